//! `sinew track`: names and fills the points of a capture as the core does it live.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};
use sinew_core::track::markers::{Config, FrameReport, Source};

use super::load::{Reading, fault};
use super::say::{Say, notices_json};
use super::{Failure, load};
use crate::clean::exchange;
use crate::export::c3d::write_c3d;
use crate::export::{ExportErrorKind, write_atomic};
use crate::fit::live::{LearnOptions, MarkerModel, learn};
use crate::label::{Labelled, label};

/// Name and fill the points of a capture, frame by frame, as the core does it live.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew track raw.c3d --learn clean.c3d --output labelled.c3d
  sinew track raw.csv --learn day1.c3d --learn day2.c3d --output labelled.c3d
  sinew bake --mesh body.glb --marker-set clean.c3d --output body.sinew
  sinew track raw.c3d --model body.sinew --output labelled.c3d

The names that the capture gives its points are ignored. Each frame sees only itself and what came
before it. Lost markers are missing in the output.")]
pub(crate) struct Track {
    /// The capture: .c3d, .trc, Motive .csv or a table of markers.
    take: PathBuf,
    /// An asset that was baked with --marker-set.
    #[arg(long, conflicts_with = "learn", required_unless_present = "learn")]
    model: Option<PathBuf>,
    /// A named, clean take of the same marker set, to learn it from; may be given several times.
    #[arg(long, value_name = "TAKE")]
    learn: Vec<PathBuf>,
    /// Where to write the result, a .c3d in the units and axes of the capture.
    #[arg(long, short)]
    output: PathBuf,
    /// Standard deviation of a measured coordinate, millimetres.
    #[arg(long, value_name = "MM", default_value_t = 0.5)]
    noise_mm: f32,
    /// Seconds in which a filled marker meets the measured one; 0 jumps.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.06)]
    blend: f32,
    /// Leave samples missing that are not filled to this many metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.05)]
    limit: f32,
    #[command(flatten)]
    reading: Reading,
}

/// Learns a marker set from takes.
pub(crate) fn learn_from(
    paths: &[PathBuf],
    reading: Reading,
    say: &Say,
) -> Result<MarkerModel, Failure> {
    let mut takes = Vec::with_capacity(paths.len());
    for path in paths {
        let (mut take, notices) = load::take(path, reading)?;
        let name = path.display().to_string();
        say.notices(&name, &notices);
        // A wrong name would be learned.
        let misnamed = exchange::find(&take, &|_| ());
        misnamed.undo(&mut take);
        for one in &misnamed.exchanges {
            let [a, b] = one.columns.map(|column| &take.labels()[column]);
            let (first, last) = (one.frames.start, one.frames.end - 1);
            say.line(format!(
                "note: {name}: {a} and {b} carry each other's marker in frames {first} to {last}: put \
                 right before learning"
            ));
        }
        takes.push(take);
    }
    let markers = takes.iter().map(|take| take.marker_count()).max();
    let bar = say.progress("learn", markers.unwrap_or(0));
    let learned = learn(&takes, &LearnOptions::default(), &|| bar.inc(1));
    bar.finish_and_clear();
    let first = paths
        .first()
        .map(PathBuf::as_path)
        .unwrap_or(std::path::Path::new(""));
    let model = learned.map_err(|error| fault(first, &error))?;
    if !model.left_out.is_empty() {
        say.line(format!(
            "note: seen too seldom to be learned: {}",
            model.left_out.join(", ")
        ));
    }
    say.line(format!(
        "learned {} markers, {} constellations",
        model.labels.len(),
        model.seeds.len()
    ));
    Ok(model)
}

impl Track {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        for (name, value, least) in [
            ("--noise-mm", self.noise_mm, 1e-3),
            ("--blend", self.blend, 0.0),
            ("--limit", self.limit, 1e-3),
        ] {
            if !(least..=1e3).contains(&value) {
                return Err(Failure::Usage(format!(
                    "{name} must be a number of at least {least}"
                )));
            }
        }
        let model = match &self.model {
            Some(path) => {
                let bytes = load::asset(path)?;
                let asset = bytes.asset().map_err(|error| fault(path, &error))?;
                MarkerModel::of(&asset).ok_or_else(|| {
                    let path = path.display();
                    Failure::Data(format!(
                        "{path}: no marker set in it; bake it with --marker-set"
                    ))
                })?
            }
            None => learn_from(&self.learn, self.reading, say)?,
        };
        let (take, notices) = load::take(&self.take, self.reading)?;
        let name = self.take.display().to_string();
        say.notices(&name, &notices);
        let core = model.model();
        let config = Config {
            noise: self.noise_mm / 1000.0,
            blend: self.blend,
            limit: self.limit,
            ..Config::new(take.rate() as f32, core.dims())
        };
        let bar = say.progress("track", take.frame_count());
        let labelled = label(&take, &model.labels, core, config, &|done| {
            bar.set_position(done as u64);
        });
        bar.finish_and_clear();
        let labelled = labelled.map_err(|error| fault(&self.take, &error))?;
        let mut c3d = Vec::new();
        write_c3d(&labelled.take.to_raw(), &mut c3d)
            .map_err(|error| fault(&self.output, &error))?;
        write_atomic(&self.output, |out| {
            out.write_all(&c3d).map_err(ExportErrorKind::from)
        })?;
        let mut object = summary(&labelled, say);
        say.line(format!("wrote {}", self.output.display()));
        object["take"] = json!(name);
        object["output"] = json!(self.output.display().to_string());
        object["markers"] = json!(model.labels);
        object["notices"] = notices_json(&notices);
        Ok(object)
    }
}

/// In words and as JSON.
fn summary(labelled: &Labelled, say: &Say) -> Value {
    let sum = |of: fn(&FrameReport) -> usize| labelled.reports.iter().map(of).sum::<usize>();
    let (measured, filled, lost) = (sum(|r| r.measured), sum(|r| r.filled), sum(|r| r.lost));
    let strangers = sum(|report| report.strangers);
    let all = (measured + filled + lost).max(1) as f64;
    let share = |count: usize| 100.0 * count as f64 / all;
    let first = labelled.samples.iter().position(|samples| {
        let measured = |s: &&_| {
            matches!(
                s,
                &&sinew_core::track::markers::Sample {
                    source: Source::Measured(_),
                    ..
                }
            )
        };
        samples.iter().filter(measured).count() * 2 > samples.len()
    });
    say.line(format!(
        "{} frames: {:.1} % of samples measured, {:.1} % filled, {:.1} % lost; {strangers} points \
         belong to no marker",
        labelled.reports.len(),
        share(measured),
        share(filled),
        share(lost),
    ));
    match first {
        Some(frame) => say.line(format!("recognised in frame {frame} (0 is the first)")),
        None => say.line("the set was never recognised; is it the one that the model knows?"),
    }
    json!({
        "frames": labelled.reports.len(),
        "measured": measured,
        "filled": filled,
        "lost": lost,
        "strangers": strangers,
        "recognised_frame": first,
        "most_work": labelled.reports.iter().map(|report| report.work).max(),
    })
}
