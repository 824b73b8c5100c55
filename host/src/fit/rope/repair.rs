//! Gaps of a rope's markers, filled from the frames before and after them.
//!
//! How a marker follows from its neighbours is learned from the frames in which all of them are
//! measured: weights for each neighbour's position a moment ago, now and in a moment (waves run
//! along a rope, so its neighbours' past and future tell about a marker), by ridge regression
//! toward the smooth curve through the neighbours. What the neighbours cannot tell, the residual,
//! is bridged over the gap by the best linear estimate under its own autocovariance (Wiener 1949,
//! in discrete time), which pulls the ends of the gap onto the measured samples. Weights are
//! scalars, so that nothing depends on the direction of the axes except gravity's own.

use glam::DVec3;

mod model;

use super::{Origin, Trace};
use model::Model;

/// How gaps are filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairOptions {
    /// Seconds before and after a gap from which is learned.
    pub memory: f64,
    /// Measured samples that lie this many standard deviations, and at least 15 mm, from what
    /// their neighbours in space and time say are ghosts.
    pub outlier: f64,
}

impl Default for RepairOptions {
    fn default() -> Self {
        Self {
            memory: 4.0,
            outlier: 8.0,
        }
    }
}

/// Neighbours on each side that a marker is learned from.
const SUPPORTS: usize = 3;
/// Seconds between a neighbour's past, present and future.
const STRIDE: f64 = 0.02;
/// Samples on each side of a gap that its residual is bridged from.
const ANCHORS: usize = 24;
/// Passes over the segments' lengths.
const SWEEPS: usize = 8;
/// Noise of a measured coordinate that is assumed at least, metres.
const LEAST_NOISE: f64 = 1e-4;

/// `[markers][frames]` positions with what is known of them.
struct Grid {
    rate: f64,
    frames: usize,
    position: Vec<Vec<DVec3>>,
    /// Measured, or filled already.
    known: Vec<Vec<bool>>,
    /// Standard deviation of a filled sample, metres.
    doubt: Vec<Vec<f64>>,
    /// Standard deviation of a measured coordinate, metres.
    noise: f64,
    /// Metres along the rope.
    arc: Vec<f64>,
}

/// A run of frames in which a marker is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Gap {
    marker: usize,
    frames: std::ops::Range<usize>,
}

/// Fills every gap of `trace` and judges each fill; measured samples stay as they are, except
/// ghosts, which are replaced. O(samples in gaps x frames of memory)
#[must_use]
pub fn repair(trace: &Trace, options: &RepairOptions) -> Trace {
    let mut repaired = trace.clone();
    let markers = trace.marker_count();
    if markers == 0 || trace.frames.is_empty() {
        return repaired;
    }
    let lengths = trace.segment_lengths();
    let mut grid = Grid::new(trace, &lengths);
    let gaps = grid.gaps();
    // Gaps of about one length lean on none of each other: neighbours that vanish together are all
    // told from what stays.
    let alike = |a: &Gap, b: &Gap| 2 * b.frames.len() <= 3 * a.frames.len() + 4;
    for group in gaps.chunk_by(alike) {
        for gap in group {
            grid.fill(gap, options);
        }
        for gap in group {
            grid.known[gap.marker][gap.frames.clone()].fill(true);
        }
    }
    grid.restore_lengths(&lengths, trace);
    for (marker, gap) in gaps.iter().map(|gap| (gap.marker, &gap.frames)) {
        for frame in gap.clone() {
            let sample = &mut repaired.frames[frame][marker];
            let doubt = grid.doubt[marker][frame];
            sample.position = grid.position[marker][frame];
            sample.confidence = 1.0 / (1.0 + (doubt / 0.03).powi(2));
            if doubt <= LOST {
                sample.origin = Origin::Filled;
            } else {
                sample.origin = Origin::Lost;
            }
            let (before, after) = (frame + 1 - gap.start, gap.end - frame);
            sample.gap = before.min(after) as u32;
        }
    }
    repaired
}

/// Beyond this standard deviation, metres, a fill is a guess.
const LOST: f64 = 0.25;

impl Grid {
    fn new(trace: &Trace, lengths: &[f64]) -> Self {
        let markers = trace.marker_count();
        let column = |marker: usize| trace.frames.iter().map(move |frame| &frame[marker]);
        let mut arc = vec![0.0];
        for length in lengths {
            let last = arc[arc.len() - 1];
            arc.push(last + if length.is_nan() { 0.1 } else { *length });
        }
        let mut grid = Self {
            rate: trace.rate,
            frames: trace.frames.len(),
            position: (0..markers)
                .map(|m| column(m).map(|s| s.position).collect())
                .collect(),
            known: (0..markers)
                .map(|m| column(m).map(|s| s.point().is_some()).collect())
                .collect(),
            doubt: vec![vec![0.0; trace.frames.len()]; markers],
            noise: LEAST_NOISE,
            arc,
        };
        grid.noise = grid.measured_noise().max(LEAST_NOISE);
        grid
    }

    /// From fourth differences of measured runs: motion is smooth, noise is not.
    fn measured_noise(&self) -> f64 {
        let mut squares = Vec::new();
        for (position, known) in self.position.iter().zip(&self.known) {
            for (p, k) in position.windows(5).zip(known.windows(5)) {
                if k.iter().all(|&k| k) {
                    let difference = p[0] - 4.0 * p[1] + 6.0 * p[2] - 4.0 * p[3] + p[4];
                    squares.push(difference.length_squared());
                }
            }
        }
        // The lower quartile: where the motion is quiet. The median of a chi-square with three
        // degrees of freedom is 2.37, its lower quartile 1.21; 70 is the filter's gain.
        if squares.is_empty() {
            return 0.0;
        }
        let quarter = squares.len() / 4;
        let (_, quartile, _) = squares.select_nth_unstable_by(quarter, f64::total_cmp);
        (*quartile / (1.21 * 70.0)).sqrt()
    }

