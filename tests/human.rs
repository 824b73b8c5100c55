//! The bundled body with its captured walk and kneel, as `sinew demo` bakes it.

use std::fs;
use std::path::Path;

use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::fit::{Correspondence, Options, floor, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Motion};
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

fn small_body() -> Avatar {
    let mut body = avatar();
    body.clips.truncate(1);
    body.skin.limit(4);
    let simple = simplify(&body, 2000);
    (body.mesh, body.skin) = (simple.mesh, simple.skin);
    body
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
