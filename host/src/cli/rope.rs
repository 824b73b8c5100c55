//! `sinew rope`: ropes out of a marker capture.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};
use sinew_core::track::rope::{Method, Order};

use super::bake::write as write_asset;
use super::load::{Loaded, Reading, fault};
use super::say::{Say, notices_json};
use super::{Failure, load};
use crate::bake::{BakeOptions, bake};

use crate::export::c3d::write_c3d;
use crate::export::marker_csv::write_marker_csv;
use crate::export::png::write_png;
use crate::export::trc::write_trc;
use crate::export::{write_atomic, write_glb_of};
use crate::film::{Film, Shot};
use crate::fit::rope::{
    FollowOptions, PointFrames, RepairOptions, Selection, Separated, Trace, TubeOptions, beside,
    both_ways, follow_all, repair, separate, tube,
};
use crate::model::Avatar;
use crate::play::Motion;
use crate::reference;
use crate::take::Take;

mod report;

/// Find ropes among a person's markers, follow them, close their gaps, and write both apart.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew rope take.c3d --output rope.c3d
  sinew rope take.csv --markers 20 --spacing 0.1 --output rope.c3d --glb rope.glb
  sinew rope take.c3d --select box:-0.2,0,-0.2,0.2,2.5,0.2 --output rope.csv --confidence sure.csv
  sinew rope take.c3d --select auto --select auto --output two_ropes.c3d
  sinew rope take.csv --select 'list:Unlabeled:108,Unlabeled:110,Unlabeled:111' --output rope.c3d
  sinew rope take.c3d --output rope.c3d --body skipper.glb --asset scene.sinew --gif scene.gif

The rope is the longest evenly spaced chain of points, hanging or not, at rest or moving. All other
markers are written beside --output, as NAME.others.EXT.")]
pub(crate) struct Rope {
    /// The capture: .c3d, .trc, Motive .csv or a table of markers.
    take: PathBuf,
    /// Where to write the rope's markers: .c3d, .csv or .trc.
    #[arg(long, short)]
    output: PathBuf,
    /// Where a rope is at the start: auto, box:X,Y,Z,X,Y,Z (two corners in metres, Y up) or
    /// list:NAME,NAME,...; give it once for each rope.
    #[arg(long, value_name = "WHERE", default_value = "auto")]
    select: Vec<String>,
    /// How many markers the rope has.
    #[arg(long, value_name = "N")]
    markers: Option<usize>,
    /// Distance between two markers in metres.
    #[arg(long, value_name = "METRES")]
    spacing: Option<f64>,
    /// How the rope is followed.
    #[arg(long, value_enum, default_value_t = Follow::Joint)]
    method: Follow,
    /// Fill gaps from the past alone, as a live capture would.
    #[arg(long)]
    live: bool,
    /// Where to write what is known of every sample (.csv): measured, filled or lost, age of the
    /// gap, confidence.
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Where to draw the gaps over time (.png).
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Where to write the rope as a skinned tube in motion (.glb).
    #[arg(long, value_name = "FILE")]
    glb: Option<PathBuf>,
    /// Where to write the tube as an asset (.sinew).
    #[arg(long, value_name = "FILE")]
    asset: Option<PathBuf>,
    /// Where to film the tube, played from the asset (.gif).
    #[arg(long, value_name = "FILE")]
    gif: Option<PathBuf>,
    /// A body in the same space and time, to go into the same file: .glb, .gltf or .sinew.
    #[arg(long, value_name = "FILE")]
    body: Option<PathBuf>,
    /// Number of the body's clip that belongs to the take.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "body")]
    clip: usize,
    /// Radius of the tube, metres.
    #[arg(long, value_name = "METRES", default_value_t = TubeOptions::default().radius)]
    radius: f64,
    /// Metres of rope beyond the first and the last marker, as FIRST,LAST.
    #[arg(long, value_name = "METRES", default_value = "0,0", value_parser = pair)]
    overhang: [f64; 2],
    #[command(flatten)]
    reading: Reading,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Follow {
    /// All points to all markers at once, with constant lengths and inertia.
    Joint,
    /// As published (Porter 2012): the nearest point to each marker; the rope hangs at the start.
    Published,
}

fn pair(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[first, last]) if (0.0..=5.0).contains(&first) && (0.0..=5.0).contains(&last) => {
            Ok([first, last])
        }
        _ => Err("give two lengths from 0 to 5 m, as 0.05,0".to_owned()),
    }
}

