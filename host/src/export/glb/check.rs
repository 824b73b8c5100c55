//! Whether the parts of a scene fit together.

use glam::DVec3;

use super::animation::parts;
use super::{GlbError, GlbScene};
use crate::import::{Channel, Interpolation, RawClip};

/// Joint indices are `u16` at most.
const BIND_LIMIT: usize = 1 << 16;

/// Fails on the first contradiction; afterwards writing cannot fail but for the file's size.
pub(super) fn check(scene: &GlbScene<'_>) -> Result<(), GlbError> {
    check_surface(scene)?;
    check_joints(scene)?;
    check_influences(scene)?;
    scene
        .clips
        .iter()
        .try_for_each(|clip| check_clip(clip, scene))
}

fn check_surface(scene: &GlbScene<'_>) -> Result<(), GlbError> {
    let vertices = scene.positions.len();
    limit("vertices", vertices, u32::MAX as usize)?;
    finite_vectors(|| "position".into(), scene.positions)?;
    if vertices > 0 && scene.triangles.is_empty() {
        return Err(GlbError::NoTriangles { vertices });
    }
    for &index in scene.triangles.iter().flatten() {
        exists(|| "vertex of a triangle".into(), index as usize, vertices)?;
    }
    if let Some(normals) = scene.normals {
        count("normals", normals.len(), vertices)?;
        finite_vectors(|| "normal".into(), normals)?;
    }
    for morph in scene.morphs {
        let what = |part| format!("{part} of morph target {:?}", morph.name);
        count(&what("positions"), morph.positions.len(), vertices)?;
        finite_vectors(|| what("position"), &morph.positions)?;
        if !morph.normals.is_empty() {
            count(&what("normals"), morph.normals.len(), vertices)?;
            finite_vectors(|| what("normal"), &morph.normals)?;
        }
        finite(|| what("weight"), [morph.rest_weight])?;
    }
    Ok(())
}

fn check_joints(scene: &GlbScene<'_>) -> Result<(), GlbError> {
    let joints = scene.joints.len();
    let mut children = vec![Vec::new(); joints];
    let mut open = Vec::new();
    for (i, joint) in scene.joints.iter().enumerate() {
        match joint.parent {
            None => open.push(i),
            Some(parent) => {
                exists(|| format!("parent of joint {i}"), parent, joints)?;
                children[parent].push(i);
            }
        }
        let rest = joint.rest;
        let what = || format!("rest transform of joint {i}");
        finite(what, rest.translation.to_array())?;
        finite(what, rest.rotation.normalize().to_array())?;
        finite(what, rest.scale.to_array())?;
    }
    // With one parent each, joints that no root leads to run in a circle.
    let mut reached = 0;
    while let Some(joint) = open.pop() {
        reached += 1;
        open.append(&mut children[joint]);
    }
    if reached < joints {
        return Err(GlbError::Cycle);
    }
    Ok(())
}

fn check_influences(scene: &GlbScene<'_>) -> Result<(), GlbError> {
    let binds = scene.bind_joints.len();
    limit("binds", binds, BIND_LIMIT)?;
    count("inverse bind matrices", scene.inverse_bind.len(), binds)?;
    for (&joint, matrix) in scene.bind_joints.iter().zip(scene.inverse_bind) {
        exists(|| "joint of a bind".into(), joint, scene.joints.len())?;
        finite(|| "inverse bind matrix".into(), matrix.to_cols_array())?;
    }
    if binds == 0 && scene.influences.is_empty() {
        return Ok(());
    }
    count("influences", scene.influences.len(), scene.positions.len())?;
    for (vertex, list) in scene.influences.iter().enumerate() {
        for &(bind, weight) in list {
            exists(|| format!("bind of vertex {vertex}"), bind as usize, binds)?;
            finite(|| format!("weight of vertex {vertex}"), [weight])?;
        }
        if !list.iter().any(|&(_, weight)| weight > 0.0) {
            return Err(GlbError::Unweighted { vertex });
        }
    }
    Ok(())
}

fn check_clip(clip: &RawClip, scene: &GlbScene<'_>) -> Result<(), GlbError> {
    for (i, track) in clip.tracks.iter().enumerate() {
        let what = |part| format!("{part} of track {i} of clip {:?}", clip.name);
        exists(|| what("joint"), track.joint, scene.joints.len())?;
        check_times(clip, &track.times)?;
        let values = track.times.len() * parts(track.interpolation);
        count(&what("values"), track.values.len(), values)?;
        let stepped = track.interpolation != Interpolation::CubicSpline;
        for value in &track.values {
            finite(|| what("value"), *value)?;
            let length = value.iter().map(|v| v * v).sum::<f64>();
            if track.channel == Channel::Rotation && stepped && length == 0.0 {
                let what = what("direction of a rotation");
                return Err(GlbError::NotFinite { what });
            }
        }
    }
    if let Some((interpolation, times, values)) = &clip.morph_weights {
        check_times(clip, times)?;
        let expected = times.len() * scene.morphs.len() * parts(*interpolation);
        let what = format!("morph weights of clip {:?}", clip.name);
        count(&what, values.len(), expected)?;
        finite(|| what.clone(), values.iter().copied())?;
    }
    Ok(())
}

fn check_times(clip: &RawClip, times: &[f64]) -> Result<(), GlbError> {
    finite(
        || format!("key time of clip {:?}", clip.name),
        times.iter().copied(),
    )?;
    let ascending = times.windows(2).all(|pair| pair[0] < pair[1]);
    if ascending && times.first().is_none_or(|&first| first >= 0.0) {
        return Ok(());
    }
    let clip = clip.name.clone();
    Err(GlbError::BadTimes { clip })
}

fn finite_vectors(what: impl Fn() -> String, vectors: &[DVec3]) -> Result<(), GlbError> {
    finite(what, vectors.iter().flat_map(|v| v.to_array()))
}

fn finite(
    what: impl Fn() -> String,
    values: impl IntoIterator<Item = f64>,
) -> Result<(), GlbError> {
    if values.into_iter().all(|value| (value as f32).is_finite()) {
        return Ok(());
    }
    Err(GlbError::NotFinite { what: what() })
}

fn exists(what: impl Fn() -> String, index: usize, count: usize) -> Result<(), GlbError> {
    if index < count {
        return Ok(());
    }
    Err(GlbError::BadIndex {
        what: what(),
        index,
        count,
    })
}

fn count(what: &str, found: usize, expected: usize) -> Result<(), GlbError> {
    if found == expected {
        return Ok(());
    }
    Err(GlbError::Count {
        what: what.into(),
        found,
        expected,
    })
}

fn limit(what: &str, count: usize, limit: usize) -> Result<(), GlbError> {
    if count <= limit {
        return Ok(());
    }
    Err(GlbError::TooMany {
        what: what.into(),
        count: count as u64,
        limit: limit as u64,
    })
}
