//! Table 1: what merging makes of 350 markers before 12 cameras.

use std::time::Instant;

use sinew_host::clean::despike;
use sinew_host::clean::fill::{FillOptions, fill};
use sinew_host::clean::merge::{MergeOptions, merge};
use sinew_host::studio::judge::Key;
use sinew_host::studio::{Capture, Direction, MarkerLayout, MarkerSet, Shot};
use sinew_tests::filming::{clip_at, film, human};
use sinew_tests::{hidden, root};

use crate::Options;

/// A motion: name, file from the project's root, times its speed, and chance of swaps.
pub(crate) const MOTIONS: [(&str, &str, f64, f64); 6] = [
    ("walk", "examples/data/walk.bvh", 1.0, 0.0),
    ("jump", "../shared/data/bvh/cmu_01_01.bvh", 1.0, 0.0),
    ("kneel", "examples/data/kneel.bvh", 1.0, 0.0),
    ("bend", "../shared/data/bvh/yxz_test2.bvh", 0.5, 0.0),
    ("kneel, swaps", "examples/data/kneel.bvh", 1.5, 0.5),
    (
        "walk12, swaps",
        "../shared/data/bvh/cmu_12_01_walk.bvh",
        1.5,
        0.5,
    ),
];

/// A motion as filmed with one seed, `None` where its file is absent.
pub(crate) fn capture(motion: usize, seed: u64) -> Option<Capture> {
    let (name, file, speed, swap_chance) = MOTIONS[motion];
    let path = root().join(file);
    if !path.exists() {
        sinew_tests::skip(&format!("{file} for {name}"));
        return None;
    }
    let markers = MarkerSet::new(human(), MarkerLayout::Dense(350), seed).expect("350 markers fit");
    let direction = Direction {
        speed,
        ..Direction::default()
    };
    let shot = Shot {
        swap_chance,
        seed,
        ..Shot::default()
    };
    Some(film(&clip_at(&path), &markers, direction, shot))
}

pub(crate) fn run(options: &Options) {
    println!(
        "motion        seed  frames  before  ghosts  after  markers  wrong  (%)     left  ghosts told  \
         wrong samples (%)  filled mm mean/median/95%/max  merge s  fill s"
    );
    for seed in options.seeds_or(&[101, 102, 103]) {
        for (motion, (name, ..)) in MOTIONS.iter().enumerate() {
            if options.wants(name)
                && let Some(capture) = capture(motion, seed)
            {
                judge(name, seed, &capture);
            }
        }
    }
}

fn judge(name: &str, seed: u64, capture: &Capture) {
    let key = Key::new(capture).expect("a capture");
    let take = capture.take().expect("a take");
    let start = Instant::now();
    let merged = merge(&take, &MergeOptions::default(), &|_| ()).expect("a merged take");
    let merging = start.elapsed().as_secs_f64();
    let labels = key.labels(&merged);
    let start = Instant::now();
    let mut take = merged.take.clone();
    despike(&mut take);
    let filled = fill(&take, &FillOptions::default(), &|| {});
    let filling = start.elapsed().as_secs_f64();
    let errors: Vec<f64> = key.fill_errors(&labels, &filled);
    let mm = |share| 1e3 * hidden::quantile(&errors, share);
    println!(
        "{name:13} {seed:4} {:7} {:7} {:7} {:6} {:8} {:6} ({:5.3}) {:5} {:7}/{:<5} {:8.4} {:13.2}/{:.2}/{:.2}/{:.1} {:18.1} {:7.1}",
        take.frame_count(),
        labels.real + labels.ghosts,
        labels.ghosts,
        labels.found,
        labels.markers,
        labels.wrong,
        100.0 * labels.wrong as f64 / labels.real as f64,
        labels.left,
        labels.ghosts_told,
        labels.ghosts,
        100.0 * labels.wrong_samples as f64 / labels.labelled_samples as f64,
        1e3 * hidden::mean(&errors),
        mm(0.5),
        mm(0.95),
        mm(1.0),
        merging,
        filling,
    );
    if std::env::var("FAULTS").is_ok() {
        for fault in &labels.faults {
            let at = merged.fragments.iter().position(|f| {
                f.column == fault.column
                    && f.start <= fault.first_frame
                    && fault.first_frame < f.end
            });
            let decision = at.and_then(|at| merged.decisions.iter().find(|d| d.fragment == at));
            println!("    {fault:?} {decision:?}");
        }
    }
}
