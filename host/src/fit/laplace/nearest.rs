//! The nearest of many points.

use glam::DVec3;

/// Points halved again and again along their longest side (Bentley 1975).
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Each middle is the root of its range; smaller coordinates stand before it.
    points: Vec<(DVec3, u32)>,
    /// The axis along which each middle halves its range.
    axes: Vec<u8>,
}

impl Nearest {
    /// Over points in any order. O(points log points)
    #[must_use]
    pub fn new(points: &[DVec3]) -> Self {
        let mut points: Vec<(DVec3, u32)> = points.iter().copied().zip(0..).collect();
        let mut axes = vec![0; points.len()];
        let mut open = vec![(0, points.len())];
        while let Some((start, end)) = open.pop() {
            if end - start < 2 {
                continue;
            }
            let part = &mut points[start..end];
            let low = part.iter().fold(DVec3::INFINITY, |low, p| low.min(p.0));
            let high = part
                .iter()
                .fold(DVec3::NEG_INFINITY, |high, p| high.max(p.0));
            let axis = (high - low).max_position();
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |a, b| {
                a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
            });
            let middle = start + half;
            axes[middle] = axis as u8;
            open.extend([(start, middle), (middle + 1, end)]);
        }
        Self { points, axes }
    }

    /// Index of the nearest point and its distance; none among no points. O(log points) as a rule
    #[must_use]
    pub fn find(&self, place: DVec3) -> Option<(u32, f64)> {
        let mut best = (f64::INFINITY, 0);
        let mut open = vec![(0..self.points.len(), 0.0)];
        while let Some((range, gap)) = open.pop() {
            if range.is_empty() || gap > best.0 {
                continue;
            }
            let middle = range.start + range.len() / 2;
            let (point, index) = self.points[middle];
            let square = point.distance_squared(place);
            if square < best.0 || (square == best.0 && index < best.1) {
                best = (square, index);
            }
            let axis = usize::from(self.axes[middle]);
            let off = place[axis] - point[axis];
            let (low, high) = (range.start..middle, middle + 1..range.end);
            let (near, far) = if off < 0.0 { (low, high) } else { (high, low) };
            open.push((far, off * off));
            open.push((near, gap));
        }
        best.0.is_finite().then(|| (best.1, best.0.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_is_the_nearest_of_all() {
        let number = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 16) / 65_536.0;
        let point = |k: u32| DVec3::new(number(k), number(k + 7919), number(k + 104_729));
        let points: Vec<_> = (0..500).map(point).collect();
        let nearest = Nearest::new(&points);
        for k in 1000..1200 {
            let place = point(k);
            let slow = points.iter().map(|p| p.distance(place));
            let slow = slow.fold(f64::INFINITY, f64::min);
            let (index, distance) = nearest.find(place).expect("there are some");
            assert!((distance - slow).abs() < 1e-12);
            assert!((points[index as usize].distance(place) - slow).abs() < 1e-12);
        }
        assert_eq!(Nearest::new(&[]).find(DVec3::ZERO), None);
    }
}
