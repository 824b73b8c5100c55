//! How the distance of every two markers varies.

use crate::clean::fill::View;
use crate::clean::neighbours::{Neighbour, rank};

/// Ranked partners of every marker, most rigid first.
pub(super) struct Pairs {
    ranked: Vec<Vec<Neighbour>>,
    count: usize,
    /// `[markers x markers]`: mean distance and variance; NaN where too few frames show both.
    table: Vec<(f64, f64)>,
}

impl Pairs {
    /// Quadratic in markers, linear in frames (at most 600 of them).
    pub fn measure(view: &View<'_>) -> Self {
        let count = view.marker_count();
        let all: Vec<usize> = (0..count).collect();
        let ranked = crate::clean::fill::in_parallel(&all, |marker| rank(view, marker));
        let mut table = vec![(f64::NAN, f64::NAN); count * count];
        for (marker, partners) in ranked.iter().enumerate() {
            for partner in partners {
                table[marker * count + partner.marker] = (partner.distance, partner.variance);
            }
        }
        Self {
            ranked,
            count,
            table,
        }
    }

    /// Partners of a marker, most rigid first.
    pub fn rank(&self, marker: usize) -> &[Neighbour] {
        &self.ranked[marker]
    }

    /// Mean distance and its variance.
    pub fn between(&self, a: usize, b: usize) -> (f64, f64) {
        self.table[a * self.count + b]
    }
}

/// Distances vary between sessions by this many metres whatever the takes show.
const SESSION: f64 = 0.003;
/// And by this share of themselves: a long distance that kept its length perhaps just was not
/// bent.
const SHARE: f64 = 0.008;
/// Deviation, metres, beyond which a distance depends on the pose, and the takes show few poses.
const POSE: f64 = 0.01;
/// Most by which it may then be wider than seen.
const WIDER: f64 = 2.5;

/// Standard deviation to be expected of a distance.
pub(super) fn spread(distance: f64, variance: f64) -> f64 {
    let wider = (1.2 + variance.sqrt() / POSE).min(WIDER);
    let unseen = SHARE * distance;
    (wider * wider * variance + SESSION * SESSION + unseen * unseen).sqrt()
}
