//! How far a piece of a surface is from moving rigidly.

use glam::{DMat3, DQuat, DVec3};

use crate::fit::laplace::rotations::fit_rotation;

/// Sums over the points of a piece in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums {
    weight: f64,
    rest: DVec3,
    posed: DVec3,
    cross: DMat3,
    squares: f64,
}

impl Sums {
    /// The default of a matrix is not zero.
    const NOTHING: Self = Self {
        weight: 0.0,
        rest: DVec3::ZERO,
        posed: DVec3::ZERO,
        cross: DMat3::ZERO,
        squares: 0.0,
    };

    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.rest += other.rest;
        self.posed += other.posed;
        self.cross += other.cross;
        self.squares += other.squares;
    }

    /// The best rigid motion, and the weighted sum of squares that it leaves (Horn 1987).
    fn fit(&self) -> Option<(DQuat, DVec3, f64)> {
        if self.weight <= 0.0 {
            return None;
        }
        let (rest, posed) = (self.rest / self.weight, self.posed / self.weight);
        let outer = DMat3::from_cols(
            self.posed * rest.x,
            self.posed * rest.y,
            self.posed * rest.z,
        );
        let cross = self.cross - outer;
        let axes = [0, 1, 2].map(|at| (DVec3::AXES[at], cross.col(at), 1.0));
        let turn = fit_rotation(axes);
        let along: f64 = (0..3)
            .map(|at| (turn * DVec3::AXES[at]).dot(cross.col(at)))
            .sum();
        let spread = self.squares - self.weight * (rest.length_squared() + posed.length_squared());
        Some((turn, posed - turn * rest, (spread - 2.0 * along).max(0.0)))
    }
}

/// Sums over the points of a piece in every frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    frames: Vec<Sums>,
}

impl Piece {
    pub fn empty(frame_count: usize) -> Self {
        Self {
            frames: vec![Sums::NOTHING; frame_count],
        }
    }

    /// A point with a weight; frames in which it is missing (NaN) do not count.
    pub fn point(&mut self, frame: usize, rest: DVec3, posed: DVec3, weight: f64) {
        if !posed.is_finite() {
            return;
        }
        self.frames[frame].add(&Sums {
            weight,
            rest: rest * weight,
            posed: posed * weight,
            cross: DMat3::from_cols(posed * rest.x, posed * rest.y, posed * rest.z) * weight,
            squares: weight * (rest.length_squared() + posed.length_squared()),
        });
    }

    pub fn add(&mut self, other: &Self) {
        self.frames
            .iter_mut()
            .zip(&other.frames)
            .for_each(|(a, b)| a.add(b));
    }

    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    pub fn with(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.add(other);
        both
    }

    /// Mean over the frames of what a rigid motion leaves: area times square metres.
    pub fn left(&self) -> f64 {
        let frames = self.frames.iter().filter_map(Sums::fit);
        let (sum, count) = frames.fold((0.0, 0), |(sum, count), fit| (sum + fit.2, count + 1));
        sum / f64::from(count.max(1))
    }

    /// The rigid motions: rotation and translation, `None` where nothing is seen.
    pub fn motions(&self) -> Vec<Option<(DQuat, DVec3)>> {
        let fit = |sums: &Sums| sums.fit().map(|(turn, shift, _)| (turn, shift));
        self.frames.iter().map(fit).collect()
    }

    /// What given motions leave of this piece, mean over the frames.
    pub fn left_by(&self, motions: &[Option<(DQuat, DVec3)>]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (sums, motion) in self.frames.iter().zip(motions) {
            let Some((turn, shift)) = motion.filter(|_| sums.weight > 0.0) else {
                continue;
            };
            let turn = DMat3::from_quat(turn);
            let along: f64 = (0..3).map(|at| turn.col(at).dot(sums.cross.col(at))).sum();
            // |y - R x - t|^2 = y^2 + x^2 + t^2 - 2 y.Rx - 2 t.y + 2 t.Rx
            let left = sums.squares + sums.weight * shift.length_squared()
                - 2.0 * along
                - 2.0 * shift.dot(sums.posed)
                + 2.0 * shift.dot(turn * sums.rest);
            sum += left.max(0.0);
            count += 1;
        }
        sum / f64::from(count.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_piece_leaves_nothing_and_two_leave_what_a_hand_computes() {
        let turn = DQuat::from_rotation_x(0.7);
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let mut piece = Piece::empty(1);
        for point in rest {
            piece.point(0, point, turn * point + DVec3::ONE, 0.5);
        }
        assert!(piece.left() < 1e-6);
        let motions = piece.motions();
        assert!(piece.left_by(&motions) < 1e-6);
        // Every point 2 m off, half a weight each.
        let off = motions
            .iter()
            .map(|m| m.map(|(turn, shift)| (turn, shift + DVec3::X * 2.0)));
        let off: Vec<_> = off.collect();
        assert!((piece.left_by(&off) - 8.0).abs() < 1e-3);
        // Two points that part by 2 d: a rigid motion leaves d squared for each.
        let mut pair = Piece::empty(1);
        pair.point(0, DVec3::X, DVec3::X * 1.5, 1.0);
        pair.point(0, -DVec3::X, -DVec3::X * 1.5, 1.0);
        assert!((pair.left() - 0.5).abs() < 1e-6);
        assert!((pair.with(&Piece::empty(1)).left() - 0.5).abs() < 1e-6);
        piece.point(0, DVec3::ONE, DVec3::NAN, 1.0);
        assert!(piece.left() < 1e-6);
    }
}
