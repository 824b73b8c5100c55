//! What moves with a joint: segments through the body.
//!
//! A joint's bones run to its children; the bone of a joint without children runs to the end of its
//! part of the body. Between joints a line stands well for a round limb. Where a human body is no
//! round limb, further lines stand for its breadth: the trunk is wide, the heel lies behind the ankle,
//! the face before the head's joint.

use glam::DVec3;

use super::super::humanoid::{Humanoid, Part, Role, SIDES};
use crate::model::Skeleton;
use crate::spatial::Solid;

/// The trunk's outer lines, as a part of half the distance between the shoulders.
const TRUNK_BREADTH: f64 = 0.4;
/// Bones end at this part of the way to the surface.
const END: f64 = 0.85;
/// Joints nearer than this are one place, metres.
const SAME: f64 = 1e-6;

/// A piece of a bone, metres in model space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The joint that moves it.
    pub joint: usize,
    /// Where it begins.
    pub from: DVec3,
    /// Where it ends.
    pub to: DVec3,
    /// The joint at its end, where it runs to one.
    pub child: Option<usize>,
}

impl Segment {
    /// `L(t) = A + b t`: the parameter of the point of the segment that is nearest to `point`, between
    /// 0 and 1, and its distance in metres (Mažrimas & Beinaravičius, section 4).
    #[must_use]
    pub fn project(&self, point: DVec3) -> (f64, f64) {
        let bone = self.to - self.from;
        let square = bone.length_squared();
        let t = if square > 0.0 {
            ((point - self.from).dot(bone) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (t, point.distance(self.from + t * bone))
    }
}

/// The bones of a skeleton in its rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bones {
    /// From joint to joint, and to the ends of limbs.
    pub lines: Vec<Segment>,
    /// The breadth of the trunk, heels, the face.
    pub breadth: Vec<Segment>,
}

impl Bones {
    /// The bones of a skeleton that stands in a solid; without cells, limbs end at their last joint.
    /// O(joints + cells log cells)
    #[must_use]
    pub fn new(skeleton: &Skeleton, human: Option<&Humanoid>, solid: &Solid) -> Self {
        let model = skeleton.model(&skeleton.rest());
        let at: Vec<DVec3> = model.iter().map(|joint| joint.translation).collect();
        let mut bones = Self::default();
        let mut is_leaf = vec![true; at.len()];
        for (child, joint) in skeleton.joints.iter().enumerate() {
            let Some(parent) = joint.parent else {
                continue;
            };
            is_leaf[parent] = false;
            if at[parent].distance(at[child]) > SAME {
                bones.lines.push(Segment {
                    joint: parent,
                    from: at[parent],
                    to: at[child],
                    child: Some(child),
                });
            }
        }
        let leaves = (0..at.len()).filter(|&joint| is_leaf[joint]);
        let point = |joint: usize| Segment {
            joint,
            from: at[joint],
            to: at[joint],
            child: None,
        };
        bones.lines.extend(leaves.map(point));
        bones.lengthen_leaves(solid);
        if let Some(body) = human.and_then(|human| Stance::new(human, &at)) {
            bones.breadth = body.breadth(solid);
        }
        bones
    }

    /// Lets the bones of last joints run to the farthest place that is nearer to them than to others.
    fn lengthen_leaves(&mut self, solid: &Solid) {
        let mut seeds = seeds(solid, &self.lines);
        for (_, gone, line) in &mut seeds {
            // Beyond its end a bone is as near as the joint that stands there, which shall have it.
            if self.lines[*line as usize].child.is_some() {
                *gone += 2.0 * solid.size();
            }
        }
        let (distance, mark) = solid.march(&seeds);
        let mut farthest: Vec<Option<(f32, u32)>> = vec![None; self.lines.len()];
        for (cell, (&gone, &line)) in distance.iter().zip(&mark).enumerate() {
            if let Some(best) = farthest.get_mut(line as usize)
                && gone.is_finite()
                && best.is_none_or(|(most, _)| gone > most)
            {
                *best = Some((gone, cell as u32));
            }
        }
        for (line, farthest) in self.lines.iter_mut().zip(farthest) {
            if let (None, Some((_, cell))) = (line.child, farthest) {
                line.to = line.from.lerp(solid.centre(cell), END);
            }
        }
    }

