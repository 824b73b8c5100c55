//! The table of figure 7 of Park & Hodgins 2006, in millimetres, on a virtual capture.
//!
//! `cargo run --release -p sinew-host --example figure7 -- [--out DIR] [--markers N]`
//!
//! A skin is learnt from some motions of a body that bulges, breathes and jiggles, and compared
//! with the true surface in others.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use sinew_core::deform::parts::ExactBudget;
use sinew_host::fit::parts::corrective_skin::{
    CorrectivePlayer, CorrectiveSkin, Performed, core_palette, learn_skin, palette,
};
use sinew_host::fit::parts::{Glued, Learnt, Mode, Options, Segments, learn, marker_frame};
use sinew_host::fit::{self, Correspondence, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Clip, Motion};
use sinew_host::studio::{Body, MarkerLayout, MarkerSet, Scene, Surface};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let (mut out, mut count) = (None, 350);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or("an option needs a value")?;
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value)),
            "--markers" => count = value.parse()?,
            other => return Err(format!("{other}: give --out DIR or --markers N").into()),
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let bytes = std::fs::read(root.join("examples/data/human.glb"))?;
    let (body, _) = Avatar::new(read_gltf(&bytes, "human.glb", Path::new(""))?, "human.glb")?;
    let clip = |path: &str| -> Result<Option<Clip>, Failure> {
        let path = root.join(path);
        if !path.exists() {
            println!("SKIPPED: {} is not here", path.display());
            return Ok(None);
        }
        let (motion, _) = Motion::new(read_bvh(&std::fs::read(&path)?, "motion")?, "motion")?;
        let map = Correspondence::new(&motion.skeleton, &body.skeleton, &[])?;
        Ok(Some(
            retarget(&motion, &body.skeleton, &map, &fit::Options::default())?.clip,
        ))
    };
    let learnt_from = [
        clip("examples/data/kneel.bvh")?,
        clip("../shared/data/bvh/cmu_01_01.bvh")?,
    ];
    let held_out = [
        clip("examples/data/walk.bvh")?,
        clip("../shared/data/bvh/cmu_12_01_walk.bvh")?,
        clip("../shared/data/bvh/mocapbank_crlf.bvh")?,
    ];
    let set = MarkerSet::new(&body, MarkerLayout::Dense(count), 0)?;
    let glued: Vec<Glued> = set
        .markers
        .iter()
        .map(|marker| Glued {
            vertices: marker.vertices,
            weights: marker.barycentric,
        })
        .collect();
    let segments = Segments::of_rig(&body, &glued);
    println!(
        "{} parts: {}",
        segments.part_count(),
        segments.names.join(", ")
    );

    let mut frames = Vec::new();
    for clip in learnt_from.iter().flatten() {
        let film = Body::new(
            &body,
            clip,
            Scene {
                rate: 60.0,
                ..Scene::default()
            },
        )?;
        let step = (film.frame_count() / 120).max(1);
        for frame in (0..film.frame_count()).step_by(step) {
            frames.push(set.positions(&film.surface(frame)));
        }
    }
    let start = Instant::now();
    let options = Options {
        frames: 240,
        ..Options::default()
    };
    let rest: Vec<DVec3> = glued
        .iter()
        .map(|marker| marker.on(&body.mesh.positions))
        .collect();
    let learnt = learn(&body.mesh, &segments, (&glued, &rest), &frames, &options)?;
    println!(
        "learnt from {} frames in {:.1} s",
        frames.len(),
        start.elapsed().as_secs_f64()
    );

    let mut truth = Vec::new();
    for clip in held_out.iter().flatten() {
        truth.extend(windows(&Body::new(
            &body,
            clip,
            Scene {
                rate: 60.0,
                ..Scene::default()
            },
        )?));
    }
    println!(
        "{} held-out frames\n",
        truth.iter().map(Vec::len).sum::<usize>()
    );
    let counted = carried(&body);
    let all = counted.len();
    let fingers = counted.iter().filter(|counted| !**counted).count();
    println!("without {fingers} of {all} vertices: fingers, which no marker can know\n");
    for noise in [0.0, 0.5e-3] {
        let mut regions = Vec::new();
        println!("marker noise {:.1} mm", 1e3 * noise);
        println!(
            "{:22} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8}",
            "mode", "mean", "p95", "max", "marker", "jitter", "noise", "normals"
        );
        for (name, mode, budget) in MODES {
            let row = measure(&learnt, mode, budget, &truth, &set, noise, &counted)?;
            println!(
                "{name:22} {:7.2} {:7.2} {:7.1} {:7.2} {:7.3} {:7.2} {:7.2}°",
                row.mean, row.percentile_95, row.max, row.marker, row.jitter, row.noise, row.normal
            );
            regions.push((name, row.by_vertex));
        }
        println!();
        if noise == 0.0 {
            by_joint(&body, &regions);
        }
    }
    correctives(
        &body,
        &segments,
        (&glued, &rest),
        &set,
        &learnt_from,
        &held_out,
    )?;
    dem_bones(&root)?;
    speed(&learnt, &body, &set.positions(&truth[0][0]))?;
    if let Some(folder) = out {
        sheets(&learnt, &body, &truth, &set, &folder)?;
    }
    Ok(())
}

