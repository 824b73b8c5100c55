//! Writes `tests/golden/limb_exact.sinew` and `limb_collapsed.sinew`: a limb of 2,000 vertices that
//! 24 markers bend and twist, for small devices.
//!
//! `cargo run -p sinew-tests --example limb`. The files are kept, because other machines round a
//! factorisation otherwise.

use std::fs;

use glam::DVec3;
use sinew_host::bake::{BakeOptions, bake_rig};
use sinew_host::fit::laplace::MarkerTarget;
use sinew_host::fit::laplace::align::Similarity;
use sinew_host::fit::laplace::drive::{DriveReport, Driven};
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{RigOptions, Solve, rig};
use sinew_host::model::Mesh;
use sinew_tests::laplacian::{limb_pose, tube};
use sinew_tests::root;

const RINGS: u32 = 125;
const SIDES: u32 = 16;

fn main() {
    let (positions, triangles, normals) = tube(RINGS, SIDES);
    let rings = [0, 24, 50, 74, 100, 124];
    let markers: Vec<u32> = rings
        .iter()
        .flat_map(|ring| [0, 4, 8, 12].map(|side| ring * SIDES + side))
        .collect();
    let rest: Vec<DVec3> = markers.iter().map(|&v| positions[v as usize]).collect();
    let pose = |frame: u32| -> Vec<MarkerTarget> {
        let phase = f64::from(frame) / 15.0;
        rest.iter().map(|&place| limb_pose(place, phase)).collect()
    };
    let driven = Driven {
        poses: (0..46).map(pose).collect(),
        rate: 30.0,
        report: DriveReport {
            similarity: Similarity::IDENTITY,
            misfit: 0.0,
            retargeted: false,
            plants: 0,
            slide: 0.0,
        },
    };
    let mesh = Mesh {
        name: "limb".into(),
        positions,
        normals,
        tangents: None,
        texcoords: None,
        triangles,
        parts: Vec::new(),
        morphs: Vec::new(),
    };
    let repaired = repair(&mesh.positions, &mesh.triangles, &RepairOptions::default());
    let repaired = repaired.expect("a tube needs no repair");
    let names: Vec<String> = (0..markers.len())
        .map(|marker| format!("m{marker}"))
        .collect();
    for (name, solve) in [
        ("limb_exact", Solve::Exact),
        ("limb_collapsed", Solve::Collapsed { tolerance: 1e-3 }),
    ] {
        let options = RigOptions {
            solve,
            ..RigOptions::default()
        };
        let rig = rig(&mesh, &repaired, &markers, &names, &driven, &options).expect("rigs");
        let mut options = BakeOptions::default();
        options.key_tolerance.translation = 1e-4;
        options.key_tolerance.rotation = 1e-3;
        let baked = bake_rig(&rig, &options).expect("bakes");
        let path = root().join("tests/golden").join(format!("{name}.sinew"));
        fs::write(&path, baked.bytes.as_slice()).expect("writes");
        println!(
            "{}: {} bytes, {:?}",
            path.display(),
            baked.bytes.as_slice().len(),
            rig.report
        );
    }
}
