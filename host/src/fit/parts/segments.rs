//! Near-rigid parts of a body and the weights with which vertices belong to them.

use glam::DVec3;

use super::Glued;
use crate::model::Avatar;

/// Markers that a root needs for a frame of its own; other parts are held by a joint too.
const FEWEST_MARKERS: usize = 3;
/// A marker counts for a part from this weight on.
const BELONGS: f64 = 0.5;
/// Most parts that move a vertex.
const MOST_INFLUENCES: usize = 6;

/// Near-rigid parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Segments {
    /// `[parts]`: names for people.
    pub names: Vec<String>,
    /// `[parts]`: the part that leads there, before the part itself.
    pub parents: Vec<Option<usize>>,
    /// `[parts]`: the joint that holds the part to its parent, metres, where it is known.
    pub pivots: Vec<Option<DVec3>>,
    /// `[vertices]`: (part, weight), heaviest first; weights sum to one.
    pub vertex_weights: Vec<Vec<(u32, f64)>>,
    /// Whether these weights are smooth, as a rig's are, and not mere labels.
    pub smooth: bool,
}

impl Segments {
    /// Parts of a rigged body: a joint with enough markers is a part of its own, any other belongs
    /// to its parent's. O(vertices + joints markers)
    #[must_use]
    pub fn of_rig(avatar: &Avatar, markers: &[Glued]) -> Self {
        let joints = &avatar.skeleton.joints;
        let binds = &avatar.skin.binds;
        let of_vertices: Vec<Vec<(u32, f64)>> = avatar
            .skin
            .influences
            .iter()
            .map(|row| {
                let joint =
                    |&(bind, weight): &(u32, f64)| (binds[bind as usize].joint as u32, weight);
                row.iter().map(joint).collect()
            })
            .collect();
        let of_markers: Vec<Vec<(u32, f64)>> = markers
            .iter()
            .map(|marker| marker.weights_of(&of_vertices))
            .collect();
        // Joints merge into their parents from the tips on.
        let mut into: Vec<usize> = (0..joints.len()).collect();
        for joint in (0..joints.len()).rev() {
            let Some(parent) = joints[joint].parent else {
                continue;
            };
            let group: Vec<usize> = (0..joints.len())
                .filter(|&other| root_of(&into, other) == joint)
                .collect();
            let weight = |row: &Vec<(u32, f64)>| -> f64 {
                let ours = row.iter().filter(|(at, _)| group.contains(&(*at as usize)));
                ours.map(|(_, weight)| weight).sum()
            };
            let ours = of_markers
                .iter()
                .filter(|row| weight(row) >= BELONGS)
                .count();
            if ours == 0 {
                into[joint] = parent;
            }
        }
        // A root with too little to be seen takes its first child's markers.
        for joint in (0..joints.len()).rev() {
            let owned = |at: usize| {
                let own = |row: &&Vec<(u32, f64)>| {
                    let ours = row.iter().filter(|w| root_of(&into, w.0 as usize) == at);
                    ours.map(|w| w.1).sum::<f64>() >= BELONGS
                };
                of_markers.iter().filter(own).count()
            };
            if joints[joint].parent.is_none()
                && into[joint] == joint
                && owned(joint) < FEWEST_MARKERS
            {
                let child = (joint + 1..joints.len()).find(|&child| {
                    into[child] == child
                        && joints[child]
                            .parent
                            .is_some_and(|p| root_of(&into, p) == joint)
                });
                if let Some(child) = child {
                    into[child] = joint;
                }
            }
        }
        let kept: Vec<usize> = (0..joints.len())
            .filter(|&joint| into[joint] == joint)
            .collect();
        let part = |joint: usize| {
            let root = root_of(&into, joint);
            kept.binary_search(&root).unwrap_or(0)
        };
        let of_parts = |row: &Vec<(u32, f64)>| {
            normalised(
                row.iter()
                    .map(|&(joint, w)| (part(joint as usize) as u32, w)),
            )
        };
        Self {
            names: kept.iter().map(|&at| joints[at].name.clone()).collect(),
            parents: kept.iter().map(|&at| joints[at].parent.map(part)).collect(),
            pivots: kept
                .iter()
                .map(|&at| {
                    let bind = avatar.skin.binds.iter().find(|bind| bind.joint == at);
                    bind.map(|bind| bind.inverse_bind.inverse().translation)
                })
                .collect(),
            vertex_weights: of_vertices.iter().map(of_parts).collect(),
            smooth: true,
        }
    }

    /// Parts by a label for each vertex, as a segmentation gives them; hard borders.
    /// `parents`: `[parts]`, each before the part itself.
    #[must_use]
    pub fn of_labels(labels: &[u32], names: Vec<String>, parents: Vec<Option<usize>>) -> Self {
        Self {
            pivots: vec![None; names.len()],
            names,
            parents,
            vertex_weights: labels.iter().map(|&label| vec![(label, 1.0)]).collect(),
            smooth: false,
        }
    }

    /// Number of parts.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.names.len()
    }

    /// The weights at a glued marker.
    #[must_use]
    pub fn at(&self, marker: &Glued) -> Vec<(u32, f64)> {
        marker.weights_of(&self.vertex_weights)
    }
}

fn root_of(into: &[usize], mut joint: usize) -> usize {
    while into[joint] != joint {
        joint = into[joint];
    }
    joint
}

/// Sums weights of one part, keeps the heaviest few, makes them sum to one.
pub(super) fn normalised(weights: impl Iterator<Item = (u32, f64)>) -> Vec<(u32, f64)> {
    let mut row: Vec<(u32, f64)> = Vec::new();
    for (part, weight) in weights.filter(|&(_, weight)| weight > 1e-4) {
        match row.iter_mut().find(|(other, _)| *other == part) {
            Some((_, sum)) => *sum += weight,
            None => row.push((part, weight)),
        }
    }
    row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    row.truncate(MOST_INFLUENCES);
    let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
    for (_, weight) in &mut row {
        *weight /= sum;
    }
    row
}
