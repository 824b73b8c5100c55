//! Vertices into blocks of eight that share as few binds as possible.

use std::collections::BTreeMap;

use sinew_core::asset::{LANES, WEIGHT_ONE};

use crate::model::Skin;

/// Blocks in the order of the asset.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// Source vertex of every vertex in block order.
    pub order: Vec<u32>,
    /// Slots of each block.
    pub blocks: Vec<Vec<Slot>>,
    /// Largest change of a weight by rounding.
    pub weight_error: f64,
}

/// A bind and what it weighs in each of the eight vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The bind.
    pub bind: u16,
    /// Sums over a block's slots to [`WEIGHT_ONE`] in every lane.
    pub weights: [u16; LANES],
}

/// Rounded weights of one vertex, by bind.
type Weights = Vec<(u16, u16)>;

/// Sorts vertices by the set of binds that move them and cuts blocks of eight.
///
/// Vertices that share a set fill blocks by themselves; what remains of each set (fewer than
/// eight) is joined with the sets that add the fewest binds.
/// O(vertices log vertices + blocks x sets).
#[must_use]
pub fn arrange(skin: &Skin) -> Blocks {
    let mut weight_error = 0.0_f64;
    let weights: Vec<Weights> = skin
        .influences
        .iter()
        .map(|influences| round(influences, &mut weight_error))
        .collect();
    let mut sets: BTreeMap<Vec<u16>, Vec<u32>> = BTreeMap::new();
    for (vertex, weights) in weights.iter().enumerate() {
        let set = weights.iter().map(|&(bind, _)| bind).collect();
        sets.entry(set).or_default().push(vertex as u32);
    }
    let mut members: Vec<Vec<u32>> = Vec::new();
    let mut rest: Vec<(Vec<u16>, Vec<u32>)> = Vec::new();
    for (set, vertices) in sets {
        let (full, left) = vertices.as_chunks::<LANES>();
        members.extend(full.iter().map(|block| block.to_vec()));
        if !left.is_empty() {
            rest.push((set, left.to_vec()));
        }
    }
    join_leftovers(rest, &mut members);
    // Only the last block may be short. The others go by the number of binds, so that the core
    // runs one loop for many, then by the binds, so that neighbours use the same matrices.
    let short = members
        .iter()
        .position(|block| block.len() < LANES)
        .map(|at| members.remove(at));
    members.sort_by_cached_key(|block| {
        let binds = union(block, &weights);
        (binds.len(), binds, block[0])
    });
    members.extend(short);
    Blocks {
        blocks: members.iter().map(|block| slots(block, &weights)).collect(),
        order: members.concat(),
        weight_error,
    }
}

/// Cuts blocks from sets of fewer than [`LANES`] vertices, largest set first.
fn join_leftovers(mut rest: Vec<(Vec<u16>, Vec<u32>)>, members: &mut Vec<Vec<u32>>) {
    rest.sort_by_key(|(set, vertices)| (std::cmp::Reverse(set.len()), vertices[0]));
    let mut rest: std::collections::VecDeque<_> = rest.into();
    while let Some((mut set, mut block)) = rest.pop_front() {
        while block.len() < LANES && !rest.is_empty() {
            let added = |other: &[u16]| other.iter().filter(|bind| !set.contains(bind)).count();
            let best = rest
                .iter()
                .enumerate()
                .min_by_key(|(_, (other, vertices))| {
                    let fits = vertices.len() <= LANES - block.len();
                    (added(other), !fits, std::cmp::Reverse(vertices.len()))
                })
                .map(|(at, _)| at);
            let Some(at) = best else { break };
            let (other, vertices) = &mut rest[at];
            for bind in other.iter() {
                if !set.contains(bind) {
                    set.push(*bind);
                }
            }
            let take = vertices.len().min(LANES - block.len());
            block.extend(vertices.drain(..take));
            if vertices.is_empty() {
                rest.remove(at);
            }
        }
        members.push(block);
    }
}

impl Blocks {
    /// Stretches of blocks with the same number of slots: first block, blocks, slots of each,
    /// first slot.
    #[must_use]
    pub fn runs(&self) -> Vec<[u32; 4]> {
        let (mut runs, mut block, mut slot) = (Vec::new(), 0, 0);
        for run in self.blocks.chunk_by(|a, b| a.len() == b.len()) {
            let (blocks, slots) = (run.len() as u32, run[0].len() as u32);
            runs.push([block, blocks, slots, slot]);
            block += blocks;
            slot += blocks * slots;
        }
        runs
    }
}

