//! Ropes from captures to assets: a skipper whose rope is found again, a Motive recording.

use glam::DVec3;
use sinew_host::bake::{BakeOptions, bake};
use sinew_host::fit::rope::{
    FollowOptions, Origin, PointFrames, RepairOptions, Selection, TubeOptions, beside, both_ways,
    follow_all, repair, separate, tube,
};
use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::studio::rope::{Grip, Motion, Scene as RopeScene, hold, skipping};
use sinew_host::studio::{
    Body, Direction, FleshOptions, MarkerLayout, MarkerSet, Scene, Shot, performed,
};
use sinew_host::take::Take;
use sinew_tests::filming::human;
use sinew_tests::shared;

/// The bundled body skips; its rope comes back from unlabelled points, and both play from one
/// asset.
#[test]
fn a_skipper_and_the_rope_in_one_asset() {
    let mut rope = RopeScene::new(Motion::Skipping, 3);
    (rope.rate, rope.seconds) = (60.0, 2.6);
    let (clip, rope) = skipping(human(), &rope).unwrap();
    let scene = Scene {
        rate: 60.0,
        direction: Direction {
            hold: 0.0,
            blend: 0.0,
            seconds: Some(2.5),
            ..Direction::default()
        },
        flesh: FleshOptions::default(),
    };
    let body = Body::new(human(), &clip, scene).unwrap();
    let shot = Shot::default();
    let held = hold(&body, &rope, Grip::Both, &shot, &|_| {}).unwrap();
    let markers = MarkerSet::new(human(), MarkerLayout::Standard41, 3).unwrap();
    let capture = shot.film(&body, &markers, &|_| {}).unwrap();
    let take = held.beside_unlabelled(&capture.take().unwrap(), 3).unwrap();

    let points = PointFrames::of_take(&take);
    let options = FollowOptions {
        markers: Some(rope.model.markers),
        ..FollowOptions::default()
    };
    let traces = follow_all(&points, &[options]).unwrap();
    let traces = both_ways(&points, &traces).unwrap();
    let trace = repair(&traces[0], &RepairOptions::default());
    // Ends in the fists may never show; what is followed lies on the rope.
    let count = trace.marker_count();
    assert!(
        count + 5 >= rope.model.markers,
        "{count} of {}",
        rope.model.markers
    );
    let mut errors: Vec<f64> = Vec::new();
    for (samples, truth) in trace.frames.iter().zip(&held.markers) {
        for sample in samples {
            let away = truth.iter().map(|p| p.distance(sample.position));
            errors.push(away.fold(f64::INFINITY, f64::min));
        }
    }
    errors.sort_by(f64::total_cmp);
    let (median, tail) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    assert!(
        median < 0.002 && tail < 0.05,
        "median {median} m, 95 % below {tail} m"
    );

    let tube = tube(&trace, "rope", &TubeOptions::default()).unwrap();
    let mut avatar = human().clone();
    avatar.clips = vec![performed(&body)];
    let whole = beside(&avatar, 0, &tube);
    let baked = bake(&whole, &BakeOptions::default()).unwrap();
    let asset = baked.bytes.asset().unwrap();
    assert_eq!(asset.dims().vertex_count, whole.mesh.positions.len());
    assert_eq!(asset.dims().clip_count, 1);
    let separated = separate(&take, &points, &[trace]).unwrap();
    assert_eq!(separated.rope.marker_count(), count);
    assert!(separated.others.marker_count() >= 41);
}

/// Three columns of a real recording, one of which jumps between two places.
#[test]
fn unlabelled_points_of_a_motive_take_are_tracked() {
    let Some(path) = shared("motive/motive_v1.21_unlabeled.csv") else {
        return;
    };
    let raw = read_take(&path, &TakeOptions::default()).unwrap();
    let (take, _) = Take::from_raw(&raw).unwrap();
    let column = |name: &str| {
        take.labels()
            .iter()
            .position(|label| label == name)
            .unwrap()
    };
    let columns = ["Unlabeled:108", "Unlabeled:110", "Unlabeled:111"].map(column);
    let points = PointFrames::of_take(&take);
    let options = FollowOptions {
        selection: Selection::Columns(columns.to_vec()),
        ..FollowOptions::default()
    };
    let traces = follow_all(&points, &[options]).unwrap();
    let traces = both_ways(&points, &traces).unwrap();
    let trace = repair(&traces[0], &RepairOptions::default());
    let (mut own, mut other) = (0, 0);
    for (frame, samples) in trace.frames.iter().enumerate() {
        for sample in samples {
            match sample.origin {
                Origin::Measured(point) if columns.contains(&points.columns[frame][point]) => {
                    own += 1;
                }
                Origin::Measured(_) => other += 1,
                _ => {}
            }
            let away = columns.map(|c| {
                let at: Option<DVec3> = take.position(c, frame);
                at.map_or(f64::INFINITY, |p| p.distance(sample.position))
            });
            assert!(
                away.into_iter().fold(f64::INFINITY, f64::min) < 0.02,
                "frame {frame}"
            );
        }
    }
    assert_eq!(other, 0);
    assert!(
        own * 10 >= 3 * take.frame_count() * 8,
        "{own} samples of {}",
        3 * take.frame_count()
    );
}
