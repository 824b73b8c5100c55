//! A scan with its markers as an avatar whose joints are the markers.
//!
//! In: the scan as its file states it, what repairing made of it, the pairs and the motion. Out:
//! a body for the asset (markers as joints, the motion as a clip, a coarse skin as a stand-in) and
//! the tables of its surface, for every vertex of the file.

use glam::{DAffine3, DQuat, DVec3};
use sinew_core::asset::{LANES, Lanes3};

use super::collapse::{
    CollapseOptions, CollapseReport, CollapsedTables, collapse, collapse_within,
};
use super::drive::Driven;
use super::nearest::Nearest;
use super::repair::{Repaired, attachments};
use super::volume::losses;
use super::{ExactTables, LaplaceError, MarkerTarget, Surface, SurfaceOptions};
use crate::model::{
    Avatar, Bind, Channel, Clip, Interpolation, Joint, Mesh, Skeleton, Skin, Track, Transform,
};
use crate::reference::laplacian::positions;

/// How the surface is computed in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solve {
    /// Solved each frame.
    Exact,
    /// As sums over handles, as many as keep 99 of 100 vertices within so many metres of the exact
    /// surface in poses that were not fitted.
    Collapsed {
        /// Metres.
        tolerance: f64,
    },
}

/// How to rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigOptions {
    /// What to compute in a frame.
    pub solve: Solve,
    /// How the surface follows.
    pub surface: SurfaceOptions,
    /// Let components without a marker follow the nearest one that has some.
    pub attach: bool,
    /// Fit to poses that keep their volume; for collapsed surfaces.
    pub keep_volume: bool,
}

impl Default for RigOptions {
    fn default() -> Self {
        let solve = Solve::Collapsed { tolerance: 3e-3 };
        Self {
            solve,
            surface: SurfaceOptions::default(),
            attach: false,
            keep_volume: false,
        }
    }
}

/// Tables of the surface, for every vertex of the source.
#[derive(Clone, Debug, PartialEq)]
pub enum Tables {
    /// Solved for.
    Exact(Box<ExactTables>),
    /// Sums.
    Collapsed(Box<CollapsedTables>),
}

/// A scan that follows markers.
#[derive(Clone, Debug)]
pub struct Rig {
    /// Markers as joints; the source's vertices.
    pub body: Avatar,
    /// Its surface.
    pub tables: Tables,
    /// What was found.
    pub report: RigReport,
}

/// What rigging found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigReport {
    /// Markers, those of attached components included.
    pub markers: usize,
    /// Components that follow another.
    pub attached: usize,
    /// Handles of a block, and between the markers; of collapsed surfaces.
    pub handles: Option<(usize, usize)>,
    /// Distance of the collapsed surface from the exact one in poses that were not fitted.
    pub held_out: Option<CollapseReport>,
    /// Poses fitted and held out.
    pub poses: (usize, usize),
    /// Volume lost: mean over poses and the worst, before and after correction.
    pub volume_loss: [[f64; 2]; 2],
}

/// Poses to fit to, and to measure on.
const FITTED: usize = 160;
const HELD_OUT: usize = 40;
/// Poses that stand together in the motion and are kept or held out together.
const STRETCH: usize = 5;

