//! The forearm twisted and the elbow bent in every skinning mode: a table of what is left of the
//! cross-section, and a picture.
//!
//! `cargo run --release -p sinew-tests --example twist -- OUT.png`

use std::process::ExitCode;

use glam::DVec3;
use sinew_host::bake::{BakeOptions, bake};
use sinew_host::export::png::{contact_sheet, write_png};
use sinew_host::export::render::{Bounds, Camera, Colors, Mesh, Quality, Scene, render};
use sinew_tests::human;
use sinew_tests::limb::{Arm, MODES, Motion, player, step};

const SIZE: usize = 300;

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("usage: twist OUT.png");
        return ExitCode::from(2);
    };
    let body = human::body();
    let options = BakeOptions {
        centres: true,
        ..BakeOptions::default()
    };
    let bytes = bake(&body, &options).expect("bakes").bytes;
    let (mut images, mut captions) = (Vec::new(), Vec::new());
    for (motion, shown) in [
        (Motion::Twist, [0.0, 60.0, 120.0, 180.0]),
        (Motion::Bend, [0.0, 60.0, 100.0, 140.0]),
    ] {
        let arm = Arm::new(&body, motion);
        println!("{motion:?}: least cross-section, percent of rest");
        println!(
            "degrees {}",
            MODES.map(|(name, _)| format!("{name:>16}")).concat()
        );
        for &degrees in arm.angles() {
            let left = MODES.map(|(_, mode)| {
                let mut player = player(&bytes, mode);
                step(&mut player, &arm.pose(degrees));
                format!("{:16.1}", 100.0 * arm.least_area(player.positions()))
            });
            println!("{degrees:7} {}", left.concat());
        }
        for (name, mode) in MODES {
            for degrees in shown {
                let mut player = player(&bytes, mode);
                step(&mut player, &arm.pose(degrees));
                let order = player.asset().source_order();
                let triangles = player.asset().triangles().iter();
                let triangles: Vec<[u32; 3]> =
                    triangles.map(|t| t.map(|at| order[at as usize])).collect();
                let scene = Scene {
                    meshes: vec![Mesh {
                        positions: player.positions(),
                        normals: None,
                        triangles: &triangles,
                        colors: Colors::Uniform([208, 170, 148]),
                    }],
                    ..Scene::default()
                };
                let corners = match motion {
                    Motion::Twist => [[0.30, 0.92, 0.0], [0.62, 1.28, 0.32]],
                    Motion::Bend => [[0.10, 1.05, -0.1], [0.55, 1.50, 0.30]],
                };
                let mut around = Bounds::EMPTY;
                for corner in corners {
                    around.include(DVec3::from_array(corner));
                }
                let camera = Camera::framing(around, 0.9, 0.25, 1.0);
                images.push(render(&scene, &camera, SIZE, SIZE, Quality::default()));
                captions.push(format!("{name}, {degrees} degrees"));
            }
        }
    }
    let captions: Vec<&str> = captions.iter().map(String::as_str).collect();
    write_png(&path, &contact_sheet(&images, 4, &captions)).expect("a picture");
    println!("wrote {path}");
    ExitCode::SUCCESS
}
