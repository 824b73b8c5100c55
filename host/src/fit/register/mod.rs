//! A detailed mesh fitted to the markers of one frame (Park & Hodgins 2006, section 5.1, after
//! Allen et al. 2003).
//!
//! In: a mesh, with its rig where there is one, and marker positions that nobody has matched to it.
//! Out: the mesh in the body's shape and the frame's pose, and the point of it that each marker is
//! glued to.
//!
//! | stage | does |
//! | --- | --- |
//! | [`align`] | turns, scales and places the whole mesh |
//! | `articulate` | bends and resizes the rig's parts, if there is a rig |
//! | `unfold` | takes out the folds that skinning makes |
//! | [`landmarks`] | says which markers stay with one point at first |
//! | `matching` | finds the nearest points of the others, again in every round |
//! | `field` | an affine map for each vertex: smooth, and near the markers |
//! | [`fold`] | finds triangles turned inside out; the field is made stiffer there |
//! | [`rig`] | moves the joints along |

pub mod align;
mod articulate;
mod error;
mod field;
mod figure;
mod fit;
pub mod fold;
pub mod landmarks;
pub mod marker_surface;
mod matching;
pub mod rig;
mod unfold;

use glam::{DAffine3, DVec3};

use crate::fit::parts::Glued;
use crate::model::{Avatar, Mesh};
use crate::spatial::Tree;
use crate::take::Take;
use align::{Similarity, extent, starts};
use articulate::{Fitting, Posed, STEPS, misfit};
pub use error::RegisterError;
use figure::Figure;
use fit::{Fit, nodes};
pub use landmarks::Landmark;

/// Fewest markers that say how a body stands.
const FEWEST_MARKERS: usize = 8;
/// Weight of markers: from the first round to the last.
const WEIGHTS: [f64; 2] = [0.05, 300.0];
/// A mesh that stays this far from the markers, over its size, does not fit at all.
const FARTHEST: f64 = 0.03;

/// How to register.
#[derive(Clone, Debug, PartialEq)]
pub struct RegisterOptions {
    /// Markers whose vertices are known.
    pub landmarks: Vec<Landmark>,
    /// Rounds of nearest points and smooth fields, at least 2.
    pub rounds: usize,
    /// Stiffer (above 1) or softer (below 1) than usual.
    pub stiffness: f64,
}

impl Default for RegisterOptions {
    fn default() -> Self {
        Self {
            landmarks: Vec::new(),
            rounds: 10,
            stiffness: 1.0,
        }
    }
}

/// The point of a mesh that a marker is glued to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glue {
    /// Index in the mesh's triangles.
    pub triangle: usize,
    /// That triangle's vertices.
    pub vertices: [u32; 3],
    /// Weights of the vertices, at least 0; they sum to 1.
    pub barycentric: [f64; 3],
}

impl Glue {
    /// The glued point on a surface of the mesh, metres.
    #[must_use]
    pub fn on(&self, positions: &[DVec3]) -> DVec3 {
        let corners = self.vertices.iter().zip(self.barycentric);
        corners
            .map(|(&at, share)| positions[at as usize] * share)
            .sum()
    }
}

impl From<Glue> for Glued {
    fn from(glue: Glue) -> Self {
        Self {
            vertices: glue.vertices,
            weights: glue.barycentric,
        }
    }
}

/// A mesh in the shape of the markers.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// `[vertices]`: metres, the markers' space.
    pub positions: Vec<DVec3>,
    /// `[markers]`: `None` for one that was not seen or does not belong to the body.
    pub glue: Vec<Option<Glue>>,
    /// `[joints]`: joint to the markers' space, unscaled; none without a rig.
    pub joints: Vec<DAffine3>,
    /// What was done.
    pub report: RegisterReport,
}

/// What registering did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegisterReport {
    /// Markers seen in the frame.
    pub seen: usize,
    /// Markers that stay too far from any body of this kind.
    pub strays: Vec<usize>,
    /// Size of the fitted body over the mesh's.
    pub scale: f64,
    /// Mean distance of the markers from the mesh once aligned, and once posed; metres.
    pub aligned: f64,
    /// See above; the same without a rig.
    pub posed: f64,
    /// Markers that served as landmarks.
    pub landmarks: usize,
    /// `[rounds]`: mean distance of the markers from the surface after each, metres.
    pub rounds: Vec<f64>,
    /// Root mean square distance of the markers from the points they are glued to, metres.
    pub residual_rms: f64,
    /// The largest of these distances, metres.
    pub residual_max: f64,
    /// Rounds in which the field was made stiffer because triangles folded.
    pub repairs: usize,
}

