//! What a frame costs.

use std::time::Instant;

use glam::DVec3;
use sinew_host::fit::parts::{Learnt, Mode, marker_frame};
use sinew_host::model::Avatar;

use crate::Failure;

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Time of a frame on one core, against a plain loop of eight influences over the same mesh.
pub fn speed(learnt: &Learnt, body: &Avatar, markers: &[DVec3]) -> Result<(), Failure> {
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
