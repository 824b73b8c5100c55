//! A rope among points: the longest chain of evenly spaced ones.
//!
//! Needs no hanging rope: from a pair of points the chain grows both ways, each time to the point
//! whose distance fits the spacing and whose direction bends least. Used to order the rope at the
//! start and to find it again after it was lost.

use glam::Vec3;

use super::points::{NONE, Points};
use super::state::Track;
use super::vector::{dot, length, unit};
use crate::row::Row;

/// A link may differ from the spacing by this share.
const TOLERANCE: f32 = 0.25;
/// A chain does not turn by more than about 100 degrees at a marker.
const SHARPEST: f32 = -0.2;
/// Price of a link's relative misfit squared against one minus the cosine of its bend: first for
/// ropes with even spacing among other markers, then for uneven ones.
const EVEN: f32 = 300.0;
pub(super) const UNEVEN: f32 = 8.0;
/// Across a missing marker the chain must go on roughly straight.
const ACROSS_GAP: f32 = 0.5;
/// The farthest first link of a rope whose spacing is not known, metres.
const FARTHEST_LINK: f32 = 0.5;

/// Points in order along a rope; `NONE` where one is missing.
pub(super) type Chain<const TRACES: usize> = heapless::Vec<u16, TRACES>;

/// The best continuation from `tip`, between `low` and `high` metres away.
fn next_link<const P: usize>(
    points: &mut Points<P>,
    tip: Vec3,
    heading: Vec3,
    spacing: f32,
    evenness: f32,
    sharpest: f32,
) -> Option<u16> {
    let (low, high) = (spacing * (1.0 - TOLERANCE), spacing * (1.0 + TOLERANCE));
    let mut best = (f32::MAX, None);
    points.near(tip, high, |point, offset, square| {
        if square < low * low {
            return;
        }
        let away = length(offset);
        let bend = dot(offset, heading) / away;
        if bend < sharpest {
            return;
        }
        let misfit = (away - spacing) / spacing;
        let cost = evenness * misfit * misfit + (1.0 - bend);
        if cost < best.0 {
            best = (cost, Some(point));
        }
    });
    best.1
}

/// Grows a chain from `tip`, which it has reached from `root`, claiming its points.
fn grow<const P: usize, const T: usize>(
    points: &mut Points<P>,
    mut root: Vec3,
    mut tip: Vec3,
    spacing: f32,
    evenness: f32,
    chain: &mut Chain<T>,
) {
    while chain.len() < T {
        let heading = unit(tip - root);
        let near = next_link(points, tip, heading, spacing, evenness, SHARPEST);
        let far = if near.is_none() && chain.len() + 1 < T {
            next_link(points, tip, heading, 2.0 * spacing, evenness, ACROSS_GAP)
        } else {
            None
        };
        let Some(point) = near.or(far) else {
            return;
        };
        if near.is_none() {
            // Cannot fail: the length was checked above.
            let _ = chain.push(NONE);
        }
        let _ = chain.push(point);
        points.claim(point);
        root = tip;
        tip = points.at(usize::from(point));
    }
}

/// The chain through the link from point `a` to point `b`; claims its points.
pub(super) fn through<const P: usize, const T: usize>(
    points: &mut Points<P>,
    a: u16,
    b: u16,
    spacing: f32,
    evenness: f32,
) -> Chain<T> {
    let (from, to) = (points.at(usize::from(a)), points.at(usize::from(b)));
    points.claim(a);
    points.claim(b);
    let mut tail = Chain::<T>::new();
    grow(points, from, to, spacing, evenness, &mut tail);
    let mut head = Chain::<T>::new();
    grow(points, to, from, spacing, evenness, &mut head);
    let mut chain = Chain::new();
    let whole = head.iter().rev().chain([&a, &b]).chain(&tail);
    // A longer chain than there are traces is cut; the start refuses it by its length.
    for &point in whole.take(T) {
        let _ = chain.push(point);
    }
    chain
}

/// Links of a chain whose both points exist: (place of the first, length).
fn links<'a, const P: usize>(
    points: &'a Points<P>,
    chain: &'a [u16],
) -> impl Iterator<Item = (usize, f32)> + 'a {
    let pairs = chain.iter().zip(chain.iter().skip(1)).enumerate();
    pairs
        .filter(|(_, (a, b))| **a != NONE && **b != NONE)
        .map(|(k, (&a, &b))| {
            let span = points.at(usize::from(b)) - points.at(usize::from(a));
            (k, length(span))
        })
}

