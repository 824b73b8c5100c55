//! Skin that dense markers drive: what `bake --markers` learns and `play --markers` plays.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};
use sinew_core::asset::Asset;

use super::Failure;
use super::load::{self, Reading};
use super::say::{Say, thousands};
use super::usable;
use crate::bake::write::MarkerSkinData;
use crate::fit::parts::measure::{Score, into_mode, measure, recommended};
use crate::fit::parts::{Mode, Options, Segments, glue, learn};
use crate::import::take::PointKind;
use crate::model::Avatar;
use crate::play::Motion;

/// What to learn from markers.
#[derive(Args, Clone, Default)]
pub(crate) struct FromMarkers {
    /// A capture of dense markers on the body's skin (.c3d, .trc, .csv), labelled and cleaned: learn
    /// how the skin follows them. With --mode laplacian any capture that the scan follows.
    #[arg(long, value_name = "TAKE")]
    markers: Option<PathBuf>,
    /// How markers move the skin; without it, the cheapest that is as good as the best on markers
    /// and frames held out.
    #[arg(long)]
    mode: Option<Wanted>,
    /// The frame (0 is the first) in which the subject stands in the mesh's rest pose; without it the
    /// one that `sinew register` takes: the first that shows nearly as many markers as any.
    #[arg(long, requires = "markers", value_name = "FRAME")]
    rest_frame: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Wanted {
    /// Near-rigid parts, each deformed quadratically, with radial-basis residuals: as published.
    Parts,
    /// One fixed sparse matrix from markers to vertices.
    Collapsed,
    /// Skinning on frames fitted to the markers, displaced by what is left.
    Hybrid,
    /// A scan without a skeleton that follows a few markers or a template.
    Laplacian,
}

const fn word(mode: Mode) -> &'static str {
    match mode {
        Mode::Exact => "parts",
        Mode::Collapsed => "collapsed",
        Mode::Hybrid => "hybrid",
    }
}

impl FromMarkers {
    /// Whether a scan is to be baked instead of a body.
    pub fn is_laplacian(&self) -> bool {
        self.mode == Some(Wanted::Laplacian)
    }

    /// The capture's file.
    pub fn take(&self) -> Option<&PathBuf> {
        self.markers.as_ref()
    }

    /// Learns the skin that is asked for, and says how good each mode is.
    pub fn learn(
        &self,
        body: &Avatar,
        reading: Reading,
        say: &Say,
    ) -> Result<Option<(MarkerSkinData, Value)>, Failure> {
        let Some(path) = &self.markers else {
            if self.mode.is_some() {
                let text = "--mode parts, collapsed and hybrid need --markers TAKE to learn from";
                return Err(Failure::Usage(text.into()));
            }
            return Ok(None);
        };
        let (take, notices) = load::take(path, reading)?;
        say.notices(&path.display().to_string(), &notices);
        let fault = |error: &dyn std::error::Error| load::fault(path, error);
        let named: Vec<usize> = (0..take.marker_count())
            .filter(|&marker| take.kinds()[marker] == PointKind::Marker)
            .collect();
        let takes = [(&take, named)];
        let seen = usable::markers(path, &takes, ("--rest-frame", self.rest_frame), say)?;
        let named: Vec<usize> = seen.kept.iter().map(|&at| takes[0].1[at]).collect();
        let (rest, frames) = (seen.rest, seen.frames.into_iter().flatten());
        let fitted = glue::fit(&body.mesh, &seen.standing).map_err(|error| fault(&error))?;
        say.line(format!(
            "{} markers on the skin in frame {rest}, {:.1} mm from it on average",
            named.len(),
            1e3 * fitted.mean_distance
        ));
        let segments = Segments::of_rig(body, &fitted.glued);
        let parts = segments.names.join(", ");
        say.line(format!(
            "{} near-rigid parts: {parts}",
            segments.part_count()
        ));
        let positions: Vec<Vec<DVec3>> = frames.map(|frame| frame.1).collect();
        let glued = (&fitted.glued[..], &fitted.rest[..]);
        let options = Options::default();
        let bar = say.progress("learning", 2);
        let scores = measure(&body.mesh, &segments, glued, &positions, &options)
            .map_err(|error| fault(&error))?;
        bar.inc(1);
        let learnt = learn(&body.mesh, &segments, glued, &positions, &options)
            .map_err(|error| fault(&error))?;
        bar.finish_and_clear();
        let best = recommended(&scores).unwrap_or(Mode::Hybrid);
        let mode = match self.mode {
            Some(Wanted::Parts) => Mode::Exact,
            Some(Wanted::Collapsed) => Mode::Collapsed,
            Some(Wanted::Hybrid) => Mode::Hybrid,
            Some(Wanted::Laplacian) | None => best,
        };
        tell(&scores, best, mode, say);
        let (rig, data) = into_mode(learnt, mode);
        let names = named.iter().map(|&marker| take.labels()[marker].clone());
        let skin = MarkerSkinData {
            names: names.collect(),
            rig,
            mode: data,
        };
        let object = json!({
            "markers": skin.names.len(),
            "parts": segments.names,
            "mode": word(mode),
            "recommended": word(best),
            "frames": positions.len(),
            "rest_frame": rest,
            "mean_distance_m": fitted.mean_distance,
            "held_out": scores.iter().map(to_json).collect::<Vec<_>>(),
        });
        Ok(Some((skin, object)))
    }
}

