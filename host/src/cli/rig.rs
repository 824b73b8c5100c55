//! `sinew rig`: skeleton and skin weights for a body that has none.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};

use super::load::{Loaded, Reading, fault};
use super::register::{Body, ending, write_bytes};
use super::say::{Say, thousands};
use super::{Failure, load};
use crate::export::png::write_png;
use crate::export::render::{Colors, Image, Rgb};
use crate::export::sheet::{PART_COLORS, body_sheet};
use crate::export::write_glb_of;
use crate::fit::inside::{CELLS, Inside};
use crate::fit::rig::fit_inside;
use crate::fit::weights::{MOST_INFLUENCES, Method, WeightOptions, weigh_inside};
use crate::model::{Avatar, Mesh, Skeleton};
use crate::reference::skin::linear_blend;

/// Fit a skeleton into a body that has none, and give every vertex its weights.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew rig scan.obj --skeleton walk.bvh --output body.glb
  sinew rig scan.ply --skeleton other.glb --picture rig.png --output body.glb
  sinew rig body.glb --keep-joints --output reweighted.glb
  sinew rig scan.obj --skeleton walk.bvh --weights simple --influences 2 --output body.glb

The body stands upright (Y up) in a T- or A-pose; it may have holes and several parts. The skeleton
may be any human one: its names, hierarchy and proportions are taken, its pose and size are not.
Joint frames of the result are parallel to the axes; `sinew bake --motion` puts motion on it as on
any body.")]
pub(crate) struct Rig {
    /// The body: .obj, .ply, .glb or .gltf.
    mesh: PathBuf,
    /// Whose hierarchy is fitted: .bvh, .glb or .gltf; without it that of the body's own file.
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// The skeleton stands in the body already: only find weights.
    #[arg(long)]
    keep_joints: bool,
    #[command(flatten)]
    weighing: Weighing,
    /// Where to write the body (.glb).
    #[arg(long, short)]
    output: PathBuf,
    /// Where to draw joints and weights (.png).
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// How weights are found.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Weighing {
    /// How weights are found: smooth, by the way through the inside; or simple, by projection onto
    /// the nearest bone.
    #[arg(long, value_enum, default_value_t = Weights::Smooth)]
    weights: Weights,
    /// Most influences of a vertex.
    #[arg(long, value_name = "N", default_value_t = 4,
        value_parser = clap::value_parser!(u32).range(1..=MOST_INFLUENCES as i64))]
    influences: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Weights {
    Smooth,
    Simple,
}

impl Weighing {
    pub(super) fn options(self) -> WeightOptions {
        WeightOptions {
            method: match self.weights {
                Weights::Smooth => Method::Smooth,
                Weights::Simple => Method::Simple,
            },
            influences: self.influences as usize,
            ..WeightOptions::default()
        }
    }
}

impl Rig {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        check_output(&self.output)?;
        let start = Instant::now();
        let body = Body::load(&self.mesh, self.reading, true, say)?;
        let (skeleton, ends) = match (&self.skeleton, &body) {
            (Some(path), _) => skeleton(path, self.reading, say)?,
            (None, Body::Rigged(avatar)) => (avatar.skeleton.clone(), Vec::new()),
            (None, Body::Mesh(_)) => {
                return Err(Failure::Usage(format!(
                    "--skeleton is needed: {} has no rig; give a .bvh or a rigged .glb",
                    self.mesh.display()
                )));
            }
        };
        let mesh = match &body {
            Body::Rigged(avatar) => at_rest(avatar),
            Body::Mesh(mesh) => (**mesh).clone(),
        };
        let options = self.weighing.options();
        let fit = !self.keep_joints;
        let made = rig(&self.mesh, &mesh, &skeleton, &ends, fit, &options, say)?;
        let seconds = start.elapsed().as_secs_f64();
        write_bytes(&self.output, &write_glb_of(&made.body, &[])?)?;
        if let Some(path) = &self.picture {
            write_png(path, &picture(&made.body))?;
        }
        say.line(format!("wrote {} in {seconds:.1} s", self.output.display()));
        let joints = made.body.skeleton.joints.iter();
        let model = made.body.skeleton.model(&made.body.skeleton.rest());
        let joints = joints.zip(&model).map(
            |(joint, place)| json!({ "name": joint.name, "place_m": place.translation.to_array() }),
        );
        Ok(json!({
            "mesh": self.mesh.display().to_string(),
            "output": self.output.display().to_string(),
            "vertices": made.body.mesh.positions.len(),
            "joints": joints.collect::<Vec<_>>(),
            "height_m": made.height,
            "idle_joints": made.idle,
            "attached_vertices": made.attached,
            "seconds": seconds,
        }))
    }
}

