//! The solve as fixed sums over handles, fitted to exact solutions.
//!
//! Virtual handles are spread over the surface between the markers. Each is moved by the markers
//! near it; each block of eight vertices by the handles near it. Both fits are least squares over
//! the exact solutions of the user's poses, with a pull toward blended rigid motion, so that poses
//! which were not fitted stay sane. Both reproduce rigid motion of the whole body exactly.

pub(crate) mod blocks;
pub(super) mod least_squares;
mod tables;

use glam::{DMat3, DQuat, DVec3};
use sinew_core::asset::LANES;

use self::least_squares::{Fit, Frame};
pub use self::tables::CollapsedTables;
use super::graph::Graph;
use super::rig::lanes;
use super::volume::Restorer;
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
    /// Fit to poses whose volume was restored ([`super::volume`]).
    pub keep_volume: bool,
}

impl Default for CollapseOptions {
    fn default() -> Self {
        Self {
            virtual_handles: 100,
            markers_a_virtual_handle: 16,
            handles_a_block: 8,
            ridge: 1e-6,
            keep_volume: false,
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
    let exact = shapes(surface, triangles, &all, options);

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
            tables
                .rest_normals
                .push(lanes(vertices, |vertex| normals[vertex]));
        }
    }
    Ok(tables)
}

/// The surfaces to fit to.
fn shapes(
    surface: &Surface,
    triangles: &[[u32; 3]],
    poses: &[Vec<MarkerTarget>],
    options: &CollapseOptions,
) -> Vec<Vec<DVec3>> {
    let mut shapes: Vec<Vec<DVec3>> = poses.iter().map(|pose| positions(surface, pose)).collect();
    if options.keep_volume {
        let restorer = Restorer::new(&surface.positions, triangles);
        shapes.iter_mut().for_each(|shape| restorer.restore(shape));
    }
    shapes
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
    start: &CollapseOptions,
    tolerance: f64,
) -> Result<(CollapsedTables, CollapseOptions, CollapseReport), LaplaceError> {
    let exact = shapes(surface, triangles, held_out, start);
    let mut handles_a_block = 8;
    loop {
        let options = CollapseOptions {
            handles_a_block,
            ..*start
        };
        let tables = collapse(surface, triangles, normals, poses, &options)?;
        let report = tables.compare_with(surface, held_out, &exact);
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
