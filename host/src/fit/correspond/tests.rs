use super::*;
use crate::fit::humanoid::{Part, Side};
use crate::model::{Joint, Transform};

fn skeleton(joints: &[(&str, usize)]) -> Skeleton {
    let joint = |(at, &(name, parent)): (usize, &(&str, usize))| Joint {
        name: name.into(),
        parent: (at > 0).then_some(parent),
        rest: Transform::IDENTITY,
    };
    Skeleton {
        joints: joints.iter().enumerate().map(joint).collect(),
    }
}

/// Three spine joints, two neck joints, a stub that only this rig has.
const LONG: &[(&str, usize)] = &[
    ("Hips", 0),
    ("LHipJoint", 0),
    ("LeftUpLeg", 1),
    ("LeftLeg", 2),
    ("LeftFoot", 3),
    ("RightUpLeg", 0),
    ("RightLeg", 5),
    ("RightFoot", 6),
    ("LowerBack", 0),
    ("Spine", 8),
    ("Spine1", 9),
    ("LeftArm", 10),
    ("RightArm", 10),
    ("Neck", 10),
    ("Head", 13),
];

/// Two spine joints, no neck.
const SHORT: &[(&str, usize)] = &[
    ("pelvis", 0),
    ("thigh_l", 0),
    ("calf_l", 1),
    ("foot_l", 2),
    ("thigh_r", 0),
    ("calf_r", 4),
    ("foot_r", 5),
    ("spine_01", 0),
    ("spine_02", 7),
    ("upperarm_l", 8),
    ("upperarm_r", 8),
    ("head", 8),
];

fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs
        .iter()
        .map(|&(a, b)| (a.to_owned(), b.to_owned()))
        .collect()
}

#[test]
fn spine_and_neck_are_spread() {
    let both = Correspondence::new(&skeleton(SHORT), &skeleton(LONG), &[]).unwrap();
    let third = 1.0 / 3.0;
    assert_eq!(both.drives[0], Some(Drive::Joint(0)));
    assert_eq!(both.drives[8], Some(Drive::Between(0, 7, 2.0 * third)));
    assert_eq!(both.drives[9], Some(Drive::Between(7, 8, third)));
    assert_eq!(both.drives[10], Some(Drive::Joint(8)));
    assert_eq!(both.drives[13], Some(Drive::Between(8, 11, 0.5)));
    assert_eq!(both.drives[14], Some(Drive::Joint(11)));
    assert_eq!(both.drives[12], Some(Drive::Joint(10)));
    assert_eq!(both.unmapped_target(&skeleton(LONG)), [1]);
    assert_eq!(both.unmapped_limbs(), []);
}

#[test]
fn what_is_left_over_is_reported() {
    let mut joints = LONG.to_vec();
    joints.extend([("Tail", 0), ("LeftHand", 11)]);
    let both = Correspondence::new(&skeleton(SHORT), &skeleton(&joints), &[]).unwrap();
    assert_eq!(both.unmapped_target(&skeleton(&joints)), [1, 15, 16]);
    assert_eq!(both.unmapped_limbs(), [Role::Limb(Side::Left, Part::Hand)]);
    let back = Correspondence::new(&skeleton(&joints), &skeleton(SHORT), &[]).unwrap();
    // The middle of three joints steers neither of two: 3/2 lies between first and second.
    assert_eq!(back.drives[7], Some(Drive::Between(8, 9, 0.5)));
    assert_eq!(back.unmapped_source(&skeleton(&joints)), [1, 13, 15, 16]);
}

#[test]
fn a_pair_overrules() {
    let mut joints = SHORT.to_vec();
    joints[1].0 = "Bone7";
    let source = skeleton(&joints);
    let target = skeleton(LONG);
    assert!(matches!(
        Correspondence::new(&source, &target, &[]),
        Err(FitError::MissingRole {
            which: Which::Source,
            ..
        })
    ));
    for pair in [("Bone7", "LeftUpLeg"), ("bone7", "leftUpperLeg")] {
        let both = Correspondence::new(&source, &target, &pairs(&[pair])).unwrap();
        assert_eq!(both.drives[2], Some(Drive::Joint(1)), "{pair:?}");
    }
    let both = pairs(&[("Bone7", "LeftUpLeg"), ("spine_01", "Spine1")]);
    let both = Correspondence::new(&source, &target, &both).unwrap();
    assert_eq!(both.drives[10], Some(Drive::Joint(7)));
}

#[test]
fn bad_pairs_are_refused() {
    let (source, target) = (skeleton(SHORT), skeleton(LONG));
    let run = |given: &[(&str, &str)]| Correspondence::new(&source, &target, &pairs(given));
    let error = run(&[("thigh", "LeftUpLeg")]).unwrap_err();
    assert!(error.to_string().contains("thigh_l, thigh_r"), "{error}");
    assert!(matches!(
        run(&[("thigh_l", "Wing")]),
        Err(FitError::UnknownJoint {
            which: Which::Target,
            ..
        })
    ));
    assert!(matches!(
        run(&[("head", "leftFoot")]),
        Err(FitError::MissingRole { .. })
    ));
    assert!(matches!(
        run(&[("rightHand", "leftHand")]),
        Err(FitError::NoJoint { .. })
    ));
    assert!(matches!(
        run(&[("thigh_l", "LeftUpLeg"), ("thigh_r", "LeftUpLeg")]),
        Err(FitError::MappedTwice { .. })
    ));
    assert!(matches!(
        run(&[("thigh_l", "leftUpperLeg"), ("thigh_r", "leftUpperLeg")]),
        Err(FitError::MappedTwice { .. })
    ));
}
