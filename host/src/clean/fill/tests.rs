use super::*;

/// A box that turns and flies, its corners as markers, and a gap in the first corner.
fn flying_box(gap: Range<usize>) -> (Take, Take) {
    const FRAMES: usize = 200;
    let corner = |at: usize| {
        let bit = |shift: usize| f64::from(u8::from(at >> shift & 1 == 1));
        0.1 * DVec3::new(bit(0), 1.5 * bit(1), 2.0 * bit(2))
    };
    let positions = (0..8).flat_map(|at| {
        (0..FRAMES).map(move |frame| {
            let time = frame as f64 / 100.0;
            let turn =
                glam::DMat3::from_rotation_y(3.0 * time) * glam::DMat3::from_rotation_x(time);
            turn * corner(at) + DVec3::new(time, (4.0 * time).sin(), 0.0)
        })
    });
    let labels = (0..8).map(|at| format!("C{at}")).collect();
    let truth = Take::new(labels, 100.0, FRAMES, positions.collect()).unwrap();
    let mut broken = truth.clone();
    for frame in gap {
        broken.set_position(0, frame, None);
    }
    (truth, broken)
}

fn worst(truth: &Take, filled: &Filled) -> f64 {
    let errors = (0..truth.frame_count()).filter_map(|frame| {
        let found = filled.take.position(0, frame)?;
        Some(found.distance(truth.position(0, frame)?))
    });
    errors.fold(0.0, f64::max)
}

fn fill_with(broken: &Take, method: FillMethod) -> Filled {
    let options = FillOptions {
        method,
        ..FillOptions::default()
    };
    fill(broken, &options, &|| {})
}

#[test]
fn a_rigid_corner_comes_back_exactly() {
    for gap in [1..2, 40..140, 0..90, 120..200] {
        let (truth, broken) = flying_box(gap.clone());
        let filled = fill_with(&broken, FillMethod::Regression);
        assert!(
            worst(&truth, &filled) < 1e-4,
            "{gap:?}: {}",
            worst(&truth, &filled)
        );
        assert_eq!(filled.filled_count(), gap.len());
        assert_eq!(filled.take.missing_fraction(), 0.0);
        for frame in 0..200 {
            let sigma = filled.sigma(0, frame);
            assert_eq!(sigma > 0.0, gap.contains(&frame));
            assert!(sigma < 1e-3);
        }
    }
    let (truth, broken) = flying_box(40..140);
    assert!(worst(&truth, &fill_with(&broken, FillMethod::Pca)) < 1e-3);
    assert!(worst(&truth, &fill_with(&broken, FillMethod::Linear)) > 0.1);
}

#[test]
fn what_cannot_be_known_stays_missing() {
    let (_, mut broken) = flying_box(0..200);
    let filled = fill_with(&broken, FillMethod::Regression);
    assert_eq!(filled.filled_count(), 0, "never seen");
    for marker in 0..8 {
        for frame in 100..200 {
            broken.set_position(marker, frame, None);
        }
    }
    let filled = fill_with(&broken, FillMethod::Regression);
    assert!(
        filled.take.position(3, 199).is_none(),
        "a second without any marker"
    );
    assert!(
        filled.take.position(3, 101).is_some(),
        "inertia holds for a moment"
    );
    let empty = Take::new(Vec::new(), 100.0, 0, Vec::new()).unwrap();
    for method in [FillMethod::Regression, FillMethod::Pca, FillMethod::Spline] {
        assert_eq!(fill_with(&empty, method).filled_count(), 0);
    }
}

#[test]
fn no_frame_is_complete() {
    let (truth, mut broken) = flying_box(80..120);
    for marker in 1..8 {
        for frame in (0..200).filter(|frame| frame / 5 % 7 == marker - 1) {
            broken.set_position(marker, frame, None);
        }
    }
    assert_eq!(broken.complete_frame_count(), 0);
    let filled = fill_with(&broken, FillMethod::Regression);
    assert_eq!(filled.take.missing_fraction(), 0.0);
    assert!(worst(&truth, &filled) < 2e-3, "{}", worst(&truth, &filled));
}
