//! Inverse kinematics: a limb of two bones reaches for a point, a joint looks at one.

use super::blend::{mix, set_rotation};
use super::{Joint12, Local};
use crate::asset::{Asset, NO_PARENT};
use crate::math::{
    Quat4, affine, conjugate, inverse_sqrt, normalise, quaternion_product, transform_vector,
};

type Point = [f32; 3];

/// What a reach came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reach {
    /// The end is at the target.
    Reached,
    /// The target is beyond the limb's length, or nearer than it can fold: the limb points there.
    Beyond,
    /// Nothing was changed: joints that do not exist or follow each other in another order, bones
    /// without length, numbers that are not finite.
    Refused,
}

/// A limb: from hip over knee to ankle, or shoulder, elbow, wrist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoBone {
    /// Upper, middle and end joint; joints may lie between them.
    pub joints: [usize; 3],
    /// Keep the end joint's rotation in model space, as a foot that stands.
    pub keep_end: bool,
}

/// Where a limb is to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Model space, metres.
    pub at: Point,
    /// Direction in model space to which the middle joint points; without it the limb bends as the
    /// pose does.
    pub pole: Option<Point>,
    /// 0 leaves the pose, 1 reaches.
    pub weight: f32,
}

/// Bends a limb so that its end joint comes to a target, in closed form by the law of cosines.
///
/// `rotations`, `model`: `[joints]`, of the pose in `local`, by [`super::rotations`] and
/// [`super::to_model`]; `local: [joints]` receives the rotations of the limb. Scales along the limb
/// must be uniform. O(joints between)
#[must_use]
pub fn reach(
    asset: &Asset<'_>,
    limb: &TwoBone,
    target: &Target,
    rotations: &[Quat4],
    model: &[Joint12],
    local: &mut [Local],
) -> Reach {
    solve(asset, limb, target, rotations, model, local).unwrap_or(Reach::Refused)
}

fn solve(
    asset: &Asset<'_>,
    limb: &TwoBone,
    target: &Target,
    rotations: &[Quat4],
    model: &[Joint12],
    local: &mut [Local],
) -> Option<Reach> {
    let [upper, middle, end] = limb.joints;
    if !(is_above(asset, upper, middle) && is_above(asset, middle, end)) {
        return None;
    }
    let place = |joint: usize| model.get(joint).map(|m| [m[3], m[7], m[11]]);
    let (a, b, c) = (place(upper)?, place(middle)?, place(end)?);
    let (first, first_length) = direction(minus(b, a))?;
    let (second, second_length) = direction(minus(c, b))?;
    let (along, distance) = direction(minus(target.at, a))?;
    if !target.weight.is_finite() {
        return None;
    }
    // Where the middle joint points now, and where it is to point.
    let (line, _) = direction(minus(c, a)).unwrap_or((first, 0.0));
    let wanted = match target.pole {
        Some(pole) => direction(pole)?.0,
        None => first,
    };
    let bend = direction(reject(first, line)).filter(|&(_, size)| size > 1e-3);
    let bend = bend.or_else(|| direction(reject(wanted, line)));
    let bend = bend.map_or_else(|| across(line), |(bend, _)| bend);
    let side = match target.pole {
        Some(_) => wanted,
        // Carried along with the limb, so that a target behind does not turn the knee round.
        None => rotate(arc(line, along), bend),
    };
    let side = direction(reject(side, along)).map_or_else(|| across(along), |(side, _)| side);

    let longest = first_length + second_length;
    let shortest = (first_length - second_length).abs();
    let reached = distance.min(longest).max(shortest.max(1e-6 * longest));
    let x = (first_length * first_length - second_length * second_length + reached * reached)
        / (2.0 * reached);
    let height = root(first_length * first_length - x * x);
    let knee = plus(scaled(along, x), scaled(side, height));
    let (first_wanted, _) = direction(knee)?;
    let (second_wanted, _) = direction(minus(scaled(along, reached), knee))?;

    // Both bones turn with the plane of the limb, so that the middle joint stays a hinge.
    let (plane, wanted_plane) = (cross(line, bend), cross(along, side));
    let upper_turn = turn_between((first, plane), (first_wanted, wanted_plane));
    let carried = rotate(upper_turn, second);
    let lower_turn = quaternion_product(arc(carried, second_wanted), upper_turn);

    let rotation = |joint: usize| rotations.get(joint).copied();
    let above = |joint: usize| match asset.parents.get(joint) {
        Some(&NO_PARENT) | None => Some([0.0, 0.0, 0.0, 1.0]),
        Some(&parent) => rotation(usize::from(parent)),
    };
    // What lies above a joint has turned with the bone before it.
    let relative = |joint: usize, before: Quat4, turn: Quat4| {
        let above = quaternion_product(before, above(joint)?);
        let own = quaternion_product(turn, rotation(joint)?);
        normalise(quaternion_product(conjugate(above), own))
    };
    const STILL: Quat4 = [0.0, 0.0, 0.0, 1.0];
    let turned = [
        relative(upper, STILL, upper_turn)?,
        relative(middle, upper_turn, lower_turn)?,
        relative(
            end,
            lower_turn,
            if limb.keep_end { STILL } else { lower_turn },
        )?,
    ];
    for (joint, turn) in limb.joints.into_iter().zip(turned) {
        set(local, joint, turn, target.weight);
    }
    let apart = distance - reached;
    let close = 1e-5 * longest;
    Some(if (-close..=close).contains(&apart) {
        Reach::Reached
    } else {
        Reach::Beyond
    })
}

