//! Moving templates: what a scan is to follow (de Aguiar et al. 2007, sections 3.1 and 4).
//!
//! In: a captured skeleton, a skinned body with a clip, marker trajectories, or the frames of a
//! moving mesh or point cloud. Out: points that move, with the rotation of what carries them where
//! it is known. There is no requirement on shape or connectivity.

mod bones;
mod stances;

use std::ops::Range;

use glam::{DAffine3, DQuat, DVec3};

use super::LaplaceError;
use super::graph::Graph;
use super::rotations::fit_rotation;
use crate::model::{Avatar, Clip, Motion, Transform, nearest_rotation};
use crate::reference::pose;
use crate::take::Take;

/// Points that move.
#[derive(Clone, Debug)]
pub struct Template {
    /// `[points]`: what a person calls each.
    pub labels: Vec<String>,
    /// Point indices; empty for point clouds and markers.
    pub triangles: Vec<[u32; 3]>,
    /// `[points]`, or empty: at rest, away from the middle of the limb that carries the point.
    pub outward: Vec<DVec3>,
    /// Frames a second.
    pub rate: f64,
    points: Points,
}

/// How points move.
#[derive(Clone, Debug)]
enum Points {
    /// With joints.
    Carried {
        /// `[points]`, metres.
        rest: Vec<DVec3>,
        /// `[points]`: (carrier, weight).
        influences: Vec<Vec<(u32, f64)>>,
        /// `[frames][carriers]`: from the rest pose. The rest pose itself comes first, poses that
        /// scans stand in last.
        frames: Vec<Vec<DAffine3>>,
        /// How many of them are such poses.
        stances: usize,
    },
    /// On their own: `[frames][points]`, metres.
    Free(Vec<Vec<DVec3>>),
}

impl Template {
    /// The bones of a captured motion as triangle meshes (section 4.1). Frame 0 is the skeleton's
    /// rest pose; behind the motion come poses that scans stand in. O(frames x joints)
    #[must_use]
    pub fn of_motion(motion: &Motion) -> Self {
        let bones = bones::of(&motion.skeleton, &motion.end_sites);
        let rest = motion.skeleton.model(&motion.skeleton.rest());
        let inverse: Vec<DAffine3> = rest.iter().map(DAffine3::inverse).collect();
        let mut frames = vec![vec![DAffine3::IDENTITY; rest.len()]];
        let moved = |local: &[Transform]| {
            let model = motion.skeleton.model(local);
            model.iter().zip(&inverse).map(|(m, i)| *m * *i).collect()
        };
        for time in times(&motion.clip) {
            frames.push(moved(&pose::sample(&motion.skeleton, &motion.clip, time)));
        }
        let stances = stances::of(&motion.skeleton);
        frames.extend(stances.iter().map(|local| moved(local)));
        Self {
            labels: bones.labels,
            triangles: bones.triangles,
            outward: bones.outward,
            rate: rate(&motion.clip),
            points: Points::Carried {
                rest: bones.points,
                influences: bones.joints.iter().map(|&j| vec![(j, 1.0)]).collect(),
                frames,
                stances: stances.len(),
            },
        }
    }

    /// The surface of a skinned body in a clip. Frame 0 is its rest pose; behind the motion come
    /// poses that scans stand in. O(frames x joints)
    #[must_use]
    pub fn of_body(body: &Avatar, clip: &Clip) -> Self {
        let binds = &body.skin.binds;
        let palette = |local: &[Transform]| {
            let model = body.skeleton.model(local);
            let matrix = |bind: &crate::model::Bind| model[bind.joint] * bind.inverse_bind;
            binds.iter().map(matrix).collect::<Vec<_>>()
        };
        let mut frames = vec![palette(&body.skeleton.rest())];
        for time in times(clip) {
            frames.push(palette(&pose::sample(&body.skeleton, clip, time)));
        }
        let stances = stances::of(&body.skeleton);
        frames.extend(stances.iter().map(|local| palette(local)));
        Self {
            labels: numbered(body.mesh.positions.len()),
            triangles: body.mesh.triangles.clone(),
            outward: body.mesh.normals.clone(),
            rate: rate(clip),
            points: Points::Carried {
                rest: body.mesh.positions.clone(),
                influences: body.skin.influences.clone(),
                frames,
                stances: stances.len(),
            },
        }
    }

    /// Captured markers, which must be complete: fill gaps first. O(frames x markers)
    ///
    /// # Errors
    /// [`LaplaceError::Gap`].
    pub fn of_take(take: &Take) -> Result<Self, LaplaceError> {
        for (marker, label) in take.labels().iter().enumerate() {
            if let Some(gap) = take.gaps(marker).next() {
                return Err(LaplaceError::Gap {
                    marker: label.clone(),
                    frame: gap.start,
                });
            }
        }
        let frame = |frame: usize| take.seen(frame).map(|(_, position)| position).collect();
        let frames = (0..take.frame_count()).map(frame).collect();
        Self::of_frames(frames, Vec::new(), take.labels().to_vec(), take.rate())
    }