/// What correctives leave of the error of the skeleton alone, on motion held out.
fn correctives(
    body: &Avatar,
    segments: &Segments,
    glued: (&[Glued], &[DVec3]),
    set: &MarkerSet,
    learnt_from: &[Option<Clip>],
    held_out: &[Option<Clip>],
) -> Result<(), Failure> {
    let scene = Scene {
        rate: 60.0,
        ..Scene::default()
    };
    let mut performances = Vec::new();
    for clip in learnt_from.iter().flatten() {
        let film = Body::new(body, clip, scene)?;
        let frames = 0..film.frame_count().min(900);
        performances.push(Performed {
            rate: 60.0,
            poses: frames.clone().map(|frame| film.pose(frame)).collect(),
            markers: frames
                .map(|frame| set.positions(&film.surface(frame)))
                .collect(),
        });
    }
    for most in [4, 8] {
        let skin = learn_skin(body, segments, glued, &performances, most)?;
        println!(
            "correctives: {} terms, {:.1} markers a block",
            skin.data.features.len(),
            skin.slots.markers_a_block()
        );
        let (mut alone, mut with, mut count) = (0.0, 0.0, 0.0);
        let mut time = [Vec::new(), Vec::new()];
        let bare = CorrectiveSkin {
            slots: sinew_host::fit::parts::SlotTables {
                starts: vec![0; skin.slots.starts.len()],
                ..Default::default()
            },
            ..skin.clone()
        };
        for clip in held_out.iter().flatten() {
            let film = Body::new(body, clip, scene)?;
            let binds = body.skin.binds.len();
            let mut player = CorrectivePlayer::new(&skin, binds)?;
            let mut skeleton = CorrectivePlayer::new(&bare, binds)?;
            for frame in 0..film.frame_count().min(360) {
                let palette = core_palette(&palette(body, &film.pose(frame)));
                for (player, time) in [&mut player, &mut skeleton].into_iter().zip(&mut time) {
                    let start = Instant::now();
                    player.step(&palette, 1.0 / 60.0);
                    time.push(start.elapsed().as_secs_f64());
                }
                if frame % 6 != 0 {
                    continue;
                }
                let truth = film.surface(frame).positions;
                let bones = film.skeleton_surface(frame).positions;
                for ((truth, bones), found) in truth.iter().zip(&bones).zip(player.positions()) {
                    alone += truth.distance(*bones);
                    with += truth.distance(DVec3::from_array(found.map(f64::from)));
                    count += 1.0;
                }
            }
        }
        let [with_time, bare_time] = time.map(median);
        println!(
            "  skeleton alone {:.2} mm, with correctives {:.2} mm: {:.0} % removed, at {:.2} x its cost\n",
            1e3 * alone / count,
            1e3 * with / count,
            100.0 * (1.0 - with / alone),
            with_time / bare_time
        );
    }
    Ok(())
}

