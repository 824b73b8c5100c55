//! The surface of an asset that follows its joints as markers, in `f64`.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use sinew_core::asset::{Asset, LANES, Lanes3, LaplacianSurface};
use sinew_core::deform::laplacian::{CollapsedParts, ExactParts};

use super::laplacian::{consistent_signs, positions, rotations};
use crate::fit::laplace::cholesky::Cholesky;
use crate::fit::laplace::operator::Laplacian;
use crate::fit::laplace::shares::rotation_system;
use crate::fit::laplace::{LaplaceError, MarkerTarget, Surface};
use crate::model::nearest_rotation;

/// The oracle of an asset's surface.
#[derive(Debug)]
pub struct Marked<'a> {
    kind: Kind<'a>,
    order: &'a [u32],
    normals: &'a [Lanes3],
}

#[derive(Debug)]
enum Kind<'a> {
    Collapsed(CollapsedParts<'a>),
    /// With the systems put together and factored again, from the asset's own numbers.
    Exact(Box<Surface>, &'a [u32]),
}

impl<'a> Marked<'a> {
    /// The surface of an asset; none for an asset without one. O(tables), O(fill) for an exact one
    ///
    /// # Errors
    /// Systems that cannot be factored.
    pub fn new(asset: &Asset<'a>) -> Result<Option<Self>, LaplaceError> {
        let kind = match asset.laplacian() {
            Some(LaplacianSurface::Collapsed(surface)) => Kind::Collapsed(*surface.parts()),
            Some(LaplacianSurface::Exact(surface)) => {
                let parts = surface.parts();
                Kind::Exact(Box::new(refactored(parts)?), parts.lane_rows)
            }
            _ => return Ok(None),
        };
        Ok(Some(Self {
            kind,
            order: asset.source_order(),
            normals: asset.rest_normals(),
        }))
    }

    /// Vertices and unit normals in the source's order: `model` `[joints]` in model space.
    /// O(tables)
    #[must_use]
    pub fn surface(&self, model: &[DAffine3]) -> (Vec<DVec3>, Vec<DVec3>) {
        let target = |joint: &DAffine3| MarkerTarget {
            position: joint.translation,
            rotation: nearest_rotation(&joint.matrix3),
        };
        let targets: Vec<MarkerTarget> = model.iter().map(target).collect();
        match &self.kind {
            Kind::Collapsed(parts) => self.sums(parts, &targets),
            Kind::Exact(surface, rows) => {
                let (places, turns) = (positions(surface, &targets), rotations(surface, &targets));
                let row = |lane: usize| rows[lane] as usize;
                self.in_source_order(|lane| {
                    let turn = DMat3::from_quat(turns[row(lane)]);
                    (places[row(lane)], turn * self.normal(lane))
                })
            }
        }
    }

    fn sums(
        &self,
        parts: &CollapsedParts<'_>,
        targets: &[MarkerTarget],
    ) -> (Vec<DVec3>, Vec<DVec3>) {
        let signs = consistent_signs(targets, parts.marker_edges);
        let mut handles: Vec<(DMat3, DVec3)> = targets
            .iter()
            .zip(&signs)
            .map(|(target, &turn)| (DMat3::from_quat(turn), target.position))
            .collect();
        let apply = |(turn, place): &(DMat3, DVec3), [b, c, d, n]: [f32; 4]| {
            let [b, c, d, n] = [b, c, d, n].map(f64::from);
            *turn * DVec3::new(b, c, d) + *place * n
        };
        for pair in parts.virtual_starts.windows(2) {
            let (mut blend, mut place) = ([0.0; 4], DVec3::ZERO);
            for entry in pair[0] as usize..pair[1] as usize {
                let marker = usize::from(parts.virtual_markers[entry]);
                let share = f64::from(parts.virtual_turns[entry]);
                for (sum, x) in blend.iter_mut().zip(signs[marker].to_array()) {
                    *sum += share * x;
                }
                place += apply(&handles[marker], parts.virtual_coefficients[entry]);
            }
            let turn = DQuat::from_array(blend).normalize();
            handles.push((DMat3::from_quat(turn), place));
        }
        self.in_source_order(|lane| {
            let (block, lane_of_block) = (lane / LANES, lane % LANES);
            let (mut place, mut normal) = (DVec3::ZERO, DVec3::ZERO);
            for slot in parts.block_starts[block]..parts.block_starts[block + 1] {
                let handle = &handles[usize::from(parts.slot_handles[slot as usize])];
                let rows = &parts.slot_coefficients[slot as usize];
                let coefficients = [0, 1, 2, 3].map(|k| rows[k][lane_of_block]);
                place += apply(handle, coefficients);
                normal += f64::from(coefficients[3]) * (handle.0 * self.normal(lane));
            }
            (place, normal.normalize_or_zero())
        })
    }

    fn normal(&self, lane: usize) -> DVec3 {
        let block = &self.normals[lane / LANES];
        DVec3::from_array([0, 1, 2].map(|axis| f64::from(block[axis][lane % LANES])))
    }

    fn in_source_order(&self, of: impl Fn(usize) -> (DVec3, DVec3)) -> (Vec<DVec3>, Vec<DVec3>) {
        let mut places = vec![DVec3::ZERO; self.order.len()];
        let mut normals = places.clone();
        for (lane, &source) in self.order.iter().enumerate() {
            (places[source as usize], normals[source as usize]) = of(lane);
        }
        (places, normals)
    }
}

/// A surface from the numbers of an asset; rows are its vertices.
fn refactored(parts: &ExactParts<'_>) -> Result<Surface, LaplaceError> {
    let size = parts.rest.len();
    let laplacian = Laplacian {
        starts: parts.starts.to_vec(),
        neighbours: parts.neighbours.to_vec(),
        weights: parts.weights.iter().map(|&w| f64::from(w)).collect(),
        mass: parts
            .rest
            .iter()
            .map(|row| 1.0 / f64::from(row[3]))
            .collect(),
    };
    let mut marked = vec![false; size];
    parts
        .marker_rows
        .iter()
        .for_each(|&row| marked[row as usize] = true);
    let stiffness = f64::from(parts.stiffness);
    let pull: Vec<f64> = parts
        .differential
        .iter()
        .map(|row| f64::from(row[3]))
        .collect();
    let mut squared = laplacian.squared();
    for entry in squared.iter_mut().filter(|entry| entry.0 == entry.1) {
        let row = entry.0 as usize;
        entry.2 += pull[row] + if marked[row] { stiffness } else { 0.0 };
    }
    let harmonic = rotation_system(&laplacian, &pull, parts.marker_rows, None)?;
    let guides = parts.guide_markers.iter().zip(parts.guide_weights);
    let place = |row: &[f32; 4]| DVec3::new(row[0].into(), row[1].into(), row[2].into());
    Ok(Surface {
        positions: parts.rest.iter().map(place).collect(),
        markers: parts.marker_rows.to_vec(),
        marker_edges: parts.marker_edges.to_vec(),
        distances: Vec::new(),
        weights: Vec::new(),
        stiffness,
        guides: guides
            .map(|(&markers, weights)| (markers, weights.map(f64::from)))
            .collect(),
        pull,
        harmonic,
        bilaplacian: Cholesky::new(size, &squared, None)?,
        laplacian,
    })
}
