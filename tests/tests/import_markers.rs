//! Real marker recordings: what the readers must find in them.

use std::fs;
use std::path::Path;

use serde_json::json;
use sinew_host::export::c3d::write_c3d;
use sinew_host::import::take::{
    LengthUnit, PointKind, RawTake, TakeOptions, UpAxis, is_present, read_take,
};
use sinew_host::import::{ImportErrorKind, Place, c3d, take};
use sinew_host::take::Take;
use sinew_tests::shared;

/// What a recording holds, counted independently of the readers.
struct Holds {
    file: &'static str,
    points: usize,
    frames: usize,
    rate: f64,
    unit: LengthUnit,
    up: UpAxis,
    /// Missing samples of all points.
    missing: usize,
    /// Runs of missing samples, and the longest; only where every point is a marker.
    gaps: Option<(usize, usize)>,
}

const MM: LengthUnit = LengthUnit::Millimetre;
const M: LengthUnit = LengthUnit::Metre;
const Y: UpAxis = UpAxis::PlusY;
const Z: UpAxis = UpAxis::PlusZ;

#[rustfmt::skip]
const C3D: [Holds; 27] = [
    Holds { file: "c3d/cmu_02_05.c3d", points: 41, frames: 1854, rate: 120.0, unit: MM, up: Z, missing: 3, gaps: Some((1, 3)) },
    Holds { file: "c3d/freeform_53mk_gappy.c3d", points: 53, frames: 1101, rate: 120.0, unit: MM, up: Y, missing: 3874, gaps: Some((511, 1101)) },
    Holds { file: "c3d/motionanalysis_gait_dec_int.c3d", points: 33, frames: 487, rate: 100.0, unit: MM, up: Z, missing: 9682, gaps: Some((66, 164)) },
    Holds { file: "c3d/optitrack_walking_dec_int.c3d", points: 12, frames: 3361, rate: 160.0, unit: MM, up: Z, missing: 2996, gaps: Some((123, 1007)) },
    Holds { file: "c3d/optitrack_wheelchair_sprint_gappy.c3d", points: 26, frames: 3678, rate: 120.0, unit: M, up: Z, missing: 37068, gaps: Some((803, 1760)) },
    Holds { file: "c3d/optotrak_racing_full.c3d", points: 46, frames: 700, rate: 69.99261474609375, unit: M, up: Y, missing: 6384, gaps: None },
    Holds { file: "c3d/vicon_dup_params_no_points.c3d", points: 0, frames: 189, rate: 200.0, unit: MM, up: Z, missing: 0, gaps: None },
    Holds { file: "c3d/vicon_walking2.c3d", points: 44, frames: 1249, rate: 250.0, unit: MM, up: Z, missing: 27567, gaps: Some((88, 423)) },
    Holds { file: "c3d_testsuite/badParameterOffset.c3d", points: 41, frames: 111, rate: 250.0, unit: MM, up: Z, missing: 222, gaps: None },
    Holds { file: "c3d_testsuite/optitrack_mocap36_missing_desc_byte.c3d", points: 36, frames: 1380, rate: 100.0, unit: MM, up: Z, missing: 8244, gaps: None },
    Holds { file: "c3d_testsuite/sample01/Eb015pi.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample01/Eb015pr.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample01/Eb015si.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample01/Eb015sr.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample01/Eb015vi.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample01/Eb015vr.c3d", points: 26, frames: 450, rate: 50.0, unit: MM, up: Z, missing: 226, gaps: Some((12, 47)) },
    Holds { file: "c3d_testsuite/sample02/DEC_INT.C3D", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample02/Dec_real.c3d", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample02/pc_int.c3d", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample02/pc_real.c3d", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample02/sgi_int.c3d", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample02/sgi_real.c3d", points: 36, frames: 89, rate: 50.0, unit: MM, up: Z, missing: 228, gaps: Some((35, 26)) },
    Holds { file: "c3d_testsuite/sample04_sub_labels.c3d", points: 114, frames: 333, rate: 60.0, unit: MM, up: Z, missing: 19753, gaps: None },
    Holds { file: "c3d_testsuite/sample06_MACsample_mips_int.c3d", points: 33, frames: 180, rate: 60.0, unit: MM, up: Z, missing: 3565, gaps: None },
    Holds { file: "c3d_testsuite/sample18_bad_parameter_section.c3d", points: 45, frames: 332, rate: 120.0, unit: MM, up: Z, missing: 6044, gaps: None },
    Holds { file: "c3d_testsuite/sample20_phasespace.c3d", points: 40, frames: 701, rate: 30.0, unit: MM, up: Z, missing: 1281, gaps: None },
    Holds { file: "c3d_testsuite/vicon_FunctionalWalk_146pts.c3d", points: 146, frames: 438, rate: 120.0, unit: MM, up: Z, missing: 16671, gaps: None },
];

#[rustfmt::skip]
const TABLES: [Holds; 10] = [
    Holds { file: "trc/cortex_walk.trc", points: 28, frames: 184, rate: 150.0, unit: MM, up: Y, missing: 0, gaps: None },
    Holds { file: "trc/dataWithBlanksForMissingMarkers.trc", points: 40, frames: 464, rate: 250.0, unit: MM, up: Z, missing: 45015 / 3, gaps: None },
    Holds { file: "trc/dataWithEformat.trc", points: 14, frames: 5, rate: 119.88012, unit: M, up: Y, missing: 0, gaps: None },
    Holds { file: "trc/dataWithNaNsOfDifferentCases.trc", points: 14, frames: 5, rate: 250.0, unit: MM, up: Y, missing: 15 / 3, gaps: Some((1, 5)) },
    Holds { file: "trc/exampleFormat.trc", points: 3, frames: 5, rate: 100.0, unit: M, up: Y, missing: 2, gaps: Some((2, 1)) },
    Holds { file: "trc/marker_flip_dropjump.trc", points: 51, frames: 289, rate: 100.0, unit: MM, up: Y, missing: 0, gaps: None },
    // The header says 250 Hz, but the times advance by 0.04 s.
    Holds { file: "trc/std_walking5_markers.trc", points: 40, frames: 112, rate: 25.0, unit: MM, up: Z, missing: 6231 / 3, gaps: None },
    Holds { file: "trc/walk_free_01.trc", points: 41, frames: 73, rate: 60.0, unit: MM, up: Y, missing: 0, gaps: None },
    Holds { file: "motive/motive_v1.21_unlabeled.csv", points: 12, frames: 250, rate: 120.0, unit: M, up: Y, missing: 750, gaps: None },
    Holds { file: "face/cheeks_41mk_60hz.csv", points: 41, frames: 1499, rate: 60.0, unit: LengthUnit::Centimetre, up: Y, missing: 0, gaps: None },
];

fn read(file: &str) -> Option<RawTake> {
    let path = shared(file)?;
    match read_take(&path, &TakeOptions::default()) {
        Ok(take) => Some(take),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn every_recording_holds_what_it_is_known_to_hold() {
    for holds in C3D.iter().chain(&TABLES) {
        let Some(raw) = read(holds.file) else {
            continue;
        };
        let file = holds.file;
        assert_eq!(
            (raw.point_count(), raw.frame_count),
            (holds.points, holds.frames),
            "{file}"
        );
        assert_eq!((raw.unit, raw.up), (holds.unit, holds.up), "{file}");
        assert_eq!(raw.rate, holds.rate, "{file}");
        assert_eq!(raw.missing_count(), holds.missing, "{file}");
        let (take, _) = Take::from_raw(&raw).unwrap();
        if let Some(gaps) = holds.gaps {
            let markers = || 0..take.marker_count();
            let count = markers()
                .map(|marker| take.gaps(marker).count())
                .sum::<usize>();
            let longest = markers()
                .flat_map(|marker| take.gaps(marker))
                .map(|gap| gap.len())
                .max();
            assert_eq!((count, longest), (gaps.0, Some(gaps.1)), "{file}");
        }
        // Everything stands within a room and above the floor, once in metres with Y up.
        if let Some((low, high)) = take.bounds() {
            assert!(
                low.y > -0.4 && high.y < 2.5 && high.y - low.y > 0.1,
                "{file}: {low} {high}"
            );
            assert!((high - low).max_element() < 14.0, "{file}: {low} {high}");
        }
    }
}

/// Largest difference of a coordinate; panics where only one of the two is missing.
fn difference(one: &RawTake, other: &RawTake) -> f64 {
    assert_eq!(
        (&one.labels, one.frame_count),
        (&other.labels, other.frame_count)
    );
    let mut largest = 0f64;
    for (a, b) in one.positions.iter().zip(&other.positions) {
        assert_eq!(is_present(*a), is_present(*b));
        for (a, b) in a.iter().zip(b).filter(|(a, _)| a.is_finite()) {
            largest = largest.max((a - b).abs());
        }
    }
    largest
}

#[test]
fn the_six_encodings_of_sample01_agree() {
    let name = |letters| format!("c3d_testsuite/sample01/Eb015{letters}.c3d");
    let all: Vec<RawTake> = ["pi", "si", "vi", "pr", "sr", "vr"]
        .into_iter()
        .filter_map(|letters| read(&name(letters)))
        .collect();
    let [pi, si, vi, pr, sr, vr] = all.as_slice() else {
        return;
    };
    for other in [si, vi] {
        assert_eq!(difference(pi, other), 0.0);
        assert_eq!(
            (&pi.residuals, &pi.cameras),
            (&other.residuals, &other.cameras)
        );
    }
    for other in [sr, vr] {
        assert_eq!(difference(pr, other), 0.0);
        assert_eq!(
            (&pr.residuals, &pr.cameras),
            (&other.residuals, &other.cameras)
        );
    }
    // Reals are the product of integer and scale, rounded once more to 24 bits.
    assert!(
        difference(pi, pr) <= 2f64.powi(12 - 24),
        "{}",
        difference(pi, pr)
    );
    assert_eq!((&pi.residuals, &pi.cameras), (&pr.residuals, &pr.cameras));
}

#[test]
fn the_encodings_of_sample02_agree_within_a_step() {
    let read = |name: &str| read(&format!("c3d_testsuite/sample02/{name}"));
    let Some(real) = read("pc_real.c3d") else {
        return;
    };
    for name in ["Dec_real.c3d", "sgi_real.c3d"] {
        assert_eq!(difference(&real, &read(name).unwrap()), 0.0, "{name}");
    }
    let step = f64::from(real.scale.unwrap().abs());
    for name in ["DEC_INT.C3D", "pc_int.c3d", "sgi_int.c3d"] {
        let difference = difference(&real, &read(name).unwrap());
        assert!(difference < step * 1.001, "{name}: {difference}");
    }
}

#[test]
fn moved_header_pointers_give_the_same_points() {
    let Some(plain) = read("c3d_testsuite/sample01/Eb015pi.c3d") else {
        return;
    };
    for name in ["TESTAPI", "TESTBPI"] {
        let moved = read(&format!("c3d_testsuite/sample08/{name}.c3d")).unwrap();
        assert_eq!(difference(&plain, &moved), 0.0, "{name}");
    }
}

#[test]
fn names_and_kinds_are_read() {
    let Some(raw) = read("c3d_testsuite/vicon_FunctionalWalk_146pts.c3d") else {
        return;
    };
    assert_eq!(
        (raw.labels[0].as_str(), raw.labels[145].as_str()),
        ("LFHD", "LeftHipCenterNM")
    );
    let count = |kind| raw.kinds.iter().filter(|other| **other == kind).count();
    assert_eq!(
        [
            PointKind::Angle,
            PointKind::Force,
            PointKind::Moment,
            PointKind::Power
        ]
        .map(count),
        [12, 10, 8, 6]
    );
    assert_eq!(raw.first_frame, 480);
    assert_eq!(raw.events.len(), 11);
    let analog = raw.analog.unwrap();
    assert_eq!((analog.channel_count, analog.samples_per_frame), (36, 9));

    let raw = read("c3d_testsuite/sample04_sub_labels.c3d").unwrap();
    assert_eq!(raw.labels[3], "Matt:SACR");
    assert_eq!(take::split_subject(&raw.labels[3]), (Some("Matt"), "SACR"));
    // Powers of exactly (0, 0, 0) are values, not gaps.
    assert_eq!(raw.position(200, 108).map(|power| power[0]), Some(0.0));

    // The scale that makes the shoulders stand at 1.45 m is the header's.
    let raw = read("c3d_testsuite/sample06_MACsample_mips_int.c3d").unwrap();
    let shoulder = raw.position(90, 0).unwrap();
    assert!((shoulder[2] - 1448.5).abs() < 0.1, "{shoulder:?}");
}

#[test]
fn motive_columns_are_told_apart() {
    let Some(raw) = read("motive/motive_v1.21_unlabeled.csv") else {
        return;
    };
    let count = |kind| raw.kinds.iter().filter(|other| **other == kind).count();
    assert_eq!(
        [PointKind::Model, PointKind::Marker, PointKind::Unlabelled].map(count),
        [3, 3, 6]
    );
    let empty = (0..12).filter(|point| (0..250).all(|frame| raw.position(frame, *point).is_none()));
    assert_eq!(
        empty
            .map(|point| raw.labels[point].as_str())
            .collect::<Vec<_>>(),
        ["Unlabeled:105", "Unlabeled:107", "Unlabeled:106"]
    );
    let body = &raw.rigid_bodies[0];
    assert_eq!(
        (body.name.as_str(), body.poses.len(), body.errors.len()),
        ("Rigid Body 1", 250, 250)
    );
    let (rotation, origin) = body.poses[0].unwrap();
    assert_eq!(origin.to_array(), [0.060002, 0.019150, 0.076611]);
    assert!(rotation.w < -0.999_999 && rotation.is_normalized());
    assert_eq!(body.errors[0], 0.000004);
}

#[test]
fn a_cut_header_is_refused() {
    let Some(path) = shared("trc/truncated.trc") else {
        return;
    };
    let error = read_take(path, &TakeOptions::default()).unwrap_err();
    assert_eq!(error.place, Place::Line(2));
    assert!(matches!(
        error.kind,
        ImportErrorKind::Truncated {
            needed: 5,
            found: 2,
            ..
        }
    ));
}

/// The take that a C3D file can hold of it: 24 bits a coordinate.
fn rounded(take: &RawTake) -> RawTake {
    let mut take = take.clone();
    for value in take.positions.iter_mut().flatten() {
        *value = f64::from(*value as f32);
    }
    take
}

#[test]
fn written_recordings_come_back() {
    for holds in C3D.iter().chain(&TABLES) {
        let Some(raw) = read(holds.file) else {
            continue;
        };
        let mut bytes = Vec::new();
        write_c3d(&raw, &mut bytes).unwrap();
        let back = c3d::parse(&bytes, holds.file, &TakeOptions::default()).unwrap();
        let file = holds.file;
        if holds.points == 0 {
            // Analog samples are not written, and without samples there are no frames.
            assert_eq!((back.point_count(), back.frame_count), (0, 0), "{file}");
            continue;
        }
        assert_eq!(difference(&rounded(&raw), &back), 0.0, "{file}");
        assert_eq!(
            (back.unit, back.up, back.kinds),
            (raw.unit, raw.up, raw.kinds.clone()),
            "{file}"
        );
        assert_eq!(
            (back.first_frame, back.rate as f32),
            (raw.first_frame, raw.rate as f32),
            "{file}"
        );
        assert_eq!(back.events.len(), raw.events.len(), "{file}");
        if !raw.cameras.is_empty() {
            assert_eq!(
                (back.residuals, back.cameras),
                (raw.residuals.clone(), raw.cameras.clone()),
                "{file}"
            );
        }

        // Through metres with Y up and back, the same 24 bits.
        let (take, _) = Take::from_raw(&raw).unwrap();
        let mut measured = raw.clone();
        let mut point = 0;
        measured.positions.retain(|_| {
            let kind = raw.kinds[point % raw.point_count()];
            point += 1;
            kind.is_measured()
        });
        measured.labels = take.labels().to_vec();
        let difference = difference(&rounded(&measured), &rounded(&take.to_raw()));
        assert_eq!(difference, 0.0, "{file}");
    }
}

/// With `SINEW_DUMP_DIR` set, leaves what `tests/python/check_c3d.py` compares with other readers.
#[test]
fn dump_for_other_readers() {
    let Some(folder) = std::env::var_os("SINEW_DUMP_DIR") else {
        eprintln!("SKIPPED: SINEW_DUMP_DIR is not set");
        return;
    };
    let folder = Path::new(&folder);
    fs::create_dir_all(folder).unwrap();
    let dump = |name: &str, source: Option<&str>, raw: &RawTake| {
        let path = |ending| folder.join(format!("{name}.{ending}"));
        let values: Vec<u8> = raw
            .positions
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        fs::write(path("f64"), values).unwrap();
        let facts = json!({
            "source": source, "labels": raw.labels, "frames": raw.frame_count, "rate": raw.rate,
            "first_frame": raw.first_frame, "scale": raw.scale,
        });
        fs::write(path("json"), facts.to_string()).unwrap();
        let mut file = Vec::new();
        write_c3d(raw, &mut file).unwrap();
        fs::write(path("c3d"), file).unwrap();
    };
    for holds in &C3D {
        let Some(raw) = read(holds.file) else {
            continue;
        };
        dump(&holds.file.replace(['/', '.'], "_"), Some(holds.file), &raw);
    }
    let table = |points: usize, frames: usize| {
        let labels: Vec<String> = (0..points)
            .map(|point| format!("m{point}_x,m{point}_y,m{point}_z"))
            .collect();
        let mut text = format!("# unit: mm, up: +Z, rate: 100\n{}\n", labels.join(","));
        for frame in 0..frames {
            let row: Vec<String> = (0..points)
                .map(|point| {
                    if (frame + point) % 7 == 3 {
                        ",,".into()
                    } else {
                        format!("{frame},{point},0.1")
                    }
                })
                .collect();
            text.push_str(&row.join(","));
            text.push('\n');
        }
        sinew_host::import::marker_csv::parse(text.as_bytes(), "made", &TakeOptions::default())
            .unwrap()
    };
    dump("made_long", None, &table(2, 70_001));
    dump("made_wide", None, &table(600, 9));
}
