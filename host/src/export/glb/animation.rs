//! Clips into animations.

use std::collections::{BTreeMap, BTreeSet};

use glam::DQuat;
use serde_json::{Value, json};

use super::GlbScene;
use super::binary::{Binary, Target};
use crate::import::{Channel, Interpolation, RawClip, RawTrack};

/// All clips that hold a key.
pub(super) fn animations(
    scene: &GlbScene<'_>,
    mesh_node: Option<usize>,
    binary: &mut Binary,
) -> Vec<Value> {
    let mut writer = Writer {
        binary,
        inputs: BTreeMap::new(),
    };
    let clips = scene.clips.iter();
    let animations = clips.filter_map(|clip| writer.clip(clip, scene.morphs.len(), mesh_node));
    animations.collect()
}

struct Writer<'b> {
    binary: &'b mut Binary,
    /// Accessors of key times, by their bits: tracks and clips share them.
    inputs: BTreeMap<Vec<u32>, usize>,
}

impl Writer<'_> {
    fn clip(
        &mut self,
        clip: &RawClip,
        morph_count: usize,
        mesh_node: Option<usize>,
    ) -> Option<Value> {
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        let mut add = |sampler: Value, node: usize, path: &str| {
            let target = json!({ "node": node, "path": path });
            channels.push(json!({ "sampler": samplers.len(), "target": target }));
            samplers.push(sampler);
        };
        let mut taken = BTreeSet::new();
        for track in clip.tracks.iter().filter(|track| !track.times.is_empty()) {
            // The format allows one channel a target; the first wins, as in the import.
            if taken.insert((track.joint, track.channel)) {
                let (sampler, path) = self.track(track);
                add(sampler, track.joint, path);
            }
        }
        if let (Some((interpolation, times, values)), Some(node)) = (&clip.morph_weights, mesh_node)
            && morph_count > 0
            && !times.is_empty()
        {
            let (input, kept) = self.input(times);
            let per_key = morph_count * parts(*interpolation);
            let keys = kept
                .iter()
                .map(|&k| &values[k * per_key..(k + 1) * per_key]);
            let values: Vec<[f32; 1]> = keys.flatten().map(|&v| [v as f32]).collect();
            let output = self.binary.push(Target::Other, &values);
            add(sampler(*interpolation, input, output), node, "weights");
        }
        if channels.is_empty() {
            return None;
        }
        Some(json!({ "name": clip.name, "samplers": samplers, "channels": channels }))
    }

    fn track(&mut self, track: &RawTrack) -> (Value, &'static str) {
        let (input, kept) = self.input(&track.times);
        let parts = parts(track.interpolation);
        let values = kept
            .iter()
            .flat_map(|&k| &track.values[k * parts..(k + 1) * parts]);
        let vector = |&[x, y, z, _]: &[f64; 4]| [x, y, z].map(|v| v as f32);
        let (output, path) = match track.channel {
            Channel::Rotation => {
                let rotation = |value: &[f64; 4]| {
                    // The tangents of splines are no rotations.
                    let unit = parts == 1;
                    let rotation = DQuat::from_array(*value);
                    let rotation = if unit { rotation.normalize() } else { rotation };
                    rotation.to_array().map(|v| v as f32)
                };
                let values: Vec<[f32; 4]> = values.map(rotation).collect();
                (self.binary.push(Target::Other, &values), "rotation")
            }
            Channel::Translation => {
                let values: Vec<[f32; 3]> = values.map(vector).collect();
                (self.binary.push(Target::Other, &values), "translation")
            }
            Channel::Scale => {
                let values: Vec<[f32; 3]> = values.map(vector).collect();
                (self.binary.push(Target::Other, &values), "scale")
            }
        };
        (sampler(track.interpolation, input, output), path)
    }

    /// The accessor of key times, and which keys it holds: those that `f32` cannot tell from the
    /// one before would break the ascending order that the format demands.
    fn input(&mut self, times: &[f64]) -> (usize, Vec<usize>) {
        let mut kept = Vec::with_capacity(times.len());
        let mut rounded: Vec<[f32; 1]> = Vec::with_capacity(times.len());
        for (key, &time) in times.iter().enumerate() {
            let time = time as f32;
            if rounded.last().is_none_or(|&[last]| last < time) {
                kept.push(key);
                rounded.push([time]);
            }
        }
        let bits = rounded.iter().map(|&[time]| time.to_bits()).collect();
        let binary = &mut self.binary;
        let new = || binary.push_bounded(Target::Other, &rounded);
        (*self.inputs.entry(bits).or_insert_with(new), kept)
    }
}

fn sampler(interpolation: Interpolation, input: usize, output: usize) -> Value {
    let interpolation = match interpolation {
        Interpolation::Step => "STEP",
        Interpolation::Linear => "LINEAR",
        Interpolation::CubicSpline => "CUBICSPLINE",
    };
    json!({ "input": input, "output": output, "interpolation": interpolation })
}

/// Values a key.
pub(super) fn parts(interpolation: Interpolation) -> usize {
    match interpolation {
        Interpolation::CubicSpline => 3,
        Interpolation::Step | Interpolation::Linear => 1,
    }
}
