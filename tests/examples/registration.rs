//! Registration and segmentation measured against the truth:
//! `cargo run --release -p sinew-tests --example registration [-- OUT_DIR]`.

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use sinew_host::fit::register::fold::folded;
use sinew_host::fit::register::{RegisterOptions, Registration, Template, register};
use sinew_host::model::Avatar;
use sinew_host::spatial::Tree;
use sinew_tests::Random;
use sinew_tests::dense::{human, markers, measured, other_proportions, pose, reshape, skin, woman};

struct Case {
    name: &'static str,
    body: Avatar,
    lowered: f64,
    bent: f64,
    yaw: f64,
    noise: f64,
    rig: bool,
}

fn main() {
    let out: Option<PathBuf> = std::env::args().nth(1).map(PathBuf::from);
    let template = human();
    let own = vec![DVec3::ZERO; template.mesh.positions.len()];
    let broad = other_proportions(&template, 1.0);
    let narrow = other_proportions(&template, -0.6);
    let mut cases = vec![
        Case {
            name: "itself, bound pose",
            body: reshape(&template, &own),
            lowered: f64::NAN,
            bent: 0.0,
            yaw: 0.0,
            noise: 0.5e-3,
            rig: true,
        },
        Case {
            name: "itself, T pose",
            body: reshape(&template, &own),
            lowered: 0.0,
            bent: 0.0,
            yaw: 0.7,
            noise: 0.5e-3,
            rig: true,
        },
        Case {
            name: "broad, T pose",
            body: reshape(&template, &broad),
            lowered: 0.0,
            bent: 0.0,
            yaw: 2.9,
            noise: 0.5e-3,
            rig: true,
        },
        Case {
            name: "narrow, arms hang",
            body: reshape(&template, &narrow),
            lowered: 75.0,
            bent: 0.0,
            yaw: -1.2,
            noise: 0.5e-3,
            rig: true,
        },
        Case {
            name: "broad, bent",
            body: reshape(&template, &broad),
            lowered: 30.0,
            bent: 40.0,
            yaw: 4.0,
            noise: 0.5e-3,
            rig: true,
        },
        Case {
            name: "broad, bound, no rig",
            body: reshape(&template, &broad),
            lowered: f64::NAN,
            bent: 0.0,
            yaw: 1.0,
            noise: 0.5e-3,
            rig: false,
        },
        Case {
            name: "narrow, 35 below, no rig",
            body: reshape(&template, &narrow),
            lowered: 35.0,
            bent: 0.0,
            yaw: 1.0,
            noise: 0.5e-3,
            rig: false,
        },
    ];
    if let Some(offsets) = woman(&template) {
        cases.push(Case {
            name: "woman, T pose",
            body: reshape(&template, &offsets),
            lowered: 0.0,
            bent: 0.0,
            yaw: 0.3,
            noise: 0.5e-3,
            rig: true,
        });
        cases.push(Case {
            name: "woman, bent, exact",
            body: reshape(&template, &offsets),
            lowered: 20.0,
            bent: 30.0,
            yaw: 5.0,
            noise: 0.0,
            rig: true,
        });
        cases.push(Case {
            name: "woman, bound, no rig",
            body: reshape(&template, &offsets),
            lowered: f64::NAN,
            bent: 0.0,
            yaw: 0.3,
            noise: 0.5e-3,
            rig: false,
        });
    }
    println!(
        "{:26} {:>6} {:>7} {:>7} | {:>7} {:>7} | {:>8} {:>8} {:>8} | {:>8} {:>7} | {:>5} {:>4} {:>5}",
        "target (350 markers)",
        "s",
        "aligned",
        "posed",
        "rms",
        "max",
        "surface",
        "surf95",
        "surfmax",
        "vertex",
        "glue",
        "folds",
        "fix",
        "stray"
    );
    for case in &cases {
        let only = std::env::args().nth(2);
        if only.is_some_and(|only| !case.name.contains(&only)) {
            continue;
        }
        let mut random = Random(7);
        let local = if case.lowered.is_nan() {
            case.body.skeleton.rest()
        } else {
            pose(&case.body, case.lowered, case.bent)
        };
        let truth = skin(&case.body, &local, case.yaw);
        let set = markers(&case.body, 350, 3);
        let points = measured(&set, &truth, case.noise, &mut random);
        let seen: Vec<Option<DVec3>> = points.iter().copied().map(Some).collect();
        let what = if case.rig {
            Template::Rigged(&template)
        } else {
            Template::Mesh(&template.mesh)
        };
        let start = Instant::now();
        let found = register(what, &seen, &RegisterOptions::default(), &|_| ());
        let seconds = start.elapsed().as_secs_f64();
        match found {
            Err(error) => println!("{:26} {seconds:6.1} {error}", case.name),
            Ok(found) => {
                row(case, &template, &truth, &set, &found, seconds);
                if let Some(out) = &out {
                    picture(out, case.name, &template, &truth, &points, &found);
                }
            }
        }
    }
}

