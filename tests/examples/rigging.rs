//! Automatic weights and skeletons against those of artists.
//!
//!     cargo run --release -p sinew-tests --example rigging -- sheet.png
//!
//! The picture shows the artist's skin, smooth and simple weights on the artist's joints, and smooth
//! weights on fitted joints, coloured by their distance from the artist's.

use std::time::Instant;

use sinew_host::export::png::write_png;
use sinew_host::export::render::Image;
use sinew_host::fit::humanoid::{PARTS, SIDES};
use sinew_host::fit::rig::fit_skeleton;
use sinew_host::fit::weights::{Method, WeightOptions, weigh};
use sinew_host::fit::{Humanoid, Which};
use sinew_host::model::{Avatar, Motion, Skeleton};
use sinew_tests::bare::{bundled, carried, difference, poses, side_by_side};
use sinew_tests::{human, shared};

const METHODS: [Method; 2] = [Method::Simple, Method::Smooth];

fn main() {
    let body = human::body();
    let motions = ["walk.bvh", "kneel.bvh"].map(bundled);
    println!("the artist's joints");
    for method in METHODS {
        for influences in [1, 2, 4, 8] {
            let options = WeightOptions {
                method,
                influences,
                ..WeightOptions::default()
            };
            let start = Instant::now();
            let weighed = weigh(&body.mesh, &body.skeleton, &options).expect("weighs");
            let seconds = start.elapsed().as_secs_f64();
            println!("{method:?}, {influences} influences, {seconds:.2} s");
            for motion in &motions {
                let clip = carried(motion, &body.skeleton);
                let poses = poses(&body.skeleton, &clip, 10);
                let truth = (&body.skin, poses.as_slice());
                let found = difference(&body.mesh, truth, (&weighed.skin, &poses));
                println!("  {}: {found}", motion.clip.name);
            }
        }
    }
    if let Some(path) = std::env::args().nth(1) {
        write_png(&path, &sheet(&body, &motions)).expect("writes");
    }
    let mut sources = vec![("its own".to_owned(), body.skeleton.clone(), Vec::new())];
    let others = [
        "cmu_12_01_walk.bvh",
        "mixamo_tabs_freebvh.bvh",
        "cmu_01_01.bvh",
    ];
    let others = others
        .iter()
        .filter_map(|name| shared(&format!("bvh/{name}")));
    for motion in motions
        .iter()
        .cloned()
        .chain(others.map(|path| sinew_tests::bare::motion(&path)))
    {
        sources.push((motion.clip.name.clone(), motion.skeleton, motion.end_sites));
    }
    for (name, skeleton, ends) in &sources {
        println!("joints fitted, hierarchy of {name}");
        let start = Instant::now();
        let fitted = match fit_skeleton(&body.mesh, skeleton, ends) {
            Ok(fitted) => fitted,
            Err(error) => {
                println!("  {error}");
                continue;
            }
        };
        println!("  {:.2} s", start.elapsed().as_secs_f64());
        off(&body.skeleton, &fitted.skeleton);
        for method in METHODS {
            let options = WeightOptions {
                method,
                ..WeightOptions::default()
            };
            let weighed = weigh(&body.mesh, &fitted.skeleton, &options).expect("weighs");
            println!("  {method:?}, idle: {}", weighed.idle.len());
            for motion in &motions {
                let [own, other] = [&body.skeleton, &fitted.skeleton]
                    .map(|skeleton| poses(skeleton, &carried(motion, skeleton), 10));
                let found = difference(&body.mesh, (&body.skin, &own), (&weighed.skin, &other));
                println!("    {}: {found}", motion.clip.name);
            }
        }
    }
}

fn sheet(body: &Avatar, motions: &[Motion]) -> Image {
    let fitted = fit_skeleton(&body.mesh, &body.skeleton, &[])
        .expect("fits")
        .skeleton;
    let weights = |skeleton: &Skeleton, method| {
        let options = WeightOptions {
            method,
            ..WeightOptions::default()
        };
        weigh(&body.mesh, skeleton, &options).expect("weighs").skin
    };
    let poses = |skeleton: &Skeleton| {
        let of = |motion| poses(skeleton, &carried(motion, skeleton), 20);
        let all: Vec<_> = motions.iter().flat_map(of).collect();
        [1, 5, 12, 16, 20].map(|at| all[at].clone())
    };
    let (own, other) = (poses(&body.skeleton), poses(&fitted));
    let smooth = weights(&body.skeleton, Method::Smooth);
    let simple = weights(&body.skeleton, Method::Simple);
    let both = weights(&fitted, Method::Smooth);
    side_by_side(
        &body.mesh,
        &[
            ("artist", &body.skin, &own),
            ("smooth", &smooth, &own),
            ("simple", &simple, &own),
            ("smooth, joints fitted", &both, &other),
        ],
    )
}

/// Says how far joints of the same role are from the artist's.
fn off(truth: &Skeleton, found: &Skeleton) {
    let places = |skeleton: &Skeleton| skeleton.model(&skeleton.rest());
    let (own, other) = (places(truth), places(found));
    let [truth, found] = [truth, found].map(|s| Humanoid::new(s, Which::Target).expect("human"));
    for part in PARTS {
        let pairs = SIDES.map(|side| Some((truth.limb(side, part)?, found.limb(side, part)?)));
        let off = pairs.iter().flatten().map(|&(a, b)| {
            let off = 1e3 * (other[b].translation - own[a].translation);
            format!("{:.0} mm ({:.0})", off.length(), off)
        });
        println!("  {part:?}: {}", off.collect::<Vec<_>>().join(", "));
    }
    for (what, a, b) in [("hips", truth.hips, found.hips)]
        .into_iter()
        .chain(
            truth
                .neck
                .iter()
                .zip(&found.neck)
                .map(|(&a, &b)| ("neck", a, b)),
        )
        .chain(
            truth
                .spine
                .iter()
                .zip(&found.spine)
                .map(|(&a, &b)| ("spine", a, b)),
        )
    {
        let off = 1e3 * (other[b].translation - own[a].translation);
        println!("  {what}: {:.0} mm ({off:.0})", off.length());
    }
}
