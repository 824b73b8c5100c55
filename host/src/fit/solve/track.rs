//! The poses of all frames, and of the chosen ones from which the body is calibrated.

use glam::DQuat;

use super::body::{Body, Pose};
use super::calibrate::Frame;
use super::equations::{Layout, Pull, Sample, cost};
use super::pose::{Effort, fit, start};
use crate::clean::fill::Filled;
use crate::take::Take;

/// Frames tried when choosing, and chosen.
const TRIED: usize = 240;
const CHOSEN: usize = 56;
/// A frame shows enough for calibration if it shows this share of what the best one does.
const ENOUGH: f64 = 0.7;
/// Frames of one piece of work; each starts afresh, so that threads do not change the result.
const CHUNK: usize = 96;
/// Filled samples count by how sure they are against this, metres.
const SURE: f64 = 0.01;
/// What a joint may stray from the middle of its neighbours in time at 120 Hz, radians. Only turns
/// that the markers leave open give way to so weak a pull.
const UNSTEADY: f64 = 0.02;

/// The seen markers of a frame; with `filled`, missing ones are estimates of less weight.
pub fn samples(body: &Body, take: &Take, filled: Option<&Filled>, frame: usize) -> Vec<Sample> {
    let of = |(marker, own): (usize, &super::body::Marker)| {
        if let Some(at) = take.position(own.column, frame) {
            return Some(Sample {
                marker,
                at,
                weight: 1.0,
            });
        }
        let filled = filled?;
        let at = filled.take.position(own.column, frame)?;
        let ratio = f64::from(filled.sigma(own.column, frame)) / SURE;
        let weight = 0.5 / (1.0 + ratio * ratio);
        Some(Sample { marker, at, weight })
    };
    body.markers.iter().enumerate().filter_map(of).collect()
}

/// Frames with poses that differ as much as the take allows: (frame number, frame).
pub fn choose(body: &Body, take: &Take) -> Vec<(usize, Frame)> {
    let layout = Layout::new(body);
    let stride = take.frame_count().div_ceil(TRIED).max(1);
    let effort = Effort {
        steps: 10,
        enough: 1e-3,
    };
    let numbers: Vec<usize> = (0..take.frame_count()).step_by(stride).collect();
    let tried = in_parallel(&numbers, &|part: &[usize], out: &mut Vec<_>| {
        for &number in part {
            let samples = samples(body, take, None, number);
            let Some(pose) = start(body, &samples) else {
                continue;
            };
            let (pose, cost) = fit(body, &layout, &samples, pose, None, effort);
            let mean = cost / samples.len() as f64;
            out.push((number, Frame { samples, pose }, mean));
        }
    });
    let most = tried.iter().map(|row| row.1.samples.len()).max();
    let least = ENOUGH * most.unwrap_or(0) as f64;
    let mut costs: Vec<f64> = tried.iter().map(|row| row.2).collect();
    costs.sort_by(f64::total_cmp);
    let usual = costs.get(costs.len() / 2).copied().unwrap_or(0.0);
    let mut open: Vec<(usize, Frame)> = tried
        .into_iter()
        .filter(|(_, frame, cost)| {
            frame.samples.len() as f64 >= least && *cost <= 4.0 * usual + 1e-9
        })
        .map(|(number, frame, _)| (number, frame))
        .collect();
    // Farthest point first.
    let mut chosen: Vec<(usize, Frame)> = Vec::new();
    let mut away = vec![f64::INFINITY; open.len()];
    while chosen.len() < CHOSEN && !open.is_empty() {
        let furthest = (0..open.len()).max_by(|&a, &b| {
            let key = |at: usize| (away[at], open[at].1.samples.len());
            key(a).0.total_cmp(&key(b).0).then(key(a).1.cmp(&key(b).1))
        });
        let at = furthest.unwrap_or(0);
        let one = open.swap_remove(at);
        away.swap_remove(at);
        for (away, (_, frame)) in away.iter_mut().zip(&open) {
            *away = away.min(difference(&frame.pose, &one.1.pose));
        }
        chosen.push(one);
    }
    chosen.sort_by_key(|(number, _)| *number);
    chosen
}

/// Sum of squared sines of half the angles between turns; the root's heading does not count.
fn difference(a: &Pose, b: &Pose) -> f64 {
    let turns = a.turns.iter().zip(&b.turns).skip(1);
    turns.map(|(a, b)| 1.0 - a.dot(*b).powi(2)).sum()
}