/// What is registered.
#[derive(Clone, Copy, Debug)]
pub enum Template<'a> {
    /// A mesh alone.
    Mesh(&'a Mesh),
    /// A mesh with a rig.
    Rigged(&'a Avatar),
}

impl<'a> Template<'a> {
    /// Its mesh.
    #[must_use]
    pub fn mesh(self) -> &'a Mesh {
        match self {
            Self::Mesh(mesh) => mesh,
            Self::Rigged(avatar) => &avatar.mesh,
        }
    }
}

/// A frame that shows this share of the markers that any shows is as good as that one.
const NEARLY_ALL: f64 = 0.98;

/// The first frame of a take that shows nearly as many markers as any: subjects begin in a pose
/// where little is hidden, and later poses close armpits and bring hands to the body.
#[must_use]
pub fn reference_frame(take: &Take) -> usize {
    let seen: Vec<usize> = (0..take.frame_count())
        .map(|frame| take.seen(frame).count())
        .collect();
    first_full(&seen)
}

/// The first of `[frames]` counts of markers that is nearly as high as any.
#[must_use]
pub fn first_full(seen: &[usize]) -> usize {
    let most = seen.iter().copied().max().unwrap_or(0);
    let enough = |&count: &usize| count as f64 >= NEARLY_ALL * most as f64;
    seen.iter().position(enough).unwrap_or(0)
}

/// Fits a mesh to marker positions `[markers]`, metres, Y up. `progress` hears how many of
/// `rounds + 2` steps are done. O(rounds fill of the mesh)
///
/// # Errors
/// Too few markers, a mesh that no pose brings near them, landmarks that do not exist, triangles
/// that cannot be kept from folding.
pub fn register(
    template: Template<'_>,
    markers: &[Option<DVec3>],
    options: &RegisterOptions,
    progress: &dyn Fn(usize),
) -> Result<Registration, RegisterError> {
    let mesh = template.mesh();
    let seen = check(mesh, markers, options)?;
    let points: Vec<DVec3> = seen.iter().filter_map(|&at| markers[at]).collect();
    let figure = match template {
        Template::Rigged(avatar) => Some(Figure::new(avatar)),
        Template::Mesh(_) => None,
    };
    let mut report = RegisterReport {
        seen: seen.len(),
        ..RegisterReport::default()
    };
    let (posed, placed) = pose(mesh, figure.as_ref(), &points, &mut report)?;
    progress(1);
    let mut fit = Fit::new(mesh, posed, figure.as_ref(), &points, options)?;
    fit.landmarks(
        &seen,
        options,
        figure.as_ref().zip(placed.as_ref()),
        &mut report,
    )?;
    progress(2);
    for round in 0..options.rounds {
        let through = round as f64 / (options.rounds - 1) as f64;
        fit.round(
            WEIGHTS[0] * (WEIGHTS[1] / WEIGHTS[0]).powf(through),
            &mut report,
        )?;
        progress(3 + round);
    }
    fit.unfold(&mut report)?;
    let mut glue = vec![None; markers.len()];
    for (&marker, found) in seen.iter().zip(fit.glue()) {
        glue[marker] = found;
    }
    report.strays = fit.strays.iter().map(|&at| seen[at]).collect();
    let positions = fit.positions();
    let distances = seen.iter().zip(&points).filter_map(|(&marker, point)| {
        glue[marker].map(|glue: Glue| glue.on(&positions).distance(*point))
    });
    let distances: Vec<f64> = distances.collect();
    let squared: f64 = distances.iter().map(|d| d * d).sum();
    report.residual_rms = (squared / distances.len().max(1) as f64).sqrt();
    report.residual_max = distances.iter().copied().fold(0.0, f64::max);
    let joints = match (template, figure.as_ref().zip(placed.as_ref())) {
        (Template::Rigged(avatar), Some((figure, placed))) => {
            rig::joints(avatar, figure, placed, &fit.field, &fit.node_of)
        }
        _ => Vec::new(),
    };
    Ok(Registration {
        positions,
        glue,
        joints,
        report,
    })
}

