//! Rounds of merging: the surest pairs of tracks first, short gaps before long ones.

use super::super::fill::in_parallel;
use super::along::Along;
use super::amend::{self, Amendment};
use super::carry::carry;
use super::choose::{Level, choose};
use super::links::{Pair, all, compare, within};
use super::rings::{Ring, rings, touches};
use super::tracks::Tracks;
use super::{MergeOptions, OWN_LIFE, Progress};

/// Seconds that may lie between two tracks, in turn: what is merged over short gaps carries what
/// is merged over longer ones. At last any.
const WINDOWS: [f64; 3] = [0.1, 0.5, 2.0];

/// From the sure to the likely. The last two are used once all windows are done.
const LEVELS: [Level; 3] = [
    level(4.0, 5.0, 0.6),
    level(2.5, 3.0, 1.0),
    level(1.0, 1.5, 1.0),
];
const LAST: [Level; 4] = [
    level(0.0, 0.0, 1.0),
    // What is seen for long in one part of a take alone is unlikely to be another marker: the odds
    // may be lower, or one frame worse, where nothing else comes near.
    level(1.5, 2.5, 2.5).of_long(),
    level(-3.0, 1.0, 1.5).of_long(),
    FARTHEST,
];
const FARTHEST: Level = level(-8.0, 2.0, 0.9).of_long();

const fn level(odds: f64, margin: f64, factor: f64) -> Level {
    Level {
        odds,
        margin,
        factor,
        long: false,
    }
}

/// Odds, and difference to a rival's, below which a merge is doubtful.
pub(super) const DOUBTFUL: [f64; 2] = [2.0, 1.5];

/// Times that what keeps halves apart is looked for.
const AMENDED: usize = 3;

/// Deviations within which a marker follows its neighbours.
const WITH_SKIN: f64 = 2.0;

/// A merge as it was decided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Joined {
    /// First fragment of the track that was taken in.
    pub fragment: usize,
    pub pair: Pair,
    /// Odds of the best rival.
    pub rival: f64,
}

/// Merges until nothing more can be decided. The tracks that are left are markers or ghosts.
pub(super) fn run(
    tracks: &mut Tracks<'_>,
    along: &Along,
    options: &MergeOptions<'_>,
    progress: &Progress<'_>,
) -> Vec<Joined> {
    let touches = touches(tracks);
    let mut work = Work {
        tracks,
        touches: &touches,
        along,
        options,
        joined: Vec::new(),
    };
    let rate = work.tracks.take().rate();
    let steps = (WINDOWS.len() + 2) as f64;
    for (step, seconds) in WINDOWS.into_iter().enumerate() {
        let window = Some((seconds * rate).ceil() as usize);
        // What little a further round would join, the next window joins too.
        while work.round(window, &LEVELS) > work.tracks.alive().len() / 50 {}
        progress((step + 1) as f64 / steps);
    }
    while work.round(None, &LEVELS) > 0 {}
    progress(1.0 - 1.0 / steps);
    let levels = [LEVELS.as_slice(), &LAST].concat();
    while work.round(None, &levels) > 0 {}
    for _ in 0..AMENDED {
        if work.amend() == 0 {
            break;
        }
        while work.round(None, &levels) > 0 {}
    }
    progress(1.0);
    work.joined
}

struct Work<'a, 't> {
    tracks: &'a mut Tracks<'t>,
    touches: &'a [Vec<usize>],
    along: &'a Along,
    options: &'a MergeOptions<'a>,
    joined: Vec<Joined>,
}

impl Work<'_, '_> {
    /// Merges at the strictest level that allows any; how many.
    fn round(&mut self, window: Option<usize>, levels: &[Level]) -> usize {
        let rings = rings(self.tracks, self.touches, self.along);
        let candidates = match window {
            Some(window) => within(self.tracks, &rings, window),
            None => all(self.tracks, &rings),
        };
        let every: Vec<usize> = (0..candidates.len()).collect();
        let pairs = in_parallel(&every, |at| {
            let (a, b) = candidates[at];
            compare(self.tracks, &rings, a, b)
        });
        let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
        for level in levels {
            let fits = |pair: &&Pair| !level.long || self.are_long(pair);
            let pairs: Vec<Pair> = pairs.iter().filter(fits).copied().collect();
            let chosen = choose(
                self.tracks,
                &pairs,
                |pair| self.allows(pair, *level),
                *level,
            );
            let count = self.join(&chosen);
            if count > 0 {
                return count;
            }
        }
        0
    }

    /// Joins halves of one marker after what keeps them apart is let go; how many.
    fn amend(&mut self) -> usize {
        let rings = rings(self.tracks, self.touches, self.along);
        let mut used = vec![false; self.tracks.members.len()];
        let mut count = 0;
        for Amendment { pair, let_go } in amend::find(self.tracks, rings) {
            let (host, guest) = (pair.host, pair.guest);
            let level = if pair.odds >= LEVELS[1].odds {
                LEVELS[1]
            } else {
                FARTHEST
            };
            let fits = !level.long || self.are_long(&pair);
            if used[host] || used[guest] || !fits || !self.allows(&pair, level) {
                continue;
            }
            (used[host], used[guest]) = (true, true);
            for &fragment in &let_go {
                self.tracks.part(fragment);
            }
            self.joined.retain(|one| !let_go.contains(&one.fragment));
            count += self.join(&[(pair, f64::NEG_INFINITY)]);
        }
        count
    }

    fn is_long(&self, track: usize) -> bool {
        self.tracks.frame_count(track) as f64 >= OWN_LIFE * self.tracks.take().rate()
    }

    fn are_long(&self, pair: &Pair) -> bool {
        self.is_long(pair.host) && self.is_long(pair.guest)
    }

    fn allows(&self, pair: &Pair, level: Level) -> bool {
        // Two brief tracks that fit badly are ghosts rather than a marker.
        pair.mean <= level.factor * self.options.mean
            && pair.worst <= level.factor * self.options.every
            && (level.odds >= LEVELS[2].odds || self.is_long(pair.host))
    }

    fn join(&mut self, chosen: &[(Pair, f64)]) -> usize {
        let before = self.joined.len();
        for &(pair, rival) in chosen {
            let first = |track: usize| self.tracks.members[track].first().copied();
            // An earlier merge of this round may have taken in either.
            let (Some(host), Some(fragment)) = (first(pair.host), first(pair.guest)) else {
                continue;
            };
            let (host, guest) = (self.tracks.track_of[host], self.tracks.track_of[fragment]);
            if self.tracks.are_disjoint(host, guest) {
                self.tracks.join(host, guest);
                self.joined.push(Joined {
                    fragment,
                    pair,
                    rival,
                });
            }
        }
        self.joined.len() - before
    }
}

/// Whether each part of a track is, at its end, where its neighbours carry its beginning.
pub(super) fn moves_with_skin(tracks: &Tracks<'_>, ring: &Ring, track: usize) -> bool {
    tracks.members[track].iter().all(|&at| {
        let (from, to) = (tracks.fragments[at].start, tracks.fragments[at].end - 1);
        let origin = tracks.sample(at, from);
        carry(tracks, ring, origin, from, to).is_some_and(|expected| {
            expected.position.distance(tracks.sample(at, to)) < WITH_SKIN * expected.sigma
        })
    })
}
