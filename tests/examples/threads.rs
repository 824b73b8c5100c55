//! A frame shared out among threads by ranges of blocks, into the back one of two buffers while the
//! front one is shown: the same bits as one thread gives.
//!
//! `threads [COUNT]`: two threads where no count is given.

use std::time::Instant;
use std::{env, mem, thread};

use sinew_core::asset::LANES;
use sinew_core::deform::{Output, VertexOrder};
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_tests::human;

const FRAMES: usize = 200;

fn main() {
    let count = env::args().nth(1).and_then(|word| word.parse().ok());
    let threads: usize = count.unwrap_or(2).max(1);
    let bytes = human::asset();
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
    let size = 3 * dims.vertex_count;
    let (mut front, mut back) = (vec![0.0; size], vec![0.0; size]);
    let mut whole = vec![0.0; size];
    let share = dims.block_count.div_ceil(threads);
    let (mut alone, mut shared) = (0.0, 0.0);
    for frame in 0..FRAMES {
        let input = Input::Clip {
            index: 0,
            seconds: frame as f32 / 60.0,
            looped: true,
        };
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
        let output = Output::separate(&dims, &mut whole, None).expect("fits");
        let start = Instant::now();
        avatar.step(
            &input,
            Budget::UNLIMITED,
            &mut output.in_order(VertexOrder::Block),
        );
        alone += start.elapsed().as_secs_f64();

        let start = Instant::now();
        let output = Output::separate(&dims, &mut back, None).expect("fits");
        // The pose once; then everybody reads it.
        avatar.step(
            &input,
            Budget::blocks(0),
            &mut output.in_order(VertexOrder::Block),
        );
        let job = avatar.job();
        thread::scope(|scope| {
            for (at, part) in back.chunks_mut(3 * LANES * share).enumerate() {
                let blocks = at * share..(at + 1) * share;
                let (job, asset) = (&job, &asset);
                scope.spawn(move || {
                    let mut output =
                        Output::of_blocks(asset.dims(), blocks.clone(), part, None).expect("fits");
                    job.run(asset, blocks, &mut output);
                });
            }
        });
        shared += start.elapsed().as_secs_f64();
        assert_eq!(back, whole, "frame {frame}");
        mem::swap(&mut front, &mut back);
    }
    println!(
        "{FRAMES} frames, the same bits; one thread {:.2} ms a frame, {threads} threads {:.2} ms \
         with starting them anew in each",
        1e3 * alone / FRAMES as f64,
        1e3 * shared / FRAMES as f64,
    );
}
