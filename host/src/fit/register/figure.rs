//! A rig as something that can be posed and resized, with derivatives.
//!
//! Everything is told in mesh space as a change since the mesh was bound: node `j` turns by `Q_j`
//! and grows by `s_j` about its origin `o_j`, so `v' = sum_j w_j (o'_j + s_j Q_j (v - o_j))` and
//! `o'_child = o'_j + s_j Q_j (o_child - o_j)`. Joints that carry little skin move with the joint
//! above them.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::fit::{Humanoid, Part, Role, Which};
use crate::model::Avatar;

/// A joint that carries less of the surface than this is no node of its own.
const LEAST_SHARE: f64 = 0.004;

/// Nodes of a rig and what they carry.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// `[nodes]`: where each turns, mesh space, metres.
    pub origins: Vec<DVec3>,
    /// `[nodes]`: smaller than the node's own index; none for the first.
    pub parents: Vec<Option<usize>>,
    /// `[nodes]`: which size each has; both sides of a body share one.
    pub groups: Vec<usize>,
    /// How many sizes there are.
    pub group_count: usize,
    /// `[nodes]`: standard deviation expected of a turn, radians.
    pub freedom: Vec<f64>,
    /// `[joints]`: the node that each joint moves with.
    pub node_of: Vec<usize>,
    /// `[joints]`: joint to mesh space when the mesh was bound.
    pub bind: Vec<DAffine3>,
    /// `[vertices]`: (node, weight).
    pub influences: Vec<Vec<(usize, f64)>>,
    /// What the joints are, if the body is human.
    pub human: Option<Humanoid>,
}

/// A pose: turns relative to the node above, sizes as logarithms.
#[derive(Clone, Debug)]
pub(super) struct Stance {
    /// `[nodes]`
    pub turns: Vec<DQuat>,
    /// `[groups]`
    pub growth: Vec<f64>,
    /// Of the whole body.
    pub scale: f64,
    /// Where the first node is, metres.
    pub place: DVec3,
}

/// A stance in the space of the markers.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// `[nodes]`: turn since the bind pose.
    pub turns: Vec<DQuat>,
    /// `[nodes]`: factor of size.
    pub sizes: Vec<f64>,
    /// `[nodes]`: metres.
    pub origins: Vec<DVec3>,
}

/// How a point moves with the parameters of a stance.
#[derive(Clone, Debug, Default)]
pub(super) struct Motion {
    /// `[nodes]`: the point turns about each node as `turn x lever`.
    pub levers: Vec<DVec3>,
    /// `[groups]`: velocity by the logarithm of each size.
    pub growth: Vec<DVec3>,
    /// Velocity by the logarithm of the whole body's size.
    pub scale: DVec3,
}

/// `[joints]`: joint to mesh space when the mesh was bound; joints without a bind stand as the rest
/// pose has them.
pub(super) fn bind_pose(avatar: &Avatar) -> Vec<DAffine3> {
    let joints = &avatar.skeleton.joints;
    let mut bind: Vec<DAffine3> = Vec::with_capacity(joints.len());
    for (index, joint) in joints.iter().enumerate() {
        let stated = avatar.skin.binds.iter().find(|bind| bind.joint == index);
        let above = joint
            .parent
            .map_or(DAffine3::IDENTITY, |parent| bind[parent]);
        bind.push(stated.map_or(above * joint.rest.affine(), |bind| {
            bind.inverse_bind.inverse()
        }));
    }
    bind
}

