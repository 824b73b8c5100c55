//! Trajectories as the filling stages see them: measured, estimated or missing.

use glam::DVec3;

use crate::take::Take;

/// A take whose missing samples may carry estimates.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub take: &'a Take,
    /// `[markers x frames]`, metres: 0 where measured, the standard deviation an axis where
    /// estimated, NaN where missing.
    pub sigma: &'a [f32],
}

impl View<'_> {
    pub fn marker_count(&self) -> usize {
        self.take.marker_count()
    }

    pub fn trajectory(&self, marker: usize) -> &[DVec3] {
        self.take.trajectory(marker)
    }

    /// Standard deviation an axis, NaN where missing.
    pub fn sigma(&self, marker: usize, frame: usize) -> f64 {
        f64::from(self.sigma[marker * self.take.frame_count() + frame])
    }

    pub fn is_measured(&self, marker: usize, frame: usize) -> bool {
        self.sigma(marker, frame) == 0.0
    }
}
