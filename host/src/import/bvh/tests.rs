use super::*;
use std::f64::consts::FRAC_PI_2;

mod damage;

/// A small file with everything a usual one has.
const SMALL: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0 0.75 0
    CHANNELS 3 Yrotation Xrotation Zrotation
    End Site
    {
      OFFSET 0 0.95 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.5
1 2 3 90 0 0 0 0 0
4 5 6 0 90 90 0 0 90
";

fn metres() -> BvhOptions {
    BvhOptions {
        unit_metres: Some(1.0),
        ..BvhOptions::default()
    }
}

fn read(text: &str) -> RawMotion {
    read_bvh_with(text.as_bytes(), "a/small.bvh", &metres()).expect("a good file")
}

fn fault(text: &str) -> ImportError {
    read_bvh(text.as_bytes(), "small.bvh").expect_err("a bad file")
}

fn track(motion: &RawMotion, joint: usize, channel: Channel) -> &RawTrack {
    let mut tracks = motion.clip.tracks.iter();
    tracks
        .find(|track| track.joint == joint && track.channel == channel)
        .expect("the track is there")
}

fn rotation(motion: &RawMotion, joint: usize, key: usize) -> DQuat {
    DQuat::from_array(track(motion, joint, Channel::Rotation).values[key])
}

fn says(motion: &RawMotion, words: &str) -> bool {
    motion
        .notices
        .iter()
        .any(|notice| notice.text.contains(words))
}

#[test]
fn reads_a_usual_file() {
    let motion = read(SMALL);
    assert_eq!(motion.notices, []);
    let joints = &motion.skeleton.joints;
    assert_eq!(joints.len(), 2);
    assert_eq!(
        (joints[1].name.as_str(), joints[1].parent),
        ("Chest", Some(0))
    );
    assert_eq!(joints[1].rest.translation, DVec3::new(0.0, 0.75, 0.0));
    assert_eq!(motion.end_sites, [(1, DVec3::new(0.0, 0.95, 0.0))]);
    assert_eq!(motion.clip.name, "small");
    assert_eq!(motion.clip.sample_period, Some(0.5));
    assert_eq!(motion.clip.tracks.len(), 3);
    let root = track(&motion, 0, Channel::Translation);
    assert_eq!(root.times, [0.0, 0.5]);
    assert_eq!(root.values, [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
}

#[test]
fn rotations_multiply_in_channel_order() {
    let motion = read(SMALL);
    // Rz(0) Rx(90) Ry(90) takes X to -Z (by Ry) and on to Y (by Rx).
    let turned = rotation(&motion, 0, 1) * DVec3::X;
    assert!(turned.abs_diff_eq(DVec3::Y, 1e-12), "{turned}");
    let first = rotation(&motion, 0, 0);
    assert!(first.abs_diff_eq(DQuat::from_rotation_z(FRAC_PI_2), 1e-12));
}

#[test]
fn every_order_is_the_product_of_its_axes() {
    let turn = [
        DQuat::from_rotation_x(0.3),
        DQuat::from_rotation_y(-1.1),
        DQuat::from_rotation_z(2.0),
    ];
    let degrees = [0.3_f64, -1.1, 2.0].map(f64::to_degrees);
    let names = ["Xrotation", "yROTATION", "zrotation"];
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
        [2, 0, 2],
    ] {
        let [a, b, c] = order;
        let text = format!(
            "HIERARCHY ROOT r {{ OFFSET 0 1 0 CHANNELS 4 {} {} {} Yposition }}\nMOTION\nFrames: 1\n\
             Frame Time: 1\n{} {} {} 7",
            names[a], names[b], names[c], degrees[a], degrees[b], degrees[c]
        );
        let motion = read(&text);
        let expected = turn[a] * turn[b] * turn[c];
        assert!(
            rotation(&motion, 0, 0).abs_diff_eq(expected, 1e-12),
            "{order:?}"
        );
        // Rotation listed first does not turn the translation.
        let root = track(&motion, 0, Channel::Translation);
        assert_eq!(root.values, [[0.0, 7.0, 0.0, 0.0]]);
    }
}

#[test]
fn line_ends_tabs_braces_and_case_do_not_matter() {
    let expected = read(SMALL);
    let crlf = SMALL.replace('\n', "\r\n");
    let cr = SMALL.replace('\n', "\r");
    let tabs = SMALL.replace("  ", "\t").replace(' ', "\t \t");
    let one_line = SMALL.split_once("MOTION").map(|(hierarchy, motion)| {
        let words: Vec<_> = hierarchy.split_whitespace().collect();
        format!(
            "\u{FEFF}{}\nMOTION{motion}",
            words.join(" ").replace("{ ", "{")
        )
    });
    let upper = SMALL
        .to_uppercase()
        .replace("HIPS", "Hips")
        .replace("CHEST", "Chest");
    let blank = SMALL.replace('\n', " \n\n");
    for text in [crlf, cr, tabs, one_line.expect("has MOTION"), upper, blank] {
        assert_eq!(read(&text), expected, "{text}");
    }
}

#[test]
fn names_keep_spaces_and_colons() {
    let text = SMALL.replace("ROOT Hips", "ROOT mixamorig:Left  Hips ");
    assert_eq!(read(&text).skeleton.joints[0].name, "mixamorig:Left  Hips");
    let motion = read(&SMALL.replace("JOINT Chest\n  {", "JOINT Hips{"));
    assert!(says(&motion, "repeat the name"));
    let bytes = [&b"HIERARCHY\nROOT H\xFCfte\n{\nOFFSET 0 0 0\n}\nMOTION\nFrame Time: 1\n"[..]];
    let motion = read_bvh(&bytes.concat(), "x").expect("a rest pose");
    assert_eq!(motion.skeleton.joints[0].name, "H\u{FFFD}fte");
    assert!(says(&motion, "not UTF-8"));
}

#[test]
fn several_roots_are_kept() {
    let two = SMALL
        .replace(
            "MOTION",
            "ROOT Prop { OFFSET 1 0 0 CHANNELS 1 Xrotation }\nMOTION",
        )
        .replace("0 0 0\n4", "0 0 0 90\n4")
        .replace("90 0 0 90\n", "90 0 0 90 0\n");
    let motion = read(&two);
    assert_eq!(motion.skeleton.joints[2].parent, None);
    assert!(rotation(&motion, 2, 0).abs_diff_eq(DQuat::from_rotation_x(FRAC_PI_2), 1e-12));
}

#[test]
fn positions_replace_or_add_as_the_data_shows() {
    let file = |chest: &str| {
        format!(
            "HIERARCHY ROOT a {{ OFFSET 0 5 0 CHANNELS 1 Yposition JOINT b {{ OFFSET 1 2 0 \
             CHANNELS 2 Xposition Yposition }} }}\nMOTION\nFrames: 1\nFrame Time: 1\n7 {chest}"
        )
    };
    let values = |text: &str, options: &BvhOptions| {
        let motion = read_bvh_with(text.as_bytes(), "x", options).expect("a good file");
        [0, 1].map(|joint| track(&motion, joint, Channel::Translation).values[0])
    };
    let whole = [[0.0, 7.0, 0.0, 0.0], [1.1, 2.0, 0.0, 0.0]];
    assert_eq!(values(&file("1.1 2"), &metres()), whole);
    let change = [[0.0, 12.0, 0.0, 0.0], [1.25, 2.0, 0.0, 0.0]];
    assert_eq!(values(&file("0.25 0"), &metres()), change);
    let stated = BvhOptions {
        positions: Some(BvhPositions::Whole),
        ..metres()
    };
    let collapsed = [[0.0, 7.0, 0.0, 0.0], [0.25, 0.0, 0.0, 0.0]];
    assert_eq!(values(&file("0.25 0"), &stated), collapsed);
}

#[test]
fn a_root_alone_cannot_show_what_its_positions_mean() {
    let text = SMALL.replace("OFFSET 0 0 0\n", "OFFSET 0 9 0\n");
    let motion = read(&text);
    assert!(says(&motion, "root with an OFFSET"));
    let whole = [1.0, 2.0, 3.0, 0.0];
    assert_eq!(track(&motion, 0, Channel::Translation).values[0], whole);
    let options = BvhOptions {
        positions: Some(BvhPositions::Change),
        ..metres()
    };
    let motion = read_bvh_with(text.as_bytes(), "x", &options).expect("a good file");
    assert_eq!(motion.notices, []);
    let change = [1.0, 11.0, 3.0, 0.0];
    assert_eq!(track(&motion, 0, Channel::Translation).values[0], change);
}

#[test]
fn the_unit_is_guessed_from_the_rest_pose() {
    for (height, unit, name) in [
        ("1.62", 1.0, "metres"),
        ("5.5", 0.3048, "feet"),
        ("16.6", 0.1, "decimetres"),
        ("26", 0.0254 / 0.45, "CMU units"),
        ("66", 0.0254, "inches"),
        ("178", 0.01, "centimetres"),
        ("1800", 0.001, "millimetres"),
    ] {
        let text = SMALL
            .replace("0 0.75 0", &format!("0 {height} 0"))
            .replace("0.95", "0");
        let motion = read_bvh(text.as_bytes(), "x").expect("a good file");
        assert!(says(&motion, name), "{height}: {:?}", motion.notices);
        let stated: f64 = height.parse().expect("a number");
        assert_eq!(motion.skeleton.joints[1].rest.translation.y, stated * unit);
        assert_eq!(
            track(&motion, 0, Channel::Translation).values[0][1],
            2.0 * unit
        );
    }
    let flat = SMALL.replace("0.75", "0").replace("0.95", "0");
    let motion = read_bvh(flat.as_bytes(), "x").expect("a good file");
    assert!(says(&motion, "no extent"));
    let tiny = SMALL.replace("0.75", "0.1").replace("0.95", "0.1");
    assert!(says(
        &read_bvh(tiny.as_bytes(), "x").expect("a good file"),
        "uncertain"
    ));
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = BvhOptions {
            unit_metres: Some(unit),
            ..BvhOptions::default()
        };
        let error = read_bvh_with(SMALL.as_bytes(), "x", &options).expect_err("no unit");
        assert!(matches!(error.kind, ImportErrorKind::OutOfRange { .. }));
    }
}

#[test]
fn z_up_turns_everything_alike() {
    let z_up = BvhOptions {
        z_up: true,
        ..metres()
    };
    let motion = read_bvh_with(SMALL.as_bytes(), "x", &z_up).expect("a good file");
    assert_eq!(
        track(&motion, 0, Channel::Translation).values[0],
        [1.0, 3.0, -2.0, 0.0]
    );
    assert_eq!(
        motion.skeleton.joints[1].rest.translation,
        DVec3::new(0.0, 0.0, -0.75)
    );
    // A turn about the file's Z is a turn about Y here.
    assert!(rotation(&motion, 0, 0).abs_diff_eq(DQuat::from_rotation_y(FRAC_PI_2), 1e-12));
    let lying = SMALL
        .replace("0 0.75 0", "0 0 0.75")
        .replace("0 0.95 0", "0 0 0.95");
    assert!(says(&read(&lying), "Z is up"));
}
