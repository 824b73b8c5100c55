//! Files that contradict themselves, end early or are no BVH at all.

use super::*;

#[test]
fn rows_overrule_the_frame_count() {
    for count in ["7", "1", "99999999999", "99999999999999999999999", "2.0"] {
        let motion = read(&SMALL.replace("Frames: 2", &format!("Frames: {count}")));
        assert_eq!(track(&motion, 0, Channel::Rotation).times.len(), 2);
        assert_eq!(says(&motion, "2 rows are there"), count != "2.0");
    }
    let motion = read(&SMALL.replace("Frames: 2\n", ""));
    assert!(says(&motion, "Frames line is missing"));
    let odd = read(
        &SMALL
            .replace("Frames: 2", "FRAMES :2")
            .replace("Frame Time:", "frame  time"),
    );
    assert_eq!(odd, read(SMALL));
}

#[test]
fn a_short_last_row_is_dropped() {
    let cut = SMALL.trim_end().strip_suffix(" 90").expect("its end");
    for text in [
        cut.to_owned(),
        format!("{cut}\n\n"),
        format!("{cut} -"),
        format!("{cut} 9e"),
    ] {
        let motion = read(&text);
        assert_eq!(track(&motion, 1, Channel::Rotation).times, [0.0], "{text}");
        assert!(says(&motion, "cut short"));
        assert_eq!(motion.notices[0].place, Place::Line(20));
    }
}

#[test]
fn other_row_lengths_are_refused() {
    let short = fault(&SMALL.replace("1 2 3 90", "1 2 3"));
    assert_eq!(short.place, Place::Line(19));
    assert!(short.to_string().contains("8 values"), "{short}");
    let long = fault(&SMALL.replace("4 5 6", "4 5 6 7"));
    assert_eq!(long.place, Place::Line(20));
    assert!(long.to_string().contains("10 values"), "{long}");
}

#[test]
fn bad_numbers_name_line_joint_and_column() {
    let nan = fault(&SMALL.replace("4 5 6 0 90", "4 5 6 0 NaN"));
    let what = "Xrotation of joint \"Hips\", column 5".to_owned();
    let kind = ImportErrorKind::NotFinite { what };
    assert_eq!(nan, kind.at("small.bvh", Place::Line(20)));
    let infinite = fault(&SMALL.replace("0 0.75 0", "0 1e999 0"));
    let what = "Y of the OFFSET of joint \"Chest\"".to_owned();
    let kind = ImportErrorKind::NotFinite { what };
    assert_eq!(infinite, kind.at("small.bvh", Place::Line(8)));
    let comma = fault(&SMALL.replace("4 5 6", "4,0 5 6"));
    assert!(
        comma.to_string().contains("must be a point, not a comma"),
        "{comma}"
    );
    assert_eq!(comma.place, Place::Line(20));
    // A last row without its end is only dropped where the last word is at fault.
    let word = fault(SMALL.replace("4 5 6", "4 x 6").trim_end());
    assert!(matches!(word.kind, ImportErrorKind::BadNumber { .. }));
}

#[test]
fn frame_time_must_be_positive_where_it_matters() {
    for time in ["0", "-0.1", "nan"] {
        let error = fault(&SMALL.replace("Time: 0.5", &format!("Time: {time}")));
        assert_eq!(error.place, Place::Line(18), "{error}");
    }
    let pose = SMALL
        .replace("Time: 0.5", "Time: 0")
        .replace("4 5 6 0 90 90 0 0 90\n", "");
    let motion = read(&pose.replace("Frames: 2", "Frames: 1"));
    assert_eq!(motion.clip.sample_period, None);
    assert!(says(&motion, "Frame Time is 0"));
    let missing = fault(&SMALL.replace("Frame Time: 0.5\n", ""));
    assert!(matches!(missing.kind, ImportErrorKind::Missing { .. }));
}

#[test]
fn hierarchies_that_do_not_close_are_refused() {
    let open = fault(&SMALL.replace("}\nMOTION", "MOTION"));
    let what = "joint \"Hips\"".to_owned();
    let kind = ImportErrorKind::Unclosed { what };
    assert_eq!(open, kind.at("small.bvh", Place::Line(2)));
    let cut = fault(SMALL.split_once("CHANNELS 3").expect("its start").0);
    let what = "joint \"Chest\"".to_owned();
    let kind = ImportErrorKind::Unclosed { what };
    assert_eq!(cut, kind.at("small.bvh", Place::Line(6)));
    let twice = fault(&SMALL.replace("}\nMOTION", "}}\nMOTION"));
    assert!(twice.to_string().contains("closing brace"), "{twice}");
}

