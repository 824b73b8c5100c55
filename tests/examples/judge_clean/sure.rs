//! How sure filled samples are against how sure they say they are: measured stretches of every
//! marker are hidden, a few lengths at once and apart, and filled again.

use sinew_host::clean::fill::{FillOptions, fill_markers};
use sinew_host::take::Take;
use sinew_tests::Random;
use sinew_tests::hidden::take;

use crate::Options;
use crate::gaps::{FILES, OTHERS};

const LENGTHS: [usize; 6] = [1, 3, 10, 30, 100, 300];
/// Frames kept between hidden stretches.
const APART: usize = 60;
/// Markers of which one is broken at a time, so that each keeps its neighbours.
const GROUPS: usize = 6;

pub(crate) fn run(options: &Options) {
    println!(
        "share of coordinates within 1 and 2 deviations (normal: 0.683, 0.954); rms over deviation"
    );
    let mut all = vec![Vec::new(); LENGTHS.len()];
    for file in FILES
        .iter()
        .chain(&OTHERS)
        .filter(|file| options.wants(file))
    {
        let Some(take) = take(file) else { continue };
        let mut scores = vec![Vec::new(); LENGTHS.len()];
        for seed in options.seeds_or(&[1]) {
            hide(&take, seed, &mut scores);
        }
        println!("{file}");
        for (at, found) in scores.into_iter().enumerate() {
            row(LENGTHS[at], &found);
            all[at].extend(found);
        }
    }
    println!("all");
    for (length, found) in LENGTHS.iter().zip(&all) {
        row(*length, found);
    }
}

fn row(length: usize, scores: &[f64]) {
    if scores.is_empty() {
        return;
    }
    let within = |most: f64| {
        let count = scores.iter().filter(|score| score.abs() <= most).count();
        count as f64 / scores.len() as f64
    };
    let square = scores.iter().map(|score| score * score).sum::<f64>() / scores.len() as f64;
    println!(
        "  {length:4} frames: {:.3} {:.3} rms {:.2} of {}",
        within(1.0),
        within(2.0),
        square.sqrt(),
        scores.len()
    );
}

/// Adds, for each length, errors of every hidden coordinate over their deviation.
fn hide(take: &Take, seed: u64, scores: &mut [Vec<f64>]) {
    let mut random = Random(seed);
    for group in 0..GROUPS {
        let markers: Vec<usize> = (group..take.marker_count()).step_by(GROUPS).collect();
        let mut broken = take.clone();
        let mut hidden: Vec<(usize, usize, usize)> = Vec::new();
        for &marker in &markers {
            let chosen = stretches(take, marker, &mut random);
            for &(kind, start) in &chosen {
                for frame in start..start + LENGTHS[kind] {
                    broken.set_position(marker, frame, None);
                }
            }
            hidden.extend(
                chosen
                    .into_iter()
                    .map(|(kind, start)| (marker, kind, start)),
            );
        }
        let filled = fill_markers(&broken, &markers, &FillOptions::default(), &|| {});
        for (marker, kind, start) in hidden {
            for frame in start..start + LENGTHS[kind] {
                let truth = take.trajectory(marker)[frame];
                if let Some(found) = filled.take.position(marker, frame) {
                    let sigma = f64::from(filled.sigma(marker, frame));
                    scores[kind].extend(((found - truth) / sigma).to_array());
                }
            }
        }
    }
}

/// One stretch of each length that fits: which length, first frame.
fn stretches(take: &Take, marker: usize, random: &mut Random) -> Vec<(usize, usize)> {
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (kind, &length) in LENGTHS.iter().enumerate().rev() {
        let is_free = |start: &usize| {
            chosen.iter().all(|&(other, at)| {
                start + length + APART <= at || at + LENGTHS[other] + APART <= *start
            })
        };
        let starts: Vec<usize> = take
            .traces(marker)
            .flat_map(|trace| trace.start + 1..trace.end.saturating_sub(length))
            .filter(is_free)
            .collect();
        if !starts.is_empty() {
            chosen.push((kind, starts[random.below(starts.len())]));
        }
    }
    chosen
}
