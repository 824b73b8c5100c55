//! Animation channels into clips (glTF 2.0, section 3.11 "Animations").

use std::collections::BTreeSet;

use glam::DQuat;
use gltf::json::accessor::Type;
use gltf::json::animation::{self, Animation, Property};
use gltf::json::validation::Checked;

use super::accessor::{Reader, Storage};
use super::document::Document;
use super::hierarchy::unit;
use super::morph::Morphs;
use super::weights::{self, WeightTrack};
use super::{checked, item_fault};
use crate::import::{Channel, ImportError, ImportErrorKind, Interpolation, RawClip, RawTrack};

/// Marks every node that a channel moves, for a file without meshes.
pub(super) fn mark_targets(document: &Document, used: &mut [bool]) -> Result<(), ImportError> {
    for (i, animation) in document.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            let item = format!("animations[{i}].channels[{c}]");
            let node = channel.target.node.value();
            used[checked(&document.nodes, node, "node", &item)?] = true;
        }
    }
    Ok(())
}

/// One clip an animation.
pub(super) fn read(
    reader: &mut Reader<'_>,
    joint_of_node: &[Option<usize>],
    morphs: &Morphs,
    stem: &str,
) -> Result<Vec<RawClip>, ImportError> {
    let document = reader.document;
    let mut clips = Vec::with_capacity(document.animations.len());
    for (i, animation) in document.animations.iter().enumerate() {
        let fallback = match document.animations.len() {
            1 => stem.to_owned(),
            _ => format!("{stem}.{i}"),
        };
        let name = animation.name.clone().unwrap_or(fallback);
        let item = format!("animations[{i}]");
        let clip = read_clip(reader, animation, joint_of_node, morphs, &item)?;
        clips.push(RawClip { name, ..clip });
    }
    Ok(clips)
}

fn read_clip(
    reader: &mut Reader<'_>,
    animation: &Animation,
    joint_of_node: &[Option<usize>],
    morphs: &Morphs,
    item: &str,
) -> Result<RawClip, ImportError> {
    let document = reader.document;
    let mut clip = RawClip::default();
    let mut weight_tracks = Vec::new();
    let mut targets = BTreeSet::new();
    let mut elsewhere = 0;
    for (c, channel) in animation.channels.iter().enumerate() {
        let channel_item = format!("{item}.channels[{c}]");
        let node = channel.target.node.value();
        checked(&document.nodes, node, "node", &channel_item)?;
        let Checked::Valid(property) = channel.target.path else {
            reader.notice(channel_item, "left out: its path is not one of glTF 2.0");
            continue;
        };
        let joint = joint_of_node[node];
        let range = morphs.of_node(node);
        let used = match property {
            Property::MorphTargetWeights => range.is_some(),
            _ => joint.is_some(),
        };
        if !used {
            elsewhere += 1;
            continue;
        }
        if !targets.insert((node, property as u8)) {
            reader.notice(
                channel_item,
                "left out: an earlier channel has the same target",
            );
            continue;
        }
        let sampler = channel.sampler.value();
        let sampler = checked(&animation.samplers, sampler, "sampler", &channel_item)?;
        let sampler_item = format!("{item}.samplers[{sampler}]");
        let keys = Keys::read(reader, &animation.samplers[sampler], &sampler_item)?;
        if keys.times.is_empty() {
            reader.notice(channel_item, "left out: it has no keys");
            continue;
        }
        match (range, joint) {
            (Some(range), _) if property == Property::MorphTargetWeights => {
                let values = keys.values(reader, Type::Scalar, range.count(), &sampler_item)?;
                weight_tracks.push(WeightTrack {
                    first_morph: range.first,
                    interpolation: keys.interpolation,
                    times: keys.times,
                    values,
                });
            }
            (_, Some(joint)) => {
                let track = keys.into_track(reader, joint, property, &sampler_item)?;
                clip.tracks.push(track);
            }
            _ => {}
        }
    }
    if elsewhere > 0 {
        let text = format!("{elsewhere} channels left out: they do not move the surface");
        reader.notice(item, text);
    }
    clip.morph_weights = weights::merge(reader, &weight_tracks, &morphs.rest_weights(), item)?;
    Ok(clip)
}

