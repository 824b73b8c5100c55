//! A box around a posed avatar, from boxes at rest: no vertex is looked at.

use super::SkinMode;
use crate::asset::Asset;
use crate::math::{Affine12, inverse_sqrt};

/// Low and high corner, metres, model space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bounds {
    /// Smallest x, y, z.
    pub low: [f32; 3],
    /// Largest x, y, z.
    pub high: [f32; 3],
}

impl Bounds {
    /// Around nothing.
    const NONE: Self = Self {
        low: [f32::MAX; 3],
        high: [-f32::MAX; 3],
    };

    fn include(&mut self, other: &Self) {
        for (low, &other) in self.low.iter_mut().zip(&other.low) {
            *low = low.min(other);
        }
        for (high, &other) in self.high.iter_mut().zip(&other.high) {
            *high = high.max(other);
        }
    }
}

/// What rounding may add, relative to the numbers that were summed.
const ROUNDING: f32 = 1e-6;

/// A box that holds every vertex, morph weights from 0 to 1 included; `None` where the asset holds
/// no boxes, or nothing moves.
///
/// `palette: [binds]` from [`crate::pose::palette`]. In [`SkinMode::Linear`] a vertex is a mean of
/// where its binds take it, so the boxes of all binds hold it. In the other modes it may leave that
/// hull, by no more than its binds take it apart: what two binds move together is widened by that.
/// (For two binds a vertex moves on an arc whose chord that is; for more this was tested, not
/// proved.) O(binds + pairs)
#[must_use]
pub fn posed_bounds(asset: &Asset<'_>, palette: &[Affine12], mode: SkinMode) -> Option<Bounds> {
    let rest = &asset.rest_bounds;
    let mut all = Bounds::NONE;
    for (matrix, corners) in palette.iter().zip(rest.boxes) {
        if let Some(moved) = moved(matrix, corners, 0.0) {
            all.include(&moved);
        }
    }
    if mode != SkinMode::Linear {
        for (&[one, other], corners) in rest.pairs.iter().zip(rest.pair_boxes) {
            let of = |bind: u16| palette.get(usize::from(bind));
            if let (Some(one), Some(other)) = (of(one), of(other))
                && let Some(moved) = moved(one, corners, chord(one, other, corners))
            {
                all.include(&moved);
            }
        }
    }
    let [low, ..] = all.low;
    let [high, ..] = all.high;
    (low <= high).then_some(all)
}

/// The box around a moved box, widened; `None` for an empty one.
fn moved(matrix: &Affine12, &[lx, ly, lz, hx, hy, hz]: &[f32; 6], wider: f32) -> Option<Bounds> {
    if lx > hx {
        return None;
    }
    let middle = [0.5 * (lx + hx), 0.5 * (ly + hy), 0.5 * (lz + hz)];
    let half = [0.5 * (hx - lx), 0.5 * (hy - ly), 0.5 * (hz - lz)];
    let mut moved = Bounds::NONE;
    let corners = moved.low.iter_mut().zip(&mut moved.high);
    for ((low, high), &[x, y, z, t]) in corners.zip(matrix.as_chunks::<4>().0) {
        let (mut centre, mut reach, mut size) = (t, wider, t.abs());
        for (number, (middle, half)) in [x, y, z].into_iter().zip(middle.into_iter().zip(half)) {
            centre += number * middle;
            reach += number.abs() * half;
            size += number.abs() * middle.abs();
        }
        reach += ROUNDING * (size + reach);
        (*low, *high) = (centre - reach, centre + reach);
    }
    Some(moved)
}

/// How far two matrices take a point of a box apart, at most: at one of its corners, since that
/// distance is convex. An upper bound, the sum over axes.
fn chord(one: &Affine12, other: &Affine12, &[lx, ly, lz, hx, hy, hz]: &[f32; 6]) -> f32 {
    let mut sum = 0.0;
    let rows = one.as_chunks::<4>().0.iter().zip(other.as_chunks::<4>().0);
    for (&[ax, ay, az, at], &[bx, by, bz, bt]) in rows {
        let (mut low, mut high) = (at - bt, at - bt);
        for (number, from, to) in [(ax - bx, lx, hx), (ay - by, ly, hy), (az - bz, lz, hz)] {
            let (from, to) = (number * from, number * to);
            low += from.min(to);
            high += from.max(to);
        }
        let far = low.abs().max(high.abs());
        sum += far * far;
    }
    sum * inverse_sqrt(sum + f32::MIN_POSITIVE) * (1.0 + ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::IDENTITY;

    const BOX: [f32; 6] = [-1.0, 0.0, 0.0, 1.0, 2.0, 3.0];

    #[test]
    fn a_moved_box_holds_its_corners() {
        let mut matrix = IDENTITY;
        (matrix[0], matrix[1], matrix[3]) = (0.0, -2.0, 5.0);
        let around = moved(&matrix, &BOX, 0.0).unwrap();
        assert!((around.low[0] - 1.0).abs() < 1e-4 && (around.high[0] - 5.0).abs() < 1e-4);
        assert!(moved(&matrix, &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0], 0.0).is_none());
    }

    #[test]
    fn a_chord_is_the_longest_of_the_corners() {
        let mut other = IDENTITY;
        other[3] = 3.0;
        other[7] = 4.0;
        assert!((chord(&IDENTITY, &other, &BOX) - 5.0).abs() < 1e-5);
        assert!(chord(&IDENTITY, &IDENTITY, &BOX) < 1e-6);
    }
}
