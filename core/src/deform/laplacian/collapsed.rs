//! The solve as a stream: every vertex is a fixed sum over a few handles.
//!
//! With the marker rotations blended linearly, equation 2 becomes `v = sum_k (R_k b_k + n_k p_k)`
//! with `b` and `n` known beforehand. Handles are the markers and, between them, *virtual*
//! handles: points of the surface whose rotation is the harmonic blend of the markers'
//! quaternions and whose position is such a sum itself.

use core::borrow::BorrowMut;
use core::ops::Range;

use super::super::lanes::Lanes;
use super::super::output::{Output, SizeError};
use super::super::skin::to_unit_length;
#[cfg(feature = "simd")]
use super::super::store::{Packed, Scattered};
use super::super::store::{Store, Strided};
use super::turns::{MarkerPose, TurnReport, TurnState, Turns, frame, marker_frame};
use super::{LaplacianError, collapsed_check};
use crate::Level;
use crate::asset::{LANES, Lanes3};
use crate::math::{Affine12, IDENTITY, Quat4};

/// Tables of a collapsed deformer.
#[derive(Clone, Copy, Debug)]
pub struct CollapsedParts<'a> {
    /// `[markers]`: rest position, metres.
    pub marker_rest: &'a [[f32; 3]],
    /// Pairs of markers that are neighbours: a spanning tree, parents first.
    pub marker_edges: &'a [[u16; 2]],
    /// `[virtual handles + 1]`: first entry of each in the three tables that follow.
    pub virtual_starts: &'a [u32],
    /// Markers that move a virtual handle.
    pub virtual_markers: &'a [u16],
    /// Their shares in its rotation.
    pub virtual_turns: &'a [f32],
    /// Their `b` (three numbers) and `n` in its position.
    pub virtual_coefficients: &'a [[f32; 4]],
    /// `[vertices]`: vertex of each lane, block after block, each once.
    pub order: &'a [u32],
    /// `[blocks + 1]`: first slot of each block of eight vertices.
    pub block_starts: &'a [u32],
    /// `[slots]`: handle, markers first, then virtual handles.
    pub slot_handles: &'a [u16],
    /// `[slots]`: `b` (three numbers) and `n` of eight vertices.
    pub slot_coefficients: &'a [[[f32; LANES]; 4]],
    /// `[blocks]`, or empty where no normals are wanted: at rest, unit length.
    pub rest_normals: &'a [Lanes3],
}

/// A checked collapsed deformer that borrows its tables.
#[derive(Clone, Copy, Debug)]
pub struct Collapsed<'a> {
    parts: CollapsedParts<'a>,
}

