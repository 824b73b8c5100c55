//! The parts of a rig.

use glam::DVec3;

use super::{SegmentReport, Segmentation, by_points};
use crate::fit::humanoid::SIDES;
use crate::fit::{Humanoid, Part, Role, Which};
use crate::model::Avatar;

/// Without a human body, a joint is a part if it moves this share of the surface.
const LEAST_SHARE: f64 = 0.01;
/// Limbs that are parts; clavicles belong to the chest, toes to the foot.
const LIMBS: [Part; 6] = [
    Part::UpperArm,
    Part::LowerArm,
    Part::Hand,
    Part::UpperLeg,
    Part::LowerLeg,
    Part::Foot,
];

/// Hard parts of a rigged body: of a human one hips, abdomen, chest, head, upper arms, forearms,
/// hands, thighs, shins and feet; of any other the joints that move at least a hundredth of the
/// surface. O(influences)
#[must_use]
pub fn parts_of_rig(avatar: &Avatar) -> Segmentation {
    let joints = &avatar.skeleton.joints;
    let mesh = &avatar.mesh;
    let corner = |at: u32| mesh.positions[at as usize];
    let areas: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|&[a, b, c]| {
            (corner(b) - corner(a))
                .cross(corner(c) - corner(a))
                .length()
                / 2.0
        })
        .collect();
    let mut shares = vec![0.0; joints.len()];
    for (triangle, area) in mesh.triangles.iter().zip(&areas) {
        for &at in triangle {
            for &(bind, weight) in &avatar.skin.influences[at as usize] {
                shares[avatar.skin.binds[bind as usize].joint] += weight * area / 3.0;
            }
        }
    }
    let total: f64 = areas.iter().sum();
    let kept: Vec<usize> = match Humanoid::new(&avatar.skeleton, Which::Target) {
        Ok(human) => of_human(&human),
        Err(_) => (0..joints.len())
            .filter(|&at| shares[at] >= LEAST_SHARE * total)
            .collect(),
    };
    // Every joint belongs to the nearest kept one above it; those above all of them to the first.
    let mut part_of = vec![0_usize; joints.len()];
    for (at, joint) in joints.iter().enumerate() {
        part_of[at] = match kept.binary_search(&at) {
            Ok(part) => part,
            Err(_) => joint.parent.map_or(0, |above| part_of[above]),
        };
    }
    let weight_of = |at: u32| {
        let mut sums = vec![0.0; kept.len().max(1)];
        for &(bind, weight) in &avatar.skin.influences[at as usize] {
            sums[part_of[avatar.skin.binds[bind as usize].joint]] += weight;
        }
        sums
    };
    let part = |triangle: &[u32; 3]| {
        let mut sums = vec![0.0; kept.len().max(1)];
        for &at in triangle {
            sums.iter_mut()
                .zip(weight_of(at))
                .for_each(|(sum, weight)| *sum += weight);
        }
        let most = (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b]).then(b.cmp(&a)));
        most.unwrap_or(0) as u32
    };
    let triangle_parts: Vec<u32> = mesh.triangles.iter().map(part).collect();
    let count = kept.len().max(1);
    let mut report = SegmentReport {
        shares: vec![0.0; count],
        ..SegmentReport::default()
    };
    for (&part, area) in triangle_parts.iter().zip(&areas) {
        report.shares[part as usize] += area / total;
    }
    let name = |&at: &usize| joints[at].name.clone();
    let parent = |(part, &at): (usize, &usize)| {
        let above = joints[at].parent.map(|above| part_of[above]);
        above
            .filter(|&above| above < part)
            .or((part > 0).then_some(0))
    };
    let point_parts = by_points(
        &triangle_parts,
        &mesh.triangles,
        &areas,
        mesh.positions.len(),
    );
    Segmentation {
        names: if kept.is_empty() {
            vec!["body".into()]
        } else {
            kept.iter().map(name).collect()
        },
        parents: if kept.is_empty() {
            vec![None]
        } else {
            kept.iter().enumerate().map(parent).collect()
        },
        triangle_parts,
        point_parts,
        report,
    }
}

/// Joints that are parts, ascending.
fn of_human(human: &Humanoid) -> Vec<usize> {
    let mut kept = vec![human.hips];
    if let [first, .., last] = human.spine[..] {
        kept.extend([first, last]);
    } else {
        kept.extend(&human.spine);
    }
    kept.extend(human.roles.get(&Role::Head));
    for side in SIDES {
        kept.extend(LIMBS.iter().filter_map(|&part| human.limb(side, part)));
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Parts carried over to another surface glued to the mesh: `[points]` of it lie in these triangles
/// of the mesh. A triangle takes the part of most of its corners.
#[must_use]
pub fn carried_over(
    of_mesh: &Segmentation,
    in_triangles: &[Option<usize>],
    rest: &[DVec3],
    triangles: &[[u32; 3]],
) -> Segmentation {
    let of_point = |at: &Option<usize>| at.map_or(0, |at| of_mesh.triangle_parts[at]);
    let point_parts: Vec<u32> = in_triangles.iter().map(of_point).collect();
    let of_triangle = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|at| point_parts[at as usize]);
        if b == c { b } else { a }
    };
    let triangle_parts: Vec<u32> = triangles.iter().map(of_triangle).collect();
    let mut report = SegmentReport {
        shares: vec![0.0; of_mesh.part_count()],
        ..SegmentReport::default()
    };
    let areas: Vec<f64> = triangles.iter().map(|t| super::area(rest, *t)).collect();
    let total: f64 = areas.iter().sum();
    for (&part, area) in triangle_parts.iter().zip(&areas) {
        report.shares[part as usize] += area / total;
    }
    Segmentation {
        names: of_mesh.names.clone(),
        parents: of_mesh.parents.clone(),
        triangle_parts,
        point_parts,
        report,
    }
}
