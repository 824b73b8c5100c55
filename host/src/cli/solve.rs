//! `sinew solve`: markers to skeleton motion.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use serde_json::{Value, json};

use super::load::{Reading, fault};
use super::say::{Say, notices_json, thousands};
use super::{Failure, load};
use crate::export::bvh::{BvhStyle, RotationOrder, write_bvh};
use crate::export::plot::{Chart, Series, Style};
use crate::export::png::write_png;
use crate::export::write_atomic;
use crate::film::skeleton;
use crate::fit::solve::{FAULT, MarkerSet, Progress, SolveOptions, Solved, solve};

/// Find the skeleton and its motion in a marker capture: joint centres and bone lengths from the
/// motion, joint rotations from all markers at once.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew solve take.c3d --output walk.bvh
  sinew solve take.trc --output walk.bvh --sheet sticks.png --plot residuals.png --report walk.json
  sinew solve take.c3d --output walk.bvh --order XYZ --z-up --units-per-metre 1
  sinew solve props.c3d --set groups --output props.bvh

Known labels: Plug-in Gait, CMU 41, OptiTrack Baseline, Helen Hayes, Cleveland Clinic and their like,
with or without a subject's prefix. Markers with other labels go where they sit still. A take without
known labels is split into near-rigid groups, joined where they turn about a common point.")]
pub(crate) struct Solve {
    /// The capture: .c3d, .trc, Motive .csv or a table of markers.
    take: PathBuf,
    /// Where to write the motion (.bvh).
    #[arg(long, short)]
    output: PathBuf,
    /// How markers are understood.
    #[arg(long, value_enum, default_value_t = Set::Auto)]
    set: Set,
    /// Bridge gaps by the segment's other markers alone instead of estimating them first.
    #[arg(long)]
    no_fill: bool,
    /// From the skin to the centre of a marker, millimetres.
    #[arg(long, value_name = "MM", default_value_t = 1e3 * SolveOptions::default().marker_radius)]
    marker_radius: f64,
    /// Order of the rotation channels, such as ZXY or XYZ.
    #[arg(long, value_name = "ORDER", default_value = "ZXY", value_parser = order)]
    order: RotationOrder,
    /// Units of the file in a metre.
    #[arg(long, value_name = "N", default_value_t = 100.0)]
    units_per_metre: f64,
    /// Write Z up instead of Y.
    #[arg(long)]
    z_up: bool,
    /// Where to draw the skeleton with its markers (.png).
    #[arg(long)]
    sheet: Option<PathBuf>,
    /// Where to draw the residual of each marker (.png).
    #[arg(long)]
    plot: Option<PathBuf>,
    /// Where to write the report (.json); `--json` puts the same on standard output.
    #[arg(long)]
    report: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Clone, Copy, ValueEnum)]
enum Set {
    /// By labels where they are known, else by motion.
    Auto,
    /// By the labels of the standard sets.
    Labels,
    /// By near-rigid groups.
    Groups,
}

fn order(text: &str) -> Result<RotationOrder, String> {
    RotationOrder::parse(text).ok_or_else(|| "give each of X, Y and Z once, such as ZXY".into())
}

impl Solve {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if !(self.units_per_metre.is_finite() && self.units_per_metre > 0.0) {
            return Err(Failure::Usage("--units-per-metre must be above 0".into()));
        }
        if !(0.0..=100.0).contains(&self.marker_radius) {
            let text = "--marker-radius must lie between 0 and 100 mm";
            return Err(Failure::Usage(text.into()));
        }
        let (take, notices) = load::take(&self.take, self.reading)?;
        let name = self.take.display().to_string();
        say.notices(&name, &notices);
        let options = SolveOptions {
            set: match self.set {
                Set::Auto => MarkerSet::Auto,
                Set::Labels => MarkerSet::Labels,
                Set::Groups => MarkerSet::Groups,
            },
            fill: !self.no_fill,
            marker_radius: self.marker_radius / 1e3,
        };
        let begun = Instant::now();
        let bar: Mutex<Option<ProgressBar>> = Mutex::new(None);
        let with_bar = |change: &dyn Fn(&mut Option<ProgressBar>)| {
            if let Ok(mut bar) = bar.lock() {
                change(&mut bar);
            }
        };
        let progress = Progress {
            stage: &|what, count| {
                with_bar(&|bar| {
                    if let Some(old) = bar.replace(say.progress(what, count)) {
                        old.finish_and_clear();
                    }
                });
            },
            done: &|count| {
                with_bar(&|bar| {
                    if let Some(bar) = bar {
                        bar.inc(count as u64);
                    }
                });
            },
        };
        let stem = self.take.file_stem().unwrap_or_default().to_string_lossy();
        let solved = solve(&take, &stem, options, progress);
        with_bar(&|bar| {
            if let Some(bar) = bar.take() {
                bar.finish_and_clear();
            }
        });
        let solved = solved.map_err(|error| fault(&self.take, &error))?;
        let seconds = begun.elapsed().as_secs_f64();
        tell(&solved, take.frame_count(), seconds, say);

