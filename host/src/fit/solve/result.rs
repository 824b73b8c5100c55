//! Poses as a motion, and how good they are.

use glam::{DQuat, DVec3};

use super::body::{Body, Pose};
use crate::model::{Channel, Clip, Interpolation, Joint, Motion, Skeleton, Track, Transform};
use crate::take::Take;

/// A marker this far from where its skeleton carries it is another one, metres.
pub const FAULT: f64 = 0.1;

/// What a solve gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// Skeleton with fixed bone lengths, and its motion at the take's rate. The rest pose is a
    /// T-pose that faces +Z; of unnamed groups it is one of the take's frames.
    pub motion: Motion,
    /// Whether labels were understood; else joints follow from rigid groups.
    pub by_labels: bool,
    /// Each marker that was used.
    pub markers: Vec<MarkerReport>,
    /// Labels of markers that sit still on no segment.
    pub ignored: Vec<String>,
    /// Lengths between joints.
    pub bones: Vec<Bone>,
    /// Root mean square distance of measured markers from where the skeleton carries them, metres,
    /// without faults.
    pub residual: f64,
    /// Samples farther than [`FAULT`] from there: exchanged or mistaken markers.
    pub faults: usize,
    /// Subject over template, where labels were understood.
    pub scale: f64,
    /// Frames that showed too little and took over their neighbours' pose.
    pub held_frames: usize,
}

/// A marker on the skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerReport {
    /// Its label.
    pub label: String,
    /// Index of the joint that carries it.
    pub joint: usize,
    /// Where it sits, relative to the joint, metres.
    pub offset: DVec3,
    /// Frames in which it was measured.
    pub seen: usize,
    /// Those in which it was farther than [`FAULT`] from its place.
    pub faults: usize,
    /// Root mean square distance from its place in the others, metres.
    pub rms: f64,
    /// Largest distance, metres, and its frame.
    pub worst: (f64, usize),
}

/// A bone from a joint to its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Bone {
    /// Index of the joint at its end.
    pub joint: usize,
    /// Metres.
    pub length: f64,
    /// The same bone on the other side: index of its joint, and how much longer this one is, as a
    /// share of their mean.
    pub other: Option<(usize, f64)>,
    /// Whether markers beyond the joint show it; else its length is the template's, scaled.
    pub seen: bool,
}

pub(super) fn report(
    take: &Take,
    name: &str,
    body: &Body,
    poses: &[Pose],
    by_labels: bool,
    held_frames: usize,
    ignored: &[usize],
) -> Solved {
    let mut markers: Vec<MarkerReport> = body
        .markers
        .iter()
        .map(|marker| MarkerReport {
            label: take.labels()[marker.column].clone(),
            joint: marker.segment,
            offset: marker.offset,
            seen: 0,
            faults: 0,
            rms: 0.0,
            worst: (0.0, 0),
        })
        .collect();
    for (frame, pose) in poses.iter().enumerate() {
        let placed = body.place(pose);
        for (report, marker) in markers.iter_mut().zip(&body.markers) {
            if let Some(at) = take.position(marker.column, frame) {
                let away = at.distance(body.marker(marker, &placed));
                report.seen += 1;
                if away > FAULT {
                    report.faults += 1;
                } else {
                    report.rms += away * away;
                }
                if away > report.worst.0 {
                    report.worst = (away, frame);
                }
            }
        }
    }
    let sum: f64 = markers.iter().map(|marker| marker.rms).sum();
    let faults: usize = markers.iter().map(|marker| marker.faults).sum();
    let seen: usize = markers.iter().map(|marker| marker.seen).sum();
    let count = seen - faults;
    for marker in &mut markers {
        let sound = (marker.seen - marker.faults).max(1);
        marker.rms = (marker.rms / sound as f64).sqrt();
    }
    Solved {
        motion: motion(take, name, body, poses),
        by_labels,
        markers,
        ignored: ignored
            .iter()
            .map(|&column| take.labels()[column].clone())
            .collect(),
        bones: bones(body),
        residual: (sum / count.max(1) as f64).sqrt(),
        faults,
        scale: body.scale,
        held_frames,
    }
}

fn bones(body: &Body) -> Vec<Bone> {
    let seen = body.seen();
    let length = |at: usize| body.segments[at].offset.length();
    let of = |joint: usize| {
        let segment = &body.segments[joint];
        let parent = segment.parent?;
        let other = segment.mirror.map(|mirror| {
            let mean = (length(joint) + length(mirror)) / 2.0;
            (mirror, (length(joint) - length(mirror)) / mean)
        });
        Some(Bone {
            joint,
            length: length(joint),
            other,
            seen: seen[parent] && seen[joint],
        })
    };
    (0..body.segments.len()).filter_map(of).collect()
}

fn motion(take: &Take, name: &str, body: &Body, poses: &[Pose]) -> Motion {
    let joints = body.segments.iter().map(|segment| Joint {
        name: segment.name.clone(),
        parent: segment.parent,
        rest: Transform {
            translation: segment.offset * f64::from(u8::from(segment.parent.is_some())),
            ..Transform::IDENTITY
        },
    });
    let times: Vec<f64> = (0..poses.len()).map(|frame| take.seconds(frame)).collect();
    let track = |joint, channel, values| Track {
        joint,
        channel,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values,
    };
    let places = poses.iter().map(|pose| pose.root.extend(0.0).to_array());
    let mut tracks = vec![track(0, Channel::Translation, places.collect())];
    for joint in 0..body.segments.len() {
        let mut last = DQuat::IDENTITY;
        let turns = poses.iter().map(|pose| {
            let turn = pose.turns[joint];
            last = if turn.dot(last) < 0.0 { -turn } else { turn };
            last.to_array()
        });
        tracks.push(track(joint, Channel::Rotation, turns.collect()));
    }
    let followed = |joint: usize| body.segments.iter().any(|s| s.parent == Some(joint));
    let end_sites = body.segments.iter().enumerate();
    let end_sites = end_sites.filter(|(joint, _)| !followed(*joint));
    Motion {
        skeleton: Skeleton {
            joints: joints.collect(),
        },
        end_sites: end_sites
            .filter_map(|(joint, segment)| Some((joint, body.scale * segment.end?)))
            .collect(),
        clip: Clip {
            name: name.to_owned(),
            tracks,
            morph_track: None,
            duration: take.seconds(poses.len().saturating_sub(1)),
            sample_period: Some(1.0 / take.rate()),
        },
    }
}
