//! The rope tracker: 20 markers among 200 points, with markers that vanish for a while.
//!
//! The scene is computed here by additions and multiplications alone, so that it too has the same
//! bits everywhere; the asset is not read.

use core::hint::black_box;

use sinew_core::deform::Level;
use sinew_core::frame::Fingerprint;
use sinew_core::track::rope::{
    Config, FrameReport, RopeTracker, Sample, Source, start_work_bound, work_bound,
};

use crate::{Fault, Probe};

const TRACES: usize = 20;
const POINTS: usize = 200;
const FRAMES: usize = 150;
/// Frames of the start.
const START: usize = 20;

/// A rotation in the plane: cosine and sine.
type Turn = [f32; 2];
/// Of the phase in a frame.
pub(crate) const STEP: Turn = [0.998_750_26, 0.049_979_17];

pub(crate) fn turn([c, s]: Turn, [d, t]: Turn) -> Turn {
    [c * d - s * t, s * d + c * t]
}

/// A pendulum whose lower markers lag behind, metres.
pub(crate) fn pendulum<const COUNT: usize>(phase: Turn) -> [[f32; 3]; COUNT] {
    const LAG: Turn = [0.988_771, -0.149_438];
    let (mut own, mut x, mut y) = (phase, 0.0, 2.4);
    core::array::from_fn(|i| {
        if i > 0 {
            let a = 0.6 * own[1];
            // The sine of at most 0.6 rad, to 1e-6.
            let sine = a * (1.0 - a * a * (1.0 / 6.0) * (1.0 - a * a * (1.0 / 20.0)));
            let cosine = 1.0 - a * a * 0.5 * (1.0 - a * a * (1.0 / 12.0));
            x += 0.1 * sine;
            y -= 0.1 * cosine;
        }
        own = turn(own, LAG);
        [x, y, 0.05 * phase[0]]
    })
}

/// Everybody else: scattered over a room, swaying.
fn bystander(k: usize, phase: Turn) -> [f32; 3] {
    let mut state = (k as u32).wrapping_mul(2_654_435_761).wrapping_add(12_345);
    let mut draw = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 * (1.0 / 16_777_216.0)
    };
    let (x, y, z) = (draw(), draw(), draw());
    [
        0.3 + 1.5 * x + 0.05 * phase[0],
        2.0 * y,
        1.0 * z + 0.05 * phase[1],
    ]
}

fn is_hidden(frame: usize, marker: usize) -> bool {
    (50..80).contains(&frame) && marker == 6
        || (90..110).contains(&frame) && (9..12).contains(&marker)
}

/// Follows the rope.
///
/// # Errors
/// [`Fault::Nothing`] where the rope is not found or not followed to the end.
pub fn run<P: Probe>(
    _asset: &[u8],
    _level: Level,
    _memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let tracker = RopeTracker::<TRACES, POINTS>::new(Config::new(100.0));
    let mut tracker = tracker.map_err(|_| Fault::Nothing)?;
    let mut hash = Fingerprint::new();
    let mut phase = [1.0, 0.0];
    let mut work = 0;
    for frame in 0..FRAMES {
        if frame >= START {
            phase = turn(phase, STEP);
        }
        let markers = pendulum::<TRACES>(phase);
        let mut points = [[0.0; 3]; POINTS];
        for (k, point) in points.iter_mut().enumerate() {
            // Every tenth is the rope's, in an order that changes; a hidden one is no number.
            let marker = (k / 10 + 7 * frame) % TRACES;
            *point = match markers.get(marker) {
                Some(own) if k % 10 == 3 => {
                    if is_hidden(frame, marker) {
                        [f32::NAN; 3]
                    } else {
                        *own
                    }
                }
                _ => bystander(k, phase),
            };
        }
        let points = black_box(&points);
        let name = if frame < START { "start" } else { "frame" };
        let report = probe.count(name, || tracker.step(points));
        if frame >= START {
            work = work.max(report.work);
        }
        for sample in tracker.samples() {
            hash.update(&sample.position);
            hash.update(&[sample.confidence, f32::from(sample.gap)]);
        }
    }
    let right = pendulum::<TRACES>(phase)
        .iter()
        .zip(tracker.samples())
        .all(|(truth, sample)| {
            sample.position == *truth && matches!(sample.source, Source::Measured(_))
        });
    let reversed = pendulum::<TRACES>(phase)
        .iter()
        .rev()
        .zip(tracker.samples())
        .all(|(truth, sample)| {
            sample.position == *truth && matches!(sample.source, Source::Measured(_))
        });
    if tracker.trace_count() != TRACES || !(right || reversed) {
        return Err(Fault::Nothing);
    }
    for (name, value) in [
        ("traces", TRACES as u64),
        ("points", POINTS as u64),
        ("work_frame", u64::from(work)),
        ("bound_work_frame", u64::from(work_bound(TRACES, POINTS))),
        (
            "bound_work_start",
            u64::from(start_work_bound(TRACES, POINTS)),
        ),
        (
            "bytes_of_RopeTracker",
            size_of::<RopeTracker<TRACES, POINTS>>() as u64,
        ),
        ("bytes_of_Sample", size_of::<Sample>() as u64),
        ("bytes_of_RopeReport", size_of::<FrameReport>() as u64),
    ] {
        probe.number(name, value);
    }
    Ok(hash.value())
}
