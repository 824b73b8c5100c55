//! Table 2: visible markers of the abdomen, the elbows, the thighs and the knees are deleted and
//! rebuilt; the truth is known.

use glam::DVec3;
use sinew_host::clean::fill::{FillOptions, fill_markers};
use sinew_host::clean::smooth::{SmoothOptions, smooth_markers};
use sinew_host::studio::{MarkerLayout, MarkerSet};
use sinew_host::take::Take;
use sinew_tests::Random;
use sinew_tests::filming::human;
use sinew_tests::hidden::{Errors, METHODS, Stretch, judge_against, mean, quantile};

use crate::Options;
use crate::labels::{MOTIONS, capture};

/// A region: name, and the landmarks between which its middle lies.
const REGIONS: [(&str, &[&str]); 7] = [
    ("abdomen", &["LFWT", "RFWT", "STRN"]),
    ("elbow", &["LELB"]),
    ("elbow", &["RELB"]),
    ("thigh", &["LTHI"]),
    ("thigh", &["RTHI"]),
    ("knee", &["LKNE"]),
    ("knee", &["RKNE"]),
];
const NAMES: [&str; 4] = ["abdomen", "elbow", "thigh", "knee"];
/// Markers of a region, and stretches of each.
const EACH: usize = 6;
const PLACEMENTS: usize = 3;

pub(crate) fn run(options: &Options) {
    println!("error over the mean neighbour distance, mean / 95 % / max; bar 0.010 and 0.035");
    for seed in options.seeds_or(&[201]) {
        for (motion, (name, ..)) in MOTIONS.iter().enumerate().take(4) {
            if !options.wants(name) {
                continue;
            }
            let Some(capture) = capture(motion, seed) else {
                continue;
            };
            let take = capture.labelled_take().expect("a take");
            let truth = capture.truth_take().expect("a take");
            for region in NAMES {
                for length in [30, 100] {
                    let hidden = places(&take, &truth, region, length, seed);
                    if !hidden.is_empty() {
                        row(
                            &format!("{name} {seed} {region}"),
                            &take,
                            &truth,
                            &hidden,
                            length,
                        );
                    }
                }
            }
        }
    }
}

/// Stretches in which markers of a region are in sight throughout.
fn places(take: &Take, truth: &Take, region: &str, length: usize, seed: u64) -> Vec<Stretch> {
    let set = MarkerSet::new(human(), MarkerLayout::Standard53, 0).expect("landmarks");
    let rest = |marker: &sinew_host::studio::Marker| {
        let corners = marker.vertices.iter().zip(marker.barycentric);
        let place = |(&at, weight): (&u32, f64)| weight * human().mesh.positions[at as usize];
        corners.map(place).sum::<DVec3>()
    };
    // The take begins in the rest pose, moved and turned about the vertical: heights and mutual
    // distances are enough to find the nearest markers, but not sides; so the rest set is asked.
    let dense = MarkerSet::new(human(), MarkerLayout::Dense(truth.marker_count()), seed);
    let dense: Vec<DVec3> = dense.expect("fits").markers.iter().map(rest).collect();
    let mut random = Random(seed + length as u64);
    let mut chosen = Vec::new();
    for (_, landmarks) in REGIONS.iter().filter(|(name, _)| *name == region) {
        let places = landmarks.iter().map(|name| {
            let found = set.markers.iter().find(|marker| marker.name == *name);
            rest(found.unwrap_or_else(|| panic!("no landmark {name}")))
        });
        let middle = places.sum::<DVec3>() / landmarks.len() as f64;
        let mut near: Vec<usize> = (0..dense.len()).collect();
        near.sort_by(|a, b| {
            let distance = |at: usize| dense[at].distance(middle);
            distance(*a).total_cmp(&distance(*b))
        });
        for &marker in near.iter().take(EACH) {
            let starts: Vec<usize> = take
                .traces(marker)
                .flat_map(|trace| {
                    trace.start + 1..trace.end.saturating_sub(length + 1).max(trace.start + 1)
                })
                .collect();
            if !starts.is_empty() {
                let one = |_| (marker, starts[random.below(starts.len())]);
                chosen.extend((0..PLACEMENTS).map(one));
            }
        }
    }
    chosen
}

fn row(name: &str, take: &Take, truth: &Take, hidden: &[Stretch], length: usize) {
    let errors = judge_against(take, truth, hidden, length);
    let smoothed = smoothed(take, truth, hidden, length);
    let named = METHODS.iter().map(|method| format!("{method:?}"));
    let columns = named.zip(errors.iter().map(|one: &Errors| &one.relative));
    print!("{name:22} {length:4} frames x {:3}", hidden.len());
    for (method, relative) in columns.chain([("smoothed".into(), &smoothed)]) {
        print!(
            " | {method} {:.4} / {:.4} / {:.4}",
            mean(relative),
            quantile(relative, 0.95),
            quantile(relative, 1.0)
        );
    }
    println!(" | z2 {:.2}", mean(&errors[0].calibration));
}

/// The default after smoothing, as the command writes it.
fn smoothed(take: &Take, truth: &Take, hidden: &[Stretch], length: usize) -> Vec<f64> {
    let mut relative = Vec::new();
    let mut broken = take.clone();
    for &(marker, start) in hidden {
        let frames = start..start + length;
        let spacing = truth.mean_neighbour_distance(start).unwrap_or(f64::NAN);
        for frame in frames.clone() {
            broken.set_position(marker, frame, None);
        }
        let mut filled = fill_markers(&broken, &[marker], &FillOptions::default(), &|| {});
        smooth_markers(&mut filled, &[marker], &SmoothOptions::default(), &|| {});
        for frame in frames {
            let truth = truth.trajectory(marker)[frame];
            let found = filled.take.trajectory(marker)[frame];
            relative.push(found.distance(truth) / spacing);
            broken.set_position(marker, frame, take.position(marker, frame));
        }
    }
    relative
}
