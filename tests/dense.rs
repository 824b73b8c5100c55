//! Dense marker captures of bodies whose shape, pose and markers are known.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use sinew_host::fit::{Humanoid, Part, Side, Which};
use sinew_host::import::gltf::read_gltf;
use sinew_host::model::{Avatar, Skeleton, Transform};
use sinew_host::studio::{MarkerLayout, MarkerSet, Surface};

use crate::{Random, root};

/// The bundled body.
///
/// # Panics
/// When the bundled file is absent or no longer fits.
#[must_use]
pub fn human() -> Avatar {
    let bytes = fs::read(root().join("examples/data/human.glb")).expect("human.glb");
    let raw = read_gltf(&bytes, "human.glb", Path::new("")).expect("a body");
    Avatar::new(raw, "human.glb").expect("a sound body").0
}

/// A body in another shape: `offsets` `[vertices]` on the rest mesh; joints go with the skin around
/// them.
///
/// # Panics
/// When there is not one offset a vertex.
#[must_use]
pub fn reshape(avatar: &Avatar, offsets: &[DVec3]) -> Avatar {
    assert_eq!(offsets.len(), avatar.mesh.positions.len());
    let joints = &avatar.skeleton.joints;
    let mut bind: Vec<DAffine3> = avatar.skeleton.model(&avatar.skeleton.rest());
    for stated in &avatar.skin.binds {
        bind[stated.joint] = stated.inverse_bind.inverse();
    }
    let mut sums = vec![(DVec3::ZERO, 0.0); joints.len()];
    for (list, offset) in avatar.skin.influences.iter().zip(offsets) {
        let of = |joint: usize| -> f64 {
            let on = list
                .iter()
                .filter(|at| avatar.skin.binds[at.0 as usize].joint == joint);
            on.map(|at| at.1).sum()
        };
        for &(at, weight) in list {
            let joint = avatar.skin.binds[at as usize].joint;
            let share = weight.min(joints[joint].parent.map_or(weight, of)) + 1e-6;
            sums[joint].0 += *offset * share;
            sums[joint].1 += share;
        }
    }
    let mut shifts = vec![DVec3::ZERO; joints.len()];
    for (joint, (sum, weight)) in sums.into_iter().enumerate() {
        shifts[joint] = if weight > 0.0 {
            sum / weight
        } else {
            joints[joint]
                .parent
                .map_or(DVec3::ZERO, |above| shifts[above])
        };
        bind[joint].translation += shifts[joint];
    }
    let mut out = avatar.clone();
    for (at, offset) in out.mesh.positions.iter_mut().zip(offsets) {
        *at += *offset;
    }
    for (index, joint) in out.skeleton.joints.iter_mut().enumerate() {
        let local = joint
            .parent
            .map_or(bind[index], |above| bind[above].inverse() * bind[index]);
        let (scale, rotation, translation) = local.to_scale_rotation_translation();
        joint.rest = Transform {
            translation,
            rotation,
            scale,
        };
    }
    for stated in &mut out.skin.binds {
        stated.inverse_bind = bind[stated.joint].inverse();
    }
    out
}

/// Offsets that make a body taller, broader and fuller around the waist, the more so the larger
/// `amount` (1 is a large difference between people).
#[must_use]
pub fn other_proportions(avatar: &Avatar, amount: f64) -> Vec<DVec3> {
    let height = avatar
        .mesh
        .positions
        .iter()
        .map(|p| p.y)
        .fold(0.0, f64::max);
    let offset = |at: &DVec3| {
        let up = at.y / height;
        let waist = (-((up - 0.6) / 0.12).powi(2)).exp();
        let legs = 0.10 * up.min(0.5) * 2.0;
        let across = 0.04 + 0.18 * waist * (1.0 - (at.x.abs() / 0.3).min(1.0));
        DVec3::new(
            at.x * (0.06 + across * 0.6),
            at.y * (legs / 2.0 + 0.03),
            at.z * across,
        ) * amount
    };
    avatar.mesh.positions.iter().map(offset).collect()
}

