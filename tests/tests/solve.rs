//! Skeletons solved from markers: real captures, and virtual ones whose skeleton is known.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use sinew_host::export::bvh::{BvhStyle, write_bvh};
use sinew_host::fit::solve::{MarkerSet, Progress, SolveError, SolveOptions, Solved, solve};
use sinew_host::fit::{Correspondence, Humanoid, Options, Part, Side, Which, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::model::{Avatar, Motion};
use sinew_host::reference::pose::sample;
use sinew_host::studio::{Body, Direction, MarkerLayout, MarkerSet as Layout, Scene, Shot};
use sinew_host::take::Take;
use sinew_tests::{Random, root, shared};

fn recording(file: &str) -> Option<Take> {
    let path = shared(file)?;
    let raw = read_take(&path, &TakeOptions::default()).unwrap();
    Some(Take::from_raw(&raw).unwrap().0)
}

fn solved(take: &Take) -> Solved {
    solve(take, "test", SolveOptions::default(), Progress::SILENT).unwrap()
}

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

/// Removes bursts of samples until this share is missing.
fn lose(take: &mut Take, share: f64, random: &mut Random) {
    while take.missing_fraction() < share {
        let marker = random.below(take.marker_count());
        let from = random.below(take.frame_count());
        let length = 5 + random.below(40);
        for frame in from..(from + length).min(take.frame_count()) {
            take.set_position(marker, frame, None);
        }
    }
}

/// Root mean square errors of a virtual capture: joint centres in metres, rotations in radians.
struct Errors {
    missing: f64,
    centres: f64,
    rotations: f64,
    residual: f64,
}

const LIMBS: [Part; 6] = [
    Part::UpperArm,
    Part::LowerArm,
    Part::Hand,
    Part::UpperLeg,
    Part::LowerLeg,
    Part::Foot,
];

/// Films the bundled body in a motion with 41 markers, loses a tenth of all samples, solves, and
/// compares with the skeleton that moved it. A rotation counts from its mean offset to the true
/// joint's, since the two rigs rest in different axes.
fn virtual_capture(file: &Path, seconds: f64) -> Errors {
    let avatar = body();
    let source = motion(file);
    let joints = Correspondence::new(&source.skeleton, &avatar.skeleton, &[]).unwrap();
    let fitted = retarget(&source, &avatar.skeleton, &joints, &Options::default()).unwrap();
    let scene = Scene {
        rate: 60.0,
        direction: Direction {
            seconds: Some(seconds),
            ..Direction::default()
        },
        ..Scene::default()
    };
    let film = Body::new(&avatar, &fitted.clip, scene).unwrap();
    let markers = Layout::new(&avatar, MarkerLayout::Standard41, 1).unwrap();
    let capture = Shot::default().film(&film, &markers, &|_| ()).unwrap();
    let mut take = capture.labelled_take().unwrap();
    lose(&mut take, 0.1, &mut Random(7));
    // The studio's markers have no thickness.
    let options = SolveOptions {
        marker_radius: 0.0,
        ..SolveOptions::default()
    };
    let found = solve(&take, "test", options, Progress::SILENT).unwrap();
    assert!(found.by_labels);

    let truth = Humanoid::new(&avatar.skeleton, Which::Target).unwrap();
    let ours = Humanoid::new(&found.motion.skeleton, Which::Source).unwrap();
    let (mut centre, mut turn, mut count) = (0.0, 0.0, 0.0);
    let poses: Vec<(Vec<DAffine3>, Vec<DAffine3>)> = (0..take.frame_count())
        .map(|frame| {
            let seconds = take.seconds(frame);
            let local = sample(&found.motion.skeleton, &found.motion.clip, seconds);
            let true_pose = film.performance().pose(seconds);
            (true_pose, found.motion.skeleton.model(&local))
        })
        .collect();
    for side in [Side::Left, Side::Right] {
        for part in LIMBS {
            let (at, own) = (
                truth.limb(side, part).unwrap(),
                ours.limb(side, part).unwrap(),
            );
            let away = |(a, b): &(Vec<DAffine3>, Vec<DAffine3>)| {
                a[at].translation.distance_squared(b[own].translation)
            };
            let centres = poses.iter().map(away).sum::<f64>();
            let offsets: Vec<DQuat> = poses
                .iter()
                .map(|(a, b)| {
                    let (a, b) = (a[at].to_scale_rotation_translation().1, b[own]);
                    a.inverse() * b.to_scale_rotation_translation().1
                })
                .collect();
            let mean = mean(&offsets);
            let turned = |offset: &DQuat| short(mean.inverse() * *offset).length_squared();
            let turns = offsets.iter().map(turned).sum::<f64>();
            let n = poses.len() as f64;
            eprintln!(
                "  {side:?} {part:?}: {:.1} mm, {:.2} degrees",
                1e3 * (centres / n).sqrt(),
                (turns / n).sqrt().to_degrees()
            );
            (centre, turn, count) = (centre + centres, turn + turns, count + n);
        }
    }
    let errors = Errors {
        missing: take.missing_fraction(),
        centres: (centre / count).sqrt(),
        rotations: (turn / count).sqrt(),
        residual: found.residual,
    };
    eprintln!(
        "{}: {:.0} % missing, centres {:.2} mm, rotations {:.2} degrees, residual {:.2} mm",
        file.display(),
        100.0 * errors.missing,
        1e3 * errors.centres,
        errors.rotations.to_degrees(),
        1e3 * errors.residual
    );
    errors
}

/// The rotation vector of the shorter way.
fn short(turn: DQuat) -> DVec3 {
    if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis()
}

fn mean(turns: &[DQuat]) -> DQuat {
    let mut mean = turns[0];
    for _ in 0..5 {
        let of = |turn: &DQuat| short(mean.inverse() * *turn);
        let step = turns.iter().map(of).sum::<DVec3>() / turns.len() as f64;
        mean = (mean * DQuat::from_scaled_axis(step)).normalize();
    }
    mean
}

#[test]
fn a_known_skeleton_comes_back() {
    let errors = virtual_capture(&root().join("examples/data/kneel.bvh"), 6.0);
    assert!(errors.missing >= 0.1);
    assert!(errors.centres <= 0.0105, "{}", errors.centres);
    assert!(errors.rotations.to_degrees() <= 3.0);
}

#[test]
#[ignore = "several minutes: the figures in host/README.md"]
fn known_skeletons_come_back_from_other_motions() {
    virtual_capture(&root().join("examples/data/walk.bvh"), 8.0);
    for file in ["bvh/cmu_01_01.bvh", "bvh/cmu_12_01_walk.bvh"] {
        if let Some(path) = shared(file) {
            virtual_capture(&path, 10.0);
        }
    }
}

#[test]
fn a_capture_of_cmu_is_solved_within_its_bars() {
    let Some(take) = recording("c3d/cmu_02_05.c3d") else {
        return;
    };
    let found = solved(&take);
    assert!(found.by_labels && found.ignored.is_empty());
    assert_eq!(found.held_frames, 0);
    assert!(found.residual <= 0.012, "{}", found.residual);
    for bone in &found.bones {
        assert!(bone.other.is_none_or(|(_, more)| more.abs() <= 0.05));
    }
    // The written file holds the same motion.
    let mut text = Vec::new();
    write_bvh(&found.motion, BvhStyle::default(), &mut text).unwrap();
    let raw = read_bvh(&text, "out.bvh").unwrap();
    let (back, _) = Motion::new(raw, "out.bvh").unwrap();
    for frame in (0..take.frame_count()).step_by(50) {
        let seconds = take.seconds(frame);
        let at = |motion: &Motion| {
            let local = sample(&motion.skeleton, &motion.clip, seconds);
            let model = motion.skeleton.model(&local);
            let named = motion.skeleton.joints.iter().zip(model);
            let mut all: Vec<(String, DVec3)> = named
                .map(|(joint, model)| (joint.name.clone(), model.translation))
                .collect();
            all.sort_by(|a, b| a.0.cmp(&b.0));
            all
        };
        for ((name, a), (other, b)) in at(&found.motion).iter().zip(&at(&back)) {
            assert_eq!(name, other);
            assert!(a.distance(*b) < 1e-6, "{name}");
        }
    }
    // And drives the bundled body.
    let avatar = body();
    let joints = Correspondence::new(&back.skeleton, &avatar.skeleton, &[]).unwrap();
    assert!(retarget(&back, &avatar.skeleton, &joints, &Options::default()).is_ok());
}

#[test]
fn markers_without_known_names_form_groups() {
    let Some(take) = recording("c3d/optitrack_walking_dec_int.c3d") else {
        return;
    };
    let found = solved(&take);
    assert!(!found.by_labels);
    assert!(found.motion.skeleton.joints.len() >= 2);
    assert!(found.residual < 0.01, "{}", found.residual);
    let options = SolveOptions {
        set: MarkerSet::Labels,
        ..SolveOptions::default()
    };
    let refused = solve(&take, "test", options, Progress::SILENT).unwrap_err();
    assert!(matches!(refused, SolveError::UnknownLabels { .. }));
}

#[test]
fn takes_that_cannot_be_solved_are_refused() {
    let nothing = Take::new(Vec::new(), 100.0, 0, Vec::new()).unwrap();
    let error = solve(&nothing, "", SolveOptions::default(), Progress::SILENT);
    assert_eq!(error.unwrap_err(), SolveError::Empty);
    let unseen = Take::new(vec!["LASI".into()], 100.0, 3, vec![DVec3::NAN; 3]).unwrap();
    let error = solve(&unseen, "", SolveOptions::default(), Progress::SILENT);
    assert_eq!(error.unwrap_err(), SolveError::Empty);
    // Three points in one place say nothing about a body.
    let labels = ["LASI", "RASI", "SACR"].map(str::to_owned).to_vec();
    let point = Take::new(labels, 100.0, 4, vec![DVec3::ONE; 12]).unwrap();
    let found = solve(&point, "", SolveOptions::default(), Progress::SILENT);
    assert!(found.is_err() || found.is_ok_and(|found| found.residual.is_finite()));
    // One frame, one marker far away.
    let far = Take::new(vec!["*1".into()], 100.0, 1, vec![DVec3::splat(1e300)]).unwrap();
    let error = solve(&far, "", SolveOptions::default(), Progress::SILENT);
    assert!(matches!(error, Err(SolveError::NoGroups { .. })));
}
