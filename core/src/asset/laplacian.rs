//! Laplacian deformers: a surface that follows its joints, the markers, without a skin.
//!
//! The joints of such an asset are its markers, and its clips move them. The skin of the asset is
//! then only a coarse stand-in, for programs that know nothing else.

use super::sections::Sections;
use super::{Asset, AssetError, LANES, SectionKind};
use crate::deform::laplacian::{Collapsed, CollapsedParts, Exact, ExactParts};
use crate::solve::sparse::{Factor, FactorParts};

/// Counts of a Laplacian deformer: all zero without one, rows only where it is solved each frame,
/// slots only where it is collapsed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LaplacianDims {
    /// Handles between the markers.
    pub virtual_count: usize,
    /// (virtual handle, marker) pairs.
    pub virtual_entry_count: usize,
    /// (block, handle) slots.
    pub slot_count: usize,
    /// Places that are solved for.
    pub row_count: usize,
    /// Neighbours of all rows together.
    pub edge_count: usize,
    /// Supernodes of both factors together.
    pub supernode_count: usize,
    /// Panels of both factors together.
    pub panel_count: usize,
    /// Quads of both factors together.
    pub quad_count: usize,
}

impl LaplacianDims {
    /// Whether the surface is a sum over handles.
    #[must_use]
    pub const fn is_collapsed(&self) -> bool {
        self.slot_count > 0
    }

    /// Whether the surface is solved for in each frame.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        self.row_count > 0
    }

    /// Whether there is a deformer at all.
    #[must_use]
    pub const fn is_some(&self) -> bool {
        self.is_collapsed() || self.is_exact()
    }

    pub(super) const fn from_words(words: [usize; 8]) -> Self {
        let [
            virtual_count,
            virtual_entry_count,
            slot_count,
            row_count,
            edge_count,
            supernode_count,
            panel_count,
            quad_count,
        ] = words;
        Self {
            virtual_count,
            virtual_entry_count,
            slot_count,
            row_count,
            edge_count,
            supernode_count,
            panel_count,
            quad_count,
        }
    }

    pub(super) const fn to_words(self) -> [usize; 8] {
        [
            self.virtual_count,
            self.virtual_entry_count,
            self.slot_count,
            self.row_count,
            self.edge_count,
            self.supernode_count,
            self.panel_count,
            self.quad_count,
        ]
    }

    /// The index of a count that contradicts the others.
    pub(super) const fn fault(&self, markers: usize) -> Option<usize> {
        if self.is_collapsed() && self.is_exact() {
            return Some(3);
        }
        if !self.is_collapsed() && (self.virtual_count > 0 || self.virtual_entry_count > 0) {
            return Some(2);
        }
        let of_factors = self.edge_count > 0
            || self.supernode_count > 0
            || self.panel_count > 0
            || self.quad_count > 0;
        if !self.is_exact() && of_factors {
            return Some(3);
        }
        if self.virtual_count.saturating_add(markers) >= u16::MAX as usize {
            return Some(0);
        }
        None
    }
}

/// The surface of a Laplacian asset.
#[expect(
    clippy::large_enum_variant,
    reason = "there is no box without an allocator, and one lives for a frame"
)]
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum LaplacianSurface<'a> {
    /// A sum over handles.
    Collapsed(Collapsed<'a>),
    /// Solved for in each frame.
    Exact(Exact<'a>),
}

/// Sections of the group.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LaplacianView<'a> {
    marker_rest: &'a [[f32; 3]],
    marker_edges: &'a [[u16; 2]],
    virtual_starts: &'a [u32],
    virtual_markers: &'a [u16],
    virtual_turns: &'a [f32],
    virtual_coefficients: &'a [[f32; 4]],
    block_starts: &'a [u32],
    slot_handles: &'a [u16],
    slot_coefficients: &'a [[[f32; LANES]; 4]],
    lane_rows: &'a [u32],
    row_rest: &'a [[f32; 4]],
    differential: &'a [[f32; 4]],
    row_starts: &'a [u32],
    neighbours: &'a [u32],
    weights: &'a [f32],
    marker_rows: &'a [u32],
    guide_markers: &'a [[u16; 4]],
    guide_weights: &'a [[f32; 4]],
    /// Supernodes, panels and quads of the harmonic factor; the bits of the stiffness.
    split: &'a [u32],
    columns: &'a [u32],
    panels: &'a [u32],
    panel_rows: &'a [[u32; 4]],
    values: &'a [[f32; 4]],
}

