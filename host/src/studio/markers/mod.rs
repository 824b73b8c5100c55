//! Markers on the skin.
//!
//! A marker is glued to a point of a triangle and moves with it. Dense sets cover the body evenly
//! (Park & Hodgins 2006, section 4: about 350 on an approximate grid, with more at the tips of the
//! elbows); sparse ones sit on the landmarks that gait laboratories use.

mod dense;
mod geodesic;
mod landmarks;

use glam::DVec3;

use super::StudioError;
use super::body::Surface;
use crate::model::Avatar;

/// Which markers to put on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkerLayout {
    /// This many, evenly over the body but for face, fingers and soles.
    Dense(usize),
    /// 41 named ones, as in CMU's recordings.
    Standard41,
    /// The 41 and 12 more on the inner sides of joints, thighs, ribs and thumbs.
    Standard53,
}

/// A marker and where it is glued.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Unique in its set.
    pub name: String,
    /// Index in the mesh's triangles.
    pub triangle: usize,
    /// That triangle's vertices.
    pub vertices: [u32; 3],
    /// Weights of the vertices; they sum to 1.
    pub barycentric: [f64; 3],
}

/// Markers of one body.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerSet {
    /// In the order of their indices.
    pub markers: Vec<Marker>,
}

impl MarkerSet {
    /// Puts markers on a body in its rest shape. The same seed gives the same places.
    /// O(markers x vertices log vertices) at worst
    ///
    /// # Errors
    /// More markers than the body has room for, a named set on a body that is not human.
    pub fn new(avatar: &Avatar, layout: MarkerLayout, seed: u64) -> Result<Self, StudioError> {
        let markers = match layout {
            MarkerLayout::Dense(count) => dense::place(avatar, count, seed)?,
            MarkerLayout::Standard41 => landmarks::place(avatar, false)?,
            MarkerLayout::Standard53 => landmarks::place(avatar, true)?,
        };
        Ok(Self { markers })
    }

    /// Positions `[markers]` on a surface of the same mesh, metres.
    #[must_use]
    pub fn positions(&self, surface: &Surface) -> Vec<DVec3> {
        self.markers
            .iter()
            .map(|marker| marker.on(&surface.positions))
            .collect()
    }

    /// Unit normals `[markers]` on a surface of the same mesh.
    #[must_use]
    pub fn normals(&self, surface: &Surface) -> Vec<DVec3> {
        let of = |marker: &Marker| marker.on(&surface.normals).normalize_or(DVec3::Y);
        self.markers.iter().map(of).collect()
    }
}

impl Marker {
    fn on(&self, values: &[DVec3]) -> DVec3 {
        let corners = self.vertices.iter().zip(self.barycentric);
        corners
            .map(|(&at, weight)| weight * values[at as usize])
            .sum()
    }
}