fn tell(scores: &[Score], best: Mode, chosen: Mode, say: &Say) {
    say.line("at markers and frames held out, mm:     mean     p95     max   multiplications");
    for score in scores {
        let [mean, p95, max] = [score.mean, score.percentile_95, score.max].map(|x| 1e3 * x);
        let mark = match score.mode {
            mode if mode == chosen && mode == best => "  <- best and chosen",
            mode if mode == chosen => "  <- chosen",
            mode if mode == best => "  <- recommended",
            _ => "",
        };
        say.line(format!(
            "  {:34} {mean:7.2} {p95:7.2} {max:7.1}   {:>15}{mark}",
            word(score.mode),
            thousands(score.multiply_adds as u64)
        ));
    }
}

fn to_json(score: &Score) -> Value {
    json!({
        "mode": word(score.mode),
        "mean_m": score.mean,
        "percentile_95_m": score.percentile_95,
        "max_m": score.max,
        "multiply_adds": score.multiply_adds,
    })
}

/// A take as motion for an asset's markers, matched by name; missing samples stay missing.
pub(crate) fn motion(
    asset: &Asset<'_>,
    path: &Path,
    reading: Reading,
    say: &Say,
) -> Result<Motion, Failure> {
    let (take, notices) = load::take(path, reading)?;
    say.notices(&path.display().to_string(), &notices);
    let Some(skin) = asset.marker_skin() else {
        return Err(Failure::Usage(
            "the asset has no skin that markers drive; bake it with --markers TAKE".into(),
        ));
    };
    let count = skin.rig.marker_count();
    let find = |marker: usize| {
        let name = asset.marker_name(marker);
        take.labels().iter().position(|label| label == name)
    };
    let columns: Vec<Option<usize>> = (0..count).map(find).collect();
    let found = columns.iter().flatten().count();
    if found < 3 {
        let (ours, theirs) = (asset.marker_name(0), take.labels().first());
        return Err(Failure::Data(format!(
            "{}: {found} of the asset's {count} markers are in it (the asset names {ours:?}, the \
             take {:?}); give a take with the same labels",
            path.display(),
            theirs.map_or("nothing", String::as_str)
        )));
    }
    if found < count {
        say.line(format!(
            "note: {}: {} of the asset's {count} markers are absent and move with their parts",
            path.display(),
            count - found
        ));
    }
    let sample = |column: &Option<usize>, frame: usize| match column {
        Some(column) => take
            .position(*column, frame)
            .map_or([f32::NAN; 3], |p| p.as_vec3().to_array()),
        None => [f32::NAN; 3],
    };
    let frames = (0..take.frame_count())
        .map(|frame| columns.iter().map(|column| sample(column, frame)).collect())
        .collect();
    Ok(Motion::Markers {
        rate: take.rate(),
        frames,
    })
}