fn row(
    case: &Case,
    template: &Avatar,
    truth: &[DVec3],
    set: &sinew_host::studio::MarkerSet,
    found: &Registration,
    seconds: f64,
) {
    let triangles = &template.mesh.triangles;
    let tree = Tree::new(triangles, truth);
    // Where markers are: within 6 cm of one.
    let sites: Vec<DVec3> = set
        .markers
        .iter()
        .map(|m| {
            m.vertices
                .iter()
                .zip(m.barycentric)
                .map(|(&v, w)| truth[v as usize] * w)
                .sum()
        })
        .collect();
    let near = |at: &DVec3| sites.iter().any(|site| site.distance(*at) < 0.06);
    let zone: Vec<usize> = (0..truth.len()).filter(|&v| near(&truth[v])).collect();
    let mut surface: Vec<f64> = zone
        .iter()
        .filter_map(|&v| Some(1e3 * tree.closest(found.positions[v], |_| true)?.distance))
        .collect();
    surface.sort_by(f64::total_cmp);
    let vertex: f64 = zone
        .iter()
        .map(|&v| 1e3 * found.positions[v].distance(truth[v]))
        .sum::<f64>()
        / zone.len() as f64;
    let glue: Vec<f64> = set
        .markers
        .iter()
        .zip(&found.glue)
        .filter_map(|(own, glue)| {
            let own: DVec3 = own
                .vertices
                .iter()
                .zip(own.barycentric)
                .map(|(&v, w)| template.mesh.positions[v as usize] * w)
                .sum();
            Some(1e3 * glue.as_ref()?.on(&template.mesh.positions).distance(own))
        })
        .collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
    let report = &found.report;
    println!(
        "{:26} {seconds:6.1} {:7.1} {:7.1} | {:7.3} {:7.3} | {:8.2} {:8.2} {:8.2} | {:8.2} {:7.2} | {:5} {:4} {:5}",
        case.name,
        1e3 * report.aligned,
        1e3 * report.posed,
        1e3 * report.residual_rms,
        1e3 * report.residual_max,
        mean(&surface),
        surface[surface.len() * 95 / 100],
        surface[surface.len() - 1],
        vertex,
        mean(&glue),
        folded(&template.mesh.positions, &found.positions, triangles).len(),
        report.repairs,
        report.strays.len()
    );
}

fn picture(
    out: &std::path::Path,
    name: &str,
    template: &Avatar,
    truth: &[DVec3],
    points: &[DVec3],
    found: &Registration,
) {
    use sinew_host::export::png::{contact_sheet, write_png};
    use sinew_host::export::render::{Camera, Colors, Floor, Mesh, Points, Quality, Scene, render};
    std::fs::create_dir_all(out).expect("a folder");
    let narrow = |points: &[DVec3]| -> Vec<[f32; 3]> {
        points.iter().map(|p| p.as_vec3().to_array()).collect()
    };
    let dots = narrow(points);
    let mut pictures = Vec::new();
    for positions in [narrow(truth), narrow(&found.positions)] {
        let scene = Scene {
            meshes: vec![Mesh {
                positions: &positions,
                normals: None,
                triangles: &template.mesh.triangles,
                colors: Colors::Uniform([208, 170, 148]),
            }],
            points: vec![Points {
                positions: &dots,
                radius: 0.006,
                colors: Colors::Uniform([214, 39, 40]),
                occluded_opacity: 0.0,
            }],
            floor: Some(Floor { height: 0.0 }),
            ..Scene::default()
        };
        for yaw in [0.4, 2.2] {
            pictures.push(render(
                &scene,
                &Camera::framing(scene.bounds(), yaw, 0.1, 0.9),
                700,
                780,
                Quality::Good,
            ));
        }
    }
    let sheet = contact_sheet(
        &pictures,
        4,
        &["truth", "truth", "registered", "registered"],
    );
    let file = name.replace([' ', ','], "_");
    write_png(out.join(format!("{file}.png")), &sheet).expect("a picture");
}