/// A published vertex sequence that no linear skinning reproduces: markers on it, every second
/// frame learnt from, the others compared.
fn dem_bones(root: &Path) -> Result<(), Failure> {
    const COUNTS: [usize; 2] = [400, 754];
    const MARKERS: usize = 120;
    let folder = root.join("../shared/data/vertex_seq/dem_bones");
    if !folder.exists() {
        println!("SKIPPED: {} is not here", folder.display());
        return Ok(());
    }
    let numbers = std::fs::read(folder.join("bone_anim_400x754x3_f32le.bin"))?;
    let numbers: Vec<f64> = numbers
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
        .collect();
    let frames: Vec<Vec<DVec3>> = numbers
        .chunks_exact(3 * COUNTS[1])
        .map(|frame| frame.chunks_exact(3).map(DVec3::from_slice).collect())
        .collect();
    let text = std::fs::read(folder.join("bone_rest.obj"))?;
    let (raw, _) = sinew_host::import::read_obj(&text, "bone_rest.obj", 1.0)?;
    let (mut mesh, _) = sinew_host::model::Mesh::new(raw, "bone_rest.obj")?;
    if mesh.positions.len() != COUNTS[1] {
        return Err(format!("the mesh has {} vertices", mesh.positions.len()).into());
    }
    mesh.positions.clone_from(&frames[0]);
    let weights = std::fs::read_to_string(folder.join("bone_weights.csv"))?;
    let rows: Vec<Vec<f64>> = weights
        .lines()
        .filter_map(|line| {
            line.split(',')
                .map(|cell| cell.trim().parse().ok())
                .collect()
        })
        .collect();
    let rows: Vec<&[f64]> = rows
        .iter()
        .map(|row| &row[row.len().saturating_sub(6)..])
        .collect();
    let vertex_weights: Vec<Vec<(u32, f64)>> = rows
        .iter()
        .map(|row| {
            let sum: f64 = row.iter().sum();
            let used = row.iter().enumerate().filter(|(_, w)| **w > 1e-3);
            used.map(|(part, weight)| (part as u32, weight / sum))
                .collect()
        })
        .collect();
    let segments = Segments {
        names: (0..6).map(|part| format!("bone {part}")).collect(),
        parents: vec![None; 6],
        pivots: vec![None; 6],
        vertex_weights: vertex_weights.clone(),
        smooth: true,
    };
    let graph = fit::laplace::graph::Graph::new(&mesh.positions, &mesh.triangles);
    let chosen = graph.spread(&[0], MARKERS - 1);
    let glued: Vec<Glued> = std::iter::once(0)
        .chain(chosen)
        .map(|vertex| Glued {
            vertices: [vertex; 3],
            weights: [1.0, 0.0, 0.0],
        })
        .collect();
    let at = |frame: &Vec<DVec3>| -> Vec<DVec3> { glued.iter().map(|m| m.on(frame)).collect() };
    let train: Vec<Vec<DVec3>> = frames.iter().step_by(2).map(at).collect();
    let options = Options::default();
    let learnt = learn(
        &mesh,
        &segments,
        (&glued, &at(&frames[0])),
        &train,
        &options,
    )?;
    let held_out: Vec<&Vec<DVec3>> = frames.iter().skip(1).step_by(2).collect();
    let linear: f64 = held_out
        .iter()
        .map(|frame| linear_error(&mesh.positions, &vertex_weights, frame))
        .sum::<f64>()
        / held_out.len() as f64;
    println!(
        "dem_bones, {} markers, rms over held-out frames (extent 3.7):",
        glued.len()
    );
    println!("  best linear skinning   {:.4}", linear.sqrt());
    for (name, mode, budget) in MODES {
        let mut player = learnt.player(mode)?.with_budget(budget);
        let (mut sum, mut count) = (0.0, 0.0);
        for frame in &held_out {
            player.step(&marker_frame(&at(frame)));
            for (a, b) in player.positions().iter().zip(*frame) {
                sum += DVec3::from_array(a.map(f64::from)).distance_squared(*b);
                count += 1.0;
            }
        }
        println!("  {name:22} {:.4}", f64::sqrt(sum / count));
    }
    println!();
    Ok(())
}

