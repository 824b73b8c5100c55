//! The Virtual Motion Capture protocol, as VR and VTuber tools send it: joint rotations of a
//! humanoid over OSC, usually to UDP port 39539.
//!
//! | address | arguments |
//! | --- | --- |
//! | `/VMC/Ext/OK` | whether a body is loaded and tracked |
//! | `/VMC/Ext/T` | the sender's time, seconds |
//! | `/VMC/Ext/Root/Pos` | name, position, quaternion x y z w |
//! | `/VMC/Ext/Bone/Pos` | Unity's name of a humanoid bone, position and rotation relative to its parent |
//!
//! Unity's space is left-handed with Y up: x and the quaternion's y and z change sign here. All
//! bones lie along the world's axes in the T-pose. Other addresses are left alone.

use glam::{DQuat, DVec3};

use super::LiveError;
use super::osc::{self, Argument, Bundle};

/// Port that senders use unless told otherwise.
pub const PORT: u16 = 39_539;

/// Unity's humanoid bones and their parents, by number; a parent comes before its children.
pub const BONES: [(&str, Option<usize>); 55] = [
    ("Hips", None),
    ("Spine", Some(0)),
    ("Chest", Some(1)),
    ("UpperChest", Some(2)),
    ("Neck", Some(3)),
    ("Head", Some(4)),
    ("LeftEye", Some(5)),
    ("RightEye", Some(5)),
    ("Jaw", Some(5)),
    ("LeftShoulder", Some(3)),
    ("LeftUpperArm", Some(9)),
    ("LeftLowerArm", Some(10)),
    ("LeftHand", Some(11)),
    ("RightShoulder", Some(3)),
    ("RightUpperArm", Some(13)),
    ("RightLowerArm", Some(14)),
    ("RightHand", Some(15)),
    ("LeftUpperLeg", Some(0)),
    ("LeftLowerLeg", Some(17)),
    ("LeftFoot", Some(18)),
    ("LeftToes", Some(19)),
    ("RightUpperLeg", Some(0)),
    ("RightLowerLeg", Some(21)),
    ("RightFoot", Some(22)),
    ("RightToes", Some(23)),
    ("LeftThumbProximal", Some(12)),
    ("LeftThumbIntermediate", Some(25)),
    ("LeftThumbDistal", Some(26)),
    ("LeftIndexProximal", Some(12)),
    ("LeftIndexIntermediate", Some(28)),
    ("LeftIndexDistal", Some(29)),
    ("LeftMiddleProximal", Some(12)),
    ("LeftMiddleIntermediate", Some(31)),
    ("LeftMiddleDistal", Some(32)),
    ("LeftRingProximal", Some(12)),
    ("LeftRingIntermediate", Some(34)),
    ("LeftRingDistal", Some(35)),
    ("LeftLittleProximal", Some(12)),
    ("LeftLittleIntermediate", Some(37)),
    ("LeftLittleDistal", Some(38)),
    ("RightThumbProximal", Some(16)),
    ("RightThumbIntermediate", Some(40)),
    ("RightThumbDistal", Some(41)),
    ("RightIndexProximal", Some(16)),
    ("RightIndexIntermediate", Some(43)),
    ("RightIndexDistal", Some(44)),
    ("RightMiddleProximal", Some(16)),
    ("RightMiddleIntermediate", Some(46)),
    ("RightMiddleDistal", Some(47)),
    ("RightRingProximal", Some(16)),
    ("RightRingIntermediate", Some(49)),
    ("RightRingDistal", Some(50)),
    ("RightLittleProximal", Some(16)),
    ("RightLittleIntermediate", Some(52)),
    ("RightLittleDistal", Some(53)),
];

/// Where a bone is, relative to its parent: metres, right-handed, Y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Position.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
}

/// What one datagram says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packet {
    /// The sender's time, seconds.
    pub time: Option<f64>,
    /// Whether the sender has a body that it tracks.
    pub tracked: Option<bool>,
    /// The model's root.
    pub root: Option<Placed>,
    /// Index into [`BONES`], and where the bone is.
    pub bones: Vec<(usize, Placed)>,
}

