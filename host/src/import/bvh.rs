//! Biovision hierarchy (BVH) files: text in, a skeleton and one clip out.
//!
//! The format has no standard; this reader follows Meredith and Maddock, *Motion Capture File
//! Formats Explained* (2001), and where programs differ it does what their files need:
//!
//! - **Rotation.** A joint's rotation is the product of its channels' rotations in the order in
//!   which they are listed: `Zrotation Xrotation Yrotation` is `Rz * Rx * Ry`. Position channels
//!   may stand before, after or between them; the translation is always applied last.
//! - **Position.** Programs disagree on a joint that has both an `OFFSET` and position channels.
//!   Blender (both ways) and the readers pybvh and bvhio take the channels *instead of* the
//!   `OFFSET`; the early description of the root and MakeHuman's files *add* them to it. Read the
//!   wrong way, a skeleton collapses into one point or grows to twice its size, so joints below the
//!   root show which is meant: numbers that stay near zero are added, numbers that stay near the
//!   `OFFSET` replace it. Without such a joint they replace it, as in most programs.
//!   [`BvhOptions::positions`] overrules. An axis without a channel keeps its `OFFSET`.
//! - **Unit and axes.** Neither is stated. The unit is found by comparing the rest pose with a
//!   human; Y is up unless [`BvhOptions::z_up`].

use glam::{DQuat, DVec3};

use super::text::{check_unit, file_stem, text_of};
use super::{
    Channel, ImportError, ImportErrorKind, Interpolation, Notice, Place, RawClip, RawJoint,
    RawMotion, RawSkeleton, RawTrack, Transform,
};
use hierarchy::{Hierarchy, Joint, Slot};
use motion::{JointMotion, Motion};

mod cursor;
mod hierarchy;
mod motion;
#[cfg(test)]
mod tests;
mod unit;

/// How position channels relate to the joint's `OFFSET`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhPositions {
    /// They are the whole translation from the parent.
    Whole,
    /// They are added to the `OFFSET`.
    Change,
}

/// What a BVH file does not state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BvhOptions {
    /// Metres in one unit of the file; guessed from the rest pose where absent.
    pub unit_metres: Option<f64>,
    /// Z is up instead of Y: everything is turned by -90 degrees about X.
    pub z_up: bool,
    /// What position channels mean; found from the data where absent.
    pub positions: Option<BvhPositions>,
}

/// Reads a BVH file with nothing known beside it; see [`read_bvh_with`].
///
/// # Errors
/// As [`read_bvh_with`].
pub fn read_bvh(bytes: &[u8], file: &str) -> Result<RawMotion, ImportError> {
    read_bvh_with(bytes, file, &BvhOptions::default())
}

/// Reads a BVH file; `file` is its name for messages and for the clip.
///
/// Gives metres, seconds and Y up; one [`Channel::Rotation`] track for every joint with rotation
/// channels and one [`Channel::Translation`] track for every joint with position channels, a key
/// a frame, linear between keys, in joint order. Joints stand in file order, parents before
/// children. O(bytes) time and memory, whatever the header announces, and no recursion.
///
/// # Errors
/// [`ImportError`] with the line for anything that is not a BVH file or contradicts itself. Not
/// an error but a [`Notice`]: a frame count that differs from the rows, a last row that was cut,
/// repeated or unreadable names, a guessed unit, doubt about the upward axis.
pub fn read_bvh_with(
    bytes: &[u8],
    file: &str,
    options: &BvhOptions,
) -> Result<RawMotion, ImportError> {
    let whole_file = |kind: ImportErrorKind| kind.at(file, Place::File);
    let text = text_of(bytes, "a BVH file").map_err(whole_file)?;
    let mut notices = Vec::new();
    let (hierarchy, rest, line) = hierarchy::read(text, file, &mut notices)?;
    let mut motion = motion::read(rest, line, &hierarchy, file, &mut notices)?;
    complete_positions(&hierarchy.joints, &mut motion.joints, options, &mut notices);
    let extent = unit::rest_extent(&hierarchy);
    if !options.z_up {
        let doubt = unit::doubt_y_up(extent);
        notices.extend(doubt.map(|text| Notice::new(Place::File, text)));
    }
    let unit_metres = match options.unit_metres {
        Some(stated) => check_unit(stated).map_err(whole_file)?,
        None => {
            let (guess, text) = unit::guess_unit(extent);
            notices.push(Notice::new(Place::File, text));
            guess
        }
    };
    let space = Space {
        unit_metres,
        z_up: options.z_up,
    };
    Ok(space.convert(hierarchy, motion, file, notices))
}

