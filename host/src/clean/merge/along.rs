//! Ways along the body between the tracks of the reference frame.

use super::super::surface::MarkerSurface;
use super::tracks::Tracks;

/// The marker surface, and which fragment is which of its points.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    surface: MarkerSurface,
    /// `[points of the surface]`: fragments.
    fragments: Vec<usize>,
}

impl Along {
    pub fn new(surface: MarkerSurface, fragments: Vec<usize>) -> Self {
        Self { surface, fragments }
    }

    /// `[tracks]`: which point of the surface each is.
    pub fn places(&self, tracks: &Tracks<'_>) -> Vec<Option<usize>> {
        let mut places = vec![None; tracks.members.len()];
        for (point, &fragment) in self.fragments.iter().enumerate() {
            places[tracks.track_of[fragment]] = Some(point);
        }
        places
    }

    /// The way between two points of the surface; the straight distance where either is none.
    pub fn metres(&self, a: Option<usize>, b: Option<usize>, straight: f64) -> f64 {
        let (Some(a), Some(b)) = (a, b) else {
            return straight;
        };
        self.surface.way(a, b).max(straight)
    }
}
