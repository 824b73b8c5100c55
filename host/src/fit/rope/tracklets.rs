//! Second thoughts about labels, from whole tracklets.
//!
//! A hand's marker lies now and then where the rope's end marker should be; while that lasts no
//! single frame can tell them apart. But the point was there before and is there after, and over
//! all that time its distance from the rope's next marker is not that of the segment. So points
//! are linked into tracklets, and each tracklet is the rope's as a whole or not at all.

use glam::DVec3;

use super::{Origin, PointFrames, RopeSample, Trace};

/// How far from where it is expected a point may continue a tracklet, metres; and what an
/// acceleration of that many metres a second squared adds.
const NEAR: f64 = 0.008;
const JERK: f64 = 60.0;
/// Least median deviation of a segment's length that is assumed, metres.
const LEAST_MEDIAN: f64 = 0.0007;
/// A tracklet whose links deviate by more than this many median deviations at its median, or at
/// its ninth decile by more than this many and twice the segment's own, is not the rope's.
const MEDIAN_LIMIT: f64 = 4.0;
const DECILE_LIMIT: f64 = 10.0;
/// Fewest links that tell anything.
const FEWEST: usize = 5;

/// (frame, point) of one thing, in consecutive frames.
type Tracklet = Vec<(usize, usize)>;

/// Lengths of a rope's segments, and the median and the ninth decile of their deviations, metres.
struct Segments {
    length: Vec<f64>,
    deviation: Vec<f64>,
    decile: Vec<f64>,
}

/// Takes away what is not the rope's and adds what is. O(frames x points^2)
pub(super) fn reconsider(trace: &mut Trace, points: &PointFrames) {
    let segments = Segments::of(trace);
    let owners = owners(trace, points);
    let tracklets = link(trace, points, &owners);
    let mut additions = Vec::new();
    for tracklet in &tracklets {
        let Some(marker) = usual_owner(tracklet, &owners) else {
            continue;
        };
        let verdict = segments.is_member(trace, points, tracklet, marker);
        for &(frame, point) in tracklet {
            let owner = owners[frame][point];
            if owner == Some(marker) && verdict == Some(false) {
                trace.frames[frame][marker].origin = Origin::Filled;
            } else if owner.is_none() && verdict == Some(true) {
                additions.push((frame, point, marker));
            }
        }
    }
    for (frame, point, marker) in additions {
        let sample = &mut trace.frames[frame][marker];
        if sample.point().is_none() {
            *sample = RopeSample {
                position: points.points[frame][point],
                origin: Origin::Measured(point),
                gap: 0,
                confidence: 0.9,
            };
        }
    }
}

/// `[frames][points]`: the marker that has taken each point.
fn owners(trace: &Trace, points: &PointFrames) -> Vec<Vec<Option<usize>>> {
    let frame = |(samples, points): (&Vec<RopeSample>, &Vec<DVec3>)| {
        let mut owners = vec![None; points.len()];
        for (marker, sample) in samples.iter().enumerate() {
            if let Some(point) = sample.point() {
                owners[point] = Some(marker);
            }
        }
        owners
    };
    trace.frames.iter().zip(&points.points).map(frame).collect()
}

/// The marker that has most of a tracklet's points, if any has one.
fn usual_owner(tracklet: &Tracklet, owners: &[Vec<Option<usize>>]) -> Option<usize> {
    let mut counts = std::collections::BTreeMap::new();
    for &(frame, point) in tracklet {
        if let Some(marker) = owners[frame][point] {
            *counts.entry(marker).or_insert(0) += 1;
        }
    }
    counts
        .into_iter()
        .max_by_key(|(_, count)| *count)
        .map(|(marker, _)| marker)
}

