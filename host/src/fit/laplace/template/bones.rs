//! A skeleton as a triangle mesh: each bone a prism with four edges and pointed ends.

use glam::DVec3;

use crate::model::Skeleton;

/// Bones shorter than this give no mesh, metres.
const SHORTEST: f64 = 0.015;

/// Where the rings of a prism stand along its bone: near both joints, where bending happens.
const RINGS: [f64; 2] = [0.15, 0.85];

/// Names of the points of a ring.
const SIDES: [&str; 4] = ["front", "left", "back", "right"];

/// The mesh.
#[derive(Debug, Default)]
pub(super) struct Bones {
    pub labels: Vec<String>,
    pub points: Vec<DVec3>,
    pub outward: Vec<DVec3>,
    /// Joint that carries each point.
    pub joints: Vec<u32>,
    pub triangles: Vec<[u32; 3]>,
}

/// Bones from each joint to those below it and to the end sites, in the rest pose. O(joints)
pub(super) fn of(skeleton: &Skeleton, end_sites: &[(usize, DVec3)]) -> Bones {
    let model = skeleton.model(&skeleton.rest());
    let mut bones = Bones::default();
    let below = skeleton
        .joints
        .iter()
        .enumerate()
        .filter_map(|(at, joint)| {
            let parent = joint.parent?;
            Some((parent, model[at].translation, &joint.name))
        });
    let ends = end_sites.iter().map(|&(joint, offset)| {
        let end = model[joint].transform_point3(offset);
        (joint, end, &skeleton.joints[joint].name)
    });
    for (joint, end, to) in below.chain(ends) {
        let start = model[joint].translation;
        if (end - start).length() >= SHORTEST {
            let from = &skeleton.joints[joint].name;
            let name = if from == to {
                format!("{from}-end")
            } else {
                format!("{from}-{to}")
            };
            bones.push(joint as u32, start, end, &name);
        }
    }
    bones
}

impl Bones {
    fn push(&mut self, joint: u32, start: DVec3, end: DVec3, name: &str) {
        let (axis, length) = ((end - start).normalize(), (end - start).length());
        let radius = (0.12 * length).clamp(0.005, 0.06);
        // The side nearest to where bodies face is called front; the others follow it.
        let face = DVec3::Z - axis * axis.z;
        let front = if face.length() > 0.3 {
            face.normalize()
        } else {
            (DVec3::Y - axis * axis.y).normalize()
        };
        let left = if axis.cross(front).x < 0.0 {
            front.cross(axis)
        } else {
            axis.cross(front)
        };
        let around = [front, left, -front, -left];
        let first = self.points.len() as u32;
        let mut point = |label: String, place: DVec3, outward: DVec3| {
            self.labels.push(label);
            self.points.push(place);
            self.outward.push(outward);
            self.joints.push(joint);
        };
        for (ring, along) in RINGS.into_iter().enumerate() {
            for (side, out) in SIDES.into_iter().zip(around) {
                let place = start + along * (end - start) + radius * out;
                point(format!("{name}:{}:{side}", ring + 1), place, out);
            }
        }
        point(format!("{name}:start"), start, -axis);
        point(format!("{name}:tip"), end, axis);
        for side in 0..4 {
            let (a, b) = (first + side, first + (side + 1) % 4);
            let (start, tip) = (first + 8, first + 9);
            self.triangles.extend([
                [start, b, a],
                [a, b, b + 4],
                [a, b + 4, a + 4],
                [tip, a + 4, b + 4],
            ]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Joint, Transform};

    #[test]
    fn a_leg_of_two_bones_is_two_closed_prisms() {
        let joint = |name: &str, parent, y| Joint {
            name: name.into(),
            parent,
            rest: Transform {
                translation: DVec3::new(0.0, y, 0.0),
                ..Transform::IDENTITY
            },
        };
        let skeleton = Skeleton {
            joints: vec![joint("hip", None, 1.0), joint("knee", Some(0), -0.5)],
        };
        let bones = of(&skeleton, &[(1, DVec3::new(0.0, -0.4, 0.0))]);
        assert_eq!((bones.points.len(), bones.triangles.len()), (20, 32));
        assert_eq!(bones.labels[0], "hip-knee:1:front");
        assert_eq!(bones.labels[19], "knee-end:tip");
        assert_eq!(bones.joints[19], 1);
        assert!(bones.points[19].distance(DVec3::Y * 0.1) < 1e-12);
        // Every edge has a twin the other way.
        let mut edges: Vec<(u32, u32)> = Vec::new();
        for &[a, b, c] in &bones.triangles {
            edges.extend([(a, b), (b, c), (c, a)]);
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        // Outward means outward.
        let middle = |at: usize| DVec3::new(0.0, bones.points[at].y, 0.0);
        assert!((0..8).all(|at| (bones.points[at] - middle(at)).dot(bones.outward[at]) > 0.0));
    }
}