/// The woman of MakeHuman's base mesh, as offsets of the bundled body; `None` where the recordings
/// are absent.
///
/// # Panics
/// When the files are no longer as they were.
#[must_use]
pub fn woman(avatar: &Avatar) -> Option<Vec<DVec3>> {
    let base = crate::shared("mesh/makehuman_base.obj")?;
    let target = crate::shared("mesh/makehuman_african-female-young.target")?;
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect()
    };
    let text = fs::read_to_string(base).expect("readable");
    let vertices = text.lines().filter(|line| line.starts_with("v "));
    let mut points: Vec<DVec3> = vertices
        .map(|line| DVec3::from_slice(&numbers(line)))
        .collect();
    for line in fs::read_to_string(target).expect("readable").lines() {
        if let [vertex, x, y, z] = numbers(line)[..]
            && !line.starts_with('#')
        {
            points[vertex as usize] += DVec3::new(x, y, z);
        }
    }
    points.truncate(avatar.mesh.positions.len());
    let sole = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let points = points.iter().map(|p| (*p - DVec3::Y * sole) * 0.1);
    Some(
        points
            .zip(&avatar.mesh.positions)
            .map(|(to, from)| to - *from)
            .collect(),
    )
}

/// Local transforms of a pose in which the upper arms point `lowered` degrees below level, elbows
/// and knees are bent by `bent` degrees, the trunk twisted and inclined a little with it.
///
/// # Panics
/// Unless the body is human.
#[must_use]
pub fn pose(avatar: &Avatar, lowered: f64, bent: f64) -> Vec<Transform> {
    let human = Humanoid::new(&avatar.skeleton, Which::Target).expect("human");
    let mut local = avatar.skeleton.rest();
    let turn = |local: &mut Vec<Transform>, joint: usize, turn: DQuat| {
        let above = avatar.skeleton.joints[joint].parent;
        let above = above.map_or(DQuat::IDENTITY, |above| {
            rotation(&avatar.skeleton, local, above)
        });
        local[joint].rotation = above.inverse() * turn * above * local[joint].rotation;
    };
    let place = |local: &[Transform], joint: usize| avatar.skeleton.model(local)[joint].translation;
    if let Some(&spine) = human.spine.first() {
        let bend = DQuat::from_rotation_y(0.3 * bent.to_radians())
            * DQuat::from_rotation_x(0.2 * bent.to_radians());
        turn(&mut local, spine, bend);
    }
    for (side, out) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
        let joint = |part| human.limb(side, part).expect("limbs");
        let (arm, fore, leg, shin) = (
            joint(Part::UpperArm),
            joint(Part::LowerArm),
            joint(Part::UpperLeg),
            joint(Part::LowerLeg),
        );
        let angle = lowered.to_radians();
        let wanted = DVec3::new(out * angle.cos(), -angle.sin(), 0.0);
        let now = (place(&local, fore) - place(&local, arm)).normalize();
        turn(&mut local, arm, DQuat::from_rotation_arc(now, wanted));
        let hinge = DQuat::from_rotation_x(-bent.to_radians());
        turn(&mut local, fore, hinge);
        if side == Side::Left {
            turn(
                &mut local,
                leg,
                DQuat::from_rotation_x(-0.6 * bent.to_radians()),
            );
            turn(&mut local, shin, DQuat::from_rotation_x(bent.to_radians()));
        }
    }
    local
}

fn rotation(skeleton: &Skeleton, local: &[Transform], joint: usize) -> DQuat {
    let above = skeleton.joints[joint].parent;
    let above = above.map_or(DQuat::IDENTITY, |above| rotation(skeleton, local, above));
    above * local[joint].rotation
}

