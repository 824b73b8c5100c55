//! Live marker labelling and filling: the first clip of an asset moves one joint a marker, which
//! stand for what a capture system sees, without names, out of order, with gaps and a ghost.

use core::hint::black_box;

use sinew_core::asset::Asset;
use sinew_core::deform::Level;
use sinew_core::frame::Fingerprint;
use sinew_core::pose;
use sinew_core::track::markers::{
    Config, FixedWorkspace, Model, Source, State, Trace, Tracker, state_len, work_bound,
};

use crate::{Fault, Memory, Probe};

/// Most markers, and points of a frame.
const MARKERS: usize = 64;
const POINTS: usize = 80;

/// Tracks the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound or holds no marker set.
pub fn run<P: Probe>(
    bytes: &[u8],
    _: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = probe.count("load", || Asset::new_checked(bytes))?;
    let model = Model::of(&asset).ok_or(Fault::Nothing)?;
    let clip = asset.clip(0).ok_or(Fault::Nothing)?;
    let markers = model.dims().marker_count;
    let mut memory = Memory::new(memory);
    let (local, _) = memory.take(10 * asset.dims().joint_count)?.as_chunks_mut();
    let (points, _) = memory.take(3 * POINTS)?.as_chunks_mut::<3>();
    let mut state = State::<[Trace; 2 * MARKERS]>::new();
    let mut workspace = FixedWorkspace::<MARKERS, POINTS>::new();
    let config = Config::new(asset.live_rate(), model.dims());
    let mut hash = Fingerprint::new();
    let (mut measured, mut filled, mut wrong, mut most) = (0, 0, 0, 0);
    for (frame, seconds) in clip.sample_times().enumerate() {
        pose::rest(&asset, local);
        pose::sample(&clip, seconds, local);
        let mut owners = [u16::MAX; POINTS];
        let mut count = 0;
        for turn in 0..markers {
            // Any order; each marker is hidden for a fifth of a second in every four.
            let marker = (turn * 23 + 7 * frame) % markers;
            if is_hidden(marker, frame) {
                continue;
            }
            let place = local
                .get(marker)
                .map(|local: &[f32; 10]| [local[4], local[5], local[6]]);
            if let (Some(place), Some(point), Some(owner)) =
                (place, points.get_mut(count), owners.get_mut(count))
            {
                (*point, *owner) = (place, marker as u16);
                count += 1;
            }
        }
        // A ghost a hand's breadth from a marker.
        let near = points.first().copied();
        if let (Some(near), Some(point)) = (near, points.get_mut(count)) {
            *point = [near[0] + 0.09, near[1], near[2] - 0.05];
            count += 1;
        }
        // A tenth of a second in which nothing is seen.
        let blind = frame % 200 >= 190;
        let seen = points
            .get(..if blind { 0 } else { count })
            .unwrap_or_default();
        let mut tracker =
            Tracker::new(&model, config, &mut state, &mut workspace).map_err(|error| {
                Fault::Memory {
                    needed: error.needed,
                    left: error.found,
                }
            })?;
        let report = probe.count("frame", || tracker.step(black_box(seen)));
        most = most.max(report.work);
        for (marker, sample) in tracker.samples().enumerate() {
            hash.update(&sample.position);
            match sample.source {
                Source::Measured(point) => {
                    measured += 1;
                    let owner = owners.get(usize::from(point)).copied();
                    wrong += u64::from(owner != Some(marker as u16));
                }
                Source::Filled => filled += 1,
                Source::Lost => {}
            }
        }
    }
    for (name, value) in [
        ("markers", markers as u64),
        ("samples_measured", measured),
        ("samples_wrong", wrong),
        ("samples_filled", filled),
        ("work_most", u64::from(most)),
        (
            "work_bound",
            u64::from(work_bound(model.dims(), POINTS, config.search)),
        ),
        ("bytes_asset", bytes.len() as u64),
        (
            "bytes_state",
            (state_len(model.dims()) * size_of::<Trace>()) as u64,
        ),
        ("bytes_of_Trace", size_of::<Trace>() as u64),
    ] {
        probe.number(name, value);
    }
    Ok(hash.value())
}

fn is_hidden(marker: usize, frame: usize) -> bool {
    (frame + 37 * marker) % 480 < 24
}