/// Rigs a scan. `mesh`: as the file states it; `vertices`: of the markers, in the repaired mesh;
/// `names`: of the markers. Cost as [`Surface::new`] and [`collapse()`].
///
/// # Errors
/// As [`Surface::new`] and [`collapse()`].
pub fn rig(
    mesh: &Mesh,
    repaired: &Repaired,
    vertices: &[u32],
    names: &[String],
    driven: &Driven,
    options: &RigOptions,
) -> Result<Rig, LaplaceError> {
    let (places, triangles) = (&repaired.positions, &repaired.triangles);
    let mut markers = vertices.to_vec();
    let mut parents: Vec<Option<usize>> = vec![None; markers.len()];
    if options.attach {
        for (vertex, parent) in attachments(places, triangles, vertices) {
            markers.push(vertex);
            parents.push(Some(parent));
        }
    }
    let surface = Surface::new(places.clone(), triangles, markers, &options.surface)?;
    let poses: Vec<Vec<MarkerTarget>> = driven
        .poses
        .iter()
        .map(|pose| with_attached(pose, &surface, &parents))
        .collect();
    let mut report = RigReport {
        markers: surface.markers.len(),
        attached: parents.iter().flatten().count(),
        ..RigReport::default()
    };
    let vertex_of = onto_surface(mesh, repaired);
    let (fitted, held_out) = split(&poses);
    report.poses = (fitted.len(), held_out.len());
    report.volume_loss = volume_loss(&surface, triangles, &held_out, options.keep_volume);
    let tables = match options.solve {
        Solve::Exact => Tables::Exact(Box::new(surface.exact()?)),
        Solve::Collapsed { tolerance } => {
            let normals = &[];
            let start = CollapseOptions {
                keep_volume: options.keep_volume,
                ..CollapseOptions::default()
            };
            let (found, used, distance) = if held_out.is_empty() {
                let found = collapse(&surface, triangles, normals, &fitted, &start)?;
                (found, start, CollapseReport::default())
            } else {
                collapse_within(
                    &surface, triangles, normals, &fitted, &held_out, &start, tolerance,
                )?
            };
            report.handles = Some((used.handles_a_block, found.virtual_starts.len() - 1));
            report.held_out = Some(distance);
            let normal = |vertex: usize| mesh.normals[vertex];
            Tables::Collapsed(Box::new(found.for_vertices(&vertex_of, normal)))
        }
    };
    let body = Avatar {
        mesh: drawn(mesh, repaired),
        skeleton: skeleton(&surface, names, &parents),
        skin: coarse_skin(&surface, &vertex_of),
        clips: vec![clip(&driven.poses, driven.rate)],
    };
    let tables = match tables {
        Tables::Exact(mut exact) => {
            spread_rows(&mut exact, &body, &vertex_of);
            Tables::Exact(exact)
        }
        collapsed @ Tables::Collapsed(_) => collapsed,
    };
    Ok(Rig {
        body,
        tables,
        report,
    })
}

/// Poses of all markers: attached ones turn with the one they hang on.
fn with_attached(
    pose: &[MarkerTarget],
    surface: &Surface,
    parents: &[Option<usize>],
) -> Vec<MarkerTarget> {
    let rest = surface.marker_rest();
    let mut all = pose.to_vec();
    for (marker, parent) in parents.iter().enumerate().skip(pose.len()) {
        let from = parent.unwrap_or(0);
        let MarkerTarget { position, rotation } = pose[from];
        all.push(MarkerTarget {
            position: position + rotation * (rest[marker] - rest[from]),
            rotation,
        });
    }
    all
}

/// Poses to fit and poses to measure on: whole stretches, evenly over the motion.
fn split(poses: &[Vec<MarkerTarget>]) -> (Vec<Vec<MarkerTarget>>, Vec<Vec<MarkerTarget>>) {
    let step = poses.len().div_ceil(FITTED + HELD_OUT).max(1);
    let chosen: Vec<_> = poses.iter().step_by(step).cloned().collect();
    if chosen.len() < 3 * STRETCH {
        return (chosen, Vec::new());
    }
    let (mut fitted, mut held_out) = (Vec::new(), Vec::new());
    for (at, stretch) in chosen.chunks(STRETCH).enumerate() {
        let to = if at % 5 == 2 {
            &mut held_out
        } else {
            &mut fitted
        };
        to.extend_from_slice(stretch);
    }
    (fitted, held_out)
}

fn volume_loss(
    surface: &Surface,
    triangles: &[[u32; 3]],
    poses: &[Vec<MarkerTarget>],
    keep: bool,
) -> [[f64; 2]; 2] {
    let mut shapes: Vec<Vec<DVec3>> = poses.iter().map(|pose| positions(surface, pose)).collect();
    let sum_up = |shapes: &[Vec<DVec3>]| {
        let losses = losses(&surface.positions, triangles, shapes);
        let mean = losses.iter().sum::<f64>() / losses.len().max(1) as f64;
        [mean, losses.into_iter().fold(0.0, f64::max)]
    };
    let before = sum_up(&shapes);
    if !keep {
        return [before, before];
    }
    let restorer = super::volume::Restorer::new(&surface.positions, triangles);
    shapes.iter_mut().for_each(|shape| restorer.restore(shape));
    [before, sum_up(&shapes)]
}

/// The place of the surface that each vertex of the source follows: its own, or the nearest for
/// one that was removed. `[source vertices]`
fn onto_surface(mesh: &Mesh, repaired: &Repaired) -> Vec<u32> {
    let nearest = Nearest::new(&repaired.positions);
    let all = mesh.positions.iter().zip(&repaired.vertex_of);
    all.map(|(place, own)| own.or_else(|| Some(nearest.find(*place)?.0)).unwrap_or(0))
        .collect()
}

