//! Absolute orientation: the rotation and translation that carry one set of points to another.

use glam::{DMat3, DQuat, DVec3};

use super::linear::symmetric_eigen;

/// A rotation about the origin, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rigid {
    pub rotation: DMat3,
    pub translation: DVec3,
}

impl Rigid {
    pub const IDENTITY: Self = Self {
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// The weighted least-squares motion from the first points of `pairs` to the second; `None`
    /// without weight. Points on a line leave the turn about it open: then the least turn is near,
    /// not exact. Horn 1987, closed form by the largest eigenvector of a 4 x 4 matrix.
    pub fn fit(pairs: impl Iterator<Item = (DVec3, DVec3, f64)> + Clone) -> Option<Self> {
        let mut weight = 0.0;
        let (mut from, mut to) = (DVec3::ZERO, DVec3::ZERO);
        for (a, b, w) in pairs.clone() {
            weight += w;
            from += w * a;
            to += w * b;
        }
        if weight.is_nan() || weight <= 0.0 {
            return None;
        }
        let (from, to) = (from / weight, to / weight);
        let mut s = [[0.0; 3]; 3];
        let mut size = 0.0;
        for (a, b, w) in pairs {
            let (a, b) = ((a - from).to_array(), (b - to).to_array());
            for row in 0..3 {
                size += w * (a[row] * a[row] + b[row] * b[row]);
                for column in 0..3 {
                    s[row][column] += w * a[row] * b[column];
                }
            }
        }
        let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
        // A grain of preference for no turn decides what the points leave open.
        let least = 1e-9 * size;
        #[rustfmt::skip]
        let matrix = [
            xx + yy + zz + least, yz - zy, zx - xz, xy - yx,
            yz - zy, xx - yy - zz, xy + yx, zx + xz,
            zx - xz, xy + yx, yy - xx - zz, yz + zy,
            xy - yx, zx + xz, yz + zy, zz - xx - yy,
        ];
        let (_, vectors) = symmetric_eigen(4, matrix.to_vec());
        let turn = DQuat::from_xyzw(vectors[1], vectors[2], vectors[3], vectors[0]);
        let rotation = DMat3::from_quat(turn.normalize());
        Some(Self {
            rotation,
            translation: to - rotation * from,
        })
    }

    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_motion_comes_back() {
        let motion = Rigid {
            rotation: DMat3::from_rotation_y(2.5) * DMat3::from_rotation_x(-1.0),
            translation: DVec3::new(1.0, -2.0, 3.0),
        };
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, 2.0 * DVec3::Z];
        for count in 3..=4 {
            let pairs = points[..count].iter().map(|&p| (p, motion.apply(p), 1.0));
            let found = Rigid::fit(pairs).unwrap();
            for point in points {
                assert!(found.apply(point).distance(motion.apply(point)) < 1e-7);
                assert!(found.inverse().apply(motion.apply(point)).distance(point) < 1e-7);
            }
        }
        assert_eq!(Rigid::fit([].into_iter()), None);
        let one = Rigid::fit([(DVec3::X, DVec3::Y, 2.0)].into_iter()).unwrap();
        assert_eq!(one.rotation, DMat3::IDENTITY);
    }
}
