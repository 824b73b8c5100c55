//! Figure 4.4: the error in a gap against its length, by how many neighbours are missing.

use sinew_host::fit::rope::Trace;
use sinew_host::studio::rope::{Capture, Label, Take};

use super::scenes::{CASES, Case, Way, capture, error, film, run};

const LENGTHS: [usize; 5] = [10, 20, 30, 60, 100];
const NEIGHBOURS: [usize; 4] = [1, 2, 3, 5];
/// Frames between two gaps.
const PAUSE: usize = 60;
/// The first gap begins after the motion has set in.
const FIRST: f64 = 1.6;
/// The thesis' own bound for a lost trace, metres.
const LOST: f64 = 0.5;

/// Errors of one way on gaps of one kind.
#[derive(Clone, Copy, Default)]
pub struct Score {
    sum: f64,
    samples: usize,
    worst: f64,
    lost: usize,
    swapped: usize,
    traces: usize,
}

impl Score {
    pub fn mean(&self) -> f64 {
        1e3 * self.sum / self.samples.max(1) as f64
    }

    fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.samples += other.samples;
        self.worst = self.worst.max(other.worst);
        self.lost += other.lost;
        self.swapped += other.swapped;
        self.traces += other.traces;
    }

    pub fn cell(&self) -> String {
        let mut text = format!("{:6.1} {:6.0}", self.mean(), 1e3 * self.worst);
        let mark = |count: usize, letter: char| {
            if count > 0 {
                format!("{count}{letter}")
            } else {
                String::new()
            }
        };
        text += &format!(" {:>7}", mark(self.lost, 'L') + &mark(self.swapped, 'S'));
        text
    }
}

/// Gaps of one kind in one take: (first frame, first marker) of each.
fn gaps(take: &Take, length: usize, neighbours: usize, at_end: bool) -> Vec<(usize, usize)> {
    let markers = take.rope[0].len();
    let first = (FIRST * take.rate) as usize;
    let starts = (first..).step_by(length + PAUSE);
    let starts = starts.take_while(|start| start + length + PAUSE / 2 < take.rope.len());
    let places = starts.enumerate().map(|(k, start)| {
        let room = markers - neighbours;
        let marker = match (at_end, k % 2) {
            (true, 0) => 0,
            (true, _) => room,
            // Two stay on each side.
            (false, _) => 2 + (k * 7) % (room - 3),
        };
        (start, marker)
    });
    places.collect()
}

/// Runs all ways on gaps of one kind.
pub fn score(
    take: &Take,
    noise: f64,
    length: usize,
    neighbours: usize,
    at_end: bool,
) -> [Score; 3] {
    let gaps = gaps(take, length, neighbours, at_end);
    let hidden = |frame: usize, marker: usize| {
        let holds = |&(start, first): &(usize, usize)| {
            (start..start + length).contains(&frame)
                && (first..first + neighbours).contains(&marker)
        };
        gaps.iter().any(holds)
    };
    let shown = capture(take, noise, &hidden);
    Way::ALL.map(|way| {
        let trace = run(&shown, way);
        let mut total = Score::default();
        for &(start, first) in &gaps {
            for marker in first..first + neighbours {
                total.add(&one(&trace, take, &shown, start, length, marker));
            }
        }
        total
    })
}

fn one(
    trace: &Trace,
    take: &Take,
    shown: &Capture,
    start: usize,
    length: usize,
    marker: usize,
) -> Score {
    let mut score = Score {
        traces: 1,
        ..Score::default()
    };
    for frame in start..start + length {
        let off = error(trace, take, frame, marker);
        score.sum += off;
        score.samples += 1;
        score.worst = score.worst.max(off);
    }
    score.lost = usize::from(score.worst > LOST);
    // A trace that has taken another's point in the gap, or takes one after it.
    let end = (start + length + PAUSE / 2).min(trace.frames.len());
    let strange = (start..end).any(|frame| {
        let point = trace.frames[frame][marker].point();
        point.is_some_and(|p| shown.frames[frame].labels[p] != Label::Rope(marker))
    });
    score.swapped = usize::from(strange);
    score
}

fn table(case: &Case, rate: f64, at_end: bool, lengths: &[usize], neighbours: &[usize]) {
    let place = if at_end { "end" } else { "interior" };
    println!(
        "\n{}, {rate} Hz, {place}: mean mm, worst mm, traces lost (L), swapped (S)",
        case.name
    );
    print!("{:>4} {:>5}", "gap", "miss");
    for way in Way::ALL {
        print!(" | {:^21}", way.name());
    }
    println!();
    let takes = [1, 2].map(|seed| film(case, rate, seed));
    for &missing in neighbours {
        for &length in lengths {
            let mut scores = [Score::default(); 3];
            for take in &takes {
                for (total, one) in scores
                    .iter_mut()
                    .zip(score(take, 0.0005, length, missing, at_end))
                {
                    total.add(&one);
                }
            }
            print!("{length:>4} {missing:>5}");
            for score in &scores {
                print!(" | {}", score.cell());
            }
            let bars = bars(length, missing);
            if case.moderate && !at_end && bars.iter().any(|bar| bar.is_finite()) {
                let [_, live, both] = &scores;
                let held = live.mean() <= bars[0]
                    && both.mean() <= bars[1]
                    && live.lost == 0
                    && both.lost == 0;
                let word = if held { "held" } else { "MISSED" };
                let number = |bar: f64| {
                    if bar < f64::MAX {
                        bar.to_string()
                    } else {
                        "-".into()
                    }
                };
                print!(" | bar {} {} 0L: {word}", number(bars[0]), number(bars[1]));
            }
            println!();
        }
    }
}

/// Millimetres, live and two-sided, for moderate motion and gaps inside.
fn bars(length: usize, missing: usize) -> [f64; 2] {
    match (length, missing) {
        (10, 1) => [4.0, 1.5],
        (30, 1) => [9.0, 5.0],
        (30, 3) => [30.0, 15.0],
        (..=60, _) => [f64::MAX; 2],
        _ => [f64::INFINITY; 2],
    }
}

pub fn print(thorough: bool) {
    if !thorough {
        table(&CASES[0], 100.0, false, &LENGTHS[..1], &NEIGHBOURS[..1]);
        return;
    }
    for case in &CASES {
        for rate in [100.0, 120.0] {
            for at_end in [false, true] {
                table(case, rate, at_end, &LENGTHS, &NEIGHBOURS);
            }
        }
    }
}