/// A joint that is to look at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Which joint.
    pub joint: usize,
    /// The axis of the joint that points at the target, in its own space.
    pub axis: Point,
    /// Cosine of the largest angle by which it may turn from the pose; -1 lets it turn right round.
    pub limit: f32,
    /// 0 leaves the pose, 1 looks there.
    pub weight: f32,
}

/// Turns a joint by the shortest way so that an axis of it points at `target` (model space, metres).
///
/// Slices as in [`reach`]. For several joints (chest, neck, head) call it from top to bottom with
/// rising weights, with fresh `rotations` and `model` before each. O(1)
#[must_use]
pub fn look_at(
    asset: &Asset<'_>,
    look: &Look,
    target: Point,
    rotations: &[Quat4],
    model: &[Joint12],
    local: &mut [Local],
) -> Reach {
    aim(asset, look, target, rotations, model, local).unwrap_or(Reach::Refused)
}

fn aim(
    asset: &Asset<'_>,
    look: &Look,
    target: Point,
    rotations: &[Quat4],
    model: &[Joint12],
    local: &mut [Local],
) -> Option<Reach> {
    let matrix = model.get(look.joint)?;
    let own = *rotations.get(look.joint)?;
    let (wanted, _) = direction(minus(target, [matrix[3], matrix[7], matrix[11]]))?;
    let (axis, _) = direction(look.axis)?;
    if !(look.weight.is_finite() && (-1.0..=1.0).contains(&look.limit)) {
        return None;
    }
    let mut turn = arc(rotate(own, axis), wanted);
    let [x, y, z, w] = turn;
    // Cosine and sine of half the limit.
    let (most, sine) = (root(0.5 + 0.5 * look.limit), root(0.5 - 0.5 * look.limit));
    let limited = w < most;
    if limited && let Some((axis, _)) = direction([x, y, z]) {
        let [x, y, z] = scaled(axis, sine);
        turn = [x, y, z, most];
    }
    let parent = *asset.parents.get(look.joint)?;
    let above = if parent == NO_PARENT {
        [0.0, 0.0, 0.0, 1.0]
    } else {
        *rotations.get(usize::from(parent))?
    };
    let own = quaternion_product(turn, own);
    let relative = normalise(quaternion_product(conjugate(above), own))?;
    set(local, look.joint, relative, look.weight);
    Some(if limited {
        Reach::Beyond
    } else {
        Reach::Reached
    })
}

/// Mixes a rotation into a joint's.
fn set(local: &mut [Local], joint: usize, turn: Quat4, weight: f32) {
    if let Some(local) = local.get_mut(joint)
        && weight > 0.0
    {
        let mut goal = *local;
        set_rotation(&mut goal, turn);
        mix(local, &goal, weight.min(1.0));
    }
}

fn is_above(asset: &Asset<'_>, above: usize, joint: usize) -> bool {
    let mut at = joint;
    // Parents have smaller indices: no more steps than joints.
    for _ in 0..asset.parents.len() {
        match asset.parents.get(at) {
            Some(&parent) if parent != NO_PARENT => at = usize::from(parent),
            _ => return false,
        }
        if at == above {
            return true;
        }
    }
    false
}

/// The rotation that takes a direction and one across it to two others.
fn turn_between((from, across): (Point, Point), (to, to_across): (Point, Point)) -> Quat4 {
    let swing = arc(from, to);
    let carried = rotate(swing, across);
    let cosine = dot(carried, to_across);
    let sine = dot(cross(carried, to_across), to);
    // Half the angle about `to`: (sine, 1 + cosine) is twice its cosine times (sine, cosine).
    let [x, y, z] = scaled(to, sine);
    let twist = normalise([x, y, z, 1.0 + cosine]).unwrap_or([to[0], to[1], to[2], 0.0]);
    normalise(quaternion_product(twist, swing)).unwrap_or(swing)
}

/// The smallest rotation from one unit vector to another.
fn arc(from: Point, to: Point) -> Quat4 {
    let [x, y, z] = cross(from, to);
    normalise([x, y, z, 1.0 + dot(from, to)]).unwrap_or_else(|| {
        let [x, y, z] = across(from);
        [x, y, z, 0.0]
    })
}

/// A unit vector across another one.
fn across(v: Point) -> Point {
    let [x, y, z] = v;
    let other = if x.abs() < 0.6 {
        [0.0, z, -y]
    } else {
        [-z, 0.0, x]
    };
    direction(other).map_or([0.0, 1.0, 0.0], |(unit, _)| unit)
}

/// Unit vector and length; `None` where there is none.
fn direction(v: Point) -> Option<(Point, f32)> {
    let square = dot(v, v);
    if !(square > 1e-12 && square < 1e18) {
        return None;
    }
    let factor = inverse_sqrt(square);
    Some((scaled(v, factor), square * factor))
}

/// Square root; 0 of what is not above 0.
fn root(x: f32) -> f32 {
    if x > 1e-30 { x * inverse_sqrt(x) } else { 0.0 }
}

fn rotate(turn: Quat4, v: Point) -> Point {
    transform_vector(&affine(turn, [0.0; 3], [1.0; 3]), v)
}

fn reject(v: Point, from: Point) -> Point {
    minus(v, scaled(from, dot(v, from)))
}

fn dot([a, b, c]: Point, [x, y, z]: Point) -> f32 {
    a * x + b * y + c * z
}

fn cross([a, b, c]: Point, [x, y, z]: Point) -> Point {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

fn plus([a, b, c]: Point, [x, y, z]: Point) -> Point {
    [a + x, b + y, c + z]
}

fn minus([a, b, c]: Point, [x, y, z]: Point) -> Point {
    [a - x, b - y, c - z]
}

fn scaled(v: Point, by: f32) -> Point {
    v.map(|x| x * by)
}
