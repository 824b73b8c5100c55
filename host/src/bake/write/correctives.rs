//! What predicts the weights of the last morph targets.

use sinew_core::asset::{CorrectiveDims, SectionKind as K};

use super::{BakeError, Writer, limit};
use crate::fit::correctives::CorrectiveData;

impl Writer {
    pub(super) fn correctives(&mut self, data: &CorrectiveData) -> Result<(), BakeError> {
        let most = usize::from(u16::MAX) - 1;
        self.dims.correctives = CorrectiveDims {
            part_count: limit("near-rigid parts", data.parents.len(), most)?,
            mode_count: data.ranges.len(),
            term_count: data.features.len(),
        };
        self.put(K::CorrectiveParents, &data.parents);
        self.put(K::CorrectiveBinds, &data.binds);
        self.put(K::CorrectivePivots, data.pivots.as_flattened());
        let springs = data.springs.as_flattened().as_flattened();
        self.put(K::CorrectiveSprings, springs);
        self.put(K::CorrectiveStarts, &data.starts);
        self.put(K::CorrectiveFeatures, &data.features);
        self.put(K::CorrectiveCoefficients, &data.coefficients);
        self.put(K::CorrectiveRanges, data.ranges.as_flattened());
        Ok(())
    }
}
