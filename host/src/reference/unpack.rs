//! An asset back into a body, so that the oracle can play exactly what the asset holds.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use sinew_core::asset::{self, Asset, LANES, WEIGHT_ONE};

use crate::model::{
    Avatar, Bind, Channel, Clip, Interpolation, Joint, Mesh, Morph, MorphTrack, Part, Skeleton,
    Skin, Track, Transform,
};

/// The body in the source's vertex order. O(asset)
#[must_use]
pub fn unpack(asset: &Asset<'_>) -> Avatar {
    let mesh = mesh(asset);
    let clips = (0..asset.dims().clip_count).filter_map(|index| asset.clip(index));
    Avatar {
        clips: clips.map(|clip| unpack_clip(&clip, &mesh.morphs)).collect(),
        mesh,
        skeleton: skeleton(asset),
        skin: skin(asset),
    }
}

/// Centres of rotation in the source's vertex order; a vertex's own place where the asset has none
/// for it.
#[must_use]
pub fn unpack_centres(asset: &Asset<'_>) -> Vec<DVec3> {
    let mut centres = mesh(asset).positions;
    let blocks = asset.source_order().chunks(LANES).enumerate();
    let blended = blocks.filter(|&(block, _)| asset.slots(block).len() > 1);
    for ((_, vertices), [x, y, z]) in blended.zip(asset.centres()) {
        for (lane, &source) in vertices.iter().enumerate() {
            let centre = [x[lane], y[lane], z[lane]].map(f64::from);
            centres[source as usize] = DVec3::from_array(centre);
        }
    }
    centres
}

fn skeleton(asset: &Asset<'_>) -> Skeleton {
    let joint = |index: usize| {
        let rest = asset.rest(index)?.map(f64::from);
        Some(Joint {
            name: asset.joint_name(index).to_owned(),
            parent: asset.parent(index),
            rest: Transform {
                rotation: DQuat::from_slice(&rest[..4]).normalize(),
                translation: DVec3::from_slice(&rest[4..7]),
                scale: DVec3::from_slice(&rest[7..]),
            },
        })
    };
    Skeleton {
        joints: (0..asset.dims().joint_count).filter_map(joint).collect(),
    }
}

fn mesh(asset: &Asset<'_>) -> Mesh {
    let order = asset.source_order();
    let vector = |blocks: &[asset::Lanes3], at: usize| {
        let [x, y, z] = &blocks[at / LANES];
        DVec3::new(
            x[at % LANES].into(),
            y[at % LANES].into(),
            z[at % LANES].into(),
        )
    };
    let mut positions = vec![DVec3::ZERO; order.len()];
    let mut normals = positions.clone();
    for (at, &source) in order.iter().enumerate() {
        positions[source as usize] = vector(asset.rest_positions(), at);
        normals[source as usize] = vector(asset.rest_normals(), at);
    }
    let triangles = asset.triangles().iter();
    Mesh {
        name: String::new(),
        positions,
        normals,
        tangents: None,
        texcoords: None,
        triangles: triangles.map(|t| t.map(|at| order[at as usize])).collect(),
        parts: asset
            .parts()
            .map(|part| Part {
                name: part.name.to_owned(),
                triangles: part.first_triangle..part.first_triangle + part.triangle_count,
            })
            .collect(),
        morphs: morphs(asset),
    }
}

fn morphs(asset: &Asset<'_>) -> Vec<Morph> {
    let order = asset.source_order();
    let has_normals = asset.dims().morph_normal_count > 0;
    let still = vec![DVec3::ZERO; order.len()];
    let morph = |index: usize| {
        let morph = asset.morph(index)?;
        Some(Morph {
            name: morph.name.to_owned(),
            positions: still.clone(),
            normals: if has_normals {
                still.clone()
            } else {
                Vec::new()
            },
            rest_weight: morph.rest_weight.into(),
        })
    };
    let mut morphs: Vec<Morph> = (0..asset.dims().morph_count).filter_map(morph).collect();
    for (block, vertices) in order.chunks(LANES).enumerate() {
        for row in asset.morph_rows(block) {
            let to = &mut morphs[row.morph];
            for (lane, &source) in vertices.iter().enumerate() {
                let of = |[x, y, z]: &asset::Lanes3| {
                    DVec3::from_array([x[lane], y[lane], z[lane]].map(f64::from))
                };
                to.positions[source as usize] = of(row.offsets);
                if let Some(normals) = row.normals {
                    to.normals[source as usize] = of(normals);
                }
            }
        }
    }
    morphs
}

