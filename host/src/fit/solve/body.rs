//! The articulated body that is fitted: segments, their markers, poses, and forward kinematics.

use glam::{DMat3, DQuat, DVec3};

/// A rigid part of the body with the joint that carries it.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Name of its joint.
    pub name: String,
    /// Smaller than its own index; `None` for the root alone, which is first.
    pub parent: Option<usize>,
    /// Joint relative to the parent's joint in the rest pose, metres.
    pub offset: DVec3,
    /// What `offset` is expected to be, before scaling to the subject.
    pub expected: DVec3,
    /// Standard deviation of that expectation along the parent's axes, metres.
    pub spread: DVec3,
    /// Standard deviation of the turn against the parent, radians about the parent's axes.
    pub turn_spread: DVec3,
    /// An axis about which the joint turns most.
    pub hinge: Option<Hinge>,
    /// The segment on the other side of the body.
    pub mirror: Option<usize>,
    /// Where it ends, relative to its joint, if nothing follows; metres, before scaling.
    pub end: Option<DVec3>,
}

/// A preferred axis of rotation, stated in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge {
    /// Unit axis.
    pub axis: DVec3,
    /// Unit direction of the bone.
    pub bone: DVec3,
    /// Radians by which the bone may leave the plane across the axis.
    pub sideways: f64,
    /// Radians by which it may twist.
    pub twist: f64,
}

/// A marker and the segment on which it sits.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Index in the take.
    pub column: usize,
    /// Index of the segment.
    pub segment: usize,
    /// Relative to the segment's joint, metres.
    pub offset: DVec3,
    /// A segment that follows and whose joint lies near: the marker is expected relative to it.
    pub anchor: Option<usize>,
    /// Neighbours of the segment that carry it too, as skin near a joint moves with both sides.
    pub shares: Vec<Share>,
    /// What `offset` is expected to be, from the anchor if there is one, before scaling to the
    /// subject.
    pub expected: DVec3,
    /// Standard deviation of that expectation, metres.
    pub spread: f64,
}

/// A part that another segment has in carrying a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The parent of the marker's segment, or one of its children.
    pub segment: usize,
    /// 0 to 1; all of a marker's are at most 1 together.
    pub share: f64,
}

/// Noise before it is known, metres.
pub const FIRST_NOISE: f64 = 0.006;

/// Segments and markers, with the size of the subject.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// Parents first.
    pub segments: Vec<Segment>,
    /// In any order.
    pub markers: Vec<Marker>,
    /// Factor from the expectations to the subject.
    pub scale: f64,
    /// Standard deviation of a marker against its segments, metres: skin moves on bones.
    pub noise: f64,
}

/// Where the root is and how each joint turns against its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub root: DVec3,
    /// `[segments]`
    pub turns: Vec<DQuat>,
}

/// A pose in world space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placed {
    /// `[segments]`: joints, metres.
    pub joints: Vec<DVec3>,
    /// `[segments]`
    pub rotations: Vec<DMat3>,
}

impl Pose {
    /// The rest pose.
    pub fn rest(segment_count: usize) -> Self {
        Self {
            root: DVec3::ZERO,
            turns: vec![DQuat::IDENTITY; segment_count],
        }
    }
}

impl Body {
    /// Forward kinematics. O(segments)
    pub fn place(&self, pose: &Pose) -> Placed {
        let mut placed = Placed {
            joints: Vec::with_capacity(self.segments.len()),
            rotations: Vec::with_capacity(self.segments.len()),
        };
        for (segment, turn) in self.segments.iter().zip(&pose.turns) {
            let turn = DMat3::from_quat(*turn);
            match segment.parent {
                Some(parent) => {
                    let above = placed.rotations[parent];
                    placed
                        .joints
                        .push(placed.joints[parent] + above * segment.offset);
                    placed.rotations.push(above * turn);
                }
                None => {
                    placed.joints.push(pose.root);
                    placed.rotations.push(turn);
                }
            }
        }
        placed
    }

    /// Where a marker is. O(1)
    pub fn marker(&self, marker: &Marker, placed: &Placed) -> DVec3 {
        let own = self.carried(marker, marker.segment, placed);
        let shares = marker.shares.iter();
        let moved = shares.map(|of| of.share * (self.carried(marker, of.segment, placed) - own));
        own + moved.sum::<DVec3>()
    }

    /// Where its segment, or a neighbour of that one, would carry a marker alone. O(1)
    pub fn carried(&self, marker: &Marker, by: usize, placed: &Placed) -> DVec3 {
        let own = marker.segment;
        let apart = if by == own {
            DVec3::ZERO
        } else if self.segments[own].parent == Some(by) {
            self.segments[own].offset
        } else {
            -self.segments[by].offset
        };
        placed.joints[by] + placed.rotations[by] * (marker.offset + apart)
    }

    /// A segment and all above it, itself first.
    pub fn line(&self, segment: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(segment), |&at| self.segments[at].parent)
    }

    /// `[segments]`: whether the segment or one below it carries a marker, so that its turn can be
    /// seen. The root always counts.
    pub fn seen(&self) -> Vec<bool> {
        let mut seen = vec![false; self.segments.len()];
        for marker in &self.markers {
            self.line(marker.segment).for_each(|at| seen[at] = true);
        }
        if let Some(root) = seen.first_mut() {
            *root = true;
        }
        seen
    }

    /// Brings joints and markers to what is expected of a subject of this size.
    pub fn resize(&mut self, scale: f64) {
        self.scale = scale;
        for segment in &mut self.segments {
            segment.offset = scale * segment.expected;
        }
        for marker in &mut self.markers {
            let anchor = marker.anchor.map(|anchor| self.segments[anchor].offset);
            marker.offset = anchor.unwrap_or_default() + scale * marker.expected;
        }
    }
}
