//! Captures as marker takes and files.

use std::collections::VecDeque;
use std::path::Path;

use glam::DVec3;
use serde_json::{Value, json};

use super::body::{Body, Surface};
use super::capture::{Capture, Shot, Statistics};
use super::markers::MarkerSet;
use crate::export::c3d::write_c3d;
use crate::export::{ExportError, NpyWriter, write_atomic};
use crate::import::take::LengthUnit;
use crate::take::{Take, TakeError};

/// A run of samples of one marker within a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Frame of the first sample, from 0.
    pub first_frame: usize,
    /// Samples.
    pub frame_count: usize,
    /// Whose points they are; `None` for a ghost.
    pub marker: Option<u32>,
}

/// A trajectory of a capture with its truth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trajectory {
    /// Column that holds it in [`Capture::take`].
    pub column: usize,
    /// One for each marker that it followed, without frames between them.
    pub spans: Vec<Span>,
}

impl Capture {
    /// `[trajectories]`: where each lies, and whose points it holds. O(samples)
    ///
    /// Trajectories share columns, or a long take would have a column for each of a hundred
    /// thousand; at least one missing sample lies between two, and the column that has been free
    /// longest comes next, so that a column says nothing about markers.
    #[must_use]
    pub fn trajectories(&self) -> Vec<Trajectory> {
        let mut out: Vec<Option<Trajectory>> = vec![None; self.trajectory_count()];
        let mut free: VecDeque<(usize, usize)> = VecDeque::new();
        let mut column_count = 0;
        let mut alive: Vec<u32> = Vec::new();
        for (frame, samples) in self.frames.iter().enumerate() {
            let now: Vec<u32> = samples.iter().map(|sample| sample.trajectory).collect();
            for id in alive.iter().filter(|id| now.binary_search(id).is_err()) {
                let column = out[*id as usize].as_ref().map_or(0, |one| one.column);
                free.push_back((frame + 1, column));
            }
            for (id, owner) in now.iter().zip(&self.truth.owners[frame]) {
                let one = out[*id as usize].get_or_insert_with(|| {
                    let column = match free.front() {
                        Some(&(from, column)) if from <= frame => {
                            free.pop_front();
                            column
                        }
                        _ => {
                            column_count += 1;
                            column_count - 1
                        }
                    };
                    Trajectory {
                        column,
                        spans: Vec::new(),
                    }
                });
                match one.spans.last_mut() {
                    Some(span) if span.marker == *owner => span.frame_count += 1,
                    _ => one.spans.push(Span {
                        first_frame: frame,
                        frame_count: 1,
                        marker: *owner,
                    }),
                }
            }
            alive = now;
        }
        out.into_iter().flatten().collect()
    }

    /// The broken, unlabelled capture; columns `*1`, `*2` and so on, in which every gap ends a
    /// trajectory ([`Self::trajectories`]). O(frames x columns)
    ///
    /// # Errors
    /// Never for a capture that was filmed: its numbers are finite.
    pub fn take(&self) -> Result<Take, TakeError> {
        let trajectories = self.trajectories();
        let columns = trajectories
            .iter()
            .map(|one| one.column + 1)
            .max()
            .unwrap_or(0);
        let frame_count = self.frames.len();
        let mut positions = vec![DVec3::NAN; columns * frame_count];
        for (frame, samples) in self.frames.iter().enumerate() {
            for sample in samples {
                let column = trajectories[sample.trajectory as usize].column;
                positions[column * frame_count + frame] = sample.position;
            }
        }
        let labels = (1..=columns).map(|column| format!("*{column}")).collect();
        Take::new(labels, self.rate, frame_count, positions)
    }

    /// The measured points under their true names, with gaps where nothing was measured.
    ///
    /// # Errors
    /// Never for a capture that was filmed.
    pub fn labelled_take(&self) -> Result<Take, TakeError> {
        let rows = self.labelled();
        self.named(|frame, marker| rows[frame][marker].unwrap_or(DVec3::NAN))
    }

    /// Where every marker really was.
    ///
    /// # Errors
    /// Never for a capture that was filmed.
    pub fn truth_take(&self) -> Result<Take, TakeError> {
        self.named(|frame, marker| self.truth.positions[frame][marker])
    }

    fn named(&self, at: impl Fn(usize, usize) -> DVec3) -> Result<Take, TakeError> {
        let (names, frame_count) = (&self.truth.names, self.frames.len());
        let all = (0..names.len()).flat_map(|marker| (0..frame_count).map(move |f| (f, marker)));
        let positions = all.map(|(frame, marker)| at(frame, marker)).collect();
        Take::new(names.clone(), self.rate, frame_count, positions)
    }

