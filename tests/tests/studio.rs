//! The virtual capture of the bundled body: truth, markers, statistics, labels, files.

use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;

use glam::DVec3;
use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::model::Clip;
use sinew_host::studio::{
    Body, Capture, Direction, FleshOptions, MarkerLayout, MarkerSet, Ring, Scene, Shot,
    StudioError, files,
};
use sinew_host::take::Take;
use sinew_tests::body::checked_arm;
use sinew_tests::filming::{clip_of, human};
use sinew_tests::{root, shared};

fn clip(name: &str) -> Clip {
    clip_of(&std::fs::read(root().join("examples/data").join(name)).unwrap())
}

fn scene(seconds: f64) -> Scene {
    Scene {
        direction: Direction {
            seconds: Some(seconds),
            ..Direction::default()
        },
        ..Scene::default()
    }
}

/// Two and a half seconds of the walk with 350 markers.
fn walk() -> &'static (Body<'static>, MarkerSet, Capture) {
    static WALK: OnceLock<(Body<'static>, MarkerSet, Capture)> = OnceLock::new();
    WALK.get_or_init(|| {
        let body = Body::new(human(), &clip("walk.bvh"), scene(2.5)).unwrap();
        let markers = MarkerSet::new(human(), MarkerLayout::Dense(350), 1).unwrap();
        let shot = Shot {
            swap_chance: 0.5,
            ..Shot::default()
        };
        let capture = shot.film(&body, &markers, &|_| ()).unwrap();
        (body, markers, capture)
    })
}

#[test]
fn the_true_surface_is_the_skinned_body_plus_bounded_flesh() {
    let (body, ..) = walk();
    let mut largest: f64 = 0.0;
    for frame in (0..body.frame_count()).step_by(10) {
        let (with, without) = (body.surface(frame), body.skeleton_surface(frame));
        for (a, b) in with.positions.iter().zip(&without.positions) {
            largest = largest.max(a.distance(*b));
        }
        assert!(
            with.normals
                .iter()
                .all(|normal| (normal.length() - 1.0).abs() < 1e-9)
        );
    }
    assert!((0.010..0.0285).contains(&largest), "{largest}");

    let still = FleshOptions {
        muscle: 0.0,
        breath: 0.0,
        jiggle: 0.0,
        ..FleshOptions::default()
    };
    let bones = Scene {
        flesh: still,
        ..scene(1.5)
    };
    let bones = Body::new(human(), &clip("walk.bvh"), bones).unwrap();
    let frame = bones.frame_count() - 1;
    assert_eq!(bones.surface(frame), bones.skeleton_surface(frame));

    // The take begins in the rest pose, turned and moved on the floor alone: heights are the
    // rest shape's.
    let start = bones.surface(0);
    let heights = start.positions.iter().zip(&human().mesh.positions);
    let worst = heights.map(|(a, b)| (a.y - b.y).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn the_truth_has_no_jerks() {
    let (_, _, capture) = walk();
    let rate = capture.rate;
    for frame in 1..capture.frames.len() - 1 {
        let [a, b, c] = [-1, 0, 1]
            .map(|step: isize| &capture.truth.positions[frame.checked_add_signed(step).unwrap()]);
        for marker in 0..capture.truth.names.len() {
            let bend = (a[marker] - 2.0 * b[marker] + c[marker]).length() * rate * rate;
            assert!(bend < 120.0, "frame {frame}, marker {marker}: {bend} m/s2");
        }
    }
}

#[test]
fn soft_parts_lag_and_settle() {
    // After the hold nothing has moved yet: only breath.
    let (body, ..) = walk();
    let names: Vec<&str> = body
        .flesh()
        .modes()
        .iter()
        .map(|mode| mode.name.as_str())
        .collect();
    let of = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let belly = of("belly y");
    let at = |frame: usize| body.amplitudes(frame)[belly];
    let held = (0.4 * body.scene().rate) as usize;
    assert!((0..held).all(|frame| at(frame).abs() < 1e-5));
    let moved = (held..body.frame_count())
        .map(|frame| at(frame).abs())
        .fold(0.0, f64::max);
    assert!((0.002..0.022).contains(&moved), "{moved}");
    let knee = of("left calf");
    let bulge = (0..body.frame_count())
        .map(|f| body.amplitudes(f)[knee])
        .fold(0.0, f64::max);
    assert!(bulge > 0.003, "{bulge}");
    assert!(
        body.amplitudes(0)[knee].abs() < 1e-9,
        "none in the rest pose"
    );
}

#[test]
fn dense_markers_are_even_and_off_the_face() {
    let set = &walk().1;
    let rest = rest_positions(set);
    let nearest = |at: usize| {
        let others = rest.iter().enumerate().filter(|(other, _)| *other != at);
        others
            .map(|(_, other)| rest[at].distance(*other))
            .fold(f64::INFINITY, f64::min)
    };
    let distances: Vec<f64> = (0..rest.len()).map(nearest).collect();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    assert!((0.040..0.056).contains(&mean), "{mean}");
    assert!(distances.iter().all(|distance| *distance > 0.012));
    let face = |at: &&DVec3| at.y > 1.54 && at.y < 1.66 && at.z > 0.08;
    assert_eq!(rest.iter().filter(face).count(), 0);
    let fingers = |at: &&DVec3| at.x.abs() > 0.5 && at.z > 0.26;
    assert_eq!(rest.iter().filter(fingers).count(), 0);
    let soles = |at: &&DVec3| at.y < 0.004;
    assert_eq!(rest.iter().filter(soles).count(), 0);
    let left = rest.iter().filter(|at| at.x > 0.0).count();
    assert!((150..200).contains(&left), "{left} on the left");
}

fn rest_positions(set: &MarkerSet) -> Vec<DVec3> {
    let place = |at: u32| human().mesh.positions[at as usize];
    let of = |marker: &sinew_host::studio::Marker| {
        let corners = marker.vertices.iter().zip(marker.barycentric);
        corners.map(|(&at, weight)| weight * place(at)).sum()
    };
    set.markers.iter().map(of).collect()
}

#[test]
fn named_sets_are_complete_and_nearly_symmetric() {
    for (layout, count) in [
        (MarkerLayout::Standard41, 41),
        (MarkerLayout::Standard53, 53),
    ] {
        let set = MarkerSet::new(human(), layout, 0).unwrap();
        assert_eq!(set.markers.len(), count);
        let rest = rest_positions(&set);
        let by_name: HashMap<&str, DVec3> = set
            .markers
            .iter()
            .map(|m| m.name.as_str())
            .zip(rest)
            .collect();
        assert_eq!(by_name.len(), count, "names are unique");
        for (name, at) in &by_name {
            if let Some(other) = name
                .strip_prefix('L')
                .and_then(|n| by_name.get(&*format!("R{n}")))
            {
                let mirrored = DVec3::new(-other.x, other.y, other.z);
                assert!(at.distance(mirrored) < 0.015, "{name} {at} {other}");
                assert!(at.x > 0.0, "{name} is on the left");
            }
        }
        assert!(by_name["ARIEL"].y > 1.72 && by_name["C7"].z < by_name["CLAV"].z);
        assert!(by_name["LKNE"].y > by_name["LSHN"].y && by_name["LSHN"].y > by_name["LANK"].y);
        assert!(by_name["LHEE"].z < by_name["LANK"].z && by_name["LTOE"].z > by_name["LANK"].z);
    }
}

#[test]
fn a_capture_looks_like_the_papers() {
    let (_, _, capture) = walk();
    let counts = capture.statistics();
    // Park & Hodgins 2006, table 1: 350 markers; 8 to 12 % of samples missing; 19 (flexing) to 164
    // (jump rope) trajectories more than markers for each second and hundred markers; gaps of 9
    // (jump rope) to 50 (flexing) frames on average.
    assert!(
        (0.02..0.15).contains(&counts.missing_fraction),
        "{counts:?}"
    );
    let broken = (counts.trajectory_count - counts.ghost_count - 350) as f64;
    let density = broken / (counts.frame_count as f64 / capture.rate) / 3.5;
    assert!((19.0..164.0).contains(&density), "{density}");
    assert!((5.0..50.0).contains(&counts.mean_gap), "{counts:?}");
    assert!(counts.missing_at_start < 35, "{counts:?}");
    assert!((4..30).contains(&counts.ghost_count), "{counts:?}");

    let labelled = capture.labelled();
    let mut errors: Vec<f64> = Vec::new();
    for (row, truth) in labelled.iter().zip(&capture.truth.positions) {
        let pairs = row
            .iter()
            .zip(truth)
            .filter_map(|(point, truth)| Some((point.as_ref()?, truth)));
        errors.extend(pairs.map(|(point, truth)| point.distance(*truth)));
    }
    errors.sort_by(f64::total_cmp);
    // The median length of a 3-D normal vector is 1.538 standard deviations.
    let median = errors[errors.len() / 2];
    assert!((median / (1.538 * 0.15e-3) - 1.0).abs() < 0.02, "{median}");
    assert!(
        errors[errors.len() - 1] < 0.02,
        "a merged dot moves a point by millimetres"
    );
}

#[test]
fn trajectories_and_owners_are_consistent() {
    let (_, _, capture) = walk();
    let all = capture.trajectories();
    assert_eq!(
        all.len(),
        capture.trajectory_count(),
        "numbered without holes"
    );
    for (frame, (samples, owners)) in capture.frames.iter().zip(&capture.truth.owners).enumerate() {
        assert_eq!(samples.len(), owners.len());
        assert!(
            samples
                .windows(2)
                .all(|pair| pair[0].trajectory < pair[1].trajectory)
        );
        let named: Vec<u32> = owners.iter().flatten().copied().collect();
        let unique: HashSet<u32> = named.iter().copied().collect();
        assert_eq!(
            unique.len(),
            named.len(),
            "frame {frame}: a marker has one point"
        );
    }
    let mut samples = 0;
    for one in &all {
        for pair in one.spans.windows(2) {
            let end = pair[0].first_frame + pair[0].frame_count;
            assert_eq!(end, pair[1].first_frame, "no holes within a trajectory");
        }
        samples += one.spans.iter().map(|span| span.frame_count).sum::<usize>();
    }
    assert_eq!(samples, capture.frames.iter().map(Vec::len).sum::<usize>());
    // A swap gives at most two trajectories another owner; some are undone by a break.
    let mixed = all.iter().filter(|one| one.spans.len() > 1).count();
    assert!(mixed <= 2 * capture.truth.swap_count, "{mixed}");
    let cameras_needed = capture.frames.iter().flatten();
    assert!(
        cameras_needed
            .into_iter()
            .all(|sample| sample.cameras.count_ones() >= 2)
    );
}

#[test]
fn the_seed_decides_and_the_threads_do_not() {
    let body = Body::new(human(), &clip("walk.bvh"), scene(0.4)).unwrap();
    let markers = MarkerSet::new(human(), MarkerLayout::Dense(60), 4).unwrap();
    assert_eq!(
        markers,
        MarkerSet::new(human(), MarkerLayout::Dense(60), 4).unwrap()
    );
    assert_ne!(
        markers,
        MarkerSet::new(human(), MarkerLayout::Dense(60), 5).unwrap()
    );
    let film = |seed, threads| {
        let shot = Shot {
            seed,
            ..Shot::default()
        };
        shot.film_with(&body, &markers, threads, &|_| ()).unwrap()
    };
    let one = film(1, 1);
    assert_eq!(one, film(1, 3));
    assert_eq!(one, film(1, 64), "more threads than frames");
    assert_ne!(one, film(2, 1));
}

#[test]
fn fewer_cameras_see_less() {
    let body = Body::new(human(), &clip("walk.bvh"), scene(0.3)).unwrap();
    let markers = MarkerSet::new(human(), MarkerLayout::Dense(100), 0).unwrap();
    let missing = |camera_count: usize| {
        let shot = Shot {
            ring: Ring {
                camera_count,
                ..Ring::default()
            },
            ..Shot::default()
        };
        shot.film(&body, &markers, &|_| ())
            .unwrap()
            .statistics()
            .missing_fraction
    };
    let [few, some, many] = [4, 8, 24].map(missing);
    assert!(few > some + 0.1 && some > many, "{few} {some} {many}");
}

#[test]
fn written_takes_are_read_back() {
    let (_, _, capture) = walk();
    let folder = std::env::temp_dir().join(format!("sinew-studio-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let takes = [
        capture.take(),
        capture.labelled_take(),
        capture.truth_take(),
    ];
    for (index, take) in takes.into_iter().enumerate() {
        let take = take.unwrap();
        let path = folder.join(format!("{index}.c3d"));
        files::write_take(&take, &path).unwrap();
        let raw = read_take(&path, &TakeOptions::default()).unwrap();
        let (back, _) = Take::from_raw(&raw).unwrap();
        assert_eq!(back.labels(), take.labels());
        assert_eq!(
            (back.rate(), back.frame_count()),
            (take.rate(), take.frame_count())
        );
        for marker in 0..take.marker_count() {
            for (a, b) in take.trajectory(marker).iter().zip(back.trajectory(marker)) {
                assert_eq!(a.is_nan(), b.is_nan());
                assert!(
                    a.is_nan() || a.distance(*b) < 1e-6,
                    "f32 millimetres: {a} {b}"
                );
            }
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn what_cannot_be_filmed_is_refused_with_its_reason() {
    let walk = clip("walk.bvh");
    let refuse = |scene: Scene| Body::new(human(), &walk, scene).unwrap_err().to_string();
    let text = refuse(Scene {
        rate: 0.0,
        ..Scene::default()
    });
    assert_eq!(text, "rate is 0; it must be between 1 and 10,000 Hz");
    refuse(Scene {
        rate: f64::NAN,
        ..Scene::default()
    });
    refuse(scene(-1.0));
    refuse(Scene {
        direction: Direction {
            speed: 0.0,
            ..Direction::default()
        },
        ..Scene::default()
    });
    let many = MarkerSet::new(human(), MarkerLayout::Dense(1_000_000), 0);
    assert!(matches!(
        many,
        Err(StudioError::TooManyMarkers {
            wanted: 1_000_000,
            ..
        })
    ));
    assert!(MarkerSet::new(human(), MarkerLayout::Dense(0), 0).is_err());

    let arm = checked_arm();
    let named = MarkerSet::new(&arm, MarkerLayout::Standard41, 0);
    assert!(matches!(named, Err(StudioError::NotHuman(_))));
    assert!(matches!(
        Body::new(&arm, &walk, Scene::default()),
        Err(StudioError::ForeignClip { .. })
    ));
}

#[test]
fn a_body_that_is_not_human_has_bones_and_markers_alone() {
    let arm = checked_arm();
    let body = Body::new(&arm, &arm.clips[0], scene(0.5)).unwrap();
    assert!(body.flesh().modes().is_empty());
    assert_eq!(body.surface(40), body.skeleton_surface(40));
    let markers = MarkerSet::new(&arm, MarkerLayout::Dense(30), 0).unwrap();
    let capture = Shot::default().film(&body, &markers, &|_| ()).unwrap();
    assert_eq!(capture.statistics().marker_count, 30);
}

#[test]
fn a_real_jump_breaks_more_trajectories_than_a_walk() {
    let Some(path) = shared("bvh/cmu_01_01.bvh") else {
        return;
    };
    let body = Body::new(human(), &clip_of(&std::fs::read(path).unwrap()), scene(2.5)).unwrap();
    let (_, markers, walk) = walk();
    let capture = Shot::default().film(&body, markers, &|_| ()).unwrap();
    let (jump, walk) = (capture.statistics(), walk.statistics());
    assert!((0.03..0.2).contains(&jump.missing_fraction), "{jump:?}");
    assert!(jump.gap_count > walk.gap_count, "{jump:?} {walk:?}");
}
