//! Cleaning, judged on real recordings: stretches that were measured are hidden and filled again.
//!
//! `tests/examples/judge_clean` prints whole tables; here are a few stretches of each.

use sinew_tests::hidden::{METHODS, judge, stretches, take};

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
