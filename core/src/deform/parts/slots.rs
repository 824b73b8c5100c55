//! Tables of blocks: the markers and the parts that move eight vertices at a time.

use super::error::{below, length, numbers, starts};
use super::{PartsError, PartsTable};
use crate::asset::{LANES, Lanes3, WEIGHT_ONE};
use crate::deform::lanes::Lanes;
use crate::deform::skin::Slots;

/// Largest coefficient of a marker; beyond it noise would be magnified to nonsense.
const LARGEST: f32 = 1e4;

/// Markers of blocks, each with its shares in eight vertices.
#[derive(Clone, Copy, Debug, Default)]
pub struct MarkerRows<'a, Shares> {
    /// `[blocks + 1]`: first slot of each block of eight vertices.
    pub starts: &'a [u32],
    /// `[slots]`: marker.
    pub markers: &'a [u16],
    /// `[slots]`: shares.
    pub shares: &'a [Shares],
}

/// Markers that move blocks. Few turn a normal, so tangents have slots of their own.
#[derive(Clone, Copy, Debug, Default)]
pub struct MarkerSlots<'a> {
    /// Shares in the positions of eight vertices.
    pub positions: MarkerRows<'a, [f32; LANES]>,
    /// How they change along the two tangents of `tangents`, a metre.
    pub tangents: MarkerRows<'a, [[f32; LANES]; 2]>,
}

impl<'a, Shares> MarkerRows<'a, Shares> {
    fn check(&self, blocks: usize, markers: usize) -> Result<(), PartsError> {
        let table = PartsTable::MarkerSlots;
        length(table, self.shares.len(), self.markers.len())?;
        starts(self.starts, blocks, self.markers.len())?;
        let of = self.markers.iter().map(|&marker| usize::from(marker));
        below(table, of, markers)
    }

    #[inline(always)]
    pub(super) fn entries(
        &self,
        block: usize,
    ) -> impl Iterator<Item = (u16, &'a Shares)> + use<'a, Shares> {
        let range = row(self.starts, block);
        let markers = self.markers.get(range.clone()).unwrap_or_default();
        let shares = self.shares.get(range).unwrap_or_default();
        markers.iter().copied().zip(shares)
    }
}

impl MarkerSlots<'_> {
    pub(super) fn check(&self, blocks: usize, markers: usize) -> Result<(), PartsError> {
        let table = PartsTable::MarkerSlots;
        self.positions.check(blocks, markers)?;
        self.tangents.check(blocks, markers)?;
        numbers(table, self.positions.shares.as_flattened(), LARGEST)?;
        let tangents = self.tangents.shares.as_flattened();
        numbers(table, tangents.as_flattened(), LARGEST)
    }

    /// Multiplications of all blocks.
    pub(super) fn multiply_adds(&self) -> usize {
        LANES * (3 * self.positions.markers.len() + 6 * self.tangents.markers.len())
    }

    /// Adds what the markers of a block do to its positions.
    #[inline(always)]
    pub(super) fn add_positions<L: Lanes>(
        &self,
        token: L::Token,
        handles: &[[f32; 3]],
        (block, first): (usize, usize),
        position: &mut [L; 3],
    ) {
        for (marker, share) in self.positions.entries(block) {
            let share = L::load(token, share, first);
            for (sum, value) in position.iter_mut().zip(handle(handles, marker)) {
                *sum = sum.add(L::splat(token, value).mul(share));
            }
        }
    }

    /// Adds what the markers of a block do to its tangents.
    #[inline(always)]
    pub(super) fn add_tangents<L: Lanes>(
        &self,
        token: L::Token,
        handles: &[[f32; 3]],
        (block, first): (usize, usize),
        tangents: &mut [[L; 3]; 2],
    ) {
        for (marker, shares) in self.tangents.entries(block) {
            let [x, y, z] = handle(handles, marker);
            let (x, y, z) = (L::splat(token, x), L::splat(token, y), L::splat(token, z));
            for ([a, b, c], share) in tangents.iter_mut().zip(shares) {
                let share = L::load(token, share, first);
                *a = a.add(x.mul(share));
                *b = b.add(y.mul(share));
                *c = c.add(z.mul(share));
            }
        }
    }

    /// [`Self::add_positions`] for all lanes without vector instructions: their sums just fit the
    /// registers of a Cortex-M, so a marker is fetched once.
    #[inline(always)]
    pub(super) fn scalar_positions(&self, handles: &[[f32; 3]], block: usize, sums: &mut Lanes3) {
        for (marker, shares) in self.positions.entries(block) {
            add_lanes(sums, handle(handles, marker), shares);
        }
    }