    /// All segments.
    pub fn all(&self) -> impl Iterator<Item = &Segment> {
        self.lines.iter().chain(&self.breadth)
    }
}

/// Cells along segments, with their distance from the segment and its number as their mark.
pub(super) fn seeds<'a>(
    solid: &Solid,
    segments: impl IntoIterator<Item = &'a Segment>,
) -> Vec<(u32, f64, u32)> {
    /// A joint that stands this many cells outside still counts, as joints of thin fingers may.
    const REACH: i32 = 3;
    let mut seeds = Vec::new();
    for (segment, mark) in segments.into_iter().zip(0..) {
        let length = segment.from.distance(segment.to);
        let steps = (2.0 * length / solid.size()).ceil().min(1e5) as u32;
        let first = seeds.len();
        let point = |step: u32| {
            let part = f64::from(step) / f64::from(steps.max(1));
            segment.from.lerp(segment.to, part)
        };
        for step in 0..=steps {
            for (cell, _) in solid.around(point(step), 0) {
                let (_, distance) = segment.project(solid.centre(cell));
                seeds.push((cell, distance, mark));
            }
        }
        if seeds.len() == first {
            let near = (0..=steps).filter_map(|step| solid.nearest(point(step), REACH));
            let near = near.min_by(|a, b| a.1.total_cmp(&b.1));
            seeds.extend(near.map(|(cell, distance)| (cell, distance, mark)));
        }
    }
    seeds
}

/// A human body: where its joints stand and which way is which.
struct Stance<'a> {
    human: &'a Humanoid,
    at: &'a [DVec3],
    left: DVec3,
    up: DVec3,
    front: DVec3,
}

impl<'a> Stance<'a> {
    /// `None` where the joints do not say which way is which.
    fn new(human: &'a Humanoid, at: &'a [DVec3]) -> Option<Self> {
        let across = |part| {
            let [left, right] = SIDES.map(|side| human.limb(side, part));
            Some(at[left?] - at[right?])
        };
        let up = (at[human.roles[&Role::Head]] - at[human.hips]).try_normalize()?;
        let hips = across(Part::UpperLeg)? + across(Part::UpperArm).unwrap_or_default();
        let left = hips.reject_from_normalized(up).try_normalize()?;
        let front = left.cross(up);
        Some(Self {
            human,
            at,
            left,
            up,
            front,
        })
    }

    fn breadth(&self, solid: &Solid) -> Vec<Segment> {
        let mut segments = Vec::new();
        self.trunk(solid, &mut segments);
        self.face(solid, &mut segments);
        self.heels(&mut segments);
        segments
    }

    /// Two lines a joint, left and right of the spine, in the middle between belly and back.
    fn trunk(&self, solid: &Solid, segments: &mut Vec<Segment>) {
        let arms = SIDES.map(|side| self.human.limb(side, Part::UpperArm));
        let legs = SIDES.map(|side| self.human.limb(side, Part::UpperLeg));
        let ends = if arms.iter().all(Option::is_some) {
            arms
        } else {
            legs
        };
        let [Some(left), Some(right)] = ends else {
            return;
        };
        let half = (self.at[left] - self.at[right]).dot(self.left).abs() / 2.0;
        let above = self
            .human
            .neck
            .first()
            .or(self.human.roles.get(&Role::Head));
        let chain = std::iter::once(&self.human.hips)
            .chain(&self.human.spine)
            .chain(above);
        let chain: Vec<usize> = chain.copied().collect();
        for pair in chain.windows(2) {
            for side in [-1.0, 1.0] {
                let beside = |joint: usize| {
                    let at = self.middle(solid, self.at[joint]);
                    at + side * TRUNK_BREADTH * half * self.left
                };
                segments.push(Segment {
                    joint: pair[0],
                    from: beside(pair[0]),
                    to: beside(pair[1]),
                    child: None,
                });
            }
        }
    }

    /// Halfway between the surface before and behind a point.
    fn middle(&self, solid: &Solid, point: DVec3) -> DVec3 {
        let [front, back] = [1.0, -1.0].map(|sign| way(solid, point, sign * self.front));
        point + (front - back) / 2.0 * self.front
    }

    /// From the head's joint to the middle of the face and to the chin.
    fn face(&self, solid: &Solid, segments: &mut Vec<Segment>) {
        let joint = self.human.roles[&Role::Head];
        let from = self.at[joint];
        let front = way(solid, from, self.front);
        for part in [0.3, -0.4] {
            segments.push(Segment {
                joint,
                from,
                to: from + END * front * (self.front + part * self.up),
                child: None,
            });
        }
    }

    /// From the ankle down, as far back as it stands high over the toes.
    fn heels(&self, segments: &mut Vec<Segment>) {
        for side in SIDES {
            let limb = |part| self.human.limb(side, part);
            let (Some(ankle), Some(toes)) = (limb(Part::Foot), limb(Part::Toes)) else {
                continue;
            };
            let foot = self.at[toes] - self.at[ankle];
            let ahead = foot.reject_from_normalized(self.up);
            let height = -foot.dot(self.up);
            if let (Some(ahead), true) = (ahead.try_normalize(), height > 0.0) {
                segments.push(Segment {
                    joint: ankle,
                    from: self.at[ankle],
                    to: self.at[ankle] - END * height * (self.up + ahead),
                    child: None,
                });
            }
        }
    }
}

/// Metres from a point to the end of the solid in a direction; 0 from outside.
fn way(solid: &Solid, point: DVec3, direction: DVec3) -> f64 {
    let step = solid.size() / 2.0;
    let mut gone = 0.0;
    while solid.contains(point + (gone + step) * direction) {
        gone += step;
    }
    gone
}
