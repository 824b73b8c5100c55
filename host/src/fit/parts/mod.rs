//! Learns a skin that dense markers drive (Park & Hodgins 2006, section 5).
//!
//! In: a mesh in its rest pose, markers glued to it, near-rigid parts, and frames of markers. Out:
//! the core's tables for one of three modes ([`ModeData`]), and how far each mode is from markers
//! that it has not seen.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | [`segments`] | a rig, or labels of vertices | parts with the weights of vertices |
//! | [`weights`] | motion of markers | which parts a marker belongs to |
//! | [`spread`] | the surface | biharmonic weights of markers over vertices |
//! | [`glue`] | a frame of markers | where they sit on the mesh |
//! | [`rig`], [`hybrid`], [`exact`], [`collapsed`] | all of it | tables |
//! | [`measure`](mod@measure) | all of it | errors on what was not seen |

pub mod collapsed;
mod error;
pub mod exact;
pub mod glue;
pub mod hybrid;
mod learn;
pub mod measure;
pub mod patches;
pub mod player;
pub mod rig;
pub mod segments;
pub mod spread;
pub mod tables;
pub mod weights;

pub use error::PartsFitError;
pub use learn::{Learnt, Mode, Options, learn};
pub use player::{MarkerPlayer, marker_frame};
pub use segments::Segments;
pub use tables::{BlockTables, ModeData, ModeTables, RigTables, SlotRows, SlotTables};

use glam::DVec3;

/// Where a marker is glued to a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glued {
    /// Vertices of a triangle.
    pub vertices: [u32; 3],
    /// Their weights, which sum to 1.
    pub weights: [f64; 3],
}

impl Glued {
    /// Weights at the marker from those of vertices, heaviest first.
    #[must_use]
    pub fn weights_of(&self, of_vertices: &[Vec<(u32, f64)>]) -> Vec<(u32, f64)> {
        let corners = self.vertices.iter().zip(self.weights);
        segments::normalised(corners.flat_map(|(&vertex, share)| {
            let row = &of_vertices[vertex as usize];
            row.iter()
                .map(move |&(part, weight)| (part, share * weight))
        }))
    }

    /// The glued point of a surface of the same mesh.
    #[must_use]
    pub fn on(&self, positions: &[DVec3]) -> DVec3 {
        let corners = self.vertices.iter().zip(self.weights);
        corners
            .map(|(&at, weight)| weight * positions[at as usize])
            .sum()
    }
}
