//! What a glTF file means, in `f64`, straight from the equations of the glTF 2.0 specification.
//!
//! Slow and plain on purpose: everything faster is compared with it. Sections: 3.7.2.2 (morph
//! targets), 3.7.3.3 (skinning), appendix C (interpolation).

use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4};
use sinew_host::import::{
    Channel, Interpolation, RawAvatar, RawClip, RawSkeleton, RawTrack, Transform,
};

/// Joint transforms and morph weights at one time.
#[derive(Clone, Debug)]
pub struct Pose {
    /// `[joints]`, relative to the parent.
    pub locals: Vec<Transform>,
    /// `[morph targets]`.
    pub morph_weights: Vec<f64>,
}

/// Skinned positions and normals (none where the mesh has none) at `time` seconds into `clip`;
/// the rest pose without one.
#[must_use]
pub fn skinned(avatar: &RawAvatar, clip: Option<&RawClip>, time: f64) -> (Vec<DVec3>, Vec<DVec3>) {
    let pose = pose(avatar, clip, time);
    let palette = palette(avatar, &pose.locals);
    let (positions, normals) = morphed(avatar, &pose.morph_weights);
    let blend = |vertex: usize| {
        let influences = &avatar.skin.influences[vertex];
        let sum: f64 = influences.iter().map(|&(_, weight)| weight).sum();
        let mut matrix = DAffine3::ZERO;
        for &(bind, weight) in influences {
            matrix.matrix3 += palette[bind as usize].matrix3 * (weight / sum);
            matrix.translation += palette[bind as usize].translation * (weight / sum);
        }
        matrix
    };
    let blended: Vec<DAffine3> = (0..positions.len()).map(blend).collect();
    let points = blended.iter().zip(&positions);
    let directions = blended.iter().zip(&normals);
    (
        points.map(|(m, p)| m.transform_point3(*p)).collect(),
        directions
            .map(|(m, n)| (normal_matrix(m.matrix3) * *n).normalize_or_zero())
            .collect(),
    )
}

/// Inverse transpose up to a positive factor, so that a singular matrix needs no exception: the
/// cofactors, turned with the sign of the determinant.
#[must_use]
pub fn normal_matrix(m: DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(
        m.y_axis.cross(m.z_axis),
        m.z_axis.cross(m.x_axis),
        m.x_axis.cross(m.y_axis),
    );
    if m.determinant() < 0.0 {
        -cofactors
    } else {
        cofactors
    }
}

/// `[binds]`: from mesh space in the bind pose to model space.
#[must_use]
pub fn palette(avatar: &RawAvatar, locals: &[Transform]) -> Vec<DAffine3> {
    let model = model_matrices(&avatar.skeleton, locals);
    let binds = avatar.skin.joints.iter().zip(&avatar.skin.inverse_bind);
    binds
        .map(|(&joint, inverse_bind)| model[joint] * *inverse_bind)
        .collect()
}

/// `[joints]`: from each joint's space to model space.
#[must_use]
pub fn model_matrices(skeleton: &RawSkeleton, locals: &[Transform]) -> Vec<DAffine3> {
    let model = |joint: usize| {
        let mut matrix = locals[joint].affine();
        let mut above = skeleton.joints[joint].parent;
        while let Some(parent) = above {
            matrix = locals[parent].affine() * matrix;
            above = skeleton.joints[parent].parent;
        }
        matrix
    };
    (0..locals.len()).map(model).collect()
}

/// Positions and normals in mesh space with the morph targets added.
#[must_use]
pub fn morphed(avatar: &RawAvatar, weights: &[f64]) -> (Vec<DVec3>, Vec<DVec3>) {
    let mut positions = avatar.mesh.positions.clone();
    let mut normals = avatar.mesh.normals.clone().unwrap_or_default();
    for (morph, &weight) in avatar.mesh.morphs.iter().zip(weights) {
        for (position, offset) in positions.iter_mut().zip(&morph.positions) {
            *position += *offset * weight;
        }
        for (normal, offset) in normals.iter_mut().zip(&morph.normals) {
            *normal += *offset * weight;
        }
    }
    (positions, normals)
}

/// The pose of an avatar; what the clip does not move is at rest.
#[must_use]
pub fn pose(avatar: &RawAvatar, clip: Option<&RawClip>, time: f64) -> Pose {
    let joints = avatar.skeleton.joints.iter();
    let morphs = avatar.mesh.morphs.iter();
    let mut pose = Pose {
        locals: joints.map(|joint| joint.rest).collect(),
        morph_weights: morphs.map(|morph| morph.rest_weight).collect(),
    };
    let Some(clip) = clip else { return pose };
    for track in &clip.tracks {
        let value = sample(track, time);
        let local = &mut pose.locals[track.joint];
        match track.channel {
            Channel::Translation => local.translation = value.truncate(),
            Channel::Rotation => local.rotation = DQuat::from_vec4(value).normalize(),
            Channel::Scale => local.scale = value.truncate(),
        }
    }
    if let Some((interpolation, times, values)) = &clip.morph_weights {
        let count = avatar.mesh.morphs.len();
        for (morph, weight) in pose.morph_weights.iter_mut().enumerate() {
            let value = |row: usize| DVec4::splat(values[row * count + morph]);
            *weight = interpolate(*interpolation, times, value, false, time).x;
        }
    }
    pose
}

