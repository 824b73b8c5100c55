//! The points of a frame, in slices along the axis on which they spread most.

use glam::Vec3;

use super::state::NONE;

/// Slices.
pub(super) const BINS: usize = 64;

/// Coordinates beyond this are unusable, metres.
const FAR: f32 = 1000.0;

/// Memory of one point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub(super) position: Vec3,
    /// Index in the caller's slice.
    pub(super) source: u16,
    /// Marker that it belongs to.
    pub(super) owner: u16,
    /// While lost markers are sought: the cheapest, its cost, and the cost of the next.
    pub(super) best: u16,
    pub(super) cost: f32,
    pub(super) second: f32,
}

impl Point {
    /// No point.
    pub const EMPTY: Self = Self {
        position: Vec3::ZERO,
        source: NONE,
        owner: NONE,
        best: NONE,
        cost: f32::MAX,
        second: f32::MAX,
    };
}

/// Points of a frame in working order: by slice, then as the caller gave them.
#[derive(Debug)]
pub(super) struct Points<'b> {
    points: &'b mut [Point],
    bins: &'b mut [u16; BINS + 1],
    count: usize,
    axis: usize,
    low: f32,
    scale: f32,
    /// Inner steps of the frame so far.
    pub work: u32,
}

/// What was left out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Refused {
    pub unusable: usize,
    pub surplus: usize,
}

impl<'b> Points<'b> {
    /// Sorts the usable points of a frame into slices, as many as the memory holds. Linear.
    pub fn load(
        memory: &'b mut [Point],
        bins: &'b mut [u16; BINS + 1],
        given: &[[f32; 3]],
    ) -> (Self, Refused) {
        let capacity = memory.len().min(usize::from(NONE));
        let is_usable = |p: &[f32; 3]| p.iter().all(|x| (-FAR..=FAR).contains(x));
        let mut refused = Refused::default();
        let mut count = 0;
        let (mut low, mut high) = (Vec3::splat(FAR), Vec3::splat(-FAR));
        let mut last = 0;
        for (at, point) in given.iter().enumerate().take(usize::from(NONE)) {
            if !is_usable(point) {
                refused.unusable += 1;
            } else if count == capacity {
                refused.surplus += 1;
            } else {
                let position = Vec3::from_array(*point);
                (low, high) = (low.min(position), high.max(position));
                count += 1;
                last = at + 1;
            }
        }
        refused.surplus += given.len().saturating_sub(usize::from(NONE));
        let extent = (high - low).to_array();
        let (low, mut axis) = (low.to_array(), 1);
        for other in [0, 2] {
            if extent[other] > extent[axis] {
                axis = other;
            }
        }
        let width = extent[axis].max(1e-3);
        let mut points = Self {
            points: memory,
            bins,
            count,
            axis,
            low: low[axis],
            scale: BINS as f32 / width,
            work: count as u32,
        };
        points.sort(given.get(..last).unwrap_or_default(), is_usable);
        (points, refused)
    }

    /// The coordinate by which points are sliced.
    #[inline]
    fn along(&self, point: &[f32; 3]) -> f32 {
        point.get(self.axis).copied().unwrap_or_default()
    }

    /// Counting sort.
    fn sort(&mut self, given: &[[f32; 3]], is_usable: impl Fn(&[f32; 3]) -> bool) {
        self.bins.fill(0);
        let usable = || {
            given
                .iter()
                .enumerate()
                .filter(|(_, point)| is_usable(point))
        };
        for (_, point) in usable() {
            let bin = self.bin(self.along(point));
            if let Some(end) = self.bins.get_mut(bin + 1) {
                *end += 1;
            }
        }
        let mut sum = 0;
        for end in self.bins.iter_mut() {
            sum += *end;
            *end = sum;
        }
        // Each start moves to the next one's place, and back at the end.
        for (source, point) in usable() {
            let bin = self.bin(self.along(point));
            let Some(next) = self.bins.get_mut(bin) else {
                continue;
            };
            if let Some(slot) = self.points.get_mut(usize::from(*next)) {
                *slot = Point {
                    position: Vec3::from_array(*point),
                    source: source as u16,
                    ..Point::EMPTY
                };
            }
            *next += 1;
        }
        for bin in (1..=BINS).rev() {
            let before = self.bins.get(bin - 1).copied().unwrap_or_default();
            if let Some(start) = self.bins.get_mut(bin) {
                *start = before;
            }
        }
        self.bins[0] = 0;
    }