    /// The shortest first: a longer one may lean on them.
    fn gaps(&self) -> Vec<Gap> {
        let mut gaps = Vec::new();
        for (marker, known) in self.known.iter().enumerate() {
            let mut frame = 0;
            while let Some(start) = (frame..self.frames).find(|&f| !known[f]) {
                let end = (start..self.frames).find(|&f| known[f]);
                let end = end.unwrap_or(self.frames);
                gaps.push(Gap {
                    marker,
                    frames: start..end,
                });
                frame = end;
            }
        }
        gaps.sort_by_key(|gap| (gap.frames.len(), gap.frames.start, gap.marker));
        gaps
    }

    fn fill(&mut self, gap: &Gap, options: &RepairOptions) {
        let stride = (STRIDE * self.rate).round().max(1.0) as usize;
        let model = self
            .supports(gap, stride)
            .and_then(|supports| Model::learn(self, gap, supports, stride, options));
        let samples = match model {
            Some(model) => model.bridge(self, gap),
            None => self.coast(gap),
        };
        for (frame, position, doubt) in samples {
            self.position[gap.marker][frame] = position;
            self.doubt[gap.marker][frame] = doubt;
        }
    }

    /// Where no neighbour is there: a cubic from the velocity before the gap to that after it.
    /// What is measured on one side only, or not at all, stays as the tracker has filled it.
    fn coast(&self, gap: &Gap) -> Vec<(usize, DVec3, f64)> {
        let (track, known) = (&self.position[gap.marker], &self.known[gap.marker]);
        let (start, end) = (gap.frames.start, gap.frames.end);
        let seen = |frame: usize| known.get(frame) == Some(&true);
        let length = gap.frames.len() as f64 + 1.0;
        if !(start > 0 && seen(start - 1) && seen(end)) {
            return gap.frames.clone().map(|f| (f, track[f], 1.0)).collect();
        }
        let (from, to) = (track[start - 1], track[end]);
        let before = if start > 1 && seen(start - 2) {
            from - track[start - 2]
        } else {
            DVec3::ZERO
        };
        let after = if seen(end + 1) {
            track[end + 1] - to
        } else {
            DVec3::ZERO
        };
        // Accelerations of 20 m/s2 that nobody sees.
        let doubt = 20.0 * (length / self.rate).powi(2) / 8.0;
        let sample = |frame: usize| {
            let t = (frame + 1 - start) as f64 / length;
            let (t2, t3) = (t * t, t * t * t);
            let position = from * (2.0 * t3 - 3.0 * t2 + 1.0)
                + to * (3.0 * t2 - 2.0 * t3)
                + before * length * (t3 - 2.0 * t2 + t)
                + after * length * (t3 - t2);
            (frame, position, doubt * 4.0 * t * (1.0 - t))
        };
        gap.frames.clone().map(sample).collect()
    }

    /// The nearest markers on each side that are known all through the gap; nearest first.
    fn supports(&self, gap: &Gap, stride: usize) -> Option<Vec<usize>> {
        let from = gap.frames.start.saturating_sub(stride);
        let to = (gap.frames.end + stride).min(self.frames);
        let usable = |&marker: &usize| self.known[marker][from..to].iter().all(|&k| k);
        let left: Vec<usize> = (0..gap.marker)
            .rev()
            .filter(usable)
            .take(SUPPORTS + 1)
            .collect();
        let right = gap.marker + 1..self.known.len();
        let right: Vec<usize> = right.filter(usable).take(SUPPORTS + 1).collect();
        let most = |other: &[usize]| {
            if other.is_empty() {
                SUPPORTS + 1
            } else {
                SUPPORTS
            }
        };
        let (on_left, on_right) = (most(&right), most(&left));
        let mut all: Vec<usize> = left.into_iter().take(on_left).collect();
        all.extend(right.into_iter().take(on_right));
        all.sort_by_key(|marker| marker.abs_diff(gap.marker));
        (!all.is_empty()).then_some(all)
    }

    /// Moves filled samples so that their segments have the rope's lengths, each as far as it is
    /// in doubt (a Kalman update a segment; Müller et al. 2007 call it a projection).
    fn restore_lengths(&mut self, lengths: &[f64], trace: &Trace) {
        for frame in 0..self.frames {
            let filled = |marker: usize| trace.frames[frame][marker].point().is_none();
            if !(0..self.known.len()).any(filled) {
                continue;
            }
            let variance = |grid: &Self, marker: usize| {
                if filled(marker) {
                    grid.doubt[marker][frame].powi(2).max(grid.noise.powi(2))
                } else {
                    grid.noise.powi(2)
                }
            };
            for sweep in 0..SWEEPS {
                for step in 0..lengths.len() {
                    let i = if sweep % 2 == 0 {
                        step
                    } else {
                        lengths.len() - 1 - step
                    };
                    if lengths[i].is_nan() || !(filled(i) || filled(i + 1)) {
                        continue;
                    }
                    let (a, b) = (variance(self, i), variance(self, i + 1));
                    let link = self.position[i + 1][frame] - self.position[i][frame];
                    let length = link.length().max(1e-9);
                    // A chord is shorter than the rope between its ends.
                    let slack = if length < lengths[i] { 0.06 } else { 0.015 } * lengths[i];
                    let pull = link * ((length - lengths[i]) / (length * (a + b + slack * slack)));
                    if filled(i) {
                        self.position[i][frame] += pull * a;
                    }
                    if filled(i + 1) {
                        self.position[i + 1][frame] -= pull * b;
                    }
                }
            }
        }
    }
}
