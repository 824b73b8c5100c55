//! Questions about a posed avatar that need no whole frame.

use super::Avatar;
use crate::deform::{Bounds, SizeError, posed_bounds};

impl Avatar<'_, '_> {
    /// A box that holds every vertex of the pose of the last step, reached by the budget or not;
    /// `None` before a step, or where the asset holds no boxes. Model space, metres; see
    /// [`posed_bounds`]. O(binds)
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        posed_bounds(self.asset, self.palette, self.mode)
    }

    /// Single vertices in the pose of the last step: what a ray cast hits, what a prop hangs on.
    ///
    /// `ids` are places in block order, as the asset's triangles name them; see
    /// [`SkinJob::vertices`](crate::deform::SkinJob::vertices).
    ///
    /// # Errors
    /// [`SizeError::TooSmall`] where there are more ids than places.
    pub fn skin_vertices(
        &self,
        ids: &[u32],
        positions: &mut [[f32; 3]],
        normals: Option<&mut [[f32; 3]]>,
    ) -> Result<(), SizeError> {
        self.job().vertices(self.asset, ids, positions, normals)
    }
}
