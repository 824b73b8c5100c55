//! The area of a limb's cross-section while it twists and bends.

use glam::{DQuat, DVec3};
use sinew_core::deform::{NormalMode, SkinMode};
use sinew_core::frame::Input;
use sinew_core::pose;
use sinew_host::bake::AssetBytes;
use sinew_host::model::{Avatar, Transform};
use sinew_host::play::Player;

/// All modes with their names.
pub const MODES: [(&str, SkinMode); 3] = [
    ("linear", SkinMode::Linear),
    ("dual quaternion", SkinMode::DualQuaternion),
    ("centres", SkinMode::CentresOfRotation),
];

/// Where a plane cuts a surface at rest: it moves with the surface.
#[derive(Clone, Debug)]
pub struct Section {
    /// Two ends, each on an edge: vertices and the part of the way from the first to the second.
    segments: Vec<[(u32, u32, f64); 2]>,
    /// Square metres at rest.
    pub area: f64,
}

impl Section {
    /// Cuts the triangles that hang on these joints alone, by the plane through `point`; `None`
    /// where what comes out is not closed.
    #[must_use]
    pub fn cut(body: &Avatar, joints: &[usize], point: DVec3, normal: DVec3) -> Option<Self> {
        let on_limb = |vertex: u32| {
            let influences = body.skin.influences[vertex as usize].iter();
            let mut joint = influences.map(|&(bind, _)| body.skin.binds[bind as usize].joint);
            joint.all(|joint| joints.contains(&joint))
        };
        let height = |vertex: u32| (body.mesh.positions[vertex as usize] - point).dot(normal);
        let mut segments = Vec::new();
        for &corners in &body.mesh.triangles {
            if !corners.iter().all(|&corner| on_limb(corner)) {
                continue;
            }
            // In the triangle's sense: once down through the plane, once up.
            let (mut down, mut up) = (None, None);
            for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
                let (a, b) = (height(from), height(to));
                if a >= 0.0 && b < 0.0 {
                    down = Some((from, to, a / (a - b)));
                } else if a < 0.0 && b >= 0.0 {
                    up = Some((from, to, a / (a - b)));
                }
            }
            if let (Some(down), Some(up)) = (down, up) {
                segments.push([down, up]);
            }
        }
        let mut section = Self {
            segments,
            area: 0.0,
        };
        let gap: DVec3 = section
            .ends(|vertex| body.mesh.positions[vertex as usize])
            .map(|[from, to]| to - from)
            .sum();
        section.area = section.area_of(|vertex| body.mesh.positions[vertex as usize]);
        (section.area > 0.0 && gap.length_squared() < 1e-6 * section.area).then_some(section)
    }

    fn ends(&self, place: impl Fn(u32) -> DVec3) -> impl Iterator<Item = [DVec3; 2]> {
        let at = move |(from, to, part): (u32, u32, f64)| place(from).lerp(place(to), part);
        self.segments.iter().map(move |ends| ends.map(&at))
    }

    /// Square metres of the same curve on the moved surface.
    #[must_use]
    pub fn area_of(&self, place: impl Fn(u32) -> DVec3) -> f64 {
        let ends: Vec<[DVec3; 2]> = self.ends(place).collect();
        let middle = ends.iter().map(|[from, _]| *from).sum::<DVec3>() / ends.len().max(1) as f64;
        let twice: DVec3 = ends
            .iter()
            .map(|[from, to]| (from - middle).cross(to - middle))
            .sum();
        twice.length() / 2.0
    }
}

/// What is measured on an arm of the bundled body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// The hand turned about the forearm.
    Twist,
    /// The forearm bent at the elbow.
    Bend,
}

/// A body with sections along its left arm.
pub struct Arm<'a> {
    body: &'a Avatar,
    motion: Motion,
    joint: usize,
    axis: DVec3,
    sections: Vec<Section>,
}

impl<'a> Arm<'a> {
    /// Sections every few millimetres where the two joints share the surface.
    ///
    /// # Panics
    /// When the body has no joints of these names.
    #[must_use]
    pub fn new(body: &'a Avatar, motion: Motion) -> Self {
        let joint = |name: &str| body.skeleton.find(name).expect("the bundled body's joint");
        let [arm, forearm, hand] = ["LeftArm", "LeftForeArm", "LeftHand"].map(joint);
        let model = body.skeleton.model(&body.skeleton.rest());
        let place = |joint: usize| model[joint].translation;
        let along = (place(hand) - place(forearm)).normalize();
        let upper = (place(forearm) - place(arm)).normalize();
        // A joint's own axes may point anywhere.
        let own = |joint: usize, axis: DVec3| {
            let (_, rotation, _) = model[joint].to_scale_rotation_translation();
            rotation.inverse() * axis
        };
        let (joint, axis, limb) = match motion {
            Motion::Twist => (hand, own(hand, along), vec![forearm, hand]),
            Motion::Bend => {
                let side = upper.cross(along).normalize_or(DVec3::X);
                (forearm, own(forearm, side), vec![arm, forearm])
            }
        };
        let mut sections = Vec::new();
        for step in 0..80 {
            let beyond = f64::from(step) * 0.003;
            let cut = |from: DVec3, normal: DVec3| Section::cut(body, &limb, from, normal);
            sections.extend(match motion {
                Motion::Twist => cut(place(hand) - along * (beyond - 0.03), along),
                Motion::Bend if step < 40 => cut(place(forearm) - upper * beyond, upper),
                Motion::Bend => cut(place(forearm) + along * (beyond - 0.12), along),
            });
        }
        assert!(!sections.is_empty(), "no section of the arm is closed");
        Self {
            body,
            motion,
            joint,
            axis,
            sections,
        }
    }

    /// The joint's transform at an angle, the others at rest.
    #[must_use]
    pub fn pose(&self, degrees: f64) -> Vec<pose::Transform> {
        let mut local = self.body.skeleton.rest();
        let turn = DQuat::from_axis_angle(self.axis, degrees.to_radians());
        local[self.joint].rotation *= turn;
        let narrow = |local: &Transform| pose::Transform {
            rotation: local.rotation.as_quat(),
            translation: local.translation.as_vec3(),
            scale: local.scale.as_vec3(),
        };
        local.iter().map(narrow).collect()
    }

    /// Least area of a section over its area at rest.
    #[must_use]
    pub fn least_area(&self, positions: &[[f32; 3]]) -> f64 {
        let place = |vertex: u32| DVec3::from_array(positions[vertex as usize].map(f64::from));
        let sections = self.sections.iter();
        let areas = sections.map(|section| section.area_of(place) / section.area);
        areas.fold(f64::INFINITY, f64::min)
    }

    /// Angles worth showing, degrees.
    #[must_use]
    pub fn angles(&self) -> &'static [f64] {
        match self.motion {
            Motion::Twist => &[0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0],
            Motion::Bend => &[0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0],
        }
    }
}

/// A player of an asset with centres in a mode.
///
/// # Panics
/// When the asset is not sound or lacks centres.
#[must_use]
pub fn player(bytes: &AssetBytes, mode: SkinMode) -> Player<'_> {
    let player = Player::new(bytes.asset().expect("sound"));
    let player = player.with_modes(mode, NormalMode::Fast);
    player.expect("baked with centres")
}

/// Steps to a pose.
pub fn step(player: &mut Player<'_>, pose: &[pose::Transform]) {
    let report = player.step(&Input::Pose(pose));
    assert!(report.flags.is_empty());
}
