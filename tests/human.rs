//! The bundled body with its captured walk and kneel, as `sinew demo` bakes it.

use std::fs;
use std::path::Path;

use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::fit::{Correspondence, Options, floor, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Motion};

use crate::root;

/// Imports, fits and bakes.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn asset() -> AssetBytes {
    let baked = bake(&avatar(), &BakeOptions::default());
    baked.expect("bakes").bytes
}

/// The body with both clips, before baking.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn avatar() -> Avatar {
    let read = |name: &str| fs::read(root().join("examples/data").join(name)).expect(name);
    let raw = read_gltf(&read("human.glb"), "human.glb", Path::new("")).expect("a body");
    let (mut body, _) = Avatar::new(raw, "human.glb").expect("a sound body");
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