fn skin(asset: &Asset<'_>) -> Skin {
    let order = asset.source_order();
    let mut influences = vec![Vec::new(); order.len()];
    for block in 0..asset.dims().block_count {
        for (bind, weights) in asset.slots(block) {
            let vertices = order[block * LANES..].iter().zip(weights);
            for (&source, &weight) in vertices.filter(|&(_, &weight)| weight > 0) {
                let weight = f64::from(weight) / f64::from(WEIGHT_ONE);
                influences[source as usize].push((u32::from(bind), weight));
            }
        }
    }
    let bind = |index: usize| {
        let (joint, m) = asset.bind(index)?;
        let m = m.map(f64::from);
        let rows = DMat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]);
        Some(Bind {
            joint,
            inverse_bind: DAffine3 {
                matrix3: rows.transpose(),
                translation: DVec3::new(m[3], m[7], m[11]),
            },
        })
    };
    Skin {
        binds: (0..asset.dims().bind_count).filter_map(bind).collect(),
        influences,
    }
}

fn unpack_clip(clip: &asset::Clip<'_>, morphs: &[Morph]) -> Clip {
    let tracks = clip.tracks().filter_map(|track| {
        let width = track.channel.width();
        let value = |numbers: &[f32]| {
            let mut value = [0.0; 4];
            for (value, &number) in value.iter_mut().zip(numbers) {
                *value = f64::from(number);
            }
            value
        };
        Some(Track {
            joint: track.target,
            channel: match track.channel {
                asset::Channel::Translation => Channel::Translation,
                asset::Channel::Rotation => Channel::Rotation,
                asset::Channel::Scale => Channel::Scale,
                asset::Channel::MorphWeight => return None,
            },
            interpolation: interpolation(track.interpolation),
            times: track.times.iter().map(|&time| time.into()).collect(),
            values: track.values.chunks_exact(width).map(value).collect(),
        })
    });
    let mut tracks: Vec<Track> = tracks.collect();
    tracks.extend(clip.packed_tracks().map(|track| unpack_track(&track, clip)));
    tracks.sort_by_key(|track| (track.joint, track.channel));
    Clip {
        name: clip.name.to_owned(),
        tracks,
        morph_track: morph_track(clip, morphs),
        duration: clip.duration.into(),
        sample_period: (clip.sample_period > 0.0).then(|| clip.sample_period.into()),
    }
}

/// A compressed track with its keys as they decode.
fn unpack_track(track: &asset::PackedTrack<'_>, clip: &asset::Clip<'_>) -> Track {
    let value = |key: usize| {
        if let (asset::Channel::Rotation, Some(turn)) = (track.channel, track.rotation(key)) {
            return DQuat::from_array(turn.map(f64::from))
                .normalize()
                .to_array();
        }
        let vector = track.vector(key).unwrap_or_default();
        DVec3::from_array(vector.map(f64::from))
            .extend(0.0)
            .to_array()
    };
    let period = f64::from(clip.sample_period);
    Track {
        joint: track.joint,
        channel: match track.channel {
            asset::Channel::Scale => Channel::Scale,
            asset::Channel::Rotation => Channel::Rotation,
            _ => Channel::Translation,
        },
        interpolation: Interpolation::Linear,
        times: track
            .frames
            .iter()
            .map(|&frame| f64::from(frame) * period)
            .collect(),
        values: (0..track.frames.len()).map(value).collect(),
    }
}

fn interpolation(of: asset::Interpolation) -> Interpolation {
    match of {
        asset::Interpolation::Step => Interpolation::Step,
        asset::Interpolation::Linear => Interpolation::Linear,
        asset::Interpolation::CubicSpline => Interpolation::CubicSpline,
    }
}

/// The bake cuts one track of all weights into one for each; those that rest are left out.
fn morph_track(clip: &asset::Clip<'_>, morphs: &[Morph]) -> Option<MorphTrack> {
    let is_weight = |track: &asset::Track<'_>| track.channel == asset::Channel::MorphWeight;
    let first = clip.tracks().find(is_weight)?;
    let group = first.interpolation.values_a_key();
    let mut values = Vec::with_capacity(first.times.len() * group * morphs.len());
    for number in 0..first.times.len() * group {
        // Of a spline's in-tangent, value and out-tangent only the value rests elsewhere than 0.
        let is_value = group == 1 || number % 3 == 1;
        let rest = |morph: &Morph| if is_value { morph.rest_weight } else { 0.0 };
        values.extend(morphs.iter().map(rest));
    }
    for track in clip.tracks().filter(is_weight) {
        for (key, &number) in track.values.iter().enumerate() {
            values[key * morphs.len() + track.target] = number.into();
        }
    }
    Some(MorphTrack {
        interpolation: interpolation(first.interpolation),
        times: first.times.iter().map(|&time| time.into()).collect(),
        values,
    })
}
