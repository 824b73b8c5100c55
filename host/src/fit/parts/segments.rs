//! Near-rigid parts of a body and the weights with which vertices belong to them.

use glam::DVec3;

use super::Glued;
use crate::clean::linear::symmetric_eigen;
use crate::model::Avatar;

/// Markers that a part needs for a frame of its own.
const FEWEST_MARKERS: usize = 3;
/// A marker counts for a part from this weight on.
const BELONGS: f64 = 0.5;
/// Markers of a part must spread this far, metres, in a second direction too.
const SPREAD: f64 = 0.006;
/// Most parts that move a vertex.
const MOST_INFLUENCES: usize = 6;

/// Near-rigid parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Segments {
    /// `[parts]`: names for people.
    pub names: Vec<String>,
    /// `[parts]`: the part that leads there, before the part itself.
    pub parents: Vec<Option<usize>>,
    /// `[vertices]`: (part, weight), heaviest first; weights sum to one.
    pub vertex_weights: Vec<Vec<(u32, f64)>>,
}

impl Segments {
    /// Parts of a rigged body: a joint with enough markers is a part of its own, any other belongs
    /// to its parent's. O(vertices + joints markers)
    #[must_use]
    pub fn of_rig(avatar: &Avatar, markers: &[Glued]) -> Self {
        let joints = &avatar.skeleton.joints;
        let binds = &avatar.skin.binds;
        let rest: Vec<DVec3> = markers
            .iter()
            .map(|marker| marker.on(&avatar.mesh.positions))
            .collect();
        let of_vertices: Vec<Vec<(u32, f64)>> = avatar
            .skin
            .influences
            .iter()
            .map(|row| {
                let joint = |&(bind, weight): &(u32, f64)| (binds[bind as usize].joint as u32, weight);
                row.iter().map(joint).collect()
            })
            .collect();
        let of_markers: Vec<Vec<(u32, f64)>> = markers
            .iter()
            .map(|marker| glued_weights(marker, &of_vertices))
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
            let ours: Vec<DVec3> = rest
                .iter()
                .zip(&of_markers)
                .filter(|(_, row)| weight(row) >= BELONGS)
                .map(|(&at, _)| at)
                .collect();
            if ours.len() < FEWEST_MARKERS || second_spread(&ours) < SPREAD {
                into[joint] = parent;
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
            normalised(row.iter().map(|&(joint, w)| (part(joint as usize) as u32, w)))
        };
        Self {
            names: kept.iter().map(|&at| joints[at].name.clone()).collect(),
            parents: kept.iter().map(|&at| joints[at].parent.map(part)).collect(),
            vertex_weights: of_vertices.iter().map(of_parts).collect(),
        }
    }

    /// Parts by a label for each vertex, as a segmentation gives them; hard borders.
    /// `parents`: `[parts]`, each before the part itself.
    #[must_use]
    pub fn of_labels(labels: &[u32], names: Vec<String>, parents: Vec<Option<usize>>) -> Self {
        Self {
            names,
            parents,
            vertex_weights: labels.iter().map(|&label| vec![(label, 1.0)]).collect(),
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
        glued_weights(marker, &self.vertex_weights)
    }
}

fn root_of(into: &[usize], mut joint: usize) -> usize {
    while into[joint] != joint {
        joint = into[joint];
    }
    joint
}

fn glued_weights(marker: &Glued, of_vertices: &[Vec<(u32, f64)>]) -> Vec<(u32, f64)> {
    let corners = marker.vertices.iter().zip(marker.weights);
    let all = corners.flat_map(|(&vertex, share)| {
        let row = &of_vertices[vertex as usize];
        row.iter().map(move |&(part, weight)| (part, share * weight))
    });
    normalised(all)
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

/// Standard deviation in the second widest direction.
fn second_spread(points: &[DVec3]) -> f64 {
    let count = points.len().max(1) as f64;
    let middle = points.iter().sum::<DVec3>() / count;
    let mut covariance = vec![0.0; 9];
    for point in points {
        let d = (*point - middle).to_array();
        for (at, sum) in covariance.iter_mut().enumerate() {
            *sum += d[at / 3] * d[at % 3] / count;
        }
    }
    let (values, _) = symmetric_eigen(3, covariance);
    values[1].max(0.0).sqrt()
}
