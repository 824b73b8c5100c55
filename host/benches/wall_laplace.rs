//! Wall-clock ratios of marker-driven surfaces: `cargo bench -p sinew-host --bench wall_laplace`.
//!
//! Each row times its candidates in turn, round after round, and takes the median of each, so that
//! what else the machine does hits all alike. Ratios count; times hold for this machine only. A row
//! has about twice as many triangles as vertices: 5 k and 15 k are 10 k and 30 k triangles.

use std::hint::black_box;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use sinew_core::Level;
use sinew_core::asset::Dims;
use sinew_core::deform::laplacian::{MarkerPose, TurnState, exact_workspace_len, turn_state_len};
use sinew_core::deform::{Output, PlainMesh, SkinJob, skin_plain};
use sinew_host::bake::{BakeOptions, bake};
use sinew_host::fit::laplace::graph::Graph;
use sinew_host::fit::laplace::{CollapseOptions, MarkerTarget, Surface, SurfaceOptions, collapse};
use sinew_host::model::{Avatar, Bind, Joint, Mesh, Skeleton, Skin, Transform};

const ROUNDS: usize = 15;
const MARKERS: usize = 50;

/// A closed, dented surface with as many vertices as asked for: rings around a bent axis.
fn surface(vertices: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let sides = ((vertices as f64 / 4.0).sqrt() as usize).max(3);
    let rings = vertices / sides;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let (u, v) = (
                std::f64::consts::TAU * ring as f64 / rings as f64,
                std::f64::consts::TAU * side as f64 / sides as f64,
            );
            let radius = 0.12 + 0.02 * (5.0 * u).sin() * (2.0 * v).cos();
            let out = DVec3::new(u.cos(), 0.3 * (2.0 * u).sin(), u.sin());
            positions.push(0.6 * out + radius * (v.cos() * out + v.sin() * DVec3::Y));
            let at = |r: usize, s: usize| ((r % rings) * sides + s % sides) as u32;
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    (positions, triangles)
}

/// Medians of candidates that take turns, seconds.
fn medians<const N: usize>(mut candidates: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut times = vec![Vec::new(); N];
    for round in 0..=ROUNDS {
        for (candidate, times) in candidates.iter_mut().zip(&mut times) {
            let start = Instant::now();
            candidate();
            // The first round warms up.
            if round > 0 {
                times.push(start.elapsed().as_secs_f64());
            }
        }
    }
    std::array::from_fn(|k| {
        times[k].sort_by(f64::total_cmp);
        times[k][ROUNDS / 2]
    })
}

fn targets(surface: &Surface, turn: f64) -> Vec<MarkerTarget> {
    let bend = |p: DVec3| DQuat::from_rotation_y(turn * p.x);
    let rest = surface.marker_rest();
    let target = |&p: &DVec3| MarkerTarget {
        position: bend(p) * p,
        rotation: bend(p),
    };
    rest.iter().map(target).collect()
}

/// A body whose joints are the markers, each vertex on the eight heaviest.
fn eight_joints(surface: &Surface, triangles: &[[u32; 3]]) -> Avatar {
    let rest = surface.marker_rest();
    let influences = |vertex: usize| {
        let weights = surface
            .weights
            .iter()
            .map(|weights| weights[vertex].max(1e-6));
        let mut heaviest: Vec<(u32, f64)> = (0..).zip(weights).collect();
        heaviest.sort_by(|a, b| b.1.total_cmp(&a.1));
        heaviest.truncate(8);
        let sum: f64 = heaviest.iter().map(|pair| pair.1).sum();
        heaviest
            .iter()
            .map(|&(marker, weight)| (marker, weight / sum))
            .collect()
    };
    let joint = |(at, place): (usize, &DVec3)| Joint {
        name: format!("marker {at}"),
        parent: None,
        rest: Transform {
            translation: *place,
            ..Transform::IDENTITY
        },
    };
    let bind = |(joint, place): (usize, &DVec3)| Bind {
        joint,
        inverse_bind: DAffine3::from_translation(-*place),
    };
    let count = surface.positions.len();
    Avatar {
        mesh: Mesh {
            name: String::new(),
            positions: surface.positions.clone(),
            normals: vec![DVec3::Y; count],
            tangents: None,
            texcoords: None,
            triangles: triangles.to_vec(),
            parts: Vec::new(),
            morphs: Vec::new(),
        },
        skeleton: Skeleton {
            joints: rest.iter().enumerate().map(joint).collect(),
        },
        skin: Skin {
            binds: rest.iter().enumerate().map(bind).collect(),
            influences: (0..count).map(influences).collect(),
        },
        clips: Vec::new(),
    }
}

