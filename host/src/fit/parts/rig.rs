//! Tables from markers to part frames.

use glam::DVec3;
use sinew_core::asset::NO_PARENT;

use super::tables::RigTables;
use super::{Glued, Segments};

/// Members of a part count by their squared weight, from this weight on.
const LEAST_WEIGHT: f64 = 0.1;
/// How much a joint counts among the markers of a part.
const PIVOT_WEIGHT: f32 = 0.5;
/// Most parts that carry a marker.
const MOST_CARRIERS: usize = 4;

/// Tables for parts whose frames follow markers weighted by their squared weights: flesh near a
/// joint moves with neither side and hardly counts. `rest`: `[markers]`, metres.
#[must_use]
pub fn tables(segments: &Segments, markers: &[Glued], rest: &[DVec3], limit: f64) -> RigTables {
    let rows: Vec<Vec<(u32, f64)>> = markers.iter().map(|marker| segments.at(marker)).collect();
    let parent = |parent: &Option<usize>| parent.map_or(NO_PARENT, |parent| parent as u16);
    let pivot = |pivot: &Option<DVec3>| {
        let [x, y, z] = pivot.unwrap_or_default().as_vec3().to_array();
        [x, y, z, if pivot.is_some() { PIVOT_WEIGHT } else { 0.0 }]
    };
    let mut tables = RigTables {
        rest: rest.iter().map(|p| p.as_vec3().to_array()).collect(),
        parents: segments.parents.iter().map(parent).collect(),
        pivots: segments.pivots.iter().map(pivot).collect(),
        member_starts: vec![0],
        carrier_starts: vec![0],
        residual_limit: limit as f32,
        ..RigTables::default()
    };
    for part in 0..segments.part_count() {
        for (marker, row) in rows.iter().enumerate() {
            let own = row.iter().find(|&&(other, _)| other as usize == part);
            if let Some(&(_, weight)) = own
                && weight >= LEAST_WEIGHT
            {
                tables.member_markers.push(marker as u16);
                tables.member_weights.push((weight * weight) as f32);
            }
        }
        tables
            .member_starts
            .push(tables.member_markers.len() as u32);
    }
    for row in &rows {
        let kept = &row[..row.len().min(MOST_CARRIERS)];
        let sum: f64 = kept.iter().map(|(_, weight)| weight).sum();
        for &(part, weight) in kept {
            tables.carrier_parts.push(part as u16);
            tables.carrier_weights.push((weight / sum) as f32);
        }
        tables
            .carrier_starts
            .push(tables.carrier_parts.len() as u32);
    }
    tables
}
