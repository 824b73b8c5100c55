//! A marker set, as the host learned it.

use sinew_core::asset::SectionKind;

use super::Writer;
use crate::fit::live::MarkerModel;

impl Writer {
    pub(super) fn markers(&mut self, set: &MarkerModel) {
        self.dims.markers = *set.model().dims();
        self.put(SectionKind::Markers, set.markers.as_flattened());
        self.put(SectionKind::MarkerNeighbours, &set.neighbours);
        self.put(SectionKind::MarkerLinks, set.links.as_flattened());
        self.put(SectionKind::MarkerSeeds, &set.seed_markers);
        self.put(SectionKind::MarkerSeedShapes, set.seeds.as_flattened());
        let names: Vec<[u32; 2]> = set.labels.iter().map(|label| self.name(label)).collect();
        self.put(SectionKind::MarkerNames, names.as_flattened());
        self.put(SectionKind::MarkerRate, &[set.rate as f32, 0.0, 0.0, 0.0]);
    }
}