/// The value of a track at `time`; before the first and after the last key these hold.
#[must_use]
pub fn sample(track: &RawTrack, time: f64) -> DVec4 {
    let value = |row: usize| DVec4::from_array(track.values[row]);
    let rotation = track.channel == Channel::Rotation;
    interpolate(track.interpolation, &track.times, value, rotation, time)
}

/// Appendix C; `value` gives one row of key values, of which splines have three a key.
fn interpolate(
    interpolation: Interpolation,
    times: &[f64],
    value: impl Fn(usize) -> DVec4,
    rotation: bool,
    time: f64,
) -> DVec4 {
    let time = time.clamp(times[0], times[times.len() - 1]);
    let last = times.len() - 1;
    let key = times.iter().rposition(|&key| key <= time).unwrap_or(0);
    let next = (key + 1).min(last);
    let span = times[next] - times[key];
    let u = if span > 0.0 {
        (time - times[key]) / span
    } else {
        0.0
    };
    match interpolation {
        Interpolation::Step => value(key),
        Interpolation::Linear if rotation => slerp(value(key), value(next), u),
        Interpolation::Linear => value(key) * (1.0 - u) + value(next) * u,
        Interpolation::CubicSpline => {
            let (start, leaving) = (value(3 * key + 1), value(3 * key + 2));
            let (arriving, end) = (value(3 * next), value(3 * next + 1));
            let (u2, u3) = (u * u, u * u * u);
            start * (2.0 * u3 - 3.0 * u2 + 1.0)
                + leaving * (span * (u3 - 2.0 * u2 + u))
                + end * (3.0 * u2 - 2.0 * u3)
                + arriving * (span * (u3 - u2))
        }
    }
}

/// Appendix C.4: along the shorter great arc.
fn slerp(from: DVec4, to: DVec4, u: f64) -> DVec4 {
    let cosine = from.dot(to);
    let to = to * cosine.signum();
    let angle = cosine.abs().min(1.0).acos();
    // Below this, sin x = x to the last bit, and the formula would divide zero by zero.
    if angle < 1e-9 {
        return from * (1.0 - u) + to * u;
    }
    (from * ((1.0 - u) * angle).sin() + to * (u * angle).sin()) / angle.sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(channel: Channel, interpolation: Interpolation, values: &[[f64; 4]]) -> RawTrack {
        RawTrack {
            joint: 0,
            channel,
            interpolation,
            times: vec![1.0, 3.0],
            values: values.to_vec(),
        }
    }

    #[test]
    fn linear_and_step_keys() {
        let values = [[0.0; 4], [4.0, 8.0, 0.0, 0.0]];
        let linear = track(Channel::Translation, Interpolation::Linear, &values);
        assert_eq!(sample(&linear, 0.0), DVec4::ZERO);
        assert_eq!(sample(&linear, 1.5), DVec4::new(1.0, 2.0, 0.0, 0.0));
        assert_eq!(sample(&linear, 9.0), DVec4::new(4.0, 8.0, 0.0, 0.0));
        let step = track(Channel::Translation, Interpolation::Step, &values);
        assert_eq!(sample(&step, 2.999), DVec4::ZERO);
        assert_eq!(sample(&step, 3.0), DVec4::new(4.0, 8.0, 0.0, 0.0));
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let turn = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
        let far = (-turn(90.0)).to_array();
        let values = [turn(0.0).to_array(), far];
        let track = track(Channel::Rotation, Interpolation::Linear, &values);
        let quarter = DQuat::from_vec4(sample(&track, 1.5));
        assert!(quarter.abs_diff_eq(turn(22.5), 1e-15), "{quarter}");
    }

    #[test]
    fn splines_follow_hermite() {
        // From 0 with slope 3 to 2 with slope 0 in two seconds; in the middle 1 + 2 * 3 / 8.
        let row = |x: f64| [x, 0.0, 0.0, 0.0];
        let values = [9.0, 0.0, 3.0, 0.0, 2.0, 9.0].map(row);
        let track = track(Channel::Scale, Interpolation::CubicSpline, &values);
        assert_eq!(sample(&track, 2.0).x, 1.75);
        assert_eq!(sample(&track, 3.0).x, 2.0);
    }

    #[test]
    fn normals_follow_the_surface() {
        // Twice as long in x: a 45 degree slope becomes flatter, its normal steeper.
        let stretch = DMat3::from_diagonal(DVec3::new(2.0, 1.0, 1.0));
        let normal = (normal_matrix(stretch) * DVec3::new(1.0, 1.0, 0.0)).normalize();
        assert!(normal.abs_diff_eq(DVec3::new(1.0, 2.0, 0.0).normalize(), 1e-15));
        // Mirrored, it still points out of the mirrored body.
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        assert_eq!(normal_matrix(mirror) * DVec3::X, DVec3::NEG_X);
    }
}