/// A sampler whose times have been read.
struct Keys {
    interpolation: Interpolation,
    times: Vec<f64>,
    output: usize,
}

impl Keys {
    fn read(
        reader: &mut Reader<'_>,
        sampler: &animation::Sampler,
        item: &str,
    ) -> Result<Self, ImportError> {
        let interpolation = match sampler.interpolation {
            Checked::Valid(animation::Interpolation::Step) => Interpolation::Step,
            Checked::Valid(animation::Interpolation::Linear) => Interpolation::Linear,
            Checked::Valid(animation::Interpolation::CubicSpline) => Interpolation::CubicSpline,
            Checked::Invalid => {
                let what = "an interpolation other than STEP, LINEAR and CUBICSPLINE".into();
                return Err(item_fault(ImportErrorKind::Unsupported { what }, item));
            }
        };
        let input = sampler.input.value();
        let times = reader.read(input, Type::Scalar, Storage::Fraction, "key times", item)?;
        let bad = |i: usize, expected: String| {
            let kind = ImportErrorKind::OutOfRange {
                what: format!("key time {i}"),
                value: times[i].to_string(),
                expected,
            };
            item_fault(kind, format!("accessors[{input}]"))
        };
        if times.first().is_some_and(|&time| time < 0.0) {
            return Err(bad(0, "0 or more".into()));
        }
        if let Some(i) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(bad(i + 1, format!("above the one before, {}", times[i])));
        }
        Ok(Self {
            interpolation,
            times,
            output: sampler.output.value(),
        })
    }

    /// The output's numbers: `per_key` elements a key, three times as many for splines.
    fn values(
        &self,
        reader: &mut Reader<'_>,
        shape: Type,
        per_key: usize,
        item: &str,
    ) -> Result<Vec<f64>, ImportError> {
        let values = reader.read(self.output, shape, Storage::Fraction, "key values", item)?;
        let parts = match self.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Step | Interpolation::Linear => 1,
        };
        let needed = self.times.len() * per_key * parts;
        let found = values.len() / shape.multiplicity();
        if found == needed {
            return Ok(values);
        }
        let what = format!(
            "{} key times ask for {needed} values, there are {found}",
            self.times.len()
        );
        Err(item_fault(ImportErrorKind::Contradiction { what }, item))
    }

    fn into_track(
        self,
        reader: &mut Reader<'_>,
        joint: usize,
        property: Property,
        item: &str,
    ) -> Result<RawTrack, ImportError> {
        let (channel, shape) = match property {
            Property::Rotation => (Channel::Rotation, Type::Vec4),
            Property::Scale => (Channel::Scale, Type::Vec3),
            Property::Translation | Property::MorphTargetWeights => {
                (Channel::Translation, Type::Vec3)
            }
        };
        let numbers = self.values(reader, shape, 1, item)?;
        let mut values: Vec<[f64; 4]> = match shape {
            Type::Vec4 => numbers.as_chunks().0.to_vec(),
            _ => {
                let (vectors, _) = numbers.as_chunks();
                vectors.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect()
            }
        };
        // The tangents of splines are no rotations, and their values are normalised after the
        // evaluation.
        if channel == Channel::Rotation && self.interpolation != Interpolation::CubicSpline {
            for value in &mut values {
                let rotation = unit(DQuat::from_array(*value));
                let place = format!("accessors[{}]", self.output);
                *value = rotation.map_err(|kind| item_fault(kind, place))?.to_array();
            }
        }
        Ok(RawTrack {
            joint,
            channel,
            interpolation: self.interpolation,
            times: self.times,
            values,
        })
    }
}
