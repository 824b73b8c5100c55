//! Absolute orientation in closed form (Horn, *Closed-form solution of absolute orientation using
//! unit quaternions*, 1987).

use super::symmetric_eigen;
use crate::math::{Quat4, affine, normalise, transform_vector};

/// A point, where it has gone, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Metres.
    pub from: [f32; 3],
    /// Metres.
    pub to: [f32; 3],
    /// Not negative.
    pub weight: f32,
}

/// A rotation, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// Unit quaternion x y z w.
    pub rotation: Quat4,
    /// Metres.
    pub translation: [f32; 3],
}

impl Rigid {
    /// No motion.
    pub const REST: Self = Self {
        rotation: [0.0, 0.0, 0.0, 1.0],
        translation: [0.0; 3],
    };
}

/// How far, as a part of the spread of the points, the best rotation must be ahead of the second
/// best: points on a line leave the turn about it open.
const CERTAIN: f32 = 2e-3;

/// The rotation and translation that bring points nearest to where they have gone, by weighted
/// squares; `None` where they do not fix a rotation: fewer than three, or on a line.
///
/// Numbers must be finite and below 1e6. O(pairs)
#[must_use]
pub fn absolute_orientation<I: Iterator<Item = Pair> + Clone>(pairs: I) -> Option<Rigid> {
    let (mut total, mut from, mut to, mut count) = (0.0, [0.0; 3], [0.0; 3], 0);
    pairs.clone().for_each(|pair| {
        total += pair.weight;
        count += usize::from(pair.weight > 0.0);
        for axis in 0..3 {
            from[axis] += pair.weight * pair.from[axis];
            to[axis] += pair.weight * pair.to[axis];
        }
    });
    if count < 3 || total <= 1e-12 {
        return None;
    }
    let (from, to) = (from.map(|x| x / total), to.map(|x| x / total));
    let mut s = [[0.0_f32; 3]; 3];
    let mut spread = 0.0;
    pairs.for_each(|pair| {
        let a = difference(pair.from, from);
        let b = difference(pair.to, to);
        for (row, a) in s.iter_mut().zip(a) {
            for (sum, b) in row.iter_mut().zip(b) {
                *sum += pair.weight * a * b;
            }
            spread += pair.weight * a * a;
        }
    });
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
    let (values, vectors) = symmetric_eigen([
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]);
    let (mut best, mut second, mut quaternion) = (f32::NEG_INFINITY, f32::NEG_INFINITY, None);
    for (&value, &[w, x, y, z]) in values.iter().zip(&vectors) {
        if value > best {
            (second, best) = (best, value);
            quaternion = Some([x, y, z, w]);
        } else if value > second {
            second = value;
        }
    }
    if spread <= 1e-12 || best - second <= CERTAIN * spread {
        return None;
    }
    let rotation = normalise(quaternion?)?;
    let turned = transform_vector(&affine(rotation, [0.0; 3], [1.0; 3]), from);
    Some(Rigid {
        rotation,
        translation: difference(to, turned),
    })
}

fn difference([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [a - x, b - y, c - z]
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [[f32; 3]; 4] = [
        [0.1, 0.0, 0.0],
        [0.0, 0.2, 0.0],
        [0.0, 0.0, 0.3],
        [0.1, 0.2, 0.1],
    ];

    fn moved(rotation: Quat4, shift: [f32; 3]) -> impl Iterator<Item = Pair> + Clone {
        let matrix = affine(rotation, shift, [1.0; 3]);
        POINTS.into_iter().map(move |from| Pair {
            from,
            to: crate::math::transform_point(&matrix, from),
            weight: 1.0 + from[0],
        })
    }

    #[test]
    fn a_rigid_motion_is_found_whatever_its_turn() {
        for (rotation, shift) in [
            ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0, 0.0], [3.0, -2.0, 1.0]),
            ([0.5, 0.5, -0.5, 0.5], [0.0, 40.0, 0.0]),
            ([0.6, 0.0, 0.8, 1e-4], [0.1, 0.2, 0.3]),
        ] {
            let rotation = normalise(rotation).unwrap();
            let found = absolute_orientation(moved(rotation, shift)).unwrap();
            let same: f32 = crate::math::dot4(found.rotation, rotation);
            assert!((same.abs() - 1.0).abs() < 1e-5, "{found:?}");
            for (a, b) in found.translation.iter().zip(shift) {
                assert!((a - b).abs() < 1e-5, "{found:?}");
            }
        }
    }

    #[test]
    fn points_on_a_line_and_two_points_fix_no_rotation() {
        let line = (0..5).map(|k| Pair {
            from: [k as f32, 0.0, 0.0],
            to: [0.0, k as f32, 0.0],
            weight: 1.0,
        });
        assert_eq!(absolute_orientation(line.clone()), None);
        assert_eq!(absolute_orientation(line.take(0)), None);
        let two = moved([0.0, 0.0, 0.0, 1.0], [0.0; 3]).take(2);
        assert_eq!(absolute_orientation(two), None);
    }
}