/// The source without triangles that were removed.
fn drawn(mesh: &Mesh, repaired: &Repaired) -> Mesh {
    let kept = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| repaired.vertex_of[v as usize]);
        a.is_some() && b.is_some() && c.is_some() && a != b && b != c && c != a
    };
    let mut drawn = mesh.clone();
    drawn.morphs.clear();
    drawn.triangles.retain(kept);
    let mut start = 0;
    for part in &mut drawn.parts {
        let count = mesh.triangles[part.triangles.clone()]
            .iter()
            .filter(|t| kept(t))
            .count();
        part.triangles = start..start + count;
        start += count;
    }
    drawn
}

fn skeleton(surface: &Surface, names: &[String], parents: &[Option<usize>]) -> Skeleton {
    let rest = surface.marker_rest();
    let joint = |(marker, parent): (usize, &Option<usize>)| {
        let from = parent.map_or(DVec3::ZERO, |parent| rest[parent]);
        let of_parent = || {
            let name = &names[parent.unwrap_or(0)];
            format!("{name}+{marker}")
        };
        Joint {
            name: names.get(marker).cloned().unwrap_or_else(of_parent),
            parent: *parent,
            rest: Transform {
                translation: rest[marker] - from,
                ..Transform::IDENTITY
            },
        }
    };
    Skeleton {
        joints: parents.iter().enumerate().map(joint).collect(),
    }
}

/// The four heaviest harmonic weights of each vertex.
fn coarse_skin(surface: &Surface, vertex_of: &[u32]) -> Skin {
    let bind = |(joint, place): (usize, DVec3)| Bind {
        joint,
        inverse_bind: DAffine3::from_translation(-place),
    };
    let influences = vertex_of.iter().map(|&vertex| {
        let (markers, weights) = surface.guides[vertex as usize];
        let pairs = markers
            .into_iter()
            .zip(weights)
            .filter(|&(_, weight)| weight > 1e-4);
        let mut pairs: Vec<(u32, f64)> = pairs
            .map(|(marker, weight)| (u32::from(marker), weight))
            .collect();
        let sum: f64 = pairs.iter().map(|pair| pair.1).sum();
        pairs.iter_mut().for_each(|pair| pair.1 /= sum);
        pairs
    });
    Skin {
        binds: surface
            .marker_rest()
            .into_iter()
            .enumerate()
            .map(bind)
            .collect(),
        influences: influences.collect(),
    }
}

fn clip(poses: &[Vec<MarkerTarget>], rate: f64) -> Clip {
    let times: Vec<f64> = (0..poses.len()).map(|frame| frame as f64 / rate).collect();
    let count = poses.first().map_or(0, Vec::len);
    let mut tracks = Vec::with_capacity(2 * count);
    for joint in 0..count {
        let track = |channel, values| Track {
            joint,
            channel,
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values,
        };
        let place = |pose: &Vec<MarkerTarget>| pose[joint].position.extend(0.0).to_array();
        tracks.push(track(
            Channel::Translation,
            poses.iter().map(place).collect(),
        ));
        let mut last = DQuat::IDENTITY;
        let turn = |pose: &Vec<MarkerTarget>| {
            let turn = pose[joint].rotation;
            last = if turn.dot(last) < 0.0 { -turn } else { turn };
            last.to_array()
        };
        tracks.push(track(Channel::Rotation, poses.iter().map(turn).collect()));
    }
    Clip {
        name: "motion".to_owned(),
        tracks,
        morph_track: None,
        duration: times.last().copied().unwrap_or(0.0),
        sample_period: Some(1.0 / rate),
    }
}

/// Lanes of an exact surface in the order of the coarse skin's blocks, with their normals.
fn spread_rows(exact: &mut ExactTables, body: &Avatar, vertex_of: &[u32]) {
    let row_of = std::mem::take(&mut exact.lane_rows);
    exact.order = crate::bake::blocks::arrange(&body.skin).order;
    exact.lane_rows = exact
        .order
        .iter()
        .map(|&source| row_of[vertex_of[source as usize] as usize])
        .collect();
    exact.rest_normals = exact
        .order
        .chunks(LANES)
        .map(|block| lanes(block, |vertex| body.mesh.normals[vertex]))
        .collect();
}

/// x of eight vertices, y, z; a short block repeats its last vertex.
pub(super) fn lanes(block: &[u32], of: impl Fn(usize) -> DVec3) -> Lanes3 {
    let at = |lane: usize| {
        of(block[lane.min(block.len() - 1)] as usize)
            .as_vec3()
            .to_array()
    };
    [0, 1, 2].map(|axis| std::array::from_fn(|lane| at(lane)[axis]))
}
