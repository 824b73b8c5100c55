//! Where vertices go: the caller's buffers, in the caller's layout.

use core::fmt;
use core::ops::Range;

use crate::asset::{Dims, LANES};

/// Which vertex goes where in the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VertexOrder {
    /// As in the source mesh.
    #[default]
    Source,
    /// As the blocks stand in the asset; the asset's triangles use this order.
    Block,
}

/// Where one attribute of a vertex lies in a buffer, in `f32`s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Attribute {
    /// From a vertex to the next.
    pub stride: usize,
    /// From the start of a vertex to the attribute.
    pub offset: usize,
}

impl Attribute {
    /// Three numbers a vertex, nothing between.
    pub const PACKED: Self = Self {
        stride: 3,
        offset: 0,
    };

    /// Four numbers a vertex, nothing between: tangents.
    pub const PACKED_FOUR: Self = Self {
        stride: 4,
        offset: 0,
    };

    /// Numbers that a buffer for `vertex_count` vertices must have; `None` where that exceeds the
    /// address space, or where vertices would overlap.
    #[must_use]
    pub const fn len(self, vertex_count: usize) -> Option<usize> {
        self.len_of(3, vertex_count)
    }

    /// The same for so many numbers a vertex.
    const fn len_of(self, width: usize, vertex_count: usize) -> Option<usize> {
        if self.stride < width || self.offset > self.stride - width {
            return None;
        }
        self.stride.checked_mul(vertex_count)
    }

    /// The same where the buffer starts with another vertex than the first. Vertices before it then
    /// lie beyond the end of every buffer.
    const fn from(self, vertex: usize) -> Self {
        let offset = self.offset.wrapping_sub(vertex.wrapping_mul(self.stride));
        Self { offset, ..self }
    }

    /// Whether two attributes of these widths share a number of one vertex, or disagree on where
    /// the next one begins.
    const fn collides(self, width: usize, other: Self, other_width: usize) -> bool {
        let apart =
            self.offset + width <= other.offset || other.offset + other_width <= self.offset;
        self.stride != other.stride || !apart
    }
}

/// A buffer that does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SizeError {
    /// Too few numbers in the named buffer.
    TooSmall {
        /// Which buffer.
        buffer: &'static str,
        /// Numbers needed.
        needed: usize,
        /// Numbers given.
        found: usize,
    },
    /// The attribute does not fit into its stride, or overlaps another.
    Layout {
        /// Which attribute.
        attribute: &'static str,
    },
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooSmall {
                buffer,
                needed,
                found,
            } => write!(
                f,
                "the {buffer} buffer has {found} numbers and needs {needed}; size it by the asset's Dims"
            ),
            Self::Layout { attribute } => write!(
                f,
                "the {attribute} need their three numbers (tangents: four) inside the stride, which nothing else uses"
            ),
        }
    }
}

impl core::error::Error for SizeError {}

/// Caller-owned vertex buffers. Contents between frames belong to the caller: a frame whose
/// budget runs out leaves the vertices it did not reach as they were.
#[derive(Debug)]
pub struct Output<'o> {
    positions: Attribute,
    /// Where, and whether in the second buffer.
    normals: Option<(Attribute, bool)>,
    /// Where, and whether in the third buffer.
    tangents: Option<(Attribute, bool)>,
    buffers: [&'o mut [f32]; 3],
    pub(super) order: VertexOrder,
    vertex_count: usize,
    /// The vertices that the buffers have room for: all, or in block order some.
    held: Range<usize>,
}

impl<'o> Output<'o> {
    /// Positions, and normals where given, in buffers of their own, three numbers a vertex.
    ///
    /// # Errors
    /// [`SizeError::TooSmall`] below `3 * vertex_count` numbers.
    pub fn separate(
        dims: &Dims,
        positions: &'o mut [f32],
        normals: Option<&'o mut [f32]>,
    ) -> Result<Self, SizeError> {
        fits(dims, Attribute::PACKED, "positions", positions.len())?;
        let has_normals = normals.is_some();
        let normals = normals.unwrap_or_default();
        if has_normals {
            fits(dims, Attribute::PACKED, "normals", normals.len())?;
        }
        Ok(Self {
            positions: Attribute::PACKED,
            normals: has_normals.then_some((Attribute::PACKED, true)),
            tangents: None,
            buffers: [positions, normals, &mut []],
            order: VertexOrder::Source,
            vertex_count: dims.vertex_count,
            held: 0..dims.vertex_count,
        })
    }

