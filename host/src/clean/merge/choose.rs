//! Which of the possible merges to make.

use super::links::Pair;
use super::tracks::Tracks;

/// How sure a merge must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Least odds.
    pub odds: f64,
    /// Least difference to the odds of a merge that excludes it. With 0 such merges are decided
    /// jointly.
    pub margin: f64,
    /// Factor on the thresholds for distances.
    pub factor: f64,
    /// Whether only tracks that are certainly markers are merged.
    pub long: bool,
}

impl Level {
    /// The same for tracks that are certainly markers alone.
    pub const fn of_long(self) -> Self {
        Self { long: true, ..self }
    }
}

/// Pairs that are tried together exhaustively, at most.
const JOINT: usize = 14;

/// Whether two pairs exclude each other: they share a track, and what they add to it overlaps.
fn conflict(tracks: &Tracks<'_>, a: &Pair, b: &Pair) -> bool {
    let other = |pair: &Pair, track| {
        if pair.host == track {
            pair.guest
        } else {
            pair.host
        }
    };
    [a.host, a.guest].into_iter().any(|track| {
        (b.host == track || b.guest == track) && {
            let (x, y) = (other(a, track), other(b, track));
            x != y && !tracks.are_disjoint(x, y)
        }
    })
}

/// Pairs to merge, with the odds of the best rival (minus infinity without one).
///
/// A pair counts if it is `within` the thresholds and its odds are above those of every rival by
/// the margin; rivals beyond the thresholds count too. Without a margin rivals are decided jointly:
/// of the ways to choose from each group of rivals, the one with the largest sum of odds.
pub(super) fn choose(
    tracks: &Tracks<'_>,
    pairs: &[Pair],
    within: impl Fn(&Pair) -> bool,
    level: Level,
) -> Vec<(Pair, f64)> {
    let by_track = grouped(pairs, tracks.members.len());
    let rivals = |at: usize| {
        let pair = &pairs[at];
        let near = by_track[pair.host].iter().chain(&by_track[pair.guest]);
        near.copied()
            .filter(move |&other| other != at && conflict(tracks, pair, &pairs[other]))
    };
    let rival = |at: usize| {
        rivals(at)
            .map(|other| pairs[other].odds)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let good: Vec<usize> = (0..pairs.len())
        .filter(|&at| pairs[at].odds >= level.odds && within(&pairs[at]))
        .collect();
    let mut chosen: Vec<usize> = if level.margin > 0.0 {
        let sure = |at: &usize| pairs[*at].odds >= rival(*at) + level.margin;
        good.into_iter().filter(sure).collect()
    } else {
        let mut state = vec![false; pairs.len()];
        for &at in &good {
            state[at] = true;
        }
        let mut chosen = Vec::new();
        for &first in &good {
            if !std::mem::take(&mut state[first]) {
                continue;
            }
            let (mut group, mut at) = (vec![first], 0);
            while at < group.len() {
                for other in rivals(group[at]) {
                    if std::mem::take(&mut state[other]) {
                        group.push(other);
                    }
                }
                at += 1;
            }
            chosen.extend(best_of(tracks, pairs, group));
        }
        chosen
    };
    // The surest first: it may turn a later one into a conflict.
    chosen.sort_by(|a, b| pairs[*b].odds.total_cmp(&pairs[*a].odds).then(a.cmp(b)));
    chosen
        .into_iter()
        .map(|at| (pairs[at], rival(at)))
        .collect()
}

/// `[tracks]`: indices of their pairs.
fn grouped(pairs: &[Pair], track_count: usize) -> Vec<Vec<usize>> {
    let mut groups = vec![Vec::new(); track_count];
    for (at, pair) in pairs.iter().enumerate() {
        groups[pair.host].push(at);
        groups[pair.guest].push(at);
    }
    groups
}

/// The best set without conflicts: exhaustive in small groups, the likeliest first in large ones.
fn best_of(tracks: &Tracks<'_>, pairs: &[Pair], mut group: Vec<usize>) -> Vec<usize> {
    group.sort_by(|a, b| pairs[*b].odds.total_cmp(&pairs[*a].odds).then(a.cmp(b)));
    let fits = |set: &[usize], at: usize| {
        set.iter()
            .all(|&other| !conflict(tracks, &pairs[other], &pairs[at]))
    };
    if group.len() > JOINT {
        let mut set = Vec::new();
        for at in group {
            if fits(&set, at) {
                set.push(at);
            }
        }
        return set;
    }
    let mut best = (0.0, Vec::new());
    for mask in 1_u32..1 << group.len() {
        let mut set: Vec<usize> = Vec::new();
        let mut sum = 0.0;
        let mut valid = true;
        for (bit, &at) in group.iter().enumerate() {
            if mask >> bit & 1 == 1 {
                valid = valid && fits(&set, at);
                sum += pairs[at].odds;
                set.push(at);
            }
        }
        if valid && sum > best.0 {
            best = (sum, set);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::fragments::Fragment;
    use super::*;
    use crate::take::Take;

    fn pair(host: usize, guest: usize, odds: f64) -> Pair {
        Pair {
            host,
            guest,
            mean: 0.1,
            worst: 0.1,
            support: 5,
            odds,
        }
    }

    #[test]
    fn the_sure_first_and_rivals_jointly() {
        // Tracks 0 and 1 end together, 2 and 3 begin together, 4 follows them.
        let lives = [(0, 10), (0, 10), (12, 20), (12, 20), (22, 30)];
        let fragments: Vec<Fragment> = lives
            .iter()
            .map(|&(start, end)| Fragment {
                column: 0,
                start,
                end,
            })
            .collect();
        let take = Take::new(vec!["*1".into()], 100.0, 30, vec![DVec3::ZERO; 30]).unwrap();
        let tracks = Tracks::new(&take, &fragments, &[]);
        // Guest 2 is likeliest host 0's, but 3 can be nothing else.
        let pairs = [
            pair(0, 2, 6.0),
            pair(1, 2, 5.0),
            pair(0, 3, 5.5),
            pair(2, 4, 9.0),
        ];
        let level = |margin| Level {
            odds: 1.0,
            margin,
            factor: 1.0,
            long: false,
        };
        let sure = choose(&tracks, &pairs, |_| true, level(2.0));
        assert_eq!(sure, [(pairs[3], f64::NEG_INFINITY)]);
        let joint = choose(&tracks, &pairs, |_| true, level(0.0));
        let chosen: Vec<Pair> = joint.iter().map(|one| one.0).collect();
        assert_eq!(chosen, [pairs[3], pairs[2], pairs[1]]);
        assert_eq!(joint[1].1, 6.0, "the rival's odds");
        assert!(choose(&tracks, &pairs, |_| false, level(2.0)).is_empty());
    }
}