    #[inline]
    fn bin(&self, coordinate: f32) -> usize {
        // The cast saturates, so that what is below lands in the first slice.
        let bin = ((coordinate - self.low) * self.scale) as usize;
        bin.min(BINS - 1)
    }

    pub fn len(&self) -> usize {
        self.count
    }

    #[inline]
    pub fn at(&self, point: usize) -> Point {
        self.points.get(point).copied().unwrap_or(Point::EMPTY)
    }

    #[inline]
    pub fn edit(&mut self, point: usize, change: impl FnOnce(&mut Point)) {
        if let Some(point) = self.points.get_mut(point) {
            change(point);
        }
    }

    /// All of them.
    pub fn all_mut(&mut self) -> &mut [Point] {
        self.points.get_mut(..self.count).unwrap_or_default()
    }

    /// Numbers of the points in slices within `radius` of `centre`: those within `radius` and more.
    #[inline]
    pub fn window(&self, centre: Vec3, radius: f32) -> core::ops::Range<usize> {
        let at = self.along(&centre.to_array());
        let start = self.bins.get(self.bin(at - radius)).copied();
        let end = self.bins.get(self.bin(at + radius) + 1).copied();
        usize::from(start.unwrap_or_default())..usize::from(end.unwrap_or_default())
    }

    /// The points of [`Self::window`] with their numbers; counts them as work.
    #[inline]
    pub fn near(&mut self, centre: Vec3, radius: f32) -> impl Iterator<Item = (usize, &Point)> {
        let window = self.window(centre, radius);
        self.work += window.len() as u32;
        let start = window.start;
        let points = self.points.get(window).unwrap_or_default();
        points
            .iter()
            .enumerate()
            .map(move |(at, point)| (start + at, point))
    }

    /// The nearest point within `radius` that `accept`s, with its squared distance.
    pub fn nearest(
        &mut self,
        centre: Vec3,
        radius: f32,
        accept: impl Fn(&Point) -> bool,
    ) -> Option<(usize, f32)> {
        let mut best = (radius * radius, None);
        for (at, point) in self.near(centre, radius) {
            let distance2 = point.position.distance_squared(centre);
            if distance2 < best.0 && accept(point) {
                best = (distance2, Some(at));
            }
        }
        best.1.map(|at| (at, best.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_every_point_within_the_radius() {
        let mut given = [[0.0; 3]; 103];
        let all = (0..100_u16)
            .map(|i| {
                let t = f32::from(i);
                [
                    libm::sinf(t),
                    3.0 * libm::cosf(1.7 * t),
                    libm::sinf(0.3 * t),
                ]
            })
            .chain([[f32::NAN, 0.0, 0.0], [2e3, 0.0, 0.0], [0.0, 9.0, 0.0]]);
        for (given, point) in given.iter_mut().zip(all) {
            *given = point;
        }
        let (mut memory, mut bins) = ([Point::EMPTY; 100], [0; BINS + 1]);
        let (mut points, refused) = Points::load(&mut memory, &mut bins, &given);
        assert_eq!((refused.unusable, refused.surplus), (2, 1));
        assert_eq!(points.len(), 100);
        for centre in given.iter().take(100).map(|p| Vec3::from_array(*p)) {
            for radius in [0.01, 0.3, 2.0] {
                let within = |p: &&[f32; 3]| Vec3::from_array(**p).distance(centre) <= radius;
                let expected = given.iter().take(100).filter(within).count();
                let near = points.near(centre, radius);
                let found = near.filter(|(_, p)| p.position.distance(centre) <= radius);
                assert_eq!(found.count(), expected);
            }
        }
    }

    #[test]
    fn no_points_and_one_point() {
        let (mut memory, mut bins) = ([Point::EMPTY; 2], [0; BINS + 1]);
        let (mut points, _) = Points::load(&mut memory, &mut bins, &[]);
        assert_eq!(points.nearest(Vec3::ZERO, 9.0, |_| true), None);
        let (mut points, _) = Points::load(&mut memory, &mut bins, &[[1.0, 2.0, 3.0]]);
        let found = points.nearest(Vec3::new(1.0, 2.0, 3.5), 1.0, |_| true);
        assert_eq!(found, Some((0, 0.25)));
    }
}
