//! The core's motion tools against `f64` oracles, and feet held on bodies of other sizes.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use sinew_core::asset::Asset;
use sinew_core::frame::Input;
use sinew_core::math::Quat4;
use sinew_core::pose::aim::{Look, Reach, Target, TwoBone, look_at, reach};
use sinew_core::pose::{self, Joint12, Local};
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::fit::feet::sole::Sole;
use sinew_host::fit::{Correspondence, Options, Part, Side, feet, floor, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Motion};
use sinew_host::reference::aim::two_bone;
use sinew_host::reference::pose::sample;
use sinew_host::reference::unpack;
use sinew_host::verify::{CORE_LIMIT, verify};
use sinew_tests::{Random, root, shared};

fn body() -> Avatar {
    let bytes = fs::read(root().join("examples/data/human.glb")).unwrap();
    let raw = read_gltf(&bytes, "human.glb", Path::new("")).unwrap();
    Avatar::new(raw, "human.glb").unwrap().0
}

fn motion(path: &Path) -> Motion {
    let name = path.display().to_string();
    let raw = read_bvh(&fs::read(path).unwrap(), &name).unwrap();
    Motion::new(raw, &name).unwrap().0
}

fn walk() -> Motion {
    motion(&root().join("examples/data/walk.bvh"))
}

/// A number between -1 and 1.
fn signed(random: &mut Random) -> f64 {
    2.0 * random.unit() - 1.0
}

fn vector(random: &mut Random) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| signed(random)))
}

fn turn(random: &mut Random) -> DQuat {
    DQuat::from_scaled_axis(3.1 * vector(random)).normalize()
}

fn local(random: &mut Random) -> Local {
    let [x, y, z, w] = turn(random).as_quat().to_array();
    let [a, b, c] = vector(random).as_vec3().to_array();
    let scale: [f32; 3] = std::array::from_fn(|_| (1.0 + 0.4 * signed(random)) as f32);
    [x, y, z, w, a, b, c, scale[0], scale[1], scale[2]]
}

fn rotation(local: &Local) -> DQuat {
    let [x, y, z, w, ..] = local.map(f64::from);
    DQuat::from_xyzw(x, y, z, w).normalize()
}

/// The angle between two rotations, radians.
fn apart(a: DQuat, b: DQuat) -> f64 {
    2.0 * (a.inverse() * b).xyz().length().min(1.0).asin()
}

#[test]
fn blends_agree_with_the_oracle() {
    let mut random = Random(3);
    for _ in 0..2000 {
        let (a, b) = (local(&mut random), local(&mut random));
        let weight = random.unit();
        let mut mixed = [a];
        pose::crossfade(&mut mixed, &[b], weight as f32, None);
        let weight = f64::from(weight as f32);
        let (from, to) = (rotation(&a), rotation(&b));
        // Half a turn apart, both ways are the shorter one.
        if from.dot(to).abs() < 1e-3 {
            continue;
        }
        let to = if from.dot(to) < 0.0 { -to } else { to };
        assert!(apart(rotation(&mixed[0]), from.slerp(to, weight)) < 2e-6);
        for at in 4..10 {
            let (a, b) = (f64::from(a[at]), f64::from(b[at]));
            assert!((f64::from(mixed[0][at]) - (a + (b - a) * weight)).abs() < 1e-6);
        }
        let mut delta = [Local::default()];
        pose::difference(&[b], &[a], &mut delta);
        let mut sum = [a];
        pose::add(&mut sum, &delta, weight as f32, None);
        let added = from * DQuat::IDENTITY.slerp(shorter(from.inverse() * to), weight);
        assert!(apart(rotation(&sum[0]), added) < 4e-6);
    }
}

fn shorter(turn: DQuat) -> DQuat {
    if turn.w < 0.0 { -turn } else { turn }
}

/// Model-space matrices and rotations of a pose, as the core computes them.
fn placed(asset: &Asset<'_>, local: &[Local]) -> (Vec<Quat4>, Vec<Joint12>) {
    let mut rotations = vec![[0.0; 4]; local.len()];
    let mut model = vec![[0.0; 12]; local.len()];
    pose::rotations(asset, local, &mut rotations);
    assert_eq!(pose::to_model(asset, local, &mut model), 0);
    (rotations, model)
}

fn place(model: &Joint12) -> DVec3 {
    DVec3::new(model[3].into(), model[7].into(), model[11].into())
}

