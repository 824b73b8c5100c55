//! `sinew segment`: a body cut into near-rigid parts.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};

use super::load::{Reading, fault};
use super::register::{Body, chosen_frame, write_bytes};
use super::say::Say;
use super::{Failure, load};
use crate::export::npy::parse_npy;
use crate::export::png::write_png;
use crate::export::render::{Colors, Rgb};
use crate::export::sheet::{PART_COLORS, body_sheet};
use crate::fit::register::Glue;
use crate::fit::register::marker_surface::{marker_surface, nearest_markers};
use crate::fit::segment::rig::carried_over;
use crate::fit::segment::{SegmentOptions, Segmentation, parts_of_rig, segment};
use crate::model::Mesh;
use crate::spatial::Tree;
use crate::take::Take;

/// Markers farther than this from the mesh, on average, do not belong to it: metres.
const FAR: f64 = 0.01;

/// Cut a body into near-rigid parts, by how its markers (or a sequence of meshes) move, or by its
/// rig.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew segment --mesh fitted.glb --markers range_of_motion.c3d --output parts.json --picture parts.png
  sinew segment --mesh fitted.obj --markers range_of_motion.c3d --parts 17 --output parts.json
  sinew segment --mesh rest.obj --sequence frames.npy --output parts.json
  sinew segment --mesh body.glb --from rig --output parts.json

--mesh is what `sinew register` wrote for the same take: markers are glued to the points of it that
are nearest in the reference frame. A sequence is float32 [frames, vertices, 3] in metres.

parts.json holds names, the part that each hangs on, and the part of each vertex, triangle and marker.")]
pub(crate) struct Segment {
    /// The registered mesh, or the reference mesh of a sequence.
    #[arg(long)]
    mesh: PathBuf,
    /// A take that shows the range of motion of every joint; cleaned, if it has gaps.
    #[arg(long, value_name = "TAKE", conflicts_with = "sequence")]
    markers: Option<PathBuf>,
    /// The mesh in every frame (.npy).
    #[arg(long, value_name = "NPY")]
    sequence: Option<PathBuf>,
    /// What says where parts end.
    #[arg(long, value_enum, default_value_t = From::Auto)]
    from: From,
    /// The frame (0 is the first) in which mesh and markers are in one place; by default the first
    /// that shows nearly as many markers as any.
    #[arg(long)]
    frame: Option<usize>,
    /// How many parts; by default as many as move apart.
    #[arg(long, value_name = "N")]
    parts: Option<usize>,
    /// Root mean square angle within which triangles turn alike, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = SegmentOptions::default().bandwidth.to_degrees())]
    bandwidth: f64,
    /// Where to write the parts (.json).
    #[arg(long, short)]
    output: PathBuf,
    /// Where to draw the parts (.png).
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum From {
    /// The motion, if there is one, else the rig.
    Auto,
    /// The rig.
    Rig,
    /// The motion.
    Motion,
}

/// Parts of a mesh, and of the markers on it.
struct Outcome {
    of_mesh: Vec<u32>,
    triangles: Vec<u32>,
    /// Labels and parts.
    markers: Vec<(String, Option<u32>)>,
    found: Segmentation,
    by: &'static str,
}

impl Segment {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if !(0.5..=180.0).contains(&self.bandwidth) {
            return Err(Failure::Usage(
                "--bandwidth must be 0.5 to 180 degrees".into(),
            ));
        }
        let body = Body::load(&self.mesh, self.reading, true, say)?;
        let start = Instant::now();
        let moves = self.markers.is_some() || self.sequence.is_some();
        let outcome = match (&body, self.from) {
            (Body::Rigged(avatar), from) if from == From::Rig || (from == From::Auto && !moves) => {
                let found = parts_of_rig(avatar);
                self.by_rig(found, body.mesh(), say)?
            }
            (Body::Mesh(_), From::Rig) => {
                let mesh = self.mesh.display();
                return Err(Failure::Usage(format!(
                    "--from rig: {mesh} has no rig; give a .glb with one"
                )));
            }
            _ => match (&self.markers, &self.sequence) {
                (Some(_), _) => self.by_markers(body.mesh(), say)?,
                (None, Some(path)) => self.by_sequence(body.mesh(), path, say)?,
                (None, None) => {
                    return Err(Failure::Usage(
                        "give --markers or --sequence, or a mesh with a rig".into(),
                    ));
                }
            },
        };
        let seconds = start.elapsed().as_secs_f64();
        outcome.tell(say, seconds);
        let mut object = outcome.to_json(seconds);
        let file = outcome.file().to_string();
        write_bytes(&self.output, format!("{file}\n").as_bytes())?;
        if let Some(path) = &self.picture {
            let color = |&part: &u32| PART_COLORS[part as usize % PART_COLORS.len()];
            let colors: Vec<Rgb> = outcome.triangles.iter().map(color).collect();
            let mesh = body.mesh();
            let colors = Colors::PerTriangle(&colors);
            let none = Colors::Uniform([0; 3]);
            let sheet = body_sheet(&mesh.positions, &mesh.triangles, colors, &[], none, 800);
            write_png(path, &sheet)?;
        }
        object["output"] = json!(self.output.display().to_string());
        say.line(format!("wrote {}", self.output.display()));
        Ok(object)
    }

