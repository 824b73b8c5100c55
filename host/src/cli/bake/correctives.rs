//! `sinew bake --correctives`: flesh that follows the skeleton, learnt from dense captures.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};

use super::super::load::{self, Reading};
use super::super::say::Say;
use super::super::usable;
use super::Failure;
use crate::fit::correctives::{Correctives, Performed, learn, pose};
use crate::fit::parts::glue;
use crate::import::take::PointKind;
use crate::model::Avatar;
use crate::take::Take;

/// What to learn correctives from.
#[derive(Args, Clone, Default)]
pub(super) struct FromCapture {
    /// A capture of dense markers on the body's skin (.c3d, .trc, .csv), labelled and cleaned:
    /// learn how flesh bulges and jiggles as the skeleton moves. Each begins in the mesh's rest
    /// pose; may be given several times, with the same labels.
    #[arg(long, value_name = "CAPTURE")]
    correctives: Vec<PathBuf>,
    /// The frame (0 is the first) of the first capture in which the subject stands in the mesh's
    /// rest pose; the first that shows nearly as many markers as any without it.
    #[arg(long, requires = "correctives", value_name = "FRAME")]
    correctives_rest: Option<usize>,
}

/// Runs of frames without gaps shorter than this are not learnt from, seconds.
const SHORTEST: f64 = 0.5;

impl FromCapture {
    /// Learns what is asked for, and says how much it explains.
    pub fn learn(
        &self,
        body: &Avatar,
        reading: Reading,
        say: &Say,
    ) -> Result<Option<(Correctives, Value)>, Failure> {
        let Some(first) = self.correctives.first() else {
            return Ok(None);
        };
        let mut takes = Vec::new();
        for path in &self.correctives {
            let (take, notices) = load::take(path, reading)?;
            say.notices(&path.display().to_string(), &notices);
            takes.push((path, take));
        }
        let labels = markers(&takes[0].1);
        let columns = |path: &Path, take: &Take| -> Result<Vec<usize>, Failure> {
            let find = |label: &String| {
                let found = take.labels().iter().position(|other| other == label);
                found.ok_or_else(|| {
                    Failure::Data(format!(
                        "{}: no marker {label:?}, which {} has; give captures of one marker set",
                        path.display(),
                        first.display()
                    ))
                })
            };
            labels.iter().map(find).collect()
        };
        let mut with_columns = Vec::new();
        for (path, take) in &takes {
            with_columns.push((take, columns(path, take)?));
        }
        let rest = ("--correctives-rest", self.correctives_rest);
        let seen = usable::markers(first, &with_columns, rest, say)?;
        let (rest_frame, frames) = (seen.rest, seen.frames);
        let fault = |error: &dyn std::error::Error| load::fault(first, error);
        let fitted = glue::fit(&body.mesh, &seen.standing).map_err(|error| fault(&error))?;
        say.line(format!(
            "correctives: {} markers on the skin in frame {rest_frame}, {:.1} mm from it on average",
            seen.kept.len(),
            1e3 * fitted.mean_distance
        ));
        let glued = (&fitted.glued[..], &fitted.rest[..]);
        let bar = say.progress("posing the skeleton", frames.len() + 1);
        let (mut performances, mut used, mut squares) = (Vec::new(), 0, 0.0);
        for ((_, take), frames) in takes.iter().zip(frames) {
            for run in runs(frames) {
                if (run.len() as f64) < SHORTEST * take.rate() {
                    continue;
                }
                let posed = pose::pose(body, glued, &run);
                used += run.len();
                squares += run.len() as f64 * posed.distance.powi(2);
                performances.push(Performed {
                    rate: take.rate(),
                    poses: posed.poses,
                    markers: run,
                });
            }
            bar.inc(1);
        }
        let learnt = learn(body, glued, &performances).map_err(|error| fault(&error))?;
        bar.finish_and_clear();
        let [before, after] = learnt.held_out.map(|metres| 1e3 * metres);
        let removed = 100.0 * (1.0 - after / before.max(1e-9));
        say.line(format!(
            "correctives: {} modes of {} near-rigid parts from {used} frames; markers are {before:.2} \
             mm (rms) off the skeleton's skin and {after:.2} mm with correctives in stretches held \
             out: {removed:.0} % less",
            learnt.morphs.len(),
            learnt.data.parents.len(),
        ));
        let report = json!({
            "markers": seen.kept.len(),
            "frames": used,
            "rest_frame": rest_frame,
            "modes": learnt.morphs.len(),
            "terms": learnt.data.features.len(),
            "posed_distance_m": f64::sqrt(squares / used.max(1) as f64),
            "held_out": { "skeleton_rms_m": before / 1e3, "correctives_rms_m": after / 1e3 },
        });
        Ok(Some((learnt, report)))
    }
}

/// Labels of a take's markers.
fn markers(take: &Take) -> Vec<String> {
    let all = take.labels().iter().zip(take.kinds());
    all.filter(|(_, kind)| **kind == PointKind::Marker)
        .map(|(label, _)| label.clone())
        .collect()
}

/// Consecutive frames together.
fn runs(frames: Vec<(usize, Vec<DVec3>)>) -> Vec<Vec<Vec<DVec3>>> {
    let mut out: Vec<Vec<Vec<DVec3>>> = Vec::new();
    let mut next = None;
    for (number, frame) in frames {
        match out.last_mut() {
            Some(run) if next == Some(number) => run.push(frame),
            _ => out.push(vec![frame]),
        }
        next = Some(number + 1);
    }
    out
}
