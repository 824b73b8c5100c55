//! From unnamed dots to a surface, all in one frame: markers on a body are named and filled, what is
//! left over goes to a rope, and the named markers drive the skin.
//!
//! The markers are vertices of the body that the asset's first clip moves, out of order, a few of
//! them hidden for a while. The rope swings beside the body and goes where it goes.

use core::hint::black_box;

use sinew_core::asset::{Asset, MarkerMode};
use sinew_core::deform::parts::{RigState, rig_state_len, rig_workspace_len};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, state_len, workspace_len,
};
use sinew_core::track::markers::{
    Config, FixedWorkspace, Model, Source, State as Traces, Trace, Tracker,
};
use sinew_core::track::rope::{self, RopeTracker};

use crate::parts::find;
use crate::rope::{STEP, pendulum, turn};
use crate::{Fault, Memory, Probe};

/// Most markers of the body, of the rope, and points of a frame.
const MARKERS: usize = 48;
const TRACES: usize = 10;
const POINTS: usize = 64;

/// Follows body and rope through the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound, holds no marker set, no collapsed skin or no clip, where
/// the rope is lost, or the memory is too small.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = probe.count("load", || Asset::new_checked(bytes))?;
    let (dims, clip) = (asset.dims(), asset.clip(0).ok_or(Fault::Nothing)?);
    let model = Model::of(&asset).ok_or(Fault::Nothing)?;
    let skin = asset.marker_skin().ok_or(Fault::Nothing)?;
    let MarkerMode::Collapsed(surface) = skin.mode else {
        return Err(Fault::Nothing);
    };
    let (markers, parts) = (skin.rig.marker_count(), skin.rig.part_count());
    let mut memory = Memory::new(memory);
    // The body that carries the markers costs nothing that is counted.
    let mut state = State::with(memory.take(state_len(dims))?);
    let mut workspace = Workspace::with(memory.take(workspace_len(dims))?);
    let places = memory.take(3 * markers)?.as_chunks_mut::<3>().0;
    let left = memory.left();
    let named = memory.take(3 * markers)?.as_chunks_mut::<3>().0;
    let mut rig_state = RigState::with(memory.take(rig_state_len(markers, parts))?);
    let handles = memory.take(rig_workspace_len(markers, parts))?;
    let used = left - memory.left();
    let positions = memory.take(3 * dims.vertex_count)?;
    let normals = memory.take(3 * dims.vertex_count)?;

    let mut vertices = [0; MARKERS];
    let vertices = vertices.get_mut(..markers).ok_or(Fault::Nothing)?;
    find(&asset, &skin, vertices);
    let mut traces = Traces::<[Trace; 2 * MARKERS]>::new();
    let mut scratch = FixedWorkspace::<MARKERS, POINTS>::new();
    let config = Config::new(asset.live_rate(), model.dims());
    let mut cord: Option<RopeTracker<TRACES, POINTS>> = None;
    let mut hash = Fingerprint::new();
    let (mut measured, mut filled, mut wrong) = (0_u64, 0_u64, 0_u64);
    let mut phase = [1.0, 0.0];
    let frames = (clip.duration * asset.live_rate()) as usize;
    for frame in 0..frames {
        let input = Input::Clip {
            index: 0,
            seconds: frame as f32 / asset.live_rate(),
            looped: false,
        };
        let mut output = Output::separate(dims, positions, Some(normals))?;
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?.with_level(level);
        avatar.step(&input, Budget::blocks(0), &mut output);
        avatar.skin_vertices(vertices, places, None)?;
        phase = turn(phase, STEP);
        let strand = strand(phase, places.first().copied().unwrap_or_default());
        let (points, owners, count) = seen(frame, places, &strand);
        let seen = black_box(points.get(..count).unwrap_or_default());

        let mut tracker =
            Tracker::new(&model, config, &mut traces, &mut scratch).map_err(|error| {
                Fault::Memory {
                    needed: error.needed,
                    left: error.found,
                }
            })?;
        probe.count("markers", || tracker.step(seen));
        let mut rest = points;
        for (marker, (sample, named)) in tracker.samples().zip(named.iter_mut()).enumerate() {
            *named = match sample.source {
                Source::Lost => [f32::NAN; 3],
                _ => sample.position,
            };
            if let Source::Measured(point) = sample.source {
                let point = usize::from(point);
                measured += 1;
                wrong += u64::from(owners.get(point) != Some(&(marker as u16)));
                // The rope tracker passes over what is no number.
                if let Some(point) = rest.get_mut(point) {
                    *point = [f32::NAN; 3];
                }
            } else {
                filled += u64::from(sample.source == Source::Filled);
            }
        }
        let rest = black_box(rest.get(..count).unwrap_or_default());
        let cord = match &mut cord {
            Some(cord) => cord,
            None => {
                let config = rope::Config::new(asset.live_rate());
                let started = RopeTracker::starting_at(config, &strand);
                cord.insert(started.map_err(|_| Fault::Nothing)?)
            }
        };
        probe.count("rope", || cord.step(rest));
        probe.count("skin", || -> Result<(), Fault> {
            let followed = skin.rig.follow(named, &mut rig_state, handles)?;
            surface.blocks(followed.positions, 0..usize::MAX, level, &mut output);
            Ok(())
        })?;
        for sample in cord.samples() {
            hash.update(&sample.position);
            if matches!(sample.source, rope::Source::Lost) {
                return Err(Fault::Nothing);
            }
        }
        hash.update(positions);
        hash.update(normals);
    }
    for (name, value) in [
        ("markers", markers as u64),
        ("parts", parts as u64),
        ("traces", TRACES as u64),
        ("vertices", dims.vertex_count as u64),
        ("samples_measured", measured),
        ("samples_wrong", wrong),
        ("samples_filled", filled),
        ("bytes_asset", bytes.len() as u64),
        (
            "bytes_memory",
            (size_of::<f32>() * used
                + size_of_val(&traces)
                + size_of_val(&scratch)
                + size_of::<RopeTracker<TRACES, POINTS>>()) as u64,
        ),
    ] {
        probe.number(name, value);
    }
    Ok(hash.value())
}

/// The rope, an arm's length beside a marker of the body.
fn strand(phase: [f32; 2], [x, y, z]: [f32; 3]) -> [[f32; 3]; TRACES] {
    pendulum::<TRACES>(phase).map(|[a, b, c]| [x + a + 0.7, y + b - 1.9, z + c])
}

/// The points of a frame, and the marker that each is; `u16::MAX` for the rope's.
fn seen(
    frame: usize,
    places: &[[f32; 3]],
    strand: &[[f32; 3]; TRACES],
) -> ([[f32; 3]; POINTS], [u16; POINTS], usize) {
    let (mut points, mut owners, mut count) = ([[0.0; 3]; POINTS], [u16::MAX; POINTS], 0);
    let all = places.len() + TRACES;
    for turn in 0..all {
        // Any order; each is hidden for a fifteenth of a second in every two.
        let which = (turn * 23 + 7 * frame) % all;
        if (frame + 37 * which) % 240 < 8 {
            continue;
        }
        let (place, owner) = match places.get(which) {
            Some(place) => (Some(place), which as u16),
            None => (strand.get(which - places.len()), u16::MAX),
        };
        if let (Some(place), Some(point), Some(to)) =
            (place, points.get_mut(count), owners.get_mut(count))
        {
            (*point, *to) = (*place, owner);
            count += 1;
        }
    }
    (points, owners, count)
}
