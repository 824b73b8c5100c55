//! Correctives against the skeleton alone.

use std::time::Instant;

use glam::{DAffine3, DVec3};
use sinew_core::frame::Input;
use sinew_core::pose::Transform;
use sinew_host::bake::{Additions, BakeOptions, bake, bake_adding};
use sinew_host::fit::correctives::{Performed, learn, pose::pose};
use sinew_host::fit::parts::Glued;
use sinew_host::model::{Avatar, Clip};
use sinew_host::play::Player;
use sinew_host::studio::{Body, FleshOptions, MarkerSet, Scene};

use crate::Failure;
use crate::speed::median;

const RATE: f64 = 60.0;

fn scene(seed: u64) -> Scene {
    Scene {
        rate: RATE,
        flesh: FleshOptions {
            seed,
            ..FleshOptions::default()
        },
        ..Scene::default()
    }
}

/// What correctives leave of the error of the skeleton alone, on motion held out.
pub fn correctives(
    body: &Avatar,
    glued: (&[Glued], &[DVec3]),
    set: &MarkerSet,
    learnt_from: &[Option<Clip>],
    held_out: &[Option<Clip>],
) -> Result<(), Failure> {
    println!("correctives, learnt from up to 15 s of each motion:");
    for known in [true, false] {
        let mut performances = Vec::new();
        for (seed, clip) in learnt_from.iter().flatten().enumerate() {
            let film = Body::new(body, clip, scene(seed as u64))?;
            let frames = 0..film.frame_count().min(900);
            let markers: Vec<Vec<DVec3>> = frames
                .clone()
                .map(|frame| set.positions(&film.surface(frame)))
                .collect();
            let poses = if known {
                frames.clone().map(|frame| film.pose(frame)).collect()
            } else {
                let posed = pose(body, glued, &markers).poses;
                let truth = frames.clone().map(|frame| film.pose(frame));
                off(body, &posed, truth);
                posed
            };
            performances.push(Performed {
                rate: RATE,
                poses,
                markers,
            });
        }
        let start = Instant::now();
        let learnt = learn(body, glued, &performances)?;
        let seconds = start.elapsed().as_secs_f64();
        let full = learnt.on(body);
        let additions = Additions {
            correctives: Some(&learnt.data),
            ..Additions::default()
        };
        let options = BakeOptions::default();
        let full = bake_adding(&full, &options, &additions)?.bytes;
        let bare = bake(body, &options)?.bytes;
        let dims = *full.asset()?.dims();
        println!(
            "  skeleton {}: {} modes, {} terms, {:.2} rows a block, {} bytes more, {seconds:.0} s",
            if known { "known" } else { "from the markers" },
            dims.correctives.mode_count,
            dims.correctives.term_count,
            dims.morph_row_count as f64 / dims.block_count as f64,
            full.as_slice().len() - bare.as_slice().len(),
        );
        let [before, after] = learnt.held_out.map(|m| 1e3 * m);
        println!("    at markers, stretches held out: {before:.2} mm rms, {after:.2} left");
        let mut player = Player::new(full.asset()?);
        let mut skeleton = Player::new(bare.asset()?);
        let mut time = [Vec::new(), Vec::new()];
        let (mut alone, mut with, mut breath, mut count) = (0.0, 0.0, 0.0, 0.0);
        let mut by_vertex = vec![[0.0; 3]; body.mesh.positions.len()];
        for (seed, clip) in held_out.iter().flatten().enumerate() {
            let film = Body::new(body, clip, scene(100 + seed as u64))?;
            let mut still = *film.scene();
            still.flesh.breath = 0.0;
            let still = Body::new(body, clip, still)?;
            let (mut a, mut w, mut n) = (0.0, 0.0, 0.0);
            for frame in 0..film.frame_count().min(480) {
                let pose = local(body, &film.pose(frame));
                for (player, time) in [&mut player, &mut skeleton].into_iter().zip(&mut time) {
                    let cut = if frame == 0 { 1.0 } else { 1.0 / RATE };
                    player.set_elapsed(cut);
                    let start = Instant::now();
                    player.step(&Input::Pose(&pose));
                    time.push(start.elapsed().as_secs_f64());
                }
                if frame % 6 != 0 {
                    continue;
                }
                let truth = film.surface(frame).positions;
                let calm = still.surface(frame).positions;
                let found = player.positions().iter().zip(skeleton.positions());
                for (((truth, calm), (found, bones)), sums) in
                    truth.iter().zip(&calm).zip(found).zip(&mut by_vertex)
                {
                    let wide = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
                    a += truth.distance(wide(bones));
                    w += truth.distance(wide(found));
                    breath += truth.distance(*calm);
                    sums[0] += 1e3 * truth.distance(wide(bones));
                    sums[1] += 1e3 * truth.distance(wide(found));
                    sums[2] += 1.0;
                    n += 1.0;
                }
            }
            println!(
                "    {}: skeleton alone {:.2} mm, with correctives {:.2} mm: {:.0} % removed",
                clip.name,
                1e3 * a / n,
                1e3 * w / n,
                100.0 * (1.0 - w / a)
            );
            (alone, with, count) = (alone + a, with + w, count + n);
        }
        println!("    by joint, mm: vertices, skeleton alone, with correctives");
        for (at, joint) in body.skeleton.joints.iter().enumerate() {
            let own = |vertex: usize| {
                let heaviest = body.skin.influences[vertex][0].0;
                body.skin.binds[heaviest as usize].joint == at
            };
            let mut sum = [0.0; 3];
            let mut vertices = 0;
            for row in (0..by_vertex.len())
                .filter(|&v| own(v))
                .map(|v| by_vertex[v])
            {
                vertices += 1;
                (0..3).for_each(|k| sum[k] += row[k]);
            }
            if sum[0] > 0.02 * sum[2] || sum[1] > 0.02 * sum[2] {
                let [a, w] = [0, 1].map(|k| sum[k] / sum[2]);
                println!("      {:16} {vertices:6} {a:6.2} {w:6.2}", joint.name);
            }
        }
        let [with_time, bare_time] = time.map(median);
        println!(
            "    all: {:.2} mm, {:.2} mm: {:.0} % removed, at {:.2} x its cost; breath alone {:.2}\n",
            1e3 * alone / count,
            1e3 * with / count,
            100.0 * (1.0 - with / alone),
            with_time / bare_time,
            1e3 * breath / count,
        );
    }
    Ok(())
}

