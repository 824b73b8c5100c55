//! Scans as scanners deliver them: every fault made on purpose.

use std::time::Instant;

use glam::DVec3;
use sinew_host::fit::laplace::drive::{DriveOptions, drive};
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{RigOptions, rig};
use sinew_host::fit::laplace::suggest::spread;
use sinew_host::fit::laplace::{Pair, Pairs, Template};
use sinew_host::model::Avatar;
use sinew_tests::laplacian::{bundled_body, fitted, subdivided};
use sinew_tests::root;

/// What was done to a body.
#[derive(Debug, Default)]
struct Faults {
    doubled: usize,
    stray: usize,
    twice: usize,
    fins: usize,
    pierced: usize,
}

/// Tears a body's triangles apart, every fifth of them there twice, with strays, fins, holes and dust.
fn spoil(body: &mut Avatar) -> Faults {
    let mesh = &mut body.mesh;
    let mut faults = Faults::default();
    let copy = |mesh: &mut sinew_host::model::Mesh, vertex: u32| {
        let (p, n) = (
            mesh.positions[vertex as usize],
            mesh.normals[vertex as usize],
        );
        mesh.positions.push(p);
        mesh.normals.push(n);
        mesh.positions.len() as u32 - 1
    };
    // Three holes, far apart.
    let third = mesh.triangles.len() / 3;
    for hole in [2, 1, 0] {
        mesh.triangles.remove(hole * third);
        faults.pierced += 1;
    }
    let count = mesh.triangles.len();
    for at in (0..count).step_by(5) {
        let corners = mesh.triangles[at].map(|vertex| copy(mesh, vertex));
        mesh.triangles.push(corners);
        (faults.twice, faults.doubled) = (faults.twice + 1, faults.doubled + 3);
    }
    for at in (count / 20..count).step_by(count / 7) {
        let [a, b, _] = mesh.triangles[at];
        mesh.positions
            .push(mesh.positions[a as usize] + DVec3::new(0.0, 0.05, 0.05));
        mesh.normals.push(DVec3::Y);
        mesh.triangles.push([a, b, mesh.positions.len() as u32 - 1]);
        faults.fins += 1;
    }
    for k in 0..50 {
        mesh.positions.push(DVec3::splat(2.0 + f64::from(k)));
        mesh.normals.push(DVec3::Y);
        faults.stray += 1;
    }
    for k in 0..20 {
        let first = mesh.positions.len() as u32;
        let place = DVec3::new(0.4, 1.0, 0.02 * f64::from(k));
        mesh.positions
            .extend([place, place + 0.004 * DVec3::X, place + 0.004 * DVec3::Y]);
        mesh.normals.extend([DVec3::Y; 3]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh.parts.clear();
    faults
}

#[test]
fn every_fault_is_found_and_counted() {
    let mut body = bundled_body();
    let clean = body.mesh.positions.len();
    let faults = spoil(&mut body);
    let options = RepairOptions {
        smallest_component: 10,
        ..RepairOptions::default()
    };
    let (places, triangles) = (&body.mesh.positions, &body.mesh.triangles);
    let repaired = repair(places, triangles, &options).expect("repairs");
    let report = &repaired.report;
    println!("{}", report.lines().join("\n"));
    assert_eq!(report.welded, faults.doubled);
    assert_eq!(report.duplicate_triangles, faults.twice);
    assert_eq!(report.non_manifold_triangles, faults.fins);
    assert_eq!(report.dust, (20, 60));
    assert_eq!(report.unreferenced, faults.stray + faults.fins);
    assert_eq!((report.holes, report.components.len()), (faults.pierced, 1));
    assert_eq!(repaired.positions.len(), clean);
}

#[test]
#[ignore = "long: run in release with --ignored --nocapture"]
fn half_a_million_triangles_are_rigged() {
    let plain = bundled_body();
    let walk = fitted(&root().join("examples/data/walk.bvh"), &plain);
    let template = Template::of_body(&plain, &walk);
    let mut body = subdivided(&subdivided(&plain));
    spoil(&mut body);
    let mesh = &body.mesh;
    let start = Instant::now();
    let said = |what: &str| {
        let memory = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let peak = memory.lines().find(|line| line.starts_with("VmHWM"));
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{what}: {seconds:.1} s, {}",
            peak.unwrap_or("no peak known")
        );
    };
    println!(
        "{} vertices, {} triangles",
        mesh.positions.len(),
        mesh.triangles.len()
    );
    let options = RepairOptions {
        smallest_component: 10,
        ..RepairOptions::default()
    };
    let repaired = repair(&mesh.positions, &mesh.triangles, &options).expect("repairs");
    println!("{}", repaired.report.lines().join("\n"));
    said("repaired");
    // Vertices of the coarse body keep their numbers in the fine one.
    let points = spread(&plain.mesh.positions, &plain.mesh.triangles, 50);
    let pairs = Pairs {
        reference: Some(0),
        pairs: points
            .into_iter()
            .map(|vertex| Pair {
                point: vertex,
                vertex,
            })
            .collect(),
    };
    let driven = drive(&template, &pairs, &mesh.positions, &DriveOptions::default());
    let driven = driven.expect("drives");
    let vertices: Vec<u32> = pairs
        .vertices()
        .iter()
        .map(|&v| repaired.vertex_of[v as usize].expect("kept"))
        .collect();
    let names: Vec<String> = (0..vertices.len()).map(|k| format!("m{k}")).collect();
    let options = RigOptions::default();
    let rigged = rig(mesh, &repaired, &vertices, &names, &driven, &options).expect("rigs");
    said("rigged");
    println!("{:?}", rigged.report.held_out);
    let held_out = rigged.report.held_out.expect("poses were held out");
    assert!(held_out.percentile_99 < 5e-3);
}
