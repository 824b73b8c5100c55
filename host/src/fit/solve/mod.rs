//! Skeleton motion from markers.
//!
//! In: a [`Take`]. Out: a [`Motion`] with fixed bone lengths, and how far each marker is from it.
//!
//! | stage | does |
//! | --- | --- |
//! | [`labels`], [`template`] | labels of the standard sets to places on an expected body |
//! | `groups` | or, without known labels, a body from near-rigid groups |
//! | `pose` | a frame's pose: absolute orientation from the pelvis outward, then Gauss-Newton |
//! | `calibrate` | bone lengths, joint centres, marker places, from chosen frames at once |
//! | `attach` | markers without a known label go where they sit still |
//! | `track` | every frame, with gaps bridged by the segment's other markers |

use glam::DVec3;

mod attach;
mod body;
mod calibrate;
mod equations;
mod error;
mod groups;
pub mod labels;
mod pose;
mod result;
pub mod template;
mod track;

pub use error::SolveError;
pub use result::{Bone, FAULT, MarkerReport, Solved};

use body::{Body, Placed};
use calibrate::{Frame, Weighing, calibrate};
use labels::{Landmark, landmark};
use template::Bone as TemplateBone;

use crate::clean::fill::{FillOptions, Filled, fill};
use crate::model::Motion;
use crate::take::Take;

/// How markers are understood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MarkerSet {
    /// By labels where a standard set is recognised, else by motion.
    #[default]
    Auto,
    /// By the labels of the standard sets.
    Labels,
    /// By near-rigid groups alone.
    Groups,
}

/// How to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions {
    /// How markers are understood.
    pub set: MarkerSet,
    /// Estimate missing samples first; they count by how sure they are.
    pub fill: bool,
    /// From the skin to the centre of a marker, metres.
    pub marker_radius: f64,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            set: MarkerSet::Auto,
            fill: true,
            marker_radius: 0.007,
        }
    }
}

/// Who hears how far the work is.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    /// A stage begins, with so many pieces of work.
    pub stage: &'a dyn Fn(&'static str, usize),
    /// So many pieces are done.
    pub done: &'a (dyn Fn(usize) + Sync),
}

impl Progress<'_> {
    /// Nobody.
    pub const SILENT: Progress<'static> = Progress {
        stage: &|_, _| (),
        done: &|_| (),
    };
}

/// Pelvis or trunk markers without which labels do not tell where the body is.
const NEEDED: usize = 3;
/// Share of labels that must be landmarks for a set to be recognised.
const RECOGNISED: f64 = 0.5;
/// Least and most that markers are taken to stray, metres.
const NOISE: (f64, f64) = (0.002, 0.01);
/// Rounds of calibration, and steps in each.
const ROUNDS: usize = 3;
const STEPS: usize = 15;

/// Solves the skeleton and its motion. O(frames x joints^3)
///
/// # Errors
/// No samples; a standard set was asked for and is not there; no rigid groups; no frame that shows
/// where the body is.
pub fn solve(
    take: &Take,
    name: &str,
    options: SolveOptions,
    progress: Progress<'_>,
) -> Result<Solved, SolveError> {
    if take.frame_count() == 0 || take.bounds().is_none() {
        return Err(SolveError::Empty);
    }
    let (mut body, by_labels) = first_body(take, options)?;
    (progress.stage)("calibrate", ROUNDS);
    let no_start = || SolveError::NoStart {
        needed: root_labels(&body, take),
    };
    if by_labels {
        let scale = first_scale(&body, take).ok_or_else(no_start)?;
        body.resize(scale);
    }
    let mut ignored = Vec::new();
    for round in 0..ROUNDS {
        let (numbers, mut frames): (Vec<usize>, Vec<Frame>) =
            track::choose(&body, take).into_iter().unzip();
        if frames.is_empty() {
            return Err(SolveError::NoStart {
                needed: root_labels(&body, take),
            });
        }
        let weighing = Weighing {
            scale_spread: if by_labels { 0.15 } else { 1e-6 },
            ..Weighing::default()
        };
        let residual = calibrate(&mut body, &mut frames, weighing, STEPS);
        body.noise = residual.clamp(NOISE.0, NOISE.1);
        if round + 1 < ROUNDS {
            let placed = |frame: &Frame| body.place(&frame.pose);
            let placed: Vec<(usize, Placed)> =
                numbers.into_iter().zip(frames.iter().map(placed)).collect();
            ignored = attach::attach(&mut body, take, &placed);
        }
        (progress.done)(1);
    }
    let filled = fill_gaps(take, options, progress);
    (progress.stage)("solve", take.frame_count());
    let (poses, held) =
        track::track(&body, take, filled.as_ref(), progress.done).ok_or_else(|| {
            SolveError::NoStart {
                needed: root_labels(&body, take),
            }
        })?;
    Ok(result::report(
        take, name, &body, &poses, by_labels, held, &ignored,
    ))
}

