//! Which point of the surface each marker lies on.

use glam::DVec3;

use super::figure::Figure;
use crate::spatial::Tree;

/// A marker's normal may differ this much from the surface's: cosine.
const FACING: f64 = 0.3;
/// A point that is this much farther than the nearest one, and that much over the body's size, is
/// not taken for facing the right way.
const FARTHER: (f64, f64) = (3.0, 0.03);

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Match {
    /// Index of the triangle.
    pub triangle: usize,
    /// Weights of its corners.
    pub barycentric: [f64; 3],
    /// Metres.
    pub distance: f64,
}

/// What is remembered of markers from round to round.
pub(super) struct Matcher<'a> {
    triangles: &'a [[u32; 3]],
    size: f64,
    /// `[triangles]`: which node of the rig moves each.
    parts: Option<(&'a Figure, Vec<usize>)>,
    /// `[markers]`: outward directions and nodes, once known.
    known: Vec<Option<(DVec3, usize)>>,
}

impl<'a> Matcher<'a> {
    pub fn new(
        triangles: &'a [[u32; 3]],
        figure: Option<&'a Figure>,
        marker_count: usize,
        size: f64,
    ) -> Self {
        let parts = figure.map(|figure| {
            let heaviest = figure.heaviest();
            let of = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|at| heaviest[at as usize]);
                if b == c { b } else { a }
            };
            (figure, triangles.iter().map(of).collect())
        });
        Self {
            triangles,
            size,
            parts,
            known: vec![None; marker_count],
        }
    }

    /// The nearest points of a surface that face as the markers do and belong to their limbs, or one
    /// joined to them; the nearest of all where there is none within reach.
    /// O(markers log triangles)
    pub fn find(
        &mut self,
        tree: &Tree,
        positions: &[DVec3],
        markers: &[DVec3],
    ) -> Vec<Option<Match>> {
        let normal = |triangle: usize| {
            let [a, b, c] = self.triangles[triangle].map(|at| positions[at as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let part = |triangle: usize| self.parts.as_ref().map_or(0, |(_, parts)| parts[triangle]);
        let find = |marker: usize| {
            let any = tree.closest(markers[marker], |_| true)?;
            let fits = |triangle: usize| {
                self.known[marker].is_none_or(|(outward, node)| {
                    let near = self
                        .parts
                        .as_ref()
                        .is_none_or(|(figure, parts)| figure.are_near(node, parts[triangle]));
                    near && normal(triangle).dot(outward) > FACING
                })
            };
            let fit = tree.closest(markers[marker], fits);
            let reach = FARTHER.0 * any.distance + FARTHER.1 * self.size;
            let near = fit.filter(|fit| fit.distance <= reach).unwrap_or(any);
            Some(Match {
                triangle: near.triangle,
                barycentric: near.barycentric,
                distance: near.distance,
            })
        };
        let matches: Vec<Option<Match>> = (0..markers.len()).map(find).collect();
        let known = matches
            .iter()
            .map(|found| found.map(|at| (normal(at.triangle), part(at.triangle))));
        self.known = known.collect();
        matches
    }
}
