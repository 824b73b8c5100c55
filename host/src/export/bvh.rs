//! BVH files out: a hierarchy and its motion, as Blender, Maya and MotionBuilder read them.
//!
//! BVH knows no rotation at rest: joints are written with axes that lie along the world's in the
//! rest pose, and rotations are counted from there. Nothing moves differently for that.

use std::io::Write;

use glam::{DMat3, DQuat, DVec3};

use super::ExportErrorKind;
use crate::model::{Channel, Motion, Transform};
use crate::reference::pose::sample;

/// Rotation channels of every joint, first to last; the joint's rotation is their product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RotationOrder([usize; 3]);

impl RotationOrder {
    /// `Zrotation Xrotation Yrotation`, the most common.
    pub const ZXY: Self = Self([2, 0, 1]);

    /// Reads "ZXY" and the like, in any case.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let axis = |letter: char| "XYZ".find(letter.to_ascii_uppercase());
        let axes: Vec<usize> = text.chars().map(axis).collect::<Option<_>>()?;
        let axes: [usize; 3] = axes.try_into().ok()?;
        let [a, b, c] = axes;
        (a != b && b != c && a != c).then_some(Self(axes))
    }

    /// Angles about the three axes whose rotations multiply to `rotation`, radians; the nearer of
    /// the two solutions to `last`, without jumps of a whole turn.
    fn angles(self, rotation: DQuat, last: DVec3) -> DVec3 {
        let Self([i, j, k]) = self;
        let m = DMat3::from_quat(rotation);
        // Element (row, column); R = R_i(a) R_j(b) R_k(c).
        let at = |row: usize, column: usize| m.col(column)[row];
        let even = (i + 1) % 3 == j;
        let sign = if even { 1.0 } else { -1.0 };
        let b = (sign * at(i, k)).clamp(-1.0, 1.0).asin();
        let flat = at(i, i).hypot(at(i, j));
        let first = if flat > 1e-9 {
            let a = (-sign * at(j, k)).atan2(at(k, k));
            let c = (-sign * at(i, j)).atan2(at(i, i));
            DVec3::new(a, b, c)
        } else {
            // Only a +- c shows: keep c.
            let a = (sign * at(k, j)).atan2(at(j, j));
            DVec3::new(a - at(i, k).signum() * last.z, b, last.z)
        };
        let pi = std::f64::consts::PI;
        let second = DVec3::new(first.x + pi, pi - first.y, first.z + pi);
        let near = |angles: DVec3| {
            let rounds = (last - angles) / (2.0 * pi);
            angles + rounds.round() * (2.0 * pi)
        };
        let (first, second) = (near(first), near(second));
        if first.distance_squared(last) <= second.distance_squared(last) {
            first
        } else {
            second
        }
    }
}

/// How a motion is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhStyle {
    /// Rotation channels.
    pub order: RotationOrder,
    /// Units in a metre: 100 writes centimetres.
    pub units_per_metre: f64,
    /// Z is up instead of Y.
    pub z_up: bool,
}

impl Default for BvhStyle {
    fn default() -> Self {
        Self {
            order: RotationOrder::ZXY,
            units_per_metre: 100.0,
            z_up: false,
        }
    }
}

/// Writes a motion as BVH. Joints with a translation track, and the root, have position channels,
/// which are the whole translation; their `OFFSET` is that of the rest pose, the root's is zero.
/// Numbers have as many digits as it takes to read the same `f64` back. O(frames x joints)
///
/// # Errors
/// No joint or several roots; scales other than 1; a value that is not finite; `out` fails.
pub fn write_bvh(
    motion: &Motion,
    style: BvhStyle,
    out: &mut dyn Write,
) -> Result<(), ExportErrorKind> {
    let joints = &motion.skeleton.joints;
    if joints.is_empty() {
        return Err(ExportErrorKind::Empty { what: "joint" });
    }
    let roots = joints.iter().filter(|joint| joint.parent.is_none()).count();
    if roots != 1 {
        return Err(out_of_range("number of root joints", roots, "1"));
    }
    let scaled = |scale: DVec3| (scale - DVec3::ONE).abs().max_element() > 1e-6;
    if let Some(joint) = joints.iter().find(|joint| scaled(joint.rest.scale)) {
        let what = format!("scale of joint {:?}", joint.name);
        return Err(out_of_range(
            &what,
            joint.rest.scale.x,
            "1: BVH knows no scale",
        ));
    }
    let writer = Writer::new(motion, style);
    writer.hierarchy(out)?;
    writer.frames(out)
}

