//! Tables from markers to part frames.

use glam::DVec3;
use sinew_core::asset::NO_PARENT;

use super::tables::RigTables;
use super::{Glued, Segments};

/// Members of a part count by the fourth power of their weight, from this weight on.
const LEAST_WEIGHT: f64 = 0.1;
/// How much a joint counts in a part without markers.
const PIVOT_WEIGHT: f32 = 1.0;
/// Most parts that carry a marker.
const MOST_CARRIERS: usize = 4;

/// Tables for parts whose frames follow markers weighted by the fourth power of their weights:
/// flesh near a joint moves with neither side and hardly counts. `rest`: `[markers]`, metres.
#[must_use]
pub fn tables(segments: &Segments, markers: &[Glued], rest: &[DVec3], limit: f64) -> RigTables {
    let rows: Vec<Vec<(u32, f64)>> = markers.iter().map(|marker| segments.at(marker)).collect();
    let parent = |parent: &Option<usize>| parent.map_or(NO_PARENT, |parent| parent as u16);
    let pivot = |pivot: &Option<DVec3>| {
        let [x, y, z] = pivot.unwrap_or_default().as_vec3().to_array();
        [x, y, z, f32::from(u8::from(pivot.is_some()))]
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
                tables.member_weights.push(weight.powi(4) as f32);
            }
        }
        let first = tables.member_starts[part] as usize;
        let sum: f32 = tables.member_weights[first..].iter().sum();
        // Many markers know better than a joint that flesh may have moved.
        tables.pivots[part][3] *= PIVOT_WEIGHT / (1.0 + sum * sum);
        let end = tables.member_markers.len() as u32;
        tables.member_starts.push(end);
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
