//! The parametric relation of points and bones.
//!
//! Every point belongs to the bone `L(t) = A + b t` that is nearest to it; `t` says where along it.
//! In the middle it follows that bone alone. Towards an end it follows the joint that the bone shares
//! there more and more, up to a half at the joint, so that both sides meet (Mažrimas &
//! Beinaravičius, sections 4 and 8.2).

use super::super::humanoid::ancestors;
use super::super::inside::Inside;
use super::bones::{Bones, Segment};
use crate::model::Skeleton;

/// Part of a bone over which it shares points with the next one.
const SHARED: f64 = 0.2;

/// `[vertices of the surface]`: (joint, weight). O(vertices x bones)
pub(super) fn weights(inside: &Inside, skeleton: &Skeleton, bones: &Bones) -> Vec<Vec<(u32, f64)>> {
    let mut has_bone = vec![false; skeleton.joints.len()];
    for line in &bones.lines {
        has_bone[line.joint] = true;
    }
    // Joints in the same place as their parent have no bone; what is above them has.
    let above = |joint: usize| ancestors(skeleton, joint).find(|&above| has_bone[above]);
    let row = |point| {
        let project = |line| (line, Segment::project(line, point));
        let nearest = bones.lines.iter().map(project);
        let Some((line, (t, _))) = nearest.min_by(|a, b| a.1.1.total_cmp(&b.1.1)) else {
            return Vec::new();
        };
        let other = if t < SHARED {
            above(line.joint).map(|other| (other, t / SHARED))
        } else if t > 1.0 - SHARED {
            line.child.map(|other| (other, (1.0 - t) / SHARED))
        } else {
            None
        };
        match other {
            Some((other, away)) => {
                let share = 0.5 * (1.0 - away);
                vec![(line.joint as u32, 1.0 - share), (other as u32, share)]
            }
            None => vec![(line.joint as u32, 1.0)],
        }
    };
    inside.surface.positions.iter().map(|&at| row(at)).collect()
}