/// The longest evenly spaced chain without a hole; among equals, the most even.
///
/// Visits at most `POINTS * 3 * 2 * 4 * TRACES` neighbourhoods; for the start, not for every frame.
pub(super) fn longest<const P: usize, const T: usize>(
    points: &mut Points<P>,
    spacing: Option<f32>,
    wanted: usize,
) -> Chain<T> {
    let mut best = (Chain::<T>::new(), f32::MAX);
    for a in 0..points.count() {
        points.release_all();
        points.claim(a as u16);
        let here = points.at(a);
        // The three nearest first links.
        let mut nearest = [(f32::MAX, NONE); 3];
        let reach = spacing.map_or(FARTHEST_LINK, |s| s * (1.0 + TOLERANCE));
        points.near(here, reach, |point, _, square| {
            let mut carried = (square, point);
            for slot in &mut nearest {
                if carried.0 < slot.0 {
                    core::mem::swap(slot, &mut carried);
                }
            }
        });
        for (_, b) in nearest {
            if b == NONE {
                continue;
            }
            let first = length(points.at(usize::from(b)) - here);
            for evenness in [EVEN, UNEVEN] {
                points.release_all();
                let spacing = spacing.unwrap_or(first);
                let chain = through::<P, T>(points, a as u16, b, spacing, evenness);
                let chain = trimmed(points, &chain, wanted);
                let unevenness = unevenness(points, &chain);
                let longer = chain.len() > best.0.len();
                if longer || (chain.len() == best.0.len() && unevenness < best.1) {
                    best = (chain, unevenness);
                }
            }
        }
    }
    points.release_all();
    best.0
}

/// Variance of the links over their squared mean.
fn unevenness<const P: usize>(points: &Points<P>, chain: &[u16]) -> f32 {
    let (mut count, mut sum, mut squares) = (0.0_f32, 0.0, 0.0);
    for (_, link) in links(points, chain) {
        count += 1.0;
        sum += link;
        squares += link * link;
    }
    let mean = sum / count.max(1.0);
    (squares / count.max(1.0) - mean * mean) / (mean * mean).max(1e-12)
}

/// The middle value; sorts by insertion, for chains are short and this cannot panic.
fn median(values: &mut [f32]) -> f32 {
    for sorted in 1..values.len() {
        for k in (1..=sorted).rev() {
            if let Some([before, after]) = values.get_mut(k - 1..=k)
                && *before > *after
            {
                core::mem::swap(before, after);
            }
        }
    }
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Cuts a chain at holes and at links that are out of step with the others, and keeps the
/// longest piece; of a piece longer than `wanted` (0: any), the most even part.
fn trimmed<const P: usize, const T: usize>(
    points: &Points<P>,
    chain: &[u16],
    wanted: usize,
) -> Chain<T> {
    let mut deviations = heapless::Vec::<f32, T>::new();
    for (_, link) in links(points, chain) {
        let _ = deviations.push(link);
    }
    let median = median(&mut deviations);
    for link in &mut deviations {
        *link = (*link - median).abs();
    }
    let typical = self::median(&mut deviations);
    // A bend shortens the distance between its markers; nothing lengthens it.
    let longer = (4.0 * typical).max(0.03 * median).min(0.12 * median);
    let shorter = (4.0 * typical).max(0.12 * median).min(0.2 * median);
    let (mut best, mut begin) = (0..0, 0);
    let mut even = Row::<bool, T>::new();
    for (k, link) in links(points, chain) {
        even.set(k, link - median <= longer && median - link <= shorter);
    }
    for k in 0..chain.len() {
        if k + 1 == chain.len() || !even.at(k) {
            if k + 1 - begin > best.len() {
                best = begin..k + 1;
            }
            begin = k + 1;
        }
    }
    let mut piece = chain.get(best).unwrap_or_default();
    while wanted > 0 && piece.len() > wanted {
        let (Some((_, without_first)), Some((_, without_last))) =
            (piece.split_first(), piece.split_last())
        else {
            break;
        };
        let first_is_worse = unevenness(points, without_first) < unevenness(points, without_last);
        piece = if first_is_worse {
            without_first
        } else {
            without_last
        };
    }
    Chain::from_slice(piece).unwrap_or_default()
}

/// How a found chain lies on a known rope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Trace of the chain's first point.
    pub(super) offset: usize,
    /// Whether the chain runs from the rope's end to its beginning.
    pub(super) reversed: bool,
    /// Mean square of the links' errors in standard deviations.
    pub(super) misfit: f32,
    /// Mean cost a point, and that of the next best way.
    pub(super) cost: f32,
    pub(super) next: f32,
}