/// The mesh as its own skeleton stands in it: files may bind it in another pose.
fn at_rest(avatar: &Avatar) -> Mesh {
    let model = avatar.skeleton.model(&avatar.skeleton.rest());
    let (positions, normals) = linear_blend(&avatar.mesh, &avatar.skin, &model);
    Mesh {
        positions,
        normals,
        tangents: None,
        morphs: Vec::new(),
        ..avatar.mesh.clone()
    }
}

/// Only a .glb holds a rig.
pub(super) fn check_output(output: &Path) -> Result<(), Failure> {
    if ending(output) == "glb" {
        return Ok(());
    }
    let text = format!("{}: give a .glb to write", output.display());
    Err(Failure::Usage(text))
}

/// A skeleton and the ends of its last joints, from a motion or a rigged body.
fn skeleton(
    path: &Path,
    reading: Reading,
    say: &Say,
) -> Result<(Skeleton, Vec<(usize, DVec3)>), Failure> {
    let (loaded, notices) = load::any(path, reading)?;
    say.notices(&path.display().to_string(), &notices);
    match loaded {
        Loaded::Motion(motion) => Ok((motion.skeleton, motion.end_sites)),
        Loaded::Avatar(avatar) => Ok((avatar.skeleton, Vec::new())),
        _ => Err(Failure::Usage(format!(
            "{}: a skeleton is needed; give a .bvh, or a .glb with a rig",
            path.display()
        ))),
    }
}

/// A body with its new rig.
pub(super) struct Made {
    pub body: Avatar,
    /// Sole to crown, metres, where a skeleton was fitted.
    height: Option<f64>,
    /// Joints that move nothing.
    idle: Vec<String>,
    attached: usize,
}

/// Fits the skeleton, unless it stands in the mesh already, and weighs the mesh.
pub(super) fn rig(
    path: &Path,
    mesh: &Mesh,
    skeleton: &Skeleton,
    ends: &[(usize, DVec3)],
    fit: bool,
    options: &WeightOptions,
    say: &Say,
) -> Result<Made, Failure> {
    let bar = say.progress("rig", 3);
    let inside = Inside::new(mesh, CELLS).map_err(|error| fault(path, &error))?;
    bar.inc(1);
    let mut height = None;
    let mut skeleton = skeleton.clone();
    if fit {
        let fitted = fit_inside(&inside, &skeleton, ends).map_err(|error| fault(path, &error))?;
        skeleton = fitted.skeleton;
        height = Some(fitted.figure.height);
    }
    bar.inc(1);
    let weighed = weigh_inside(mesh, &inside, &skeleton, options);
    let weighed = weighed.map_err(|error| fault(path, &error))?;
    bar.finish_and_clear();
    let name = |&joint: &usize| skeleton.joints[joint].name.clone();
    let idle: Vec<String> = weighed.idle.iter().map(name).collect();
    let (vertices, joints) = (mesh.positions.len(), skeleton.joints.len());
    say.line(format!(
        "{} vertices follow {joints} joints{}",
        thousands(vertices as u64),
        height.map_or_else(String::new, |height| format!(", fitted into {height:.2} m")),
    ));
    if !idle.is_empty() {
        say.line(format!(
            "note: joints that move nothing: {}",
            idle.join(", ")
        ));
    }
    if weighed.attached > 0 {
        say.line(format!(
            "note: {} vertices of parts without an inside move as the nearest ones do",
            thousands(weighed.attached as u64)
        ));
    }
    let body = Avatar {
        mesh: mesh.clone(),
        skin: weighed.skin,
        skeleton,
        clips: Vec::new(),
    };
    Ok(Made {
        body,
        height,
        idle,
        attached: weighed.attached,
    })
}

/// The body from four sides, each joint's part in its colour, joints as dots.
pub(super) fn picture(body: &Avatar) -> Image {
    let color = |bind: u32| PART_COLORS[bind as usize % PART_COLORS.len()];
    let mix = |row: &Vec<(u32, f64)>| -> Rgb {
        let mut sum = [0.0; 3];
        for &(bind, weight) in row {
            for (sum, part) in sum.iter_mut().zip(color(bind)) {
                *sum += weight * f64::from(part);
            }
        }
        sum.map(|part| part.round() as u8)
    };
    let colors: Vec<Rgb> = body.skin.influences.iter().map(mix).collect();
    let model = body.skeleton.model(&body.skeleton.rest());
    let joints: Vec<DVec3> = model.iter().map(|joint| joint.translation).collect();
    body_sheet(
        &body.mesh.positions,
        &body.mesh.triangles,
        Colors::PerVertex(&colors),
        &joints,
        Colors::Uniform([20, 20, 20]),
        800,
    )
}
