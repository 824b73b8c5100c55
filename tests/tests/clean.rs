//! Cleaning, judged on real recordings: stretches that were measured are hidden and filled again.

use std::fmt::Write as _;

use glam::DVec3;
use sinew_host::clean::fill::{FillMethod, FillOptions, fill_markers};
use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::take::Take;
use sinew_tests::{Random, shared};

const METHODS: [FillMethod; 4] = [
    FillMethod::Regression,
    FillMethod::Pca,
    FillMethod::Spline,
    FillMethod::Linear,
];

fn take(file: &str) -> Option<Take> {
    let raw = read_take(shared(file)?, &TakeOptions::default()).unwrap();
    Some(Take::from_raw(&raw).unwrap().0)
}

/// Hidden stretches of one length: up to `placements` random ones of each marker, all measured.
fn stretches(take: &Take, length: usize, placements: usize, seed: u64) -> Vec<(usize, usize)> {
    let mut random = Random(seed);
    let mut chosen = Vec::new();
    for marker in 0..take.marker_count() {
        let starts: Vec<usize> = take
            .traces(marker)
            .flat_map(|trace| {
                // A sample stays measured on either side.
                (trace.start + 1)..(trace.end.saturating_sub(length + 1)).max(trace.start + 1)
            })
            .collect();
        if starts.is_empty() {
            continue;
        }
        for _ in 0..placements {
            chosen.push((marker, starts[random.below(starts.len())]));
        }
    }
    chosen
}

/// Errors of one method on one length.
#[derive(Clone, Debug, Default)]
struct Errors {
    /// Metres, every hidden sample.
    metres: Vec<f64>,
    /// The same over the distance to the nearest neighbour.
    relative: Vec<f64>,
    /// Error over stated deviation, squared, an axis.
    calibration: Vec<f64>,
}

impl Errors {
    fn mean(&self) -> f64 {
        self.metres.iter().sum::<f64>() / self.metres.len() as f64
    }

    fn quantile(values: &[f64], share: f64) -> f64 {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted[((sorted.len() - 1) as f64 * share) as usize]
    }
}

fn judge(take: &Take, hidden: &[(usize, usize)], length: usize) -> Vec<Errors> {
    let mut all = vec![Errors::default(); METHODS.len()];
    for &(marker, start) in hidden {
        let mut broken = take.clone();
        let truth: Vec<DVec3> = take.trajectory(marker)[start..start + length].to_vec();
        let spacing = take.mean_neighbour_distance(start).unwrap_or(f64::NAN);
        for frame in start..start + length {
            broken.set_position(marker, frame, None);
        }
        for (errors, method) in all.iter_mut().zip(METHODS) {
            let options = FillOptions {
                method,
                limit: f64::INFINITY,
            };
            let filled = fill_markers(&broken, &[marker], &options, &|| {});
            for (at, truth) in truth.iter().enumerate() {
                let position = filled.take.position(marker, start + at).unwrap();
                let error = position.distance(*truth);
                errors.metres.push(error);
                errors.relative.push(error / spacing);
                let sigma = f64::from(filled.sigma(marker, start + at));
                errors
                    .calibration
                    .push(error * error / (3.0 * sigma * sigma));
            }
        }
    }
    all
}

fn table(file: &str, lengths: &[usize], placements: usize, seed: u64) -> Option<Vec<Vec<Errors>>> {
    let take = take(file)?;
    let mut text = format!("{file}: mean / median / 95 % in mm (mean over spacing)\n");
    let mut rows = Vec::new();
    for &length in lengths {
        let hidden = stretches(&take, length, placements, seed + length as u64);
        if hidden.is_empty() {
            continue;
        }
        let errors = judge(&take, &hidden, length);
        let _ = write!(text, "  {length:4} frames");
        for (method, errors) in METHODS.iter().zip(&errors) {
            let mm = |share| 1e3 * Errors::quantile(&errors.metres, share);
            let relative = errors.relative.iter().sum::<f64>() / errors.relative.len() as f64;
            let _ = write!(
                text,
                " | {method:?} {:.2} / {:.2} / {:.2} ({relative:.3})",
                1e3 * errors.mean(),
                mm(0.5),
                mm(0.95)
            );
        }
        let calibration = &errors[0].calibration;
        let mean = calibration.iter().sum::<f64>() / calibration.len() as f64;
        let median = Errors::quantile(calibration, 0.5);
        let _ = writeln!(text, " | z2 {mean:.2} median {median:.2}");
        rows.push(errors);
    }
    eprintln!("{text}");
    Some(rows)
}

const FILES: [&str; 4] = [
    "c3d/freeform_53mk_gappy.c3d",
    "c3d/cmu_02_05.c3d",
    "c3d/vicon_walking2.c3d",
    "face/cheeks_41mk_60hz.csv",
];

/// Recordings on which nothing was chosen.
const OTHERS: [&str; 6] = [
    "c3d_testsuite/optitrack_mocap36_missing_desc_byte.c3d",
    "c3d/optitrack_wheelchair_sprint_gappy.c3d",
    "c3d/motionanalysis_gait_dec_int.c3d",
    "trc/marker_flip_dropjump.trc",
    "trc/cortex_walk.trc",
    "c3d_testsuite/sample01/Eb015pr.c3d",
];

#[test]
#[ignore = "minutes; prints tables: cargo test --release --test clean -- --ignored --nocapture"]
fn hidden_stretches_of_real_takes() {
    let placements = std::env::var("PLACEMENTS").map_or(5, |text| text.parse().unwrap());
    let only = std::env::var("ONLY").unwrap_or_default();
    for file in FILES.iter().chain(&OTHERS) {
        if !file.contains(&only) {
            continue;
        }
        table(file, &[10, 30, 100, 300], placements, 1);
    }
}

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
