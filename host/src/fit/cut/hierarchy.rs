//! Parts that touch as joints that hang on each other.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use super::{Gap, Shell};
use crate::fit::laplace::nearest::Nearest;
use crate::fit::names;
use crate::fit::rig::parallel;
use crate::import::Transform;
use crate::model::{Joint, Skeleton};

/// Words that name the part on which all others hang.
const ROOT: [&str; 5] = ["hips", "hip", "pelvis", "root", "lowertorso"];

/// Parts that share edges already: gaps without width. O(triangles log triangles)
pub(super) fn touching(shell: &Shell) -> Vec<Gap> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * shell.triangles.len());
    for (&[a, b, c], &part) in shell.triangles.iter().zip(&shell.part_of_triangle) {
        edges.extend([[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], part)));
    }
    edges.sort_unstable();
    let mut sums: BTreeMap<[usize; 2], (DVec3, f64)> = BTreeMap::new();
    for pair in edges.windows(2) {
        let ([a, b], [first, second]) = (pair[0].0, [pair[0].1, pair[1].1]);
        if pair[0].0 == pair[1].0 && first != second {
            let [a, b] = [a, b].map(|v| shell.positions[v as usize]);
            let sum = sums.entry([first as usize, second as usize]).or_default();
            let length = a.distance(b);
            *sum = (sum.0 + length * (a + b) / 2.0, sum.1 + length);
        }
    }
    let gap = |(parts, (sum, length)): ([usize; 2], (DVec3, f64))| Gap {
        parts,
        width: 0.0,
        length,
        centre: sum / length,
    };
    sums.into_iter().map(gap).collect()
}

/// A joint a part: the skeleton, the joint of each part, and parts that hang on the nearest one for
/// want of a gap. The tree follows the longest borders (Prim 1957).
pub(super) fn skeleton(
    shell: &Shell,
    names: &[&str],
    gaps: &[Gap],
) -> (Skeleton, Vec<u32>, Vec<usize>) {
    let mut centres = vec![(DVec3::ZERO, 0.0_f64); names.len()];
    for gap in gaps {
        for part in gap.parts {
            centres[part] = (centres[part].0 + gap.centre, centres[part].1 + 1.0);
        }
    }
    let parsed = names::parse(names.iter().copied());
    let is_root = |part: &usize| {
        let name = &parsed[*part];
        name.side.is_none() && name.words.iter().any(|word| ROOT.contains(&word.as_str()))
    };
    let touched = (0..names.len()).filter(|&part| centres[part].1 > 0.0);
    let root = touched.clone().find(is_root);
    let most = || {
        touched
            .rev()
            .max_by(|&a, &b| centres[a].1.total_cmp(&centres[b].1))
    };
    let root = root.or_else(most).unwrap_or(0);

    let mut order = vec![root];
    let mut parent: Vec<Option<usize>> = vec![None; names.len()];
    let mut place = vec![centres[root].0 / centres[root].1.max(1.0); names.len()];
    let mut is_in = vec![false; names.len()];
    is_in[root] = true;
    loop {
        let onward = gaps
            .iter()
            .filter(|gap| is_in[gap.parts[0]] != is_in[gap.parts[1]]);
        let Some(gap) = onward.max_by(|a, b| a.length.total_cmp(&b.length)) else {
            break;
        };
        let [a, b] = gap.parts;
        let (above, below) = if is_in[a] { (a, b) } else { (b, a) };
        is_in[below] = true;
        (parent[below], place[below]) = (Some(above), gap.centre);
        order.push(below);
    }
    let attached = attach(shell, &is_in, &mut parent, &mut place);
    order.extend(&attached);

    let mut joint_of = vec![0_u32; names.len()];
    for (joint, &part) in order.iter().enumerate() {
        joint_of[part] = joint as u32;
    }
    let joint = |&part: &usize| Joint {
        name: names[part].to_owned(),
        parent: parent[part].map(|above| joint_of[above] as usize),
        rest: Transform {
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        },
    };
    let joints = Skeleton {
        joints: order.iter().map(joint).collect(),
    };
    let places: Vec<DVec3> = order.iter().map(|&part| place[part]).collect();
    (parallel(&joints, &places), joint_of, attached)
}

/// Hangs parts that are not in the tree on the part nearest to their middle.
fn attach(
    shell: &Shell,
    is_in: &[bool],
    parent: &mut [Option<usize>],
    place: &mut [DVec3],
) -> Vec<usize> {
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); is_in.len()];
    let (mut known, mut part_of) = (Vec::new(), Vec::new());
    for (&at, &part) in shell.positions.iter().zip(&shell.part_of) {
        let part = part as usize;
        sums[part] = (sums[part].0 + at, sums[part].1 + 1.0);
        if is_in[part] {
            known.push(at);
            part_of.push(part);
        }
    }
    let nearest = Nearest::new(&known);
    let loose: Vec<usize> = (0..is_in.len()).filter(|&part| !is_in[part]).collect();
    for &part in &loose {
        place[part] = sums[part].0 / sums[part].1.max(1.0);
        let near = nearest.find(place[part]);
        parent[part] = near.map(|(index, _)| part_of[index as usize]);
    }
    loose
}
