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
pub mod fold;
pub mod landmarks;
pub mod marker_surface;
mod matching;
pub mod rig;
mod unfold;

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DVec3};

use crate::fit::laplace::graph::Graph;
use crate::model::{Avatar, Mesh, nearest_rotation};
use crate::spatial::{Tree, weld};
use crate::take::Take;
use align::{Similarity, extent, starts};
use articulate::{Fitting, Posed, STEPS, misfit};
pub use error::RegisterError;
use field::{Field, Pull};
use figure::Figure;
pub use landmarks::Landmark;
use matching::{Match, Matcher};
use unfold::unfold;

/// Fewest markers that say how a body stands.
const FEWEST_MARKERS: usize = 8;
/// Maps vary over this length, over the body's size.
const SMOOTHNESS: f64 = 0.012;
/// Weight of landmarks before the other markers count.
const LANDMARK_WEIGHT: f64 = 30.0;
/// Weight of markers: from the first round to the last.
const WEIGHTS: [f64; 2] = [0.3, 3e4];
/// Where no marker is within this many spacings of markers, the shape is kept.
const UNMARKED: f64 = 1.6;
/// A marker that stays this far from the surface over the body's size, and this many times farther
/// than the middle one, is no marker of this body.
const STRAY: (f64, f64) = (0.03, 8.0);
/// Rounds of stiffening where triangles fold.
const REPAIRS: usize = 12;

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
            rounds: 9,
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

/// The frame of a take that shows most markers, the first of these.
#[must_use]
pub fn reference_frame(take: &Take) -> usize {
    let seen = |&frame: &usize| (take.seen(frame).count(), std::cmp::Reverse(frame));
    (0..take.frame_count()).max_by_key(seen).unwrap_or(0)
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
        let far = report.posed > 0.045 * size * scale;
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
    if best.misfit > 0.03 * size * report.scale {
        return Err(no_fit(best.misfit));
    }
    Ok((best.positions, Some(best.placed)))
}

/// The field, and what the markers have to do with it. Markers are counted among those seen.
struct Fit<'a> {
    mesh: &'a Mesh,
    markers: &'a [DVec3],
    /// `[vertices]`: node of the field; seams are closed.
    node_of: Vec<usize>,
    field: Field,
    graph: Graph,
    tree: Tree,
    matcher: Matcher<'a>,
    /// Vertices of the user's landmarks, by marker.
    pinned: Vec<(usize, usize)>,
    matches: Vec<Option<Match>>,
    strays: BTreeSet<usize>,
    size: f64,
}