    /// Some blocks alone, in block order, three numbers a vertex: so threads, or a core and a DMA
    /// channel, share one buffer, each with a piece of its own. What a frame writes to other blocks
    /// is dropped.
    ///
    /// `positions`, `normals`: `[vertices of the blocks]`; blocks that do not exist are left out.
    ///
    /// # Errors
    /// [`SizeError::TooSmall`] below three numbers a vertex.
    pub fn of_blocks(
        dims: &Dims,
        blocks: Range<usize>,
        positions: &'o mut [f32],
        normals: Option<&'o mut [f32]>,
    ) -> Result<Self, SizeError> {
        let vertex = |block: usize| block.saturating_mul(LANES).min(dims.vertex_count);
        let (first, end) = (vertex(blocks.start), vertex(blocks.end));
        let held = first..end.max(first);
        let piece = Dims {
            vertex_count: held.len(),
            ..*dims
        };
        let output = Self::separate(&piece, positions, normals)?;
        Ok(Self {
            order: VertexOrder::Block,
            vertex_count: dims.vertex_count,
            held,
            ..output
        })
    }

    /// Positions, and normals where given, in one interleaved vertex buffer.
    ///
    /// # Errors
    /// [`SizeError`] where the buffer is too short, the strides differ, or the two overlap.
    pub fn interleaved(
        dims: &Dims,
        vertices: &'o mut [f32],
        positions: Attribute,
        normals: Option<Attribute>,
    ) -> Result<Self, SizeError> {
        fits(dims, positions, "positions", vertices.len())?;
        if let Some(normals) = normals {
            fits(dims, normals, "normals", vertices.len())?;
            if normals.collides(3, positions, 3) {
                return Err(SizeError::Layout {
                    attribute: "normals",
                });
            }
        }
        Ok(Self {
            positions,
            normals: normals.map(|normals| (normals, false)),
            tangents: None,
            buffers: [vertices, &mut [], &mut []],
            order: VertexOrder::Source,
            vertex_count: dims.vertex_count,
            held: 0..dims.vertex_count,
        })
    }

    /// The same with tangents in a buffer of their own: direction, then handedness, four numbers a
    /// vertex. Where the asset has no tangents the buffer is not touched.
    ///
    /// # Errors
    /// [`SizeError::TooSmall`] below `4 * vertex_count` numbers.
    pub fn with_tangents(mut self, tangents: &'o mut [f32]) -> Result<Self, SizeError> {
        self.tangents = Some((Attribute::PACKED_FOUR, true));
        fits_width(
            self.held.len(),
            Attribute::PACKED_FOUR,
            4,
            "tangents",
            tangents.len(),
        )?;
        let [_, _, third] = &mut self.buffers;
        *third = tangents;
        Ok(self)
    }

    /// The same with tangents among positions: direction, then handedness, four numbers.
    ///
    /// # Errors
    /// [`SizeError`] where the buffer of positions is too short, the strides differ, or tangents
    /// overlap what else is in it.
    pub fn with_interleaved_tangents(mut self, tangents: Attribute) -> Result<Self, SizeError> {
        let [first, ..] = &self.buffers;
        fits_width(self.held.len(), tangents, 4, "tangents", first.len())?;
        let collides = tangents.collides(4, self.positions, 3)
            || self
                .normals
                .is_some_and(|(normals, apart)| !apart && tangents.collides(4, normals, 3));
        if collides {
            return Err(SizeError::Layout {
                attribute: "tangents",
            });
        }
        self.tangents = Some((tangents, false));
        Ok(self)
    }

    /// The same with another vertex order; an output [of some blocks](Self::of_blocks) keeps its own.
    #[must_use]
    pub fn in_order(mut self, order: VertexOrder) -> Self {
        if self.is_whole() {
            self.order = order;
        }
        self
    }

