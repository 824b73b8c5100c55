//! Morph targets, added to the rest shape before it is skinned.

use super::lanes::Lanes;
use super::skin::{load, to_unit_length};
use crate::asset::{Asset, Lanes3};

/// An asset's morph targets with their weights; nothing where all weights are zero.
#[derive(Clone, Copy)]
pub(super) struct Morphs<'m, 'a> {
    asset: &'m Asset<'a>,
    weights: &'m [f32],
}

impl<'m, 'a> Morphs<'m, 'a> {
    /// `weights: [morphs]`; those that are missing count as zero.
    pub fn new(asset: &'m Asset<'a>, weights: &'m [f32]) -> Option<Self> {
        let moved = asset.dims().morph_row_count > 0 && weights.iter().any(|&weight| weight != 0.0);
        moved.then_some(Self { asset, weights })
    }

    #[inline(always)]
    pub fn positions<L: Lanes>(
        &self,
        token: L::Token,
        block: usize,
        first: usize,
        mut sums: [L; 3],
    ) -> [L; 3] {
        for row in self.asset.morph_rows(block) {
            let weight = self.weights.get(row.morph).copied().unwrap_or(0.0);
            if weight != 0.0 {
                sums = add(token, sums, row.offsets, weight, first);
            }
        }
        sums
    }

    /// At unit length again where something was added, so that skinning can rely on it.
    #[inline(always)]
    pub fn normals<L: Lanes>(
        &self,
        token: L::Token,
        block: usize,
        first: usize,
        mut sums: [L; 3],
    ) -> [L; 3] {
        let mut changed = false;
        for row in self.asset.morph_rows(block) {
            let weight = self.weights.get(row.morph).copied().unwrap_or(0.0);
            if let Some(offsets) = row.normals.filter(|_| weight != 0.0) {
                sums = add(token, sums, offsets, weight, first);
                changed = true;
            }
        }
        if changed {
            sums = to_unit_length(token, sums);
        }
        sums
    }
}

#[inline(always)]
fn add<L: Lanes>(
    token: L::Token,
    [x, y, z]: [L; 3],
    offsets: &Lanes3,
    weight: f32,
    first: usize,
) -> [L; 3] {
    let weight = L::splat(token, weight);
    let [dx, dy, dz] = load::<L>(token, offsets, first);
    [
        x.add(dx.mul(weight)),
        y.add(dy.mul(weight)),
        z.add(dz.mul(weight)),
    ]
}
