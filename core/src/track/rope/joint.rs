//! The tracker's own method: all points to all traces at once, and fills that keep the rope a rope.

use super::associate::{Association, COST_FAR, Found, Goal};
use super::chain::{UNEVEN, fit, through};
use super::fill::{Run, fill, keep_velocity};
use super::others::Others;
use super::points::{NONE, Points};
use super::review::review;
use super::state::Track;
use super::vector::length;
use crate::row::Row;

/// Prediction errors are taken this many times larger than they were on average: a jerk is not
/// announced.
const WARINESS: f32 = 2.5;
/// Least standard deviation of a prediction, metres.
const LEAST_DOUBT: f32 = 0.012;
/// Least standard deviation between the prediction errors of neighbours, metres.
const LEAST_APART: f32 = 0.006;
/// Gates in standard deviations, and at least and at most in spacings. A lost marker lies within
/// one spacing of its neighbour, so within two of any guess that keeps that distance.
const GATE: f32 = 4.0;
const NARROWEST_GATE: f32 = 0.8;
const WIDEST_GATE: f32 = 1.5;
const LOST_GATE: f32 = 2.0;
/// A trace with a gap that is less sure than this share of the spacing takes a point only beside
/// a sure neighbour.
const SURE: f32 = 0.35;
/// Standard deviations that a point may lie off without a neighbour that vouches for it.
const FAR: f32 = 3.5;
/// That many neighbours that are found together vouch for each other.
const VOUCHERS: usize = 3;
/// Seconds with less than a quarter of the rope, and with less than three fifths, before the whole
/// of it is sought anew.
const BLIND: f32 = 0.15;
const HALF_BLIND: f32 = 0.5;
/// A chain whose links are off by more than this many variances on average is not the rope.
const WORST_MISFIT: f32 = 5.0;
/// Seconds after which a chain without its ends is accepted as the rope.
const DESPERATE: f32 = 1.0;

/// One frame.
pub(super) fn step<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    association: &mut Association<TRACES, POINTS>,
    others: &mut Others<POINTS>,
    points: &mut Points<POINTS>,
) {
    let was_blind = track.measured_count() < 2;
    track.open();
    others.explain(points);
    follow(track, association, others, points, was_blind);
    fill_runs(track);
    recover(track, association, others, points);
    fill_runs(track);
    let count = track.measures.count;
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, count, from) {
        keep_velocity(&mut track.pose, run);
        from = run.end;
    }
    judge(track);
    track
        .trials
        .advance(&track.measures, &track.pose, &track.pace);
    track.close();
    track.trials.start(count, &track.pose);
    review(track, association, others, points);
    seek_lost(track, points);
    others.learn(points, track);
}

/// Points for the traces that were measured a moment ago, from their own predictions.
fn follow<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    association: &mut Association<TRACES, POINTS>,
    others: &Others<POINTS>,
    points: &mut Points<POINTS>,
    was_blind: bool,
) {
    let spacing = track.measures.spacing;
    let (narrowest, widest) = (NARROWEST_GATE * spacing, WIDEST_GATE * spacing);
    let most = 0.4 * spacing;
    let mut goals = Row::<Goal, TRACES>::new();
    for i in 0..track.measures.count {
        let gap = track.gap.at(i);
        // Without any support a gap's own prediction is all there is.
        if gap == 0 || was_blind {
            let surprise = track.surprise(i);
            let wary = (WARINESS * surprise).min(most).max(LEAST_DOUBT);
            let doubt = wary * (1.0 + 0.7 * f32::from(gap));
            goals.set(
                i,
                Goal::Seek {
                    centre: track.predicted(i),
                    since: track.since.at(i),
                    most: COST_FAR,
                    doubt,
                    gate: (GATE * doubt).max(narrowest).min(widest),
                },
            );
        }
    }
    // A calm end beside a hand moves with its neighbour although the middle hits the floor.
    let mut drift = Row::<f32, TRACES>::new();
    for i in 0..track.measures.count {
        let square = 1.5 * track.surprise_square(i);
        drift.set(i, 1.0 / square.max(LEAST_APART * LEAST_APART));
    }
    associate(track, association, others, points, &goals, &drift);
}