fn out_of_range(what: &str, value: impl ToString, expected: &str) -> ExportErrorKind {
    ExportErrorKind::OutOfRange {
        what: what.to_owned(),
        value: value.to_string(),
        expected: expected.to_owned(),
    }
}

struct Writer<'a> {
    motion: &'a Motion,
    style: BvhStyle,
    /// `[joints]`: rotation in model space at rest.
    rest: Vec<DQuat>,
    /// `[joints]`: whether it has position channels.
    placed: Vec<bool>,
    /// `[joints]`: depth-first, as BVH lists them.
    order: Vec<usize>,
    children: Vec<Vec<usize>>,
}

impl<'a> Writer<'a> {
    fn new(motion: &'a Motion, style: BvhStyle) -> Self {
        let joints = &motion.skeleton.joints;
        let mut rest: Vec<DQuat> = Vec::with_capacity(joints.len());
        let mut children = vec![Vec::new(); joints.len()];
        for (at, joint) in joints.iter().enumerate() {
            let above = joint.parent.map_or(DQuat::IDENTITY, |parent| rest[parent]);
            rest.push((above * joint.rest.rotation).normalize());
            if let Some(parent) = joint.parent {
                children[parent].push(at);
            }
        }
        let mut placed: Vec<bool> = joints.iter().map(|joint| joint.parent.is_none()).collect();
        for track in &motion.clip.tracks {
            placed[track.joint] |= track.channel == Channel::Translation;
        }
        let mut order = Vec::with_capacity(joints.len());
        let mut open: Vec<usize> = placed_roots(motion);
        while let Some(joint) = open.pop() {
            order.push(joint);
            open.extend(children[joint].iter().rev());
        }
        Self {
            motion,
            style,
            rest,
            placed,
            order,
            children,
        }
    }

    fn axes(&self, v: DVec3) -> DVec3 {
        if self.style.z_up {
            DVec3::new(v.x, -v.z, v.y)
        } else {
            v
        }
    }

    /// A vector in a parent's own axes, as BVH counts it.
    fn vector(&self, parent: Option<usize>, v: DVec3) -> DVec3 {
        let turn = parent.map_or(DQuat::IDENTITY, |parent| self.rest[parent]);
        self.axes(turn * v) * self.style.units_per_metre
    }

    fn hierarchy(&self, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
        writeln!(out, "HIERARCHY")?;
        let mut depth = 0;
        let joints = &self.motion.skeleton.joints;
        // How many joints have yet to follow in each open one.
        let mut open: Vec<usize> = Vec::new();
        for &joint in &self.order {
            let indent = "\t".repeat(depth);
            let name = bvh_name(&joints[joint].name);
            let (kind, offset) = match joints[joint].parent {
                Some(_) => ("JOINT", joints[joint].rest.translation),
                None => ("ROOT", DVec3::ZERO),
            };
            let offset = self.vector(joints[joint].parent, offset);
            writeln!(out, "{indent}{kind} {name}\n{indent}{{")?;
            let inner = format!("{indent}\t");
            self.offset(&inner, offset, out)?;
            let RotationOrder(order) = self.style.order;
            let rotations: Vec<String> = order
                .iter()
                .map(|&axis| format!("{}rotation", ["X", "Y", "Z"][axis]))
                .collect();
            let rotations = rotations.join(" ");
            if self.placed[joint] {
                writeln!(
                    out,
                    "{inner}CHANNELS 6 Xposition Yposition Zposition {rotations}"
                )?;
            } else {
                writeln!(out, "{inner}CHANNELS 3 {rotations}")?;
            }
            depth += 1;
            open.push(self.children[joint].len());
            if self.children[joint].is_empty() {
                let sites = &self.motion.end_sites;
                let end = sites.iter().find(|(at, _)| *at == joint);
                let end = end.map_or(DVec3::ZERO, |(_, end)| *end);
                writeln!(out, "{inner}End Site\n{inner}{{")?;
                self.offset(&format!("{inner}\t"), self.vector(Some(joint), end), out)?;
                writeln!(out, "{inner}}}")?;
            }
            while open.last() == Some(&0) {
                open.pop();
                depth -= 1;
                writeln!(out, "{}}}", "\t".repeat(depth))?;
                if let Some(left) = open.last_mut() {
                    *left -= 1;
                }
            }
        }
        Ok(())
    }