fn fill_gaps(take: &Take, options: SolveOptions, progress: Progress<'_>) -> Option<Filled> {
    if !options.fill || take.missing_fraction() == 0.0 {
        return None;
    }
    (progress.stage)("fill", take.marker_count());
    Some(fill(take, &FillOptions::default(), &|| (progress.done)(1)))
}

/// The template with the take's landmarks, or groups.
fn first_body(take: &Take, options: SolveOptions) -> Result<(Body, bool), SolveError> {
    let set = options.set;
    if set == MarkerSet::Groups {
        return Ok((groups::body(take)?, false));
    }
    let seen = |column: &usize| take.missing_count(*column) < take.frame_count();
    let columns: Vec<usize> = (0..take.marker_count()).filter(seen).collect();
    let mut known: Vec<(usize, Landmark)> = Vec::new();
    for &column in &columns {
        if let Some(found) = landmark(&take.labels()[column]) {
            known.push((column, found));
        }
    }
    let on = |bones: &[TemplateBone]| {
        let on = |(_, landmark): &&(usize, Landmark)| bones.contains(&landmark.place.bone);
        known.iter().filter(on).count()
    };
    let pelvis = on(&[TemplateBone::Hips]);
    let trunk = on(&[TemplateBone::Chest]);
    let enough = pelvis >= NEEDED || pelvis >= 1 && pelvis + trunk >= NEEDED;
    let many = known.len() as f64 >= RECOGNISED * columns.len() as f64 || known.len() >= 12;
    if enough && many {
        return Ok((template::body(&known, options.marker_radius), true));
    }
    if set == MarkerSet::Labels {
        let needed = if enough {
            "at least half must be"
        } else {
            "three of them must lie on the pelvis (such as LASI, RASI, SACR)"
        };
        return Err(SolveError::UnknownLabels {
            found: known.len(),
            count: columns.len(),
            needed,
        });
    }
    Ok((groups::body(take)?, false))
}

/// The subject's size over the template's: median over pairs of well-placed markers that one
/// segment carries, long ones first.
fn first_scale(body: &Body, take: &Take) -> Option<f64> {
    const STRIDED: usize = 60;
    const PLACED: f64 = 0.04;
    let stride = take.frame_count().div_ceil(STRIDED).max(1);
    let mut ratios: Vec<(f64, f64)> = Vec::new();
    let markers: Vec<_> = body
        .markers
        .iter()
        .filter(|marker| marker.spread <= PLACED)
        .collect();
    let rest = body.place(&body::Pose::rest(body.segments.len()));
    for (at, a) in markers.iter().enumerate() {
        for b in &markers[..at] {
            let trunk = |marker: &body::Marker| marker.segment <= 3;
            if a.segment != b.segment && !(trunk(a) && trunk(b)) {
                continue;
            }
            let length = body.marker(a, &rest).distance(body.marker(b, &rest));
            if length < 0.08 {
                continue;
            }
            for frame in (0..take.frame_count()).step_by(stride) {
                let (Some(p), Some(q)) = (
                    take.position(a.column, frame),
                    take.position(b.column, frame),
                ) else {
                    continue;
                };
                ratios.push((p.distance(q) / length, length));
            }
        }
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = ratios.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    ratios.into_iter().find_map(|(ratio, weight)| {
        sum += weight;
        (sum >= whole / 2.0).then_some(ratio)
    })
}

/// Labels of the markers that show the root, for messages.
fn root_labels(body: &Body, take: &Take) -> String {
    let on_root = body.markers.iter().filter(|marker| marker.segment == 0);
    let labels = on_root.map(|marker| take.labels()[marker.column].as_str());
    let labels: Vec<&str> = labels.take(6).collect();
    format!("three of {}", labels.join(", "))
}

/// A motion's joints in model space at a time, metres, for pictures and measures.
#[must_use]
pub fn joints_at(motion: &Motion, seconds: f64) -> Vec<DVec3> {
    let local = crate::reference::pose::sample(&motion.skeleton, &motion.clip, seconds);
    let model = motion.skeleton.model(&local);
    model.iter().map(|matrix| matrix.translation).collect()
}
