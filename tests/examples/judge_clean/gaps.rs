//! Real recordings: measured stretches of every marker are hidden in turn and filled again.

use sinew_tests::hidden::{Errors, METHODS, judge, mean, quantile, stretches, take};

use crate::Options;

/// The recordings that the bars are stated for.
pub(crate) const FILES: [&str; 4] = [
    "c3d/freeform_53mk_gappy.c3d",
    "c3d/cmu_02_05.c3d",
    "c3d/vicon_walking2.c3d",
    "face/cheeks_41mk_60hz.csv",
];

/// Recordings on which nothing was chosen.
pub(crate) const OTHERS: [&str; 6] = [
    "c3d_testsuite/optitrack_mocap36_missing_desc_byte.c3d",
    "c3d/optitrack_wheelchair_sprint_gappy.c3d",
    "c3d/motionanalysis_gait_dec_int.c3d",
    "trc/marker_flip_dropjump.trc",
    "trc/cortex_walk.trc",
    "c3d_testsuite/sample01/Eb015pr.c3d",
];

const LENGTHS: [usize; 4] = [10, 30, 100, 300];
const PLACEMENTS: usize = 5;

pub(crate) fn run(options: &Options) {
    println!("mean / median / 95 % in mm (mean over spacing); ! where the default loses");
    for seed in options.seeds_or(&[1]) {
        for file in FILES
            .iter()
            .chain(&OTHERS)
            .filter(|file| options.wants(file))
        {
            let Some(take) = take(file) else { continue };
            println!("{file}, seed {seed}");
            for length in LENGTHS {
                let hidden = stretches(&take, length, PLACEMENTS, seed + length as u64);
                if !hidden.is_empty() {
                    row(length, hidden.len(), &judge(&take, &hidden, length));
                }
            }
        }
    }
}

fn row(length: usize, count: usize, errors: &[Errors]) {
    let figures = |errors: &Errors| {
        [errors.mean(), errors.quantile(0.5), errors.quantile(0.95)].map(|metres| 1e3 * metres)
    };
    let default = figures(&errors[0]);
    // Below 30 frames, where splines are good, it may be a tenth worse.
    let allowed = if length < 30 { 1.1 } else { 1.0 };
    print!("  {length:4} frames x {count:3}");
    for (method, errors) in METHODS.iter().zip(errors) {
        let these = figures(errors);
        let lost = default.iter().zip(&these).any(|(a, b)| *a > allowed * b);
        print!(
            " | {method:?} {:.2} / {:.2} / {:.2} ({:.3}){}",
            these[0],
            these[1],
            these[2],
            mean(&errors.relative),
            if lost { " !" } else { "" }
        );
    }
    let calibration = &errors[0].calibration;
    println!(
        " | z2 mean {:.2} median {:.2}",
        mean(calibration),
        quantile(calibration, 0.5)
    );
}