    fn offset(&self, indent: &str, at: DVec3, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
        if !at.is_finite() {
            let what = "an offset".to_owned();
            return Err(ExportErrorKind::NotFinite { what });
        }
        writeln!(out, "{indent}OFFSET {} {} {}", at.x, at.y, at.z)?;
        Ok(())
    }

    fn frames(&self, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
        let clip = &self.motion.clip;
        let period = clip.sample_period.filter(|period| *period > 0.0);
        let period = period.unwrap_or(1.0 / 60.0);
        let count = (clip.duration / period + 1e-6).floor() as usize + 1;
        writeln!(out, "MOTION\nFrames: {count}\nFrame Time: {period}")?;
        let mut last = vec![DVec3::ZERO; self.rest.len()];
        for frame in 0..count {
            let seconds = frame as f64 * period;
            let local = sample(&self.motion.skeleton, clip, seconds);
            let mut line = String::new();
            for &joint in &self.order {
                self.channels(joint, &local[joint], &mut last[joint], &mut line);
            }
            if line.contains(['N', 'i']) {
                let what = format!("frame {frame}");
                return Err(ExportErrorKind::NotFinite { what });
            }
            writeln!(out, "{}", line.trim_start())?;
        }
        Ok(())
    }

    fn channels(&self, joint: usize, local: &Transform, last: &mut DVec3, line: &mut String) {
        let parent = self.motion.skeleton.joints[joint].parent;
        let mut push = |v: DVec3| {
            for value in v.to_array() {
                line.push(' ');
                // Negative zero reads oddly.
                line.push_str(&(value + 0.0).to_string());
            }
        };
        if self.placed[joint] {
            push(self.vector(parent, local.translation));
        }
        let above = parent.map_or(DQuat::IDENTITY, |parent| self.rest[parent]);
        let turn = above * local.rotation * self.rest[joint].inverse();
        let axis = self.axes(turn.xyz());
        let turn = DQuat::from_xyzw(axis.x, axis.y, axis.z, turn.w).normalize();
        *last = self.style.order.angles(turn, *last);
        push(DVec3::from_array(last.to_array().map(f64::to_degrees)));
    }
}

fn placed_roots(motion: &Motion) -> Vec<usize> {
    let joints = motion.skeleton.joints.iter().enumerate();
    let roots = joints.filter(|(_, joint)| joint.parent.is_none());
    roots.map(|(at, _)| at).collect()
}

