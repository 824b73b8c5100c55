//! A frame's points: checked, and sorted into slabs so that a search sees only what is near.

use glam::Vec3;

use super::vector::dot;
use crate::row::Row;

/// Slabs across the longest side of the points' box.
const SLABS: usize = 64;
/// Coordinates beyond this are as useless as infinity: squares of them leave `f32`.
const FARTHEST: f32 = 1e6;

/// No point.
pub(super) const NONE: u16 = u16::MAX;

#[derive(Clone, Debug)]
pub(super) struct Points<const POINTS: usize> {
    count: usize,
    position: Row<Vec3, POINTS>,
    /// Place in the caller's slice.
    source: Row<u16, POINTS>,
    claimed: Row<bool, POINTS>,
    axis: u8,
    low: f32,
    slabs_per_metre: f32,
    /// Where each slab begins in `order`.
    first: Row<u16, { SLABS + 1 }>,
    order: Row<u16, POINTS>,
    slab_of: Row<u8, POINTS>,
    /// Inner steps of this frame, for the report.
    pub(super) work: u32,
}

/// What was left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Refused {
    pub(super) unusable: u16,
    pub(super) surplus: u16,
}

#[inline]
fn along(v: Vec3, axis: u8) -> f32 {
    match axis {
        0 => v.x,
        1 => v.y,
        _ => v.z,
    }
}

