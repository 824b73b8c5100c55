//! `sinew register`: a detailed mesh fitted to the markers of one frame.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};

use super::load::{Loaded, Reading, fault};
use super::say::{Say, notices_json};
use super::{Failure, load};
use crate::export::obj::write_obj;
use crate::export::png::write_png;
use crate::export::render::Colors;
use crate::export::sheet::body_sheet;
use crate::export::{ExportErrorKind, write_atomic, write_glb_of};
use crate::fit::register::rig::rerig;
use crate::fit::register::{
    Landmark, RegisterOptions, Registration, Template, reference_frame, register, reshaped,
};
use crate::model::{Avatar, Mesh};
use crate::take::Take;

/// Fit a detailed mesh to the markers of one frame: the mesh takes the body's shape and pose, and
/// each marker is glued to a point of it.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew register --mesh body.glb --markers clean.c3d --output fitted.glb
  sinew register --mesh scan.obj --markers clean.c3d --frame 12 --output fitted.obj --picture fit.png
  sinew register --mesh scan.ply --markers take.trc --landmark C7=1203 --landmark LELB=877 \\
      --output fitted.obj --glue glue.json

A .glb with a rig is posed first, so that its pose and proportions may differ from the frame's; the
result keeps the rig, with the frame's pose as its rest pose. Without a rig, mesh and frame should
stand alike.")]
pub(crate) struct Register {
    /// The mesh: .glb or .gltf (with its rig), .obj or .ply.
    #[arg(long)]
    mesh: PathBuf,
    /// The capture: .c3d, .trc, Motive .csv or a table of markers; cleaned, if it has gaps.
    #[arg(long, value_name = "TAKE")]
    markers: PathBuf,
    /// The frame (0 is the first) whose shape the mesh takes; by default the first that shows
    /// nearly as many markers as any.
    #[arg(long)]
    frame: Option<usize>,
    /// A marker and the vertex (from 0) that it sits on; may be given several times.
    #[arg(long, value_name = "LABEL=VERTEX", value_parser = landmark)]
    landmark: Vec<(String, usize)>,
    /// Leave the rig aside.
    #[arg(long)]
    no_rig: bool,
    /// Above 1 keeps more of the mesh's own shape, below 1 follows markers more freely.
    #[arg(long, default_value_t = 1.0)]
    stiffness: f64,
    /// Where to write the fitted mesh: .glb (with the rig) or .obj.
    #[arg(long, short)]
    output: PathBuf,
    /// Where to write the point that each marker is glued to (.json).
    #[arg(long, value_name = "JSON")]
    glue: Option<PathBuf>,
    /// Where to draw the fitted mesh with the markers (.png).
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

fn landmark(text: &str) -> Result<(String, usize), String> {
    let wrong = || "give a marker's label, = and the number of a vertex".to_owned();
    let (label, vertex) = text.rsplit_once('=').ok_or_else(wrong)?;
    Ok((label.to_owned(), vertex.parse().map_err(|_| wrong())?))
}

/// A mesh, with its rig where it has one.
pub(super) enum Body {
    Mesh(Box<Mesh>),
    Rigged(Box<Avatar>),
}

impl Body {
    /// Reads a mesh, and its rig unless that is not wanted.
    pub(super) fn load(
        path: &Path,
        reading: Reading,
        rig: bool,
        say: &Say,
    ) -> Result<Self, Failure> {
        let (loaded, notices) = load::any(path, reading)?;
        say.notices(&path.display().to_string(), &notices);
        match loaded {
            Loaded::Avatar(avatar) if rig => Ok(Self::Rigged(avatar)),
            Loaded::Avatar(avatar) => Ok(Self::Mesh(Box::new(avatar.mesh))),
            Loaded::Mesh(mesh) => Ok(Self::Mesh(mesh)),
            _ => Err(Failure::Usage(format!(
                "{}: a mesh is needed; give a .glb, .gltf, .obj or .ply",
                path.display()
            ))),
        }
    }

    pub(super) fn mesh(&self) -> &Mesh {
        match self {
            Self::Mesh(mesh) => mesh,
            Self::Rigged(avatar) => &avatar.mesh,
        }
    }

    fn template(&self) -> Template<'_> {
        match self {
            Self::Mesh(mesh) => Template::Mesh(mesh),
            Self::Rigged(avatar) => Template::Rigged(avatar),
        }
    }
}

/// The frame asked for, or the first that shows nearly as many markers as any.
pub(super) fn chosen_frame(
    take: &Take,
    path: &Path,
    frame: Option<usize>,
) -> Result<usize, Failure> {
    let (name, count) = (path.display(), take.frame_count());
    if count == 0 || take.marker_count() == 0 {
        let text = format!("{name}: there are no marker samples in it; nothing to fit to");
        return Err(Failure::Data(text));
    }
    match frame {
        Some(frame) if frame >= count => Err(Failure::Usage(format!(
            "--frame: {name} has {count} frames"
        ))),
        Some(frame) => Ok(frame),
        None => Ok(reference_frame(take)),
    }
}

