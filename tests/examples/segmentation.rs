//! Segmentation measured against rigs:
//! `cargo run --release -p sinew-tests --example segmentation [-- OUT_DIR]`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use sinew_host::export::png::write_png;
use sinew_host::export::render::{Colors, Rgb};
use sinew_host::export::sheet::{PART_COLORS, body_sheet};
use sinew_host::fit::register::Glue;
use sinew_host::fit::register::marker_surface::marker_surface;
use sinew_host::fit::segment::rig::carried_over;
use sinew_host::fit::segment::{Agreement, SegmentOptions, Segmentation, parts_of_rig, segment};
use sinew_host::fit::{Correspondence, Options, retarget};
use sinew_host::import::{read_bvh, read_obj};
use sinew_host::model::{Avatar, Mesh, Motion};
use sinew_host::studio::{Body, Scene};
use sinew_tests::dense::{human, markers, measured, range_of_motion, skin};
use sinew_tests::{Random, root, shared};

struct Case {
    name: String,
    rest: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    frames: Vec<Vec<DVec3>>,
    truth: Vec<u32>,
    parts: usize,
}

fn main() {
    let out = std::env::args().nth(1).map(PathBuf::from);
    println!(
        "{:34} {:>6} {:>8} {:>8} {:>6} {:>9} | {:>5} {:>7} {:>8} | {:>5} {:>7} {:>8}",
        "surface",
        "s",
        "patches",
        "clusters",
        "rigid",
        "scattered",
        "own N",
        "rand",
        "matched",
        "N",
        "rand",
        "matched"
    );
    let template = human();
    let mut random = Random(5);
    let motions = range_of_motion(&template, 240);
    let surfaces: Vec<Vec<DVec3>> = motions
        .iter()
        .map(|local| skin(&template, local, 0.3))
        .collect();
    for count in [350, 150] {
        let name = format!("{count} markers, range of motion");
        row(
            &of_markers(name, &template, count, &surfaces, 0.5e-3, &mut random),
            &out,
        );
    }
    let mesh = &template.mesh;
    row(
        &Case {
            name: "13 k vertices, range of motion".into(),
            rest: mesh.positions.clone(),
            triangles: mesh.triangles.clone(),
            frames: surfaces.iter().step_by(4).cloned().collect(),
            truth: parts_of_rig(&template).triangle_parts,
            parts: parts_of_rig(&template).part_count(),
        },
        &out,
    );
    for file in ["cmu_01_01.bvh", "mocapbank_crlf.bvh"] {
        let Some(path) = shared(&format!("bvh/{file}")) else {
            continue;
        };
        let surfaces = filmed(&template, &path, 240);
        let name = format!("350 markers with flesh, {file}");
        row(
            &of_markers(name, &template, 350, &surfaces, 0.5e-3, &mut random),
            &out,
        );
    }
    let surfaces = filmed(&template, &root().join("examples/data/kneel.bvh"), 240);
    row(
        &of_markers(
            "350 markers with flesh, kneel".into(),
            &template,
            350,
            &surfaces,
            0.5e-3,
            &mut random,
        ),
        &out,
    );
    if let Some(case) = dem_bones() {
        row(&case, &out);
    }
}

fn row(case: &Case, out: &Option<PathBuf>) {
    let start = Instant::now();
    let run = |parts| {
        let options = SegmentOptions {
            parts,
            ..SegmentOptions::default()
        };
        segment(&case.rest, &case.triangles, &case.frames, &options, &|_| ()).expect("segments")
    };
    let areas: Vec<f64> = case
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|at| case.rest[at as usize]);
            (b - a).cross(c - a).length()
        })
        .collect();
    let own = run(None);
    let seconds = start.elapsed().as_secs_f64();
    let told = run(Some(case.parts));
    let [a, b] =
        [&own, &told].map(|found| Agreement::new(&found.triangle_parts, &case.truth, &areas));
    let report = &own.report;
    let rigid = report
        .deviations
        .iter()
        .zip(&report.shares)
        .map(|(d, s)| d * d * s)
        .sum::<f64>()
        .sqrt();
    println!(
        "{:34} {seconds:6.2} {:8} {:8} {:6.1} {:8.1}% | {:5} {:7.3} {:8.3} | {:5} {:7.3} {:8.3}",
        case.name,
        report.patches,
        report.clusters,
        1e3 * rigid,
        100.0 * report.scattered,
        own.part_count(),
        a.rand,
        a.matched,
        told.part_count(),
        b.rand,
        b.matched
    );
    let Some(out) = out else { return };
    fs::create_dir_all(out).expect("a folder");
    let file = case.name.replace([' ', ',', '.'], "_");
    for (kind, parts) in [
        ("own", &own.triangle_parts),
        ("told", &told.triangle_parts),
        ("rig", &case.truth),
    ] {
        let colors: Vec<Rgb> = parts
            .iter()
            .map(|&part| PART_COLORS[part as usize % PART_COLORS.len()])
            .collect();
        let sheet = body_sheet(
            &case.rest,
            &case.triangles,
            Colors::PerTriangle(&colors),
            &[],
            Colors::Uniform([0; 3]),
            480,
        );
        write_png(out.join(format!("{file}_{kind}.png")), &sheet).expect("a picture");
    }
}

