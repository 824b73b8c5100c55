//! Coarser meshes for the same skeleton.
//!
//! A level is an asset inside the asset: the same format with the same skeleton and names, without
//! clips. Its view takes those of the whole, so that an avatar can change its level at any frame.

use super::{Asset, check};

/// Counts of coarser levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LevelDims {
    /// Levels besides the finest.
    pub count: usize,
    /// Bytes of them together.
    pub bytes: usize,
    /// Vertices that name one of the finest level: all of a coarser level's, else 0.
    pub source_count: usize,
}

/// The group's sections.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Levels<'a> {
    /// `[levels]`: offset and bytes in `data`, vertices, blocks.
    pub table: &'a [[u32; 4]],
    pub data: &'a [u8],
    /// Of a coarser level `[vertices]`: index in the finest level's source mesh.
    pub sources: &'a [u32],
}

impl<'a> Levels<'a> {
    pub fn bytes_of(&self, &[offset, length, ..]: &[u32; 4]) -> &'a [u8] {
        let end = offset.saturating_add(length) as usize;
        self.data.get(offset as usize..end).unwrap_or_default()
    }
}

impl<'a> Asset<'a> {
    /// Levels of detail, the finest included.
    #[must_use]
    pub fn level_count(&self) -> usize {
        1 + self.levels.table.len()
    }

    /// A level of detail as an asset of its own, with the clips of the whole; 0 is the finest.
    /// `None` for one that does not exist. O(sections)
    ///
    /// State and workspace fit every level; outputs are sized by the level's own
    /// [`dims`](Self::dims).
    #[must_use]
    pub fn level(&self, index: usize) -> Option<Self> {
        let Some(coarser) = index.checked_sub(1) else {
            return Some(*self);
        };
        let bytes = self.levels.bytes_of(self.levels.table.get(coarser)?);
        let mut level = check::views(bytes).ok()?;
        level.clips = self.clips;
        level.tracks = self.tracks;
        level.key_times = self.key_times;
        level.key_values = self.key_values;
        level.packed = self.packed;
        level.corrective = self.corrective;
        level.rest_bounds = self.rest_bounds;
        level.dims.clip_count = self.dims.clip_count;
        level.dims.track_count = self.dims.track_count;
        level.dims.max_clip_tracks = self.dims.max_clip_tracks;
        level.dims.max_track_keys = self.dims.max_track_keys;
        level.dims.key_time_count = self.dims.key_time_count;
        level.dims.key_value_count = self.dims.key_value_count;
        level.dims.packed = self.dims.packed;
        level.dims.correctives = self.dims.correctives;
        level.dims.bounds = self.dims.bounds;
        Some(level)
    }

    /// The finest level with at most so many blocks; the coarsest where all have more.
    #[must_use]
    pub fn level_within(&self, blocks: usize) -> usize {
        if self.dims.block_count <= blocks {
            return 0;
        }
        let mut coarser = self.levels.table.iter();
        let fits = coarser.position(|&[_, _, _, count]| count as usize <= blocks);
        fits.map_or(self.levels.table.len(), |index| index + 1)
    }

    /// Of a coarser level, the vertex in the finest level's source mesh that each vertex of the
    /// level's source mesh is; empty for the finest.
    #[must_use]
    pub fn level_sources(&self) -> &'a [u32] {
        self.levels.sources
    }
}