/// Links points of consecutive frames that are each other's nearest where they are expected.
fn link(trace: &Trace, points: &PointFrames, owners: &[Vec<Option<usize>>]) -> Vec<Tracklet> {
    let reach = NEAR + JERK / (points.rate * points.rate);
    let mut tracklets: Vec<Tracklet> = Vec::new();
    // (tracklet, velocity a frame) of each point of the frame before.
    let mut before: Vec<(usize, DVec3)> = Vec::new();
    for (frame, here) in points.points.iter().enumerate() {
        let expected: Vec<DVec3> = before
            .iter()
            .enumerate()
            .map(|(point, (_, velocity))| points.points[frame - 1][point] + *velocity)
            .collect();
        let nearest = |at: DVec3, among: &[DVec3]| {
            let distances = among.iter().map(|p| p.distance_squared(at)).enumerate();
            let best = distances.min_by(|a, b| a.1.total_cmp(&b.1));
            best.filter(|(_, square)| *square < reach * reach)
                .map(|(index, _)| index)
        };
        let mut now = Vec::with_capacity(here.len());
        for (point, &position) in here.iter().enumerate() {
            let from = nearest(position, &expected)
                .filter(|&from| nearest(expected[from], here) == Some(point));
            let (tracklet, velocity) = match from {
                Some(from) => {
                    let (tracklet, velocity) = before[from];
                    let moved = position - points.points[frame - 1][from];
                    (tracklet, velocity.lerp(moved, 0.7))
                }
                None => {
                    tracklets.push(Vec::new());
                    // A marker of the rope is as fast as its trace.
                    let own = owners[frame][point].filter(|_| frame > 0);
                    let velocity = own.map_or(DVec3::ZERO, |marker| {
                        position - trace.frames[frame - 1][marker].position
                    });
                    (tracklets.len() - 1, velocity)
                }
            };
            tracklets[tracklet].push((frame, point));
            now.push((tracklet, velocity));
        }
        before = now;
    }
    tracklets
}

impl Segments {
    fn of(trace: &Trace) -> Self {
        let length = trace.segment_lengths();
        let (mut deviation, mut decile) = (Vec::new(), Vec::new());
        for (i, length) in length.iter().enumerate() {
            let off = trace.frames.iter().filter_map(|samples| {
                let both = samples[i].point().is_some() && samples[i + 1].point().is_some();
                both.then(|| (samples[i].position.distance(samples[i + 1].position) - length).abs())
            });
            let mut off: Vec<f64> = off.collect();
            off.sort_unstable_by(f64::total_cmp);
            let at = |share: usize| off.get(off.len() * share / 10).copied().unwrap_or(0.0);
            deviation.push(at(5).max(LEAST_MEDIAN));
            decile.push(at(9));
        }
        Self {
            length,
            deviation,
            decile,
        }
    }

    /// Whether all of a tracklet lies as far from the neighbours of `marker` as that should; `None`
    /// where too few neighbours are measured.
    fn is_member(
        &self,
        trace: &Trace,
        points: &PointFrames,
        tracklet: &Tracklet,
        marker: usize,
    ) -> Option<bool> {
        let mut deviations = Vec::new();
        let mut usual = 0.0_f64;
        for &(frame, point) in tracklet {
            let position = points.points[frame][point];
            let neighbours = [
                marker.checked_sub(1).map(|other| (other, other)),
                Some((marker + 1, marker)),
            ];
            for (other, segment) in neighbours.into_iter().flatten() {
                let Some(sample) = trace.frames[frame].get(other) else {
                    continue;
                };
                let Some(length) = self.length.get(segment).filter(|l| l.is_finite()) else {
                    continue;
                };
                if sample.point().is_some_and(|taken| taken != point) {
                    let off = (sample.position.distance(position) - length).abs();
                    deviations.push(off / self.deviation[segment]);
                    usual = usual.max(self.decile[segment] / self.deviation[segment]);
                }
            }
        }
        if deviations.len() < FEWEST {
            return None;
        }
        deviations.sort_unstable_by(f64::total_cmp);
        let decile = deviations[deviations.len() * 9 / 10];
        let middle = deviations[deviations.len() / 2];
        Some(middle < MEDIAN_LIMIT && decile < DECILE_LIMIT.max(2.0 * usual))
    }
}
