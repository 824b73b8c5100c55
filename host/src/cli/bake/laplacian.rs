//! `sinew bake --mode laplacian`: a scan and what it is to follow into an asset, without a skeleton.

mod follow;
mod report;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};

use super::super::load::{self, Loaded, Reading, fault};
use super::super::say::{Say, bytes, notices_json};
use super::super::verify::{measure, to_json as error_json};
use super::super::{Failure, cost};
use super::{tell, to_json, write};
use crate::bake::{BakeOptions, bake_rig};
use crate::export::png::write_png;
use crate::export::write_atomic;
use crate::fit::laplace::align::{Alignment, Similarity, align, best_frame};
use crate::fit::laplace::drive::{Retarget, Rotations};
use crate::fit::laplace::picture::marker_sheet;
use crate::fit::laplace::repair::{RepairOptions, Repaired, repair};
use crate::fit::laplace::rig::{Rig, RigOptions, Solve, rig};
use crate::fit::laplace::{
    DriveOptions, Driven, LaplaceError, Pairs, SurfaceOptions, Template, drive,
};
use crate::model::{Mesh, Notice};
use crate::verify::{BAKE_LIMIT, limit_of};
use report::{rig_json, tell_drive, tell_rig};
use sinew_core::frame::Budget;

/// What a scan follows, and how (--mode laplacian).
#[derive(Args, Clone)]
#[command(next_help_heading = "A scan without a skeleton (--mode laplacian)")]
pub(crate) struct Laplacian {
    /// Moving template to follow: a .bvh skeleton, a .glb body with a clip, or a folder with one
    /// .ply or .obj a frame (meshes or point clouds).
    #[arg(long, value_name = "FILE", conflicts_with = "markers")]
    template: Option<PathBuf>,
    /// Marker file to use: which vertex of the scan follows which point of the template.
    #[arg(long, value_name = "FILE")]
    pairs: Option<PathBuf>,
    /// Where to write the marker file that was used, to look at and to edit.
    #[arg(long, value_name = "FILE")]
    save_pairs: Option<PathBuf>,
    /// Markers to propose where the template has more points.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u16).range(3..=4096))]
    marker_count: u16,
    /// The template's frame in whose pose the scan stands; by default the one that fits best. Frame
    /// 0 of a skeleton or body is its rest pose.
    #[arg(long, value_name = "FRAME")]
    pose_frame: Option<usize>,
    /// Frames a second of a folder of meshes.
    #[arg(long, default_value_t = 30.0)]
    template_rate: f64,
    /// Solve the surface in every frame instead of collapsing it to sums over handles.
    #[arg(long)]
    exact: bool,
    /// Largest distance of 99 of 100 vertices of the collapsed surface from the exact one, mm.
    #[arg(long, value_name = "MM", default_value_t = 3.0)]
    tolerance: f64,
    /// Fit the collapsed surface to poses whose volume was restored.
    #[arg(long, conflicts_with = "exact")]
    keep_volume: bool,
    /// Components without a marker follow the nearest marker instead of being an error.
    #[arg(long)]
    attach: bool,
    /// Where the rotations of markers come from.
    #[arg(long, value_enum, default_value_t = Source::Template)]
    rotations: Source,
    /// Whether positions are scaled part by part, for a scan of other proportions.
    #[arg(long, value_enum, default_value_t = Adapt::Auto)]
    retarget: Adapt,
    /// Do not hold standing feet still on the floor when positions are scaled.
    #[arg(long)]
    keep_feet: bool,
    /// Weld vertices of the scan at most this far apart, mm; equal ones are always welded.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    weld: f64,
    /// Remove components of the scan with fewer vertices.
    #[arg(long, value_name = "VERTICES", default_value_t = 0)]
    dust: usize,
    /// Where to draw markers and handles on the scan (.png).
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Source {
    /// What carries the marker where the template knows it, else its neighbours.
    Template,
    /// The markers around that keep their distance.
    Neighbours,
    /// The edges of a spanning tree, and the paper's equations throughout.
    Tree,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Adapt {
    /// Where proportions differ.
    Auto,
    /// In any case.
    Always,
    /// Never.
    Never,
}

/// The scan and what repairing made of it.
struct Scan {
    mesh: Mesh,
    repaired: Repaired,
    notices: Vec<Notice>,
}

impl Laplacian {
    /// `followed`: the capture and the motions of the command's own options.
    pub fn run(
        &self,
        mesh: &Path,
        followed: (Option<&PathBuf>, &[PathBuf]),
        reading: Reading,
        baking: &BakeOptions,
        output: &Path,
        say: &Say,
    ) -> Result<Value, Failure> {
        let tolerance = 1e-3 * self.tolerance;
        if !(tolerance > 0.0 && self.weld >= 0.0 && self.template_rate > 0.0) {
            let text = "--tolerance and --template-rate must be above 0, --weld not below";
            return Err(Failure::Usage(text.into()));
        }
        let scan = self.scan(mesh, reading, say)?;
        let (path, template) = self.template(followed, reading, say)?;
        let at = |error: LaplaceError| fault(&path, &error);
        let (pairs, alignment) = self.pairs(&scan, &template, &path, say)?;
        if let Some(to) = &self.save_pairs {
            let text = pairs.to_text(&template, &scan.mesh.positions);
            write_atomic(to, |file| Ok(file.write_all(text.as_bytes())?))?;
            say.line(format!(
                "wrote {} (edit it, then give it as --pairs)",
                to.display()
            ));
        }
        let options = DriveOptions {
            rotations: match self.rotations {
                Source::Template => Rotations::Template,
                Source::Neighbours => Rotations::Neighbours,
                Source::Tree => Rotations::Tree,
            },
            retarget: match self.retarget {
                Adapt::Auto => Retarget::Auto,
                Adapt::Always => Retarget::Always,
                Adapt::Never => Retarget::Never,
            },
            keep_feet: self.keep_feet,
        };
        let driven = drive(&template, &pairs, &scan.mesh.positions, &options).map_err(at)?;
        tell_drive(&driven, say);
        let rig = self.rig(mesh, &scan, &template, &pairs, &driven, tolerance)?;
        tell_rig(&rig, say);
        if let Some(to) = &self.picture {
            write_png(to, &marker_sheet(&rig, 640))?;
            say.line(format!("wrote {}", to.display()));
        }
        let baked = bake_rig(&rig, baking)?;
        let asset = baked.bytes.asset()?;
        tell(&baked.report, say);
        let error = measure(&asset, &rig.body, say);
        let length = baked.bytes.as_slice().len();
        cost::tell(&asset, length, Budget::UNLIMITED, say);
        write(&baked, output)?;
        say.line(format!("wrote {} ({})", output.display(), bytes(length)));
        let mut object = to_json(&baked.report);
        object["output"] = json!(output.display().to_string());
        object["error"] = error_json(&error, limit_of(&asset, BAKE_LIMIT));
        object["cost"] = cost::to_json(&asset, length, Budget::UNLIMITED);
        object["notices"] = notices_json(&scan.notices);
        object["repairs"] = json!(scan.repaired.report.lines());
        object["laplacian"] = rig_json(&rig, &driven.report, alignment.as_ref());
        Ok(object)
    }

    fn scan(&self, path: &Path, reading: Reading, say: &Say) -> Result<Scan, Failure> {
        let (loaded, notices) = load::any(path, reading)?;
        let mesh = match loaded {
            Loaded::Mesh(mesh) => *mesh,
            Loaded::Avatar(avatar) => avatar.mesh,
            _ => {
                let text = "a scan is needed; give a .ply, .obj, .glb or .gltf";
                return Err(Failure::Usage(format!("{}: {text}", path.display())));
            }
        };
        let name = path.display().to_string();
        say.notices(&name, &notices);
        let options = RepairOptions {
            weld_distance: 1e-3 * self.weld,
            smallest_component: self.dust,
        };
        let repaired = repair(&mesh.positions, &mesh.triangles, &options)
            .map_err(|error| fault(path, &error))?;
        for line in repaired.report.lines() {
            say.line(format!("note: {name}: {line}"));
        }
        Ok(Scan {
            mesh,
            repaired,
            notices,
        })
    }

    /// Pairs in the numbers of the scan's file.
    fn pairs(
        &self,
        scan: &Scan,
        template: &Template,
        path: &Path,
        say: &Say,
    ) -> Result<(Pairs, Option<Alignment>), Failure> {
        if let Some(file) = &self.pairs {
            let text = std::fs::read_to_string(file).map_err(|error| fault(file, &error))?;
            let pairs = Pairs::from_text(&text, template, &scan.mesh.positions);
            return Ok((pairs.map_err(|error| fault(file, &error))?, None));
        }
        let repaired = &scan.repaired;
        let places = &repaired.positions;
        let all: Vec<u32> = (0..template.point_count() as u32).collect();
        let found = match self.pose_frame {
            Some(frame) if frame >= template.frame_count() => {
                let count = template.frame_count();
                let text = format!("--pose-frame {frame}: the template has {count} frames");
                return Err(Failure::Usage(text));
            }
            Some(frame) => {
                align(&template.positions(&all, frame), places, None).map(|found| (frame, found))
            }
            None => best_frame(template, places),
        };
        let (frame, alignment) = found.map_err(|error| fault(path, &error))?;
        let (similarity, residual) = (&alignment.similarity, 1e3 * alignment.residual);
        let stance = if template.motion().contains(&frame) {
            ""
        } else {
            " (no frame of the motion: a pose that people are scanned in)"
        };
        say.line(format!(
            "aligned to frame {frame}{stance}: size x {:.3}, {residual:.1} mm from the scan; fits {:.2} x as \
             well as the next direction",
            similarity.scale, alignment.lead
        ));
        if alignment.lead < 1.1 {
            say.line("note: that is close to a draw; look at --picture, or give --pairs");
        }
        let count = usize::from(self.marker_count);
        let surface = (&places[..], &repaired.triangles[..]);
        let mut pairs = Pairs::propose(template, frame, similarity, surface, count);
        if !template.has_rotations() {
            tell_far(template, &pairs, similarity, places, say);
        }
        for pair in &mut pairs.pairs {
            pair.vertex = repaired.source_of[pair.vertex as usize];
        }
        Ok((pairs, Some(alignment)))
    }

    fn rig(
        &self,
        path: &Path,
        scan: &Scan,
        template: &Template,
        pairs: &Pairs,
        driven: &Driven,
        tolerance: f64,
    ) -> Result<Rig, Failure> {
        let vertices = pairs.pairs.iter().enumerate().map(|(marker, pair)| {
            let vertex = scan.repaired.vertex_of[pair.vertex as usize];
            vertex.ok_or(LaplaceError::BadMarker {
                marker,
                vertex: pair.vertex,
                why: "which is not part of the repaired surface",
            })
        });
        let at = |error: LaplaceError| {
            let hint = match &error {
                LaplaceError::Unmarked { .. } => " (--attach, or --dust to remove small ones)",
                _ => "",
            };
            Failure::Data(format!("{}: {error}{hint}", path.display()))
        };
        let vertices = vertices.collect::<Result<Vec<u32>, _>>().map_err(at)?;
        let name = |&point: &u32| template.labels[point as usize].clone();
        let names: Vec<String> = pairs.points().iter().map(name).collect();
        let options = RigOptions {
            solve: if self.exact {
                Solve::Exact
            } else {
                Solve::Collapsed { tolerance }
            },
            surface: if self.rotations == Source::Tree {
                SurfaceOptions::PAPER
            } else {
                SurfaceOptions::default()
            },
            attach: self.attach,
            keep_volume: self.keep_volume,
        };
        let (mesh, repaired) = (&scan.mesh, &scan.repaired);
        rig(mesh, repaired, &vertices, &names, driven, &options).map_err(at)
    }
}

/// Names markers that are far from the scan: the take does not show the scan's pose there.
fn tell_far(
    template: &Template,
    pairs: &Pairs,
    alignment: &Similarity,
    places: &[DVec3],
    say: &Say,
) {
    /// Metres; markers stand off the skin by less.
    const FAR: f64 = 0.06;
    let points = template.positions(&pairs.points(), pairs.reference.unwrap_or(0));
    let distance =
        |(point, vertex): (&DVec3, u32)| alignment.apply(*point).distance(places[vertex as usize]);
    let far: Vec<String> = points
        .iter()
        .zip(pairs.vertices())
        .map(distance)
        .zip(pairs.points())
        .filter(|(distance, _)| *distance > FAR)
        .map(|(distance, point)| {
            let label = &template.labels[point as usize];
            format!("{label} ({:.0} mm)", 1e3 * distance)
        })
        .collect();
    if !far.is_empty() {
        say.line(format!(
            "note: {} of {} markers are far from the scan where the take is most like it, so the \
             take does not show its pose: {}; give --pairs, or make a skeleton of the take (sinew \
             solve) and give that as --template",
            far.len(),
            points.len(),
            far.join(", ")
        ));
    }
}
