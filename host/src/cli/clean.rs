//! `sinew clean`: broken marker trajectories to complete, smooth motion.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::Failure;
use super::load::fault;
use super::say::{Say, notices_json, thousands};
use crate::clean::fill::{FillMethod, FillOptions, Filled, fill};
use crate::clean::smooth::{SmoothOptions, amplitude_kept, pass_count, smooth};
use crate::clean::{Spike, despike};
use crate::export::c3d::write_c3d;
use crate::export::plot::{Timeline, TimelineRow};
use crate::export::png::write_png;
use crate::export::{ExportErrorKind, write_atomic};
use crate::import::take::{LengthUnit, TakeOptions, UpAxis, read_take};
use crate::take::Take;

/// Remove spikes from a marker capture, fill its gaps and smooth it, and say how sure each part is.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew clean take.c3d --output clean.c3d
  sinew clean take.trc --output clean.c3d --plot gaps.png --report clean.json
  sinew clean take.csv --unit cm --up z --smooth 0 --output clean.c3d")]
pub(crate) struct Clean {
    /// The capture: .c3d, .trc, Motive .csv or a table of markers.
    take: PathBuf,
    /// Where to write the result, a .c3d in the units and axes of the capture.
    #[arg(long, short)]
    output: PathBuf,
    /// Where to draw the gaps over time, before and after (.png).
    #[arg(long)]
    plot: Option<PathBuf>,
    /// Where to write the report (.json); `--json` puts the same on standard output.
    #[arg(long)]
    report: Option<PathBuf>,
    /// How gaps are filled.
    #[arg(long, value_enum, default_value_t = Method::Regression)]
    fill: Method,
    /// Leave samples missing that cannot be told to this many metres.
    #[arg(long, value_name = "METRES", default_value_t = FillOptions::default().limit)]
    limit: f64,
    /// Frequency in hertz of which smoothing keeps 71 %; 0 turns smoothing off.
    #[arg(long, value_name = "HERTZ", default_value_t = SmoothOptions::default().cutoff)]
    smooth: f64,
    /// Leave spikes where they are.
    #[arg(long)]
    keep_spikes: bool,
    /// The capture's unit of length, over what its file says.
    #[arg(long, value_enum)]
    unit: Option<Unit>,
    /// The capture's axis that points up, over what its file says.
    #[arg(long, value_enum)]
    up: Option<super::bake::Up>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Method {
    /// Ridge regression in a local frame, weighed against inertia.
    Regression,
    /// Principal components, as published.
    Pca,
    /// Cubic splines in time.
    Spline,
    /// Straight lines in time.
    Linear,
}

impl Method {
    fn method(self) -> FillMethod {
        match self {
            Self::Regression => FillMethod::Regression,
            Self::Pca => FillMethod::Pca,
            Self::Spline => FillMethod::Spline,
            Self::Linear => FillMethod::Linear,
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Unit {
    Mm,
    Cm,
    M,
}

/// What one run did.
struct Outcome {
    before: Take,
    filled: Filled,
    spikes: Vec<Spike>,
    passes: usize,
    seconds: f64,
}

impl Clean {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if !(self.smooth.is_finite() && self.smooth >= 0.0) {
            return Err(Failure::Usage(
                "--smooth must be 0 or a frequency in hertz".into(),
            ));
        }
        if self.limit.is_nan() || self.limit <= 0.0 {
            return Err(Failure::Usage("--limit must be above 0 metres".into()));
        }
        let options = TakeOptions {
            unit: self.unit.map(|unit| match unit {
                Unit::Mm => LengthUnit::Millimetre,
                Unit::Cm => LengthUnit::Centimetre,
                Unit::M => LengthUnit::Metre,
            }),
            up: self.up.map(|up| match up {
                super::bake::Up::Y => UpAxis::PlusY,
                super::bake::Up::Z => UpAxis::PlusZ,
            }),
            rate: None,
        };
        let raw = read_take(&self.take, &options)?;
        let name = self.take.display().to_string();
        let (take, notices) = Take::from_raw(&raw).map_err(|error| fault(&self.take, &error))?;
        say.notices(&name, &raw.notices);
        say.notices(&name, &notices);
        if take.marker_count() == 0 || take.frame_count() == 0 {
            let text = format!("{name}: there are no marker samples in it; nothing to clean");
            return Err(Failure::Data(text));
        }
        let outcome = self.clean(take, say);
        outcome.tell(say);
        let mut object = outcome.to_json();
        object["take"] = json!(name);
        object["output"] = json!(self.output.display().to_string());
        object["notices"] = notices_json(&[raw.notices, notices].concat());
        if let Some(path) = &self.plot {
            let image = outcome.timeline().render(1200, 900);
            write_png(path, &image)?;
        }
        if let Some(path) = &self.report {
            write_bytes(path, format!("{object:#}\n").as_bytes())?;
        }
        let mut c3d = Vec::new();
        write_c3d(&outcome.filled.take.to_raw(), &mut c3d)
            .map_err(|error| fault(&self.output, &error))?;
        write_bytes(&self.output, &c3d)?;
        say.line(format!("wrote {}", self.output.display()));
        Ok(object)
    }

    fn clean(&self, before: Take, say: &Say) -> Outcome {
        let start = Instant::now();
        let mut take = before.clone();
        let spikes = if self.keep_spikes {
            Vec::new()
        } else {
            despike(&mut take)
        };
        let options = FillOptions {
            method: self.fill.method(),
            limit: self.limit,
        };
        let bar = say.progress("fill", take.marker_count());
        let mut filled = fill(&take, &options, &|| bar.inc(1));
        bar.finish_and_clear();
        let passes = pass_count(self.smooth, take.rate());
        let bar = say.progress("smooth", take.marker_count());
        let cutoff = self.smooth;
        smooth(&mut filled, &SmoothOptions { cutoff }, &|| bar.inc(1));
        bar.finish_and_clear();
        Outcome {
            before,
            filled,
            spikes,
            passes,
            seconds: start.elapsed().as_secs_f64(),
        }
    }
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    Ok(write_atomic(path, |out| {
        out.write_all(bytes).map_err(ExportErrorKind::from)
    })?)
}

/// Counts for the table: missing samples, gaps, longest gap, complete frames.
fn counts(take: &Take) -> [usize; 4] {
    let markers = || 0..take.marker_count();
    let gaps = || markers().flat_map(|marker| take.gaps(marker));
    [
        markers().map(|marker| take.missing_count(marker)).sum(),
        gaps().count(),
        gaps().map(|gap| gap.len()).max().unwrap_or(0),
        take.complete_frame_count(),
    ]
}

impl Outcome {
    /// Standard deviations of the filled samples in millimetres, ascending.
    fn deviations(&self) -> Vec<f64> {
        let filled = self.filled.sigma.iter().filter(|sigma| **sigma > 0.0);
        let mut all: Vec<f64> = filled.map(|sigma| 1e3 * f64::from(*sigma)).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    fn tell(&self, say: &Say) {
        let take = &self.before;
        say.line(format!(
            "{} markers, {} frames at {:.2} Hz ({:.1} s), cleaned in {:.1} s",
            take.marker_count(),
            thousands(take.frame_count() as u64),
            take.rate(),
            take.frame_count() as f64 / take.rate(),
            self.seconds
        ));
        say.line(format!("{:>18} {:>12} {:>12}", "", "before", "after"));
        let names = ["missing samples", "gaps", "longest gap", "complete frames"];
        let rows = names
            .iter()
            .zip(counts(take))
            .zip(counts(&self.filled.take));
        for ((name, before), after) in rows {
            let [before, after] = [before, after].map(|count| thousands(count as u64));
            say.line(format!("{name:>18} {before:>12} {after:>12}"));
        }
        say.line(format!(
            "{:>18} {:>12} {:>12}",
            "spikes",
            self.spikes.len(),
            0
        ));
        let deviations = self.deviations();
        let at = |share: f64| deviations[((deviations.len() - 1) as f64 * share) as usize];
        if !deviations.is_empty() && at(1.0).is_finite() {
            say.line(format!(
                "filled samples are sure to {:.2} mm an axis (median), {:.2} mm (95 %)",
                at(0.5),
                at(0.95)
            ));
        }
        if self.passes > 0 {
            let kept = |frequency| 100.0 * amplitude_kept(frequency, take.rate(), self.passes);
            say.line(format!(
                "smoothing keeps {:.1} % of local motion at 5 Hz, {:.1} % at 10 Hz, {:.1} % at 20 Hz",
                kept(5.0),
                kept(10.0),
                kept(20.0)
            ));
        }
        for (marker, label) in take.labels().iter().enumerate() {
            let missing = self.filled.take.missing_count(marker);
            if missing > 0 {
                let why = if take.missing_count(marker) == take.frame_count() {
                    "it was never seen"
                } else {
                    "too far from any sight of it or its neighbours (--limit)"
                };
                say.line(format!(
                    "note: {label}: {missing} samples stay missing: {why}"
                ));
            }
        }
    }

    fn to_json(&self) -> Value {
        let table = |take: &Take| {
            let [missing, gaps, longest, complete] = counts(take);
            json!({
                "missing_samples": missing,
                "gaps": gaps,
                "longest_gap": longest,
                "complete_frames": complete,
            })
        };
        let take = &self.before;
        let labels = take.labels();
        let markers = (0..take.marker_count()).map(|marker| {
            let sigma = (0..take.frame_count()).map(|frame| self.filled.sigma(marker, frame));
            let filled: Vec<f32> = sigma.filter(|sigma| *sigma > 0.0).collect();
            let worst = filled.iter().copied().fold(0.0, f32::max);
            json!({
                "label": labels[marker],
                "missing_before": take.missing_count(marker),
                "filled": filled.len(),
                "missing_after": self.filled.take.missing_count(marker),
                "worst_sigma_m": worst.is_finite().then_some(worst),
            })
        });
        let spikes = self.spikes.iter().map(|spike| {
            json!({
                "label": labels[spike.marker],
                "frame": spike.frame,
                "frames": spike.len,
                "height_m": spike.height,
            })
        });
        let kept = [1.0, 2.0, 5.0, 10.0, 20.0].map(|frequency| {
            let kept = amplitude_kept(frequency, take.rate(), self.passes);
            json!({ "hz": frequency, "kept": kept })
        });
        json!({
            "frames": take.frame_count(),
            "rate_hz": take.rate(),
            "seconds": self.seconds,
            "before": table(take),
            "after": table(&self.filled.take),
            "markers": markers.collect::<Vec<_>>(),
            "spikes": spikes.collect::<Vec<_>>(),
            "smoothing": { "passes": self.passes, "amplitude_kept": kept },
        })
    }

    /// Rows of the markers with gaps: what was missing, and below it what still is.
    fn timeline(&self) -> Timeline {
        let spans = |take: &Take, marker| {
            let seconds = |frame| take.seconds(frame);
            take.gaps(marker)
                .map(|gap| [seconds(gap.start), seconds(gap.end)])
                .collect::<Vec<_>>()
        };
        let mut rows = Vec::new();
        for (marker, label) in self.before.labels().iter().enumerate() {
            let before = spans(&self.before, marker);
            if before.is_empty() {
                continue;
            }
            let after = spans(&self.filled.take, marker);
            rows.push(TimelineRow {
                name: label.clone(),
                spans: before,
            });
            if !after.is_empty() {
                rows.push(TimelineRow {
                    name: format!("{label} (left)"),
                    spans: after,
                });
            }
        }
        Timeline {
            title: "Gaps of each marker".into(),
            x_label: "seconds".into(),
            rows,
            x_range: Some([0.0, self.before.seconds(self.before.frame_count())]),
        }
    }
}
