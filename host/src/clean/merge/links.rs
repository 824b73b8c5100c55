//! Which tracks may be one marker, and what speaks for it.

use std::collections::HashMap;

use glam::DVec3;

use super::carry::expect;
use super::fragments::Fragment;
use super::rings::Ring;
use super::tracks::Tracks;

/// Two tracks that are never seen together, and the evidence that they are one marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    /// The one with more frames.
    pub host: usize,
    pub guest: usize,
    /// Mean distance from where the other expects it, over spacing; the surer places count more.
    pub mean: f64,
    /// Largest such distance beyond two standard deviations.
    pub worst: f64,
    /// Least number of neighbours behind it.
    pub support: usize,
    /// Logarithm of how much likelier the places are if the two are one than if they are not.
    pub odds: f64,
}

/// Fragments of a guest that are compared, and frames of each.
const PARTS: usize = 5;
const FRAMES: usize = 10;
/// Frames of the host beside them that are compared.
const BESIDE: usize = 8;
/// How far around the neighbours a track may be, over spacing.
const GATE: f64 = 3.0;
/// Deviation, over spacing, from which on a place refutes nothing.
const VAGUE: f64 = 0.5;
/// Degrees of freedom of the distribution of places: heavier tails than a normal one, as the
/// deviations are themselves estimated.
const FREEDOM: f64 = 4.0;
/// Logarithm of that distribution's density at its middle, for a deviation of 1.
const MIDDLE: f64 = -2.594;
/// Least logarithm of the room for chance over the deviation.
const LEAST_LN: f64 = 1.1;

/// Pairs of disjoint tracks with at most `window` frames between an end of one and a start of the
/// other, and neighbours in common; each once. About fragments times those that end within a
/// window.
pub(super) fn within(tracks: &Tracks<'_>, rings: &[Ring], window: usize) -> Vec<(usize, usize)> {
    let mut ends: Vec<usize> = (0..tracks.fragments.len()).collect();
    ends.sort_unstable_by_key(|&at| tracks.fragments[at].end);
    let mut pairs: HashMap<(usize, usize), bool> = HashMap::new();
    for (later, fragment) in tracks.fragments.iter().enumerate() {
        let start = fragment.start;
        let from = ends.partition_point(|&at| tracks.fragments[at].end + window < start);
        let to = ends.partition_point(|&at| tracks.fragments[at].end <= start);
        for &earlier in &ends[from..to] {
            let (a, b) = (tracks.track_of[earlier], tracks.track_of[later]);
            if a != b {
                let known = pairs.entry((a.min(b), a.max(b)));
                known.or_insert_with(|| {
                    may_be_one(tracks, a, b) && is_near(tracks, &rings[a], later)
                });
            }
        }
    }
    let mut pairs: Vec<(usize, usize)> = pairs.into_iter().filter(|p| p.1).map(|p| p.0).collect();
    pairs.sort_unstable();
    pairs
}

/// Whether two tracks are never seen together and not both named.
fn may_be_one(tracks: &Tracks<'_>, a: usize, b: usize) -> bool {
    let both_named = tracks.named[a].is_some() && tracks.named[b].is_some();
    !both_named && tracks.are_disjoint(a, b)
}

/// Pairs of disjoint tracks with neighbours in common, whatever lies between them. Quadratic in
/// tracks, in time alone.
pub(super) fn all(tracks: &Tracks<'_>, rings: &[Ring]) -> Vec<(usize, usize)> {
    let alive = tracks.alive();
    let mut pairs = Vec::new();
    for (at, &a) in alive.iter().enumerate() {
        for &b in &alive[at + 1..] {
            if may_be_one(tracks, a, b) {
                let (host, guest) = ordered(tracks, a, b);
                let near = |&at: &usize| is_near(tracks, &rings[host], at);
                if thinned(&tracks.members[guest], PARTS).iter().any(near) {
                    pairs.push((a, b));
                }
            }
        }
    }
    pairs
}

/// Whether a fragment begins near neighbours of a ring.
pub(super) fn is_near(tracks: &Tracks<'_>, ring: &Ring, fragment: usize) -> bool {
    let frame = tracks.fragments[fragment].start;
    let here = tracks.sample(fragment, frame);
    let reach = GATE * ring.spacing;
    ring.members.iter().any(|&(other, _)| {
        let place = tracks.position(other, frame);
        place.is_some_and(|place| place.distance_squared(here) < reach * reach)
    })
}

