//! Halves of one marker that a wrong fragment keeps apart.
//!
//! A ghost that was taken in early, or a fragment of a neighbour, is seen together with the other
//! half, so the two are never compared. Where they would clearly be one marker without what they
//! share, and what they share fits worse than they do, it is let go.

use super::links::{Pair, compare, is_near};
use super::rings::Ring;
use super::tracks::Tracks;

/// Share of a track, and seconds, that may be let go.
const SHARE: f64 = 0.3;
const BRIEF: f64 = 0.5;
/// Odds of the halves, and by how much they must be above those of what is let go.
const ODDS: f64 = 3.0;
const ABOVE: f64 = 1.0;
/// Least odds of the halves where what is let go is seen for so few seconds and has less odds than
/// these: a ghost.
const LEAST: f64 = -8.0;
const GHOST: (f64, f64) = (0.1, 3.0);

/// Two tracks that are one without `let_go`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Amendment {
    pub pair: Pair,
    /// Fragments that belong elsewhere.
    pub let_go: Vec<usize>,
}

/// The amendments that can be made, the likeliest first. Quadratic in tracks, in time alone.
pub(super) fn find(tracks: &mut Tracks<'_>, mut rings: Vec<Ring>) -> Vec<Amendment> {
    let alive = tracks.alive();
    let mut found = Vec::new();
    for (at, &a) in alive.iter().enumerate() {
        for &b in &alive[at + 1..] {
            if tracks.named[a].is_some() && tracks.named[b].is_some() || tracks.are_disjoint(a, b) {
                continue;
            }
            let near = |&at: &usize| is_near(tracks, &rings[a], at);
            if tracks.members[b].iter().any(near) {
                let either = [(a, b), (b, a)];
                let each = either.map(|(of, other)| without(tracks, &mut rings, of, other));
                let best = each.into_iter().flatten();
                found.extend(best.max_by(|x, y| x.pair.odds.total_cmp(&y.pair.odds)));
            }
        }
    }
    found.sort_by(|x, y| y.pair.odds.total_cmp(&x.pair.odds));
    found
}

/// What comes of letting go what a track shares with another.
fn without(
    tracks: &mut Tracks<'_>,
    rings: &mut Vec<Ring>,
    track: usize,
    other: usize,
) -> Option<Amendment> {
    let let_go = tracks.shared(track, other);
    let frames = |all: &[usize]| -> usize {
        let each = all.iter().map(|&at| tracks.fragments[at].frame_count());
        each.sum()
    };
    let (gone, all) = (frames(&let_go), tracks.frame_count(track));
    let is_brief = gone as f64 <= SHARE * all as f64
        && gone as f64 <= BRIEF * tracks.take().rate()
        && let_go.len() < tracks.members[track].len();
    if !is_brief || tracks.named[track].is_some() {
        return None;
    }
    let before = tracks.members.len();
    for &fragment in &let_go {
        tracks.part(fragment);
    }
    // What is let go asks nobody: the track it was in is asked about it.
    rings.resize(tracks.members.len(), Ring::default());
    let pair = compare(tracks, rings, track, other);
    let kept = (before..tracks.members.len())
        .filter_map(|gone| compare(tracks, rings, track, gone))
        .map(|pair| pair.odds)
        .fold(f64::NEG_INFINITY, f64::max);
    for at in (before..tracks.members.len()).rev() {
        tracks.join(track, at);
        tracks.members.truncate(at);
        tracks.named.truncate(at);
    }
    rings.truncate(before);
    let pair = pair?;
    let is_clear = pair.odds >= ODDS && pair.odds > kept + ABOVE;
    let is_ghost = gone as f64 <= GHOST.0 * tracks.take().rate() && kept < GHOST.1;
    let is_one = is_clear || is_ghost && pair.odds >= LEAST;
    is_one.then_some(Amendment { pair, let_go })
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::super::along::Along;
    use super::super::fragments::Fragment;
    use super::super::rings::{rings, touches};
    use super::*;
    use crate::take::Take;

    #[test]
    fn a_ghost_between_two_halves_is_let_go() {
        // Twelve markers on a turning shell; the first is seen until frame 40 and from 60 on, and
        // wears a ghost at 20 in its second half.
        const FRAMES: usize = 100;
        let place = |at: usize, frame: usize| {
            let angle = 2.4 * at as f64;
            let home = 0.05 * DVec3::new(angle.cos(), 0.3 * (at as f64).sin(), angle.sin());
            DMat3::from_rotation_y(0.02 * frame as f64) * home
        };
        let mut positions: Vec<DVec3> = (0..12)
            .flat_map(|at| (0..FRAMES).map(move |frame| place(at, frame)))
            .collect();
        positions.extend((0..FRAMES).map(|frame| place(0, frame) + DVec3::Y * 0.03));
        let labels = (0..13).map(|at| format!("*{at}")).collect();
        let take = Take::new(labels, 100.0, FRAMES, positions).unwrap();
        let fragment = |column, start, end| Fragment { column, start, end };
        let mut fragments: Vec<Fragment> = (1..12).map(|at| fragment(at, 0, FRAMES)).collect();
        fragments.extend([
            fragment(0, 0, 40),
            fragment(0, 60, 100),
            fragment(12, 20, 22),
        ]);
        let mut tracks = Tracks::new(&take, &fragments, &[]);
        tracks.join(12, 13);
        let rings = rings(&tracks, &touches(&tracks), &Along::default());
        let found = find(&mut tracks, rings);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].let_go, [13]);
        assert!(found[0].pair.odds > 3.0);
        assert_eq!(tracks.members[12], [13, 12], "nothing is changed yet");
    }
}
