//! The bundled body, filmed.

use std::path::Path;
use std::sync::OnceLock;

use sinew_host::fit::{Correspondence, Options, floor, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Clip, Motion};
use sinew_host::studio::{Body, Capture, Direction, FleshOptions, MarkerSet, Ring, Scene, Shot};

use crate::root;

/// The bundled human body.
///
/// # Panics
/// When the bundled file is absent or broken.
#[must_use]
pub fn human() -> &'static Avatar {
    static HUMAN: OnceLock<Avatar> = OnceLock::new();
    HUMAN.get_or_init(|| {
        let folder = root().join("examples/data");
        let bytes = std::fs::read(folder.join("human.glb")).expect("human.glb");
        let raw = read_gltf(&bytes, "human.glb", &folder).expect("a body");
        Avatar::new(raw, "human.glb").expect("a sound body").0
    })
}

/// A BVH motion carried over to [`human`], feet on the floor.
///
/// # Panics
/// When it does not fit.
#[must_use]
pub fn clip_of(bytes: &[u8]) -> Clip {
    let raw = read_bvh(bytes, "motion").expect("a motion");
    let (motion, _) = Motion::new(raw, "motion").expect("a sound motion");
    let joints = Correspondence::new(&motion.skeleton, &human().skeleton, &[]).expect("fits");
    let fit = |lift| {
        let options = Options {
            lift,
            ..Options::default()
        };
        let fitted = retarget(&motion, &human().skeleton, &joints, &options);
        fitted.expect("fits").clip
    };
    let lift = floor::lift(human(), &joints.target, &fit(0.0)).expect("feet");
    fit(lift)
}

/// A BVH file carried over to [`human`].
///
/// # Panics
/// When it cannot be read or does not fit.
#[must_use]
pub fn clip_at(path: &Path) -> Clip {
    clip_of(&std::fs::read(path).expect("a readable motion"))
}

/// Films [`human`] as `sinew studio` does: 12 cameras at 120 Hz.
///
/// # Panics
/// When the clip does not fit the body.
#[must_use]
pub fn film(clip: &Clip, markers: &MarkerSet, direction: Direction, shot: Shot) -> Capture {
    let scene = Scene {
        direction,
        flesh: FleshOptions {
            seed: shot.seed,
            ..FleshOptions::default()
        },
        ..Scene::default()
    };
    let body = Body::new(human(), clip, scene).expect("a body that moves");
    let shot = Shot {
        ring: Ring::default().reaching(body.performance().reach()),
        ..shot
    };
    shot.film(&body, markers, &|_| ()).expect("a capture")
}