/// Reads a datagram. O(bytes)
///
/// # Errors
/// Bytes that are no OSC, numbers that are not finite; then nothing of the datagram counts.
pub fn read(packet: &[u8]) -> Result<Packet, LiveError> {
    let mut found = Packet::default();
    for message in osc::messages(packet)? {
        match message.address {
            "/VMC/Ext/T" => {
                let time = message.number(0).map(f64::from);
                found.time = Some(time.filter(|time| time.is_finite()).ok_or_else(|| {
                    LiveError::NotFinite {
                        what: "the value",
                        name: "/VMC/Ext/T".into(),
                    }
                })?);
            }
            "/VMC/Ext/OK" => {
                // Loaded; later versions add calibration state and mode, then tracking status.
                let state = |at| message.number(at).is_none_or(|state| state != 0.0);
                found.tracked = Some(state(0) && state(3));
            }
            "/VMC/Ext/Root/Pos" => found.root = placed(&message)?,
            "/VMC/Ext/Bone/Pos" => {
                let name = message.text(0).unwrap_or_default();
                let bone = BONES.iter().position(|(bone, _)| *bone == name);
                if let (Some(bone), Some(placed)) = (bone, placed(&message)?) {
                    found.bones.push((bone, placed));
                }
            }
            _ => {}
        }
    }
    Ok(found)
}

fn placed(message: &osc::Message<'_>) -> Result<Option<Placed>, LiveError> {
    let Some([x, y, z, qx, qy, qz, qw]) = message.numbers(1) else {
        return Ok(None);
    };
    let name = || message.text(0).unwrap_or_default().to_owned();
    let position = DVec3::new(-f64::from(x), y.into(), z.into());
    let rotation = DQuat::from_xyzw(qx.into(), -f64::from(qy), -f64::from(qz), qw.into());
    if !position.is_finite() || position.abs().max_element() > 1e6 {
        return Err(LiveError::NotFinite {
            what: "the position",
            name: name(),
        });
    }
    let length = rotation.length();
    if !(1e-3..1e3).contains(&length) {
        return Err(LiveError::NotFinite {
            what: "the rotation",
            name: name(),
        });
    }
    Ok(Some(Placed {
        position,
        rotation: rotation.normalize(),
    }))
}

/// The datagram that says this.
#[must_use]
pub fn write(packet: &Packet) -> Vec<u8> {
    let mut bundle = Bundle::new();
    if let Some(tracked) = packet.tracked {
        bundle.push("/VMC/Ext/OK", &[Argument::Int(tracked.into())]);
    }
    if let Some(time) = packet.time {
        bundle.push("/VMC/Ext/T", &[Argument::Float(time as f32)]);
    }
    if let Some(root) = &packet.root {
        bundle.push("/VMC/Ext/Root/Pos", &arguments("root", root));
    }
    for (bone, placed) in &packet.bones {
        if let Some((name, _)) = BONES.get(*bone) {
            bundle.push("/VMC/Ext/Bone/Pos", &arguments(name, placed));
        }
    }
    bundle.into_bytes()
}

fn arguments<'n>(name: &'n str, placed: &Placed) -> [Argument<'n>; 8] {
    let (p, q) = (placed.position.as_vec3(), placed.rotation.as_quat());
    let float = Argument::Float;
    [
        Argument::Text(name),
        float(-p.x),
        float(p.y),
        float(p.z),
        float(q.x),
        float(-q.y),
        float(-q.z),
        float(q.w),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_first() {
        for (bone, (_, parent)) in BONES.iter().enumerate() {
            assert!(parent.is_none_or(|parent| parent < bone));
        }
    }

    #[test]
    fn a_packet_survives_and_changes_hands() {
        let placed = Placed {
            position: DVec3::new(0.25, 1.0, -0.5),
            rotation: DQuat::from_xyzw(0.5, 0.5, -0.5, 0.5),
        };
        let packet = Packet {
            time: Some(1.5),
            tracked: Some(true),
            root: Some(placed),
            bones: vec![(0, placed), (54, placed)],
        };
        let bytes = write(&packet);
        assert_eq!(read(&bytes), Ok(packet));
        // On the wire it is Unity's: x mirrored.
        let found = osc::messages(&bytes).expect("reads");
        let numbers: [f32; 7] = found[2].numbers(1).expect("seven numbers");
        assert_eq!(numbers, [-0.25, 1.0, -0.5, 0.5, -0.5, 0.5, 0.5]);
    }

    #[test]
    fn numbers_that_are_none_refuse_the_packet() {
        let mut bundle = Bundle::new();
        let mut values = [Argument::Float(0.0); 8];
        values[0] = Argument::Text("Hips");
        bundle.push("/VMC/Ext/Bone/Pos", &values);
        let error = read(&bundle.into_bytes()).expect_err("no rotation");
        assert!(matches!(error, LiveError::NotFinite { .. }));
        let mut bundle = Bundle::new();
        bundle.push("/VMC/Ext/T", &[Argument::Float(f32::NAN)]);
        assert!(read(&bundle.into_bytes()).is_err());
    }
}