    /// Everything but the points: settings, cameras, markers, statistics and whose points each
    /// trajectory holds. Frames count from 0, columns from 0.
    #[must_use]
    pub fn describe(&self, body: &Body<'_>, markers: &MarkerSet, shot: &Shot) -> Value {
        let vector = |v: DVec3| json!(v.to_array());
        let cameras: Vec<Value> = self
            .cameras
            .iter()
            .map(|camera| {
                json!({
                    "position": vector(camera.position),
                    "right": vector(camera.axes[0]),
                    "up": vector(camera.axes[1]),
                    "forward": vector(camera.axes[2]),
                    "resolution": camera.resolution,
                    "focal_px": camera.focal,
                })
            })
            .collect();
        let glued: Vec<Value> = markers
            .markers
            .iter()
            .map(|marker| {
                json!({
                    "name": marker.name,
                    "triangle": marker.triangle,
                    "vertices": marker.vertices,
                    "barycentric": marker.barycentric,
                })
            })
            .collect();
        let trajectories: Vec<Value> = self
            .trajectories()
            .iter()
            .map(|one| {
                let span = |s: &Span| json!([s.first_frame, s.frame_count, s.marker]);
                json!({
                    "column": one.column,
                    "spans": one.spans.iter().map(span).collect::<Vec<_>>(),
                })
            })
            .collect();
        let flesh = body.scene().flesh;
        let sight = shot.sight;
        json!({
            "unit": "m",
            "up": "+Y",
            "rate_hz": self.rate,
            "seed": shot.seed,
            "statistics": self.statistics().to_json(),
            "noise_m": shot.noise,
            "start_cameras": shot.start_cameras,
            "keep_cameras": shot.keep_cameras,
            "ghosts_per_second": shot.ghosts_per_second,
            "swap_chance": shot.swap_chance,
            "sight": {
                "marker_diameter_m": sight.marker_diameter,
                "facing_limit_rad": sight.facing_limit,
                "facing_spread_rad": sight.facing_spread,
                "miss": sight.miss,
                "exposure_s": sight.exposure,
                "blur_px": sight.blur,
            },
            "flesh": {
                "muscle": flesh.muscle,
                "breath": flesh.breath,
                "jiggle": flesh.jiggle,
                "breath_rate_hz": flesh.breath_rate,
                "limit_m": flesh.limit,
                "seed": flesh.seed,
                "modes": body.flesh().modes().iter().map(|mode| &mode.name).collect::<Vec<_>>(),
            },
            "treadmill": body.performance().is_on_treadmill(),
            "cameras": cameras,
            "markers": glued,
            "trajectories": { "span": ["first_frame", "frame_count", "marker"], "all": trajectories },
        })
    }
}

/// Why a description of a capture cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// It is no JSON.
    #[error("no JSON: {0}; give the studio.json that `sinew studio` wrote")]
    Json(#[from] serde_json::Error),
    /// It is no description of a capture.
    #[error(
        "trajectories.all, entry {0}, is not {{column, spans}}; give the studio.json that `sinew studio` wrote"
    )]
    Trajectory(usize),
}

/// Reads the trajectories of a [`Capture::describe`]d capture.
///
/// # Errors
/// Other bytes.
pub fn read_trajectories(bytes: &[u8]) -> Result<Vec<Trajectory>, DescriptionError> {
    let value: Value = serde_json::from_slice(bytes)?;
    let all = value["trajectories"]["all"].as_array();
    let all = all.ok_or(DescriptionError::Trajectory(0))?;
    let number = |value: &Value| value.as_u64().and_then(|at| usize::try_from(at).ok());
    let span = |value: &Value| {
        Some(Span {
            first_frame: number(&value[0])?,
            frame_count: number(&value[1])?,
            marker: match &value[2] {
                Value::Null => None,
                marker => Some(u32::try_from(number(marker)?).ok()?),
            },
        })
    };
    let trajectory = |value: &Value| {
        Some(Trajectory {
            column: number(&value["column"])?,
            spans: value["spans"]
                .as_array()?
                .iter()
                .map(span)
                .collect::<Option<_>>()?,
        })
    };
    let each = all.iter().enumerate();
    each.map(|(at, value)| trajectory(value).ok_or(DescriptionError::Trajectory(at)))
        .collect()
}

impl Statistics {
    /// The same as an object.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "frames": self.frame_count,
            "markers": self.marker_count,
            "trajectories": self.trajectory_count,
            "ghosts": self.ghost_count,
            "swaps": self.swap_count,
            "missing_samples": self.missing_count,
            "missing_fraction": self.missing_fraction,
            "gaps": self.gap_count,
            "mean_gap_frames": self.mean_gap,
            "longest_gap_frames": self.longest_gap,
            "complete_frames": self.complete_frame_count,
            "missing_in_first_frame": self.missing_at_start,
        })
    }
}

