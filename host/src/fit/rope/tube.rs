//! A rope as a tube that a skin moves: any engine, and the asset's own kernel, can play it.
//!
//! One joint a marker. The tube's weights are the natural cubic B-spline's basis over the joints:
//! four at most, never negative, with two continuous derivatives, so the tube is a swept spline
//! although linear blend skinning moves it. Each joint carries a straight piece of rope; blended,
//! the pieces would cut the corners, so the joints stand where the blend passes through the
//! markers ([`Spline::joints`], a tridiagonal system).

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};

use super::Trace;
use crate::model::{
    Avatar, Bind, Channel, Clip, Joint, Mesh, Part, Skeleton, Skin, Track, Transform,
};

#[cfg(test)]
mod tests;

/// How a tube looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeOptions {
    /// Metres.
    pub radius: f64,
    /// Vertices around the tube.
    pub sides: usize,
    /// Rings between two markers.
    pub rings: usize,
    /// Metres of rope beyond the first and the last marker.
    pub overhang: [f64; 2],
}

impl Default for TubeOptions {
    fn default() -> Self {
        Self {
            radius: 0.006,
            sides: 8,
            rings: 4,
            overhang: [0.0; 2],
        }
    }
}

/// A curve through a rope's markers in one frame.
#[derive(Clone, Debug)]
pub struct Spline {
    /// `[markers]`: metres along the rope, the same in every frame.
    arc: Vec<f64>,
}

/// Joints of a rope in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RopePose {
    /// `[markers]`, metres.
    pub positions: Vec<DVec3>,
    /// `[markers]`: the bind pose's X onto the rope's direction, without twist along the rope.
    pub rotations: Vec<DQuat>,
}

