//! Cleaning, judged on real recordings, of which measured stretches are hidden and filled again, and
//! on a virtual capture whose truth is known.
//!
//! `tests/examples/judge_clean` prints whole tables; here are a few stretches of each.

use sinew_host::clean::exchange;
use sinew_host::clean::fill::{FillOptions, fill};
use sinew_host::clean::merge::{MergeOptions, merge};
use sinew_host::studio::judge::Key;
use sinew_host::studio::{Direction, MarkerLayout, MarkerSet, Shot};
use sinew_tests::filming::{clip_at, film, human};
use sinew_tests::hidden::{METHODS, judge, stretches, take};
use sinew_tests::live::cut;
use sinew_tests::root;

/// Fills a few hidden stretches: the default must beat splines and lines at 30 frames and above.
#[test]
fn the_default_beats_interpolation() {
    for (file, seed) in [
        ("c3d/cmu_02_05.c3d", 11),
        ("c3d/freeform_53mk_gappy.c3d", 12),
    ] {
        let Some(take) = take(file) else { return };
        for length in [30, 100] {
            let mut hidden = stretches(&take, length, 1, seed);
            hidden.retain(|(marker, _)| marker % 8 == 0);
            let errors = judge(&take, &hidden, length);
            let default = errors[0].mean();
            for (method, errors) in METHODS.iter().zip(&errors).skip(1) {
                assert!(
                    default < errors.mean(),
                    "{file}, {length} frames: {method:?}"
                );
            }
            assert!(default < 0.012, "{file}, {length} frames: {default} m");
        }
    }
}

/// Two markers of a recording exchange their names behind a gap: found, and nothing else.
#[test]
fn exchanged_names_of_a_recording_are_found() {
    let Some(take) = take("c3d/cmu_02_05.c3d") else {
        return;
    };
    let truth = cut(&take, 0, 500);
    let mut broken = truth.clone();
    let (a, b) = (4, 23);
    for frame in 150..330 {
        let hidden = frame < 160;
        let seen = |marker| truth.position(marker, frame).filter(|_| !hidden);
        broken.set_position(a, frame, seen(b));
        broken.set_position(b, frame, seen(a));
    }
    let found = exchange::find(&broken, &|_| ());
    assert_eq!(found.exchanges.len(), 1, "{found:?}");
    let one = &found.exchanges[0];
    assert_eq!(one.columns, [a, b]);
    assert!(one.frames.start <= 160 && one.frames.end == 330, "{one:?}");
    assert!(one.after < 0.25 * one.before);
    assert!(exchange::find(&truth, &|_| ()).is_empty());
}

/// A second and a half of walking with exchanged trajectories: labels, markers, ghosts and swaps as
/// the truth has them, and filled samples near it.
#[test]
fn a_virtual_capture_gets_its_labels_back() {
    let markers = MarkerSet::new(human(), MarkerLayout::Dense(160), 21).unwrap();
    let direction = Direction {
        seconds: Some(2.0),
        speed: 1.5,
        ..Direction::default()
    };
    let shot = Shot {
        swap_chance: 0.5,
        seed: 21,
        ..Shot::default()
    };
    let clip = clip_at(&root().join("examples/data/walk.bvh"));
    let capture = film(&clip, &markers, direction, shot);
    let take = capture.take().unwrap();
    let merged = merge(&take, &MergeOptions::default(), &|_| ()).unwrap();
    let key = Key::new(&capture).unwrap();
    key.check(&take).unwrap();
    let labels = key.labels(&merged);
    assert!(labels.real > 200, "{}", labels.real);
    assert!(100 * labels.wrong <= labels.real, "{:?}", labels.faults);
    assert!(50 * labels.left <= labels.real, "{:?}", labels.faults);
    assert!(labels.found.abs_diff(labels.markers) <= 3, "{labels:?}");
    assert!(labels.ghosts_told + 1 >= labels.ghosts);
    for swap in merged.swaps() {
        assert_ne!(swap.from, swap.to);
    }
    let filled = fill(&merged.take, &FillOptions::default(), &|| ());
    let errors = key.fill_errors(&labels, &filled);
    assert!(errors.len() > 200);
    assert!(
        errors[errors.len() / 2] < 3e-3,
        "{} m",
        errors[errors.len() / 2]
    );
}