impl Register {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let ending = ending(&self.output);
        if !["glb", "obj"].contains(&ending.as_str()) {
            let text = format!("{}: give a .glb or .obj to write", self.output.display());
            return Err(Failure::Usage(text));
        }
        let body = Body::load(&self.mesh, self.reading, !self.no_rig, say)?;
        let (take, notices) = load::take(&self.markers, self.reading)?;
        let name = self.markers.display().to_string();
        say.notices(&name, &notices);
        let frame = chosen_frame(&take, &self.markers, self.frame)?;
        let options = RegisterOptions {
            landmarks: self.landmarks(&take)?,
            stiffness: self.stiffness,
            ..RegisterOptions::default()
        };
        let markers: Vec<Option<DVec3>> = (0..take.marker_count())
            .map(|marker| take.position(marker, frame))
            .collect();
        let start = Instant::now();
        let bar = say.progress("register", options.rounds + 2);
        let found = register(body.template(), &markers, &options, &|done| {
            bar.set_position(done as u64);
        });
        bar.finish_and_clear();
        let found = found.map_err(|error| fault(&self.markers, &error))?;
        let seconds = start.elapsed().as_secs_f64();
        tell(say, &take, frame, &found, seconds);
        let mut object = to_json(&take, frame, &found, seconds);
        object["mesh"] = json!(self.mesh.display().to_string());
        object["markers"] = json!(name);
        object["output"] = json!(self.output.display().to_string());
        object["notices"] = notices_json(&notices);
        if let Some(path) = &self.glue {
            let glue = json!({ "frame": frame, "markers": glue_json(&take, &found) });
            write_bytes(path, format!("{glue:#}\n").as_bytes())?;
        }
        if let Some(path) = &self.picture {
            write_png(path, &picture(body.mesh(), &markers, &found))?;
        }
        let bytes = match (&body, ending.as_str()) {
            (_, "obj") => write_obj(&reshaped(body.mesh(), &found.positions)).into_bytes(),
            (Body::Rigged(avatar), _) => {
                let fitted = rerig(avatar, &found)?;
                write_glb_of(&fitted, &fitted.clips)?
            }
            (Body::Mesh(mesh), _) => {
                let mesh = reshaped(mesh, &found.positions);
                crate::export::glb::write_glb(&crate::export::glb::GlbScene {
                    name: &mesh.name,
                    positions: &mesh.positions,
                    normals: Some(&mesh.normals),
                    triangles: &mesh.triangles,
                    ..Default::default()
                })?
            }
        };
        write_bytes(&self.output, &bytes)?;
        say.line(format!("wrote {}", self.output.display()));
        Ok(object)
    }

    fn landmarks(&self, take: &Take) -> Result<Vec<Landmark>, Failure> {
        let find = |(label, vertex): &(String, usize)| {
            let marker = take.labels().iter().position(|own| own == label);
            let marker = marker.ok_or_else(|| {
                let take = self.markers.display();
                Failure::Usage(format!(
                    "--landmark {label}: {take} has no marker of this name"
                ))
            })?;
            Ok(Landmark {
                marker,
                vertex: *vertex,
            })
        };
        self.landmark.iter().map(find).collect()
    }
}

pub(super) fn ending(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default();
    ending.to_string_lossy().to_lowercase()
}

pub(super) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    Ok(write_atomic(path, |out| {
        out.write_all(bytes).map_err(ExportErrorKind::from)
    })?)
}

fn tell(say: &Say, take: &Take, frame: usize, found: &Registration, seconds: f64) {
    let report = &found.report;
    let mm = |metres: f64| 1e3 * metres;
    say.line(format!(
        "frame {frame}: {} of {} markers seen, registered in {seconds:.1} s",
        report.seen,
        take.marker_count()
    ));
    say.line(format!(
        "{:>34} {:>10.1} mm",
        "markers from the aligned mesh",
        mm(report.aligned)
    ));
    if !found.joints.is_empty() {
        say.line(format!(
            "{:>34} {:>10.1} mm",
            "from the posed rig",
            mm(report.posed)
        ));
    }
    say.line(format!(
        "{:>34} {:>10.3} mm rms, {:.3} mm at most",
        "from the fitted mesh",
        mm(report.residual_rms),
        mm(report.residual_max)
    ));
    say.line(format!(
        "size {:.3} of the mesh's; {} landmarks; triangles folded: none{}",
        report.scale,
        report.landmarks,
        match report.repairs {
            0 => String::new(),
            count => format!(" (after {count} local repairs)"),
        }
    ));
    for &marker in &report.strays {
        say.line(format!(
            "note: {}: too far from any such body; left out",
            take.labels()[marker]
        ));
    }
}

fn to_json(take: &Take, frame: usize, found: &Registration, seconds: f64) -> Value {
    let report = &found.report;
    let label = |&marker: &usize| take.labels()[marker].clone();
    json!({
        "frame": frame,
        "seconds": seconds,
        "markers_seen": report.seen,
        "strays": report.strays.iter().map(label).collect::<Vec<_>>(),
        "scale": report.scale,
        "aligned_m": report.aligned,
        "posed_m": report.posed,
        "landmarks": report.landmarks,
        "rounds_m": report.rounds,
        "residual_rms_m": report.residual_rms,
        "residual_max_m": report.residual_max,
        "repairs": report.repairs,
    })
}

fn glue_json(take: &Take, found: &Registration) -> Value {
    let markers = take.labels().iter().zip(&found.glue).map(|(label, glue)| {
        let Some(glue) = glue else {
            return json!({ "label": label });
        };
        json!({
            "label": label,
            "triangle": glue.triangle,
            "vertices": glue.vertices,
            "barycentric": glue.barycentric,
        })
    });
    Value::Array(markers.collect())
}

fn picture(
    mesh: &Mesh,
    markers: &[Option<DVec3>],
    found: &Registration,
) -> crate::export::render::Image {
    let dots: Vec<DVec3> = markers.iter().flatten().copied().collect();
    body_sheet(
        &found.positions,
        &mesh.triangles,
        Colors::Uniform([208, 170, 148]),
        &dots,
        Colors::Uniform([214, 39, 40]),
        800,
    )
}
