//! Cuts the bundled body, in T-pose, into fifteen rigid groups of an OBJ; with a second path, draws the
//! parts, the joined body, and the joined body bent.
//!
//!     cargo run --release -p sinew-tests --example cut -- cut.obj joined.png

use std::fs;

use glam::DVec3;
use sinew_host::export::obj::write_obj;
use sinew_host::export::png::{contact_sheet, write_png};
use sinew_host::export::render::Rgb;
use sinew_host::export::sheet::PART_COLORS;
use sinew_host::fit::cut::{JoinOptions, join};
use sinew_host::model::{Mesh, Skin};
use sinew_host::reference::pose::model;
use sinew_tests::bare::{bundled, carried, picture, poses, surface};
use sinew_tests::cut::{cut, with_arms};
use sinew_tests::human;

fn main() {
    let path = std::env::args().nth(1).unwrap_or_else(|| "cut.obj".into());
    let parts = cut(&with_arms(&human::body(), DVec3::X));
    fs::write(&path, write_obj(&parts)).expect("writes");
    println!(
        "{} groups, {} triangles: {path}",
        parts.parts.len(),
        parts.triangles.len()
    );
    let Some(path) = std::env::args().nth(2) else {
        return;
    };
    let (body, _) = join(&parts, &JoinOptions::default()).expect("joins");
    let colors = colors(&body.skin);
    let draw =
        |at: &[DVec3], mesh: &Mesh, colors: &[Rgb]| picture(at, &mesh.triangles, colors, 560);
    let mut pictures = vec![
        draw(
            &parts.positions,
            &parts,
            &vec![[208, 170, 148]; parts.positions.len()],
        ),
        draw(&body.mesh.positions, &body.mesh, &colors),
    ];
    let rest = model(&body.skeleton, &body.skeleton.rest());
    assert_eq!(rest.len(), 15);
    let clip = carried(&bundled("kneel.bvh"), &body.skeleton);
    let all = poses(&body.skeleton, &clip, 1);
    for frame in [0, 120, 180, 300] {
        let at = surface(&body.mesh, &body.skin, &all[frame]);
        pictures.push(draw(&at, &body.mesh, &colors));
    }
    let captions = [
        "cut",
        "joined",
        "frame 0",
        "frame 120",
        "frame 180",
        "frame 300",
    ];
    write_png(&path, &contact_sheet(&pictures, 3, &captions)).expect("writes");
}

/// Joints' colours, mixed by weight.
fn colors(skin: &Skin) -> Vec<Rgb> {
    let mix = |row: &Vec<(u32, f64)>| {
        let mut sum = [0.0; 3];
        for &(bind, weight) in row {
            let color = PART_COLORS[bind as usize % PART_COLORS.len()];
            for (sum, part) in sum.iter_mut().zip(color) {
                *sum += weight * f64::from(part);
            }
        }
        sum.map(|part| part as u8)
    };
    skin.influences.iter().map(mix).collect()
}