impl<'a> Fit<'a> {
    fn new(
        mesh: &'a Mesh,
        posed: Vec<DVec3>,
        figure: Option<&'a Figure>,
        markers: &'a [DVec3],
        options: &RegisterOptions,
    ) -> Result<Self, RegisterError> {
        let size = extent(&posed);
        let (node_of, nodes) = nodes(&mesh.positions);
        let mut rest: Vec<DVec3> = nodes.iter().map(|&vertex| posed[vertex]).collect();
        let bound: Vec<DVec3> = nodes.iter().map(|&at| mesh.positions[at]).collect();
        let triangles: Vec<[u32; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|at| node_of[at as usize] as u32))
            .collect();
        unfold(&bound, &mut rest, &triangles, size)?;
        let unfolded: Vec<DVec3> = node_of.iter().map(|&node| rest[node]).collect();
        let graph = Graph::new(&rest, &triangles);
        let mut field = Field::new(rest, &triangles, SMOOTHNESS * size)?;
        field
            .stiffness
            .iter_mut()
            .for_each(|s| *s = options.stiffness);
        Ok(Self {
            tree: Tree::new(&mesh.triangles, &unfolded),
            matcher: Matcher::new(&mesh.triangles, figure, markers.len(), size),
            mesh,
            markers,
            node_of,
            field,
            graph,
            pinned: Vec::new(),
            matches: Vec::new(),
            strays: BTreeSet::new(),
            size,
        })
    }

    /// `[vertices]`
    fn positions(&self) -> Vec<DVec3> {
        self.node_of
            .iter()
            .map(|&node| self.field.positions[node])
            .collect()
    }

    fn pull(&self, marker: usize, at: &Match, weight: f64) -> Pull {
        let triangle = self.mesh.triangles[at.triangle];
        Pull {
            corners: triangle.map(|vertex| self.node_of[vertex as usize]),
            barycentric: at.barycentric,
            target: self.markers[marker],
            weight,
        }
    }

    /// First landmarks alone and smoothness, as in the paper.
    fn landmarks(
        &mut self,
        seen: &[usize],
        options: &RegisterOptions,
        rig: Option<(&Figure, &figure::Placed)>,
        report: &mut RegisterReport,
    ) -> Result<(), RegisterError> {
        for landmark in &options.landmarks {
            if let Ok(marker) = seen.binary_search(&landmark.marker) {
                self.pinned.push((marker, self.node_of[landmark.vertex]));
            }
        }
        let posed = self.positions();
        self.matches = self.matcher.find(&self.tree, &posed, self.markers);
        let mut pulls = self.pins(LANDMARK_WEIGHT);
        if let (true, Some((figure, placed))) = (pulls.is_empty(), rig) {
            for marker in landmarks::near_joints(figure, placed, self.markers, &self.matches) {
                if let Some(at) = &self.matches[marker] {
                    pulls.push(self.pull(marker, at, LANDMARK_WEIGHT));
                }
            }
        }
        report.landmarks = pulls.len();
        if pulls.is_empty() {
            return Ok(());
        }
        self.keep_shapes();
        self.field.solve(&pulls)?;
        Ok(())
    }

    fn pins(&self, weight: f64) -> Vec<Pull> {
        let pin = |&(marker, node): &(usize, usize)| Pull {
            corners: [node; 3],
            barycentric: [1.0, 0.0, 0.0],
            target: self.markers[marker],
            weight,
        };
        self.pinned.iter().map(pin).collect()
    }

    /// Nearest points, then the field that brings them nearer.
    fn round(&mut self, weight: f64, report: &mut RegisterReport) -> Result<(), RegisterError> {
        let positions = self.positions();
        self.tree.refit(&positions);
        self.matches = self.matcher.find(&self.tree, &positions, self.markers);
        self.keep_shapes();
        self.field.solve(&self.pulls(weight))?;
        let left = self.distances();
        let mut sorted: Vec<f64> = left.iter().map(|left| left.1).collect();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        // Early rounds are too stiff to judge.
        if weight > 30.0 {
            let far = (STRAY.0 * self.size).max(STRAY.1 * middle);
            let strays = left.iter().filter(|left| left.1 > far).map(|left| left.0);
            self.strays.extend(strays);
        }
        report
            .rounds
            .push(sorted.iter().sum::<f64>() / sorted.len().max(1) as f64);
        Ok(())
    }

    fn pulls(&self, weight: f64) -> Vec<Pull> {
        let pinned: BTreeSet<usize> = self.pinned.iter().map(|pin| pin.0).collect();
        let free = |marker: &usize| !pinned.contains(marker) && !self.strays.contains(marker);
        let mut pulls = self.pins(weight.max(LANDMARK_WEIGHT));
        for marker in (0..self.markers.len()).filter(free) {
            if let Some(at) = &self.matches[marker] {
                pulls.push(self.pull(marker, at, weight));
            }
        }
        pulls
    }

    /// (marker, distance from its point) of those that belong to the body.
    fn distances(&self) -> Vec<(usize, f64)> {
        let of = |marker: usize| {
            let at = self.matches[marker].filter(|_| !self.strays.contains(&marker))?;
            let pull = self.pull(marker, &at, 0.0);
            let here = self.field.at(pull.corners, pull.barycentric);
            Some((marker, here.distance(pull.target)))
        };
        (0..self.markers.len()).filter_map(of).collect()
    }

    /// Holds each stretch of skin far from all markers near one turn and size.
    fn keep_shapes(&mut self) {
        let marked: Vec<u32> = self
            .matches
            .iter()
            .flatten()
            .map(|at| {
                let most = (0..3).max_by(|&a, &b| at.barycentric[a].total_cmp(&at.barycentric[b]));
                let vertex = self.mesh.triangles[at.triangle][most.unwrap_or(0)];
                self.node_of[vertex as usize] as u32
            })
            .collect();
        let spacing = spacing(&self.graph, &marked, &self.field.area);
        let distances = self.graph.distances(&marked);
        let far: Vec<bool> = distances
            .iter()
            .map(|&d| f64::from(d) > UNMARKED * spacing)
            .collect();
        let mut seen = vec![false; far.len()];
        for first in 0..far.len() {
            if !far[first] || seen[first] {
                continue;
            }
            seen[first] = true;
            let mut region = vec![first];
            let mut at = 0;
            while let Some(&node) = region.get(at) {
                at += 1;
                for &(next, _) in self.graph.row(node as u32) {
                    let next = next as usize;
                    if far[next] && !std::mem::replace(&mut seen[next], true) {
                        region.push(next);
                    }
                }
            }
            let weigh = |&node: &usize| self.field.maps[node] * self.field.area[node];
            let sum = region
                .iter()
                .map(weigh)
                .fold(DMat3::ZERO, |sum, map| sum + map);
            let area: f64 = region.iter().map(|&node| self.field.area[node]).sum();
            let mean = if area > 0.0 {
                sum * (1.0 / area)
            } else {
                DMat3::IDENTITY
            };
            let size = mean.determinant().max(0.0).cbrt();
            let kept = DMat3::from_quat(nearest_rotation(&mean)) * size;
            region
                .iter()
                .for_each(|&node| self.field.held[node] = (1.0, kept));
        }
        for (held, far) in self.field.held.iter_mut().zip(far) {
            if !far {
                held.0 = 0.0;
            }
        }
    }

    /// Makes the field stiffer around folded triangles, and lets markers there go a little, until
    /// there are none.
    fn unfold(&mut self, report: &mut RegisterReport) -> Result<(), RegisterError> {
        let mut weights = vec![WEIGHTS[1]; self.markers.len()];
        for repair in 0..=REPAIRS {
            let folded = fold::folded(
                &self.mesh.positions,
                &self.positions(),
                &self.mesh.triangles,
            );
            let Some(&first) = folded.first() else {
                report.repairs = repair;
                return Ok(());
            };
            if repair == REPAIRS {
                let corner = self.mesh.triangles[first][0] as usize;
                return Err(RegisterError::Folded {
                    count: folded.len(),
                    place: self.mesh.positions[corner],
                });
            }
            let corners = folded.iter().flat_map(|&at| self.mesh.triangles[at]);
            let nodes: Vec<u32> = corners.map(|at| self.node_of[at as usize] as u32).collect();
            let reach = SMOOTHNESS * self.size * (1.5 + repair as f64);
            let near = self.graph.distances(&nodes);
            let near = |node: usize| f64::from(near[node]) < reach;
            for (node, stiffness) in self.field.stiffness.iter_mut().enumerate() {
                *stiffness *= if near(node) { 4.0 } else { 1.0 };
            }
            for (marker, weight) in weights.iter_mut().enumerate() {
                if let Some(at) = &self.matches[marker] {
                    let corners = self.mesh.triangles[at.triangle];
                    if corners.iter().any(|&at| near(self.node_of[at as usize])) {
                        *weight *= 0.25;
                    }
                }
            }
            let mut pulls = self.pulls(WEIGHTS[1]);
            for pull in &mut pulls {
                let marker = self.markers.iter().position(|at| *at == pull.target);
                pull.weight = marker.map_or(pull.weight, |marker| weights[marker]);
            }
            self.field.solve(&pulls)?;
        }
        Ok(())
    }

    /// `[markers]`: the nearest points of the final surface.
    fn glue(&mut self) -> Vec<Option<Glue>> {
        let positions = self.positions();
        self.tree.refit(&positions);
        self.matches = self.matcher.find(&self.tree, &positions, self.markers);
        let glue = |marker: usize| {
            let at = self.matches[marker].filter(|_| !self.strays.contains(&marker))?;
            Some(Glue {
                triangle: at.triangle,
                vertices: self.mesh.triangles[at.triangle],
                barycentric: at.barycentric,
            })
        };
        (0..self.markers.len()).map(glue).collect()
    }
}

