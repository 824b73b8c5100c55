//! How far the core's own functions are from exact ones, as stated in core/DESIGN.md.

use sinew_core::math::{inverse_sqrt, rough_inverse_sqrt, slerp};

/// Largest errors that are stated, of `inverse_sqrt`, `rough_inverse_sqrt` and `slerp`.
const STATED: [f64; 3] = if cfg!(feature = "micromath") {
    [8e-7, 9e-4, 3e-4]
} else {
    [2e-7, 8e-7, 4e-7]
};

/// `cargo test -p sinew-core --features micromath --test arithmetic -- --nocapture` prints the others.
fn say(name: &str, worst: f64, stated: f64) {
    println!("{name}: {worst:.1e} off at most, {stated:.1e} stated");
    assert!(worst < stated, "{name}: {worst}");
}

#[test]
fn inverse_square_roots_are_as_exact_as_stated() {
    let (mut worst, mut roughest) = (0.0_f64, 0.0_f64);
    let mut x = 1e-12_f32;
    while x < 1e12 {
        let exact = 1.0 / libm::sqrt(f64::from(x));
        let error = |found: f32| ((f64::from(found) - exact) / exact).abs();
        worst = worst.max(error(inverse_sqrt(x)));
        roughest = roughest.max(error(rough_inverse_sqrt(x)));
        x *= 1.0037;
    }
    say("inverse_sqrt", worst, STATED[0]);
    say("rough_inverse_sqrt", roughest, STATED[1]);
}

#[test]
fn slerp_agrees_with_sines_for_all_angles() {
    let mut worst = 0.0_f64;
    for degrees in 0..=360 {
        let half = f64::from(degrees).to_radians() / 2.0;
        let from = [0.0, 0.0, 0.0, 1.0];
        let to = [libm::sin(half) as f32, 0.0, 0.0, libm::cos(half) as f32];
        // Beyond 180 degrees the shorter way is backwards.
        let short = if degrees > 180 {
            half - core::f64::consts::PI
        } else {
            half
        };
        for step in 0..=16 {
            let t = f64::from(step) / 16.0;
            let got = slerp(from, to, t as f32);
            let want = [libm::sin(short * t), 0.0, 0.0, libm::cos(short * t)];
            // At exactly 180 degrees both ways are equally short.
            let sign = if degrees == 180 && f64::from(got[0]) * want[0] < 0.0 {
                -1.0
            } else {
                1.0
            };
            worst = worst.max((f64::from(got[0]) - sign * want[0]).abs());
            worst = worst.max((f64::from(got[3]) - want[3]).abs());
        }
    }
    say("slerp", worst, STATED[2]);
}