fn row(vertices: usize) {
    let (positions, triangles) = surface(vertices);
    let count = positions.len();
    let markers = Graph::new(&positions, &triangles).spread(&[0], MARKERS);
    let options = SurfaceOptions::default();
    let surface = Surface::new(positions, &triangles, markers, &options).expect("factors");
    let tables = surface.exact().expect("packs");
    let exact = tables.exact().expect("sound");
    let packed = &tables.bilaplacian;
    let factor = packed.factor().expect("sound");
    let level = Level::best();

    let right = vec![[1e-3_f32, 2e-3, 3e-3, 0.0]; count];
    let mut x = right.clone();
    let mut columns = vec![1e-3; 3 * count];
    let mut solve = || {
        x.copy_from_slice(&right);
        factor.solve(black_box(&mut x), level);
    };
    let mut faer = || {
        columns.fill(1e-3);
        surface.bilaplacian.solve(black_box(&mut columns));
    };
    let mut read = || {
        for _ in 0..2 {
            let mut sums = [[0.0_f32; 4]; 4];
            for quads in black_box(&packed.values[..]).chunks_exact(4) {
                for (sum, quad) in sums.iter_mut().zip(quads) {
                    for (sum, x) in sum.iter_mut().zip(quad) {
                        *sum += x;
                    }
                }
            }
            let rows = black_box(&packed.rows[..]).iter().flatten();
            black_box((sums, rows.fold(0, |sum: u32, &row| sum.wrapping_add(row))));
        }
    };
    let [solve, faer, read] = medians([&mut solve, &mut faer, &mut read]);

    let fit: Vec<_> = (0..12)
        .map(|k| targets(&surface, f64::from(k - 6) * 0.1))
        .collect();
    let normals = vec![DVec3::Y; count];
    let collapsed = collapse(
        &surface,
        &triangles,
        &normals,
        &fit,
        &CollapseOptions::default(),
    );
    let collapsed = collapsed.expect("fits");
    let collapsed = collapsed.collapsed().expect("sound");
    let poses: Vec<MarkerPose> = targets(&surface, 0.5)
        .iter()
        .map(|target| MarkerPose {
            position: target.position.as_vec3().to_array(),
            rotation: target.rotation.as_quat().to_array(),
        })
        .collect();
    let dims = Dims {
        vertex_count: count,
        ..Dims::default()
    };
    let mut buffers = [(); 4].map(|()| (vec![0.0; 3 * count], vec![0.0; 3 * count]));
    let [one, two, three, four] = &mut buffers;
    let mut output_one = Output::separate(&dims, &mut one.0, None).expect("fits");
    let mut output_two = Output::separate(&dims, &mut two.0, Some(&mut two.1)).expect("fits");
    let mut output_three = Output::separate(&dims, &mut three.0, Some(&mut three.1)).expect("fits");
    let mut state = TurnState::with(vec![0.0; turn_state_len(MARKERS, count)]);
    let mut workspace = vec![0.0; exact_workspace_len(count)];
    let mut exact_frame = || {
        let output = &mut output_one;
        let report = exact.step(&poses, 0, level, &mut state, &mut workspace, output);
        black_box(report.expect("sizes fit"));
    };
    let state_len = turn_state_len(MARKERS, collapsed.virtual_count());
    let mut few = TurnState::with(vec![0.0; state_len]);
    let mut handles = vec![[0.0; 12]; collapsed.handle_count()];
    let mut collapsed_frame = || {
        let report = collapsed.handles(&poses, &mut few, &mut handles);
        black_box(report.expect("sizes fit"));
        collapsed.blocks(&handles, 0..usize::MAX, level, &mut output_two);
    };
    // Eight influences on every vertex, in a plain loop over vertices.
    let plain_positions: Vec<[f32; 3]> = surface
        .positions
        .iter()
        .map(|p| p.as_vec3().to_array())
        .collect();
    let plain_normals = vec![[0.0, 1.0, 0.0]; count];
    let binds: Vec<u16> = (0..8 * count)
        .map(|k| (k % 8 + k / (64 * count / MARKERS)) as u16 % 50)
        .collect();
    let weights = vec![0.125; 8 * count];
    let palette = vec![sinew_core::math::IDENTITY; MARKERS];
    let mesh = PlainMesh::new(&plain_positions, &plain_normals, &binds, &weights, 8);
    let mesh = mesh.expect("lengths fit");
    let mut skinned = || skin_plain(&mesh, black_box(&palette), &mut output_three);
    // The same vertices with the eight heaviest markers of each as joints, baked into blocks.
    let body = eight_joints(&surface, &triangles);
    let baked = bake(&body, &BakeOptions::default()).expect("bakes");
    let asset = baked.bytes.asset().expect("sound");
    let mut output_four = Output::separate(&dims, &mut four.0, Some(&mut four.1)).expect("fits");
    let job = SkinJob {
        level,
        ..SkinJob::linear(&palette)
    };
    let mut blocks = || job.run(&asset, 0..usize::MAX, black_box(&mut output_four));
    let [whole, stream, skinning, blocks] = medians([
        &mut exact_frame,
        &mut collapsed_frame,
        &mut skinned,
        &mut blocks,
    ]);

    println!(
        "wall_laplace_{count:<6} factor {:6.2} MB  solve {:6.2} ms  faer / solve {:5.2}  solve / read twice {:5.2}  | \
         exact frame {:6.2} ms {:6.0} fps  collapsed {:6.3} ms {:6.0} fps  collapsed / 8 influences: plain {:4.2}, blocks {:4.2}",
        packed.bytes() as f64 / 1e6,
        1e3 * solve,
        faer / solve,
        solve / read,
        1e3 * whole,
        1.0 / whole,
        1e3 * stream,
        1.0 / stream,
        stream / skinning,
        stream / blocks,
    );
}

fn main() {
    for vertices in [5_000, 15_000, 27_000, 50_000] {
        row(vertices);
    }
}
