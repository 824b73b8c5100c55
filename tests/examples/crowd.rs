//! Many bodies of one asset: a state and an output for each, one workspace for all.
//!
//! `crowd`: prints what a frame of 10, 100 and 1,000 bodies of 2,000 vertices takes, and what it
//! takes of memory. Each body is somewhere else in its walk.

use std::time::Instant;

use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_tests::human;

const FRAMES: usize = 9;

fn main() {
    let bytes = human::small_asset();
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let size = 3 * dims.vertex_count;
    println!(
        "asset {} bytes for all, workspace {} bytes for all, state {} bytes a body",
        bytes.as_slice().len(),
        4 * workspace_len(&dims),
        4 * state_len(&dims),
    );
    let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
    for count in [10, 100, 1_000] {
        let mut states = vec![State::with(vec![0.0; state_len(&dims)]); count];
        let mut positions = vec![0.0; count * size];
        let mut normals = vec![0.0; count * size];
        let mut times: Vec<f64> = (0..FRAMES)
            .map(|frame| {
                let start = Instant::now();
                let outputs = positions.chunks_mut(size).zip(normals.chunks_mut(size));
                for (body, (state, (positions, normals))) in
                    states.iter_mut().zip(outputs).enumerate()
                {
                    let mut output =
                        Output::separate(&dims, positions, Some(normals)).expect("fits");
                    let mut avatar = Avatar::new(&asset, state, &mut workspace).expect("fits");
                    let input = Input::Clip {
                        index: 0,
                        seconds: frame as f32 / 60.0 + 0.013 * body as f32,
                        looped: true,
                    };
                    avatar.step(&input, Budget::UNLIMITED, &mut output);
                }
                start.elapsed().as_secs_f64()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let median = times[FRAMES / 2];
        println!(
            "{count:>5} bodies: {:>8.2} ms a frame, {:.1} us a body",
            1e3 * median,
            1e6 * median / count as f64
        );
    }
}