    fn options(&self) -> SegmentOptions {
        SegmentOptions {
            parts: self.parts,
            bandwidth: self.bandwidth.to_radians(),
            ..SegmentOptions::default()
        }
    }

    fn by_rig(&self, found: Segmentation, mesh: &Mesh, say: &Say) -> Result<Outcome, Failure> {
        let mut markers = Vec::new();
        if let Some(path) = &self.markers {
            let (take, glue) = self.glued(path, mesh, say)?;
            let rest = vec![DVec3::ZERO; glue.len()];
            let inside: Vec<Option<usize>> =
                glue.iter().map(|at| at.map(|at| at.triangle)).collect();
            let carried = carried_over(&found, &inside, &rest, &[]);
            let labels = take.labels().iter().zip(carried.point_parts).zip(&glue);
            markers = labels
                .map(|((label, part), glue)| (label.clone(), glue.map(|_| part)))
                .collect();
        }
        Ok(Outcome {
            of_mesh: found.point_parts.clone(),
            triangles: found.triangle_parts.clone(),
            markers,
            found,
            by: "rig",
        })
    }

    /// The take, and the point of the mesh nearest to each marker in the reference frame.
    fn glued(
        &self,
        path: &std::path::Path,
        mesh: &Mesh,
        say: &Say,
    ) -> Result<(Take, Vec<Option<Glue>>), Failure> {
        let (take, notices) = load::take(path, self.reading)?;
        say.notices(&path.display().to_string(), &notices);
        let frame = chosen_frame(&take, path, self.frame)?;
        let tree = Tree::new(&mesh.triangles, &mesh.positions);
        let mut away = Vec::new();
        let glue = (0..take.marker_count()).map(|marker| {
            let near = tree.closest(take.position(marker, frame)?, |_| true)?;
            away.push(near.distance);
            Some(Glue {
                triangle: near.triangle,
                vertices: mesh.triangles[near.triangle],
                barycentric: near.barycentric,
            })
        });
        let glue: Vec<Option<Glue>> = glue.collect();
        let mean = away.iter().sum::<f64>() / away.len().max(1) as f64;
        if mean > FAR {
            return Err(Failure::Data(format!(
                "{}: in frame {frame} markers lie {:.0} mm from {} on average; register it first \
                 (sinew register), or name the frame it was registered in (--frame)",
                path.display(),
                1e3 * mean,
                self.mesh.display()
            )));
        }
        Ok((take, glue))
    }

