//! The bundled body with its captured walk and kneel, as `sinew demo` bakes it; the bundled hand.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use glam::DQuat;
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::fit::{Correspondence, Options, floor, retarget};
use sinew_host::import::Channel;
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Clip, Motion, Track};
use sinew_host::simplify::simplify;

use crate::root;

/// The body at rest.
///
/// # Panics
/// When the bundled file is absent or no longer sound.
#[must_use]
pub fn body() -> Avatar {
    let file = fs::read(root().join("examples/data/human.glb")).expect("the bundled body");
    let raw = read_gltf(&file, "human.glb", Path::new("")).expect("a body");
    Avatar::new(raw, "human.glb").expect("a sound body").0
}

/// Imports, fits and bakes.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn asset() -> AssetBytes {
    let baked = bake(&avatar(), &BakeOptions::default());
    baked.expect("bakes").bytes
}

/// For a small machine: 2,000 vertices, 4 influences, 16-bit shapes, the walk alone, compressed to
/// half a millimetre.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn small_asset() -> AssetBytes {
    let options = BakeOptions {
        quantised: true,
        compression: Some(5e-4),
        ..BakeOptions::default()
    };
    bake(&small_body(), &options).expect("bakes").bytes
}

/// The same with centres of rotation, tangents, and a level of 1,000 vertices.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn small_asset_of_every_mode() -> AssetBytes {
    let mut body = small_body();
    let normals = body.mesh.normals.iter().enumerate();
    let tangents = normals.map(|(vertex, normal)| {
        let [x, y, z] = normal.any_orthonormal_vector().to_array();
        [x, y, z, if vertex % 3 == 0 { -1.0 } else { 1.0 }]
    });
    body.mesh.tangents = Some(tangents.collect());
    let options = BakeOptions {
        quantised: true,
        centres: true,
        levels: vec![1000],
        ..BakeOptions::default()
    };
    bake(&body, &options).expect("bakes").bytes
}

/// The body with its walk alone, 2,000 vertices, at most 4 influences.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn small_body() -> Avatar {
    static BODY: OnceLock<Avatar> = OnceLock::new();
    let simplified = || {
        let mut body = avatar();
        body.clips.truncate(1);
        body.skin.limit(4);
        let simple = simplify(&body, 2000);
        (body.mesh, body.skin) = (simple.mesh, simple.skin);
        body
    };
    BODY.get_or_init(simplified).clone()
}

/// The body with its walk and kneel, before baking.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn avatar() -> Avatar {
    let read = |name: &str| fs::read(root().join("examples/data").join(name)).expect(name);
    let mut body = body();
    for name in ["walk", "kneel"] {
        let file = format!("{name}.bvh");
        let raw = read_bvh(&read(&file), &file).expect("a motion");
        let (motion, _) = Motion::new(raw, &file).expect("a sound motion");
        let joints = Correspondence::new(&motion.skeleton, &body.skeleton, &[]).expect("fits");
        let mut options = Options::default();
        let fit = |options: &Options| retarget(&motion, &body.skeleton, &joints, options);
        let mut fitted = fit(&options).expect("fits");
        if let Some(lift) = floor::lift(&body, &joints.target, &fitted.clip) {
            options.lift = lift;
            fitted = fit(&options).expect("fits");
        }
        fitted.clip.name = name.into();
        body.clips.push(fitted.clip);
    }
    body
}

/// The bundled VR hand of 25 joints, closing and opening; its clip compressed to half a millimetre.
///
/// # Panics
/// When the bundled file is absent or no longer sound.
#[must_use]
pub fn hand() -> AssetBytes {
    let file = fs::read(root().join("examples/data/hand.glb")).expect("the bundled hand");
    let raw = read_gltf(&file, "hand.glb", Path::new("")).expect("a hand");
    let (mut hand, _) = Avatar::new(raw, "hand.glb").expect("a sound hand");
    let times: Vec<f64> = (0..=30).map(|frame| f64::from(frame) / 30.0).collect();
    let fingers = hand.skeleton.joints.iter().enumerate();
    let tracks = fingers.filter(|(_, joint)| joint.name.contains("phalanx"));
    let tracks = tracks.map(|(index, joint)| {
        let grip = |seconds: &f64| {
            let angle = 0.6 * (1.0 - (std::f64::consts::TAU * seconds).cos());
            (joint.rest.rotation * DQuat::from_rotation_x(angle)).to_array()
        };
        let values = times.iter().map(grip).collect();
        Track::linear(index, Channel::Rotation, &times, values)
    });
    hand.clips = vec![Clip {
        name: "grip".into(),
        tracks: tracks.collect(),
        duration: 1.0,
        sample_period: Some(1.0 / 30.0),
        ..Clip::default()
    }];
    let options = BakeOptions {
        quantised: true,
        compression: Some(5e-4),
        ..BakeOptions::default()
    };
    bake(&hand, &options).expect("bakes").bytes
}