#[test]
fn broken_hierarchies_are_refused_with_their_line() {
    let cases = [
        ("JOINT Chest\n  {", "JOINT Chest", 6, "opening brace"),
        ("JOINT Chest", "ROOT Chest", 6, "inside another joint"),
        ("ROOT Hips", "JOINT Hips", 2, "outside any ROOT"),
        (
            "OFFSET 0 0.75 0\n",
            "OFFSET 0 0.75\n}",
            9,
            "Z of the OFFSET",
        ),
        ("OFFSET 0 0.75 0\n", "", 13, "OFFSET of joint"),
        ("OFFSET 0 0.95 0\n", "", 12, "OFFSET of the End Site"),
        (
            "OFFSET 0 0.95 0",
            "OFFSET 0 0 0 OFFSET 0 0 0",
            12,
            "second OFFSET",
        ),
        (
            "OFFSET 0 0.95 0",
            "OFFSET 0 0 0 CHANNELS 0",
            12,
            "the End Site",
        ),
        ("CHANNELS 3", "CHANNELS 4", 9, "announces 4 channels"),
        ("CHANNELS 3", "CHANNELS 2", 9, "Zrotation"),
        ("CHANNELS 3", "CHANNELS 1000000", 9, "at most 6"),
        ("CHANNELS 3", "CHANNELS -3", 9, "not a number"),
        (
            "CHANNELS 3 Yrotation",
            "CHANNELS 3 Wrotation",
            9,
            "Wrotation",
        ),
        (
            "CHANNELS 6 Xposition Y",
            "CHANNELS 6 Xposition X",
            5,
            "twice",
        ),
        ("End Site", "CHANNELS 0 End Site", 10, "CHANNELS twice"),
        ("HIERARCHY\n", "", 1, "not a BVH file"),
        ("JOINT Chest", "BONE Chest", 6, "BONE"),
    ];
    for (old, new, line, words) in cases {
        let error = fault(&SMALL.replace(old, new));
        assert!(error.to_string().contains(words), "{new:?}: {error}");
        assert_eq!(error.place, Place::Line(line), "{new:?}: {error}");
    }
}

#[test]
fn files_without_content_are_refused() {
    assert_eq!(fault("").kind, ImportErrorKind::Empty);
    assert_eq!(fault(" \r\n\t").kind, ImportErrorKind::Empty);
    let missing = |text: &str| matches!(fault(text).kind, ImportErrorKind::Missing { .. });
    assert!(missing("HIERARCHY"));
    assert!(missing("HIERARCHY MOTION"));
    let rowless = SMALL.split_once("1 2 3").expect("its rows").0;
    let what = "the motion rows".to_owned();
    let (needed, found) = (2, 0);
    let kind = ImportErrorKind::Truncated {
        what,
        needed,
        found,
    };
    assert_eq!(fault(rowless).kind, kind);
    let rest = read(&rowless.replace("Frames: 2", "Frames: 0"));
    assert_eq!(rest.clip.tracks, []);
    assert!(says(&rest, "no frame"));
    let garbage: Vec<u8> = (0..2000_u32).map(|i| (i * i * 7 + i / 3) as u8).collect();
    let error = read_bvh(&garbage, "x").expect_err("garbage");
    assert!(
        matches!(error.kind, ImportErrorKind::NotThisFormat { .. }),
        "{error}"
    );
}

#[test]
fn a_million_nested_joints_are_read() {
    const DEPTH: usize = 1_000_000;
    let mut text = String::from("HIERARCHY ROOT a{OFFSET 0 1 0 ");
    for _ in 1..DEPTH {
        text.push_str("JOINT a{OFFSET 0 1 0 ");
    }
    let unclosed = fault(&text);
    assert!(matches!(unclosed.kind, ImportErrorKind::Unclosed { .. }));
    text.push_str(&"}".repeat(DEPTH));
    text.push_str("\nMOTION\nFrames: 0\nFrame Time: 1\n");
    let motion = read(&text);
    assert_eq!(motion.skeleton.joints.len(), DEPTH);
    assert_eq!(motion.skeleton.joints[DEPTH - 1].parent, Some(DEPTH - 2));
}

#[test]
fn cut_and_damaged_files_never_panic() {
    for length in 0..SMALL.len() {
        let cut = read_bvh(&SMALL.as_bytes()[..length], "x");
        // Nothing before the second row can be complete.
        assert!(cut.is_err() || length > SMALL.len() - 45, "{length}");
    }
    let mut random = crate::import::text::tests::Random(7);
    let mut survived = 0;
    for _ in 0..2000 {
        let mut bytes = SMALL.as_bytes().to_vec();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        if let Ok(motion) = read_bvh(&bytes, "x") {
            survived += 1;
            for track in &motion.clip.tracks {
                assert_eq!(track.values.len(), track.times.len());
                assert!(track.values.iter().flatten().all(|value| value.is_finite()));
            }
        }
    }
    assert!((1..2000).contains(&survived), "{survived}");
}
