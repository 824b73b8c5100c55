//! Drives random frames through every stage and says how fast they went.
//!
//! `storm [FRAMES] [STAGE]`: ten million of each where no count is given; stages whose names hold
//! STAGE. The first frame that gives a number that is not finite, or writes where it must not, ends
//! it.

use std::env;
use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let frames = arguments
        .first()
        .map_or(Ok(10_000_000), |word| word.parse());
    let Ok(frames) = frames else {
        eprintln!("usage: storm [FRAMES] [STAGE]");
        return ExitCode::from(2);
    };
    let wanted = arguments.get(1).map_or("", String::as_str);
    for (name, run) in sinew_tests::storm::ALL {
        if !name.contains(wanted) {
            continue;
        }
        let start = Instant::now();
        run(frames, 1);
        let seconds = start.elapsed().as_secs_f64();
        let rate = frames as f64 / seconds;
        println!("{name:<22} {frames} frames, all finite, {rate:.0} a second");
    }
    ExitCode::SUCCESS
}
