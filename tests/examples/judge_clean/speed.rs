//! 300 s of 350 markers, cleaned from end to end.

use std::time::Instant;

use glam::DVec3;
use sinew_host::clean::despike;
use sinew_host::clean::fill::{FillOptions, fill};
use sinew_host::clean::merge::{MergeOptions, merge};
use sinew_host::clean::smooth::{SmoothOptions, smooth};
use sinew_host::take::Take;

use crate::labels::capture;

const SECONDS: f64 = 300.0;

pub(crate) fn run() {
    let Some(capture) = capture(1, 301) else {
        return;
    };
    let take = there_and_back(&capture.take().expect("a take"));
    let start = Instant::now();
    let lap = |what: &str| println!("{what:>8} {:7.1} s", start.elapsed().as_secs_f64());
    println!(
        "{} columns, {} frames, {:.0} s",
        take.marker_count(),
        take.frame_count(),
        take.frame_count() as f64 / take.rate()
    );
    let merged = merge(&take, &MergeOptions::default(), &|_| ()).expect("a merged take");
    println!(
        "{} partial trajectories, {} markers",
        merged.fragments.len(),
        merged.take.marker_count()
    );
    lap("merge");
    let mut take = merged.take;
    despike(&mut take);
    lap("despike");
    let mut filled = fill(&take, &FillOptions::default(), &|| {});
    lap("fill");
    smooth(&mut filled, &SmoothOptions::default(), &|| {});
    lap("smooth");
}

/// A capture played forward and backward in turn until it lasts [`SECONDS`].
fn there_and_back(take: &Take) -> Take {
    let count = take.frame_count();
    let frames = (SECONDS * take.rate()) as usize;
    let period = 2 * (count - 1);
    let source = |frame: usize| {
        let at = frame % period;
        at.min(period - at)
    };
    let positions: Vec<DVec3> = (0..take.marker_count())
        .flat_map(|marker| {
            let path = take.trajectory(marker);
            (0..frames).map(move |frame| path[source(frame)])
        })
        .collect();
    Take::new(take.labels().to_vec(), take.rate(), frames, positions).expect("a take")
}
