//! The whole tracker on ropes whose motion a formula gives.

use super::*;

const COUNT: usize = 10;

/// A rope that swings as a pendulum of growing phase: `[markers]` at a time in seconds.
fn swing(t: f32) -> [[f32; 3]; COUNT] {
    let (mut x, mut y) = (0.0, 2.0);
    core::array::from_fn(|i| {
        let angle = 0.6 * libm::sinf(5.0 * t - 0.15 * i as f32);
        if i > 0 {
            x += 0.1 * libm::sinf(angle);
            y -= 0.1 * libm::cosf(angle);
        }
        [x, y, 0.1 * libm::sinf(2.0 * t)]
    })
}

/// Points of a body that stand in no line.
fn bystanders(t: f32) -> [[f32; 3]; 5] {
    core::array::from_fn(|i| {
        let k = i as f32;
        let (a, b) = (libm::sinf(17.0 * k), libm::cosf(11.0 * k * k));
        [
            1.0 + 0.4 * a + 0.1 * libm::sinf(t),
            1.0 + 0.5 * b,
            0.3 * a * b,
        ]
    })
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (Vec3::from_array(a) - Vec3::from_array(b)).length()
}

type Small = RopeTracker<12, 24>;

/// Follows the swinging rope; `shows` says which markers are seen in a frame.
fn run(method: Method, frames: usize, shows: impl Fn(usize, usize) -> bool) -> (Small, f32) {
    let config = Config {
        method,
        ..Config::new(100.0)
    };
    let mut tracker = Small::starting_at(config, &swing(0.0)).unwrap();
    let mut worst = 0.0_f32;
    for frame in 1..frames {
        let t = 0.01 * frame as f32;
        let (rope, body) = (swing(t), bystanders(t));
        let mut points = heapless::Vec::<[f32; 3], 24>::new();
        // In an order that changes.
        for k in 0..COUNT {
            let i = (k * 7 + frame) % COUNT;
            if shows(frame, i) {
                points.push(rope[i]).unwrap();
            }
        }
        points.extend_from_slice(&body).unwrap();
        let report = tracker.step(&points);
        assert!(report.work <= work_bound(12, 24));
        for (i, sample) in tracker.samples().enumerate() {
            worst = worst.max(distance(sample.position, rope[i]));
            if let Source::Measured(point) = sample.source {
                assert_eq!(
                    points[usize::from(point)],
                    rope[i],
                    "frame {frame}, marker {i}"
                );
            }
        }
    }
    (tracker, worst)
}

#[test]
fn a_swinging_rope_is_followed_by_both_methods() {
    for method in [Method::Joint, Method::Published] {
        let (tracker, worst) = run(method, 200, |_, _| true);
        assert_eq!(worst, 0.0);
        assert!(
            tracker
                .segment_lengths()
                .all(|length| (length - 0.1).abs() < 1e-3)
        );
    }
}

#[test]
fn an_interior_gap_is_filled_and_closed() {
    let hidden = |frame, marker| (100..130).contains(&frame) && marker == 5;
    let (tracker, worst) = run(Method::Joint, 140, |f, i| !hidden(f, i));
    assert!(worst < 0.004, "{worst}");
    assert!(tracker.samples().all(|s| s.gap == 0 && s.confidence > 0.5));
    let (_, published) = run(Method::Published, 140, |f, i| !hidden(f, i));
    assert!(worst < published, "{worst} {published}");
}

#[test]
fn three_neighbours_and_an_end_come_back() {
    let inside = |frame, marker: usize| !((100..120).contains(&frame) && (3..6).contains(&marker));
    assert!(run(Method::Joint, 140, inside).1 < 0.03);
    let end = |frame, marker: usize| !((100..110).contains(&frame) && marker >= 8);
    assert!(run(Method::Joint, 140, end).1 < 0.05);
}

