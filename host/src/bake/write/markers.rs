//! A marker set, as the host learned it.

use sinew_core::asset::SectionKind;

use super::Writer;
use crate::fit::live::MarkerModel;

impl Writer {
    pub(super) fn markers(&mut self, set: &MarkerModel) {
        self.dims.markers = *set.model().dims();
        self.put(SectionKind::LiveMarkers, set.markers.as_flattened());
        self.put(SectionKind::LiveNeighbours, &set.neighbours);
        self.put(SectionKind::LiveLinks, set.links.as_flattened());
        self.put(SectionKind::LiveSeeds, &set.seed_markers);
        self.put(SectionKind::LiveSeedShapes, set.seeds.as_flattened());
        let names: Vec<[u32; 2]> = set.labels.iter().map(|label| self.name(label)).collect();
        self.put(SectionKind::LiveNames, names.as_flattened());
        self.put(SectionKind::LiveRate, &[set.rate as f32, 0.0, 0.0, 0.0]);
    }
}
