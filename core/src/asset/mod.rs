//! Bytes in, typed views out: checked once, read in place.
//!
//! [`Asset::new_checked`] proves every length, index, weight sum and number of the format in
//! `SPEC.md`; after that no accessor can fail. Nothing is copied: the views borrow the bytes,
//! which may lie in flash or in a mapped file.

mod check;
mod checksum;
mod error;
mod header;
mod include;

pub use checksum::crc32;
pub use error::AssetError;
pub use header::{
    ALIGNMENT, Dims, HEADER_BYTES, LANES, LARGEST, LARGEST_WEIGHT, MAGIC, NO_PARENT,
    SECTION_ROW_BYTES, SectionKind, VERSION, WEIGHT_ONE,
};
pub use include::Aligned;

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
    joint_names: &'a [[u32; 2]],
    names: &'a [u8],
}

/// Vertex indices of all triangles, three each, in block order.
#[derive(Clone, Copy, Debug)]
pub enum Triangles<'a> {
    /// Meshes of at most 65,536 vertices.
    U16(&'a [u16]),
    /// Larger ones.
    U32(&'a [u32]),
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

/// A named range of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part<'a> {
    /// Name in the source mesh.
    pub name: &'a str,
    /// First triangle.
    pub first_triangle: usize,
    /// Number of triangles.
    pub triangle_count: usize,
}

/// A piece of motion.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    /// Name in the source.
    pub name: &'a str,
    /// Seconds from 0 to the last key.
    pub duration: f32,
    /// Seconds between samples where the source was sampled evenly, else 0.
    pub sample_period: f32,
    tracks: &'a [[u32; 4]],
    key_times: &'a [f32],
    key_values: &'a [f32],
}

/// Offsets that can be blended in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Morph<'a> {
    /// Name in the source mesh.
    pub name: &'a str,
    /// Weight when nothing animates it.
    pub rest_weight: f32,
}

/// Offsets of a block's vertices under one morph target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MorphRow<'a> {
    /// Which morph target.
    pub morph: usize,
    /// At weight one, metres.
    pub offsets: &'a Lanes3,
    /// Of the normals, where the asset has them.
    pub normals: Option<&'a Lanes3>,
}

/// What part of a joint a track moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Metres, three numbers.
    Translation,
    /// Unit quaternion, four numbers.
    Rotation,
    /// Factors, three numbers.
    Scale,
    /// Weight of a morph target, one number.
    MorphWeight,
}

/// How values between two keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier key holds.
    Step,
    /// Straight line; the shorter great arc for rotations.
    Linear,
    /// Hermite spline (glTF 2.0, appendix C); every key holds in-tangent, value, out-tangent.
    CubicSpline,
}

/// One animated channel of one joint, or the weight of a morph target.
#[derive(Clone, Copy, Debug)]
pub struct Track<'a> {
    /// The joint; the morph target where the channel is [`Channel::MorphWeight`].
    pub target: usize,
    /// What it moves.
    pub channel: Channel,
    /// Between keys.
    pub interpolation: Interpolation,
    /// `[keys]`, seconds, strictly ascending, never empty.
    pub times: &'a [f32],
    /// `[keys x numbers]`, or `[keys x 3 x numbers]` for splines.
    pub values: &'a [f32],
}

impl Channel {
    /// Numbers in a value.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            Self::Rotation => 4,
            Self::Translation | Self::Scale => 3,
            Self::MorphWeight => 1,
        }
    }

    /// The channel with this number in a file.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Translation),
            1 => Some(Self::Rotation),
            2 => Some(Self::Scale),
            3 => Some(Self::MorphWeight),
            _ => None,
        }
    }
}

impl Interpolation {
    /// Values stored for one key.
    #[must_use]
    pub const fn values_a_key(self) -> usize {
        match self {
            Self::CubicSpline => 3,
            Self::Step | Self::Linear => 1,
        }
    }

