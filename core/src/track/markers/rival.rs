//! A second labelling beside the first, begun elsewhere, which takes over where it explains more.
//!
//! A set that was recognised from the wrong end, or a limb that took another's points, may agree
//! with itself. Nothing but a better labelling shows that it is wrong.

use super::Frame;
use super::state::{NONE, Rival, Trace};

/// By how much a rival must be better.
const BETTER: usize = 3;

/// Runs the rival of a frame that is done, if it has reason to be, and lets it take over.
pub(super) fn step(frame: &mut Frame<'_, '_>, rival: &mut Rival, traces: &mut [Trace]) {
    let possible = frame.points.len().min(frame.traces.len());
    let is_short = frame.course.is_tracking && frame.measured() + 1 < possible;
    rival.short = if is_short {
        rival.short.saturating_add(1)
    } else {
        0
    };
    if rival.short <= frame.pace.doubtful {
        rival.waits = 0;
        rival.wait = 0;
        rival.is_running = false;
        return;
    }
    if !rival.is_running {
        if rival.wait > 0 {
            rival.wait -= 1;
            return;
        }
        rival.is_running = true;
        rival.age = 0;
        rival.course.is_tracking = false;
        rival.course.poor = 0;
        rival.course.blank = 0;
        for (trace, first) in traces.iter_mut().zip(&*frame.traces) {
            *trace = Trace {
                bias: first.bias,
                position: first.position,
                ..Trace::EMPTY
            };
        }
    }
    let score = frame.score();
    exchange(frame, rival, traces);
    for point in frame.points.all_mut() {
        point.owner = NONE;
    }
    frame.run();
    rival.age = rival.age.saturating_add(1);
    let is_better = frame.course.is_tracking && frame.score() >= score + BETTER;
    let is_over = rival.age > frame.pace.patience;
    if is_better && rival.age > 2 {
        rival.is_running = false;
        rival.short = 0;
        return;
    }
    exchange(frame, rival, traces);
    if is_over {
        rival.is_running = false;
        rival.waits = rival.waits.saturating_add(1).min(6);
        rival.wait = frame.pace.patience << rival.waits;
    }
}

fn exchange(frame: &mut Frame<'_, '_>, rival: &mut Rival, traces: &mut [Trace]) {
    core::mem::swap(frame.course, &mut rival.course);
    for (one, other) in frame.traces.iter_mut().zip(traces) {
        core::mem::swap(one, other);
    }
}

impl Frame<'_, '_> {
    /// How much a labelling explains: measured markers, and again those that their neighbours
    /// confirm.
    fn score(&self) -> usize {
        let each = self.traces.iter().filter(|trace| trace.is_measured());
        each.map(|trace| {
            if trace.doubt > 0 {
                0
            } else {
                1 + usize::from(!trace.is_weak)
            }
        })
        .sum()
    }
}