/// The skin in a pose, `[vertices]`, turned by `yaw` and set down somewhere.
#[must_use]
pub fn skin(avatar: &Avatar, local: &[Transform], yaw: f64) -> Vec<DVec3> {
    let model = avatar.skeleton.model(local);
    let binds = avatar.skin.binds.iter();
    let palette: Vec<DAffine3> = binds
        .map(|bind| model[bind.joint] * bind.inverse_bind)
        .collect();
    let vertices = avatar.mesh.positions.iter().zip(&avatar.skin.influences);
    let place = DAffine3::from_rotation_translation(
        DQuat::from_rotation_y(yaw),
        DVec3::new(0.4, 0.0, -0.7),
    );
    vertices
        .map(|(rest, list)| {
            let parts = list
                .iter()
                .map(|&(bind, weight)| weight * palette[bind as usize].transform_point3(*rest));
            place.transform_point3(parts.sum())
        })
        .collect()
}

/// Markers glued to a body at rest.
///
/// # Panics
/// When the body has no room for them.
#[must_use]
pub fn markers(avatar: &Avatar, count: usize, seed: u64) -> MarkerSet {
    MarkerSet::new(avatar, MarkerLayout::Dense(count), seed).expect("room for markers")
}

/// Where markers are measured on a surface: true positions plus noise of `sigma` metres an axis.
#[must_use]
pub fn measured(
    markers: &MarkerSet,
    positions: &[DVec3],
    sigma: f64,
    random: &mut Random,
) -> Vec<DVec3> {
    let surface = Surface {
        positions: positions.to_vec(),
        normals: Vec::new(),
    };
    let mut normal = || {
        let radius = (-2.0 * (1.0 - random.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * random.unit()).cos()
    };
    let truth = markers.positions(&surface);
    truth
        .iter()
        .map(|at| *at + DVec3::new(normal(), normal(), normal()) * sigma)
        .collect()
}

/// Local transforms of a take in which one joint after another goes through its range, `frames` of
/// them.
///
/// # Panics
/// Unless the body is human.
#[must_use]
pub fn range_of_motion(avatar: &Avatar, frames: usize) -> Vec<Vec<Transform>> {
    let human = Humanoid::new(&avatar.skeleton, Which::Target).expect("human");
    // (joint, largest turns about x, y and z in degrees)
    let mut moves: Vec<(usize, [f64; 3])> = Vec::new();
    for (side, sign) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
        let mut limb = |part, turn: [f64; 3]| {
            let joint = human.limb(side, part).expect("limbs");
            moves.push((joint, [turn[0], sign * turn[1], sign * turn[2]]));
        };
        limb(Part::UpperArm, [60.0, 30.0, 45.0]);
        limb(Part::LowerArm, [-80.0, 0.0, 0.0]);
        limb(Part::Hand, [20.0, 0.0, 50.0]);
        limb(Part::UpperLeg, [-60.0, 10.0, 25.0]);
        limb(Part::LowerLeg, [80.0, 0.0, 0.0]);
        limb(Part::Foot, [30.0, 10.0, 0.0]);
    }
    let middle = |list: &[usize]| list.last().copied().unwrap_or(human.hips);
    moves.push((
        human.spine.first().copied().unwrap_or(human.hips),
        [35.0, 25.0, 20.0],
    ));
    moves.push((middle(&human.spine), [15.0, 25.0, 10.0]));
    moves.push((middle(&human.neck), [30.0, 45.0, 20.0]));
    (0..frames)
        .map(|frame| {
            let mut local = avatar.skeleton.rest();
            for (at, (joint, turn)) in moves.iter().enumerate() {
                let seconds = frame as f64 * (0.31 + 0.057 * at as f64);
                let [x, y, z] = [0.0, 1.1, 2.3].map(|late| (seconds + late + at as f64).sin());
                let by = DQuat::from_rotation_x((turn[0] * x).to_radians())
                    * DQuat::from_rotation_y((turn[1] * y).to_radians())
                    * DQuat::from_rotation_z((turn[2] * z).to_radians());
                let above = avatar.skeleton.joints[*joint].parent;
                let above = above.map_or(DQuat::IDENTITY, |above| {
                    rotation(&avatar.skeleton, &local, above)
                });
                local[*joint].rotation = above.inverse() * by * above * local[*joint].rotation;
            }
            local
        })
        .collect()
}
