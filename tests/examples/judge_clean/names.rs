//! Pairs of named markers of real recordings are exchanged for a while, and looked for.

use std::ops::Range;

use sinew_host::clean::exchange;
use sinew_host::take::Take;
use sinew_tests::Random;
use sinew_tests::hidden::take;

use crate::Options;
use crate::gaps::{FILES, OTHERS};

/// Recordings with names on which nothing was chosen either.
const MORE: [&str; 3] = [
    "c3d_testsuite/vicon_FunctionalWalk_146pts.c3d",
    "c3d_testsuite/sample04_sub_labels.c3d",
    "c3d/optotrak_racing_full.c3d",
];
/// Frames by which an end may be missed.
const NEAR: usize = 13;

/// What was done to a take.
struct Made {
    pair: [usize; 2],
    frames: Range<usize>,
    /// Frames at the start in which neither is seen.
    gap: usize,
}

pub(crate) fn run(options: &Options) {
    let (mut made, mut found) = (0, 0);
    let files = FILES.iter().chain(&OTHERS).chain(&MORE);
    for file in files.filter(|file| options.wants(file)) {
        let Some(mut take) = take(file) else { continue };
        let own = exchange::find(&take, &|_| ());
        println!("{file}: {} as it is", tell(&take, &own));
        own.undo(&mut take);
        for seed in options.seeds_or(&[1, 2, 3, 4]) {
            let Some((broken, one)) = break_names(&take, seed) else {
                continue;
            };
            let misnamed = exchange::find(&broken, &|_| ());
            let hit = misnamed.exchanges.iter().any(|e| {
                e.columns == one.pair
                    && e.frames.start.abs_diff(one.frames.start) <= NEAR + one.gap
                    && e.frames.end.abs_diff(one.frames.end) <= NEAR
            });
            made += 1;
            found += usize::from(hit);
            if !hit || misnamed.exchanges.len() > 1 {
                let [a, b] = one.pair.map(|marker| &take.labels()[marker]);
                println!(
                    "  seed {seed}: {a} and {b} in {:?}, unseen for {}: {}",
                    one.frames,
                    one.gap,
                    tell(&take, &misnamed)
                );
            }
        }
    }
    println!("{found} of {made} found");
}

fn tell(take: &Take, misnamed: &exchange::Misnamed) -> String {
    let each = misnamed.exchanges.iter().map(|one| {
        let [a, b] = one.columns.map(|column| &take.labels()[column]);
        format!("{a} and {b} in {:?}", one.frames)
    });
    let list: Vec<String> = each.collect();
    format!("[{}], {} stray", list.join("; "), misnamed.strays.len())
}

/// Two markers exchanged for 0.1 s to 0.4 of the take; `None` where no two are seen long enough.
fn break_names(take: &Take, seed: u64) -> Option<(Take, Made)> {
    let mut random = Random(seed);
    let (markers, frames) = (take.marker_count(), take.frame_count());
    for _ in 0..100 {
        let (a, b) = (random.below(markers), random.below(markers));
        let len = (0.1 * take.rate()) as usize + random.below((frames * 4 / 10).max(1));
        let len = len.min(frames / 2);
        let start = random.below(frames - len);
        let seen = |frame: &usize| [a, b].iter().all(|&m| take.position(m, *frame).is_some());
        let both = (start..start + len).filter(seen).count();
        if a == b || 2 * both < len || both < 5 {
            continue;
        }
        let gap = (10 * random.below(3)).min(len / 2);
        let mut broken = take.clone();
        for frame in start..start + len {
            let place = |marker| {
                take.position(marker, frame)
                    .filter(|_| frame >= start + gap)
            };
            broken.set_position(a, frame, place(b));
            broken.set_position(b, frame, place(a));
        }
        let made = Made {
            pair: [a.min(b), a.max(b)],
            frames: start..start + len,
            gap,
        };
        return Some((broken, made));
    }
    None
}
