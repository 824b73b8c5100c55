//! What a body really did, as a clip in the capture's own space and time.

use glam::DAffine3;

use super::body::Body;
use crate::model::{Channel, Clip, Track, Transform};

/// The body's motion, one key a frame, so that whatever is solved from the capture can stand beside
/// it. O(frames x joints)
#[must_use]
pub fn performed(body: &Body<'_>) -> Clip {
    let skeleton = &body.avatar().skeleton;
    let times: Vec<f64> = (0..body.frame_count()).map(|f| body.seconds(f)).collect();
    let poses: Vec<Vec<Transform>> = (0..body.frame_count())
        .map(|frame| {
            let model = body.pose(frame);
            let local = skeleton.joints.iter().zip(&model).map(|(joint, matrix)| {
                let above = joint.parent.map_or(DAffine3::IDENTITY, |p| model[p]);
                let (scale, rotation, translation) =
                    (above.inverse() * *matrix).to_scale_rotation_translation();
                Transform {
                    rotation,
                    translation,
                    scale,
                }
            });
            local.collect()
        })
        .collect();
    let mut tracks = Vec::new();
    for joint in 0..skeleton.joints.len() {
        let mut track = |channel, values: Vec<[f64; 4]>| {
            tracks.push(Track::linear(joint, channel, &times, values));
        };
        let places = poses
            .iter()
            .map(|p| p[joint].translation.extend(0.0).to_array());
        track(Channel::Translation, places.collect());
        let turns = poses
            .iter()
            .map(|p| p[joint].rotation.normalize().to_array());
        track(Channel::Rotation, turns.collect());
    }
    Clip {
        name: "performed".into(),
        tracks,
        morph_track: None,
        duration: times.last().copied().unwrap_or(0.0),
        sample_period: Some(1.0 / body.scene().rate),
    }
}
