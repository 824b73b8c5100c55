//! Where the parts of a human body lie on its mesh.

use glam::{DAffine3, DVec3};

use super::StudioError;
use crate::fit::{Humanoid, Part, Role, Side, Which};
use crate::model::Avatar;

/// Height of the body that lengths here are stated for, metres.
const HEIGHT: f64 = 1.73;

/// A human body's landmarks in mesh space.
#[derive(Clone, Debug)]
pub(super) struct Anatomy {
    /// Which joint is what.
    pub human: Humanoid,
    /// `[joints]`: joint space to mesh space when the mesh was bound.
    pub bind: Vec<DAffine3>,
    /// Unit vectors of the body, orthogonal: to its left, up, and to the front.
    pub left: DVec3,
    pub up: DVec3,
    pub front: DVec3,
    /// Its height over that of the body that lengths are stated for.
    pub scale: f64,
    /// `[joints]`: the joint and all above it.
    lines: Vec<Vec<usize>>,
}

impl Anatomy {
    /// Understands a body by the names of its joints.
    ///
    /// # Errors
    /// A skeleton in which no human body is recognised, or one without extent.
    pub fn new(avatar: &Avatar) -> Result<Self, StudioError> {
        let human = Humanoid::new(&avatar.skeleton, Which::Target)?;
        let joints = &avatar.skeleton.joints;
        let mut bind: Vec<DAffine3> = Vec::with_capacity(joints.len());
        let mut lines: Vec<Vec<usize>> = Vec::with_capacity(joints.len());
        for (index, joint) in joints.iter().enumerate() {
            let stated = avatar.skin.binds.iter().find(|bind| bind.joint == index);
            let above = joint
                .parent
                .map_or(DAffine3::IDENTITY, |parent| bind[parent]);
            bind.push(stated.map_or(above * joint.rest.affine(), |bind| {
                bind.inverse_bind.inverse()
            }));
            let mut line = vec![index];
            line.extend(
                joint
                    .parent
                    .iter()
                    .flat_map(|&parent| lines[parent].clone()),
            );
            lines.push(line);
        }
        let at = |joint: usize| bind[joint].translation;
        let leg = |side| human.limb(side, Part::UpperLeg).map(at);
        let top = human
            .roles
            .get(&Role::Head)
            .or(human.neck.last())
            .or(human.spine.last());
        let no_place = |why: &str| StudioError::NoPlace {
            marker: "of the whole body".into(),
            why: why.into(),
        };
        let (Some(left_leg), Some(right_leg), Some(&top)) =
            (leg(Side::Left), leg(Side::Right), top)
        else {
            return Err(no_place("the body has no hips or no head"));
        };
        let middle = (left_leg + right_leg) / 2.0;
        let flat = || no_place("hips and head lie in one place");
        let up = (at(top) - middle).try_normalize().ok_or_else(flat)?;
        let across = (left_leg - right_leg).reject_from(up);
        let left = across.try_normalize().ok_or_else(flat)?;
        let heights = avatar
            .mesh
            .positions
            .iter()
            .map(|position| position.dot(up));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        Ok(Self {
            human,
            bind,
            left,
            up,
            front: left.cross(up),
            scale: (high - low) / HEIGHT,
            lines,
        })
    }

    /// A joint's place in mesh space.
    pub fn at(&self, joint: usize) -> DVec3 {
        self.bind[joint].translation
    }

    /// The joint of a limb.
    pub fn limb(&self, side: Side, part: Part) -> Option<usize> {
        self.human.limb(side, part)
    }

    /// The joint from which arms and neck go out.
    pub fn thorax(&self) -> usize {
        self.human.spine.last().copied().unwrap_or(self.human.hips)
    }

    /// The body's own direction to a side.
    pub fn outward(&self, side: Side) -> DVec3 {
        if side == Side::Left {
            self.left
        } else {
            -self.left
        }
    }

    /// Whether a joint is `top` or below it.
    pub fn is_below(&self, joint: usize, top: usize) -> bool {
        self.lines[joint].contains(&top)
    }

    /// `[vertices]`: the share of each vertex's weight on joints that `chosen` names.
    pub fn membership(&self, avatar: &Avatar, chosen: impl Fn(usize) -> bool) -> Vec<f64> {
        let of = |list: &Vec<(u32, f64)>| {
            let on = |&&(bind, _): &&(u32, f64)| chosen(avatar.skin.binds[bind as usize].joint);
            list.iter().filter(on).map(|(_, weight)| weight).sum()
        };
        avatar.skin.influences.iter().map(of).collect()
    }

    /// `[vertices]`: the share on hips, spine, neck and clavicles.
    pub fn trunk(&self, avatar: &Avatar) -> Vec<f64> {
        self.membership(avatar, |joint| !self.is_limb(joint) && !self.is_head(joint))
    }

    /// Whether a joint belongs to a leg, or to an arm from the upper arm on.
    pub fn is_limb(&self, joint: usize) -> bool {
        let parts = [Part::UpperArm, Part::UpperLeg];
        [Side::Left, Side::Right].into_iter().any(|side| {
            let tops = parts.iter().filter_map(|&part| self.limb(side, part));
            tops.into_iter().any(|top| self.is_below(joint, top))
        })
    }

    /// Whether a joint moves the head.
    pub fn is_head(&self, joint: usize) -> bool {
        let head = self.human.roles.get(&Role::Head);
        head.is_some_and(|&head| self.is_below(joint, head))
    }
}
