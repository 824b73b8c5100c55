//! Ways to write the lanes of a block to their vertices.

use super::lanes::Lanes;
use super::output::{Output, VertexOrder, Writer};
use crate::asset::LANES;

/// Takes `L::WIDTH` vertices of a block, from lane `first` on.
pub(super) trait Store {
    /// Whether normals are asked for.
    fn wants_normals(&self) -> bool;
    fn positions<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]);
    fn normals<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]);
    /// Whether tangents are asked for; only [`Strided`] takes them.
    #[inline(always)]
    fn wants_tangents(&self) -> bool {
        false
    }
    /// `signs`: a bit for each lane of the block, set where the handedness is negative.
    #[inline(always)]
    fn tangents<L: Lanes>(&mut self, _block: usize, _first: usize, _xyz: [L; 3], _signs: u8) {}
    /// Positions and normals.
    #[inline(always)]
    fn vertices<L: Lanes>(
        &mut self,
        block: usize,
        first: usize,
        positions: [L; 3],
        normals: [L; 3],
    ) {
        self.positions(block, first, positions);
        self.normals(block, first, normals);
    }
}

/// Any layout and order.
pub(super) struct Strided<'s> {
    to: Writer<'s>,
    /// Empty for block order.
    order: &'s [u32],
    vertex_count: usize,
}

impl<'s> Strided<'s> {
    /// `source_order`: `[vertices]`, where each goes in source order.
    pub fn new(source_order: &'s [u32], output: &'s mut Output<'_>) -> Self {
        Self {
            order: order(source_order, output),
            vertex_count: source_order.len(),
            to: output.writer(),
        }
    }

    /// Where a vertex goes; `None` for lanes that only fill the last block.
    #[inline(always)]
    fn place(&self, vertex: usize) -> Option<usize> {
        match self.order.get(vertex) {
            Some(&source) => Some(source as usize),
            None => (vertex < self.vertex_count).then_some(vertex),
        }
    }
}

impl Store for Strided<'_> {
    #[inline(always)]
    fn wants_normals(&self) -> bool {
        self.to.wants_normals()
    }
    #[inline(always)]
    fn positions<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        let first = block * LANES + first;
        for (vertex, &row) in (first..).zip(L::rows(xyz).as_ref()) {
            if let Some(vertex) = self.place(vertex) {
                self.to.put_position(vertex, row);
            }
        }
    }
    #[inline(always)]
    fn normals<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        let first = block * LANES + first;
        for (vertex, &row) in (first..).zip(L::rows(xyz).as_ref()) {
            if let Some(vertex) = self.place(vertex) {
                self.to.put_normal(vertex, row);
            }
        }
    }
    #[inline(always)]
    fn wants_tangents(&self) -> bool {
        self.to.wants_tangents()
    }
    #[inline(always)]
    fn tangents<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3], signs: u8) {
        for (lane, &[x, y, z]) in (first..).zip(L::rows(xyz).as_ref()) {
            let handedness = if signs >> lane & 1 == 0 { 1.0 } else { -1.0 };
            if let Some(vertex) = self.place(block * LANES + lane) {
                self.to.put_tangent(vertex, [x, y, z, handedness]);
            }
        }
    }
}

/// Buffers of their own, nothing between vertices, any order; for one vertex at a time.
pub(super) struct Rows<'s> {
    positions: &'s mut [[f32; 3]],
    /// Empty where none are wanted.
    normals: &'s mut [[f32; 3]],
    wants_normals: bool,
    /// Empty for block order.
    order: &'s [u32],
    /// The vertex with which the buffers start.
    start: usize,
}

impl<'s> Rows<'s> {
    /// `None` for another layout. `source_order`: `[vertices]`.
    pub fn new(source_order: &'s [u32], output: &'s mut Output<'_>) -> Option<Self> {
        let order = order(source_order, output);
        let held = output.held();
        let (positions, normals) = output.separated()?;
        let wants_normals = normals.is_some();
        // Lanes beyond the last vertex find no place.
        let positions = positions.as_chunks_mut().0.get_mut(..held.len())?;
        Some(Self {
            positions,
            normals: normals.unwrap_or_default().as_chunks_mut().0,
            wants_normals,
            order,
            start: held.start,
        })
    }

    #[inline(always)]
    fn place(&self, vertex: usize) -> usize {
        match self.order.get(vertex) {
            Some(&source) => source as usize,
            None if self.order.is_empty() => vertex.wrapping_sub(self.start),
            None => usize::MAX,
        }
    }
}