/// Points for the traces that are still without one, around where the fill puts them.
fn recover<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    association: &mut Association<TRACES, POINTS>,
    others: &Others<POINTS>,
    points: &mut Points<POINTS>,
) {
    let (count, spacing) = (track.measures.count, track.measures.spacing);
    let measured = track.measured_count();
    if measured == 0 || measured == count {
        return;
    }
    let mut goals = Row::<Goal, TRACES>::new();
    for i in 0..count {
        if track.pose.known.at(i) {
            goals.set(i, Goal::Fixed(track.point.at(i)));
        }
    }
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, count, from) {
        for i in run.begin..run.end {
            let gap = track.gap.at(i).saturating_add(1);
            let doubt = track.trials.doubt(run, count, gap, track.pace.trial);
            let doubt = doubt.max(track.surprise(i));
            goals.set(
                i,
                Goal::Seek {
                    centre: track.pose.now.at(i),
                    since: track.since.at(i),
                    most: f32::MAX,
                    doubt,
                    gate: (GATE * doubt).min(LOST_GATE * spacing),
                },
            );
        }
        from = run.end;
    }
    let apart = 0.2 * spacing;
    let mut drift = Row::<f32, TRACES>::new();
    drift.fill(1.0 / (apart * apart));
    associate(track, association, others, points, &goals, &drift);
}

/// Solves for `goals` and enters what can be trusted.
fn associate<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    association: &mut Association<TRACES, POINTS>,
    others: &Others<POINTS>,
    points: &mut Points<POINTS>,
    goals: &Row<Goal, TRACES>,
    drift: &Row<f32, TRACES>,
) {
    let count = track.measures.count;
    let mut found = Row::<Option<Found>, TRACES>::new();
    association.solve(&track.measures, goals, drift, others, points, |one| {
        found.set(one.trace, Some(one));
    });
    let unsure = SURE * track.measures.spacing;
    // Neighbours that stand together: at least one of them sure, or enough of them.
    let mut begin = 0;
    while begin < count {
        let stands = |i: usize| i < count && (found.at(i).is_some() || track.pose.known.at(i));
        let mut end = begin;
        let mut sure = false;
        while stands(end) {
            sure |= match goals.at(end) {
                Goal::Seek { doubt, .. } => track.gap.at(end) == 0 || doubt < unsure,
                _ => true,
            };
            end += 1;
        }
        // A jerk is not announced, but it moves neighbours alike: nobody goes far alone.
        let vouched = end - begin > 1;
        let is_far = |one: &Found| match goals.at(one.trace) {
            Goal::Seek { doubt, .. } => one.off > FAR * FAR * doubt * doubt,
            _ => false,
        };
        if sure || end - begin >= VOUCHERS.min(count) {
            for i in begin..end {
                if let Some(one) = found.at(i).filter(|one| vouched || !is_far(one)) {
                    enter(track, points, one);
                }
            }
        }
        begin = end + 1;
    }
}

/// A trace has its point.
fn enter<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    points: &mut Points<POINTS>,
    found: Found,
) {
    let i = found.trace;
    if track.gap.at(i) > 0 {
        // The fill's velocity, before the measurement replaces the fill.
        let moved = track.pose.now.at(i) - track.pose.before.at(i);
        track.pose.velocity.set(i, moved);
    }
    track.pose.now.set(i, points.at(usize::from(found.point)));
    track.pose.known.set(i, true);
    track.point.set(i, found.point);
    track.confidence.set(i, found.margin / (found.margin + 3.0));
    points.claim(found.point);
}

pub(super) fn fill_runs<const TRACES: usize>(track: &mut Track<TRACES>) {
    let count = track.measures.count;
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, count, from) {
        let shape = track.trials.shape_share(run, count);
        fill(
            &track.measures,
            &mut track.pose,
            run,
            shape,
            track.pace.fall,
        );
        from = run.end;
    }
}

/// How far each position can be trusted.
fn judge<const TRACES: usize>(track: &mut Track<TRACES>) {
    let count = track.measures.count;
    let measured = track.measured_count();
    for i in 0..count {
        if track.pose.known.at(i) {
            track.doubt.set(i, 0.0);
        }
    }
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, count, from) {
        for i in run.begin..run.end {
            let gap = track.gap.at(i).saturating_add(1);
            let doubt = if measured == 0 {
                // Accelerations of 20 m/s2 that nobody sees.
                let seconds = f32::from(gap) / track.pace.rate;
                0.01 + 10.0 * seconds * seconds
            } else {
                track.trials.doubt(run, count, gap, track.pace.trial)
            };
            track.doubt.set(i, doubt);
            let share = doubt / 0.03;
            track.confidence.set(i, 1.0 / (1.0 + share * share));
        }
        from = run.end;
    }
}