        let style = BvhStyle {
            order: self.order,
            units_per_metre: self.units_per_metre,
            z_up: self.z_up,
        };
        write_atomic(&self.output, |out| write_bvh(&solved.motion, style, out))?;
        if let Some(path) = &self.sheet {
            write_png(path, &skeleton::sheet(&solved.motion, Some(&take), 360))?;
        }
        if let Some(path) = &self.plot {
            write_png(path, &chart(&solved).render(1200, 500))?;
        }
        let mut object = to_json(&solved);
        object["take"] = json!(name);
        object["output"] = json!(self.output.display().to_string());
        object["seconds"] = json!(seconds);
        object["notices"] = notices_json(&notices);
        if let Some(path) = &self.report {
            let text = format!("{object:#}\n");
            write_atomic(path, |out| Ok(out.write_all(text.as_bytes())?))?;
        }
        say.line(format!("wrote {}", self.output.display()));
        Ok(object)
    }
}

fn tell(solved: &Solved, frames: usize, seconds: f64, say: &Say) {
    let joints = &solved.motion.skeleton.joints;
    let how = if solved.by_labels {
        format!("labels understood, subject {:.2} of 1.75 m", solved.scale)
    } else {
        "no known labels: joints from rigid groups".into()
    };
    say.line(format!(
        "{how}; {} joints, {} markers, {} frames, solved in {seconds:.1} s",
        joints.len(),
        solved.markers.len(),
        thousands(frames as u64),
    ));
    say.line(format!(
        "markers lie {:.1} mm (rms) from where the skeleton carries them",
        1e3 * solved.residual
    ));
    if solved.faults > 0 {
        say.line(format!(
            "note: {} samples are farther than {:.0} mm from there and count as faults",
            thousands(solved.faults as u64),
            1e3 * FAULT
        ));
    }
    let mut worst: Vec<_> = solved.markers.iter().collect();
    worst.sort_by(|a, b| b.rms.total_cmp(&a.rms));
    for marker in worst.iter().take(5) {
        say.line(format!(
            "  {:<12} on {:<14} {:>5.1} mm rms, {:>6.1} mm at most (frame {})",
            marker.label,
            joints[marker.joint].name,
            1e3 * marker.rms,
            1e3 * marker.worst.0,
            marker.worst.1,
        ));
    }
    for bone in &solved.bones {
        if let Some((other, more)) = bone.other.filter(|(other, _)| *other > bone.joint) {
            let [a, b] = [bone.joint, other].map(|at| joints[at].name.as_str());
            let length = |joint| solved.bones.iter().find(|bone| bone.joint == joint);
            let right = length(other).map_or(0.0, |bone| bone.length);
            say.line(format!(
                "  to {a} {:.1} mm, to {b} {:.1} mm ({:+.1} %){}",
                1e3 * bone.length,
                1e3 * right,
                100.0 * more,
                if bone.seen { "" } else { ", not seen" },
            ));
        }
    }
    if !solved.ignored.is_empty() {
        say.line(format!(
            "note: on no segment, left out: {}",
            solved.ignored.join(", ")
        ));
    }
    if solved.held_frames > 0 {
        say.line(format!(
            "note: {} frames show too little; they take over their neighbours' pose",
            thousands(solved.held_frames as u64)
        ));
    }
}

fn chart(solved: &Solved) -> Chart {
    let millimetres = |value: &dyn Fn(usize) -> f64| {
        let points = (0..solved.markers.len()).map(|at| [at as f64, 1e3 * value(at)]);
        points.collect::<Vec<_>>()
    };
    Chart {
        title: "Distance of each marker from where the skeleton carries it".into(),
        y_label: "mm (rms)".into(),
        series: vec![Series::new(
            "",
            Style::Bars,
            millimetres(&|at| solved.markers[at].rms),
        )],
        categories: solved
            .markers
            .iter()
            .map(|marker| marker.label.clone())
            .collect(),
        ..Chart::default()
    }
}

fn to_json(solved: &Solved) -> Value {
    let joints = &solved.motion.skeleton.joints;
    let name = |joint: usize| joints[joint].name.as_str();
    let markers = solved.markers.iter().map(|marker| {
        json!({
            "label": marker.label,
            "joint": name(marker.joint),
            "offset_m": marker.offset.to_array(),
            "seen": marker.seen,
            "faults": marker.faults,
            "rms_m": marker.rms,
            "worst_m": marker.worst.0,
            "worst_frame": marker.worst.1,
        })
    });
    let bones = solved.bones.iter().map(|bone| {
        json!({
            "joint": name(bone.joint),
            "length_m": bone.length,
            "seen": bone.seen,
            "other_side": bone.other.map(|(joint, _)| name(joint)),
            "longer_than_other_side": bone.other.map(|(_, more)| more),
        })
    });
    json!({
        "by_labels": solved.by_labels,
        "scale": solved.by_labels.then_some(solved.scale),
        "residual_rms_m": solved.residual,
        "faults": solved.faults,
        "held_frames": solved.held_frames,
        "ignored": solved.ignored,
        "markers": markers.collect::<Vec<_>>(),
        "bones": bones.collect::<Vec<_>>(),
    })
}
