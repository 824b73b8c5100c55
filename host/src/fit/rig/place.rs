//! Joints of a skeleton put at the landmarks of a body.

use glam::{DMat3, DQuat, DVec3};

use super::figure::{Axes, Figure, Limb};
use super::limbs::bend;
use crate::fit::humanoid::{Humanoid, Part, Role, SIDES, ancestors};
use crate::fit::retarget::swing;
use crate::model::Skeleton;
use crate::spatial::Solid;

/// The skeleton that is fitted, in its rest pose.
pub(super) struct Source<'a> {
    pub skeleton: &'a Skeleton,
    pub human: &'a Humanoid,
    /// `[joints]`, model space.
    pub at: &'a [DVec3],
    /// Ends of last joints, model space.
    pub ends: &'a [(usize, DVec3)],
    pub axes: Axes,
}

/// How the surroundings of a joint come from the source to the body: turned, then scaled.
#[derive(Clone, Copy, Debug)]
struct Frame {
    turn: DQuat,
    scale: f64,
}

/// Model-space places `[joints]`. O(joints^2) at worst
pub(super) fn place(source: &Source<'_>, figure: &Figure, solid: &Solid) -> Vec<DVec3> {
    let mut placing = Placing {
        source,
        figure,
        fixed: vec![None; source.at.len()],
        frames: vec![None; source.at.len()],
        whole: whole(source, figure),
    };
    placing.limbs(solid);
    placing.trunk();
    placing.others(solid)
}

/// The frame of the body as a whole: facing as it does, as large between hips and shoulders.
fn whole(source: &Source<'_>, figure: &Figure) -> Frame {
    let basis = |axes: &Axes| DMat3::from_cols(axes.left, DVec3::Y, axes.front);
    let turn = basis(&figure.axes) * basis(&source.axes).transpose();
    let [leg, shoulders] = [&figure.legs, &figure.arms].map(roots);
    let own = [Part::UpperLeg, Part::UpperArm].map(|part| source.middle(part));
    let scale = match own {
        [Some(legs), Some(arms)] => (shoulders - leg).y / (arms - legs).y,
        _ => f64::NAN,
    };
    // A source whose arms hang no higher than its hips says nothing about size.
    let tallest = source
        .at
        .iter()
        .map(|at| at.y)
        .fold(f64::NEG_INFINITY, f64::max);
    let lowest = source
        .at
        .iter()
        .map(|at| at.y)
        .fold(f64::INFINITY, f64::min);
    let by_height = figure.height / (tallest - lowest).max(f64::MIN_POSITIVE);
    Frame {
        turn: DQuat::from_mat3(&turn),
        scale: if scale.is_finite() && scale > 0.0 {
            scale
        } else {
            by_height
        },
    }
}

/// Middle of the roots of two limbs.
fn roots(limbs: &[Limb; 2]) -> DVec3 {
    (limbs[0].axis[0] + limbs[1].axis[0]) / 2.0
}

impl Source<'_> {
    /// Middle of left and right.
    fn middle(&self, part: Part) -> Option<DVec3> {
        let [left, right] = SIDES.map(|side| self.human.limb(side, part));
        Some((self.at[left?] + self.at[right?]) / 2.0)
    }

    /// The mean of the ends below a joint, which are joints without children and end sites.
    fn end_below(&self, joint: usize) -> Option<DVec3> {
        let below =
            |at: usize| at == joint || ancestors(self.skeleton, at).any(|above| above == joint);
        let sites = self
            .ends
            .iter()
            .filter(|&&(at, _)| below(at))
            .map(|&(_, end)| end);
        let is_last = |&at: &usize| {
            let mut joints = self.skeleton.joints.iter();
            at != joint && below(at) && !joints.any(|other| other.parent == Some(at))
        };
        let last = (0..self.at.len()).filter(is_last).map(|at| self.at[at]);
        // Thumbs stand aside: the farther half of the ends shows the way.
        let mut all: Vec<DVec3> = sites.chain(last).collect();
        let far = |end: &DVec3| end.distance_squared(self.at[joint]);
        all.sort_by(|a, b| far(b).total_cmp(&far(a)));
        all.truncate(all.len().div_ceil(2));
        (!all.is_empty()).then(|| all.iter().sum::<DVec3>() / all.len() as f64)
    }
}

struct Placing<'a> {
    source: &'a Source<'a>,
    figure: &'a Figure,
    /// `[joints]`: those with a landmark.
    fixed: Vec<Option<DVec3>>,
    /// `[joints]`: for what stands around them.
    frames: Vec<Option<Frame>>,
    whole: Frame,
}

