//! Correctives against the skeleton alone.

use std::time::Instant;

use glam::DVec3;
use sinew_host::fit::parts::corrective_skin::{
    CorrectivePlayer, CorrectiveSkin, Performed, core_palette, learn_skin, palette,
};
use sinew_host::fit::parts::{Glued, Segments};
use sinew_host::model::{Avatar, Clip};
use sinew_host::studio::{Body, MarkerSet, Scene};

use crate::Failure;
use crate::speed::median;

/// What correctives leave of the error of the skeleton alone, on motion held out.
pub fn correctives(
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
