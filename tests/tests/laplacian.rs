//! Marker-driven surfaces: the core against the `f64` oracle and against the known body.

use glam::DVec3;
use sinew_core::Level;
use sinew_core::asset::Dims;
use sinew_core::deform::Output;
use sinew_core::deform::laplacian::{
    MarkerPose, TurnState, exact_workspace_len, turn_state_len,
};
use sinew_host::fit::laplace::{
    CollapseOptions, CollapseReport, ExactTables, MarkerTarget, SurfaceOptions, collapse,
};
use sinew_host::reference;
use sinew_tests::laplacian::{Scan, bundled_body, fitted};
use sinew_tests::root;

fn poses(targets: &[MarkerTarget]) -> Vec<MarkerPose> {
    let pose = |target: &MarkerTarget| MarkerPose {
        position: target.position.as_vec3().to_array(),
        rotation: target.rotation.as_quat().to_array(),
    };
    targets.iter().map(pose).collect()
}

fn dims(vertex_count: usize) -> Dims {
    Dims {
        vertex_count,
        ..Dims::default()
    }
}

/// One frame of the core from a fresh state.
fn exact_frame(tables: &ExactTables, targets: &[MarkerTarget], level: Level) -> Vec<f32> {
    let exact = tables.exact().expect("sound");
    let (rows, markers) = (exact.row_count(), exact.marker_count());
    let mut state = TurnState::with(vec![0.0; turn_state_len(markers, rows)]);
    let mut workspace = vec![0.0; exact_workspace_len(rows)];
    let mut positions = vec![0.0; 3 * rows];
    let mut output = Output::separate(&dims(rows), &mut positions, None).expect("fits");
    exact
        .step(
            &poses(targets),
            &[],
            0,
            level,
            &mut state,
            &mut workspace,
            &mut output,
        )
        .expect("sizes fit");
    positions
}

fn compare(found: &[f32], truth: &[DVec3]) -> CollapseReport {
    let pairs = found.as_chunks::<3>().0.iter().zip(truth);
    CollapseReport::new(
        pairs
            .map(|(a, b)| b.distance(DVec3::from_array(a.map(f64::from))))
            .collect(),
    )
}

fn show(what: &str, report: &CollapseReport) {
    let CollapseReport {
        mean,
        percentile_99,
        max,
    } = report;
    let [mean, p99, max] = [mean, percentile_99, max].map(|x| 1e3 * x);
    println!("{what:40} mean {mean:7.3}  p99 {p99:7.3}  max {max:7.3} mm");
}

#[test]
#[ignore = "exploration"]
fn explore() {
    let walk = root().join("examples/data/walk.bvh");
    let kneel = root().join("examples/data/kneel.bvh");
    for markers in [50, 100] {
        for stiffness in [0.01, 0.1, 1.0] {
            let start = std::time::Instant::now();
            let scan = Scan::new(bundled_body(), markers, &SurfaceOptions { stiffness });
            println!("{markers} markers, stiffness {stiffness}, set up {:?}", start.elapsed());
            let tables = scan.surface.exact().expect("packs");
            println!("  factor {} kB", tables.bilaplacian.bytes() / 1000);
            for (name, path) in [("walk", &walk), ("kneel", &kneel)] {
                let clip = fitted(path, &scan.body);
                let (mut truth_errors, mut core_errors) = (Vec::new(), Vec::new());
                for k in 0..5 {
                    let (truth, targets) = scan.at(&clip, clip.duration * f64::from(k) / 5.0);
                    let oracle = reference::laplacian::positions(&scan.surface, &targets);
                    truth_errors.extend(truth.iter().zip(&oracle).map(|(a, b)| a.distance(*b)));
                    let start = std::time::Instant::now();
                    let found = exact_frame(&tables, &targets, Level::best());
                    let report = compare(&found, &oracle);
                    core_errors.push(report.max);
                    if k == 0 {
                        println!("  frame {:?}", start.elapsed());
                    }
                }
                show(&format!("  {name} oracle against truth"), &CollapseReport::new(truth_errors));
                show(&format!("  {name} core against oracle (max)"), &CollapseReport::new(core_errors));
            }
        }
    }
}

#[test]
#[ignore = "exploration"]
fn explore_collapsed() {
    let walk = root().join("examples/data/walk.bvh");
    let kneel = root().join("examples/data/kneel.bvh");
    let scan = Scan::new(bundled_body(), 50, &SurfaceOptions::default());
    let mut fit_poses = Vec::new();
    let mut held_out = Vec::new();
    for path in [&walk, &kneel] {
        let clip = fitted(path, &scan.body);
        for k in 0..80 {
            let (_, targets) = scan.at(&clip, clip.duration * f64::from(k) / 80.0);
            if k % 4 == 2 {
                held_out.push(targets);
            } else {
                fit_poses.push(targets);
            }
        }
    }
    for (virtual_handles, handles_a_block, markers, ridge) in [
        (0, 8, 16, 1e-5),
        (0, 16, 16, 1e-5),
        (100, 8, 16, 1e-5),
        (200, 8, 16, 1e-5),
        (200, 12, 16, 1e-5),
        (200, 12, 16, 1e-7),
        (400, 8, 24, 1e-6),
    ] {
        let start = std::time::Instant::now();
        let options = CollapseOptions {
            virtual_handles,
            handles_a_block,
            markers_a_virtual_handle: markers,
            ridge,
        };
        let mesh = &scan.body.mesh;
        let tables = collapse(&scan.surface, &mesh.triangles, &mesh.normals, &fit_poses, &options)
            .expect("fits");
        println!("{options:?} {:?}", start.elapsed());
        show("  held out", &tables.compare(&scan.surface, &held_out));
    }
}
