//! Second thoughts: is there a better labelling of this frame than the one that time has led to?
//!
//! A trace that has slipped onto a hand's marker, or a fold that was closed by leaving a marker
//! out, agrees with its own past. Without the past it does not: the lengths are wrong, or a
//! marker is missing although its point is there. So a frame that looks suspicious is labelled
//! once more from the segments' lengths alone, and when that has been better for long enough, its
//! labelling is taken.

use super::associate::{Association, COST_MISSING, Goal, missing_price, tension};
use super::fill::Run;
use super::joint::fill_runs;
use super::others::Others;
use super::points::{NONE, Points};
use super::state::Track;
use super::vector::{dot, length};
use crate::row::Row;

/// How far in spacings a marker may be from where its trace is, as a standard deviation and as a
/// gate. A rope that has slipped along itself is a whole spacing off.
const DOUBT: f32 = 1.0;
const GATE: f32 = 1.3;
/// A link this unlikely makes a frame suspicious.
const SUSPICIOUS: f32 = 1.5;
/// Seconds of right lengths after which a trace surely has its own point.
const TRUSTED: f32 = 0.05;
/// Seconds without a point that do.
const ABSENT: f32 = 0.1;
/// Advantage of the new labelling that counts, and how much must add up before it is taken.
const LEAST_GAIN: f32 = 1.0;
const CONVINCING: f32 = 12.0;

/// Compares labellings and takes the better one.
pub(super) fn review<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    association: &mut Association<TRACES, POINTS>,
    others: &Others<POINTS>,
    points: &mut Points<POINTS>,
) {
    update_trust(track, others, points);
    if !is_suspicious(track, others, points) {
        track.unease = 0.0;
        return;
    }
    let count = track.measures.count;
    let spacing = track.measures.spacing;
    let mut goals = Row::<Goal, TRACES>::new();
    for i in 0..count {
        let centre = track.pose.now.at(i);
        let (doubt, gate) = (DOUBT * spacing, GATE * spacing);
        let since = track.since.at(i);
        goals.set(
            i,
            Goal::Seek {
                centre,
                doubt,
                gate,
                since,
                most: f32::MAX,
            },
        );
    }
    points.release_all();
    let mut labels = Row::<u16, TRACES>::new();
    labels.fill(NONE);
    association.solve(
        &track.measures,
        &goals,
        &Row::new(),
        others,
        points,
        |found| {
            labels.set(found.trace, found.point);
        },
    );
    let gain = price(track, others, points, &track.point) - price(track, others, points, &labels);
    if gain > LEAST_GAIN {
        track.unease += gain;
    } else {
        track.unease *= 0.5;
    }
    if track.unease > CONVINCING {
        adopt(track, points, &labels);
        track.unease = 0.0;
    }
    for i in 0..count {
        points.claim(track.point.at(i));
    }
}

/// A trace is trusted while it has had a point, and right lengths, for long enough; from the end
/// of that, frames are counted.
fn update_trust<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    others: &Others<POINTS>,
    points: &Points<POINTS>,
) {
    let needed = TRUSTED * track.pace.rate;
    for i in 0..track.measures.count {
        let fine = |k: usize| {
            link_price(track, points, k, &track.point).is_none_or(|price| price < SUSPICIOUS)
        };
        let contested = others.is_contested(track.point.at(i), track.since.at(i));
        let quiet = track.pose.known.at(i) && fine(i) && fine(i.wrapping_sub(1)) && !contested;
        let streak = if quiet {
            track.streak.at(i).saturating_add(1)
        } else {
            0
        };
        let trusted = f32::from(streak) >= needed || (quiet && track.since.at(i) == 0);
        let since = if trusted {
            0
        } else {
            track.since.at(i).saturating_add(1)
        };
        track.streak.set(i, streak);
        track.since.set(i, since);
    }
}

/// Whether a link is off or a marker has been missing for a while.
fn is_suspicious<const TRACES: usize, const POINTS: usize>(
    track: &Track<TRACES>,
    others: &Others<POINTS>,
    points: &Points<POINTS>,
) -> bool {
    let absent = ABSENT * track.pace.rate;
    (0..track.measures.count).any(|i| {
        f32::from(track.gap.at(i)) > absent
            || (track.is_unsure(i) && others.is_contested(track.point.at(i), track.since.at(i)))
            || link_price(track, points, i, &track.point).is_some_and(|p| p > SUSPICIOUS)
    })
}

/// Price of the link from trace `i` to the next that has a point, if both have one.
fn link_price<const TRACES: usize, const POINTS: usize>(
    track: &Track<TRACES>,
    points: &Points<POINTS>,
    i: usize,
    labels: &Row<u16, TRACES>,
) -> Option<f32> {
    let measures = &track.measures;
    if i >= measures.count || labels.at(i) == NONE {
        return None;
    }
    let next = (i + 1..measures.count).find(|&k| labels.at(k) != NONE)?;
    let span = points.at(usize::from(labels.at(next))) - points.at(usize::from(labels.at(i)));
    if next == i + 1 {
        return Some(tension(measures, i, span));
    }
    // Across missing markers a rope is not longer than it is, and seldom folded.
    let rope = measures.arc.at(next) - measures.arc.at(i);
    let span = length(span);
    let off = (span - 1.02 * rope).max(0.7 * rope - span).max(0.0) / (0.1 * measures.spacing);
    Some((off * off).min(COST_MISSING))
}

/// Price of a labelling of this frame, without its past.
fn price<const TRACES: usize, const POINTS: usize>(
    track: &Track<TRACES>,
    others: &Others<POINTS>,
    points: &Points<POINTS>,
    labels: &Row<u16, TRACES>,
) -> f32 {
    let near = DOUBT * track.measures.spacing;
    let mut sum = 0.0;
    for i in 0..track.measures.count {
        let point = labels.at(i);
        if point == NONE {
            sum += missing_price(i, track.measures.count);
        } else {
            let off = points.at(usize::from(point)) - track.pose.now.at(i);
            let square = dot(off, off);
            sum += square / (near * near) + others.price(point, i, track.since.at(i), square);
        }
        sum += link_price(track, points, i, labels).unwrap_or_default();
    }
    sum
}

/// Enters a labelling; what changes is moved with its history.
fn adopt<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    points: &Points<POINTS>,
    labels: &Row<u16, TRACES>,
) {
    let count = track.measures.count;
    for i in 0..count {
        let point = labels.at(i);
        let changed = point != track.point.at(i);
        track.point.set(i, point);
        track.pose.known.set(i, point != NONE);
        if changed && point != NONE {
            track.jump(i, points.at(usize::from(point)));
        } else if changed {
            track.gap.set(i, 1);
        }
    }
    fill_runs(track);
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, count, from) {
        for i in run.begin..run.end {
            track.smooth.set(i, track.pose.now.at(i));
        }
        from = run.end;
    }
}
