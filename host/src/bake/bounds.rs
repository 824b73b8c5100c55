//! Boxes of what binds move, from which the core finds the bounds of a posed avatar.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::model::{Mesh, Skin};

/// Boxes at rest, morph targets in full included, and correctives as far as they go.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RestBounds {
    /// `[binds]`: low and high corner; low above high where a bind moves nothing.
    pub boxes: Vec<[f64; 6]>,
    /// Two binds that move a vertex together, and the box of all such vertices.
    pub pairs: Vec<([u16; 2], [f64; 6])>,
}

const EMPTY: [f64; 6] = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0];

/// `wider`: metres by which stored positions may differ; `ranges`: least and largest weights of the
/// last morph targets, where they are not from 0 to 1. O(vertices x (influences^2 + morphs))
#[must_use]
pub fn rest_bounds(mesh: &Mesh, skin: &Skin, wider: f64, ranges: &[[f32; 2]]) -> RestBounds {
    let usual = mesh.morphs.len().saturating_sub(ranges.len());
    let range = |morph: usize| match morph.checked_sub(usual) {
        Some(at) => ranges[at].map(f64::from),
        None => [0.0, 1.0],
    };
    let mut boxes = vec![EMPTY; skin.binds.len()];
    let mut pairs: BTreeMap<[u16; 2], [f64; 6]> = BTreeMap::new();
    for (vertex, influences) in skin.influences.iter().enumerate() {
        let (mut low, mut high) = (mesh.positions[vertex], mesh.positions[vertex]);
        for (at, morph) in mesh.morphs.iter().enumerate() {
            let [least, most] = range(at).map(|weight| weight * morph.positions[vertex]);
            low += least.min(most).min(DVec3::ZERO);
            high += least.max(most).max(DVec3::ZERO);
        }
        let (low, high) = (low - wider, high + wider);
        for (at, &(bind, _)) in influences.iter().enumerate() {
            include(&mut boxes[bind as usize], low, high);
            for &(other, _) in &influences[at + 1..] {
                let pair = [bind.min(other) as u16, bind.max(other) as u16];
                include(pairs.entry(pair).or_insert(EMPTY), low, high);
            }
        }
    }
    RestBounds {
        boxes,
        pairs: pairs.into_iter().collect(),
    }
}

fn include(corners: &mut [f64; 6], low: DVec3, high: DVec3) {
    if corners[0] > corners[3] {
        *corners = [low.x, low.y, low.z, high.x, high.y, high.z];
        return;
    }
    for axis in 0..3 {
        corners[axis] = corners[axis].min(low[axis]);
        corners[axis + 3] = corners[axis + 3].max(high[axis]);
    }
}
