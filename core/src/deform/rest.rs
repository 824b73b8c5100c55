//! A block's rest shape as plain numbers.
//!
//! Most blocks are read where they lie. Where morph targets add to them, they are first put
//! together in a little room on the stack, once a block, so that the kernel knows nothing of it.

use super::lanes::Lanes;
use super::morph::Morphs;
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
    /// Of any length above zero.
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
    /// Whether normals have unit length without a further thought.
    #[inline(always)]
    pub fn has_unit_normals(&self) -> bool {
        true
    }

    #[inline(always)]
    pub fn block<'r, L: Lanes>(
        &'r self,
        token: L::Token,
        block: usize,
        room: &'r mut Room,
    ) -> Rest<'r> {
        let positions = self.asset.positions.get(block).unwrap_or(&ORIGIN);
        let normals = self.asset.normals.get(block).unwrap_or(&ORIGIN);
        let Some(morphs) = &self.morphs else {
            return Rest { positions, normals };
        };
        room.positions = *positions;
        room.normals = *normals;
        L::add_morphs(token, morphs, block, room);
        Rest {
            positions: &room.positions,
            normals: &room.normals,
        }
    }
}