impl<'a> LaplacianView<'a> {
    pub(super) fn find(sections: &Sections<'a>) -> Result<Self, AssetError> {
        use SectionKind as Kind;
        Ok(Self {
            marker_rest: sections.view(Kind::SurfaceMarkers)?,
            marker_edges: sections.view(Kind::MarkerEdges)?,
            virtual_starts: sections.view(Kind::VirtualStarts)?,
            virtual_markers: sections.view(Kind::VirtualMarkers)?,
            virtual_turns: sections.view(Kind::VirtualTurns)?,
            virtual_coefficients: sections.view(Kind::VirtualCoefficients)?,
            block_starts: sections.view(Kind::HandleStarts)?,
            slot_handles: sections.view(Kind::SlotHandles)?,
            slot_coefficients: sections.view(Kind::SlotCoefficients)?,
            lane_rows: sections.view(Kind::LaneRows)?,
            row_rest: sections.view(Kind::RowRest)?,
            differential: sections.view(Kind::Differential)?,
            row_starts: sections.view(Kind::RowStarts)?,
            neighbours: sections.view(Kind::Neighbours)?,
            weights: sections.view(Kind::NeighbourWeights)?,
            marker_rows: sections.view(Kind::MarkerRows)?,
            guide_markers: sections.view(Kind::GuideMarkers)?,
            guide_weights: sections.view(Kind::GuideWeights)?,
            split: sections.view(Kind::FactorSplit)?,
            columns: sections.view(Kind::FactorColumns)?,
            panels: sections.view(Kind::FactorPanels)?,
            panel_rows: sections.view(Kind::FactorRows)?,
            values: sections.view(Kind::FactorValues)?,
        })
    }
}

impl<'a> Asset<'a> {
    /// The surface that follows the markers; none in an asset without one.
    #[must_use]
    pub fn laplacian(&self) -> Option<LaplacianSurface<'a>> {
        let dims = &self.dims.laplacian;
        if dims.is_collapsed() {
            let collapsed = Collapsed::proved(self.collapsed_parts());
            Some(LaplacianSurface::Collapsed(collapsed))
        } else if dims.is_exact() {
            let parts = self.exact_parts();
            let (harmonic, bilaplacian) = (parts.harmonic, parts.bilaplacian);
            let (harmonic, bilaplacian) = (Factor::proved(harmonic), Factor::proved(bilaplacian));
            let exact = Exact::proved(parts, harmonic, bilaplacian);
            Some(LaplacianSurface::Exact(exact))
        } else {
            None
        }
    }

    pub(super) fn collapsed_parts(&self) -> CollapsedParts<'a> {
        let view = &self.laplacian;
        CollapsedParts {
            marker_rest: view.marker_rest,
            marker_edges: view.marker_edges,
            virtual_starts: view.virtual_starts,
            virtual_markers: view.virtual_markers,
            virtual_turns: view.virtual_turns,
            virtual_coefficients: view.virtual_coefficients,
            order: self.order,
            block_starts: view.block_starts,
            slot_handles: view.slot_handles,
            slot_coefficients: view.slot_coefficients,
            rest_normals: self.normals,
        }
    }

    pub(super) fn exact_parts(&self) -> ExactParts<'a> {
        let view = &self.laplacian;
        let mut split = [0; 4];
        for (to, &word) in split.iter_mut().zip(view.split) {
            *to = word;
        }
        let [supernodes, panels, quads, stiffness] = split;
        // A factor of n supernodes has n + 1 starts.
        let (columns, more_columns) = cut(view.columns, supernodes.saturating_add(1));
        let (starts, more_starts) = cut(view.panels, supernodes.saturating_add(1));
        let (rows, more_rows) = cut(view.panel_rows, panels);
        let (values, more_values) = cut(view.values, quads);
        let factor = |columns, panels, rows, values: &'a [[f32; 4]]| FactorParts {
            size: view.row_rest.len(),
            columns,
            panels,
            rows,
            values,
        };
        ExactParts {
            order: self.order,
            lane_rows: view.lane_rows,
            rest_normals: self.normals,
            rest: view.row_rest,
            differential: view.differential,
            starts: view.row_starts,
            neighbours: view.neighbours,
            weights: view.weights,
            marker_rows: view.marker_rows,
            marker_edges: view.marker_edges,
            stiffness: f32::from_bits(stiffness),
            guide_markers: view.guide_markers,
            guide_weights: view.guide_weights,
            harmonic: factor(columns, starts, rows, values),
            bilaplacian: factor(more_columns, more_starts, more_rows, more_values),
        }
    }
}

/// Both parts of a slice; all of it first where it is too short.
fn cut<T>(all: &[T], at: u32) -> (&[T], &[T]) {
    all.split_at_checked(at as usize).unwrap_or((all, &[]))
}
