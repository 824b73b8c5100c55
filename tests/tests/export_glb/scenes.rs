//! Scenes that between them use everything that a `.glb` file can hold.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use sinew_host::export::glb::{GlbScene, write_glb};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::{
    Channel, Interpolation, RawAvatar, RawClip, RawJoint, RawMorph, RawTrack, Transform,
};
use sinew_tests::shared;

/// A scene that owns its lists.
pub struct Owned {
    pub avatar: RawAvatar,
    pub triangles: Vec<[u32; 3]>,
}

impl Owned {
    pub fn new(avatar: RawAvatar) -> Self {
        let primitives = avatar.mesh.primitives.iter();
        let corners: Vec<u32> = primitives.flat_map(|p| &p.corners).copied().collect();
        let (triangles, _) = corners.as_chunks::<3>();
        Self {
            triangles: triangles.to_vec(),
            avatar,
        }
    }

    pub fn scene(&self) -> GlbScene<'_> {
        let avatar = &self.avatar;
        GlbScene {
            name: &avatar.mesh.name,
            positions: &avatar.mesh.positions,
            normals: avatar.mesh.normals.as_deref(),
            triangles: &self.triangles,
            joints: &avatar.skeleton.joints,
            bind_joints: &avatar.skin.joints,
            inverse_bind: &avatar.skin.inverse_bind,
            influences: &avatar.skin.influences,
            morphs: &avatar.mesh.morphs,
            clips: &avatar.clips,
        }
    }

    /// Writes the scene twice and reads it back.
    pub fn round_trip(&self) -> RawAvatar {
        let bytes = write_glb(&self.scene()).expect("the scene fits together");
        assert_eq!(
            bytes,
            write_glb(&self.scene()).expect("again"),
            "the same bytes"
        );
        let again =
            read_gltf(&bytes, "written.glb", Path::new(".")).expect("what is written is readable");
        assert!(again.notices.is_empty(), "{:?}", again.notices);
        again
    }
}

fn joint(name: &str, parent: Option<usize>, translation: [f64; 3]) -> RawJoint {
    RawJoint {
        name: name.into(),
        parent,
        rest: Transform {
            translation: DVec3::from_array(translation),
            ..Transform::IDENTITY
        },
    }
}

/// A triangle with nine influences on the first vertex, two roots, a joint that serves two binds,
/// all interpolations, and morph targets of which only one has normals.
pub fn everything() -> Owned {
    let mut avatar = RawAvatar::default();
    avatar.mesh.name = "patch".into();
    avatar.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    avatar.mesh.normals = Some(vec![DVec3::Z * 3.0, DVec3::Z, DVec3::ZERO]);
    avatar.mesh.morphs = vec![
        RawMorph {
            name: "up".into(),
            positions: vec![DVec3::Y; 3],
            normals: Vec::new(),
            rest_weight: 0.25,
        },
        RawMorph {
            name: "tilt".into(),
            positions: vec![DVec3::ZERO; 3],
            normals: vec![DVec3::X; 3],
            rest_weight: 0.0,
        },
    ];
    avatar.skeleton.joints = (0..9)
        .map(|i| {
            joint(
                &format!("j{i}"),
                (i > 1).then(|| i - 1),
                [0.0, i as f64, 0.0],
            )
        })
        .collect();
    avatar.skeleton.joints[1].rest.scale = DVec3::new(1.0, 2.0, 1.0);
    avatar.skin.joints = (0..9).chain([3]).collect();
    avatar.skin.inverse_bind = (0..10)
        .map(|i| DAffine3::from_translation(DVec3::new(0.0, 0.0, i as f64)))
        .collect();
    avatar.skin.influences = vec![
        (0..9).map(|i| (i, 1.0 + f64::from(i))).collect(),
        vec![(9, 0.5), (3, 0.5)],
        vec![(8, 2.0)],
    ];
    let track = |joint, channel, interpolation, values: &[[f64; 4]]| RawTrack {
        joint,
        channel,
        interpolation,
        times: vec![0.0, 0.5],
        values: values.to_vec(),
    };
    let (a, b) = (
        DQuat::from_rotation_x(0.3).to_array(),
        DQuat::from_rotation_y(1.0).to_array(),
    );
    let rows =
        |n: usize| -> Vec<[f64; 4]> { (0..n).map(|i| [1.0 + i as f64, 1.0, 0.5, 0.0]).collect() };
    avatar.clips = vec![RawClip {
        name: "all".into(),
        tracks: vec![
            track(1, Channel::Rotation, Interpolation::Linear, &[a, b]),
            track(
                2,
                Channel::Translation,
                Interpolation::CubicSpline,
                &rows(6),
            ),
            track(3, Channel::Scale, Interpolation::Step, &rows(2)),
            track(
                4,
                Channel::Rotation,
                Interpolation::CubicSpline,
                &[[0.0; 4], a, [0.1; 4], [0.0; 4], b, [0.0; 4]],
            ),
        ],
        morph_weights: Some((
            Interpolation::Step,
            vec![0.0, 0.25],
            vec![0.0, 1.0, 0.5, 0.5],
        )),
        sample_period: None,
    }];
    let mut owned = Owned::new(avatar);
    owned.triangles = vec![[0, 1, 2], [0, 0, 1]];
    owned
}

/// A mesh that never moves.
pub fn still() -> Owned {
    let mut scene = everything();
    scene.avatar.skeleton.joints.clear();
    scene.avatar.skin = Default::default();
    scene.avatar.clips.clear();
    scene.avatar.mesh.normals = None;
    scene
}

/// A skeleton in motion without a mesh.
pub fn bare() -> Owned {
    let mut scene = everything();
    scene.avatar.mesh = Default::default();
    scene.avatar.skin = Default::default();
    scene.avatar.clips[0].morph_weights = None;
    scene.triangles.clear();
    scene
}

/// More vertices and joints than the narrow index types hold.
pub fn wide() -> Owned {
    let count = 70_000_u32;
    let mut avatar = RawAvatar::default();
    avatar.mesh.name = "fan".into();
    let angle = |i: u32| f64::from(i) / f64::from(count);
    let point = |i| DVec3::new(angle(i).cos(), angle(i).sin(), 0.0);
    avatar.mesh.positions = (0..count).map(point).collect();
    avatar.skeleton.joints = (0..300)
        .map(|i: usize| joint("", i.checked_sub(1), [0.0, 0.01, 0.0]))
        .collect();
    avatar.skin.joints = (0..300).collect();
    avatar.skin.inverse_bind = vec![DAffine3::IDENTITY; 300];
    let pair = |i| vec![(i % 300, 0.7), ((i + 1) % 300, 0.3)];
    avatar.skin.influences = (0..count).map(pair).collect();
    let mut owned = Owned::new(avatar);
    owned.triangles = (1..count - 1).map(|i| [0, i, i + 1]).collect();
    owned
}

/// Real files, where they are present.
pub fn real() -> Vec<(&'static str, Owned)> {
    let names = ["cesium_man", "rigged_simple", "MorphStressTest"];
    let read = |name| {
        let path = shared(&format!("mesh/{name}.gltf"))?;
        let bytes = std::fs::read(path).expect("the file was found");
        let avatar = read_gltf(&bytes, name, Path::new(".")).expect("real files are readable");
        Some((name, Owned::new(avatar)))
    };
    names.into_iter().filter_map(read).collect()
}