impl Figure {
    /// The nodes of a rigged body. O(vertices + joints)
    pub fn new(avatar: &Avatar) -> Self {
        let joints = &avatar.skeleton.joints;
        let bind = bind_pose(avatar);
        let human = Humanoid::new(&avatar.skeleton, Which::Target).ok();
        let shares = shares(avatar);
        let (mut origins, mut parents, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
        let mut node_of: Vec<usize> = Vec::with_capacity(joints.len());
        for (index, joint) in joints.iter().enumerate() {
            let above = joint.parent.map_or(0, |parent| node_of[parent]);
            if index == 0 || shares[index] >= LEAST_SHARE {
                node_of.push(origins.len());
                parents.push((index > 0).then_some(above));
                origins.push(bind[index].translation);
                chosen.push(index);
            } else {
                node_of.push(above);
            }
        }
        let (groups, group_count) = groups(&chosen, human.as_ref());
        let freedom = chosen.iter().map(|&joint| freedom(joint, human.as_ref()));
        let merge = |list: &Vec<(u32, f64)>| {
            let mut merged: Vec<(usize, f64)> = Vec::new();
            for &(at, weight) in list {
                let node = node_of[avatar.skin.binds[at as usize].joint];
                match merged.iter_mut().find(|(known, _)| *known == node) {
                    Some((_, sum)) => *sum += weight,
                    None => merged.push((node, weight)),
                }
            }
            merged
        };
        Self {
            groups,
            group_count,
            freedom: freedom.collect(),
            influences: avatar.skin.influences.iter().map(merge).collect(),
            origins,
            parents,
            node_of,
            bind,
            human,
        }
    }

    /// As the mesh was bound.
    pub fn bound(&self) -> Stance {
        Stance {
            turns: vec![DQuat::IDENTITY; self.origins.len()],
            growth: vec![0.0; self.group_count],
            scale: 0.0,
            place: self.origins[0],
        }
    }

    /// Where the nodes are. O(nodes)
    pub fn place(&self, stance: &Stance) -> Placed {
        let mut placed = Placed {
            turns: Vec::with_capacity(self.origins.len()),
            sizes: Vec::with_capacity(self.origins.len()),
            origins: Vec::with_capacity(self.origins.len()),
        };
        for (node, &parent) in self.parents.iter().enumerate() {
            let (turn, origin) = match parent {
                None => (stance.turns[node], stance.place),
                Some(above) => {
                    let arm = self.origins[node] - self.origins[above];
                    let turned = placed.turns[above] * arm * placed.sizes[above];
                    (
                        (placed.turns[above] * stance.turns[node]).normalize(),
                        placed.origins[above] + turned,
                    )
                }
            };
            placed.turns.push(turn);
            placed.origins.push(origin);
            let size = stance.scale + stance.growth[self.groups[node]];
            placed.sizes.push(size.exp());
        }
        placed
    }

    /// A point of the bound mesh as one node carries it.
    fn carried(&self, placed: &Placed, node: usize, rest: DVec3) -> DVec3 {
        placed.origins[node] + placed.turns[node] * (rest - self.origins[node]) * placed.sizes[node]
    }

    /// `[vertices]`: the posed mesh. O(influences)
    pub fn pose(&self, placed: &Placed, rest: &[DVec3]) -> Vec<DVec3> {
        let vertices = rest.iter().zip(&self.influences);
        let point = |(&rest, list): (&DVec3, &Vec<(usize, f64)>)| {
            let parts = list.iter();
            parts
                .map(|&(node, weight)| weight * self.carried(placed, node, rest))
                .sum()
        };
        vertices.map(point).collect()
    }

    /// How a point of a triangle moves. O(influences x depth)
    pub fn motion(
        &self,
        placed: &Placed,
        rest: &[DVec3],
        corners: [u32; 3],
        barycentric: [f64; 3],
    ) -> Motion {
        let mut motion = Motion {
            levers: vec![DVec3::ZERO; self.origins.len()],
            growth: vec![DVec3::ZERO; self.group_count],
            scale: DVec3::ZERO,
        };
        for (&vertex, share) in corners.iter().zip(barycentric) {
            for &(node, weight) in &self.influences[vertex as usize] {
                let weight = weight * share;
                let point = self.carried(placed, node, rest[vertex as usize]);
                let mut at = node;
                let mut tip = point;
                loop {
                    let origin = placed.origins[at];
                    motion.levers[at] += weight * (point - origin);
                    motion.growth[self.groups[at]] += weight * (tip - origin);
                    tip = origin;
                    match self.parents[at] {
                        Some(above) => at = above,
                        None => break,
                    }
                }
                motion.scale += weight * (point - placed.origins[0]);
            }
        }
        motion
    }

    /// `[vertices]`: the node that moves each most.
    pub fn heaviest(&self) -> Vec<usize> {
        let of = |list: &Vec<(usize, f64)>| {
            let most = list.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            most.map_or(0, |&(node, _)| node)
        };
        self.influences.iter().map(of).collect()
    }

    /// Whether two nodes are one, or joined.
    pub fn are_near(&self, a: usize, b: usize) -> bool {
        let above = |node: usize| self.parents[node];
        a == b
            || above(a) == Some(b)
            || above(b) == Some(a)
            || (above(a).is_some() && above(a) == above(b) && self.is_short(a) && self.is_short(b))
    }

    /// Whether a node hangs close to the one above, as hips and clavicles do: then those beside it
    /// are its neighbours too.
    fn is_short(&self, node: usize) -> bool {
        let tall = self.height();
        self.parents[node]
            .is_some_and(|above| self.origins[node].distance(self.origins[above]) < 0.12 * tall)
    }

    fn height(&self) -> f64 {
        let low = self.origins.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
        let high = self
            .origins
            .iter()
            .fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
        (high - low).max_element()
    }
}

impl Stance {
    /// Moves by `step`: place (3), scale, growth (groups), turns in the markers' space (3 a node).
    pub fn advance(&mut self, figure: &Figure, placed: &Placed, step: &[f64]) {
        self.place += DVec3::from_slice(&step[..3]);
        self.scale += step[3];
        let (growth, turns) = step[4..].split_at(self.growth.len());
        for (size, step) in self.growth.iter_mut().zip(growth) {
            *size += step;
        }
        for (node, turn) in turns.chunks_exact(3).enumerate() {
            let by = DQuat::from_scaled_axis(DVec3::from_slice(turn));
            let above = figure.parents[node].map_or(DQuat::IDENTITY, |at| placed.turns[at]);
            self.turns[node] = (above.inverse() * by * above * self.turns[node]).normalize();
        }
    }
}

/// `[joints]`: the share of the surface's area that each moves.
fn shares(avatar: &Avatar) -> Vec<f64> {
    let mut shares = vec![0.0; avatar.skeleton.joints.len()];
    let mut total = 0.0;
    for triangle in &avatar.mesh.triangles {
        let [a, b, c] = triangle.map(|at| avatar.mesh.positions[at as usize]);
        let area = (b - a).cross(c - a).length() / 6.0;
        for &corner in triangle {
            for &(bind, weight) in &avatar.skin.influences[corner as usize] {
                shares[avatar.skin.binds[bind as usize].joint] += weight * area;
                total += weight * area;
            }
        }
    }
    if total > 0.0 {
        shares.iter_mut().for_each(|share| *share /= total);
    }
    shares
}

/// Nodes of the same limb on both sides have one size, all others their own.
fn groups(chosen: &[usize], human: Option<&Humanoid>) -> (Vec<usize>, usize) {
    let mut known: Vec<(Option<Part>, usize)> = Vec::new();
    let mut groups = Vec::with_capacity(chosen.len());
    for &joint in chosen {
        let part = part_of(joint, human);
        let found = known
            .iter()
            .find(|(known, _)| part.is_some() && *known == part);
        let group = found.map_or(known.len(), |&(_, group)| group);
        if found.is_none() {
            known.push((part, group));
        }
        groups.push(group);
    }
    (groups, known.len())
}

fn part_of(joint: usize, human: Option<&Humanoid>) -> Option<Part> {
    let roles = human.iter().flat_map(|human| &human.roles);
    roles.into_iter().find_map(|(role, &plays)| match role {
        Role::Limb(_, part) if plays == joint => Some(*part),
        _ => None,
    })
}

/// How far a joint is expected to be turned, radians.
fn freedom(joint: usize, human: Option<&Humanoid>) -> f64 {
    match (human, part_of(joint, human)) {
        (None, _) => 0.5,
        (_, Some(Part::UpperArm | Part::LowerArm | Part::UpperLeg | Part::LowerLeg)) => 0.8,
        (_, Some(Part::Hand | Part::Foot)) => 0.35,
        _ => 0.2,
    }
}

/// The matrix of `v -> a x v`.
pub(super) fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(0.0, a.z, -a.y),
        DVec3::new(-a.z, 0.0, a.x),
        DVec3::new(a.y, -a.x, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three nodes on a line, one vertex between the last two.
    fn arm() -> Figure {
        Figure {
            origins: vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X],
            parents: vec![None, Some(0), Some(1)],
            groups: vec![0, 1, 1],
            group_count: 2,
            freedom: vec![0.5; 3],
            node_of: vec![0, 1, 2],
            bind: vec![],
            influences: vec![vec![(1, 0.25), (2, 0.75)]; 3],
            human: None,
        }
    }

