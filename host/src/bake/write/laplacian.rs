//! Surfaces that follow their joints as markers.

use sinew_core::asset::SectionKind as Kind;

use super::{BakeError, Writer, limit};
use crate::fit::laplace::rig::Tables;
use crate::fit::laplace::{CollapsedTables, ExactTables};

impl Writer {
    pub(super) fn laplacian(&mut self, tables: &Tables) -> Result<(), BakeError> {
        match tables {
            Tables::Collapsed(tables) => self.collapsed(tables),
            Tables::Exact(tables) => self.exact(tables),
        }
    }

    fn collapsed(&mut self, tables: &CollapsedTables) -> Result<(), BakeError> {
        let counts = &mut self.dims.laplacian;
        counts.virtual_count = tables.virtual_starts.len() - 1;
        counts.virtual_entry_count = tables.virtual_markers.len();
        counts.slot_count = limit("slots", tables.slot_handles.len(), u32::MAX as usize / 128)?;
        self.put(Kind::SurfaceMarkers, tables.marker_rest.as_flattened());
        self.put(Kind::MarkerEdges, tables.marker_edges.as_flattened());
        self.put(Kind::VirtualStarts, &tables.virtual_starts);
        self.put(Kind::VirtualMarkers, &tables.virtual_markers);
        self.put(Kind::VirtualTurns, &tables.virtual_turns);
        self.put(
            Kind::VirtualCoefficients,
            tables.virtual_coefficients.as_flattened(),
        );
        self.put(Kind::HandleStarts, &tables.block_starts);
        self.put(Kind::SlotHandles, &tables.slot_handles);
        let slots = tables.slot_coefficients.as_flattened().as_flattened();
        self.put(Kind::SlotCoefficients, slots);
        Ok(())
    }

    fn exact(&mut self, tables: &ExactTables) -> Result<(), BakeError> {
        let factors = [&tables.harmonic, &tables.bilaplacian];
        let quads: usize = factors.iter().map(|factor| factor.values.len()).sum();
        let counts = &mut self.dims.laplacian;
        counts.row_count = tables.rest.len();
        counts.edge_count = tables.neighbours.len();
        counts.supernode_count = factors.iter().map(|factor| factor.columns.len() - 1).sum();
        counts.panel_count = factors.iter().map(|factor| factor.rows.len()).sum();
        counts.quad_count = limit("quads of a factor", quads, u32::MAX as usize / 16)?;
        let rest = tables.marker_rows.iter().map(|&row| {
            let [x, y, z, _] = tables.rest[row as usize];
            [x, y, z]
        });
        self.put(
            Kind::SurfaceMarkers,
            rest.collect::<Vec<_>>().as_flattened(),
        );
        self.put(Kind::MarkerEdges, tables.marker_edges.as_flattened());
        self.put(Kind::LaneRows, &tables.lane_rows);
        self.put(Kind::RowRest, tables.rest.as_flattened());
        self.put(Kind::Differential, tables.differential.as_flattened());
        self.put(Kind::RowStarts, &tables.starts);
        self.put(Kind::Neighbours, &tables.neighbours);
        self.put(Kind::NeighbourWeights, &tables.weights);
        self.put(Kind::MarkerRows, &tables.marker_rows);
        self.put(Kind::GuideMarkers, tables.guide_markers.as_flattened());
        self.put(Kind::GuideWeights, tables.guide_weights.as_flattened());
        let first = &tables.harmonic;
        let split = [
            first.columns.len() - 1,
            first.rows.len(),
            first.values.len(),
        ];
        let [supernodes, panels, quads] = split.map(|count| count as u32);
        let stiffness = tables.stiffness.to_bits();
        self.put(Kind::FactorSplit, &[supernodes, panels, quads, stiffness]);
        let columns = factors.map(|factor| &factor.columns[..]).concat();
        self.put(Kind::FactorColumns, &columns);
        let starts = factors.map(|factor| &factor.panels[..]).concat();
        self.put(Kind::FactorPanels, &starts);
        let rows = factors.map(|factor| &factor.rows[..]).concat();
        self.put(Kind::FactorRows, rows.as_flattened());
        let values = factors.map(|factor| &factor.values[..]).concat();
        self.put(Kind::FactorValues, values.as_flattened());
        Ok(())
    }
}