    /// The frames of a moving mesh or, without triangles, a moving point cloud:
    /// `frames` `[frames][points]` in metres. `labels`: `[points]`, or empty for numbers.
    ///
    /// # Errors
    /// [`LaplaceError::NoTemplate`] without points or frames or with a frame of another length,
    /// [`LaplaceError::BadTriangle`], [`LaplaceError::BadPosition`].
    pub fn of_frames(
        frames: Vec<Vec<DVec3>>,
        triangles: Vec<[u32; 3]>,
        labels: Vec<String>,
        rate: f64,
    ) -> Result<Self, LaplaceError> {
        let count = frames.first().map_or(0, Vec::len);
        if count == 0 || frames.iter().any(|frame| frame.len() != count) {
            return Err(LaplaceError::NoTemplate);
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(LaplaceError::BadTriangle {
                    triangle,
                    vertex,
                    count,
                });
            }
        }
        for frame in &frames {
            if let Some(vertex) = frame.iter().position(|p| !p.is_finite()) {
                let position = frame[vertex];
                return Err(LaplaceError::BadPosition { vertex, position });
            }
        }
        Ok(Self {
            labels: if labels.len() == count {
                labels
            } else {
                numbered(count)
            },
            triangles,
            outward: Vec::new(),
            rate,
            points: Points::Free(frames),
        })
    }

    /// Number of points.
    #[must_use]
    pub fn point_count(&self) -> usize {
        self.labels.len()
    }

    /// Number of frames, with those that are not part of the motion.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        match &self.points {
            Points::Carried { frames, .. } => frames.len(),
            Points::Free(frames) => frames.len(),
        }
    }

    /// The frames of the motion: without a rest pose and poses that scans stand in.
    #[must_use]
    pub fn motion(&self) -> Range<usize> {
        match &self.points {
            Points::Carried {
                frames, stances, ..
            } => {
                let end = frames.len() - stances;
                usize::from(end > 1)..end
            }
            Points::Free(frames) => 0..frames.len(),
        }
    }

    /// Whether rotations come with the points.
    #[must_use]
    pub fn has_rotations(&self) -> bool {
        matches!(self.points, Points::Carried { .. }) || !self.triangles.is_empty()
    }

    /// Positions of some points in a frame, metres. O(points)
    ///
    /// # Panics
    /// Where a point or the frame does not exist.
    #[must_use]
    pub fn positions(&self, points: &[u32], frame: usize) -> Vec<DVec3> {
        let at = |&point: &u32| match &self.points {
            Points::Free(frames) => frames[frame][point as usize],
            Points::Carried {
                rest,
                influences,
                frames,
                ..
            } => {
                let (rest, influences) = (rest[point as usize], &influences[point as usize]);
                let carried = influences.iter().map(|&(carrier, weight)| {
                    weight * frames[frame][carrier as usize].transform_point3(rest)
                });
                carried.sum()
            }
        };
        points.iter().map(at).collect()
    }

    /// How some points have turned since the rest pose or, for a mesh, since `reference`; none
    /// for points without triangles. O(points)
    ///
    /// # Panics
    /// Where a point or a frame does not exist.
    #[must_use]
    pub fn rotations(&self, points: &[u32], reference: usize, frame: usize) -> Option<Vec<DQuat>> {
        match &self.points {
            Points::Carried {
                influences, frames, ..
            } => {
                let now = turns(&frames[frame], &frames[reference]);
                let blend = |&point: &u32| blend(&influences[point as usize], &now);
                Some(points.iter().map(blend).collect())
            }
            Points::Free(_) if self.triangles.is_empty() => None,
            Points::Free(frames) => {
                let graph = Graph::new(&frames[reference], &self.triangles);
                let (rest, posed) = (&frames[reference], &frames[frame]);
                let turn = |&point: &u32| {
                    let at = point as usize;
                    let edges = graph.row(point).iter().map(|&(other, _)| {
                        let other = other as usize;
                        (rest[other] - rest[at], posed[other] - posed[at], 1.0)
                    });
                    fit_rotation(edges)
                };
                Some(points.iter().map(turn).collect())
            }
        }
    }
}

/// Rotation of each carrier between two frames.
fn turns(now: &[DAffine3], then: &[DAffine3]) -> Vec<DQuat> {
    let turn = |(now, then): (&DAffine3, &DAffine3)| {
        nearest_rotation(&now.matrix3) * nearest_rotation(&then.matrix3).inverse()
    };
    now.iter().zip(then).map(turn).collect()
}

/// Weighted sum of quaternions on the side of the heaviest.
fn blend(influences: &[(u32, f64)], turns: &[DQuat]) -> DQuat {
    let first = influences
        .first()
        .map_or(DQuat::IDENTITY, |i| turns[i.0 as usize]);
    let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    for &(carrier, weight) in influences {
        let turn = turns[carrier as usize];
        sum += if turn.dot(first) < 0.0 { -turn } else { turn } * weight;
    }
    if sum.length_squared() > 1e-12 {
        sum.normalize()
    } else {
        first
    }
}

fn numbered(count: usize) -> Vec<String> {
    (0..count).map(|point| format!("v{point}")).collect()
}

/// Frames a second where a clip does not say.
const DEFAULT_RATE: f64 = 60.0;

fn rate(clip: &Clip) -> f64 {
    let period = clip.sample_period.filter(|&period| period > 0.0);
    period.map_or(DEFAULT_RATE, f64::recip)
}

fn times(clip: &Clip) -> Vec<f64> {
    crate::play::frame_times(clip.duration, rate(clip))
}
