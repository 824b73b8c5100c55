//! A small body made by code: an arm of three joints, bent and stretched by two clips.

use glam::{DAffine3, DQuat, DVec3};
use sinew_host::import::{
    Channel, Interpolation, RawAvatar, RawClip, RawJoint, RawMesh, RawPrimitive, RawSkeleton,
    RawSkin, RawTrack, Transform,
};
use sinew_host::model::Avatar;

/// A tube of 9 rings of 10 vertices along y, 0.6 m long; joints at 0, 0.3 and 0.6 m; 90 vertices,
/// so the last block is short.
#[must_use]
pub fn arm() -> RawAvatar {
    const RINGS: u32 = 9;
    const SIDES: u32 = 10;
    let height = |ring: u32| 0.6 * f64::from(ring) / f64::from(RINGS - 1);
    let mut mesh = RawMesh {
        name: "arm".into(),
        ..RawMesh::default()
    };
    let mut influences = Vec::new();
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let angle = std::f64::consts::TAU * f64::from(side) / f64::from(SIDES);
            let y = height(ring);
            mesh.positions
                .push(DVec3::new(0.05 * angle.cos(), y, 0.05 * angle.sin()));
            let bend = ((y - 0.2) / 0.2).clamp(0.0, 1.0);
            let hand = ((y - 0.5) / 0.1).clamp(0.0, 1.0);
            influences.push(vec![
                (0, 1.0 - bend),
                (1, bend * (1.0 - hand)),
                (2, bend * hand),
            ]);
        }
    }
    let mut side_quads = RawPrimitive {
        name: "skin".into(),
        ..RawPrimitive::default()
    };
    for ring in 0..RINGS - 1 {
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            let (below, above) = (ring * SIDES, (ring + 1) * SIDES);
            side_quads
                .corners
                .extend([below + side, above + side, above + next, below + next]);
            side_quads.polygon_sizes.push(4);
        }
    }
    mesh.primitives.push(side_quads);
    let joint = |name: &str, parent, y| RawJoint {
        name: name.into(),
        parent,
        rest: Transform {
            translation: DVec3::new(0.0, y, 0.0),
            ..Transform::IDENTITY
        },
    };
    RawAvatar {
        mesh,
        skeleton: RawSkeleton {
            joints: vec![
                joint("shoulder", None, 0.0),
                joint("elbow", Some(0), 0.3),
                joint("hand", Some(1), 0.3),
            ],
        },
        skin: RawSkin {
            joints: vec![0, 1, 2],
            inverse_bind: [0.0, 0.3, 0.6]
                .map(|y| DAffine3::from_translation(DVec3::new(0.0, -y, 0.0)))
                .to_vec(),
            influences,
        },
        clips: vec![bend(), stretch()],
        notices: Vec::new(),
    }
}

/// The arm after its checks.
///
/// # Panics
/// Never: the arm is sound.
#[must_use]
pub fn checked_arm() -> Avatar {
    Avatar::new(arm(), "arm").expect("the arm is sound").0
}

fn bend() -> RawClip {
    let turn = |angle: f64| DQuat::from_rotation_x(angle).to_array();
    let track = |joint, interpolation, values: Vec<[f64; 4]>, times: &[f64]| RawTrack {
        joint,
        channel: Channel::Rotation,
        interpolation,
        times: times.to_vec(),
        values,
    };
    let zero = [0.0; 4];
    RawClip {
        name: "bend".into(),
        tracks: vec![
            track(
                1,
                Interpolation::Linear,
                vec![turn(0.0), turn(2.2), turn(0.0)],
                &[0.0, 0.5, 1.0],
            ),
            track(
                2,
                Interpolation::CubicSpline,
                vec![zero, turn(0.0), zero, zero, turn(0.9), zero],
                &[0.0, 1.0],
            ),
        ],
        ..RawClip::default()
    }
}

fn stretch() -> RawClip {
    RawClip {
        name: "stretch".into(),
        tracks: vec![
            RawTrack {
                joint: 1,
                channel: Channel::Scale,
                interpolation: Interpolation::Linear,
                times: vec![0.0, 1.0],
                values: vec![[1.0, 1.0, 1.0, 0.0], [1.5, 2.0, 0.5, 0.0]],
            },
            RawTrack {
                joint: 0,
                channel: Channel::Translation,
                interpolation: Interpolation::Step,
                times: vec![0.0, 0.5],
                values: vec![[0.0; 4], [0.0, 1.0, 0.0, 0.0]],
            },
        ],
        ..RawClip::default()
    }
}