/// What `--select` says.
fn selection(text: &str, take: &Take) -> Result<Selection, Failure> {
    let usage = |why: String| Failure::Usage(format!("--select {text}: {why}"));
    if text == "auto" {
        return Ok(Selection::Automatic);
    }
    if let Some(corners) = text.strip_prefix("box:") {
        let numbers: Result<Vec<f64>, _> = corners.split(',').map(|n| n.trim().parse()).collect();
        return match numbers.as_deref() {
            Ok(n) if n.len() == 6 && n.iter().all(|x| x.is_finite()) => {
                let (a, b) = (DVec3::from_slice(n), DVec3::from_slice(&n[3..]));
                Ok(Selection::Box {
                    low: a.min(b),
                    high: a.max(b),
                })
            }
            _ => Err(usage(
                "give two corners in metres, as box:-1,0,-1,1,2,1".into(),
            )),
        };
    }
    let Some(names) = text.strip_prefix("list:") else {
        return Err(usage("give auto, box:... or list:...".into()));
    };
    let column = |name: &str| {
        let found = take.labels().iter().position(|label| label == name.trim());
        found.ok_or_else(|| {
            let shown: Vec<&str> = take.labels().iter().take(12).map(String::as_str).collect();
            let text = format!(
                "there is no marker {name:?}; the take holds {}",
                shown.join(", ")
            );
            usage(
                text + if take.marker_count() > 12 {
                    ", ..."
                } else {
                    ""
                },
            )
        })
    };
    let columns = names
        .split(',')
        .map(column)
        .collect::<Result<Vec<_>, _>>()?;
    if columns.len() < 3 {
        return Err(usage("list at least three markers".into()));
    }
    Ok(Selection::Columns(columns))
}

