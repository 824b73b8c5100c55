//! Which of the possible merges to make.

use super::fragments::Fragment;

/// A marker and a fragment that may be its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    pub fragment: usize,
    pub marker: usize,
    /// Mean distance over neighbour distance.
    pub mean: f64,
    /// Largest such distance.
    pub worst: f64,
    /// Least number of neighbours behind it.
    pub support: usize,
    /// Mean of the best other marker for the fragment.
    pub other: f64,
}

/// Pairs that are tried together exhaustively, at most.
const JOINT: usize = 14;

/// Pairs to merge: each fragment goes to one marker, a marker has one fragment at a time.
///
/// A pair counts if it is `within` the thresholds and every rival (another marker for the
/// fragment, another fragment for the marker at the same time) is worse by `margin`. With a margin
/// of 1 rivals are decided jointly: of the ways to assign each group of rivals, the one that
/// explains the most frames with the least distance.
pub(super) fn choose(
    pairs: &[Pair],
    fragments: &[Fragment],
    within: impl Fn(&Pair) -> bool,
    margin: f64,
) -> Vec<Pair> {
    let conflict = |a: &Pair, b: &Pair| {
        let (x, y) = (&fragments[a.fragment], &fragments[b.fragment]);
        a.fragment == b.fragment || a.marker == b.marker && x.start < y.end && y.start < x.end
    };
    let good: Vec<Pair> = pairs.iter().copied().filter(|pair| within(pair)).collect();
    if margin > 1.0 {
        // Rivals beyond the thresholds count too: what is nearly as near speaks against both.
        let by_marker = grouped(pairs);
        let sure = |pair: &&Pair| {
            let beaten = |rival: &Pair| rival.mean < margin * pair.mean;
            let rivals = by_marker.get(pair.marker).map_or(&[][..], Vec::as_slice);
            let other = rivals.iter().map(|&at| &pairs[at]).any(|rival| {
                rival.fragment != pair.fragment && conflict(rival, pair) && beaten(rival)
            });
            pair.other >= margin * pair.mean && !other
        };
        return good.iter().filter(sure).copied().collect();
    }
    let mut chosen = Vec::new();
    for group in groups(&good, &conflict) {
        let members: Vec<Pair> = group.iter().map(|&at| good[at]).collect();
        chosen.extend(best_of(&members, fragments, &conflict));
    }
    chosen.sort_by_key(|pair: &Pair| (pair.fragment, pair.marker));
    chosen
}

/// `[markers]`: indices of their pairs.
fn grouped(pairs: &[Pair]) -> Vec<Vec<usize>> {
    let count = pairs.iter().map(|pair| pair.marker + 1).max().unwrap_or(0);
    let mut groups = vec![Vec::new(); count];
    for (at, pair) in pairs.iter().enumerate() {
        groups[pair.marker].push(at);
    }
    groups
}

/// Sets of pairs that are tied by conflicts.
fn groups(pairs: &[Pair], conflict: &dyn Fn(&Pair, &Pair) -> bool) -> Vec<Vec<usize>> {
    let mut open: Vec<usize> = (0..pairs.len()).collect();
    let mut groups = Vec::new();
    while let Some(first) = open.pop() {
        let (mut group, mut at) = (vec![first], 0);
        while at < group.len() {
            let pair = pairs[group[at]];
            let (tied, rest): (Vec<usize>, Vec<usize>) = open
                .iter()
                .partition(|&&other| conflict(&pair, &pairs[other]));
            group.extend(tied);
            open = rest;
            at += 1;
        }
        groups.push(group);
    }
    groups
}

/// The best set without conflicts: exhaustive in small groups, the nearest first in large ones.
fn best_of(
    pairs: &[Pair],
    fragments: &[Fragment],
    conflict: &dyn Fn(&Pair, &Pair) -> bool,
) -> Vec<Pair> {
    let mut order: Vec<&Pair> = pairs.iter().collect();
    order.sort_by(|a, b| a.mean.total_cmp(&b.mean).then(a.fragment.cmp(&b.fragment)));
    let fits = |set: &[&Pair], pair: &Pair| set.iter().all(|other| !conflict(other, pair));
    if order.len() > JOINT {
        let mut set: Vec<&Pair> = Vec::new();
        for pair in order {
            if fits(&set, pair) {
                set.push(pair);
            }
        }
        return set.into_iter().copied().collect();
    }
    // Explaining a frame is worth more than any distance within the thresholds costs.
    let worth = |pair: &Pair| fragments[pair.fragment].frame_count() as f64 * (2.0 - pair.mean);
    let mut best: (f64, Vec<&Pair>) = (0.0, Vec::new());
    for mask in 1_u32..1 << order.len() {
        let mut set: Vec<&Pair> = Vec::new();
        let mut sum = 0.0;
        let mut valid = true;
        for (at, pair) in order.iter().enumerate() {
            if mask >> at & 1 == 1 {
                valid &= fits(&set, pair);
                sum += worth(pair);
                set.push(pair);
            }
        }
        if valid && sum > best.0 {
            best = (sum, set);
        }
    }
    best.1.into_iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(fragment: usize, marker: usize, mean: f64, other: f64) -> Pair {
        Pair {
            fragment,
            marker,
            mean,
            worst: mean,
            support: 5,
            other,
        }
    }

    const FRAGMENTS: [Fragment; 3] = [
        Fragment {
            column: 0,
            start: 0,
            end: 10,
        },
        Fragment {
            column: 1,
            start: 5,
            end: 15,
        },
        Fragment {
            column: 2,
            start: 12,
            end: 20,
        },
    ];

    #[test]
    fn the_sure_first_and_rivals_jointly() {
        // Fragment 0 is nearest to marker 0, but fragment 1 can be nothing else.
        let pairs = [
            pair(0, 0, 0.20, 0.24),
            pair(0, 1, 0.24, 0.20),
            pair(1, 0, 0.22, f64::INFINITY),
            pair(2, 1, 0.05, f64::INFINITY),
        ];
        let within = |pair: &Pair| pair.mean < 0.5;
        let sure = choose(&pairs, &FRAGMENTS, within, 1.5);
        assert_eq!(sure, [pairs[3]]);
        let joint = choose(&pairs, &FRAGMENTS, within, 1.0);
        assert_eq!(joint, [pairs[1], pairs[2], pairs[3]]);
        assert!(choose(&pairs, &FRAGMENTS, |_| false, 1.0).is_empty());
    }
}
