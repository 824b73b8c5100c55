//! The expected body: joints of a person of 1.75 m in a T-pose, and where landmarks lie on it.
//!
//! Y is up, Z to the front, X to the person's left; palms look down, thumbs forward. Proportions
//! follow Winter, *Biomechanics and Motor Control of Human Movement* (2009), table 4.1; hip centres
//! lie as in Harrington et al. 2007. The fit only starts here: joints that move are found from
//! their motion.

use glam::DVec3;

use super::body::{Body, FIRST_NOISE, Hinge, Marker, Segment, Share};
use super::calibrate::SHARE;
use super::labels::{Landmark, Place};
use crate::fit::Side;

/// Segments in the order of [`body`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bone {
    /// The pelvis.
    Hips,
    /// From the waist up.
    Spine,
    /// The rib cage.
    Chest,
    /// The neck.
    Neck,
    /// The head.
    Head,
    /// A clavicle.
    Shoulder,
    /// An upper arm.
    Arm,
    /// A forearm.
    ForeArm,
    /// A hand.
    Hand,
    /// A thigh.
    UpLeg,
    /// A shank.
    Leg,
    /// A foot.
    Foot,
    /// Toes.
    Toes,
}

/// A bone's joint: position in the template, spreads of position and of turn.
struct Row {
    bone: Bone,
    parent: Option<Bone>,
    name: &'static str,
    /// Of the left side, metres.
    at: [f64; 3],
    /// Metres along each axis.
    spread: [f64; 3],
    /// Radians about each axis.
    turn: [f64; 3],
}

const fn row(
    bone: Bone,
    parent: Option<Bone>,
    name: &'static str,
    at: [f64; 3],
    spread: [f64; 3],
    turn: [f64; 3],
) -> Row {
    Row {
        bone,
        parent,
        name,
        at,
        spread,
        turn,
    }
}

/// A bone that follows the one above it alone fixes that one's axes: across, it strays this little, metres.
const ACROSS: f64 = 0.01;
/// A landmark this near the next joint is expected relative to it, metres.
const NEAR_JOINT: f64 = 0.09;
/// The same on the pelvis, whose skin the thighs move most.
const NEAR_HIP: f64 = 0.14;
/// Segments whose joint lies this near move the skin of the trunk too, metres; limbs' skin moves
/// within [`NEAR_JOINT`].
const NEAR_TRUNK: f64 = 0.18;
const FREE: [f64; 3] = [2.0; 3];

#[rustfmt::skip]
const TRUNK: [Row; 5] = [
    row(Bone::Hips, None, "Hips", [0.0, 0.96, 0.0], [0.02; 3], FREE),
    row(Bone::Spine, Some(Bone::Hips), "Spine", [0.0, 1.05, -0.02], [ACROSS, 0.02, 0.015], [0.4; 3]),
    row(Bone::Chest, Some(Bone::Spine), "Chest", [0.0, 1.20, -0.03], [ACROSS, 0.02, ACROSS], [0.4; 3]),
    row(Bone::Neck, Some(Bone::Chest), "Neck", [0.0, 1.46, -0.02], [ACROSS, 0.025, 0.02], [0.5; 3]),
    row(Bone::Head, Some(Bone::Neck), "Head", [0.0, 1.56, 0.0], [ACROSS, 0.015, ACROSS], [0.5; 3]),
];