impl<'a> Collapsed<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(parts: CollapsedParts<'a>) -> Result<Self, LaplacianError> {
        collapsed_check::check(&parts)?;
        Ok(Self { parts })
    }

    /// Tables that were checked before.
    pub(crate) const fn proved(parts: CollapsedParts<'a>) -> Self {
        Self { parts }
    }

    /// The tables.
    #[must_use]
    pub fn parts(&self) -> &CollapsedParts<'a> {
        &self.parts
    }

    /// Number of markers.
    #[must_use]
    pub fn marker_count(&self) -> usize {
        self.parts.marker_rest.len()
    }

    /// Number of virtual handles: rows of the [`TurnState`].
    #[must_use]
    pub fn virtual_count(&self) -> usize {
        self.parts.virtual_starts.len().saturating_sub(1)
    }

    /// Markers and virtual handles: matrices that [`Self::handles`] writes.
    #[must_use]
    pub fn handle_count(&self) -> usize {
        self.marker_count() + self.virtual_count()
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.parts.order.len()
    }

    /// Number of blocks of eight vertices.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.parts.block_starts.len().saturating_sub(1)
    }

    /// Multiplications of a frame: handles, then all blocks; an upper bound.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        let normals = usize::from(!self.parts.rest_normals.is_empty());
        let slots = self.parts.slot_handles.len();
        16 * self.parts.virtual_markers.len()
            + 90 * self.handle_count()
            + slots * LANES * (12 + 9 * normals)
            + normals * self.block_count() * LANES * 30
    }

    /// First half of a frame: the matrix of every handle.
    ///
    /// `poses`: `[markers]`; missing ones are held. `handles`: `[handles]`, old contents do not
    /// matter. `state`: [`super::turn_state_len`] of markers and virtual handles.
    /// O(markers of virtual handles)
    ///
    /// # Errors
    /// [`SizeError`] where the state or `handles` is too small.
    pub fn handles<B: BorrowMut<[f32]>>(
        &self,
        poses: &[MarkerPose],
        state: &mut TurnState<B>,
        handles: &mut [Affine12],
    ) -> Result<TurnReport, SizeError> {
        self.handles_of(|marker| poses.get(marker).copied(), state, handles)
    }

    /// As [`Self::handles`], with the pose of a marker wherever it comes from.
    pub(crate) fn handles_of<B: BorrowMut<[f32]>>(
        &self,
        poses: impl Fn(usize) -> Option<MarkerPose>,
        state: &mut TurnState<B>,
        handles: &mut [Affine12],
    ) -> Result<TurnReport, SizeError> {
        let markers = self.marker_count();
        let found = handles.len();
        let needed = self.handle_count();
        let short = SizeError::TooSmall {
            buffer: "handles",
            needed,
            found,
        };
        let handles = handles.get_mut(..needed).ok_or(short)?;
        let (real, rest) = handles.split_at_mut_checked(markers).ok_or(short)?;
        let mut turns = state.parts(markers, self.virtual_count())?;
        let at_rest = |marker: usize| self.parts.marker_rest.get(marker).copied();
        let mut report = turns.follow(
            poses,
            |marker| at_rest(marker).unwrap_or_default(),
            self.parts.marker_edges,
        );
        for (handle, held) in real.iter_mut().zip(&*turns.markers) {
            *handle = marker_frame(held);
        }
        for (row, handle) in rest.iter_mut().enumerate() {
            let mut position = [0.0; 3];
            for (marker, _, coefficients) in self.virtual_row(row) {
                let matrix = real.get(marker).unwrap_or(&IDENTITY);
                let [b, c, d, n] = *coefficients;
                for (sum, &[x, y, z, t]) in position.iter_mut().zip(matrix.as_chunks::<4>().0) {
                    *sum += x * b + y * c + z * d + t * n;
                }
            }
            *handle = frame(self.virtual_rotation(&turns, row), position);
        }
        if turns.is_far(self.parts.marker_edges) {
            turns.rebase(|turns, row| self.virtual_rotation(turns, row));
            report.rebased = true;
        }
        Ok(report)
    }

    fn virtual_rotation(&self, turns: &Turns<'_>, row: usize) -> Quat4 {
        let mut blend: Quat4 = [0.0; 4];
        for (marker, share, _) in self.virtual_row(row) {
            for (sum, x) in blend.iter_mut().zip(turns.since_base(marker)) {
                *sum += share * x;
            }
        }
        turns.row(row, blend)
    }

    fn virtual_row(
        &self,
        row: usize,
    ) -> impl Iterator<Item = (usize, f32, &'a [f32; 4])> + use<'a> {
        let starts = self.parts.virtual_starts;
        let range = match (starts.get(row), starts.get(row + 1)) {
            (Some(&first), Some(&end)) => first as usize..end as usize,
            _ => 0..0,
        };
        let markers = self.parts.virtual_markers.get(range.clone());
        let turns = self.parts.virtual_turns.get(range.clone());
        let coefficients = self.parts.virtual_coefficients.get(range);
        markers
            .unwrap_or_default()
            .iter()
            .zip(turns.unwrap_or_default())
            .zip(coefficients.unwrap_or_default())
            .map(|((&marker, &turn), coefficients)| (usize::from(marker), turn, coefficients))
    }

    /// Second half of a frame: vertices of a range of blocks, which is cut to those that exist.
    /// Ranges may go to different threads with outputs of their own.
    ///
    /// `handles`: from [`Self::handles`]. The bits do not depend on `level`. O(slots)
    pub fn blocks(
        &self,
        handles: &[Affine12],
        blocks: Range<usize>,
        level: Level,
        output: &mut Output<'_>,
    ) {
        let end = blocks.end.min(self.block_count());
        let blocks = blocks.start.min(end)..end;
        match level {
            Level::Scalar => self.scalar(handles, blocks, output),
            #[cfg(feature = "simd")]
            Level::Simd(level) => {
                // Vector kernels write whole blocks; the last one may be short.
                let middle = (self.vertex_count() / LANES).clamp(blocks.start, blocks.end);
                let (first, last) = (blocks.start..middle, middle..blocks.end);
                fearless_simd::dispatch!(level, simd => self.by_width(simd, handles, first, output));
                self.scalar(handles, last, output);
            }
        }
    }

    fn scalar(&self, handles: &[Affine12], blocks: Range<usize>, output: &mut Output<'_>) {
        let mut store = Strided::new(self.parts.order, output);
        self.blocks_by::<[f32; 2], _>((), handles, blocks, &mut store);
    }

    #[cfg(feature = "simd")]
    #[inline(always)]
    fn by_width<S: fearless_simd::Simd>(
        &self,
        simd: S,
        handles: &[Affine12],
        blocks: Range<usize>,
        output: &mut Output<'_>,
    ) {
        use fearless_simd::SimdBase;
        if S::f32s::LEN >= LANES {
            self.by_layout::<fearless_simd::f32x8<S>>(simd, handles, blocks, output);
        } else {
            self.by_layout::<fearless_simd::f32x4<S>>(simd, handles, blocks, output);
        }
    }

    #[cfg(feature = "simd")]
    #[inline(always)]
    fn by_layout<L: Lanes>(
        &self,
        token: L::Token,
        handles: &[Affine12],
        blocks: Range<usize>,
        output: &mut Output<'_>,
    ) {
        let order = self.parts.order;
        if let Some(mut store) = Packed::new(output) {
            self.blocks_by::<L, _>(token, handles, blocks, &mut store);
        } else if let Some(mut store) = Scattered::new(order, output) {
            self.blocks_by::<L, _>(token, handles, blocks, &mut store);
        } else {
            self.blocks_by::<L, _>(token, handles, blocks, &mut Strided::new(order, output));
        }
    }

    #[inline(always)]
    fn blocks_by<L: Lanes, S: Store>(
        &self,
        token: L::Token,
        handles: &[Affine12],
        blocks: Range<usize>,
        store: &mut S,
    ) {
        let wants_normals = store.wants_normals() && !self.parts.rest_normals.is_empty();
        for block in blocks {
            for first in (0..LANES).step_by(L::WIDTH) {
                let sums = self.positions::<L>(token, handles, block, first);
                store.positions(block, first, sums);
                if wants_normals {
                    let sums = self.normals::<L>(token, handles, block, first);
                    store.normals(block, first, to_unit_length(token, sums));
                }
            }
        }
    }

    #[inline(always)]
    fn slots(&self, block: usize) -> impl Iterator<Item = (u16, &'a [[f32; LANES]; 4])> + use<'a> {
        let starts = self.parts.block_starts;
        let range = match (starts.get(block), starts.get(block + 1)) {
            (Some(&first), Some(&end)) => first as usize..end as usize,
            _ => 0..0,
        };
        let handles = self.parts.slot_handles.get(range.clone());
        let coefficients = self.parts.slot_coefficients.get(range);
        let handles = handles.unwrap_or_default().iter().copied();
        handles.zip(coefficients.unwrap_or_default())
    }

    /// `sum_k (R_k b_k + n_k p_k)` of each lane.
    #[inline(always)]
    fn positions<L: Lanes>(
        &self,
        token: L::Token,
        handles: &[Affine12],
        block: usize,
        first: usize,
    ) -> [L; 3] {
        let mut sums = [L::splat(token, 0.0); 3];
        for (handle, coefficients) in self.slots(block) {
            let matrix = handles.get(usize::from(handle)).unwrap_or(&IDENTITY);
            let [b, c, d, n] = coefficients;
            let [b, c, d, n] = [
                L::load(token, b, first),
                L::load(token, c, first),
                L::load(token, d, first),
                L::load(token, n, first),
            ];
            for (sum, &[x, y, z, t]) in sums.iter_mut().zip(matrix.as_chunks::<4>().0) {
                *sum = sum
                    .add(L::splat(token, x).mul(b))
                    .add(L::splat(token, y).mul(c))
                    .add(L::splat(token, z).mul(d))
                    .add(L::splat(token, t).mul(n));
            }
        }
        sums
    }

    /// Rest normals turned by `sum_k n_k R_k`, not of unit length.
    #[inline(always)]
    fn normals<L: Lanes>(
        &self,
        token: L::Token,
        handles: &[Affine12],
        block: usize,
        first: usize,
    ) -> [L; 3] {
        let rest = self.parts.rest_normals.get(block);
        let rest = rest.copied().unwrap_or_default();
        let [nx, ny, nz] = [
            L::load(token, &rest[0], first),
            L::load(token, &rest[1], first),
            L::load(token, &rest[2], first),
        ];
        let mut sums = [L::splat(token, 0.0); 3];
        for (handle, [_, _, _, share]) in self.slots(block) {
            let matrix = handles.get(usize::from(handle)).unwrap_or(&IDENTITY);
            let share = L::load(token, share, first);
            let (nx, ny, nz) = (nx.mul(share), ny.mul(share), nz.mul(share));
            for (sum, &[x, y, z, _]) in sums.iter_mut().zip(matrix.as_chunks::<4>().0) {
                *sum = sum
                    .add(L::splat(token, x).mul(nx))
                    .add(L::splat(token, y).mul(ny))
                    .add(L::splat(token, z).mul(nz));
            }
        }
        sums
    }
}