/// Writes a take as C3D in millimetres.
///
/// # Errors
/// The take does not fit into the format, or the disk refuses.
pub fn write_take(take: &Take, path: &Path) -> Result<(), ExportError> {
    let mut raw = take.to_raw();
    let factor = raw.unit.metres() / LengthUnit::Millimetre.metres();
    raw.unit = LengthUnit::Millimetre;
    for value in raw.positions.as_flattened_mut() {
        *value *= factor;
    }
    write_atomic(path, |out| write_c3d(&raw, out))
}

/// Writes the true surface as float32 `[frames, vertices, 3]`, metres.
///
/// # Errors
/// The disk refuses, or a position is beyond `f32`.
pub fn write_surface(
    body: &Body<'_>,
    path: &Path,
    progress: &dyn Fn(usize),
) -> Result<(), ExportError> {
    let vertex_count = body.avatar().mesh.positions.len();
    let mut writer = NpyWriter::create(path, &[body.frame_count(), vertex_count, 3])?;
    let mut surface = Surface::default();
    for frame in 0..body.frame_count() {
        body.surface_into(frame, &mut surface);
        let row: Vec<[f32; 3]> = surface
            .positions
            .iter()
            .map(|at| at.as_vec3().to_array())
            .collect();
        writer.push(row.as_flattened())?;
        progress(frame + 1);
    }
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::super::capture::{Sample, Truth};
    use super::*;

    /// Frames of (trajectory, marker).
    fn capture(frames: &[&[(u32, Option<u32>)]]) -> Capture {
        let sample = |&(trajectory, _): &(u32, Option<u32>)| Sample {
            trajectory,
            position: DVec3::X * f64::from(trajectory),
            cameras: 3,
        };
        Capture {
            rate: 100.0,
            cameras: Vec::new(),
            frames: frames
                .iter()
                .map(|f| f.iter().map(sample).collect())
                .collect(),
            truth: Truth {
                names: vec!["A".into(), "B".into()],
                positions: vec![vec![DVec3::ZERO, DVec3::Y]; frames.len()],
                owners: frames
                    .iter()
                    .map(|f| f.iter().map(|s| s.1).collect())
                    .collect(),
                cameras: vec![vec![3, 3]; frames.len()],
                swap_count: 0,
            },
        }
    }

    #[test]
    fn columns_are_shared_with_a_gap_between() {
        let (a, b) = (Some(0), Some(1));
        let capture = capture(&[
            &[(0, a), (1, b)],
            &[(1, b), (2, a)],
            &[(1, b), (3, None)],
            &[(1, b), (4, a)],
        ]);
        let columns: Vec<usize> = capture
            .trajectories()
            .iter()
            .map(|one| one.column)
            .collect();
        // 2 begins when 0 has just ended: a column of its own. 3 may follow 0; 4 may follow 2.
        assert_eq!(columns, [0, 1, 2, 0, 2]);
        let take = capture.take().unwrap();
        assert_eq!(take.labels(), ["*1", "*2", "*3"]);
        assert_eq!(take.traces(0).collect::<Vec<_>>(), [0..1, 2..3]);
        assert_eq!(take.position(2, 3), Some(DVec3::X * 4.0));
        let named = capture.labelled_take().unwrap();
        assert!(named.gaps(0).eq(std::iter::once(2..3)));
        assert_eq!(capture.truth_take().unwrap().missing_fraction(), 0.0);
    }

    #[test]
    fn a_swap_and_a_ghost_are_told() {
        let (a, b) = (Some(0), Some(1));
        let capture = capture(&[&[(0, a), (1, b)], &[(0, b), (1, a), (2, None)]]);
        let all = capture.trajectories();
        let span = |first_frame, marker| Span {
            first_frame,
            frame_count: 1,
            marker,
        };
        assert_eq!(all[0].spans, [span(0, a), span(1, b)]);
        assert_eq!(all[2].spans, [span(1, None)]);
        let counts = capture.statistics();
        assert_eq!((counts.trajectory_count, counts.ghost_count), (3, 1));
        assert_eq!((counts.missing_count, counts.complete_frame_count), (0, 2));
    }

    #[test]
    fn an_empty_capture_is_a_take() {
        assert_eq!(capture(&[]).take().unwrap().frame_count(), 0);
        assert_eq!(capture(&[&[], &[]]).statistics().missing_fraction, 1.0);
    }
}