#[rustfmt::skip]
const SIDE: [Row; 8] = [
    row(Bone::Shoulder, Some(Bone::Chest), "Shoulder", [0.025, 1.41, 0.01], [0.01; 3], [0.2, 0.3, 0.3]),
    row(Bone::Arm, Some(Bone::Shoulder), "Arm", [0.18, 1.41, -0.015], [0.03, 0.02, 0.02], FREE),
    row(Bone::ForeArm, Some(Bone::Arm), "ForeArm", [0.46, 1.41, -0.015], [0.06, ACROSS, ACROSS], FREE),
    row(Bone::Hand, Some(Bone::ForeArm), "Hand", [0.715, 1.41, -0.015], [0.06, ACROSS, ACROSS], [0.5, 0.6, 0.8]),
    row(Bone::UpLeg, Some(Bone::Hips), "UpLeg", [0.088, 0.915, 0.005], [0.02, 0.03, 0.025], FREE),
    row(Bone::Leg, Some(Bone::UpLeg), "Leg", [0.088, 0.49, 0.005], [ACROSS, 0.06, ACROSS], FREE),
    row(Bone::Foot, Some(Bone::Leg), "Foot", [0.088, 0.08, 0.005], [ACROSS, 0.05, ACROSS], [0.7, 0.5, 0.5]),
    row(Bone::Toes, Some(Bone::Foot), "ToeBase", [0.098, 0.025, 0.135], [0.015, 0.008, 0.02], [0.5, 0.1, 0.1]),
];

fn ends(bone: Bone) -> Option<[f64; 3]> {
    match bone {
        Bone::Head => Some([0.0, 0.19, 0.0]),
        Bone::Hand => Some([0.18, 0.0, 0.0]),
        Bone::Toes => Some([0.0, -0.005, 0.07]),
        _ => None,
    }
}

/// Elbows bend about the vertical of the T-pose, knees about the axis to the left.
fn hinge(bone: Bone, side: f64) -> Option<Hinge> {
    match bone {
        Bone::ForeArm => Some(Hinge {
            axis: DVec3::Y,
            bone: side * DVec3::X,
            sideways: 0.12,
            twist: 10.0,
        }),
        Bone::Leg => Some(Hinge {
            axis: DVec3::X,
            bone: DVec3::NEG_Y,
            sideways: 0.08,
            twist: 0.15,
        }),
        _ => None,
    }
}

/// Where a bone's joint lies in the template, metres.
fn joint_at(bone: Bone, side: Option<Side>) -> DVec3 {
    let rows = TRUNK.iter().chain(&SIDE);
    let at = rows.into_iter().find(|row| row.bone == bone);
    let at = at.map_or(DVec3::ZERO, |row| DVec3::from_array(row.at));
    mirrored(at, side)
}

fn mirrored(v: DVec3, side: Option<Side>) -> DVec3 {
    if side == Some(Side::Right) {
        DVec3::new(-v.x, v.y, v.z)
    } else {
        v
    }
}

/// Index of a bone's segment in [`body`].
#[must_use]
pub fn index(bone: Bone, side: Option<Side>) -> usize {
    let trunk = TRUNK.len();
    match SIDE.iter().position(|row| row.bone == bone) {
        None => TRUNK.iter().position(|row| row.bone == bone).unwrap_or(0),
        Some(at) if side == Some(Side::Right) => trunk + SIDE.len() + at,
        Some(at) => trunk + at,
    }
}

/// The way from a segment's axis to a point on its skin, a unit vector; zero on the axis.
fn outward(body: &Body, segment: usize, at: DVec3) -> DVec3 {
    let next = body
        .segments
        .iter()
        .find(|next| next.parent == Some(segment));
    let own = &body.segments[segment];
    let axis = next.map_or(own.end, |next| Some(next.expected));
    let axis = axis.and_then(DVec3::try_normalize).unwrap_or(DVec3::Y);
    at.reject_from_normalized(axis).normalize_or_zero()
}