    /// Likewise both tangents of half the lanes.
    #[inline(always)]
    pub(super) fn scalar_tangents(
        &self,
        handles: &[[f32; 3]],
        (block, half): (usize, usize),
        sums: &mut [[[f32; LANES / 2]; 3]; 2],
    ) {
        for (marker, shares) in self.tangents.entries(block) {
            let handle = handle(handles, marker);
            for (sums, shares) in sums.iter_mut().zip(shares) {
                if let Some(shares) = shares.as_chunks().0.get(half) {
                    add_lanes(sums, handle, shares);
                }
            }
        }
    }
}

#[inline(always)]
fn handle(handles: &[[f32; 3]], marker: u16) -> [f32; 3] {
    handles
        .get(usize::from(marker))
        .copied()
        .unwrap_or_default()
}

#[inline(always)]
fn add_lanes<const N: usize>(sums: &mut [[f32; N]; 3], handle: [f32; 3], shares: &[f32; N]) {
    for (sums, value) in sums.iter_mut().zip(handle) {
        for (sum, share) in sums.iter_mut().zip(shares) {
            *sum += value * share;
        }
    }
}

/// Rest shape of blocks and the parts that move them.
#[derive(Clone, Copy, Debug, Default)]
pub struct PartBlocks<'a> {
    /// `[vertices]`: vertex of each lane, block after block, each once.
    pub order: &'a [u32],
    /// `[blocks]`: metres; lanes beyond the last vertex repeat it.
    pub positions: &'a [Lanes3],
    /// `[blocks]`: unit length.
    pub normals: &'a [Lanes3],
    /// `[blocks + 1]`: first slot of each block.
    pub starts: &'a [u32],
    /// `[slots]`: part; at least one a block.
    pub parts: &'a [u16],
    /// `[slots]`: weights of eight vertices; those of a vertex sum to
    /// [`WEIGHT_ONE`].
    pub weights: &'a [[u16; LANES]],
}

impl<'a> PartBlocks<'a> {
    /// Number of blocks of eight vertices.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.order.len().div_ceil(LANES)
    }

    pub(super) fn check(&self, part_count: usize) -> Result<(), PartsError> {
        let blocks = self.block_count();
        check_order(self.order)?;
        length(PartsTable::Rest, self.positions.len(), blocks)?;
        length(PartsTable::Rest, self.normals.len(), blocks)?;
        for rest in [self.positions, self.normals] {
            numbers(PartsTable::Rest, rest.as_flattened().as_flattened(), 1e6)?;
        }
        let table = PartsTable::PartSlots;
        length(table, self.weights.len(), self.parts.len())?;
        starts(self.starts, blocks, self.parts.len())?;
        let of = self.parts.iter().map(|&part| usize::from(part));
        below(table, of, part_count)?;
        for block in 0..blocks {
            let mut sums = [0_u32; LANES];
            for weights in self
                .weights
                .get(row(self.starts, block))
                .unwrap_or_default()
            {
                for (sum, &weight) in sums.iter_mut().zip(weights) {
                    *sum += u32::from(weight);
                }
            }
            if sums != [u32::from(WEIGHT_ONE); LANES] {
                return Err(PartsError::Number { table, at: block });
            }
        }
        Ok(())
    }

    /// Parts of a block and where its slots start.
    #[inline(always)]
    pub(super) fn slots(&self, block: usize) -> (Slots<'a>, usize) {
        let range = row(self.starts, block);
        let slots = Slots {
            binds: self.parts.get(range.clone()).unwrap_or_default(),
            weights: self.weights.get(range.clone()).unwrap_or_default(),
            centre: &ORIGIN,
        };
        (slots, range.start)
    }

    /// Rest positions of some lanes.
    #[inline(always)]
    pub(super) fn position<L: Lanes>(&self, token: L::Token, block: usize, first: usize) -> [L; 3] {
        L::load3(token, self.positions.get(block).unwrap_or(&ORIGIN), first)
    }

    /// Rest normals of some lanes.
    #[inline(always)]
    pub(super) fn normal<L: Lanes>(&self, token: L::Token, block: usize, first: usize) -> [L; 3] {
        L::load3(token, self.normals.get(block).unwrap_or(&ORIGIN), first)
    }
}

pub(super) static ORIGIN: Lanes3 = [[0.0; LANES]; 3];

/// The entries of a row.
#[inline(always)]
pub(crate) fn row(starts: &[u32], row: usize) -> core::ops::Range<usize> {
    match (starts.get(row), starts.get(row + 1)) {
        (Some(&first), Some(&end)) => first as usize..end as usize,
        _ => 0..0,
    }
}

/// Checks that vertices stand in range. O(vertices)
pub(super) fn check_order(order: &[u32]) -> Result<(), PartsError> {
    let vertices = order.iter().map(|&vertex| vertex as usize);
    below(PartsTable::Order, vertices, order.len())
}
