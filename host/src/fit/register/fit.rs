//! The field fitted round by round: nearest points, pulls, shapes kept, folds laid out, glue.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};

use super::align::extent;
use super::field::{Field, Pull};
use super::figure::Figure;
use super::matching::{Match, Matcher};
use super::unfold::unfold;
use super::{
    Glue, RegisterError, RegisterOptions, RegisterReport, WEIGHTS, figure, fold, landmarks,
};
use crate::fit::laplace::graph::Graph;
use crate::model::{Mesh, nearest_rotation};
use crate::spatial::{Tree, weld};

/// Maps vary over this length, over the body's size.
const SMOOTHNESS: f64 = 0.012;
/// Weight of landmarks before the other markers count.
const LANDMARK_WEIGHT: f64 = 30.0;
/// Where no marker is within this many spacings of markers, the shape is kept.
const UNMARKED: f64 = 1.6;
/// A marker that stays this far from the surface over the body's size, and this many times farther
/// than the middle one, is no marker of this body.
const STRAY: (f64, f64) = (0.05, 8.0);
/// Rounds of stiffening where triangles fold.
const REPAIRS: usize = 12;

/// The field, and what the markers have to do with it. Markers are counted among those seen.
pub(super) struct Fit<'a> {
    mesh: &'a Mesh,
    markers: &'a [DVec3],
    /// `[vertices]`: node of the field; seams are closed.
    pub(super) node_of: Vec<usize>,
    pub(super) field: Field,
    graph: Graph,
    tree: Tree,
    matcher: Matcher<'a>,
    /// Vertices of the user's landmarks, by marker.
    pinned: Vec<(usize, usize)>,
    matches: Vec<Option<Match>>,
    pub(super) strays: BTreeSet<usize>,
    size: f64,
}

impl<'a> Fit<'a> {
    pub(super) fn new(
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
    pub(super) fn positions(&self) -> Vec<DVec3> {
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
    pub(super) fn landmarks(
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
        self.find(&posed);
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

    /// Nearest points, and the markers that have none: they may be a body's again once it is nearer.
    fn find(&mut self, positions: &[DVec3]) {
        self.matches = self.matcher.find(&self.tree, positions, self.markers);
        let distances = self.matches.iter().flatten().map(|at| at.distance);
        let mut sorted: Vec<f64> = distances.collect();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let far = (STRAY.0 * self.size).max(STRAY.1 * middle);
        let is_stray = |&marker: &usize| self.matches[marker].is_none_or(|at| at.distance > far);
        self.strays = (0..self.markers.len()).filter(is_stray).collect();
    }

    /// Nearest points, then the field that brings them nearer.
    pub(super) fn round(
        &mut self,
        weight: f64,
        report: &mut RegisterReport,
    ) -> Result<(), RegisterError> {
        let positions = self.positions();
        self.tree.refit(&positions);
        self.find(&positions);
        self.keep_shapes();
        self.field.solve(&self.pulls(weight))?;
        let left = self.distances();
        report
            .rounds
            .push(left.iter().sum::<f64>() / left.len().max(1) as f64);
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

    /// Distances from their points of the markers that belong to the body.
    fn distances(&self) -> Vec<f64> {
        let of = |marker: usize| {
            let at = self.matches[marker].filter(|_| !self.strays.contains(&marker))?;
            let pull = self.pull(marker, &at, 0.0);
            let here = self.field.at(pull.corners, pull.barycentric);
            Some(here.distance(pull.target))
        };
        (0..self.markers.len()).filter_map(of).collect()
    }

    /// Holds each stretch of skin far from all markers near one turn and size.
    fn keep_shapes(&mut self) {
        let own = self.matches.iter().enumerate();
        let marked: Vec<u32> = own
            .filter(|(marker, _)| !self.strays.contains(marker))
            .filter_map(|(_, at)| *at)
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
    pub(super) fn unfold(&mut self, report: &mut RegisterReport) -> Result<(), RegisterError> {
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
    pub(super) fn glue(&mut self) -> Vec<Option<Glue>> {
        let positions = self.positions();
        self.tree.refit(&positions);
        self.find(&positions);
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
pub(super) fn nodes(positions: &[DVec3]) -> (Vec<usize>, Vec<usize>) {
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