fn narrow(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

#[test]
fn limbs_reach_and_agree_with_the_oracle() {
    let avatar = body();
    let bytes = bake(&avatar, &BakeOptions::default()).unwrap().bytes;
    let asset = bytes.asset().unwrap();
    let human =
        sinew_host::fit::Humanoid::new(&avatar.skeleton, sinew_host::fit::Which::Target).unwrap();
    let of = |part| human.limb(Side::Left, part).unwrap();
    let limbs = [
        [of(Part::UpperLeg), of(Part::LowerLeg), of(Part::Foot)],
        [of(Part::UpperArm), of(Part::LowerArm), of(Part::Hand)],
    ];
    let mut random = Random(11);
    let mut rest = vec![Local::default(); asset.dims().joint_count];
    pose::rest(&asset, &mut rest);
    let (mut worst_place, mut worst_turn): (f64, f64) = (0.0, 0.0);
    for round in 0..400 {
        let joints = limbs[round % 2];
        let mut local = rest.clone();
        // Bend the limb somehow first; now and then leave it straight.
        for joint in &joints[..2] {
            let by = 0.6 * vector(&mut random);
            let own = rotation(&local[*joint]) * DQuat::from_scaled_axis(by);
            let [x, y, z, w] = own.as_quat().to_array();
            local[*joint][..4].copy_from_slice(&[x, y, z, w]);
        }
        let (rotations, model) = placed(&asset, &local);
        let places = joints.map(|joint| place(&model[joint]));
        let length = places[0].distance(places[1]) + places[1].distance(places[2]);
        let way = vector(&mut random).normalize_or(DVec3::X);
        let target = places[0] + way * length * (0.3 + random.unit());
        let pole = (round % 3 == 0).then(|| vector(&mut random));
        if pole.is_some_and(|pole| pole.normalize().dot(way).abs() > 0.98) {
            continue;
        }
        let limb = TwoBone {
            joints,
            keep_end: round % 5 == 0,
        };
        let goal = Target {
            at: narrow(target),
            pole: pole.map(narrow),
            weight: 1.0,
        };
        let mut bent = local.clone();
        let came = reach(&asset, &limb, &goal, &rotations, &model, &mut bent);
        assert_ne!(came, Reach::Refused);
        let (after, moved) = placed(&asset, &bent);
        let end = place(&moved[joints[2]]);
        let wanted = places[0] + (target - places[0]).clamp_length_max(length);
        worst_place = worst_place.max(end.distance(wanted));
        assert_eq!(
            came == Reach::Reached,
            target.distance(places[0]) < length + 1e-5 * length
        );
        let own =
            |all: &[Quat4], joint: usize| DQuat::from_array(all[joint].map(f64::from)).normalize();
        let [upper, lower] = two_bone(places, target, pole).unwrap();
        for (joint, by) in [(joints[0], upper), (joints[1], lower)] {
            let expected = by * own(&rotations, joint);
            worst_turn = worst_turn.max(apart(own(&after, joint), expected));
        }
        if limb.keep_end {
            let (before, after) = (own(&rotations, joints[2]), own(&after, joints[2]));
            assert!(apart(before, after) < 1e-5);
        }
        // Input that cannot be used changes nothing.
        for bad in [f32::NAN, f32::INFINITY] {
            let goal = Target {
                at: [bad; 3],
                ..goal
            };
            let mut same = local.clone();
            let came = reach(&asset, &limb, &goal, &rotations, &model, &mut same);
            assert_eq!((came, same == local), (Reach::Refused, true));
        }
    }
    eprintln!(
        "reach: {:.4} mm, {:.1e} rad off",
        1e3 * worst_place,
        worst_turn
    );
    // Near a stretched limb the knee's height is the root of a small difference.
    assert!(worst_place < 1e-3, "{worst_place}");
    assert!(worst_turn < 5e-3, "{worst_turn}");
}

#[test]
fn a_head_looks_at_its_target_within_its_limit() {
    let avatar = body();
    let bytes = bake(&avatar, &BakeOptions::default()).unwrap().bytes;
    let asset = bytes.asset().unwrap();
    let joint = avatar.skeleton.joints.len() / 2;
    let mut rest = vec![Local::default(); asset.dims().joint_count];
    pose::rest(&asset, &mut rest);
    let (rotations, model) = placed(&asset, &rest);
    let mut random = Random(5);
    for _ in 0..200 {
        let target = place(&model[joint]) + 2.0 * vector(&mut random);
        let axis = vector(&mut random);
        let own = DQuat::from_array(rotations[joint].map(f64::from)).normalize();
        let wanted = (target - place(&model[joint])).normalize();
        let off = (own * axis.normalize()).angle_between(wanted);
        for degrees in [180.0_f64, 40.0] {
            let look = Look {
                joint,
                axis: narrow(axis),
                limit: degrees.to_radians().cos() as f32,
                weight: 1.0,
            };
            let mut local = rest.clone();
            let came = look_at(
                &asset,
                &look,
                narrow(target),
                &rotations,
                &model,
                &mut local,
            );
            let (after, _) = placed(&asset, &local);
            let after = DQuat::from_array(after[joint].map(f64::from)).normalize();
            let turned = off.min(degrees.to_radians());
            let left = (after * axis.normalize()).angle_between(wanted);
            assert!((left - (off - turned)).abs() < 1e-3, "{off} {left}");
            assert_eq!(came == Reach::Reached, off <= turned + 1e-6);
        }
    }
}

/// The bundled body with clips of these motions, by rotation alone.
fn with_clips(motions: &[Motion]) -> Avatar {
    let mut avatar = body();
    for motion in motions {
        let joints = Correspondence::new(&motion.skeleton, &avatar.skeleton, &[]).unwrap();
        let fitted = retarget(motion, &avatar.skeleton, &joints, &Options::default()).unwrap();
        avatar.clips.push(fitted.clip);
    }
    avatar
}

#[test]
fn compressed_clips_keep_their_tolerance_and_agree_with_the_oracle() {
    let avatar = with_clips(&[walk()]);
    let whole = bake(&avatar, &BakeOptions::default()).unwrap();
    let options = BakeOptions {
        compression: Some(1e-3),
        ..BakeOptions::default()
    };
    let packed = bake(&avatar, &options).unwrap();
    let report = &packed.report.compression[0];
    assert!(report.error <= 1e-3, "{}", report.error);
    assert!(report.bytes < report.raw_bytes, "{report:?}");
    assert!(packed.bytes.as_slice().len() < whole.bytes.as_slice().len());
    let asset = packed.bytes.asset().unwrap();
    let oracle = unpack(&asset);
    let found = verify(&asset, &oracle, |_, _| ());
    assert!(found.passed(CORE_LIMIT), "{found:?}");
    // The same input gives the same bytes.
    assert_eq!(bake(&avatar, &options).unwrap().bytes, packed.bytes);
}

#[test]
fn damaged_compressed_tracks_are_refused_or_harmless() {
    let avatar = with_clips(&[walk()]);
    let options = BakeOptions {
        compression: Some(2e-3),
        ..BakeOptions::default()
    };
    let bytes = bake(&avatar, &options).unwrap().bytes;
    let good = bytes.as_slice();
    let clips = bytes.asset().unwrap();
    let clip = clips.clip(0).unwrap();
    assert!(clip.packed_tracks().count() > 10);
    // Where the compressed sections and the clip's row stand.
    let rows = u32::from_le_bytes(good[20..24].try_into().unwrap()) as usize;
    let word = |at: usize| u32::from_le_bytes(good[at..at + 4].try_into().unwrap()) as usize;
    let table = (0..rows).map(|row| 288 + 16 * row);
    let wanted: Vec<(usize, usize)> = table
        .filter(|&at| {
            [*b"KPTK", *b"KPFR", *b"KPVL", *b"CLIP"]
                .iter()
                .any(|k| good[at..at + 4] == k[..])
        })
        .map(|at| (word(at + 4), word(at + 8)))
        .collect();
    assert_eq!(wanted.len(), 4);
    let mut random = Random(17);
    let mut refused = 0;
    for _ in 0..300 {
        let mut bad = good.to_vec();
        let (from, length) = wanted[random.below(4)];
        let at = from + random.below(length);
        bad[at] ^= 1 << random.below(8);
        let sum = sinew_core::asset::crc32(&bad[20..]).to_le_bytes();
        bad[16..20].copy_from_slice(&sum);
        let bad = AssetBytes::new(&bad);
        let Ok(asset) = bad.asset() else {
            refused += 1;
            continue;
        };
        let mut player = sinew_host::play::Player::new(asset);
        let input = Input::Clip {
            index: 0,
            seconds: 0.7,
            looped: true,
        };
        player.step(&input);
        let all = player.positions().as_flattened().iter();
        assert!(all.copied().all(f32::is_finite));
    }
    assert!(refused > 30, "{refused}");
}

/// The body, `size` times as large.
fn sized(size: f64) -> Avatar {
    let mut avatar = body();
    for joint in &mut avatar.skeleton.joints {
        joint.rest.translation *= size;
    }
    for position in &mut avatar.mesh.positions {
        *position *= size;
    }
    for bind in &mut avatar.skin.binds {
        bind.inverse_bind.translation *= size;
    }
    avatar
}

/// The body with legs `size` times as long.
fn long_legged(size: f64) -> Avatar {
    let mut avatar = body();
    let human =
        sinew_host::fit::Humanoid::new(&avatar.skeleton, sinew_host::fit::Which::Target).unwrap();
    let before = avatar.skeleton.model(&avatar.skeleton.rest());
    for side in [Side::Left, Side::Right] {
        for part in [Part::LowerLeg, Part::Foot] {
            let joint = human.limb(side, part).unwrap();
            avatar.skeleton.joints[joint].rest.translation *= size;
        }
    }
    // The skin goes with its joints.
    let after = avatar.skeleton.model(&avatar.skeleton.rest());
    let moved: Vec<DAffine3> = after
        .iter()
        .zip(&before)
        .map(|(a, b)| *a * b.inverse())
        .collect();
    for (position, influences) in avatar
        .mesh
        .positions
        .iter_mut()
        .zip(&avatar.skin.influences)
    {
        let sum = influences.iter().map(|&(bind, weight)| {
            moved[avatar.skin.binds[bind as usize].joint].transform_point3(*position) * weight
        });
        *position = sum.sum();
    }
    for bind in &mut avatar.skin.binds {
        bind.inverse_bind *= moved[bind.joint].inverse();
    }
    avatar
}

/// How far soles slide sideways within a contact of the source, and stand above or below the floor,
/// metres: read from the clips as they are, before and after holding.
fn slides(avatar: &Avatar, source: &Motion) -> ([[f64; 2]; 2], feet::FeetReport) {
    let joints = Correspondence::new(&source.skeleton, &avatar.skeleton, &[]).unwrap();
    let mut options = Options::default();
    let fitted = retarget(source, &avatar.skeleton, &joints, &options).unwrap();
    options.lift = floor::lift(avatar, &joints.target, &fitted.clip).unwrap();
    let fitted = retarget(source, &avatar.skeleton, &joints, &options).unwrap();
    let (held, report) = feet::hold(avatar, &joints.target, &fitted.clip, source, &joints.source);
    let times = &held.tracks[0].times;
    let found = [&fitted.clip, &held].map(|clip| {
        let (mut slide, mut height): (f64, f64) = (0.0, 0.0);
        for (side, contacts) in &report.contacts {
            let sole = Sole::new(avatar, &joints.target, *side).unwrap();
            for (point, ranges) in sole.stand.iter().zip([&contacts.heel, &contacts.ball]) {
                for range in ranges {
                    let place = |frame: usize| {
                        let local = sample(&avatar.skeleton, clip, times[frame]);
                        avatar.skeleton.model(&local)[sole.leg[2]].transform_point3(*point)
                    };
                    let places: Vec<DVec3> = range.clone().map(place).collect();
                    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
                    for at in places {
                        slide = slide.max((at - middle).reject_from(DVec3::Y).length());
                        height = height.max(at.y.abs());
                    }
                }
            }
        }
        [slide, height]
    });
    (found, report)
}

#[test]
fn feet_that_stand_in_the_source_stand_in_the_target() {
    let mut sources = vec![("walk", walk())];
    for file in ["bvh/cmu_12_01_walk.bvh", "bvh/mocapbank_crlf.bvh"] {
        if let Some(path) = shared(file) {
            sources.push((file, motion(&path)));
        }
    }
    let bodies = [
        ("80 %", sized(0.8)),
        ("120 %", sized(1.2)),
        ("legs 80 %", long_legged(0.8)),
        ("legs 120 %", long_legged(1.2)),
    ];
    for (name, source) in &sources {
        for (size, avatar) in &bodies {
            let ([before, after], report) = slides(avatar, source);
            let stances: usize = report.contacts.iter().map(|(_, on)| on.ball.len()).sum();
            let mm = |[slide, height]: [f64; 2]| {
                format!("{:.1} and {:.1} mm", 1e3 * slide, 1e3 * height)
            };
            eprintln!(
                "{name}, {size}: {stances} stances; slide and height {}, held {}; depth {:.2}, hips sink {:.1} mm",
                mm(before),
                mm(after),
                1e3 * report.depth,
                1e3 * report.sink
            );
            assert!(stances >= 2, "{name}");
            assert!(
                after.iter().all(|&error| error <= 0.005),
                "{name} {size}: {after:?}"
            );
            assert!(report.depth <= 0.001, "{name} {size}: {}", report.depth);
        }
    }
}
