//! The tables of a collapsed deformer, and what they compute in `f64`.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};
use sinew_core::asset::{LANES, Lanes3};
use sinew_core::deform::laplacian::{Collapsed, CollapsedParts, LaplacianError};

use super::CollapseReport;
use super::least_squares::Frame;
use crate::fit::laplace::rig::lanes;
use crate::fit::laplace::{MarkerTarget, Surface};
use crate::reference::laplacian::positions;

/// Owned tables of [`Collapsed`]; the fields are those of [`CollapsedParts`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in CollapsedParts")]
pub struct CollapsedTables {
    pub marker_rest: Vec<[f32; 3]>,
    pub marker_edges: Vec<[u16; 2]>,
    pub virtual_starts: Vec<u32>,
    pub virtual_markers: Vec<u16>,
    pub virtual_turns: Vec<f32>,
    pub virtual_coefficients: Vec<[f32; 4]>,
    pub order: Vec<u32>,
    pub block_starts: Vec<u32>,
    pub slot_handles: Vec<u16>,
    pub slot_coefficients: Vec<[[f32; LANES]; 4]>,
    pub rest_normals: Vec<Lanes3>,
}

impl CollapsedTables {
    /// The core's view, checked.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn collapsed(&self) -> Result<Collapsed<'_>, LaplacianError> {
        Collapsed::new_checked(CollapsedParts {
            marker_rest: &self.marker_rest,
            marker_edges: &self.marker_edges,
            virtual_starts: &self.virtual_starts,
            virtual_markers: &self.virtual_markers,
            virtual_turns: &self.virtual_turns,
            virtual_coefficients: &self.virtual_coefficients,
            order: &self.order,
            block_starts: &self.block_starts,
            slot_handles: &self.slot_handles,
            slot_coefficients: &self.slot_coefficients,
            rest_normals: &self.rest_normals,
        })
    }

    /// Places of virtual handles at rest, metres.
    #[must_use]
    pub fn virtual_rest(&self) -> Vec<[f32; 3]> {
        let starts = self.virtual_starts.windows(2);
        let place = |pair: &[u32]| {
            let mut sum = [0.0; 3];
            for entry in pair[0] as usize..pair[1] as usize {
                let marker = self.marker_rest[usize::from(self.virtual_markers[entry])];
                let [b, c, d, n] = self.virtual_coefficients[entry];
                for ((sum, b), p) in sum.iter_mut().zip([b, c, d]).zip(marker) {
                    *sum += b + n * p;
                }
            }
            sum
        };
        starts.map(place).collect()
    }

    /// The same for `[vertices]` that follow places of the surface: `vertex_of` says which. Several
    /// may follow one; `normal`: of a vertex at rest. O(vertices log vertices)
    #[must_use]
    pub fn for_vertices(&self, vertex_of: &[u32], normal: impl Fn(usize) -> DVec3) -> Self {
        let mut place = vec![0_u32; self.order.len()];
        for (at, &vertex) in self.order.iter().enumerate() {
            place[vertex as usize] = at as u32;
        }
        let mut order: Vec<u32> = (0..vertex_of.len() as u32).collect();
        order.sort_by_key(|&vertex| place[vertex_of[vertex as usize] as usize]);
        let mut tables = Self {
            block_starts: vec![0],
            slot_handles: Vec::new(),
            slot_coefficients: Vec::new(),
            rest_normals: Vec::new(),
            order: Vec::new(),
            ..self.clone()
        };
        for vertices in order.chunks(LANES) {
            let places = vertices
                .iter()
                .map(|&v| place[vertex_of[v as usize] as usize] as usize);
            let mut slots: BTreeMap<u16, [[f32; LANES]; 4]> = BTreeMap::new();
            for (lane, at) in places.enumerate() {
                let (block, from) = (at / LANES, at % LANES);
                let range =
                    self.block_starts[block] as usize..self.block_starts[block + 1] as usize;
                for slot in range {
                    let to = slots.entry(self.slot_handles[slot]).or_default();
                    for (to, row) in to.iter_mut().zip(&self.slot_coefficients[slot]) {
                        to[lane] = row[from];
                    }
                }
            }
            tables.slot_handles.extend(slots.keys());
            tables.slot_coefficients.extend(slots.values());
            tables.block_starts.push(tables.slot_handles.len() as u32);
            tables.rest_normals.push(lanes(vertices, &normal));
        }
        tables.order = order;
        tables
    }

    /// Frames of all handles in a pose, in `f64`: markers, then virtual handles.
    #[must_use]
    pub fn handle_frames(&self, surface: &Surface, targets: &[MarkerTarget]) -> Vec<Frame> {
        let signs = crate::reference::laplacian::consistent_signs(targets, &surface.marker_edges);
        let mut frames: Vec<Frame> = targets
            .iter()
            .zip(&signs)
            .map(|(target, &rotation)| Frame {
                rotation: DMat3::from_quat(rotation),
                position: target.position,
            })
            .collect();
        for pair in self.virtual_starts.windows(2) {
            let (mut blend, mut position) = ([0.0; 4], DVec3::ZERO);
            for entry in pair[0] as usize..pair[1] as usize {
                let marker = usize::from(self.virtual_markers[entry]);
                let share = f64::from(self.virtual_turns[entry]);
                for (sum, x) in blend.iter_mut().zip(signs[marker].to_array()) {
                    *sum += share * x;
                }
                position += frames[marker].apply(self.virtual_coefficients[entry].map(f64::from));
            }
            frames.push(Frame {
                rotation: DMat3::from_quat(DQuat::from_array(blend).normalize()),
                position,
            });
        }
        frames
    }

    /// Vertices in a pose, in `f64`: the oracle of the core's stream. `[vertices]`, metres.
    #[must_use]
    pub fn positions(&self, surface: &Surface, targets: &[MarkerTarget]) -> Vec<DVec3> {
        let frames = self.handle_frames(surface, targets);
        let mut positions = vec![DVec3::ZERO; self.order.len()];
        for (block, vertices) in self.order.chunks(LANES).enumerate() {
            let slots = self.block_starts[block] as usize..self.block_starts[block + 1] as usize;
            for slot in slots {
                let frame = &frames[usize::from(self.slot_handles[slot])];
                let coefficients = &self.slot_coefficients[slot];
                for (lane, &vertex) in vertices.iter().enumerate() {
                    let coefficients = [0, 1, 2, 3].map(|k| f64::from(coefficients[k][lane]));
                    positions[vertex as usize] += frame.apply(coefficients);
                }
            }
        }
        positions
    }

    /// Difference to the exact surface over poses.
    #[must_use]
    pub fn compare(&self, surface: &Surface, poses: &[Vec<MarkerTarget>]) -> CollapseReport {
        let exact: Vec<_> = poses.iter().map(|pose| positions(surface, pose)).collect();
        self.compare_with(surface, poses, &exact)
    }

    /// Difference to given surfaces `[poses][vertices]`.
    pub(super) fn compare_with(
        &self,
        surface: &Surface,
        poses: &[Vec<MarkerTarget>],
        exact: &[Vec<DVec3>],
    ) -> CollapseReport {
        let mut errors: Vec<f64> = Vec::new();
        for (targets, exact) in poses.iter().zip(exact) {
            let collapsed = self.positions(surface, targets);
            errors.extend(exact.iter().zip(collapsed).map(|(a, b)| a.distance(b)));
        }
        CollapseReport::new(errors)
    }
}
