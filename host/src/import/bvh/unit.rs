//! What the file does not state: the length unit, the upward axis, and whether position channels
//! include the `OFFSET`.

use glam::DVec3;

use super::hierarchy::{Hierarchy, Joint, Slot};
use super::motion::JointMotion;

/// Largest side of the box around one skeleton in its rest pose, and that box, in file units.
/// O(joints).
pub(super) fn rest_extent(hierarchy: &Hierarchy) -> DVec3 {
    let joints = &hierarchy.joints;
    // World position, and the root it hangs on: two people side by side are not one tall one.
    let mut world: Vec<(DVec3, usize)> = Vec::with_capacity(joints.len());
    let mut boxes: Vec<(DVec3, DVec3)> = vec![(DVec3::MAX, DVec3::MIN); joints.len()];
    let mut grow = |root: usize, point: DVec3| {
        let (low, high) = &mut boxes[root];
        *low = low.min(point);
        *high = high.max(point);
    };
    for (index, joint) in joints.iter().enumerate() {
        let (parent, root) = joint
            .parent
            .map_or((DVec3::ZERO, index), |parent| world[parent]);
        world.push((parent + joint.offset, root));
        grow(root, parent + joint.offset);
    }
    for &(joint, offset) in &hierarchy.end_sites {
        let (position, root) = world[joint];
        grow(root, position + offset);
    }
    let sizes = boxes
        .iter()
        .filter(|(low, high)| low.cmple(*high).all())
        .map(|(low, high)| *high - *low);
    sizes.fold(DVec3::ZERO, |largest, size| {
        if size.max_element() > largest.max_element() {
            size
        } else {
            largest
        }
    })
}

/// Stature of the human that an unstated unit is guessed against.
const STATURE: f64 = 1.7;

/// Metres and name of the units that BVH files are written in. CMU's Acclaim files count in
/// inches divided by 0.45, and so do the BVH files made from them.
const UNITS: [(f64, &str); 7] = [
    (1.0, "metres"),
    (0.3048, "feet"),
    (0.1, "decimetres"),
    (0.0254 / 0.45, "CMU units (1 inch / 0.45)"),
    (0.0254, "inches"),
    (0.01, "centimetres"),
    (0.001, "millimetres"),
];

/// The unit that makes a skeleton of this extent closest to a human, and what to say about it.
///
/// The largest side of the rest pose's box stands for the height: in a T-pose the span of the
/// arms is the height too, and it holds whichever axis is up.
pub(super) fn guess_unit(extent: DVec3) -> (f64, String) {
    let size = extent.max_element();
    if size <= 0.0 {
        let text = "the file states no length unit and its rest pose has no extent; metres are \
                    assumed";
        return (1.0, text.to_owned());
    }
    let misfit = |unit: f64| (size * unit / STATURE).ln().abs();
    let best = UNITS
        .into_iter()
        .min_by(|a, b| misfit(a.0).total_cmp(&misfit(b.0)));
    let (unit, name) = best.unwrap_or(UNITS[0]);
    let doubt = if misfit(unit) > 1.4_f64.ln() {
        ", which is unlike a standing human and so uncertain"
    } else {
        ""
    };
    let text = format!(
        "the file states no length unit: its rest pose is {size:.4} units large, read as {name}, \
         that is {:.2} m{doubt}; state the unit if this is wrong",
        size * unit
    );
    (unit, text)
}

/// A doubt about Y up, where the rest pose raises one.
pub(super) fn doubt_y_up(extent: DVec3) -> Option<String> {
    // A standing body is thinnest from front to back.
    (extent.z > 2.0 * extent.y && extent.z > 0.5 * extent.x).then(|| {
        format!(
            "the rest pose is {:.4} units along Z and {:.4} along Y: it looks as if Z is up; Y is \
             taken as up unless stated otherwise",
            extent.z, extent.y
        )
    })
}

/// Whether position channels are changes from the `OFFSET`, decided over all joints below the
/// roots that have both: numbers near zero are changes, numbers near the `OFFSET` include it.
/// `None` where there is no such joint. O(position keys).
pub(super) fn positions_are_changes(joints: &[Joint], motion: &[JointMotion]) -> Option<bool> {
    let longest = joints
        .iter()
        .filter(|joint| joint.parent.is_some())
        .fold(0.0, |longest: f64, joint| {
            longest.max(joint.offset.length())
        });
    let (mut changes, mut whole) = (0_usize, 0_usize);
    for track in motion {
        let joint = &joints[track.joint];
        let axes = || {
            joint.slots.iter().filter_map(|slot| match *slot {
                Slot::Position(axis) => Some(axis),
                Slot::Rotation(_) => None,
            })
        };
        let length: f64 = axes().map(|axis| joint.offset[axis].abs()).sum();
        if joint.parent.is_none() || track.positions.is_empty() || length <= 1e-3 * longest {
            continue;
        }
        let (mut from_zero, mut from_offset) = (0.0, 0.0);
        for position in &track.positions {
            for axis in axes() {
                from_zero += position[axis].abs();
                from_offset += (position[axis] - joint.offset[axis]).abs();
            }
        }
        if from_zero < from_offset {
            changes += 1;
        } else {
            whole += 1;
        }
    }
    (changes + whole > 0).then_some(changes > whole)
}