/// Poses of all frames, and how many frames showed too little for one and took over their
/// neighbours'. `None` where no frame shows enough.
pub fn track(
    body: &Body,
    take: &Take,
    filled: Option<&Filled>,
    progress: &(dyn Fn(usize) + Sync),
) -> Option<(Vec<Pose>, usize)> {
    let layout = Layout::new(body);
    let effort = Effort {
        steps: 8,
        enough: 1e-4,
    };
    let numbers: Vec<usize> = (0..take.frame_count()).collect();
    let found = in_parallel(&numbers, &|part: &[usize], out: &mut Vec<_>| {
        let mut last: Option<Pose> = None;
        for &number in part {
            let samples = samples(body, take, filled, number);
            let fresh = start(body, &samples);
            let pose = match (fresh, last.take()) {
                (Some(fresh), Some(last)) => {
                    let loss = |pose: &Pose| cost(body, &layout, &samples, pose, None);
                    let last_is_better = loss(&last) <= loss(&fresh);
                    Some(if last_is_better { last } else { fresh })
                }
                (Some(fresh), None) => Some(fresh),
                // Too little for a fresh start, enough to go on.
                (None, Some(last)) if samples.len() >= 4 => Some(last),
                (None, _) => None,
            };
            last = pose.map(|pose| fit(body, &layout, &samples, pose, None, effort).0);
            out.push((samples, last.clone()));
            progress(1);
        }
    });
    let (samples, poses): (Vec<Vec<Sample>>, Vec<Option<Pose>>) = found.into_iter().unzip();
    let held = poses.iter().filter(|pose| pose.is_none()).count();
    let mut poses = bridge(poses)?;
    let spread = UNSTEADY * (120.0 / take.rate()).powi(2).max(1.0);
    let effort = Effort {
        steps: 2,
        enough: 1e-3,
    };
    for parity in [1, 0, 1, 0] {
        let numbers: Vec<usize> = (1..poses.len().saturating_sub(1))
            .filter(|number| number % 2 == parity)
            .collect();
        let steady = in_parallel(&numbers, &|part: &[usize], out: &mut Vec<_>| {
            for &number in part {
                let (before, after) = (&poses[number - 1], &poses[number + 1]);
                let turns = before.turns.iter().zip(&after.turns);
                let pull = Pull {
                    turns: turns.map(|(a, b)| a.slerp(*b, 0.5)).collect(),
                    spread,
                };
                let from = poses[number].clone();
                if samples[number].len() < 4 {
                    out.push(from);
                    continue;
                }
                let (pose, _) = fit(body, &layout, &samples[number], from, Some(&pull), effort);
                out.push(pose);
            }
        });
        for (number, pose) in numbers.into_iter().zip(steady) {
            poses[number] = pose;
        }
    }
    Some((poses, held))
}

/// Frames without a pose take one between their neighbours'.
fn bridge(poses: Vec<Option<Pose>>) -> Option<Vec<Pose>> {
    let known: Vec<usize> = (0..poses.len()).filter(|&at| poses[at].is_some()).collect();
    known.first()?;
    let between = |at: usize| {
        let after = known.partition_point(|&known| known <= at);
        let before = after.checked_sub(1).map(|before| known[before]);
        let after = known.get(after).copied();
        let pose = |at: usize| poses[at].clone();
        match (before, after) {
            (Some(before), Some(after)) if before != at => {
                let (a, b) = (pose(before)?, pose(after)?);
                let t = (at - before) as f64 / (after - before) as f64;
                let turns = a.turns.iter().zip(&b.turns);
                let turns: Vec<DQuat> = turns.map(|(a, b)| a.slerp(*b, t)).collect();
                Some(Pose {
                    root: a.root.lerp(b.root, t),
                    turns,
                })
            }
            (Some(before), _) => pose(before),
            (None, after) => pose(after?),
        }
    };
    (0..poses.len()).map(between).collect()
}

/// Works on chunks of `numbers` with all processors; the results stand in order.
fn in_parallel<T: Send>(
    numbers: &[usize],
    work: &(dyn Fn(&[usize], &mut Vec<T>) + Sync),
) -> Vec<T> {
    let chunks: Vec<&[usize]> = numbers.chunks(CHUNK).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut done: Vec<Vec<T>> = chunks.iter().map(|_| Vec::new()).collect();
    let next = std::sync::Mutex::new(chunks.iter().zip(done.iter_mut()));
    std::thread::scope(|scope| {
        for _ in 0..threads.min(chunks.len()) {
            scope.spawn(|| {
                loop {
                    let one = match next.lock() {
                        Ok(mut all) => all.next(),
                        Err(_) => None,
                    };
                    let Some((chunk, out)) = one else { break };
                    work(chunk, out);
                }
            });
        }
    });
    done.into_iter().flatten().collect()
}
