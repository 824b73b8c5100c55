//! Partial trajectories: runs of samples without a gap or a jump.

use glam::DVec3;

use crate::take::Take;

/// A run of samples of one column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fragment {
    /// Column of the source.
    pub column: usize,
    /// First frame.
    pub start: usize,
    /// Frame after the last.
    pub end: usize,
}

impl Fragment {
    /// How many frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.end - self.start
    }
}

/// Least jump, metres.
const JUMP: f64 = 0.008;
/// Least jump over the largest change of step around it.
const TIMES: f64 = 4.0;
/// Frames on each side that say what is usual.
const AROUND: usize = 6;

/// The fragments of all unnamed columns, and where a column jumped: (column, frame).
pub(super) fn split(take: &Take) -> (Vec<Fragment>, Vec<(usize, usize)>) {
    let (mut fragments, mut jumps) = (Vec::new(), Vec::new());
    let unnamed = crate::import::take::PointKind::Unlabelled;
    for column in (0..take.marker_count()).filter(|&c| take.kinds()[c] == unnamed) {
        let path = take.trajectory(column);
        for trace in take.traces(column) {
            let mut start = trace.start;
            for frame in trace.start + 1..trace.end {
                if jumps_at(&path[trace.start..trace.end], frame - trace.start) {
                    jumps.push((column, frame));
                    fragments.push(Fragment {
                        column,
                        start,
                        end: frame,
                    });
                    start = frame;
                }
            }
            fragments.push(Fragment {
                column,
                start,
                end: trace.end,
            });
        }
    }
    fragments.sort_by_key(|fragment| (fragment.start, fragment.column));
    (fragments, jumps)
}

/// Seconds that a fragment must live to count for the reference frame.
const LEAST_LIFE: f64 = 0.1;

/// The frame that shows most fragments that are not brief, the first of several.
pub(super) fn fullest_frame(take: &Take, fragments: &[Fragment]) -> Option<usize> {
    let frames = take.frame_count();
    let mut change = vec![0_isize; frames + 1];
    let least = ((LEAST_LIFE * take.rate()).ceil() as usize).min(frames);
    for fragment in fragments.iter().filter(|one| one.frame_count() >= least) {
        change[fragment.start] += 1;
        change[fragment.end] -= 1;
    }
    let (mut alive, mut best) = (0, (0, None));
    for (frame, change) in change.iter().enumerate().take(frames) {
        alive += change;
        if alive > best.0 {
            best = (alive, Some(frame));
        }
    }
    best.1
}

/// Whether the step to a sample departs from the steps before and after it.
fn jumps_at(path: &[DVec3], at: usize) -> bool {
    let step = |to: usize| path[to] - path[to - 1];
    let usual = |at: usize| {
        let steps = at.saturating_sub(AROUND).max(1)..(at + AROUND + 1).min(path.len());
        steps.filter(move |&other| other != at)
    };
    let others: Vec<usize> = usual(at).collect();
    if others.len() < 3 {
        return false;
    }
    let near = |other: &&usize| other.abs_diff(at) <= 2;
    let close: Vec<&usize> = others.iter().filter(near).collect();
    let mean = close.iter().map(|&&other| step(other)).sum::<DVec3>() / close.len().max(1) as f64;
    let departure = step(at).distance(mean);
    let spread = others
        .iter()
        .map(|&other| step(other).distance(mean))
        .fold(0.0, f64::max);
    departure > JUMP && departure > TIMES * spread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_jumps_split() {
        let mut path: Vec<DVec3> = (0..60).map(|at| DVec3::X * 0.01 * at as f64).collect();
        path[20] = DVec3::NAN;
        for position in &mut path[40..] {
            position.y = 0.03;
        }
        let take = Take::new(vec!["*1".into()], 100.0, 60, path).unwrap();
        let (fragments, jumps) = split(&take);
        let ranges: Vec<_> = fragments.iter().map(|f| (f.start, f.end)).collect();
        assert_eq!(ranges, [(0, 20), (21, 40), (40, 60)]);
        assert_eq!(jumps, [(0, 40)]);
        assert_eq!(fragments[0].frame_count(), 20);
    }
}
