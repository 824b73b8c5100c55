//! Every mode beside the others, coloured by error.

use std::path::Path;

use glam::DVec3;
use sinew_host::fit::parts::{Learnt, marker_frame};
use sinew_host::model::Avatar;
use sinew_host::studio::{MarkerSet, Surface};

use crate::{Failure, MODES};

/// Contact sheets: every mode beside the truth, coloured by error from 0 to 10 mm.
pub fn sheets(
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
