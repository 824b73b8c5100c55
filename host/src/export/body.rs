//! A validated body as binary glTF.

use super::glb::{GlbError, GlbScene, write_glb};
use crate::import::{RawClip, RawJoint, RawMorph, RawTrack};
use crate::model::{Avatar, Clip};

/// A body with the given clips as the bytes of a `.glb` that any viewer plays. O(body)
///
/// # Errors
/// [`GlbError`] where the format cannot hold it.
pub fn write_glb_of(body: &Avatar, clips: &[Clip]) -> Result<Vec<u8>, GlbError> {
    let joints = body.skeleton.joints.iter();
    let joints: Vec<RawJoint> = joints
        .map(|joint| RawJoint {
            name: joint.name.clone(),
            parent: joint.parent,
            rest: joint.rest,
        })
        .collect();
    let morphs = body.mesh.morphs.iter();
    let morphs: Vec<RawMorph> = morphs
        .map(|morph| RawMorph {
            name: morph.name.clone(),
            positions: morph.positions.clone(),
            normals: morph.normals.clone(),
            rest_weight: morph.rest_weight,
        })
        .collect();
    let clips: Vec<RawClip> = clips.iter().map(raw_clip).collect();
    let (bind_joints, inverse_bind): (Vec<_>, Vec<_>) = body
        .skin
        .binds
        .iter()
        .map(|bind| (bind.joint, bind.inverse_bind))
        .unzip();
    write_glb(&GlbScene {
        name: &body.mesh.name,
        positions: &body.mesh.positions,
        normals: Some(&body.mesh.normals),
        triangles: &body.mesh.triangles,
        joints: &joints,
        bind_joints: &bind_joints,
        inverse_bind: &inverse_bind,
        influences: &body.skin.influences,
        morphs: &morphs,
        clips: &clips,
    })
}

fn raw_clip(clip: &Clip) -> RawClip {
    let tracks = clip.tracks.iter().map(|track| RawTrack {
        joint: track.joint,
        channel: track.channel,
        interpolation: track.interpolation,
        times: track.times.clone(),
        values: track.values.clone(),
    });
    RawClip {
        name: clip.name.clone(),
        tracks: tracks.collect(),
        morph_weights: clip.morph_track.as_ref().map(|track| {
            (
                track.interpolation,
                track.times.clone(),
                track.values.clone(),
            )
        }),
        sample_period: clip.sample_period,
    }
}