/// Mean squared error of the affine matrices that fit a frame best, by normal equations.
fn linear_error(rest: &[DVec3], weights: &[Vec<(u32, f64)>], frame: &[DVec3]) -> f64 {
    const N: usize = 24;
    let row = |vertex: usize| {
        let mut row = [0.0; N];
        for &(bone, weight) in &weights[vertex] {
            let terms = [rest[vertex].x, rest[vertex].y, rest[vertex].z, 1.0];
            for (to, term) in row[4 * bone as usize..].iter_mut().zip(terms) {
                *to = weight * term;
            }
        }
        row
    };
    let mut matrix = vec![[0.0; N + 3]; N];
    for (vertex, target) in frame.iter().enumerate() {
        let row = row(vertex);
        for (to, a) in matrix.iter_mut().zip(row) {
            for (to, b) in to.iter_mut().zip(row.into_iter().chain(target.to_array())) {
                *to += a * b;
            }
        }
    }
    for at in 0..N {
        matrix[at][at] += 1e-9;
        let pivot = matrix[at];
        for below in matrix.iter_mut().skip(at + 1) {
            let share = below[at] / pivot[at];
            for (to, from) in below.iter_mut().zip(pivot) {
                *to -= share * from;
            }
        }
    }
    let mut solved = [DVec3::ZERO; N];
    for at in (0..N).rev() {
        let mut value = DVec3::new(matrix[at][N], matrix[at][N + 1], matrix[at][N + 2]);
        for (known, share) in solved.iter().zip(matrix[at]).skip(at + 1) {
            value -= share * *known;
        }
        solved[at] = value / matrix[at][at];
    }
    let error = |(vertex, target): (usize, &DVec3)| {
        let found: DVec3 = row(vertex).iter().zip(&solved).map(|(a, b)| *a * *b).sum();
        found.distance_squared(*target)
    };
    frame.iter().enumerate().map(error).sum::<f64>() / frame.len() as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Time of a frame on one core, against a plain loop of eight influences over the same mesh.
fn speed(learnt: &Learnt, body: &Avatar, markers: &[DVec3]) -> Result<(), Failure> {
    use sinew_core::deform::{Output, PlainMesh, skin_plain};
    let count = body.mesh.positions.len();
    let (rest, normals) = (
        marker_frame(&body.mesh.positions),
        marker_frame(&body.mesh.normals),
    );
    let binds: Vec<u16> = (0..8 * count)
        .map(|k| ((k % 8 + k / 4000) % 31) as u16)
        .collect();
    let weights = vec![0.125; 8 * count];
    let mesh = PlainMesh::new(&rest, &normals, &binds, &weights, 8)?;
    let palette = vec![sinew_core::math::IDENTITY; 31];
    let dims = sinew_core::asset::Dims {
        vertex_count: count,
        ..Default::default()
    };
    let (mut positions, mut turned) = (vec![0.0; 3 * count], vec![0.0; 3 * count]);
    let frame = marker_frame(markers);
    let mut times = vec![Vec::new(); 4];
    let mut players = [Mode::Collapsed, Mode::Hybrid, Mode::Exact]
        .map(|mode| learnt.player(mode).expect("sound"));
    for _ in 0..41 {
        let start = Instant::now();
        let mut output = Output::separate(&dims, &mut positions, Some(&mut turned))?;
        skin_plain(&mesh, &palette, &mut output);
        times[0].push(start.elapsed().as_secs_f64());
        for (player, times) in players.iter_mut().zip(&mut times[1..]) {
            let start = Instant::now();
            player.step(&frame);
            times.push(start.elapsed().as_secs_f64());
        }
    }
    let times: Vec<f64> = times.into_iter().map(median).collect();
    let share = 54_000.0 / body.mesh.triangles.len() as f64;
    println!(
        "one core, {} triangles; frames a second for 54,000 triangles:",
        body.mesh.triangles.len()
    );
    for (name, time) in ["8 influences, plain", "collapsed", "hybrid", "exact"]
        .iter()
        .zip(&times)
    {
        println!(
            "  {name:20} {:7.3} ms  {:5.2} x  {:6.0} fps",
            1e3 * time,
            time / times[0],
            1.0 / (time * share)
        );
    }
    Ok(())
}

/// Contact sheets: every mode beside the truth, coloured by error from 0 to 10 mm.
fn sheets(
    learnt: &Learnt,
    body: &Avatar,
    truth: &[Vec<Surface>],
    set: &MarkerSet,
    folder: &Path,
) -> Result<(), Failure> {
    use sinew_host::export::png::{contact_sheet, write_png};
    use sinew_host::export::render::{Bounds, Camera, Colors, Mesh, Quality, Scene, render};
    std::fs::create_dir_all(folder)?;
    for (view, yaw) in [("front", 0.5), ("back", 3.6)] {
        let (mut images, mut captions) = (Vec::new(), Vec::new());
        for run in truth.iter().step_by(5).take(4) {
            let surface = &run[run.len() / 2];
            let flat: Vec<[f32; 3]> = marker_frame(&surface.positions);
            let bounds = Bounds::of(&flat);
            let camera = Camera::framing(bounds, yaw, 0.15, 1.0);
            for (name, mode, budget) in MODES {
                let mut player = learnt.player(mode)?.with_budget(budget);
                for surface in run {
                    player.step(&marker_frame(&set.positions(surface)));
                }
                let last = run.last().ok_or("an empty run")?;
                let colors: Vec<[u8; 3]> = player
                    .positions()
                    .iter()
                    .zip(&last.positions)
                    .map(|(a, b)| heat(1e2 * DVec3::from_array(a.map(f64::from)).distance(*b)))
                    .collect();
                let scene = Scene {
                    meshes: vec![Mesh {
                        positions: player.positions(),
                        normals: Some(player.normals()),
                        triangles: &body.mesh.triangles,
                        colors: Colors::PerVertex(&colors),
                    }],
                    ..Scene::default()
                };
                images.push(render(&scene, &camera, 360, 360, Quality::default()));
                captions.push(name);
            }
        }
        let path = folder.join(format!("modes_{view}.png"));
        write_png(&path, &contact_sheet(&images, MODES.len(), &captions))?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// Grey at nothing, yellow at half, red at one and above.
fn heat(share: f64) -> [u8; 3] {
    let share = share.clamp(0.0, 1.0);
    let mix = |a: f64, b: f64, t: f64| (a + (b - a) * t) as u8;
    if share < 0.5 {
        let t = 2.0 * share;
        [
            mix(190.0, 250.0, t),
            mix(190.0, 210.0, t),
            mix(190.0, 40.0, t),
        ]
    } else {
        let t = 2.0 * share - 1.0;
        [
            mix(250.0, 210.0, t),
            mix(210.0, 20.0, t),
            mix(40.0, 20.0, t),
        ]
    }
}

const MODES: [(&str, Mode, ExactBudget); 6] = [
    ("rigid", Mode::Exact, budget(false, 0)),
    ("quadratic", Mode::Exact, budget(true, 0)),
    ("rigid + residual", Mode::Exact, budget(false, usize::MAX)),
    (
        "quadratic + residual",
        Mode::Exact,
        budget(true, usize::MAX),
    ),
    ("collapsed", Mode::Collapsed, ExactBudget::UNLIMITED),
    ("hybrid", Mode::Hybrid, ExactBudget::UNLIMITED),
];

const fn budget(quadratic: bool, residual_parts: usize) -> ExactBudget {
    ExactBudget {
        quadratic,
        residual_parts,
    }
}

/// `[vertices]`: whether markers can know where it is: all but what finger joints move.
fn carried(body: &Avatar) -> Vec<bool> {
    let finger = |bind: u32| {
        let joint = body.skin.binds[bind as usize].joint;
        let name = body.skeleton.joints[joint].name.to_lowercase();
        name.contains("finger") || name.contains("thumb")
    };
    let rows = body.skin.influences.iter();
    rows.map(|row| {
        !row.iter()
            .any(|&(bind, weight)| finger(bind) && weight > 0.02)
    })
    .collect()
}

/// Mean error of each mode over the vertices of each joint, millimetres.
fn by_joint(body: &Avatar, regions: &[(&str, Vec<f64>)]) {
    for (at, joint) in body.skeleton.joints.iter().enumerate() {
        let own = |vertex: usize| {
            let heaviest = body.skin.influences[vertex][0].0;
            body.skin.binds[heaviest as usize].joint == at
        };
        let vertices: Vec<usize> = (0..body.mesh.positions.len()).filter(|&v| own(v)).collect();
        if vertices.is_empty() {
            continue;
        }
        let mean = |errors: &Vec<f64>| {
            vertices.iter().map(|&v| errors[v]).sum::<f64>() / vertices.len() as f64
        };
        let cells = regions
            .iter()
            .map(|(_, errors)| format!("{:7.2}", mean(errors)));
        println!(
            "  {:18} {:6} {}",
            joint.name,
            vertices.len(),
            cells.collect::<String>()
        );
    }
    println!();
}

/// Runs of consecutive frames spread over a motion.
fn windows(body: &Body<'_>) -> Vec<Vec<Surface>> {
    const RUN: usize = 8;
    let runs = 8;
    let room = body.frame_count().saturating_sub(RUN);
    (0..runs)
        .map(|run| {
            let first = room * run / (runs - 1);
            (first..first + RUN)
                .map(|frame| body.surface(frame))
                .collect()
        })
        .collect()
}

/// Millimetres and degrees.
struct Row {
    mean: f64,
    percentile_95: f64,
    max: f64,
    marker: f64,
    jitter: f64,
    /// What the markers' noise adds to the skin, rms.
    noise: f64,
    normal: f64,
    /// `[vertices]`: mean over frames.
    by_vertex: Vec<f64>,
}

fn measure(
    learnt: &Learnt,
    mode: Mode,
    budget: ExactBudget,
    truth: &[Vec<Surface>],
    set: &MarkerSet,
    noise: f64,
    counted: &[bool],
) -> Result<Row, Failure> {
    let mut player = learnt.player(mode)?.with_budget(budget);
    let mut clean = learnt.player(mode)?.with_budget(budget);
    let (mut added, mut counts) = (0.0, 0.0);
    let mut random = Noise(1);
    let (mut errors, mut markers, mut turns) = (Vec::new(), Vec::new(), Vec::new());
    let (mut jitter, mut jitters) = (0.0, 0.0);
    let mut by_vertex = vec![0.0; counted.len()];
    let frames = truth.iter().map(Vec::len).sum::<usize>() as f64;
    for run in truth {
        let mut last: Vec<Vec<DVec3>> = Vec::new();
        for surface in run {
            let mut seen = set.positions(surface);
            clean.step(&marker_frame(&seen));
            for point in &mut seen {
                *point += noise * random.vector();
            }
            player.step(&marker_frame(&seen));
            let vector = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
            let found = Surface {
                positions: player.positions().iter().map(vector).collect(),
                normals: player.normals().iter().map(vector).collect(),
            };
            let pairs = found.positions.iter().zip(clean.positions());
            for ((noisy, clean), counted) in pairs.zip(counted) {
                if *counted {
                    added += (1e3 * (*noisy - vector(clean))).length_squared();
                    counts += 1.0;
                }
            }
            let off: Vec<DVec3> = found
                .positions
                .iter()
                .zip(&surface.positions)
                .map(|(a, b)| *a - *b)
                .collect();
            for ((d, counted), sum) in off.iter().zip(counted).zip(&mut by_vertex) {
                *sum += 1e3 * d.length() / frames;
                if *counted {
                    errors.push(1e3 * d.length());
                }
            }
            let glued = set.positions(&found).into_iter();
            markers.extend(
                glued
                    .zip(set.positions(surface))
                    .map(|(a, b)| 1e3 * a.distance(b)),
            );
            let pairs = found.normals.iter().zip(&surface.normals);
            let pairs = pairs.zip(counted).filter(|pair| *pair.1);
            turns.extend(pairs.map(|((a, b), _)| a.angle_between(*b).to_degrees()));
            let kept = off.into_iter().zip(counted).filter(|pair| *pair.1);
            last.push(kept.map(|pair| pair.0).collect());
            if let [.., a, b, c] = &last[..] {
                for ((a, b), c) in a.iter().zip(b).zip(c) {
                    jitter += (1e3 * (*a - 2.0 * *b + *c)).length_squared();
                    jitters += 1.0;
                }
            }
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (marker, normal, mean) = (mean(&markers), mean(&turns), mean(&errors));
    errors.sort_by(f64::total_cmp);
    Ok(Row {
        mean,
        percentile_95: errors[errors.len() * 95 / 100],
        max: errors[errors.len() - 1],
        marker,
        jitter: f64::sqrt(jitter / f64::max(jitters, 1.0)),
        noise: f64::sqrt(added / f64::max(counts, 1.0)),
        normal,
        by_vertex,
    })
}

/// Deterministic normal noise (`SplitMix64`, Box & Muller 1958).
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self) -> DVec3 {
        let mut one = || {
            let (a, b) = (1.0 - self.unit(), self.unit());
            (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
        };
        DVec3::new(one(), one(), one())
    }
}
