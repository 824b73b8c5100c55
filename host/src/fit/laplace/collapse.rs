//! The solve as fixed sums over handles, fitted to exact solutions.
//!
//! Virtual handles are spread over the surface between the markers. Each is moved by the markers
//! near it; each block of eight vertices by the handles near it. Both fits are least squares over
//! the exact solutions of the user's poses, with a pull toward blended rigid motion, so that poses
//! which were not fitted stay sane. Both reproduce rigid motion of the whole body exactly.

pub(crate) mod blocks;
mod least_squares;

use glam::{DMat3, DQuat, DVec3};
use sinew_core::asset::{LANES, Lanes3};
use sinew_core::deform::laplacian::{Collapsed, CollapsedParts, LaplacianError};

use self::least_squares::{Fit, Frame};
use super::graph::Graph;
use super::{LaplaceError, MarkerTarget, Surface};
use crate::reference::laplacian::positions;

/// Sizes of a collapsed deformer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapseOptions {
    /// Virtual handles between the markers.
    pub virtual_handles: usize,
    /// Markers that move a virtual handle.
    pub markers_a_virtual_handle: usize,
    /// Handles that move a block of eight vertices.
    pub handles_a_block: usize,
    /// Pull toward blended rigid motion, as a part of the mean square of the fitted terms.
    pub ridge: f64,
}

impl Default for CollapseOptions {
    fn default() -> Self {
        Self {
            virtual_handles: 100,
            markers_a_virtual_handle: 16,
            handles_a_block: 8,
            ridge: 1e-6,
        }
    }
}

/// How far the collapsed surface is from the exact one, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CollapseReport {
    /// Mean over vertices and poses.
    pub mean: f64,
    /// Which 99 of 100 vertices stay below.
    pub percentile_99: f64,
    /// Largest.
    pub max: f64,
}

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
        let mut errors: Vec<f64> = Vec::new();
        for targets in poses {
            let exact = positions(surface, targets);
            let collapsed = self.positions(surface, targets);
            errors.extend(exact.iter().zip(collapsed).map(|(a, b)| a.distance(b)));
        }
        CollapseReport::new(errors)
    }
}

impl CollapseReport {
    /// Sums up distances in metres.
    #[must_use]
    pub fn new(mut errors: Vec<f64>) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        errors.sort_by(f64::total_cmp);
        Self {
            mean: errors.iter().sum::<f64>() / errors.len() as f64,
            percentile_99: errors[(errors.len() - 1) * 99 / 100],
            max: errors[errors.len() - 1],
        }
    }
}

/// Fits the tables of a collapsed deformer to the exact surface in `poses`.
///
/// `normals`: `[vertices]`, unit length at rest, or empty; `poses`: `[poses][markers]`; the rest
/// pose is always one of them.
/// O(poses (factor + blocks handles^2) + blocks handles^3)
///
/// # Errors
/// [`LaplaceError::PoseLength`], [`LaplaceError::MarkerCount`] beyond 16-bit indices.
pub fn collapse(
    surface: &Surface,
    triangles: &[[u32; 3]],
    normals: &[DVec3],
    poses: &[Vec<MarkerTarget>],
    options: &CollapseOptions,
) -> Result<CollapsedTables, LaplaceError> {
    let needed = surface.markers.len();
    for (pose, targets) in poses.iter().enumerate() {
        let found = targets.len();
        if found != needed {
            return Err(LaplaceError::PoseLength {
                pose,
                found,
                needed,
            });
        }
    }
    let limit = usize::from(u16::MAX);
    if needed + options.virtual_handles > limit {
        let count = needed + options.virtual_handles;
        return Err(LaplaceError::MarkerCount { count, limit });
    }
    let rest = surface.marker_rest();
    let at_rest = rest.iter().map(|&position| MarkerTarget {
        position,
        rotation: DQuat::IDENTITY,
    });
    let mut all = vec![at_rest.collect::<Vec<_>>()];
    all.extend_from_slice(poses);
    let exact: Vec<Vec<DVec3>> = all.iter().map(|pose| positions(surface, pose)).collect();

    let graph = Graph::new(&surface.positions, triangles);
    let chosen = graph.spread(&surface.markers, options.virtual_handles);
    let mut tables = CollapsedTables {
        marker_rest: rest.iter().map(|p| p.as_vec3().to_array()).collect(),
        marker_edges: surface.marker_edges.clone(),
        virtual_starts: vec![0],
        ..CollapsedTables::default()
    };
    fit_virtual_handles(surface, &chosen, &all, &exact, options, &mut tables);

    let handles: Vec<u32> = surface.markers.iter().chain(&chosen).copied().collect();
    let mut distances = surface.distances.clone();
    distances.extend(chosen.iter().map(|&v| graph.distances(&[v])));
    let frames: Vec<Vec<Frame>> = all
        .iter()
        .map(|targets| tables.handle_frames(surface, targets))
        .collect();
    tables.order = blocks::order(&surface.distances);
    tables.block_starts = vec![0];
    for vertices in tables.order.chunks(LANES) {
        let near = blocks::nearest(vertices, &distances, options.handles_a_block);
        let fit = Fit::new(&near, &handles, &frames, &surface.positions, options.ridge);
        let columns: Vec<Vec<[f64; 4]>> = vertices
            .iter()
            .map(|&vertex| {
                let weights = blocks::weights(vertex, &near, &distances);
                fit.solve(vertex as usize, &weights, &exact)
            })
            .collect();
        for (slot, &handle) in near.iter().enumerate() {
            tables.slot_handles.push(handle as u16);
            let mut coefficients = [[0.0; LANES]; 4];
            for (lane, column) in columns.iter().enumerate() {
                for (row, &value) in coefficients.iter_mut().zip(&column[slot]) {
                    row[lane] = value as f32;
                }
            }
            tables.slot_coefficients.push(coefficients);
        }
        tables.block_starts.push(tables.slot_handles.len() as u32);
        if !normals.is_empty() {
            // Lanes beyond the last vertex repeat it.
            let at = |lane: usize| normals[vertices[lane.min(vertices.len() - 1)] as usize];
            tables.rest_normals.push(
                [0, 1, 2].map(|axis| std::array::from_fn(|lane| at(lane).to_array()[axis] as f32)),
            );
        }
    }
    Ok(tables)
}