    /// Whether there is room for every vertex.
    fn is_whole(&self) -> bool {
        self.held.len() == self.vertex_count
    }

    /// The vertices that there is room for.
    #[inline(always)]
    pub(super) fn held(&self) -> Range<usize> {
        self.held.clone()
    }

    /// The buffers alone, so that a kernel can hold them in registers.
    #[inline(always)]
    pub(super) fn writer(&mut self) -> Writer<'_> {
        let [first, second, third] = &mut self.buffers;
        let start = self.held.start;
        let from_start = |(attribute, apart): (Attribute, bool)| (attribute.from(start), apart);
        Writer {
            positions: self.positions.from(start),
            normals: self.normals.map(from_start),
            tangents: self.tangents.map(from_start),
            first,
            second,
            third,
        }
    }

    /// Positions and normals, where each has a buffer without gaps and no tangents are wanted.
    pub(super) fn separated(&mut self) -> Option<(&mut [f32], Option<&mut [f32]>)> {
        if self.tangents.is_some() {
            return None;
        }
        let [first, second, _] = &mut self.buffers;
        match (self.positions, self.normals) {
            (Attribute::PACKED, None) => Some((first, None)),
            (Attribute::PACKED, Some((Attribute::PACKED, true))) => Some((first, Some(second))),
            _ => None,
        }
    }

    /// Vertices that it was made for.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Whether it was made for an asset of this size.
    #[must_use]
    pub fn fits(&self, dims: &Dims) -> bool {
        self.vertex_count == dims.vertex_count
    }
}

/// Where a kernel puts vertices.
pub(super) struct Writer<'w> {
    positions: Attribute,
    /// Where, and whether in the second buffer.
    normals: Option<(Attribute, bool)>,
    /// Where, and whether in the third buffer.
    tangents: Option<(Attribute, bool)>,
    first: &'w mut [f32],
    second: &'w mut [f32],
    third: &'w mut [f32],
}

impl Writer<'_> {
    #[inline(always)]
    pub(super) fn wants_normals(&self) -> bool {
        self.normals.is_some()
    }

    #[inline(always)]
    pub(super) fn wants_tangents(&self) -> bool {
        self.tangents.is_some()
    }

    #[inline(always)]
    pub(super) fn put_tangent(&mut self, vertex: usize, value: [f32; 4]) {
        if let Some((attribute, apart)) = self.tangents {
            let buffer = if apart {
                &mut *self.third
            } else {
                &mut *self.first
            };
            put(buffer, attribute, vertex, value);
        }
    }

    #[inline(always)]
    pub(super) fn put_position(&mut self, vertex: usize, value: [f32; 3]) {
        put(self.first, self.positions, vertex, value);
    }

    #[inline(always)]
    pub(super) fn put_normal(&mut self, vertex: usize, value: [f32; 3]) {
        if let Some((attribute, apart)) = self.normals {
            let buffer = if apart {
                &mut *self.second
            } else {
                &mut *self.first
            };
            put(buffer, attribute, vertex, value);
        }
    }
}

#[inline(always)]
fn put<const N: usize>(buffer: &mut [f32], attribute: Attribute, vertex: usize, value: [f32; N]) {
    let at = vertex
        .wrapping_mul(attribute.stride)
        .wrapping_add(attribute.offset);
    let slot = buffer.get_mut(at..).and_then(<[f32]>::first_chunk_mut);
    if let Some(slot) = slot {
        *slot = value;
    }
}

fn fits(
    dims: &Dims,
    attribute: Attribute,
    name: &'static str,
    found: usize,
) -> Result<(), SizeError> {
    fits_width(dims.vertex_count, attribute, 3, name, found)
}

fn fits_width(
    vertex_count: usize,
    attribute: Attribute,
    width: usize,
    name: &'static str,
    found: usize,
) -> Result<(), SizeError> {
    match attribute.len_of(width, vertex_count) {
        Some(needed) if needed <= found => Ok(()),
        Some(needed) => Err(SizeError::TooSmall {
            buffer: name,
            needed,
            found,
        }),
        None => Err(SizeError::Layout { attribute: name }),
    }
}