/// All binds of a block, ascending.
fn union(block: &[u32], weights: &[Weights]) -> Vec<u16> {
    let all = block.iter().flat_map(|&vertex| &weights[vertex as usize]);
    let mut binds: Vec<u16> = all.map(|&(bind, _)| bind).collect();
    binds.sort_unstable();
    binds.dedup();
    binds
}

fn slots(block: &[u32], weights: &[Weights]) -> Vec<Slot> {
    let lane = |lane: usize| block.get(lane).or(block.last());
    let of = |lane_vertex: Option<&u32>, bind: u16| {
        let row = lane_vertex.map(|&vertex| &weights[vertex as usize]);
        row.and_then(|row| row.iter().find(|(other, _)| *other == bind))
            .map_or(0, |&(_, weight)| weight)
    };
    union(block, weights)
        .into_iter()
        .map(|bind| Slot {
            bind,
            weights: std::array::from_fn(|at| of(lane(at), bind)),
        })
        .collect()
}

/// Weights as integers that sum to [`WEIGHT_ONE`], by largest remainder; ascending by bind,
/// without those that round to zero.
pub(crate) fn round(influences: &[(u32, f64)], worst: &mut f64) -> Weights {
    let one = f64::from(WEIGHT_ONE);
    let mut rows: Vec<(u16, u16, f64)> = influences
        .iter()
        .map(|&(bind, weight)| {
            let exact = weight * one;
            (bind as u16, exact as u16, exact.fract())
        })
        .collect();
    let sum: u32 = rows.iter().map(|&(_, weight, _)| u32::from(weight)).sum();
    let missing = u32::from(WEIGHT_ONE).saturating_sub(sum) as usize;
    rows.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
    let count = rows.len();
    for at in 0..missing {
        rows[at % count].1 += 1;
    }
    for (&(bind, weight), rounded) in influences.iter().zip(std::iter::repeat(&rows)) {
        let found = rounded.iter().find(|row| row.0 == bind as u16);
        let found = found.map_or(0.0, |row| f64::from(row.1) / one);
        *worst = worst.max((weight - found).abs());
    }
    let mut kept: Weights = rows
        .into_iter()
        .filter(|&(_, weight, _)| weight > 0)
        .map(|(bind, weight, _)| (bind, weight))
        .collect();
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skin(influences: Vec<Vec<(u32, f64)>>) -> Skin {
        Skin {
            binds: Vec::new(),
            influences,
        }
    }

    #[test]
    fn rounded_weights_sum_exactly() {
        let mut worst = 0.0;
        let third = 1.0 / 3.0;
        let rows = round(&[(4, third), (1, third), (9, third)], &mut worst);
        assert_eq!(rows, [(1, 21845), (4, 21845), (9, 21845)]);
        assert!(worst < 1e-9);
        let rows = round(&[(4, 0.3), (1, 0.3), (9, 0.4)], &mut worst);
        assert_eq!(rows, [(1, 19661), (4, 19660), (9, 26214)]);
        assert!(worst < 1.0 / 65535.0);
        assert_eq!(round(&[(0, 1.0), (1, 1e-9)], &mut worst), [(0, 65535)]);
    }

    #[test]
    fn vertices_of_one_set_share_blocks() {
        // Two sets, interleaved; nine vertices of the first, seven of the second.
        let influences = (0..16)
            .map(|v| vec![(u32::from(v % 2 == 1 && v < 14), 1.0)])
            .collect();
        let blocks = arrange(&skin(influences));
        assert_eq!(blocks.blocks.len(), 2);
        let slot_counts: Vec<_> = blocks.blocks.iter().map(Vec::len).collect();
        assert_eq!(slot_counts.iter().sum::<usize>(), 3);
        let mut order = blocks.order.clone();
        order.sort_unstable();
        assert_eq!(order, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn the_short_block_is_last_and_repeats_its_last_vertex() {
        let influences = (0..10).map(|v| vec![(v / 9, 1.0)]).collect();
        let blocks = arrange(&skin(influences));
        assert_eq!(blocks.blocks.len(), 2);
        for block in &blocks.blocks {
            for lane in 0..LANES {
                let sum: u32 = block.iter().map(|slot| u32::from(slot.weights[lane])).sum();
                assert_eq!(sum, u32::from(WEIGHT_ONE));
            }
        }
        assert_eq!(blocks.blocks[0].len(), 1);
        assert_eq!(blocks.blocks[1].len(), 2);
    }
}
