//! Vertices into blocks of eight: small patches of the surface that few parts and markers move.

use std::collections::HashMap;

use glam::DVec3;
use sinew_core::asset::{LANES, Lanes3};

use super::tables::BlockTables;
use crate::bake::blocks::round;
use crate::fit::laplace::collapse::blocks;

/// `[vertices]`: vertices patch by patch. `distances`: `[markers][vertices]` along the surface.
#[must_use]
pub fn by_surface(distances: &[Vec<f32>]) -> Vec<u32> {
    blocks::order(distances)
}

/// Patch by patch among vertices that the same parts move, so that blocks have few slots.
#[must_use]
pub fn by_parts(by_surface: &[u32], weights: &[Vec<(u32, f64)>]) -> Vec<u32> {
    let set = |vertex: u32| {
        let mut set: Vec<u32> = weights[vertex as usize].iter().map(|w| w.0).collect();
        set.sort_unstable();
        set
    };
    let mut order = by_surface.to_vec();
    // Stable, so patches stay together.
    order.sort_by_cached_key(|&vertex| set(vertex));
    order
}

/// The blocks of an order with their parts: `weights` `[vertices]`, `positions` and `normals` at
/// rest.
#[must_use]
pub fn tables(
    order: Vec<u32>,
    weights: &[Vec<(u32, f64)>],
    positions: &[DVec3],
    normals: &[DVec3],
) -> BlockTables {
    let mut out = BlockTables {
        starts: vec![0],
        ..BlockTables::default()
    };
    for vertices in order.chunks(LANES) {
        // Lanes beyond the last vertex repeat it.
        let lane = |lane: usize| vertices[lane.min(vertices.len() - 1)] as usize;
        let lanes = |values: &[DVec3]| -> Lanes3 {
            [0, 1, 2].map(|axis| std::array::from_fn(|at| values[lane(at)][axis] as f32))
        };
        out.positions.push(lanes(positions));
        out.normals.push(lanes(normals));
        let mut slots: HashMap<u16, [u16; LANES]> = HashMap::new();
        for at in 0..LANES {
            for (part, weight) in round(&weights[lane(at)], &mut 0.0) {
                slots.entry(part).or_default()[at] = weight;
            }
        }
        let mut slots: Vec<(u16, [u16; LANES])> = slots.into_iter().collect();
        slots.sort_unstable();
        for (part, weights) in slots {
            out.parts.push(part);
            out.weights.push(weights);
        }
        out.starts.push(out.parts.len() as u32);
    }
    out.order = order;
    out
}