fn of_markers(
    name: String,
    body: &Avatar,
    count: usize,
    surfaces: &[Vec<DVec3>],
    noise: f64,
    random: &mut Random,
) -> Case {
    let set = markers(body, count, 3);
    let glue: Vec<Option<Glue>> = set
        .markers
        .iter()
        .map(|m| {
            Some(Glue {
                triangle: m.triangle,
                vertices: m.vertices,
                barycentric: m.barycentric,
            })
        })
        .collect();
    let triangles = marker_surface(&body.mesh.positions, &body.mesh.triangles, &glue);
    let rest = measured(&set, &body.mesh.positions, noise, random);
    let of_rig: Segmentation = parts_of_rig(body);
    let inside: Vec<Option<usize>> = set.markers.iter().map(|m| Some(m.triangle)).collect();
    let truth = carried_over(&of_rig, &inside, &rest, &triangles);
    Case {
        name,
        frames: surfaces
            .iter()
            .map(|surface| measured(&set, surface, noise, random))
            .collect(),
        rest,
        triangles,
        truth: truth.triangle_parts,
        parts: of_rig.part_count(),
    }
}

/// True surfaces of a motion on the body with its flesh.
fn filmed(body: &Avatar, path: &Path, count: usize) -> Vec<Vec<DVec3>> {
    let bytes = fs::read(path).expect("readable");
    let (motion, _) =
        Motion::new(read_bvh(&bytes, "motion").expect("a motion"), "motion").expect("sound");
    let joints = Correspondence::new(&motion.skeleton, &body.skeleton, &[]).expect("fits");
    let clip = retarget(&motion, &body.skeleton, &joints, &Options::default())
        .expect("fits")
        .clip;
    let scene = Scene {
        rate: 30.0,
        ..Scene::default()
    };
    let filmed = Body::new(body, &clip, scene).expect("films");
    let frames = filmed.frame_count();
    (0..count.min(frames))
        .map(|at| filmed.surface(at * frames / count.min(frames)).positions)
        .collect()
}

/// Electronic Arts' test sequence: 754 vertices, 400 frames, six bones.
fn dem_bones() -> Option<Case> {
    let folder = shared("vertex_seq/dem_bones")?;
    let bytes = fs::read(folder.join("bone_rest.obj")).expect("readable");
    let (raw, _) = read_obj(&bytes, "bone_rest.obj", 1.0).expect("an OBJ");
    let (mesh, _) = Mesh::new(raw, "bone_rest.obj").expect("sound");
    let bytes = fs::read(folder.join("bone_anim_400x754x3_f32le.bin")).expect("readable");
    let values: Vec<f64> = bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| f64::from(f32::from_le_bytes(*b)))
        .collect();
    let count = values.len() / 3 / 400;
    let frames: Vec<Vec<DVec3>> = values
        .chunks_exact(3 * count)
        .map(|frame| frame.chunks_exact(3).map(DVec3::from_slice).collect())
        .collect();
    let text = fs::read_to_string(folder.join("bone_weights.csv")).expect("readable");
    let bones: Vec<u32> = text
        .lines()
        .filter_map(|line| {
            let row: Vec<f64> = line
                .split(',')
                .map(|word| word.trim().parse().ok())
                .collect::<Option<_>>()?;
            let row = if row.len() == 7 { &row[1..] } else { &row[..] };
            (0..row.len() as u32).max_by(|&a, &b| row[a as usize].total_cmp(&row[b as usize]))
        })
        .collect();
    // The OBJ may hold its vertices in another order than the sequence: frame 0 is its shape.
    let nearest = |at: &DVec3| {
        (0..count)
            .min_by(|&a, &b| {
                frames[0][a]
                    .distance_squared(*at)
                    .total_cmp(&frames[0][b].distance_squared(*at))
            })
            .unwrap_or(0) as u32
    };
    let place: Vec<u32> = mesh.positions.iter().map(nearest).collect();
    let triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|at| place[at as usize]))
        .collect();
    let truth = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|at| bones[at as usize]);
        if b == c { b } else { a }
    });
    Some(Case {
        name: "dem_bones sequence".into(),
        truth: truth.collect(),
        parts: 6,
        rest: frames[0].clone(),
        triangles,
        frames,
    })
}