/// The best place of `chain` on the rope: by the lengths of the segments, and by where the markers
/// were last believed to be.
pub(super) fn fit<const P: usize, const T: usize>(
    track: &Track<T>,
    points: &Points<P>,
    chain: &[u16],
) -> Option<Fit> {
    let count = track.measures.count;
    let spare = count.checked_sub(chain.len())?;
    let mut best: Option<Fit> = None;
    for reversed in [false, true] {
        for offset in 0..=spare {
            let trace = |k: usize| {
                if reversed {
                    (count - 1).saturating_sub(offset + k)
                } else {
                    offset + k
                }
            };
            let mut misfit = 0.0;
            for (k, link) in links(points, chain) {
                let segment = trace(k).min(trace(k + 1));
                let off = link - track.measures.length.at(segment);
                let spread = track.measures.spread.at(segment) + 4e-6;
                misfit += (off * off / spread).min(9.0);
            }
            let mut sum = misfit;
            for (k, &point) in chain.iter().enumerate().filter(|(_, p)| **p != NONE) {
                let off = points.at(usize::from(point)) - track.pose.now.at(trace(k));
                let doubt = track.doubt.at(trace(k)).max(track.measures.spacing);
                sum += (dot(off, off) / (doubt * doubt)).min(9.0);
            }
            let points_seen = chain.len().max(1) as f32;
            let (cost, misfit) = (sum / points_seen, misfit / points_seen);
            match &mut best {
                Some(fit) if cost >= fit.cost => fit.next = fit.next.min(cost),
                slot => {
                    let next = slot.as_ref().map_or(f32::MAX, |fit| fit.cost);
                    *slot = Some(Fit {
                        offset,
                        reversed,
                        misfit,
                        cost,
                        next,
                    });
                }
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::state::Pace;
    use super::*;

    /// A helix, so that nothing hangs, shuffled among scattered points.
    fn scene() -> ([[f32; 3]; 20], [Vec3; 12]) {
        let rope: [Vec3; 12] = core::array::from_fn(|i| {
            let a = 0.35 * i as f32;
            Vec3::new(0.25 * libm::cosf(a), 0.05 * i as f32, 0.25 * libm::sinf(a))
        });
        let mut list = [[0.0; 3]; 20];
        for (i, slot) in list.iter_mut().enumerate() {
            let place = (i * 7) % 20;
            *slot = match rope.get(place) {
                Some(marker) => marker.to_array(),
                None => {
                    let k = place as f32;
                    [
                        0.9 + 0.31 * libm::sinf(k * 9.0),
                        0.17 * k - 2.0,
                        0.3 * libm::cosf(k * 5.0),
                    ]
                }
            };
        }
        (list, rope)
    }

    #[test]
    fn a_chain_is_found_among_other_points() {
        let (list, rope) = scene();
        let mut points = Points::<32>::new();
        points.load(&list);
        let chain = longest::<32, 16>(&mut points, None, 0);
        assert_eq!(chain.len(), 12);
        let forward = (points.at(usize::from(chain[0])) - rope[0]).length() < 1e-6;
        for (k, &point) in chain.iter().enumerate() {
            let marker = rope[if forward { k } else { 11 - k }];
            assert!((points.at(usize::from(point)) - marker).length() < 1e-6);
        }
        // Of a longer chain, as many as wanted.
        assert_eq!(longest::<32, 16>(&mut points, None, 10).len(), 10);
    }

    #[test]
    fn a_chain_is_laid_onto_the_rope() {
        let (list, rope) = scene();
        let mut points = Points::<32>::new();
        points.load(&list);
        let chain = longest::<32, 16>(&mut points, Some(0.1), 0);
        // The rope is remembered half a spacing away, and the other way round.
        let moved = rope.iter().rev().map(|p| *p + Vec3::Y * 0.05);
        let mut track = Track::<16>::new(Pace::new(100.0, [0.0; 3]), moved);
        for i in 0..12 {
            track.doubt.set(i, 0.1);
        }
        let fit = fit(&track, &points, &chain).unwrap();
        let first = points.at(usize::from(chain[0]));
        let trace = if fit.reversed { 11 } else { 0 };
        assert_eq!(fit.offset, 0);
        assert!((first - track.pose.now.at(trace)).length() < 0.06);
        assert!(fit.next > fit.cost + 1.0);
    }
}