#[test]
fn a_rope_that_vanishes_is_lost_and_found_again() {
    let config = Config::new(100.0);
    let mut tracker = Small::starting_at(config, &swing(0.0)).unwrap();
    for frame in 0..100 {
        tracker.step(&swing(0.01 * frame as f32));
    }
    for _ in 0..60 {
        let report = tracker.step(&[]);
        assert_eq!(report.measured, 0);
    }
    assert!(
        tracker.samples().all(|s| s.source == Source::Lost),
        "and says so"
    );
    let moved = |t: f32| swing(t).map(|[x, y, z]| [x + 0.4, y - 0.2, z]);
    for frame in 160..400 {
        tracker.step(&moved(0.01 * frame as f32));
    }
    let last = moved(3.99);
    assert!(
        tracker
            .samples()
            .enumerate()
            .all(|(i, s)| s.position == last[i])
    );
}

#[test]
fn points_that_are_no_numbers_change_nothing() {
    let config = Config::new(100.0);
    let mut clean = Small::starting_at(config, &swing(0.0)).unwrap();
    let mut dirty = clean.clone();
    for frame in 1..50 {
        let rope = swing(0.01 * frame as f32);
        clean.step(&rope);
        let mut points = heapless::Vec::<[f32; 3], 24>::new();
        points.extend_from_slice(&rope).unwrap();
        points.push([f32::NAN, 0.0, 0.0]).unwrap();
        points.push([f32::INFINITY; 3]).unwrap();
        assert_eq!(dirty.step(&points).unusable, 2);
        assert!(clean.samples().eq(dirty.samples()));
    }
}

#[test]
fn the_start_finds_the_rope_at_rest_and_in_motion() {
    for still in [true, false] {
        let mut tracker = Small::new(Config::new(100.0)).unwrap();
        let mut phase = Phase::Starting;
        for frame in 0..40 {
            let t = 0.01 * frame as f32;
            let rope = swing(if still { 0.0 } else { t });
            let mut points = heapless::Vec::<[f32; 3], 24>::new();
            points.extend_from_slice(&bystanders(t)).unwrap();
            points.extend_from_slice(&rope).unwrap();
            phase = tracker.step(&points).phase;
        }
        assert_eq!(phase, Phase::Tracking, "still: {still}");
        let last = swing(if still { 0.0 } else { 0.39 });
        let count = tracker.trace_count();
        assert_eq!(count, COUNT);
        let forwards = tracker
            .samples()
            .enumerate()
            .all(|(i, s)| s.position == last[i]);
        let backwards = tracker
            .samples()
            .enumerate()
            .all(|(i, s)| s.position == last[9 - i]);
        assert!(forwards || backwards, "still: {still}");
    }
}

#[test]
fn nothing_there_is_not_found() {
    let mut tracker = Small::new(Config::new(100.0)).unwrap();
    let phases = (0..20).map(|_| tracker.step(&[]).phase);
    assert_eq!(phases.last(), Some(Phase::NotFound));
    assert_eq!(tracker.trace_count(), 0);
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |config| Small::new(config).err();
    let usual = Config::new(100.0);
    assert_eq!(refused(Config::new(0.0)), Some(ConfigError::Rate(0.0)));
    let gamma = refused(Config {
        gamma: f32::NAN,
        ..usual
    });
    assert!(matches!(gamma, Some(ConfigError::Gamma(_))));
    let markers = Some(ConfigError::Markers {
        given: 13,
        capacity: 12,
    });
    assert_eq!(
        refused(Config {
            markers: Some(13),
            ..usual
        }),
        markers
    );
    let few = Small::starting_at(usual, &[[0.0; 3]; 2]).err();
    assert_eq!(
        few,
        Some(ConfigError::Markers {
            given: 2,
            capacity: 12
        })
    );
    let same = Small::starting_at(usual, &[[0.0; 3]; 3]).err();
    assert_eq!(same, Some(ConfigError::Coincident { index: 0 }));
    let nan = Small::starting_at(usual, &[[0.0; 3], [f32::NAN; 3], [1.0; 3]]).err();
    assert_eq!(nan, Some(ConfigError::NotANumber { index: 1 }));
}