fn ordered(tracks: &Tracks<'_>, a: usize, b: usize) -> (usize, usize) {
    let rank = |track: usize| (tracks.named[track].is_some(), tracks.frame_count(track));
    if rank(a) >= rank(b) { (a, b) } else { (b, a) }
}

/// At most `count` of `items`, evenly, with both ends.
fn thinned(items: &[usize], count: usize) -> Vec<usize> {
    if items.len() <= count {
        return items.to_vec();
    }
    let last = items.len() - 1;
    (0..count)
        .map(|at| items[at * last / (count - 1)])
        .collect()
}

/// Frames at which a fragment is compared: dense at its ends, where the other track was or will be
/// seen nearby, thin in between (the whole-trajectory test).
fn probes(start: usize, end: usize) -> Vec<usize> {
    let len = end - start;
    let steps = std::iter::successors(Some(1), |step| Some(2 * step));
    let steps = steps.take_while(|step| *step < len);
    let mut probes: Vec<usize> = steps
        .flat_map(|step| [start + step, end - 1 - step])
        .chain([start, end - 1])
        .collect();
    probes.sort_unstable();
    probes.dedup();
    thinned(&probes, FRAMES)
}

/// Compares two disjoint tracks: the guest's places with where the host's neighbours expect the
/// host, and the host's beside them with where the guest's neighbours expect the guest. `None` if
/// neighbours cannot tell.
pub(super) fn compare(tracks: &Tracks<'_>, rings: &[Ring], a: usize, b: usize) -> Option<Pair> {
    let (host, guest) = ordered(tracks, a, b);
    let mut sum = Evidence::default();
    let spacing = rings[host].spacing;
    let mut beside = Vec::new();
    for at in thinned(&tracks.members[guest], PARTS) {
        let Fragment { start, end, .. } = tracks.fragments[at];
        for frame in probes(start, end) {
            if !sum.add(
                tracks,
                rings,
                host,
                frame,
                tracks.sample(at, frame),
                spacing,
            ) {
                return None;
            }
        }
        beside.extend(tracks.sights(host, start)[0]);
        beside.extend(tracks.sights(host, end - 1)[1]);
    }
    beside.sort_unstable();
    beside.dedup();
    for frame in thinned(&beside, BESIDE) {
        if let Some(place) = tracks.position(host, frame)
            && !sum.add(tracks, rings, guest, frame, place, spacing)
        {
            return None;
        }
    }
    (sum.weight > 0.0).then(|| Pair {
        host,
        guest,
        mean: sum.mean / sum.weight,
        worst: sum.worst,
        support: sum.support,
        odds: sum.odds / sum.weight,
    })
}

/// Sums over compared frames, each with the weight that its certainty gives it.
struct Evidence {
    weight: f64,
    mean: f64,
    worst: f64,
    support: usize,
    odds: f64,
}

impl Default for Evidence {
    fn default() -> Self {
        Self {
            weight: 0.0,
            mean: 0.0,
            worst: 0.0,
            support: usize::MAX,
            odds: 0.0,
        }
    }
}

impl Evidence {
    /// Adds where a track is expected against a place; false if it is hopelessly far.
    fn add(
        &mut self,
        tracks: &Tracks<'_>,
        rings: &[Ring],
        track: usize,
        frame: usize,
        place: DVec3,
        spacing: f64,
    ) -> bool {
        let Some(expected) = expect(tracks, &rings[track], track, frame) else {
            return true;
        };
        let (distance, sigma) = (expected.position.distance(place), expected.sigma);
        // What two deviations explain is no departure, and who knows little refutes nothing.
        let departure = if sigma < VAGUE * spacing {
            (distance - 2.0 * sigma).max(0.0) / spacing
        } else {
            0.0
        };
        if departure > GATE {
            return false;
        }
        let unlikely = (distance / sigma).powi(2) / FREEDOM;
        // Anywhere else is within a spacing, or within what is uncertain.
        let odds = 3.0 * (spacing / sigma).ln().max(LEAST_LN) + MIDDLE
            - 0.5 * (FREEDOM + 3.0) * unlikely.ln_1p();
        let weight = (spacing / sigma).powi(2);
        self.weight += weight;
        self.odds += weight * odds;
        self.mean += weight * distance / spacing;
        self.worst = self.worst.max(departure);
        self.support = self.support.min(expected.support);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_hold_both_ends() {
        assert_eq!(probes(5, 6), [5]);
        assert_eq!(probes(5, 9), [5, 6, 7, 8]);
        let many = probes(0, 1000);
        assert_eq!((many.len(), many[0], many[FRAMES - 1]), (FRAMES, 0, 999));
    }
}
