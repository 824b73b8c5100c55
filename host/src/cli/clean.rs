//! `sinew clean`: broken marker trajectories to complete, smooth motion.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::load::{Loaded, Reading, fault};
use super::say::{Say, notices_json};
use super::{Failure, load};
use crate::clean::exchange::{self, Misnamed};
use crate::clean::fill::{FillMethod, FillOptions, Filled, fill};
use crate::clean::merge::{MergeOptions, Merged, merge};
use crate::clean::smooth::{SmoothOptions, pass_count, smooth};
use crate::clean::surface::BodyMesh;
use crate::clean::{Spike, despike};
use crate::export::c3d::write_c3d;
use crate::export::png::write_png;
use crate::export::{ExportErrorKind, write_atomic};
use crate::model::Mesh;
use crate::studio::files::read_trajectories;
use crate::studio::judge::Key;
use crate::take::Take;

mod report;

/// Merge a marker capture's unnamed trajectories, remove spikes, fill gaps and smooth, and say how
/// sure each part is.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew clean take.c3d --output clean.c3d
  sinew clean take.trc --output clean.c3d --plot gaps.png --report clean.json
  sinew clean take.csv --unit cm --up z --smooth 0 --output clean.c3d
  sinew clean capture/capture.c3d --truth capture --output clean.c3d")]
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
    /// Say which names are exchanged or stray, but leave them as they are.
    #[arg(long)]
    keep_names: bool,
    /// The frame (0 is the first) in which the body stands in its reference pose; by default the one
    /// that shows most.
    #[arg(long, value_name = "FRAME")]
    reference_frame: Option<usize>,
    /// The body in the place and pose of the reference frame (.glb, .gltf, .obj or .ply): markers are
    /// neighbours along it. By default the way along the body is found from the markers alone.
    #[arg(long, value_name = "MESH")]
    mesh: Option<PathBuf>,
    /// Folder of `sinew studio` whose capture this is: says how many labels are wrong, and by how
    /// much filled samples miss the truth.
    #[arg(long, value_name = "DIR")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
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

/// What one run did.
struct Outcome {
    before: Take,
    misnamed: Misnamed,
    names_kept: bool,
    merged: Merged,
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
        let (take, notices) = load::take(&self.take, self.reading)?;
        let name = self.take.display().to_string();
        say.notices(&name, &notices);
        if take.marker_count() == 0 || take.frame_count() == 0 {
            let text = format!("{name}: there are no marker samples in it; nothing to clean");
            return Err(Failure::Data(text));
        }
        if self
            .reference_frame
            .is_some_and(|frame| frame >= take.frame_count())
        {
            let text = format!(
                "--reference-frame: {name} has {} frames",
                take.frame_count()
            );
            return Err(Failure::Usage(text));
        }
        let key = self.key(&take)?;
        let outcome = self.clean(take, say)?;
        outcome.tell(say);
        let mut object = outcome.to_json();
        object["take"] = json!(name);
        object["output"] = json!(self.output.display().to_string());
        object["notices"] = notices_json(&notices);
        if let Some(key) = &key {
            object["truth"] = outcome.judge(key, say);
        }
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

    /// What the capture's points really are, if its folder is stated.
    fn key(&self, take: &Take) -> Result<Option<Key>, Failure> {
        let Some(folder) = &self.truth else {
            return Ok(None);
        };
        let (truth, _) = load::take(&folder.join("truth.c3d"), Reading::default())?;
        let path = folder.join("studio.json");
        let bytes = std::fs::read(&path).map_err(|error| fault(&path, &error))?;
        let trajectories = read_trajectories(&bytes).map_err(|error| fault(&path, &error))?;
        let key = Key {
            trajectories,
            truth,
        };
        if let Err(why) = key.check(take) {
            let folder = folder.display();
            return Err(Failure::Data(format!("--truth {folder}: {why}")));
        }
        Ok(Some(key))
    }

    fn body(&self) -> Result<Option<Mesh>, Failure> {
        let Some(path) = &self.mesh else {
            return Ok(None);
        };
        match load::any(path, self.reading)?.0 {
            Loaded::Avatar(avatar) => Ok(Some(avatar.mesh)),
            Loaded::Mesh(mesh) => Ok(Some(*mesh)),
            _ => {
                let path = path.display();
                let text = format!("--mesh {path}: no mesh; give a .glb, .gltf, .obj or .ply");
                Err(Failure::Data(text))
            }
        }
    }

    fn clean(&self, before: Take, say: &Say) -> Result<Outcome, Failure> {
        let start = Instant::now();
        let bar = say.progress("names", 1000);
        let misnamed = exchange::find(&before, &|share| {
            bar.set_position((1000.0 * share) as u64);
        });
        bar.finish_and_clear();
        let mut named = before.clone();
        if !self.keep_names {
            misnamed.undo(&mut named);
        }
        let mesh = self.body()?;
        let body = mesh.as_ref().map(|mesh| BodyMesh {
            positions: &mesh.positions,
            triangles: &mesh.triangles,
        });
        let options = MergeOptions {
            reference_frame: self.reference_frame,
            mesh: body,
            ..MergeOptions::default()
        };
        let bar = say.progress("merge", 1000);
        let merged = merge(&named, &options, &|share| {
            bar.set_position((1000.0 * share) as u64);
        });
        bar.finish_and_clear();
        let merged = merged.map_err(|error| fault(&self.take, &error))?;
        let mut take = merged.take.clone();
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
        Ok(Outcome {
            before,
            misnamed,
            names_kept: self.keep_names,
            merged,
            filled,
            spikes,
            passes,
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    Ok(write_atomic(path, |out| {
        out.write_all(bytes).map_err(ExportErrorKind::from)
    })?)
}
