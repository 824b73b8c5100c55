use super::*;
use crate::math::affine;

const TABLES: CorrectiveTables<'_> = CorrectiveTables {
    parents: &[NO_PARENT, 0],
    binds: &[1, 0],
    pivots: &[[0.0; 3], [0.0, 0.3, 0.0]],
    springs: &[[[20.0, 0.3], [40.0, 0.3]]; 2],
    starts: &[0, 2],
    features: &[PART_FEATURES as u16, 2 * PART_FEATURES as u16],
    coefficients: &[1.0, 0.2],
    ranges: &[[-0.5, 0.6]],
};
const STATE: usize = corrective_state_len(2);
const FEATURES: usize = corrective_feature_count(2);
/// First spring of the first part.
const SPRING: usize = BEND_FEATURES + 3;

fn bent(angle: f32, scale: f32) -> Affine12 {
    let half = 0.5 * angle;
    let turn = [libm::sinf(half), 0.0, 0.0, libm::cosf(half)];
    affine(turn, [0.0; 3], [scale; 3])
}

struct Driven {
    state: CorrectiveState<[f32; STATE]>,
    features: [f32; FEATURES],
}

impl Driven {
    fn new() -> Self {
        Self {
            state: CorrectiveState::with([7.0; STATE]),
            features: [0.0; FEATURES],
        }
    }

    /// Frames of the second bind and the first: the parts stand the other way round.
    fn step(&mut self, child: Affine12, root: Affine12, seconds: f32) -> f32 {
        let corrective = Corrective::new_checked(TABLES, 2).unwrap();
        let palette = [child, root];
        corrective
            .features(&palette, seconds, &mut self.state, &mut self.features)
            .unwrap();
        let mut weights = [9.0];
        corrective.weights(&self.features, &mut weights);
        weights[0]
    }
}

#[test]
fn a_bend_is_the_sine_of_its_half_whatever_the_scale_and_moves_its_mode() {
    for scale in [1.0, 2.5] {
        let mut driven = Driven::new();
        let weight = driven.step(bent(0.6, scale), bent(0.0, scale), 0.01);
        let sine = libm::sinf(0.3);
        assert!((driven.features[PART_FEATURES] - sine).abs() < 1e-6);
        assert!((driven.features[PART_FEATURES + 3] - sine * sine).abs() < 1e-6);
        assert!((weight - (sine + 0.2)).abs() < 1e-6);
    }
    let far = Driven::new().step(bent(2.0, 1.0), IDENTITY, 0.01);
    assert_eq!(far, 0.6, "within its range");
}

#[test]
fn steady_acceleration_stretches_springs_by_their_law_at_any_rate() {
    for rate in [24.0_f32, 60.0, 240.0] {
        let mut driven = Driven::new();
        for frame in 0..(6.0 * rate) as u32 {
            let time = frame as f32 / rate;
            let mut moving = IDENTITY;
            moving[3] = 0.5 * 0.8 * time * time;
            driven.step(moving, moving, 1.0 / rate);
        }
        // 0.8 m/s2 over 20^2 is 2 mm, backwards.
        let stretch = driven.features[SPRING];
        assert!((stretch + 0.002).abs() < 1e-4, "{rate}: {stretch}");
    }
}

#[test]
fn it_begins_at_rest_and_a_moment_shown_again_is_the_same() {
    let mut driven = Driven::new();
    let over = bent(core::f32::consts::PI, 1.0);
    driven.step(over, over, 0.01);
    let hanging = driven.features[SPRING + 1];
    // Turned over it hangs by twice its weight: 2 x 9.81 / 20^2.
    assert!((hanging - 2.0 * 9.81 / 400.0).abs() < 1e-4, "{hanging}");
    let before = driven.features;
    for seconds in [0.0, f32::NAN, -1.0] {
        driven.step(over, over, seconds);
        assert_eq!(driven.features, before);
    }
    driven.step(IDENTITY, IDENTITY, 9.0);
    assert!(driven.features[SPRING + 1].abs() < 1e-6, "a cut");
}

#[test]
fn a_teleport_does_not_kick() {
    let mut driven = Driven::new();
    let at = |x: f32| {
        let mut frame = IDENTITY;
        frame[3] = x;
        frame
    };
    for frame in 0..60 {
        let x = 0.01 * frame as f32 + if frame > 30 { 5.0 } else { 0.0 };
        driven.step(at(x), at(x), 0.01);
        assert!(driven.features[SPRING].abs() < 4e-3, "{frame}");
    }
}

#[test]
fn hostile_motion_keeps_weights_bounded_and_is_forgotten() {
    let mut driven = Driven::new();
    for frame in 0..2000_u32 {
        let mut far = bent(frame as f32 * 2.5, 1.0);
        far[3] = if frame % 2 == 0 { 1e6 } else { -1e6 };
        let seconds = [0.01, f32::NAN, 0.0, 1e9][frame as usize % 4];
        if frame % 5 == 0 {
            far[7] = f32::NAN;
        }
        let weight = driven.step(bent(3.1, 1.0), far, seconds);
        assert!((-0.5..=0.6).contains(&weight), "{weight}");
        assert!(driven.features.iter().all(|x| x.abs() <= 1.1));
    }
    for _ in 0..400 {
        driven.step(IDENTITY, IDENTITY, 0.01);
    }
    let springs = &driven.features[SPRING..PART_FEATURES];
    assert!(springs.iter().all(|x| x.abs() < 1e-4), "{springs:?}");
}

#[test]
fn tables_that_contradict_are_refused() {
    let refused = |tables| Corrective::new_checked(tables, 2).is_err();
    assert!(!refused(TABLES));
    assert!(Corrective::new_checked(TABLES, 1).is_err());
    assert!(refused(CorrectiveTables {
        parents: &[1, NO_PARENT],
        ..TABLES
    }));
    assert!(refused(CorrectiveTables {
        features: &[0, FEATURES as u16],
        ..TABLES
    }));
    assert!(refused(CorrectiveTables {
        ranges: &[[0.5, -0.5]],
        ..TABLES
    }));
    assert!(refused(CorrectiveTables {
        coefficients: &[1.0, f32::NAN],
        ..TABLES
    }));
    assert!(refused(CorrectiveTables {
        springs: &[[[0.0, 0.3]; 2]; 2],
        ..TABLES
    }));
}