/// `[vertices]`: number of its node; and `[nodes]`: a vertex of each.
fn nodes(positions: &[DVec3]) -> (Vec<usize>, Vec<usize>) {
    let welded = weld(positions);
    let mut nodes = Vec::new();
    let mut node_of = Vec::with_capacity(positions.len());
    for (vertex, &first) in welded.iter().enumerate() {
        if first as usize == vertex {
            node_of.push(nodes.len());
            nodes.push(vertex);
        } else {
            node_of.push(node_of[first as usize]);
        }
    }
    (node_of, nodes)
}

/// The usual way from one marker to the next along the surface, from the area that each has: metres.
fn spacing(graph: &Graph, marked: &[u32], area: &[f64]) -> f64 {
    let distances = graph.distances(marked);
    // Half of the surface nearest to markers counts: hands and face have none.
    let mut by_distance: Vec<(f32, f64)> =
        distances.into_iter().zip(area.iter().copied()).collect();
    by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = area.iter().sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let middle = by_distance.iter().find(|(_, area)| {
        sum += area;
        sum >= half
    });
    // In a disc around a marker half of the area lies within 0.71 of its radius, and the spacing is
    // two radii.
    f64::from(middle.map_or(0.0, |(distance, _)| *distance)) * 2.0 / std::f64::consts::FRAC_1_SQRT_2
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
