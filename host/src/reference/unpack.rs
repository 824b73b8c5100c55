//! An asset back into a body, so that the oracle can play exactly what the asset holds.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use sinew_core::asset::{self, Asset, LANES, WEIGHT_ONE};

use crate::model::{
    Avatar, Bind, Channel, Clip, Interpolation, Joint, Mesh, Part, Skeleton, Skin, Track, Transform,
};

/// The body in the source's vertex order. O(asset)
#[must_use]
pub fn unpack(asset: &Asset<'_>) -> Avatar {
    Avatar {
        mesh: mesh(asset),
        skeleton: skeleton(asset),
        skin: skin(asset),
        clips: (0..asset.dims().clip_count)
            .filter_map(|index| asset.clip(index))
            .map(|clip| unpack_clip(&clip))
            .collect(),
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
        morphs: Vec::new(),
    }
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

fn unpack_clip(clip: &asset::Clip<'_>) -> Clip {
    let tracks = clip.tracks().map(|track| {
        let width = track.channel.width();
        let value = |numbers: &[f32]| {
            let mut value = [0.0; 4];
            for (value, &number) in value.iter_mut().zip(numbers) {
                *value = f64::from(number);
            }
            value
        };
        Track {
            joint: track.joint,
            channel: match track.channel {
                asset::Channel::Translation => Channel::Translation,
                asset::Channel::Rotation => Channel::Rotation,
                asset::Channel::Scale => Channel::Scale,
            },
            interpolation: match track.interpolation {
                asset::Interpolation::Step => Interpolation::Step,
                asset::Interpolation::Linear => Interpolation::Linear,
                asset::Interpolation::CubicSpline => Interpolation::CubicSpline,
            },
            times: track.times.iter().map(|&time| time.into()).collect(),
            values: track.values.chunks_exact(width).map(value).collect(),
        }
    });
    Clip {
        name: clip.name.to_owned(),
        tracks: tracks.collect(),
        morph_track: None,
        duration: clip.duration.into(),
        sample_period: (clip.sample_period > 0.0).then(|| clip.sample_period.into()),
    }
}