impl Rope {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if !(self.radius > 1e-4 && self.radius <= 0.5) {
            return Err(Failure::Usage(
                "--radius must lie between 0.0001 and 0.5 m".into(),
            ));
        }
        for path in [Some(&self.output), self.confidence.as_ref()]
            .into_iter()
            .flatten()
        {
            ending(path, &["c3d", "csv", "trc"])?;
        }
        let (take, notices) = load::take(&self.take, self.reading)?;
        let name = self.take.display().to_string();
        say.notices(&name, &notices);
        if take.marker_count() == 0 || take.frame_count() == 0 {
            let text = format!("{name}: there are no marker samples in it; nothing to follow");
            return Err(Failure::Data(text));
        }
        let points = PointFrames::of_take(&take);
        let traces = self.traces(&take, &points, say)?;
        let separated =
            separate(&take, &points, &traces).map_err(|error| fault(&self.take, &error))?;
        for (rope, trace) in traces.iter().enumerate() {
            let found = trace.marker_count();
            if let Some(wanted) = self.markers.filter(|&wanted| wanted != found) {
                say.line(format!(
                    "note: rope {}: {found} of {wanted} markers ever show together; those are followed",
                    rope + 1
                ));
            }
        }
        let counts = report::count(&traces);
        report::tell(&counts, say);
        self.write_markers(&separated, say)?;
        if let Some(path) = &self.confidence {
            let table = report::samples_csv(&traces);
            write_atomic(path, |out| Ok(out.write_all(table.as_bytes())?))?;
        }
        if let Some(path) = &self.plot {
            write_png(path, &report::timeline(&traces, &name).render(1200, 900))?;
        }
        self.write_tube(&traces, say)?;
        Ok(json!({
            "take": name,
            "output": self.output.display().to_string(),
            "ropes": report::to_json(&counts, &traces),
            "other_markers": separated.others.marker_count(),
            "notices": notices_json(&notices),
        }))
    }

    fn traces(&self, take: &Take, points: &PointFrames, say: &Say) -> Result<Vec<Trace>, Failure> {
        let published = self.method == Follow::Published;
        let ropes = self.select.iter().map(|text| {
            Ok(FollowOptions {
                method: if published {
                    Method::Published
                } else {
                    Method::Joint
                },
                order: if published && text != "auto" {
                    Order::Height
                } else {
                    Order::Spacing
                },
                selection: selection(text, take)?,
                markers: self.markers,
                spacing: self.spacing,
            })
        });
        let ropes = ropes.collect::<Result<Vec<_>, Failure>>()?;
        let bar = say.progress("rope", 3);
        let traces = follow_all(points, &ropes).map_err(|error| fault(&self.take, &error))?;
        bar.inc(1);
        if self.live || published {
            bar.finish_and_clear();
            return Ok(traces);
        }
        let traces = both_ways(points, &traces).map_err(|error| fault(&self.take, &error))?;
        bar.inc(1);
        let repaired = traces
            .iter()
            .map(|trace| repair(trace, &RepairOptions::default()));
        let repaired = repaired.collect();
        bar.finish_and_clear();
        Ok(repaired)
    }

    fn write_markers(&self, separated: &Separated, say: &Say) -> Result<(), Failure> {
        write_take(&separated.rope, &self.output)?;
        say.line(format!("wrote {}", self.output.display()));
        if separated.others.marker_count() > 0 {
            let stem = self
                .output
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy();
            let ending = self
                .output
                .extension()
                .unwrap_or_default()
                .to_string_lossy();
            let path = self
                .output
                .with_file_name(format!("{stem}.others.{ending}"));
            write_take(&separated.others, &path)?;
            let markers = separated.others.marker_count();
            say.line(format!("wrote {} ({markers} markers)", path.display()));
        }
        Ok(())
    }

    /// The tube, alone or beside a body, in every form that is asked for.
    fn write_tube(&self, traces: &[Trace], say: &Say) -> Result<(), Failure> {
        if self.glb.is_none() && self.asset.is_none() && self.gif.is_none() {
            return Ok(());
        }
        let options = TubeOptions {
            radius: self.radius,
            overhang: self.overhang,
            ..TubeOptions::default()
        };
        let mut scene = match &self.body {
            Some(path) => Some(body(path, say)?),
            None => None,
        };
        for (rope, trace) in traces.iter().enumerate() {
            let name = if rope == 0 {
                "rope".to_owned()
            } else {
                format!("rope{}", rope + 1)
            };
            let Some(tube) = tube(trace, &name, &options) else {
                continue;
            };
            scene = Some(match scene {
                Some(whole) => beside(&whole, self.clip, &tube),
                None => tube,
            });
        }
        let Some(scene) = scene else {
            return Ok(());
        };
        if let Some(path) = &self.glb {
            let clips = scene
                .clips
                .get(self.clip..=self.clip)
                .unwrap_or(&scene.clips);
            let file = write_glb_of(&scene, clips)?;
            write_atomic(path, |out| Ok(out.write_all(&file)?))?;
            say.line(format!("wrote {}", path.display()));
        }
        if self.asset.is_none() && self.gif.is_none() {
            return Ok(());
        }
        let baked = bake(&scene, &BakeOptions::default())?;
        if let Some(path) = &self.asset {
            write_asset(&baked, path)?;
            say.line(format!("wrote {}", path.display()));
        }
        if let Some(path) = &self.gif {
            let index = self.clip.min(scene.clips.len().saturating_sub(1));
            let duration = scene.clips.get(index).map_or(0.0, |clip| clip.duration);
            let motion = Motion::Own { index, duration };
            let film = Film::new(baked.bytes.asset()?, &motion, Shot::default());
            let bar = say.progress("drawing", film.frame_count());
            film.write_gif(path, |done| bar.set_position(done as u64))?;
            bar.finish_and_clear();
            say.line(format!("wrote {}", path.display()));
        }
        Ok(())
    }
}

fn body(path: &Path, say: &Say) -> Result<Avatar, Failure> {
    let (loaded, notices) = load::any(path, Reading::default())?;
    say.notices(&path.display().to_string(), &notices);
    match loaded {
        Loaded::Avatar(avatar) => Ok(*avatar),
        Loaded::Asset(bytes) => {
            let asset = bytes.asset().map_err(|error| fault(path, &error))?;
            Ok(reference::unpack(&asset))
        }
        _ => Err(Failure::Usage(format!(
            "{}: a body with skin weights is needed; give a .glb, .gltf or .sinew",
            path.display()
        ))),
    }
}

fn ending(path: &Path, known: &[&str]) -> Result<String, Failure> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    if known.contains(&ending.as_str()) {
        Ok(ending)
    } else {
        let text = format!(
            "{}: the name must end in .{}",
            path.display(),
            known.join(", .")
        );
        Err(Failure::Usage(text))
    }
}

/// Writes a take by its name's ending, whole or not at all.
fn write_take(take: &Take, path: &Path) -> Result<(), Failure> {
    let raw = take.to_raw();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let ending = ending(path, &["c3d", "csv", "trc"])?;
    write_atomic(path, |out| match ending.as_str() {
        "c3d" => write_c3d(&raw, out),
        "csv" => write_marker_csv(&raw, out),
        _ => write_trc(&raw, &name, out),
    })?;
    Ok(())
}