    #[test]
    fn nothing_changed_moves_nothing_and_a_turn_carries_what_hangs_below() {
        let (figure, rest) = (arm(), vec![DVec3::new(2.5, 0.5, 0.0); 3]);
        let still = figure.pose(&figure.place(&figure.bound()), &rest);
        assert!(still[0].distance(rest[0]) < 1e-15);
        let mut stance = figure.bound();
        stance.turns[0] = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let turned = figure.pose(&figure.place(&stance), &rest);
        assert!(turned[0].distance(DVec3::new(-0.5, 2.5, 0.0)) < 1e-15);
        stance.scale = 2f64.ln();
        let grown = figure.pose(&figure.place(&stance), &rest);
        assert!(grown[0].distance(DVec3::new(-1.0, 5.0, 0.0)) < 1e-12);
    }

    #[test]
    fn derivatives_are_those_of_small_steps() {
        let figure = arm();
        let rest = [
            DVec3::new(2.5, 0.5, 0.0),
            DVec3::new(1.5, -0.3, 0.2),
            DVec3::new(3.0, 0.1, 0.4),
        ];
        let share = [0.2, 0.3, 0.5];
        let mut stance = figure.bound();
        stance.turns = [0.3, -0.7, 0.4].map(DQuat::from_rotation_y).to_vec();
        stance.turns[1] *= DQuat::from_rotation_x(0.5);
        (stance.growth, stance.scale) = (vec![0.1, -0.2], 0.15);
        let placed = figure.place(&stance);
        let motion = figure.motion(&placed, &rest, [0, 1, 2], share);
        let point = |stance: &Stance| -> DVec3 {
            let posed = figure.pose(&figure.place(stance), &rest);
            posed.iter().zip(share).map(|(p, share)| *p * share).sum()
        };
        let before = point(&stance);
        for at in 0..4 + 2 + 9 {
            let mut step = vec![0.0; 15];
            step[at] = 1e-6;
            let mut moved = stance.clone();
            moved.advance(&figure, &placed, &step);
            let measured = (point(&moved) - before) / 1e-6;
            let stated = match at {
                0..3 => DVec3::AXES[at],
                3 => motion.scale,
                4 | 5 => motion.growth[at - 4],
                _ => DVec3::AXES[(at - 6) % 3].cross(motion.levers[(at - 6) / 3]),
            };
            assert!(
                measured.distance(stated) < 1e-5,
                "{at}: {measured} {stated}"
            );
        }
        let cross = cross_matrix(DVec3::new(1.0, 2.0, 3.0)) * DVec3::new(-1.0, 0.5, 2.0);
        assert_eq!(
            cross,
            DVec3::new(1.0, 2.0, 3.0).cross(DVec3::new(-1.0, 0.5, 2.0))
        );
    }
}