/// Weights of the natural cubic B-spline at `u` between joints `segment` and `segment + 1`:
/// joints `segment - 1` to `segment + 2`; a joint beyond an end is the end's mirror image.
fn basis(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    [
        v * v * v / 6.0,
        (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
        (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
        u * u * u / 6.0,
    ]
}

/// (joint, weight) at `u` in `segment` of a rope of `count` joints; the weights sum to one.
fn weights(count: usize, segment: usize, u: f64) -> Vec<(usize, f64)> {
    let mut sums = vec![0.0; 4];
    let first = segment.saturating_sub(1);
    let mut add = |joint: i64, weight: f64| sums[(joint - first as i64) as usize] += weight;
    for (k, weight) in basis(u).into_iter().enumerate() {
        let joint = segment as i64 + k as i64 - 1;
        let last = count as i64 - 1;
        // Beyond an end: twice the end, minus the one before.
        if joint < 0 {
            add(0, 2.0 * weight);
            add(1, -weight);
        } else if joint > last {
            add(last, 2.0 * weight);
            add(last - 1, -weight);
        } else {
            add(joint, weight);
        }
    }
    let sums = sums.into_iter().enumerate();
    sums.map(|(k, weight)| (first + k, weight))
        .filter(|(_, weight)| *weight > 1e-12)
        .collect()
}

impl Spline {
    /// A curve for ropes with these distances between markers, metres.
    #[must_use]
    pub fn new(lengths: &[f64]) -> Self {
        let known: Vec<f64> = lengths.iter().copied().filter(|l| *l > 0.0).collect();
        let usual = if known.is_empty() {
            0.1
        } else {
            super::median(known)
        };
        let mut arc = vec![0.0];
        for length in lengths {
            let step = if *length > 0.0 { *length } else { usual };
            arc.push(arc[arc.len() - 1] + step);
        }
        Self { arc }
    }

    fn count(&self) -> usize {
        self.arc.len()
    }

    /// Unit directions of the rope at its markers: central differences over the arc.
    fn tangents(&self, markers: &[DVec3]) -> Vec<DVec3> {
        let last = self.count() - 1;
        let mut tangents = Vec::with_capacity(self.count());
        for i in 0..=last {
            let chord = |a: usize, b: usize| {
                let span = (self.arc[b] - self.arc[a]).max(1e-9);
                (markers[b] - markers[a]) / span
            };
            let tangent = if i == 0 {
                // The parabola through the first three.
                if last > 1 {
                    2.0 * chord(0, 1) - chord(0, 2)
                } else {
                    chord(0, 1)
                }
            } else if i == last {
                if last > 1 {
                    2.0 * chord(last - 1, last) - chord(last - 2, last)
                } else {
                    chord(last - 1, last)
                }
            } else {
                let (left, right) = (chord(i - 1, i), chord(i, i + 1));
                let (a, b) = (self.arc[i] - self.arc[i - 1], self.arc[i + 1] - self.arc[i]);
                (left * b + right * a) / (a + b)
            };
            let before = tangents.last().copied().unwrap_or(DVec3::X);
            tangents.push(tangent.normalize_or(before));
        }
        tangents
    }

    /// Where joints must stand so that the blended tube passes through `markers`, and how they are
    /// turned. `before` is the frame before, which the first joint's twist continues. O(markers)
    #[must_use]
    pub fn joints(&self, markers: &[DVec3], before: Option<&RopePose>) -> RopePose {
        let tangents = self.tangents(markers);
        let last = self.count() - 1;
        // At marker i the blend is (q[i-1] + 4 q[i] + q[i+1]) / 6, where a neighbour stands for
        // itself and the straight piece from it to the marker. The ends are met by themselves.
        let mut positions = markers.to_vec();
        let mut factors = vec![0.0; last + 1];
        for i in 1..last {
            let back = tangents[i - 1] * (self.arc[i] - self.arc[i - 1]);
            let ahead = tangents[i + 1] * (self.arc[i + 1] - self.arc[i]);
            let right = 6.0 * markers[i] - back + ahead;
            let pivot = 1.0 / (4.0 - factors[i - 1]);
            factors[i] = pivot;
            positions[i] = (right - positions[i - 1]) * pivot;
        }
        for i in (1..last).rev() {
            let after = positions[i + 1];
            positions[i] -= after * factors[i];
        }
        let start = before.map_or(DQuat::IDENTITY, |pose| pose.rotations[0]);
        let mut rotations = Vec::with_capacity(last + 1);
        let mut turn = start;
        for tangent in tangents {
            turn = (DQuat::from_rotation_arc(turn * DVec3::X, tangent) * turn).normalize();
            rotations.push(turn);
        }
        RopePose {
            positions,
            rotations,
        }
    }
}

/// A rope as a body of its own: a straight tube along X in the bind pose, a joint a marker, one
/// clip. O(frames x markers + vertices)
///
/// The rest pose is the first frame.
#[must_use]
pub fn tube(trace: &Trace, name: &str, options: &TubeOptions) -> Option<Avatar> {
    if trace.marker_count() < 3 || trace.frames.is_empty() {
        return None;
    }
    let spline = Spline::new(&trace.segment_lengths());
    let mut poses: Vec<RopePose> = Vec::with_capacity(trace.frames.len());
    for frame in &trace.frames {
        let markers: Vec<DVec3> = frame.iter().map(|sample| sample.position).collect();
        let pose = spline.joints(&markers, poses.last());
        poses.push(pose);
    }
    let (mesh, influences) = surface(&spline, name, options);
    let root = Joint {
        name: name.to_owned(),
        parent: None,
        rest: Transform::IDENTITY,
    };
    let width = spline.count().to_string().len().max(2);
    let joints = (0..spline.count()).map(|i| Joint {
        name: format!("{name}_{:0width$}", i + 1),
        parent: Some(0),
        rest: Transform {
            translation: poses[0].positions[i],
            rotation: poses[0].rotations[i],
            ..Transform::IDENTITY
        },
    });
    let skeleton = Skeleton {
        joints: std::iter::once(root).chain(joints).collect(),
    };
    let binds = spline.arc.iter().enumerate().map(|(i, arc)| Bind {
        joint: i + 1,
        inverse_bind: DAffine3::from_translation(-DVec3::X * *arc),
    });
    let skin = Skin {
        binds: binds.collect(),
        influences,
    };
    let clips = vec![clip(&poses, trace.rate, name)];
    Some(Avatar {
        mesh,
        skeleton,
        skin,
        clips,
    })
}

fn clip(poses: &[RopePose], rate: f64, name: &str) -> Clip {
    let times: Vec<f64> = (0..poses.len()).map(|frame| frame as f64 / rate).collect();
    let mut tracks = Vec::new();
    for i in 0..poses[0].positions.len() {
        let mut track = |channel, values: Vec<[f64; 4]>| {
            tracks.push(Track::linear(i + 1, channel, &times, values));
        };
        let places = poses
            .iter()
            .map(|pose| pose.positions[i].extend(0.0).to_array());
        track(Channel::Translation, places.collect());
        let turns = poses.iter().map(|pose| pose.rotations[i].to_array());
        track(Channel::Rotation, turns.collect());
    }
    tracks.sort_by_key(|track| (track.joint, track.channel));
    Clip {
        name: name.to_owned(),
        tracks,
        morph_track: None,
        duration: times[times.len() - 1],
        sample_period: Some(1.0 / rate),
    }
}

/// The straight tube with round ends, and each vertex' (bind, weight).
fn surface(spline: &Spline, name: &str, options: &TubeOptions) -> (Mesh, Vec<Vec<(u32, f64)>>) {
    let count = spline.count();
    let (sides, rings) = (options.sides.max(3), options.rings.max(1));
    let total = spline.arc[count - 1];
    // Places along the rope: (metres, segment, share of it).
    let mut places = Vec::new();
    if options.overhang[0] > 0.0 {
        places.push((-options.overhang[0], 0, 0.0));
    }
    for segment in 0..count - 1 {
        for ring in 0..rings {
            let u = ring as f64 / rings as f64;
            let (a, b) = (spline.arc[segment], spline.arc[segment + 1]);
            places.push((a + u * (b - a), segment, u));
        }
    }
    places.push((total, count - 2, 1.0));
    if options.overhang[1] > 0.0 {
        places.push((total + options.overhang[1], count - 2, 1.0));
    }
    let mut mesh = Mesh {
        name: name.to_owned(),
        positions: Vec::new(),
        normals: Vec::new(),
        tangents: None,
        texcoords: None,
        triangles: Vec::new(),
        parts: Vec::new(),
        morphs: Vec::new(),
    };
    let mut influences = Vec::new();
    let mut vertex = |position: DVec3, normal: DVec3, segment: usize, u: f64| {
        mesh.positions.push(position);
        mesh.normals.push(normal);
        let mut list: Vec<(u32, f64)> = weights(count, segment, u)
            .into_iter()
            .map(|(joint, weight)| (joint as u32, weight))
            .collect();
        list.sort_by(|a, b| b.1.total_cmp(&a.1));
        influences.push(list);
    };
    for &(x, segment, u) in &places {
        for side in 0..sides {
            let angle = TAU * side as f64 / sides as f64;
            let out = DVec3::new(0.0, angle.cos(), angle.sin());
            vertex(DVec3::X * x + out * options.radius, out, segment, u);
        }
    }
    // A point beyond each end closes it.
    let (first, last) = (places[0], places[places.len() - 1]);
    let tip = 0.7 * options.radius;
    vertex(DVec3::X * (first.0 - tip), DVec3::NEG_X, first.1, first.2);
    vertex(DVec3::X * (last.0 + tip), DVec3::X, last.1, last.2);
    let at = |ring: usize, side: usize| (ring * sides + side % sides) as u32;
    for ring in 0..places.len() - 1 {
        for side in 0..sides {
            let (a, b) = (at(ring, side), at(ring, side + 1));
            let (c, d) = (at(ring + 1, side), at(ring + 1, side + 1));
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    let start_tip = (places.len() * sides) as u32;
    for side in 0..sides {
        mesh.triangles
            .push([start_tip, at(0, side + 1), at(0, side)]);
        let end = places.len() - 1;
        mesh.triangles
            .push([start_tip + 1, at(end, side), at(end, side + 1)]);
    }
    mesh.parts.push(Part {
        name: name.to_owned(),
        triangles: 0..mesh.triangles.len(),
    });
    (mesh, influences)
}

/// A body with a rope beside it: one mesh, one skeleton, one skin; the rope's clip joins the
/// body's clip `clip`, and starts with it. O(vertices + keys)
#[must_use]
pub fn beside(body: &Avatar, clip: usize, rope: &Avatar) -> Avatar {
    let mut whole = body.clone();
    let first_vertex = body.mesh.positions.len() as u32;
    let (joints, binds) = (body.skeleton.joints.len(), body.skin.binds.len() as u32);
    let count = rope.mesh.positions.len();
    whole.mesh.positions.extend(&rope.mesh.positions);
    whole.mesh.normals.extend(&rope.mesh.normals);
    if let Some(tangents) = &mut whole.mesh.tangents {
        tangents.extend(std::iter::repeat_n([1.0, 0.0, 0.0, 1.0], count));
    }
    if let Some(texcoords) = &mut whole.mesh.texcoords {
        texcoords.extend(std::iter::repeat_n([0.0; 2], count));
    }
    for morph in &mut whole.mesh.morphs {
        let length = morph.positions.len() + count;
        morph.positions.resize(length, DVec3::ZERO);
        if !morph.normals.is_empty() {
            morph.normals.resize(length, DVec3::ZERO);
        }
    }
    let triangles = whole.mesh.triangles.len();
    let moved = rope.mesh.triangles.iter();
    whole
        .mesh
        .triangles
        .extend(moved.map(|t| t.map(|corner| corner + first_vertex)));
    whole
        .mesh
        .parts
        .extend(rope.mesh.parts.iter().map(|part| Part {
            name: part.name.clone(),
            triangles: part.triangles.start + triangles..part.triangles.end + triangles,
        }));
    whole
        .skeleton
        .joints
        .extend(rope.skeleton.joints.iter().map(|joint| Joint {
            name: unused(&joint.name, &body.skeleton),
            parent: joint.parent.map(|parent| parent + joints),
            rest: joint.rest,
        }));
    whole
        .skin
        .binds
        .extend(rope.skin.binds.iter().map(|bind| Bind {
            joint: bind.joint + joints,
            inverse_bind: bind.inverse_bind,
        }));
    let moved = rope.skin.influences.iter();
    let moved = moved.map(|list| list.iter().map(|(bind, w)| (bind + binds, *w)).collect());
    whole.skin.influences.extend(moved);
    if let Some(motion) = rope.clips.first() {
        let tracks = motion.tracks.iter().map(|track| Track {
            joint: track.joint + joints,
            ..track.clone()
        });
        match whole.clips.get_mut(clip) {
            Some(own) => {
                own.tracks.extend(tracks);
                own.duration = own.duration.max(motion.duration);
            }
            None => whole.clips.push(Clip {
                tracks: tracks.collect(),
                ..motion.clone()
            }),
        }
    }
    whole
}

/// A joint name that the skeleton does not have.
fn unused(name: &str, skeleton: &Skeleton) -> String {
    let mut name = name.to_owned();
    while skeleton.find(&name).is_some() {
        name.push('_');
    }
    name
}
