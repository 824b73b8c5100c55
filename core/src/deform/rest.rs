//! A block's rest shape as plain numbers.
//!
//! Most blocks are read where they lie. Packed ones are unpacked, and what morph targets move is
//! put together, in a little room on the stack, once a block, so that the kernel knows nothing of
//! it.

use super::lanes::Lanes;
use super::morph::{Morphs, put3};
use super::octahedral;
use super::skin::to_unit_length;
use crate::asset::{Asset, LANES, Lanes3};

/// Where blocks come from.
#[derive(Clone, Copy)]
pub(super) struct RestShape<'j, 'a> {
    pub asset: &'j Asset<'a>,
    /// `None` where nothing is added to the rest shape.
    pub morphs: Option<Morphs<'j, 'a>>,
}

/// Numbers of one block.
pub(super) struct Rest<'r> {
    pub positions: &'r Lanes3,
    /// Unit length, or longer where [`RestShape::has_unit_normals`] says no.
    pub normals: &'r Lanes3,
}

/// Where a block is put together; old contents do not matter.
pub(super) struct Room {
    pub positions: Lanes3,
    pub normals: Lanes3,
}

pub(super) const ORIGIN: Lanes3 = [[0.0; LANES]; 3];

impl Room {
    pub fn new() -> Self {
        Self {
            positions: ORIGIN,
            normals: ORIGIN,
        }
    }
}

impl RestShape<'_, '_> {
    fn is_packed(&self) -> bool {
        !self.asset.shapes.positions.is_empty()
    }

    /// Whether normals have unit length without a further thought.
    #[inline(always)]
    pub fn has_unit_normals(&self) -> bool {
        !self.is_packed()
    }

    #[inline(always)]
    pub fn block<'r, L: Lanes>(
        &'r self,
        token: L::Token,
        block: usize,
        room: &'r mut Room,
    ) -> Rest<'r> {
        let moved = self.morphs.as_ref().is_some_and(|m| m.move_block(block));
        if !moved && !self.is_packed() {
            return Rest {
                positions: self.asset.positions.get(block).unwrap_or(&ORIGIN),
                normals: self.asset.normals.get(block).unwrap_or(&ORIGIN),
            };
        }
        L::put_together(token, self, block, room);
        Rest {
            positions: &room.positions,
            normals: &room.normals,
        }
    }

    /// Unpacks, then adds morph targets.
    #[inline(always)]
    pub fn put_together<L: Lanes>(&self, token: L::Token, block: usize, room: &mut Room) {
        if self.is_packed() {
            self.unpack::<L>(token, block, room);
        } else {
            let positions = self.asset.positions.get(block).unwrap_or(&ORIGIN);
            let normals = self.asset.normals.get(block).unwrap_or(&ORIGIN);
            if let Some(morphs) = self.morphs.as_ref().filter(|_| L::WIDTH >= 4) {
                morphs.put_sum::<L>(token, block, (positions, normals), room);
                return;
            }
            (room.positions, room.normals) = (*positions, *normals);
        }
        if let Some(morphs) = &self.morphs {
            morphs.add_to::<L>(token, block, room, self.has_unit_normals());
        }
    }

    /// Normals are 32,767 long, more or less.
    #[inline(always)]
    fn unpack<L: Lanes>(&self, token: L::Token, block: usize, room: &mut Room) {
        let packed = &self.asset.shapes;
        let place = packed.packed_box(block);
        if let Some(axes) = packed.positions.get(block) {
            let place = place.origin.into_iter().zip(place.step);
            for (to, (from, (origin, step))) in
                room.positions.iter_mut().zip(axes.iter().zip(place))
            {
                let (origin, step) = (L::splat(token, origin), L::splat(token, step));
                for first in (0..LANES).step_by(L::WIDTH) {
                    let number = L::load_unsigned(token, from, first);
                    origin.add(number.mul(step)).put(to, first);
                }
            }
        }
        if let Some(from) = packed.normals.get(block) {
            for first in (0..LANES).step_by(L::WIDTH) {
                let normals = octahedral::unpack::<L>(token, from, first);
                put3(&mut room.normals, normals, first);
            }
        }
    }

    /// Tangents at rest and the bits of those with negative handedness; `None` where the asset has
    /// none.
    #[inline(always)]
    pub fn tangents<L: Lanes>(
        &self,
        token: L::Token,
        block: usize,
        first: usize,
    ) -> Option<([L; 3], u8)> {
        let packed = &self.asset.shapes;
        let from = packed.tangents.get(block)?;
        let signs = *packed.tangent_signs.get(block)?;
        Some((octahedral::unpack::<L>(token, from, first), signs))
    }
}

/// Rest positions, metres, and unit normals of a block, packed or not; zero for a block that does
/// not exist. Lanes beyond the last vertex repeat it.
#[must_use]
pub fn rest_shape(asset: &Asset<'_>, block: usize) -> (Lanes3, Lanes3) {
    let shape = RestShape {
        asset,
        morphs: None,
    };
    let mut room = Room::new();
    shape.put_together::<f32>((), block, &mut room);
    if !shape.has_unit_normals() {
        for lane in 0..LANES {
            let unit = to_unit_length((), f32::load3((), &room.normals, lane));
            put3(&mut room.normals, unit, lane);
        }
    }
    (room.positions, room.normals)
}

/// Rest tangents of a block, unit length: x, y, z, then 1 or -1; `None` where the asset has none.
#[must_use]
pub fn rest_tangents(asset: &Asset<'_>, block: usize) -> Option<[[f32; LANES]; 4]> {
    let shape = RestShape {
        asset,
        morphs: None,
    };
    let mut tangents = [[0.0; LANES]; 4];
    for lane in 0..LANES {
        let (tangent, signs) = shape.tangents::<f32>((), block, lane)?;
        let [x, y, z] = to_unit_length((), tangent);
        let handedness = if signs >> lane & 1 == 0 { 1.0 } else { -1.0 };
        for (to, number) in tangents.iter_mut().zip([x, y, z, handedness]) {
            number.put(to, lane);
        }
    }
    Some(tangents)
}
