//! From unlabelled points to repaired ropes, on virtual ropes whose truth is known.

use glam::DVec3;

use super::*;
use crate::studio::rope::{Capture, Disturbance, Label, Motion, Scene};

fn scene(motion: Motion, tempo: f64, seconds: f64) -> Scene {
    Scene {
        tempo,
        seconds,
        ..Scene::new(motion, 11)
    }
}

fn frames(capture: &Capture) -> PointFrames {
    let points = capture.frames.iter().map(|frame| frame.points.clone());
    PointFrames::new(capture.rate, points.collect())
}

/// Turned so that marker 0 is the truth's.
fn aligned(mut trace: Trace, truth: &[Vec<DVec3>]) -> Trace {
    let first = &trace.frames[trace.start];
    let [a, b] = [first[0].position, first[first.len() - 1].position];
    if truth[trace.start][0].distance(b) < truth[trace.start][0].distance(a) {
        trace.frames.iter_mut().for_each(|frame| frame.reverse());
    }
    trace
}

#[test]
fn a_gap_is_repaired_from_both_sides() {
    let take = scene(Motion::Ribbon, 0.6, 4.0).film().unwrap();
    let mut capture = take.capture(&Disturbance::noise_only(2));
    let hidden = |frame: usize, marker: usize| (220..250).contains(&frame) && marker == 7;
    for (number, frame) in capture.frames.iter_mut().enumerate() {
        let labels = frame.labels.clone();
        let shown = |at: usize| !matches!(labels[at], Label::Rope(m) if hidden(number, m));
        let mut at = 0..;
        frame.points.retain(|_| shown(at.next().unwrap()));
        frame
            .labels
            .retain(|label| !matches!(label, Label::Rope(m) if hidden(number, *m)));
    }
    let points = frames(&capture);
    let live = follow(&points, &FollowOptions::default()).unwrap();
    let both = both_ways(&points, std::slice::from_ref(&live))
        .unwrap()
        .remove(0);
    let fixed = aligned(repair(&both, &RepairOptions::default()), &take.rope);
    let live = aligned(live, &take.rope);
    let mean = |trace: &Trace| {
        let errors = (220..250).map(|f| trace.frames[f][7].position.distance(take.rope[f][7]));
        errors.sum::<f64>() / 30.0
    };
    assert_eq!(live.marker_count(), 16);
    assert!(mean(&live) < 0.009, "{}", mean(&live));
    assert!(
        mean(&fixed) < 0.005 && mean(&fixed) < mean(&live),
        "{}",
        mean(&fixed)
    );
    let sample = &fixed.frames[235][7];
    assert_eq!((sample.origin, sample.gap), (Origin::Filled, 15));
    assert!(sample.confidence > 0.5);
}

#[test]
fn a_skipping_rope_is_told_from_its_skipper() {
    let mut scene = scene(Motion::Skipping, 1.0, 3.0);
    scene.people = true;
    let take = scene.film().unwrap();
    let capture = take.capture(&Disturbance {
        cameras: 12,
        ..Disturbance::rough(4)
    });
    let points = frames(&capture);
    let options = FollowOptions {
        markers: Some(25),
        ..FollowOptions::default()
    };
    let live = follow(&points, &options).unwrap();
    let both = both_ways(&points, &[live]).unwrap().remove(0);
    let trace = aligned(repair(&both, &RepairOptions::default()), &take.rope);
    let (mut wrong, mut measured, mut error) = (0, 0, 0.0);
    for (frame, samples) in trace.frames.iter().enumerate() {
        for (marker, sample) in samples.iter().enumerate() {
            error += sample.position.distance(take.rope[frame][marker]);
            if let Some(point) = sample.point() {
                measured += 1;
                let label = capture.frames[frame].labels[point];
                wrong += usize::from(label != Label::Rope(marker));
            }
        }
    }
    let all = trace.frames.len() * 25;
    assert!(10 * measured > 8 * all, "{measured} of {all} measured");
    assert!(100 * wrong < measured, "{wrong} of {measured} wrong");
    assert!(error / (all as f64) < 0.01, "{}", error / all as f64);
}

#[test]
fn listed_markers_need_not_be_even() {
    let at = |x: f64| DVec3::new(x, 1.0, 0.0);
    let frame = vec![at(0.5), at(9.0), at(0.0), at(0.16)];
    let points = PointFrames::new(120.0, vec![frame; 10]);
    let options = FollowOptions {
        selection: Selection::Columns(vec![0, 2, 3]),
        ..FollowOptions::default()
    };
    let trace = follow(&points, &options).unwrap();
    let places: Vec<f64> = trace.frames[9].iter().map(|s| s.position.x).collect();
    assert!(
        places == [0.0, 0.16, 0.5] || places == [0.5, 0.16, 0.0],
        "{places:?}"
    );
    assert!(trace.frames.iter().flatten().all(|s| s.point().is_some()));
}

#[test]
fn what_is_no_rope_is_said() {
    let scattered = vec![DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 7.0];
    let points = PointFrames::new(100.0, vec![scattered; 50]);
    let error = follow(&points, &FollowOptions::default()).unwrap_err();
    assert!(matches!(
        error,
        RopeError::NotFound {
            wanted: 5,
            frames: 50
        }
    ));
    let crowd = PointFrames::new(100.0, vec![vec![DVec3::ZERO; 5000]]);
    let error = follow(&crowd, &FollowOptions::default()).unwrap_err();
    assert!(matches!(
        error,
        RopeError::TooManyPoints { points: 5000, .. }
    ));
    let empty = PointFrames::new(100.0, Vec::new());
    assert!(follow(&empty, &FollowOptions::default()).is_err());
}

#[test]
fn two_ropes_share_no_point() {
    let take = scene(Motion::Ribbon, 0.6, 2.0).film().unwrap();
    let both = |frame: &Vec<DVec3>| -> Vec<DVec3> {
        let other = frame.iter().map(|p| DVec3::new(-p.x + 1.5, p.y, p.z));
        frame.iter().copied().chain(other).collect()
    };
    let points = PointFrames::new(100.0, take.rope.iter().map(both).collect());
    let rope = FollowOptions {
        markers: Some(16),
        ..FollowOptions::default()
    };
    let traces = follow_all(&points, &[rope.clone(), rope]).unwrap();
    let last = take.rope.len() - 1;
    let points_of = |trace: &Trace| -> Vec<usize> {
        trace.frames[last]
            .iter()
            .filter_map(RopeSample::point)
            .collect()
    };
    let (a, b) = (points_of(&traces[0]), points_of(&traces[1]));
    assert_eq!((a.len(), b.len()), (16, 16));
    assert!(a.iter().all(|point| !b.contains(point)));
}
