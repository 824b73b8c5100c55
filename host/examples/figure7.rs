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
    for noise in [0.0, 0.5e-3] {
        println!("marker noise {:.1} mm", 1e3 * noise);
        println!(
            "{:22} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8}",
            "mode", "mean", "p95", "max", "marker", "jitter", "normals"
        );
        for (name, mode, budget) in MODES {
            let row = measure(&learnt, mode, budget, &truth, &set, noise)?;
            println!(
                "{name:22} {:7.2} {:7.2} {:7.1} {:7.2} {:7.3} {:7.2}°",
                row.mean, row.percentile_95, row.max, row.marker, row.jitter, row.normal
            );
        }
        println!();
    }
    correctives(
        &body,
        &segments,
        (&glued, &rest),
        &set,
        &learnt_from,
        &held_out,
    )?;
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
            "correctives: {} terms, springs {:.0?} rad/s, {:.1} markers a block",
            skin.data.features.len(),
            skin.data.springs,
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
    normal: f64,
}

fn measure(
    learnt: &Learnt,
    mode: Mode,
    budget: ExactBudget,
    truth: &[Vec<Surface>],
    set: &MarkerSet,
    noise: f64,
) -> Result<Row, Failure> {
    let mut player = learnt.player(mode)?.with_budget(budget);
    let mut random = Noise(1);
    let (mut errors, mut markers, mut turns) = (Vec::new(), Vec::new(), Vec::new());
    let (mut jitter, mut jitters) = (0.0, 0.0);
    for run in truth {
        let mut last: Vec<Vec<DVec3>> = Vec::new();
        for surface in run {
            let mut seen = set.positions(surface);
            for point in &mut seen {
                *point += noise * random.vector();
            }
            player.step(&marker_frame(&seen));
            let vector = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
            let found = Surface {
                positions: player.positions().iter().map(vector).collect(),
                normals: player.normals().iter().map(vector).collect(),
            };
            let off: Vec<DVec3> = found
                .positions
                .iter()
                .zip(&surface.positions)
                .map(|(a, b)| *a - *b)
                .collect();
            errors.extend(off.iter().map(|d| 1e3 * d.length()));
            let glued = set.positions(&found).into_iter();
            markers.extend(
                glued
                    .zip(set.positions(surface))
                    .map(|(a, b)| 1e3 * a.distance(b)),
            );
            let pairs = found.normals.iter().zip(&surface.normals);
            turns.extend(pairs.map(|(a, b)| a.angle_between(*b).to_degrees()));
            last.push(off);
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
        normal,
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
