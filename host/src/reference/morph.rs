//! Morph targets.

use crate::model::{Clip, Interpolation, Mesh, Morph};

/// Weights `[morphs]` of a clip at a time; the weights at rest where the clip is silent.
#[must_use]
pub fn sample(morphs: &[Morph], clip: &Clip, seconds: f64) -> Vec<f64> {
    let Some(track) = &clip.morph_track else {
        return rest(morphs);
    };
    let (times, count) = (&track.times, morphs.len());
    let spline = track.interpolation == Interpolation::CubicSpline;
    let row = |row: usize, morph: usize| track.values[row * count + morph];
    let value = |key: usize, morph| row(if spline { 3 * key + 1 } else { key }, morph);
    let after = times.partition_point(|&time| time <= seconds);
    let sample = |morph: usize| {
        if after == 0 || after == times.len() {
            return value(after.saturating_sub(1), morph);
        }
        let (key, length) = (after - 1, times[after] - times[after - 1]);
        let t = (seconds - times[key]) / length;
        let (from, to) = (value(key, morph), value(after, morph));
        match track.interpolation {
            Interpolation::Step => from,
            Interpolation::Linear => from + (to - from) * t,
            Interpolation::CubicSpline => {
                let (out, next_in) = (row(3 * key + 2, morph), row(3 * after, morph));
                let (t2, t3) = (t * t, t * t * t);
                (2.0 * t3 - 3.0 * t2 + 1.0) * from
                    + length * (t3 - 2.0 * t2 + t) * out
                    + (3.0 * t2 - 2.0 * t3) * to
                    + length * (t3 - t2) * next_in
            }
        }
    };
    (0..count).map(sample).collect()
}

/// Weights when nothing animates them.
#[must_use]
pub fn rest(morphs: &[Morph]) -> Vec<f64> {
    morphs.iter().map(|morph| morph.rest_weight).collect()
}

/// The mesh with weighted offsets added (glTF 2.0, section 3.7.2.2), normals at unit length.
#[must_use]
pub fn morphed(mesh: &Mesh, weights: &[f64]) -> Mesh {
    let mut mesh = mesh.clone();
    for (morph, &weight) in mesh.morphs.iter().zip(weights) {
        for (position, offset) in mesh.positions.iter_mut().zip(&morph.positions) {
            *position += weight * *offset;
        }
        for (normal, offset) in mesh.normals.iter_mut().zip(&morph.normals) {
            *normal += weight * *offset;
        }
    }
    for normal in &mut mesh.normals {
        *normal = normal.normalize_or_zero();
    }
    mesh
}