impl<const POINTS: usize> Points<POINTS> {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            position: Row::new(),
            source: Row::new(),
            claimed: Row::new(),
            axis: 0,
            low: 0.0,
            slabs_per_metre: 0.0,
            first: Row::new(),
            order: Row::new(),
            slab_of: Row::new(),
            work: 0,
        }
    }

    /// Takes the first `POINTS` of `points`; leaves out what is not a usable number.
    pub(super) fn load(&mut self, points: &[[f32; 3]]) -> Refused {
        let mut refused = Refused::default();
        let surplus = points.len().saturating_sub(POINTS);
        refused.surplus = u16::try_from(surplus).unwrap_or(u16::MAX);
        self.count = 0;
        self.work = 0;
        let (mut low, mut high) = (Vec3::splat(FARTHEST), Vec3::splat(-FARTHEST));
        for (place, &[x, y, z]) in points.iter().take(POINTS).enumerate() {
            // NaN fails every comparison.
            let usable = |c: f32| c > -FARTHEST && c < FARTHEST;
            if !(usable(x) && usable(y) && usable(z)) {
                refused.unusable += 1;
                continue;
            }
            let point = Vec3::new(x, y, z);
            low = low.min(point);
            high = high.max(point);
            self.position.set(self.count, point);
            self.source.set(self.count, place as u16);
            self.claimed.set(self.count, false);
            self.count += 1;
        }
        self.sort(low, high);
        refused
    }

    /// Counting sort along the longest side of the box.
    fn sort(&mut self, low: Vec3, high: Vec3) {
        let side = high - low;
        self.axis = if side.x >= side.y && side.x >= side.z {
            0
        } else if side.y >= side.z {
            1
        } else {
            2
        };
        self.low = along(low, self.axis);
        let longest = along(side, self.axis);
        self.slabs_per_metre = if longest > 1e-6 {
            SLABS as f32 / longest
        } else {
            0.0
        };
        self.first.fill(0);
        for index in 0..self.count {
            let slab = self.slab(along(self.position.at(index), self.axis));
            self.slab_of.set(index, slab as u8);
            self.first.edit(slab, |n| *n += 1);
        }
        let mut begin = 0;
        for slab in 0..=SLABS {
            let members = self.first.at(slab);
            self.first.set(slab, begin);
            begin += members;
        }
        for index in 0..self.count {
            let slab = usize::from(self.slab_of.at(index));
            let place = self.first.at(slab);
            self.order.set(usize::from(place), index as u16);
            self.first.set(slab, place + 1);
        }
        // Each start has moved to its slab's end: shift back by one.
        let mut begin = 0;
        for slab in 0..=SLABS {
            let end = self.first.at(slab);
            self.first.set(slab, begin);
            begin = end;
        }
    }

    /// Float to integer conversion saturates, so any coordinate gives a slab.
    #[inline]
    fn slab(&self, coordinate: f32) -> usize {
        (((coordinate - self.low) * self.slabs_per_metre) as usize).min(SLABS - 1)
    }

    #[inline]
    pub(super) fn count(&self) -> usize {
        self.count
    }

    #[inline]
    pub(super) fn at(&self, index: usize) -> Vec3 {
        self.position.at(index)
    }

    /// Place of a point in the caller's slice.
    #[inline]
    pub(super) fn source(&self, index: u16) -> u16 {
        self.source.at(usize::from(index))
    }

    #[inline]
    pub(super) fn is_claimed(&self, index: usize) -> bool {
        self.claimed.at(index)
    }

    #[inline]
    pub(super) fn claim(&mut self, index: u16) {
        self.claimed.set(usize::from(index), true);
    }

    pub(super) fn release_all(&mut self) {
        self.claimed.fill(false);
    }

    /// Calls `visit(index, point - centre, squared distance)` for unclaimed points within `radius`.
    #[inline]
    pub(super) fn near(
        &mut self,
        centre: Vec3,
        radius: f32,
        mut visit: impl FnMut(u16, Vec3, f32),
    ) {
        let middle = along(centre, self.axis);
        let begin = self.first.at(self.slab(middle - radius));
        let end = self.first.at(self.slab(middle + radius) + 1);
        let places = usize::from(begin)..usize::from(end);
        let (reach, mut work) = (radius * radius, 0);
        for &index in self
            .order
            .as_slice(self.count)
            .get(places)
            .unwrap_or_default()
        {
            work += 1;
            let offset = self.position.at(usize::from(index)) - centre;
            let square = dot(offset, offset);
            if square < reach && !self.claimed.at(usize::from(index)) {
                visit(index, offset, square);
            }
        }
        self.work = self.work.wrapping_add(work);
    }

    /// The nearest unclaimed point within `radius`.
    pub(super) fn nearest(&mut self, centre: Vec3, radius: f32) -> Option<u16> {
        let mut best = (f32::MAX, None);
        self.near(centre, radius, |index, _, square| {
            if square < best.0 {
                best = (square, Some(index));
            }
        });
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn search_finds_what_a_full_scan_finds() {
        let mut points = Points::<64>::new();
        let coordinate = |i: u32, k: u32| ((i * 37 + k * 101) % 97) as f32 * 0.01;
        let list: [[f32; 3]; 60] =
            core::array::from_fn(|i| core::array::from_fn(|k| coordinate(i as u32, k as u32)));
        assert_eq!(points.load(&list), Refused::default());
        for centre in list {
            let centre = Vec3::from_array(centre);
            let mut found = 0;
            points.near(centre, 0.25, |_, _, _| found += 1);
            let all = list.iter().filter(|&&p| {
                let d = Vec3::from_array(p) - centre;
                dot(d, d) < 0.0625
            });
            assert_eq!(found, all.count());
        }
    }

    #[test]
    fn unusable_and_surplus_points_are_counted() {
        let mut points = Points::<3>::new();
        let refused = points.load(&[
            [f32::NAN, 0.0, 0.0],
            [0.0, f32::INFINITY, 0.0],
            [1.0, 2.0, 3.0],
            [0.0; 3],
        ]);
        assert_eq!(
            refused,
            Refused {
                unusable: 2,
                surplus: 1
            }
        );
        assert_eq!((points.count(), points.source(0)), (1, 2));
        assert_eq!(points.nearest(Vec3::new(1.0, 2.0, 3.1), 0.2), Some(0));
        points.claim(0);
        assert_eq!(points.nearest(Vec3::new(1.0, 2.0, 3.1), 0.2), None);
    }

    #[test]
    fn all_points_in_one_place() {
        let mut points = Points::<4>::new();
        points.load(&[[1.0; 3]; 4]);
        let mut found = 0;
        points.near(Vec3::ONE, 0.1, |_, _, _| found += 1);
        assert_eq!(found, 4);
        points.near(Vec3::splat(1e5), 0.1, |_, _, _| found += 1);
        assert_eq!(found, 4);
    }
}