    /// The interpolation with this number in a file.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Step),
            1 => Some(Self::Linear),
            2 => Some(Self::CubicSpline),
            _ => None,
        }
    }
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

    /// Rest positions, metres. `[blocks]`; lanes beyond the last vertex repeat it.
    #[must_use]
    pub fn rest_positions(&self) -> &'a [Lanes3] {
        self.positions
    }

    /// Rest normals, unit length. `[blocks]`
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

    /// A morph target; `None` for one that does not exist.
    #[must_use]
    pub fn morph(&self, index: usize) -> Option<Morph<'a>> {
        let &[name, name_bytes, rest_weight, _] = self.morphs.get(index)?;
        Some(Morph {
            name: self.name(name, name_bytes),
            rest_weight: f32::from_bits(rest_weight),
        })
    }

    /// Morph targets that move a block's vertices, ascending.
    #[inline]
    pub fn morph_rows(&self, block: usize) -> impl Iterator<Item = MorphRow<'a>> + use<'a> {
        let starts = (
            self.morph_starts.get(block),
            self.morph_starts.get(block + 1),
        );
        let range = match starts {
            (Some(&first), Some(&end)) => first as usize..end as usize,
            _ => 0..0,
        };
        let ids = self.morph_ids.get(range.clone()).unwrap_or_default();
        let offsets = self.morph_offsets.get(range.clone()).unwrap_or_default();
        let normals = self.morph_normals.get(range).unwrap_or_default();
        let rows = ids.iter().zip(offsets).enumerate();
        rows.map(move |(row, (&morph, offsets))| MorphRow {
            morph: usize::from(morph),
            offsets,
            normals: normals.get(row),
        })
    }

    /// Vertex indices of all triangles.
    #[must_use]
    pub fn triangles(&self) -> Triangles<'a> {
        self.triangles
    }

    /// Named ranges of triangles, in order.
    pub fn parts(&self) -> impl Iterator<Item = Part<'a>> + use<'a> {
        let asset = *self;
        self.parts
            .iter()
            .map(move |&[offset, length, first, count]| Part {
                name: asset.name(offset, length),
                first_triangle: first as usize,
                triangle_count: count as usize,
            })
    }

    /// A clip; `None` for one that does not exist.
    #[must_use]
    pub fn clip(&self, index: usize) -> Option<Clip<'a>> {
        let &[name, name_bytes, first, count, duration, period, _, _] = self.clips.get(index)?;
        Some(Clip {
            name: self.name(name, name_bytes),
            duration: f32::from_bits(duration),
            sample_period: f32::from_bits(period),
            tracks: slice(self.tracks, first, count),
            key_times: self.key_times,
            key_values: self.key_values,
        })
    }

    fn name(&self, offset: u32, length: u32) -> &'a str {
        core::str::from_utf8(slice(self.names, offset, length)).unwrap_or_default()
    }
}

impl<'a> Clip<'a> {
    /// Times in seconds at which the source was sampled, from 0 to the last; where it was not
    /// sampled evenly, 30 a second.
    #[inline]
    pub fn sample_times(&self) -> impl ExactSizeIterator<Item = f32> + use<> {
        let period = if self.sample_period > 0.0 {
            self.sample_period
        } else {
            1.0 / 30.0
        };
        // A duration is seldom exactly so many periods.
        let steps = (self.duration / period + 0.01) as u32;
        (0..steps.saturating_add(1)).map(move |step| step as f32 * period)
    }

    /// Its tracks, sorted by joint.
    #[inline]
    pub fn tracks(&self) -> impl Iterator<Item = Track<'a>> + use<'a> {
        let (times, values) = (self.key_times, self.key_values);
        self.tracks
            .iter()
            .filter_map(move |row| decode_track(row, times, values))
    }
}

impl<'a> Triangles<'a> {
    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U16(indices) => indices.len() / 3,
            Self::U32(indices) => indices.len() / 3,
        }
    }

    /// Whether there is no triangle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All triangles, widened.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + use<'a> {
        let (short, long): (&'a [u16], &'a [u32]) = match *self {
            Self::U16(indices) => (indices, &[]),
            Self::U32(indices) => (&[], indices),
        };
        let short = short.as_chunks::<3>().0.iter().map(|t| t.map(u32::from));
        short.chain(long.as_chunks::<3>().0.iter().copied())
    }
}

/// The track that a row of the section describes; `None` where it points outside.
#[inline]
fn decode_track<'a>(row: &[u32; 4], times: &'a [f32], values: &'a [f32]) -> Option<Track<'a>> {
    let &[what, first_time, keys, first_value] = row;
    let channel = Channel::from_code((what >> 16) & 0xFF)?;
    let interpolation = Interpolation::from_code(what >> 24)?;
    let (first_time, keys, first_value) =
        (first_time as usize, keys as usize, first_value as usize);
    let width = channel.width() * interpolation.values_a_key();
    let numbers = keys.checked_mul(width)?;
    Some(Track {
        target: (what & 0xFFFF) as usize,
        channel,
        interpolation,
        times: times.get(first_time..first_time.checked_add(keys)?)?,
        values: values.get(first_value..first_value.checked_add(numbers)?)?,
    })
}

fn slice<T>(all: &[T], first: u32, count: u32) -> &[T] {
    let first = first as usize;
    all.get(first..first.saturating_add(count as usize))
        .unwrap_or_default()
}
