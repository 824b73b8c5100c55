//! The table of figure 7 of Park & Hodgins 2006, in millimetres, on a virtual capture.
//!
//! `cargo run --release -p sinew-host --example figure7 -- [--out DIR] [--markers N] [--only WHAT]`
//!
//! `WHAT`: table, correctives, dem_bones or speed.
//!
//! A skin is learnt from some motions of a body that bulges, breathes and jiggles, and compared
//! with the true surface in others.

mod correctives;
mod dem_bones;
mod sheets;
mod speed;

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use sinew_core::deform::parts::ExactBudget;
use sinew_host::fit::parts::{
    Glued, Learnt, Mode, ModeData, Options, Segments, learn, marker_frame,
};
use sinew_host::fit::{self, Correspondence, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Clip, Motion};
use sinew_host::studio::{Body, MarkerLayout, MarkerSet, Scene, Surface};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let (mut out, mut count, mut only) = (None, 350, None);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or("an option needs a value")?;
        match argument.as_str() {
            "--out" => out = Some(PathBuf::from(value)),
            "--markers" => count = value.parse()?,
            "--only" => only = Some(value),
            other => {
                return Err(format!("{other}: give --out DIR, --markers N or --only WHAT").into());
            }
        }
    }
    let wanted = |what: &str| only.as_deref().is_none_or(|only| only == what);
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

    let rest: Vec<DVec3> = glued
        .iter()
        .map(|marker| marker.on(&body.mesh.positions))
        .collect();
    if wanted("dem_bones") {
        dem_bones::dem_bones(&root)?;
    }
    if wanted("correctives") {
        let glued = (&glued[..], &rest[..]);
        correctives::correctives(&body, glued, &set, &learnt_from, &held_out)?;
    }
    if !(wanted("table") || wanted("speed")) {
        return Ok(());
    }
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
    let learnt = learn(&body.mesh, &segments, (&glued, &rest), &frames, &options)?;
    println!(
        "learnt from {} frames in {:.1} s",
        frames.len(),
        start.elapsed().as_secs_f64()
    );

    if let ModeData::Collapsed { slots, .. } = &learnt.collapsed {
        println!(
            "collapsed: {:.1} markers a block, {:.1} for its normals",
            slots.positions.markers_a_block(),
            slots.tangents.markers_a_block()
        );
    }

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
            if noise == 0.0 {
                worst_places(&body, &rest, &row.largest);
            }
            regions.push((name, row.by_vertex));
        }
        println!();
        if noise == 0.0 {
            by_joint(&body, &regions);
        }
    }
    speed::speed(&learnt, &body, &set.positions(&truth[0][0]))?;
    if let Some(folder) = out {
        sheets::sheets(&learnt, &body, &truth, &set, &folder)?;
    }
    Ok(())
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

/// Where the largest errors are: vertices at least 4 cm apart.
fn worst_places(body: &Avatar, markers: &[DVec3], largest: &[f64]) {
    let positions = &body.mesh.positions;
    let mut order: Vec<usize> = (0..largest.len()).collect();
    order.sort_by(|&a, &b| largest[b].total_cmp(&largest[a]));
    let mut shown: Vec<usize> = Vec::new();
    for vertex in order {
        if shown.len() == 4 {
            break;
        }
        let far = |&other: &usize| positions[other].distance(positions[vertex]) > 0.04;
        if !shown.iter().all(far) {
            continue;
        }
        shown.push(vertex);
        let joints = body.skin.influences[vertex].iter().map(|&(bind, weight)| {
            let joint = body.skin.binds[bind as usize].joint;
            format!("{} {weight:.2}", body.skeleton.joints[joint].name)
        });
        let near = markers.iter().map(|m| m.distance(positions[vertex]));
        println!(
            "      {:5.1} mm at vertex {vertex}, {:.0} mm from a marker, height {:.2}: {}",
            largest[vertex],
            1e3 * near.fold(f64::INFINITY, f64::min),
            positions[vertex].y,
            joints.collect::<Vec<_>>().join(", ")
        );
    }
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
    /// `[vertices]`: largest over frames; 0 where it does not count.
    largest: Vec<f64>,
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
    let mut largest = vec![0.0_f64; counted.len()];
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
            for (vertex, (d, counted)) in off.iter().zip(counted).enumerate() {
                let length = 1e3 * d.length();
                by_vertex[vertex] += length / frames;
                if *counted {
                    errors.push(length);
                    largest[vertex] = largest[vertex].max(length);
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
        largest,
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