/// Fits with more and more handles until the surface in `held_out` poses is close enough, and says
/// how close: 8, 12, 16, then 24 handles a block. The last try is returned whatever it reaches.
/// `tolerance`: metres, what 99 of 100 vertices must stay below. Cost as [`collapse`], four times
/// at worst.
///
/// # Errors
/// As [`collapse`].
pub fn collapse_within(
    surface: &Surface,
    triangles: &[[u32; 3]],
    normals: &[DVec3],
    poses: &[Vec<MarkerTarget>],
    held_out: &[Vec<MarkerTarget>],
    tolerance: f64,
) -> Result<(CollapsedTables, CollapseOptions, CollapseReport), LaplaceError> {
    let mut handles_a_block = 8;
    loop {
        let options = CollapseOptions {
            handles_a_block,
            ..CollapseOptions::default()
        };
        let tables = collapse(surface, triangles, normals, poses, &options)?;
        let report = tables.compare(surface, held_out);
        handles_a_block = match handles_a_block {
            8 => 12,
            12 => 16,
            16 => 24,
            _ => return Ok((tables, options, report)),
        };
        if report.percentile_99 <= tolerance {
            return Ok((tables, options, report));
        }
    }
}

/// Appends rows for virtual handles at `chosen` vertices.
fn fit_virtual_handles(
    surface: &Surface,
    chosen: &[u32],
    poses: &[Vec<MarkerTarget>],
    exact: &[Vec<DVec3>],
    options: &CollapseOptions,
    tables: &mut CollapsedTables,
) {
    let frames: Vec<Vec<Frame>> = poses
        .iter()
        .map(|targets| {
            let frame = |target: &MarkerTarget| Frame {
                rotation: DMat3::from_quat(target.rotation),
                position: target.position,
            };
            targets.iter().map(frame).collect()
        })
        .collect();
    for &vertex in chosen {
        let near = blocks::nearest(
            &[vertex],
            &surface.distances,
            options.markers_a_virtual_handle,
        );
        let fit = Fit::new(
            &near,
            &surface.markers,
            &frames,
            &surface.positions,
            options.ridge,
        );
        let weights = blocks::weights(vertex, &near, &surface.distances);
        let coefficients = fit.solve(vertex as usize, &weights, exact);
        let turn = |marker: usize| surface.weights[marker][vertex as usize];
        let sum: f64 = near.iter().map(|&marker| turn(marker)).sum();
        for (&marker, coefficients) in near.iter().zip(coefficients) {
            tables.virtual_markers.push(marker as u16);
            tables.virtual_turns.push((turn(marker) / sum) as f32);
            let coefficients = coefficients.map(|value| value as f32);
            tables.virtual_coefficients.push(coefficients);
        }
        tables
            .virtual_starts
            .push(tables.virtual_markers.len() as u32);
    }
}