impl Placing<'_> {
    fn limbs(&mut self, solid: &Solid) {
        let arm = [Part::UpperArm, Part::LowerArm, Part::Hand];
        let leg = [Part::UpperLeg, Part::LowerLeg, Part::Foot];
        let figure = self.figure;
        for (at, side) in SIDES.into_iter().enumerate() {
            for (parts, limb, usual) in
                [(arm, &figure.arms[at], 0.53), (leg, &figure.legs[at], 0.5)]
            {
                let joints = parts.map(|part| self.source.human.limb(side, part));
                self.limb(joints, limb, usual);
            }
            let limb = |part| self.source.human.limb(side, part);
            if let (Some(foot), Some(toes)) = (limb(Part::Foot), limb(Part::Toes)) {
                let ball = self.ball(foot, toes, &figure.legs[at], solid);
                self.fix(
                    toes,
                    ball,
                    self.source.end_below(toes).zip(Some(figure.legs[at].tip)),
                );
            }
        }
        for (at, side) in SIDES.into_iter().enumerate() {
            let limb = |part| self.source.human.limb(side, part);
            if let (Some(clavicle), Some(arm)) = (limb(Part::Shoulder), limb(Part::UpperArm)) {
                self.clavicle(clavicle, arm, figure.arms[at].axis[0]);
            }
        }
    }

    /// Root, bend and end of a limb; joints that the source lacks are left out.
    fn limb(&mut self, joints: [Option<usize>; 3], limb: &Limb, usual: f64) {
        let own = |joint: Option<usize>| joint.map(|joint| self.source.at[joint]);
        let own = [
            own(joints[0]),
            own(joints[1]),
            own(joints[2]).or_else(|| self.source.end_below(joints[1]?)),
        ];
        let expected = match own {
            [Some(root), Some(middle), Some(end)] => {
                let [upper, lower] = [root.distance(middle), middle.distance(end)];
                let part = upper / (upper + lower);
                // Skeletons that are no anatomy's (a root at the elbow) do not count.
                if (0.35..0.65).contains(&part) {
                    part
                } else {
                    usual
                }
            }
            _ => usual,
        };
        let end = limb.axis[limb.axis.len() - 1];
        let places = [limb.axis[0], bend(&limb.axis, expected), end, limb.tip];
        for (at, joint) in joints.into_iter().enumerate() {
            let Some(joint) = joint else {
                continue;
            };
            let next = joints
                .get(at + 1)
                .copied()
                .flatten()
                .map(|next| self.source.at[next]);
            let next = next.or_else(|| self.source.end_below(joint));
            self.fix(joint, places[at], next.zip(Some(places[at + 1])));
        }
    }

    /// Puts a joint in its place. `bone`: where its bone ends in the source and in the body.
    fn fix(&mut self, joint: usize, place: DVec3, bone: Option<(DVec3, DVec3)>) {
        self.fixed[joint] = Some(place);
        let own = bone.map(|(from, to)| {
            let turned = self.whole.turn * (from - self.source.at[joint]);
            (turned, to - place)
        });
        self.frames[joint] = own.and_then(|(from, to)| {
            let scale = to.length() / from.length();
            let turn = swing(from.try_normalize()?, to.try_normalize()?) * self.whole.turn;
            scale.is_finite().then_some(Frame { turn, scale })
        });
    }

    /// The ball of the foot: as far ahead as in the source, in the middle of the foot's height.
    fn ball(&self, foot: usize, toes: usize, leg: &Limb, solid: &Solid) -> DVec3 {
        const USUAL: f64 = 0.72;
        let at = |joint: usize| self.source.at[joint].with_y(0.0);
        let part = self.source.end_below(toes).map(|end| {
            let whole = at(foot).distance(end.with_y(0.0));
            at(foot).distance(at(toes)) / whole
        });
        let part = part
            .filter(|part| (0.5..0.9).contains(part))
            .unwrap_or(USUAL);
        let ankle = leg.axis[leg.axis.len() - 1];
        let ball = ankle.lerp(leg.tip, part);
        let steps = (0..).map(|step| self.figure.floor + f64::from(step) * solid.size() / 2.0);
        let heights = steps
            .take_while(|&y| y < ankle.y)
            .filter(|&y| solid.contains(ball.with_y(y)));
        let (sum, count) = heights.fold((0.0, 0.0), |(sum, count), y| (sum + y, count + 1.0));
        if count > 0.0 {
            ball.with_y(sum / count)
        } else {
            ball
        }
    }

    /// As far from the middle as in the source, at the depth of the shoulder.
    fn clavicle(&mut self, clavicle: usize, arm: usize, shoulder: DVec3) {
        let (own, figure) = (self.source, self.figure);
        let Some(middle) = own.middle(Part::UpperArm) else {
            return;
        };
        let aside = |joint: usize| (own.at[joint] - middle).dot(own.axes.left);
        let part = (aside(clavicle) / aside(arm)).clamp(0.0, 0.9);
        let below = self.whole.scale * (own.at[clavicle].y - own.at[arm].y);
        let below = below.clamp(-0.06 * figure.height, 0.03 * figure.height);
        let spine = figure.spine_at(shoulder.y);
        let across = (shoulder - spine).dot(figure.axes.left) * figure.axes.left;
        let place = shoulder - (1.0 - part) * across + below * DVec3::Y;
        self.fix(clavicle, place, Some((own.at[arm], shoulder)));
    }

    fn trunk(&mut self) {
        let (own, figure) = (self.source, self.figure);
        let human = own.human;
        let sockets = roots(&figure.legs);
        let own_sockets = own.middle(Part::UpperLeg).unwrap_or(own.at[human.hips]);
        let height =
            |joint: usize| sockets.y + self.whole.scale * (own.at[joint].y - own_sockets.y);
        let [neck, skull] = figure.neck;
        let hips = height(human.hips);
        let hips = hips.clamp(
            sockets.y - 0.02 * figure.height,
            sockets.y + 0.08 * figure.height,
        );
        let highest = neck.y - 0.03 * figure.height;
        let spine: Vec<(usize, DVec3)> = human
            .spine
            .iter()
            .map(|&joint| (joint, figure.spine_at(height(joint).clamp(hips, highest))))
            .collect();
        self.fix(human.hips, sockets.with_y(hips), None);
        for (joint, place) in spine {
            self.fix(joint, place, None);
        }
        let head = human.roles[&Role::Head];
        let lengths = |joint: &usize| {
            own.skeleton.joints[*joint]
                .parent
                .map_or(0.0, |p| own.at[*joint].distance(own.at[p]))
        };
        let whole: f64 = human.neck.iter().skip(1).map(lengths).sum();
        let mut gone = 0.0;
        for (at, joint) in human.neck.iter().enumerate() {
            if at > 0 {
                gone += lengths(joint);
            }
            let part = if whole > 0.0 { gone / whole } else { 0.0 };
            let end = (*joint == head).then(|| own.end_below(head)).flatten();
            self.fix(*joint, neck.lerp(skull, part), end.zip(Some(figure.crown)));
        }
    }

    /// Joints without a landmark: on the way between two that have one, else as they stand beside
    /// the nearest one above.
    fn others(self, solid: &Solid) -> Vec<DVec3> {
        /// Joints of thin fingers are brought inside from as many cells away.
        const REACH: i32 = 3;
        let own = self.source;
        // The first joint below each that has a place, looked for from below.
        let mut below: Vec<Option<usize>> = vec![None; own.at.len()];
        for joint in (0..own.at.len()).rev() {
            let found = self.fixed[joint].map(|_| joint).or(below[joint]);
            if let Some(parent) = own.skeleton.joints[joint].parent {
                below[parent] = found.or(below[parent]);
            }
        }
        let mut places: Vec<DVec3> = Vec::with_capacity(own.at.len());
        let mut frames: Vec<Frame> = Vec::with_capacity(own.at.len());
        for (joint, &next) in below.iter().enumerate() {
            let parent = own.skeleton.joints[joint].parent;
            let frame = self.frames[joint].or_else(|| Some(frames[parent?]));
            frames.push(frame.unwrap_or(self.whole));
            let place = match (self.fixed[joint], next, parent) {
                (Some(place), ..) => place,
                (None, Some(next), Some(parent)) => {
                    let gone = own.at[parent].distance(own.at[joint]);
                    let left = own.at[joint].distance(own.at[next]);
                    let part = if gone > 0.0 {
                        gone / (gone + left)
                    } else {
                        0.0
                    };
                    places[parent].lerp(self.fixed[next].unwrap_or(places[parent]), part)
                }
                // Above the hips: on the floor, as a rule.
                (None, _, None) => {
                    let hips = self.fixed[own.human.hips].unwrap_or_default();
                    let offset = own.at[joint] - own.at[own.human.hips];
                    hips + self.whole.scale * (self.whole.turn * offset)
                }
                (None, None, Some(parent)) => {
                    let frame = frames[parent];
                    let offset = own.at[joint] - own.at[parent];
                    let place = places[parent] + frame.scale * (frame.turn * offset);
                    match solid.nearest(place, REACH) {
                        Some((cell, _)) if !solid.contains(place) => solid.centre(cell),
                        _ => place,
                    }
                }
            };
            places.push(place);
        }
        places
    }
}