/// The markers that are seen, once everything is found sound.
fn check(
    mesh: &Mesh,
    markers: &[Option<DVec3>],
    options: &RegisterOptions,
) -> Result<Vec<usize>, RegisterError> {
    let range = |name, value: f64, low: f64, high: f64, range| {
        if (low..=high).contains(&value) {
            Ok(())
        } else {
            Err(RegisterError::BadOption { name, value, range })
        }
    };
    range("rounds", options.rounds as f64, 2.0, 100.0, "2 to 100")?;
    range("stiffness", options.stiffness, 1e-3, 1e3, "0.001 to 1000")?;
    let size = extent(&mesh.positions);
    if mesh.triangles.is_empty() || size.is_nan() || size <= 0.0 {
        return Err(RegisterError::NoSurface);
    }
    let seen: Vec<usize> = (0..markers.len())
        .filter(|&at| markers[at].is_some())
        .collect();
    let is_nowhere = |at: &DVec3| !at.is_finite() || at.abs().max_element() > 1e6;
    for &marker in &seen {
        if let Some(position) = markers[marker].filter(is_nowhere) {
            return Err(RegisterError::BadMarker { marker, position });
        }
    }
    if seen.len() < FEWEST_MARKERS {
        return Err(RegisterError::FewMarkers {
            count: seen.len(),
            needed: FEWEST_MARKERS,
        });
    }
    for (landmark, &Landmark { marker, vertex }) in options.landmarks.iter().enumerate() {
        let vertices = mesh.positions.len();
        for (what, index, count) in [
            ("marker", marker, markers.len()),
            ("vertex", vertex, vertices),
        ] {
            if index >= count {
                return Err(RegisterError::BadLandmark {
                    landmark,
                    what,
                    index,
                    count,
                });
            }
        }
    }
    let points: Vec<DVec3> = seen.iter().filter_map(|&at| markers[at]).collect();
    let extent = extent(&points);
    if extent < 1e-3 {
        return Err(RegisterError::NoExtent { extent });
    }
    Ok(seen)
}

/// The mesh brought near the markers: as a whole, then, with a rig, limb by limb.
fn pose(
    mesh: &Mesh,
    figure: Option<&Figure>,
    markers: &[DVec3],
    report: &mut RegisterReport,
) -> Result<(Vec<DVec3>, Option<figure::Placed>), RegisterError> {
    /// Starts that are bent a little, and those of them bent to the end.
    const CANDIDATES: (usize, usize) = (6, 2);
    let (rest, triangles) = (&mesh.positions, &mesh.triangles);
    let size = extent(rest);
    let found = starts(figure, rest, triangles, markers);
    let best = found.first().ok_or(RegisterError::NoSurface)?;
    let Similarity { scale, .. } = best.similarity;
    (report.scale, report.aligned) = (scale, best.misfit * size * scale);
    let mut tree = Tree::new(triangles, rest);
    let no_fit = |metres: f64| RegisterError::NoFit {
        millimetres: 1e3 * metres,
    };
    let Some(figure) = figure else {
        let posed: Vec<DVec3> = rest.iter().map(|&p| best.similarity.apply(p)).collect();
        tree.refit(&posed);
        report.posed = misfit(&tree, markers, size * scale);
        let far = report.posed > FARTHEST * size * scale;
        return if far {
            Err(no_fit(report.posed))
        } else {
            Ok((posed, None))
        };
    };
    let fitting = Fitting {
        figure,
        rest,
        triangles,
        markers,
        size: size * scale,
    };
    let mut bend = |start: &align::Start, steps| fitting.articulate(&mut tree, start, steps);
    let mut short: Vec<(f64, &align::Start)> = found
        .iter()
        .take(CANDIDATES.0)
        .map(|start| (bend(start, 12).misfit, start))
        .collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0));
    let bent = short
        .iter()
        .take(CANDIDATES.1)
        .map(|(_, start)| bend(start, STEPS));
    let best: Posed = bent
        .min_by(|a, b| a.misfit.total_cmp(&b.misfit))
        .ok_or(RegisterError::NoSurface)?;
    report.posed = best.misfit;
    report.scale = best.stance.scale.exp();
    if best.misfit > FARTHEST * size * report.scale {
        return Err(no_fit(best.misfit));
    }
    Ok((best.positions, Some(best.placed)))
}

/// A mesh in another shape, with normals of that shape and without what belongs to the old one:
/// tangents and morph targets.
///
/// # Panics
/// Unless there is one position a vertex.
#[must_use]
pub fn reshaped(mesh: &Mesh, positions: &[DVec3]) -> Mesh {
    assert_eq!(positions.len(), mesh.positions.len(), "one a vertex");
    let (node_of, _) = nodes(&mesh.positions);
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|at| positions[at as usize]);
        let normal = (b - a).cross(c - a);
        for &at in triangle {
            normals[node_of[at as usize]] += normal;
        }
    }
    let kept = node_of.iter().zip(&mesh.normals);
    Mesh {
        positions: positions.to_vec(),
        normals: kept
            .map(|(&node, &old)| normals[node].normalize_or(old))
            .collect(),
        tangents: None,
        morphs: Vec::new(),
        ..mesh.clone()
    }
}
