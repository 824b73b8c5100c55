//! The bundled body in T-pose, whole and cut into fifteen rigid parts with gaps between them, as
//! people cut bodies by hand.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use sinew_host::import::{Channel, Interpolation};
use sinew_host::model::{Avatar, Clip, Mesh, Part, Skeleton, Track, vertex_normals};
use sinew_host::reference::skin::linear_blend;

/// Name of each part and the joints whose skin it takes.
const PARTS: [(&str, &[&str]); 15] = [
    ("Hips", &["Hips", "LHipJoint", "RHipJoint", "LowerBack"]),
    (
        "Torso",
        &["Spine", "Spine1", "LeftShoulder", "RightShoulder", "Neck"],
    ),
    ("Head", &["Neck1", "Head"]),
    ("LeftUpperArm", &["LeftArm"]),
    ("LeftForeArm", &["LeftForeArm"]),
    (
        "LeftHand",
        &["LeftHand", "LThumb", "LeftFingerBase", "LeftHandFinger1"],
    ),
    ("RightUpperArm", &["RightArm"]),
    ("RightForeArm", &["RightForeArm"]),
    (
        "RightHand",
        &["RightHand", "RThumb", "RightFingerBase", "RightHandFinger1"],
    ),
    ("LeftThigh", &["LeftUpLeg"]),
    ("LeftShin", &["LeftLeg"]),
    ("LeftFoot", &["LeftFoot", "LeftToeBase"]),
    ("RightThigh", &["RightUpLeg"]),
    ("RightShin", &["RightLeg"]),
    ("RightFoot", &["RightFoot", "RightToeBase"]),
];

/// The body with its arms turned so that upper arm and forearm point along `left` (of the right arm:
/// its mirror image), its skeleton too.
///
/// # Panics
/// For a body that is not the bundled one.
#[must_use]
pub fn with_arms(body: &Avatar, left: DVec3) -> Avatar {
    let find = |name: &str| {
        body.skeleton
            .find(name)
            .expect("a joint of the bundled body")
    };
    let model = body.skeleton.model(&body.skeleton.rest());
    let at = |joint: usize| model[joint].translation;
    let mut turn = vec![DQuat::IDENTITY; model.len()];
    for (side, sign) in [("Left", 1.0), ("Right", -1.0)] {
        let [arm, forearm, hand] =
            ["Arm", "ForeArm", "Hand"].map(|part| find(&format!("{side}{part}")));
        let wanted = left.normalize() * DVec3::new(sign, 1.0, 1.0);
        for (from, to) in [(arm, forearm), (forearm, hand)] {
            turn[from] = DQuat::from_rotation_arc((at(to) - at(from)).normalize(), wanted);
        }
    }
    let mut local = body.skeleton.rest();
    let mut whole: Vec<DQuat> = Vec::new();
    for (joint, local) in body.skeleton.joints.iter().zip(&mut local) {
        let above = joint.parent.map_or(DQuat::IDENTITY, |parent| whole[parent]);
        let own = turn[whole.len()];
        // All joints of the bundled body are parallel to the axes at rest.
        let own = if own == DQuat::IDENTITY { above } else { own };
        local.rotation = above.inverse() * own;
        whole.push(own);
    }
    let posed = body.skeleton.model(&local);
    let places: Vec<DVec3> = posed.iter().map(|joint| joint.translation).collect();
    let mut out = body.clone();
    (out.mesh.positions, _) = linear_blend(&body.mesh, &body.skin, &posed);
    out.mesh.normals = vertex_normals(&out.mesh.positions, &out.mesh.triangles);
    out.skeleton = sinew_host::fit::rig::parallel(&body.skeleton, &places);
    for (bind, place) in out
        .skin
        .binds
        .iter_mut()
        .zip(out.skeleton.model(&out.skeleton.rest()))
    {
        bind.inverse_bind = place.inverse();
    }
    out.clips.clear();
    out
}

/// The mesh of the body in parts; triangles between two parts are left out.
///
/// # Panics
/// For a body that is not the bundled one.
#[must_use]
pub fn cut(body: &Avatar) -> Mesh {
    let part_of_joint: Vec<usize> = body
        .skeleton
        .joints
        .iter()
        .map(|joint| {
            let own = |(_, joints): &(&str, &[&str])| joints.contains(&joint.name.as_str());
            PARTS
                .iter()
                .position(own)
                .expect("a joint of the bundled body")
        })
        .collect();
    let part_of = |vertex: u32| {
        let mut weights = [0.0; PARTS.len()];
        for &(bind, weight) in &body.skin.influences[vertex as usize] {
            weights[part_of_joint[body.skin.binds[bind as usize].joint]] += weight;
        }
        (0..PARTS.len())
            .max_by(|&a, &b| weights[a].total_cmp(&weights[b]))
            .unwrap_or(0)
    };
    let mut out = Mesh {
        name: "cut".into(),
        positions: Vec::new(),
        normals: Vec::new(),
        tangents: None,
        texcoords: None,
        triangles: Vec::new(),
        parts: Vec::new(),
        morphs: Vec::new(),
    };
    for (at, (name, _)) in PARTS.iter().enumerate() {
        let first = out.triangles.len();
        let mut number = BTreeMap::new();
        for corners in &body.mesh.triangles {
            if corners.iter().any(|&vertex| part_of(vertex) != at) {
                continue;
            }
            let corners = corners.map(|vertex| {
                *number.entry(vertex).or_insert_with(|| {
                    out.positions.push(body.mesh.positions[vertex as usize]);
                    out.normals.push(body.mesh.normals[vertex as usize]);
                    out.positions.len() as u32 - 1
                })
            });
            out.triangles.push(corners);
        }
        out.parts.push(Part {
            name: (*name).into(),
            triangles: first..out.triangles.len(),
        });
    }
    out
}

/// Every joint in turn bent both ways about every axis, one second each.
#[must_use]
pub fn range_of_motion(skeleton: &Skeleton, degrees: f64) -> Clip {
    let mut tracks = Vec::new();
    let mut now = 0.0;
    for joint in 1..skeleton.joints.len() {
        let (mut times, mut values) = (vec![now], vec![DQuat::IDENTITY.to_array()]);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for angle in [degrees, -degrees] {
                now += 1.0;
                times.push(now);
                let turn = DQuat::from_axis_angle(axis, angle.to_radians());
                values.push(turn.to_array());
            }
        }
        now += 1.0;
        times.push(now);
        values.push(DQuat::IDENTITY.to_array());
        tracks.push(Track {
            joint,
            channel: Channel::Rotation,
            interpolation: Interpolation::Linear,
            times,
            values,
        });
    }
    Clip {
        name: "range of motion".into(),
        tracks,
        morph_track: None,
        duration: now,
        sample_period: None,
    }
}