/// The template with the markers of these landmarks, (column, landmark), their centres `radius`
/// metres off the skin.
#[must_use]
pub fn body(landmarks: &[(usize, Landmark)], radius: f64) -> Body {
    let mut body = Body {
        scale: 1.0,
        noise: FIRST_NOISE,
        ..Body::default()
    };
    let mut push = |row: &Row, side: Option<Side>| {
        let parent = row.parent.map(|parent| {
            let sided = SIDE.iter().any(|row| row.bone == parent);
            (parent, side.filter(|_| sided))
        });
        let at = joint_at(row.bone, side);
        let expected = parent.map_or(at, |(bone, side)| at - joint_at(bone, side));
        let (letter, sign) = match side {
            None => ("", 0.0),
            Some(Side::Left) => ("Left", 1.0),
            Some(Side::Right) => ("Right", -1.0),
        };
        let other = side.map(|side| match side {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        });
        body.segments.push(Segment {
            name: format!("{letter}{}", row.name),
            parent: parent.map(|(bone, side)| index(bone, side)),
            offset: expected,
            expected,
            spread: DVec3::from_array(row.spread),
            turn_spread: DVec3::from_array(row.turn),
            hinge: hinge(row.bone, sign),
            mirror: other.map(|other| index(row.bone, Some(other))),
            end: ends(row.bone).map(|end| {
                let end = DVec3::from_array(end);
                if row.bone == Bone::Hand {
                    mirrored(end, side)
                } else {
                    end
                }
            }),
        });
    };
    TRUNK.iter().for_each(|row| push(row, None));
    for side in [Side::Left, Side::Right] {
        SIDE.iter().for_each(|row| push(row, Some(side)));
    }
    // A toe marker beside both ball markers sits on the toes' tip, alone it sits on the ball.
    let has = |name: &str, side| {
        let mut all = landmarks.iter();
        all.any(|(_, landmark)| landmark.name == name && landmark.side == side)
    };
    for (column, landmark) in landmarks {
        let Landmark { side, place, .. } = *landmark;
        let tip = landmark.name == "TOE" && has("MT1", side) && has("MT5", side);
        let place = if tip {
            Place {
                bone: Bone::Toes,
                at: [0.098, 0.03, 0.185],
                spread: place.spread,
            }
        } else {
            place
        };
        // Landmarks of one side on the trunk lie on an unpaired bone.
        let sided = SIDE.iter().any(|row| row.bone == place.bone);
        let segment = index(place.bone, side.filter(|_| sided));
        let offset = mirrored(DVec3::from_array(place.at), side)
            - joint_at(place.bone, side.filter(|_| sided));
        let offset = offset + radius * outward(&body, segment, offset);
        let away = |at: &usize| body.segments[*at].expected.distance(offset);
        let follows = |at: &usize| {
            let next = &body.segments[*at];
            next.parent == Some(segment) && (side.is_some() || next.mirror.is_none())
        };
        let near = (0..body.segments.len()).filter(follows);
        let anchor = near
            .filter(|at| {
                let near = if segment == 0 { NEAR_HIP } else { NEAR_JOINT };
                away(at) < near
            })
            .min_by(|a, b| away(a).total_cmp(&away(b)));
        let trunk = body.segments[segment].mirror.is_none();
        let near = if trunk { NEAR_TRUNK } else { NEAR_JOINT };
        let shares = (0..body.segments.len()).filter(|&at| {
            let parent = body.segments[segment].parent == Some(at) && offset.length() < near;
            anchor == Some(at) || parent || follows(&at) && away(&at) < near
        });
        let shares = shares.map(|at| Share {
            segment: at,
            share: if anchor == Some(at) { SHARE } else { 0.0 },
        });
        let shares = shares.collect();
        let expected = offset - anchor.map_or(DVec3::ZERO, |at| body.segments[at].expected);
        body.markers.push(Marker {
            column: *column,
            segment,
            offset,
            anchor,
            shares,
            expected,
            spread: place.spread,
        });
    }
    body
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_first_and_sides_mirror() {
        let body = body(&[], 0.0);
        assert_eq!(body.segments.len(), 21);
        for (at, segment) in body.segments.iter().enumerate() {
            assert!(segment.parent.is_none_or(|parent| parent < at));
            let Some(mirror) = segment.mirror else {
                continue;
            };
            let other = &body.segments[mirror];
            assert_eq!(other.mirror, Some(at));
            assert!((other.expected.x + segment.expected.x).abs() < 1e-12);
            assert_eq!(other.expected.y, segment.expected.y);
        }
        let hand = index(Bone::Hand, Some(Side::Right));
        assert_eq!(body.segments[hand].name, "RightHand");
        let arm = body.segments[hand].parent.unwrap();
        assert_eq!(body.segments[arm].name, "RightForeArm");
    }
}