/// Makes every position key the whole translation from the parent.
fn complete_positions(
    joints: &[Joint],
    motion: &mut [JointMotion],
    options: &BvhOptions,
    notices: &mut Vec<Notice>,
) {
    let meaning = options.positions.unwrap_or_else(|| {
        let (meaning, text) = guess_positions(joints, motion);
        notices.extend(text.map(|text| Notice::new(Place::File, text)));
        meaning
    });
    for track in motion {
        let joint = &joints[track.joint];
        for axis in 0..3 {
            let stated = joint.slots.contains(&Slot::Position(axis));
            if meaning == BvhPositions::Change || !stated {
                let offset = joint.offset[axis];
                track
                    .positions
                    .iter_mut()
                    .for_each(|key| key[axis] += offset);
            }
        }
    }
}

/// What position channels mean where nobody says, and what to tell of it.
fn guess_positions(
    joints: &[Joint],
    motion: &[JointMotion],
) -> (BvhPositions, Option<&'static str>) {
    match unit::positions_are_changes(joints, motion) {
        Some(true) => {
            let text = "position channels stay near zero where the OFFSET is not: they are added \
                        to the OFFSET";
            (BvhPositions::Change, Some(text))
        }
        Some(false) => (BvhPositions::Whole, None),
        None => {
            let doubtful = motion.iter().any(|track| {
                !track.positions.is_empty() && joints[track.joint].offset != DVec3::ZERO
            });
            let text = "position channels of a root with an OFFSET are taken as the whole \
                        translation; state otherwise if they are to be added";
            (BvhPositions::Whole, doubtful.then_some(text))
        }
    }
}

/// From the file's unit and axes to metres with Y up.
struct Space {
    unit_metres: f64,
    z_up: bool,
}

impl Space {
    fn axes(&self, v: DVec3) -> DVec3 {
        if self.z_up {
            DVec3::new(v.x, v.z, -v.y)
        } else {
            v
        }
    }

    fn point(&self, v: DVec3) -> DVec3 {
        self.axes(v) * self.unit_metres
    }

    /// The same turn in the new axes: a quaternion's vector part turns like any vector.
    fn rotation(&self, q: DQuat) -> DQuat {
        let axis = self.axes(q.xyz());
        DQuat::from_xyzw(axis.x, axis.y, axis.z, q.w)
    }

    fn convert(
        &self,
        hierarchy: Hierarchy,
        motion: Motion,
        file: &str,
        notices: Vec<Notice>,
    ) -> RawMotion {
        let joints = hierarchy.joints.into_iter().map(|joint| RawJoint {
            name: joint.name,
            parent: joint.parent,
            rest: Transform {
                translation: self.point(joint.offset),
                ..Transform::IDENTITY
            },
        });
        let end_sites = hierarchy.end_sites.into_iter();
        let times: Vec<f64> = (0..motion.frame_count)
            .map(|frame| frame as f64 * motion.frame_time)
            .collect();
        let mut tracks = Vec::new();
        for mut track in motion.joints {
            for key in &mut track.positions {
                let [x, y, z, _] = *key;
                *key = self.point(DVec3::new(x, y, z)).extend(0.0).to_array();
            }
            if self.z_up {
                for key in &mut track.rotations {
                    *key = self.rotation(DQuat::from_array(*key)).to_array();
                }
            }
            let channels = [
                (Channel::Translation, track.positions),
                (Channel::Rotation, track.rotations),
            ];
            tracks.extend(
                channels
                    .into_iter()
                    .filter(|(_, values)| !values.is_empty())
                    .map(|(channel, values)| RawTrack {
                        joint: track.joint,
                        channel,
                        interpolation: Interpolation::Linear,
                        times: times.clone(),
                        values,
                    }),
            );
        }
        RawMotion {
            skeleton: RawSkeleton {
                joints: joints.collect(),
            },
            end_sites: end_sites
                .map(|(joint, offset)| (joint, self.point(offset)))
                .collect(),
            clip: RawClip {
                name: file_stem(file),
                tracks,
                morph_weights: None,
                sample_period: (motion.frame_time > 0.0).then_some(motion.frame_time),
            },
            notices,
        }
    }
}