/// Whether two measured markers are farther apart than the rope between them is long: then some
/// trace sits on another marker's point.
fn is_strained<const TRACES: usize>(track: &Track<TRACES>) -> bool {
    let measures = &track.measures;
    let mut from = 0;
    while let Some(run) = Run::next(&track.pose.known, measures.count, from) {
        if run.is_interior(measures.count) {
            let (left, right) = (run.begin.saturating_sub(1), run.end);
            let rope = measures.arc.at(right) - measures.arc.at(left);
            let apart = length(track.pose.now.at(right) - track.pose.now.at(left));
            if apart > 1.03 * rope + 0.1 * measures.spacing {
                return true;
            }
        }
        from = run.end;
    }
    false
}

/// Seeks the whole rope by its spacing once nearly nothing of it has been seen for a while, or
/// what is seen contradicts its length.
///
/// One seed a frame bounds the work; a rope among 200 points is met within a few frames.
fn seek_lost<const TRACES: usize, const POINTS: usize>(
    track: &mut Track<TRACES>,
    points: &mut Points<POINTS>,
) {
    let count = track.measures.count;
    let measured = track.measured_count();
    let strained = is_strained(track);
    if 5 * measured > 3 * count && !strained {
        track.blind = 0;
        return;
    }
    track.blind = track.blind.saturating_add(1);
    let seconds = f32::from(track.blind) / track.pace.rate;
    let patience = if 4 * measured > count && !strained {
        HALF_BLIND
    } else {
        BLIND
    };
    if seconds < patience || points.count() < 3 {
        return;
    }
    points.release_all();
    let spacing = track.measures.spacing;
    track.seed = track.seed.wrapping_add(7);
    let seed = usize::from(track.seed) % points.count();
    points.claim(seed as u16);
    let here = points.at(seed);
    let mut link = (f32::MAX, NONE);
    points.near(here, 1.25 * spacing, |point, offset, _| {
        let misfit = (length(offset) - spacing).abs();
        if misfit < link.0 {
            link = (misfit, point);
        }
    });
    if link.1 == NONE || link.0 > 0.25 * spacing {
        return;
    }
    let chain = through::<POINTS, TRACES>(points, seed as u16, link.1, spacing, UNEVEN);
    let seen = chain.iter().filter(|&&point| point != NONE).count();
    let whole = chain.len() == count;
    let most = chain.len() < count
        && chain.len() + 2 >= count
        && 4 * measured < count
        && seconds > DESPERATE;
    if 4 * seen < 3 * count || !(whole || most) {
        return;
    }
    let Some(fit) = fit(track, points, &chain) else {
        return;
    };
    if fit.misfit > WORST_MISFIT {
        return;
    }
    let trace_of = |k: usize| {
        let place = fit.offset + k;
        if fit.reversed {
            (count - 1).saturating_sub(place)
        } else {
            place
        }
    };
    // What most of the rope is sure of, the chain must not deny.
    let agreed = chain
        .iter()
        .enumerate()
        .filter(|(k, point)| **point != NONE && track.point.at(trace_of(*k)) == **point);
    if 2 * measured > count && 2 * agreed.count() < measured {
        return;
    }
    track.open();
    for (k, &point) in chain.iter().enumerate().filter(|(_, p)| **p != NONE) {
        let i = trace_of(k);
        let position = points.at(usize::from(point));
        for row in [
            &mut track.pose.now,
            &mut track.pose.before,
            &mut track.pose.slow,
        ] {
            row.set(i, position);
        }
        track.smooth.set(i, position);
        track.pose.velocity.set(i, glam::Vec3::ZERO);
        track.acceleration.set(i, glam::Vec3::ZERO);
        track.pose.known.set(i, true);
        track.point.set(i, point);
        track.gap.set(i, 0);
        track.doubt.set(i, 0.0);
        track
            .confidence
            .set(i, (fit.next - fit.cost).clamp(0.0, 1.0));
    }
    track.blind = 0;
    fill_runs(track);
}
