//! Triangles and named ranges of them.

use super::Asset;

/// Vertex indices of all triangles, three each, in block order.
#[derive(Clone, Copy, Debug)]
pub enum Triangles<'a> {
    /// Meshes of at most 65,536 vertices.
    U16(&'a [u16]),
    /// Larger ones.
    U32(&'a [u32]),
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

impl<'a> Asset<'a> {
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

    /// Corners of a triangle; `None` for one that does not exist.
    #[must_use]
    pub fn get(&self, triangle: usize) -> Option<[u32; 3]> {
        match self {
            Self::U16(indices) => {
                let corners = indices.as_chunks::<3>().0.get(triangle)?;
                Some(corners.map(u32::from))
            }
            Self::U32(indices) => indices.as_chunks().0.get(triangle).copied(),
        }
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
