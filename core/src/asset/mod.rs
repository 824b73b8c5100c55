//! Bytes in, typed views out: checked once, read in place.
//!
//! [`Asset::new_checked`] proves every length, index, weight sum and number of the format in
//! `SPEC.md`; after that no accessor can fail. Nothing is copied: the views borrow the bytes,
//! which may lie in flash or in a mapped file.

mod bounds;
mod check;
mod checksum;
mod clips;
mod correctives;
mod error;
mod header;
mod include;
mod kind;
mod laplacian;
mod levels;
pub(crate) mod marker_skin;
mod markers;
mod mesh;
mod morphs;
mod packed;
mod sections;
mod shapes;

pub use bounds::BoundsDims;
pub(crate) use bounds::RestBounds;
pub use checksum::crc32;
pub use clips::{Channel, Clip, Interpolation, Track};
pub use correctives::CorrectiveDims;
pub use error::AssetError;
pub use header::{
    ALIGNMENT, Dims, HEADER_BYTES, LANES, LARGEST, LARGEST_WEIGHT, MAGIC, NO_PARENT,
    SECTION_ROW_BYTES, VERSION, WEIGHT_ONE,
};
pub use include::Aligned;
pub use kind::SectionKind;
pub use laplacian::{LaplacianDims, LaplacianSurface};
pub use levels::LevelDims;
pub(crate) use levels::Levels;
pub use marker_skin::{MarkerMode, MarkerSkin, MarkerSkinDims};
pub use markers::{
    LINK_NUMBERS, MARKER_NUMBERS, MAX_MARKERS, MAX_NEIGHBOURS, MAX_RATE, MAX_SEEDS, MarkerDims,
    MarkerError, MarkerTables, SEED_NUMBERS,
};
pub use mesh::{Part, Triangles};
pub use morphs::{Morph, MorphRow};
pub use packed::{PackedDims, PackedTrack, unpack_rotation};
pub(crate) use shapes::Shapes;
pub use shapes::{PackedBox, ShapeDims};

use crate::deform::parts::Corrective;

/// Eight lanes of x, then of y, then of z.
pub type Lanes3 = [[f32; LANES]; 3];

/// A checked asset that borrows its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Asset<'a> {
    pub(crate) dims: Dims,
    pub(crate) parents: &'a [u16],
    pub(crate) rest: &'a [[f32; 10]],
    pub(crate) bind_joints: &'a [u16],
    pub(crate) inverse_bind: &'a [[f32; 12]],
    pub(crate) bind_rotations: &'a [[f32; 4]],
    pub(crate) runs: &'a [[u32; 4]],
    pub(crate) slot_binds: &'a [u16],
    pub(crate) slot_weights: &'a [[u16; LANES]],
    pub(crate) positions: &'a [Lanes3],
    pub(crate) normals: &'a [Lanes3],
    pub(crate) centres: &'a [Lanes3],
    pub(crate) morphs: &'a [[u32; 4]],
    pub(crate) morph_starts: &'a [u32],
    pub(crate) morph_ids: &'a [u16],
    pub(crate) morph_offsets: &'a [Lanes3],
    pub(crate) morph_normals: &'a [Lanes3],
    pub(crate) order: &'a [u32],
    triangles: Triangles<'a>,
    parts: &'a [[u32; 4]],
    clips: &'a [[u32; 8]],
    tracks: &'a [[u32; 4]],
    key_times: &'a [f32],
    key_values: &'a [f32],
    pub(crate) packed: packed::Packed<'a>,
    joint_names: &'a [[u32; 2]],
    markers: MarkerTables<'a>,
    live_names: &'a [[u32; 2]],
    live_rate: &'a [[f32; 4]],
    names: &'a [u8],
    laplacian: laplacian::LaplacianView<'a>,
    pub(crate) shapes: Shapes<'a>,
    pub(crate) rest_bounds: RestBounds<'a>,
    levels: Levels<'a>,
    marker_skin: Option<MarkerSkin<'a>>,
    marker_names: &'a [[u32; 2]],
    corrective: Option<Corrective<'a>>,
}

/// Blocks with the same number of slots.
#[derive(Clone, Debug)]
pub(crate) struct Run<'a> {
    pub blocks: core::ops::Range<usize>,
    /// Of each block, at least 1.
    pub slots: usize,
    /// `[blocks x slots]`
    pub binds: &'a [u16],
    /// `[blocks x slots]`
    pub weights: &'a [[u16; LANES]],
}