impl Store for Rows<'_> {
    #[inline(always)]
    fn wants_normals(&self) -> bool {
        self.wants_normals
    }
    #[inline(always)]
    fn positions<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        for (vertex, &row) in (block * LANES + first..).zip(L::rows(xyz).as_ref()) {
            let at = self.place(vertex);
            if let Some(to) = self.positions.get_mut(at) {
                *to = row;
            }
        }
    }
    #[inline(always)]
    fn normals<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        for (vertex, &row) in (block * LANES + first..).zip(L::rows(xyz).as_ref()) {
            let at = self.place(vertex);
            if let Some(to) = self.normals.get_mut(at) {
                *to = row;
            }
        }
    }
    #[inline(always)]
    fn vertices<L: Lanes>(
        &mut self,
        block: usize,
        first: usize,
        positions: [L; 3],
        normals: [L; 3],
    ) {
        let rows = L::rows(positions);
        let normals = L::rows(normals);
        let rows = rows.as_ref().iter().zip(normals.as_ref());
        for (vertex, (&position, &normal)) in (block * LANES + first..).zip(rows) {
            let at = self.place(vertex);
            if let Some(to) = self.positions.get_mut(at) {
                *to = position;
            }
            if let Some(to) = self.normals.get_mut(at) {
                *to = normal;
            }
        }
    }
}

/// Buffers of their own, nothing between vertices, block order, whole blocks: no vertex is
/// written alone.
#[cfg(feature = "simd")]
pub(super) struct Packed<'s> {
    positions: &'s mut [[f32; 3 * LANES]],
    normals: Option<&'s mut [[f32; 3 * LANES]]>,
    /// The block with which the buffers start.
    start: usize,
}

#[cfg(feature = "simd")]
impl<'s> Packed<'s> {
    /// `None` for another layout or order.
    pub fn new(output: &'s mut Output<'_>) -> Option<Self> {
        if output.order == VertexOrder::Source {
            return None;
        }
        let start = output.held().start / LANES;
        let (positions, normals) = output.separated()?;
        Some(Self {
            positions: positions.as_chunks_mut().0,
            normals: normals.map(|normals| normals.as_chunks_mut().0),
            start,
        })
    }
}

#[cfg(feature = "simd")]
impl Store for Packed<'_> {
    #[inline(always)]
    fn wants_normals(&self) -> bool {
        self.normals.is_some()
    }
    #[inline(always)]
    fn positions<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        if let Some(to) = self.positions.get_mut(block.wrapping_sub(self.start)) {
            L::store_rows(xyz, to, first);
        }
    }
    #[inline(always)]
    fn normals<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        let block = block.wrapping_sub(self.start);
        if let Some(to) = self.normals.as_mut().and_then(|all| all.get_mut(block)) {
            L::store_rows(xyz, to, first);
        }
    }
}

/// Buffers of their own, nothing between vertices, source order, whole blocks.
#[cfg(feature = "simd")]
pub(super) struct Scattered<'s> {
    positions: &'s mut [[f32; 3]],
    normals: Option<&'s mut [[f32; 3]]>,
    order: &'s [[u32; LANES]],
}

#[cfg(feature = "simd")]
impl<'s> Scattered<'s> {
    /// `None` for another layout or order.
    pub fn new(source_order: &'s [u32], output: &'s mut Output<'_>) -> Option<Self> {
        let order = order(source_order, output).as_chunks().0;
        if output.order == VertexOrder::Block {
            return None;
        }
        let (positions, normals) = output.separated()?;
        Some(Self {
            positions: positions.as_chunks_mut().0,
            normals: normals.map(|normals| normals.as_chunks_mut().0),
            order,
        })
    }
}

#[cfg(feature = "simd")]
#[inline(always)]
fn scatter<L: Lanes>(
    to: &mut [[f32; 3]],
    order: &[[u32; LANES]],
    block: usize,
    first: usize,
    xyz: [L; 3],
) {
    let order = order.get(block).and_then(|order| order.get(first..));
    let rows = L::rows(xyz);
    for (&source, row) in order.unwrap_or_default().iter().zip(rows.as_ref()) {
        if let Some(to) = to.get_mut(source as usize) {
            *to = *row;
        }
    }
}

#[cfg(feature = "simd")]
impl Store for Scattered<'_> {
    #[inline(always)]
    fn wants_normals(&self) -> bool {
        self.normals.is_some()
    }
    #[inline(always)]
    fn positions<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        scatter(self.positions, self.order, block, first, xyz);
    }
    #[inline(always)]
    fn normals<L: Lanes>(&mut self, block: usize, first: usize, xyz: [L; 3]) {
        if let Some(normals) = &mut self.normals {
            scatter(normals, self.order, block, first, xyz);
        }
    }
}

fn order<'a>(source_order: &'a [u32], output: &Output<'_>) -> &'a [u32] {
    match output.order {
        VertexOrder::Source => source_order,
        VertexOrder::Block => &[],
    }
}