/// Prints how far joints are from where they were.
fn off(body: &Avatar, found: &[Vec<DAffine3>], truth: impl Iterator<Item = Vec<DAffine3>>) {
    let joints = body.skeleton.joints.len();
    let mut sums = vec![[0.0; 2]; joints];
    for (found, truth) in found.iter().zip(truth) {
        for ((sum, a), b) in sums.iter_mut().zip(found).zip(truth) {
            let turn = (a.inverse() * b).to_scale_rotation_translation().1;
            sum[0] += 1e3 * a.translation.distance(b.translation);
            sum[1] += turn.to_axis_angle().1.to_degrees();
        }
    }
    let frames = found.len().max(1) as f64;
    let mean = |at: usize| sums.iter().map(|s| s[at]).sum::<f64>() / joints as f64;
    println!(
        "  skeleton from markers: joints {:.1} mm, {:.1} degrees off on average",
        mean(0) / frames,
        mean(1) / frames
    );
}

/// `[joints]`: relative to the parents.
fn local(body: &Avatar, model: &[DAffine3]) -> Vec<Transform> {
    let joints = body.skeleton.joints.iter().zip(model);
    joints
        .map(|(joint, matrix)| {
            let above = joint
                .parent
                .map_or(DAffine3::IDENTITY, |parent| model[parent]);
            let (scale, rotation, translation) =
                (above.inverse() * *matrix).to_scale_rotation_translation();
            Transform {
                rotation: rotation.as_quat(),
                translation: translation.as_vec3(),
                scale: scale.as_vec3(),
            }
        })
        .collect()
}