/// Names end at white space, and braces open blocks.
fn bvh_name(name: &str) -> String {
    let plain = |letter: char| letter.is_whitespace() || letter == '{' || letter == '}';
    name.replace(plain, "_")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::read_bvh_with;
    use crate::import::{BvhOptions, BvhPositions};
    use crate::model::{Clip, Interpolation, Joint, Skeleton, Track};

    fn joint(name: &str, parent: Option<usize>, at: DVec3, turn: DQuat) -> Joint {
        Joint {
            name: name.into(),
            parent,
            rest: Transform {
                translation: at,
                rotation: turn,
                scale: DVec3::ONE,
            },
        }
    }

    /// A root, a chain that is turned at rest, and a second branch.
    fn motion() -> Motion {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.5));
        let joints = vec![
            joint("hips", None, DVec3::Y, DQuat::from_rotation_y(0.4)),
            joint("a b", Some(0), DVec3::new(0.1, 0.2, 0.3), turn),
            joint("other", Some(0), DVec3::NEG_X, DQuat::IDENTITY),
            joint("tip", Some(1), DVec3::Z, turn.inverse()),
        ];
        let times: Vec<f64> = (0..50).map(|frame| f64::from(frame) * 0.01).collect();
        let mut tracks = vec![Track {
            joint: 0,
            channel: Channel::Translation,
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values: times.iter().map(|&t| [t, 1.0 - t, 2.0 * t, 0.0]).collect(),
        }];
        for joint in 0..4 {
            let axis = DVec3::new(1.0, joint as f64 - 1.0, 0.7).normalize();
            let value = |&t: &f64| DQuat::from_axis_angle(axis, 14.0 * t + joint as f64).to_array();
            tracks.push(Track {
                joint,
                channel: Channel::Rotation,
                interpolation: Interpolation::Linear,
                times: times.clone(),
                values: times.iter().map(value).collect(),
            });
        }
        Motion {
            skeleton: Skeleton { joints },
            end_sites: vec![(3, DVec3::Y)],
            clip: Clip {
                name: "m".into(),
                tracks,
                morph_track: None,
                duration: 0.49,
                sample_period: Some(0.01),
            },
        }
    }

    #[test]
    fn every_order_reads_back_as_the_same_motion() {
        let source = motion();
        for order in ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "zyx"] {
            for z_up in [false, true] {
                let style = BvhStyle {
                    order: RotationOrder::parse(order).unwrap(),
                    z_up,
                    ..BvhStyle::default()
                };
                let mut text = Vec::new();
                write_bvh(&source, style, &mut text).unwrap();
                let options = BvhOptions {
                    unit_metres: Some(0.01),
                    z_up,
                    positions: Some(BvhPositions::Whole),
                };
                let raw = read_bvh_with(&text, "m.bvh", &options).unwrap();
                let (back, _) = Motion::new(raw, "m.bvh").unwrap();
                let (there, here) = ([0, 1, 2, 3], [0, 1, 3, 2]);
                for frame in 0..50 {
                    let seconds = f64::from(frame) * 0.01;
                    let place = |motion: &Motion| {
                        let local = sample(&motion.skeleton, &motion.clip, seconds);
                        motion.skeleton.model(&local)
                    };
                    let (a, b) = (place(&source), place(&back));
                    for (there, here) in there.iter().zip(here) {
                        let away = a[*there].translation.distance(b[here].translation);
                        assert!(away < 1e-9, "{order} {z_up} {frame}: {away}");
                    }
                    let tip = a[3].transform_point3(DVec3::Y);
                    let (joint, end) = back.end_sites[0];
                    assert!(tip.distance(b[joint].transform_point3(end)) < 1e-9);
                }
            }
        }
    }

    #[test]
    fn what_bvh_cannot_hold_is_refused() {
        let style = BvhStyle::default();
        let mut two = motion();
        two.skeleton.joints[2].parent = None;
        assert!(write_bvh(&two, style, &mut Vec::new()).is_err());
        let mut scaled = motion();
        scaled.skeleton.joints[1].rest.scale.x = 2.0;
        assert!(write_bvh(&scaled, style, &mut Vec::new()).is_err());
        let mut broken = motion();
        broken.clip.tracks[0].values[3][1] = f64::NAN;
        let error = write_bvh(&broken, style, &mut Vec::new()).unwrap_err();
        assert!(matches!(error, ExportErrorKind::NotFinite { .. }));
        assert!(RotationOrder::parse("XXZ").is_none());
        assert!(RotationOrder::parse("XYZW").is_none());
    }
}