    fn by_markers(&self, mesh: &Mesh, say: &Say) -> Result<Outcome, Failure> {
        let path = self.markers.as_deref().unwrap_or(&self.mesh);
        let (take, glue) = self.glued(path, mesh, say)?;
        let surface = marker_surface(&mesh.positions, &mesh.triangles, &glue);
        let glued = |at: &Option<Glue>| at.map_or(DVec3::ZERO, |at| at.on(&mesh.positions));
        let rest: Vec<DVec3> = glue.iter().map(glued).collect();
        let frames: Vec<Vec<DVec3>> = (0..take.frame_count())
            .map(|frame| {
                (0..take.marker_count())
                    .map(|at| take.trajectory(at)[frame])
                    .collect()
            })
            .collect();
        let bar = say.progress("segment", 5);
        let found = segment(&rest, &surface, &frames, &self.options(), &|done| {
            bar.set_position(done as u64);
        });
        bar.finish_and_clear();
        let found = found.map_err(|error| fault(path, &error))?;
        let nearest = nearest_markers(&mesh.positions, &mesh.triangles, &glue);
        let of_mesh: Vec<u32> = nearest
            .iter()
            .map(|marker| marker.map_or(0, |marker| found.point_parts[marker as usize]))
            .collect();
        let of_triangle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|at| of_mesh[at as usize]);
            if b == c { b } else { a }
        };
        let labels = take.labels().iter().zip(&glue).enumerate();
        let markers =
            labels.map(|(at, (label, glue))| (label.clone(), glue.map(|_| found.point_parts[at])));
        Ok(Outcome {
            triangles: mesh.triangles.iter().map(of_triangle).collect(),
            of_mesh: of_mesh.clone(),
            markers: markers.collect(),
            found,
            by: "motion of the markers",
        })
    }

    fn by_sequence(
        &self,
        mesh: &Mesh,
        path: &std::path::Path,
        say: &Say,
    ) -> Result<Outcome, Failure> {
        let bytes = std::fs::read(path).map_err(|error| fault(path, &error))?;
        let array = parse_npy(&bytes, &path.display().to_string())?;
        let vertices = mesh.positions.len();
        if array.shape.len() != 3 || array.shape[1] != vertices || array.shape[2] != 3 {
            let text = format!(
                "{}: an array of {:?}, where [frames, {vertices}, 3] is needed",
                path.display(),
                array.shape
            );
            return Err(Failure::Data(text));
        }
        let point = |at: &[f64; 3]| DVec3::from_array(*at);
        let frames: Vec<Vec<DVec3>> = array
            .values
            .chunks_exact(3 * vertices)
            .map(|frame| frame.as_chunks::<3>().0.iter().map(point).collect())
            .collect();
        let bar = say.progress("segment", 5);
        let found = segment(
            &mesh.positions,
            &mesh.triangles,
            &frames,
            &self.options(),
            &|done| {
                bar.set_position(done as u64);
            },
        );
        bar.finish_and_clear();
        let found = found.map_err(|error| fault(path, &error))?;
        Ok(Outcome {
            of_mesh: found.point_parts.clone(),
            triangles: found.triangle_parts.clone(),
            markers: Vec::new(),
            found,
            by: "motion of the mesh",
        })
    }
}

impl Outcome {
    fn tell(&self, say: &Say, seconds: f64) {
        let report = &self.found.report;
        say.line(format!(
            "{} parts by the {} in {seconds:.1} s",
            self.found.part_count(),
            self.by
        ));
        if report.clusters > 0 {
            say.line(format!(
                "{} patches in {} frames: {} clusters in {} regions, {:.1} % of the surface scattered before clean-up",
                report.patches,
                report.frames,
                report.clusters,
                report.regions,
                100.0 * report.scattered
            ));
        }
        say.line(format!(
            "{:>20} {:>9} {:>16} {:>12}",
            "part", "surface", "from rigid", "hangs on"
        ));
        for (part, name) in self.found.names.iter().enumerate() {
            let deviation = report.deviations.get(part);
            let deviation =
                deviation.map_or(String::new(), |left| format!("{:.1} mm rms", 1e3 * left));
            let above = self.found.parents[part].map_or("", |above| &self.found.names[above]);
            say.line(format!(
                "{name:>20} {:>7.1} % {deviation:>16} {above:>12}",
                100.0 * report.shares[part]
            ));
        }
    }

    fn to_json(&self, seconds: f64) -> Value {
        let report = &self.found.report;
        let part = |(at, name): (usize, &String)| {
            json!({
                "name": name,
                "parent": self.found.parents[at],
                "share": report.shares[at],
                "deviation_m": report.deviations.get(at),
            })
        };
        json!({
            "by": self.by,
            "seconds": seconds,
            "frames": report.frames,
            "patches": report.patches,
            "clusters": report.clusters,
            "regions": report.regions,
            "scattered": report.scattered,
            "parts": self.found.names.iter().enumerate().map(part).collect::<Vec<_>>(),
        })
    }

    fn file(&self) -> Value {
        let marker =
            |(label, part): &(String, Option<u32>)| json!({ "label": label, "part": part });
        json!({
            "names": self.found.names,
            "parents": self.found.parents,
            "vertices": self.of_mesh,
            "triangles": self.triangles,
            "markers": self.markers.iter().map(marker).collect::<Vec<_>>(),
        })
    }
}
