//! Morph targets, added to the rest shape before it is skinned.

use super::lanes::Lanes;
use super::rest::Room;
use super::skin::to_unit_length;
use crate::asset::{Asset, LANES, Lanes3};

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

    /// Whether a block has rows.
    #[inline(always)]
    pub fn move_block(&self, block: usize) -> bool {
        let starts = self.asset.morph_starts;
        starts.get(block) != starts.get(block + 1)
    }

    /// Adds the offsets of a block; normals are at unit length again where something was added,
    /// and made so before where they were not.
    #[inline(always)]
    pub fn add_to<L: Lanes>(
        &self,
        token: L::Token,
        block: usize,
        room: &mut Room,
        has_unit_normals: bool,
    ) {
        let mut changed = false;
        for row in self.asset.morph_rows(block) {
            let weight = self.weights.get(row.morph).copied().unwrap_or(0.0);
            if weight == 0.0 {
                continue;
            }
            add::<L>(token, &mut room.positions, row.offsets, weight);
            if let Some(offsets) = row.normals {
                if !changed && !has_unit_normals {
                    normalise::<L>(token, &mut room.normals);
                }
                add::<L>(token, &mut room.normals, offsets, weight);
                changed = true;
            }
        }
        if changed {
            normalise::<L>(token, &mut room.normals);
        }
    }

    /// The same sums, kept in registers: of a block that is not packed, where there are registers.
    #[inline(always)]
    pub fn put_sum<L: Lanes>(
        &self,
        token: L::Token,
        block: usize,
        (positions, normals): (&Lanes3, &Lanes3),
        room: &mut Room,
    ) {
        for first in (0..LANES).step_by(L::WIDTH) {
            let mut position = L::load3(token, positions, first);
            let mut normal = L::load3(token, normals, first);
            let mut changed = false;
            for row in self.asset.morph_rows(block) {
                let weight = self.weights.get(row.morph).copied().unwrap_or(0.0);
                if weight == 0.0 {
                    continue;
                }
                let weight = L::splat(token, weight);
                position = sum3(token, position, row.offsets, weight, first);
                if let Some(offsets) = row.normals {
                    normal = sum3(token, normal, offsets, weight, first);
                    changed = true;
                }
            }
            if changed {
                normal = to_unit_length(token, normal);
            }
            put3(&mut room.positions, position, first);
            put3(&mut room.normals, normal, first);
        }
    }
}

#[inline(always)]
fn sum3<L: Lanes>(
    token: L::Token,
    [x, y, z]: [L; 3],
    offsets: &Lanes3,
    weight: L,
    first: usize,
) -> [L; 3] {
    let [a, b, c] = L::load3(token, offsets, first);
    [
        x.add(a.mul(weight)),
        y.add(b.mul(weight)),
        z.add(c.mul(weight)),
    ]
}

#[inline(always)]
fn normalise<L: Lanes>(token: L::Token, normals: &mut Lanes3) {
    for first in (0..LANES).step_by(L::WIDTH) {
        let unit = to_unit_length(token, L::load3(token, normals, first));
        put3(normals, unit, first);
    }
}

#[inline(always)]
fn add<L: Lanes>(token: L::Token, sums: &mut Lanes3, offsets: &Lanes3, weight: f32) {
    let weight = L::splat(token, weight);
    for (sums, offsets) in sums.iter_mut().zip(offsets) {
        for first in (0..LANES).step_by(L::WIDTH) {
            let sum = L::load(token, sums, first).add(L::load(token, offsets, first).mul(weight));
            sum.put(sums, first);
        }
    }
}

#[inline(always)]
pub(super) fn put3<L: Lanes>(to: &mut Lanes3, xyz: [L; 3], first: usize) {
    for (to, lanes) in to.iter_mut().zip(xyz) {
        lanes.put(to, first);
    }
}