impl<'a> Asset<'a> {
    /// Checks the whole of `bytes` and returns views into it.
    ///
    /// `bytes` starts at a multiple of [`ALIGNMENT`] ([`include_asset!`](crate::include_asset)
    /// sees to that). One pass for the checksum and one for the contents, no copy.
    ///
    /// # Errors
    /// The first fault found, with its place. Bytes that pass can be used in every other call.
    pub fn new_checked(bytes: &'a [u8]) -> Result<Self, AssetError> {
        check::check(bytes)
    }

    /// All counts.
    #[must_use]
    pub fn dims(&self) -> &Dims {
        &self.dims
    }

    /// Parent of a joint; `None` for a root or a joint that does not exist.
    #[must_use]
    pub fn parent(&self, joint: usize) -> Option<usize> {
        let parent = *self.parents.get(joint)?;
        (parent != NO_PARENT).then_some(usize::from(parent))
    }

    /// Name of a joint; empty for one that does not exist.
    #[must_use]
    pub fn joint_name(&self, joint: usize) -> &'a str {
        match self.joint_names.get(joint) {
            Some(&[offset, length]) => self.name(offset, length),
            None => "",
        }
    }

    /// Rest pose of a joint relative to its parent: rotation x y z w, translation, scale.
    #[must_use]
    pub fn rest(&self, joint: usize) -> Option<&'a [f32; 10]> {
        self.rest.get(joint)
    }

    /// Joint of a bind and the matrix from mesh space to that joint's space.
    #[must_use]
    pub fn bind(&self, bind: usize) -> Option<(usize, &'a [f32; 12])> {
        let joint = usize::from(*self.bind_joints.get(bind)?);
        Some((joint, self.inverse_bind.get(bind)?))
    }

    /// Index in the source mesh of each vertex, in block order. `[vertices]`
    #[must_use]
    pub fn source_order(&self) -> &'a [u32] {
        self.order
    }

    /// Rest positions, metres. `[blocks]`, or empty where they are packed
    /// ([`crate::deform::rest_shape`] reads both); lanes beyond the last vertex repeat it.
    #[must_use]
    pub fn rest_positions(&self) -> &'a [Lanes3] {
        self.positions
    }

    /// Rest normals, unit length. `[blocks]`, or empty where they are packed.
    #[must_use]
    pub fn rest_normals(&self) -> &'a [Lanes3] {
        self.normals
    }

    /// (bind, weights of the eight lanes) of a block's slots; none for a block that does not
    /// exist. The weights of a lane sum to [`WEIGHT_ONE`]. O(runs)
    #[inline]
    pub fn slots(
        &self,
        block: usize,
    ) -> impl ExactSizeIterator<Item = (u16, &'a [u16; LANES])> + Clone + use<'a> {
        let run = self.runs().find(|run| run.blocks.contains(&block));
        let (binds, weights) = match run {
            Some(run) => {
                let skipped = (block - run.blocks.start) * run.slots;
                let range = skipped..skipped + run.slots;
                (run.binds.get(range.clone()), run.weights.get(range))
            }
            None => (None, None),
        };
        let binds = binds.unwrap_or_default().iter().copied();
        binds.zip(weights.unwrap_or_default())
    }

    /// Stretches of blocks with the same number of slots, in order.
    #[inline]
    pub(crate) fn runs(&self) -> impl Iterator<Item = Run<'a>> + use<'a> {
        let (binds, weights) = (self.slot_binds, self.slot_weights);
        self.runs
            .iter()
            .map(move |&[block, blocks, slots, first_slot]| {
                let count = blocks.saturating_mul(slots);
                Run {
                    blocks: block as usize..block.saturating_add(blocks) as usize,
                    slots: slots as usize,
                    binds: slice(binds, first_slot, count),
                    weights: slice(weights, first_slot, count),
                }
            })
    }

    /// Rotation x y z w of a bind's inverse bind matrix, its stretch left out.
    #[must_use]
    pub fn bind_rotation(&self, bind: usize) -> Option<&'a [f32; 4]> {
        self.bind_rotations.get(bind)
    }

    /// Centres of rotation of the blocks with two or more slots, in order; empty where the asset
    /// was baked without.
    #[must_use]
    pub fn centres(&self) -> &'a [Lanes3] {
        self.centres
    }

    /// Text at a place in the names' section.
    fn name(&self, offset: u32, length: u32) -> &'a str {
        core::str::from_utf8(slice(self.names, offset, length)).unwrap_or_default()
    }
}

fn slice<T>(all: &[T], first: u32, count: u32) -> &[T] {
    let first = first as usize;
    all.get(first..first.saturating_add(count as usize))
        .unwrap_or_default()
}
