//! A rig posed and resized so that its skin meets the markers.
//!
//! Gauss-Newton steps on the distances of the markers to their nearest points of the posed skin
//! (Besl & McKay 1992), which count across the surface more than along it, with robust weights
//! (Geman & McClure 1987) whose width narrows, and with turns and sizes held near those expected.

use glam::{DMat3, DQuat, DVec3};

use super::align::Start;
use super::figure::{Figure, Placed, Stance, cross_matrix};
use crate::clean::linear::Cholesky;
use crate::spatial::{Nearest, Tree};

/// Steps at most.
pub(super) const STEPS: usize = 40;
/// Width of the robust weights, over the body's size: first and last.
const WIDTH: [f64; 2] = [0.08, 0.012];
/// Standard deviation of a distance over the body's size, against which turns and sizes are held.
const DEVIATION: f64 = 0.008;
/// How much a distance along the surface counts against one across it: first and last.
const ALONG: [f64; 2] = [1.0, 0.1];
/// Standard deviation of the logarithm of a size: of one part, of the body.
const GROWTH: [f64; 2] = [0.10, 1.0];
/// No joint turns further in one step, radians.
const LARGEST_TURN: f64 = 0.4;

/// A posed rig and how well it fits.
#[derive(Clone, Debug)]
pub(super) struct Posed {
    /// The pose.
    pub stance: Stance,
    /// The same, placed.
    pub placed: Placed,
    /// `[vertices]`: the posed skin, metres.
    pub positions: Vec<DVec3>,
    /// Mean distance of the markers from the skin, none counted as more than 5 % of the body.
    pub misfit: f64,
}

/// A rig, and what it shall meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitting<'a> {
    /// The rig.
    pub figure: &'a Figure,
    /// `[vertices]`: its mesh as it was bound.
    pub rest: &'a [DVec3],
    /// Of the mesh.
    pub triangles: &'a [[u32; 3]],
    /// `[markers]`, metres.
    pub markers: &'a [DVec3],
    /// The body's size, metres.
    pub size: f64,
}

impl Fitting<'_> {
    /// Bends and resizes the rig from a start. `tree` is over the mesh; it is refitted.
    /// O(steps (vertices + markers nodes^2))
    pub fn articulate(&self, tree: &mut Tree, start: &Start, steps: usize) -> Posed {
        let Self {
            figure,
            rest,
            triangles,
            markers,
            size,
        } = *self;
        let mut stance = start.stance.clone().unwrap_or_else(|| figure.bound());
        let similarity = &start.similarity;
        stance.place = similarity.apply(stance.place);
        stance.turns[0] = similarity.rotation * stance.turns[0];
        stance.scale += similarity.scale.ln();
        let mut placed = figure.place(&stance);
        let mut positions = figure.pose(&placed, rest);
        for step in 0..steps {
            let through = step as f64 / (steps - 1).max(1) as f64;
            let between = |[first, last]: [f64; 2]| first * (last / first).powf(through.min(1.0));
            tree.refit(&positions);
            let width = between(WIDTH) * size;
            let along = between(ALONG);
            let mut system = System::new(figure);
            for &marker in markers {
                let Some(near) = tree.closest(marker, |_| true) else {
                    continue;
                };
                let robust = (1.0 + (near.distance / width).powi(2)).powi(-2);
                let normal = normal(&positions, triangles[near.triangle]);
                let across =
                    DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                let counts = across + (DMat3::IDENTITY - across) * along;
                let motion =
                    figure.motion(&placed, rest, triangles[near.triangle], near.barycentric);
                system.add(&motion.columns(), near.position - marker, counts * robust);
            }
            system.hold(figure, &stance, &placed, DEVIATION * size);
            let Some(change) = system.solve() else { break };
            let length = change.iter().map(|c| c * c).sum::<f64>().sqrt();
            stance.advance(figure, &placed, &change);
            placed = figure.place(&stance);
            positions = figure.pose(&placed, rest);
            if through >= 1.0 && length < 1e-4 {
                break;
            }
        }
        tree.refit(&positions);
        let misfit = misfit(tree, markers, size * stance.scale.exp());
        Posed {
            stance,
            placed,
            positions,
            misfit,
        }
    }
}

/// Mean distance of markers from a surface, none counted as more than 5 % of `size`.
pub(super) fn misfit(tree: &Tree, markers: &[DVec3], size: f64) -> f64 {
    let most = 0.05 * size;
    let away = |marker: &DVec3| {
        let near: Option<Nearest> = tree.closest(*marker, |_| true);
        near.map_or(most, |near| near.distance.min(most))
    };
    markers.iter().map(away).sum::<f64>() / markers.len().max(1) as f64
}

fn normal(positions: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|at| positions[at as usize]);
    (b - a).cross(c - a).normalize_or(DVec3::Y)
}

impl super::figure::Motion {
    /// Velocities by every parameter, in the order of [`Stance::advance`].
    fn columns(&self) -> Vec<DVec3> {
        let mut columns = Vec::with_capacity(4 + self.growth.len() + 3 * self.levers.len());
        columns.extend(DVec3::AXES);
        columns.push(self.scale);
        columns.extend(&self.growth);
        for lever in &self.levers {
            let turn = -cross_matrix(*lever);
            columns.extend([turn.x_axis, turn.y_axis, turn.z_axis]);
        }
        columns
    }
}

/// Normal equations of one step.
struct System {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    fn new(figure: &Figure) -> Self {
        let size = 4 + figure.group_count + 3 * figure.origins.len();
        Self {
            size,
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
        }
    }

    /// A point that is `error` from where it should be and moves by `columns`.
    fn add(&mut self, columns: &[DVec3], error: DVec3, counts: DMat3) {
        let used = columns.iter().enumerate();
        let used: Vec<(usize, DVec3)> = used
            .filter(|(_, column)| **column != DVec3::ZERO)
            .map(|(at, column)| (at, *column))
            .collect();
        for &(row, column) in &used {
            let weighted = counts * column;
            self.right[row] -= weighted.dot(error);
            for &(at, other) in used.iter().take_while(|(at, _)| *at <= row) {
                self.matrix[row * self.size + at] += weighted.dot(other);
            }
        }
    }

    /// Sizes and turns near those expected.
    fn hold(&mut self, figure: &Figure, stance: &Stance, placed: &Placed, deviation: f64) {
        let mut towards = |at: usize, value: f64, sigma: f64| {
            let weight = (deviation / sigma).powi(2);
            self.matrix[at * self.size + at] += weight;
            self.right[at] -= weight * value;
        };
        for axis in 0..3 {
            towards(axis, 0.0, 1.0);
        }
        towards(3, 0.0, GROWTH[1]);
        for (group, &growth) in stance.growth.iter().enumerate() {
            towards(4 + group, growth, GROWTH[0]);
        }
        let first = 4 + stance.growth.len();
        for (node, turn) in stance.turns.iter().enumerate() {
            let (turned, sigma) = match figure.parents[node] {
                None => (DVec3::ZERO, 1.0),
                Some(above) => (placed.turns[above] * near_turn(*turn), figure.freedom[node]),
            };
            for axis in 0..3 {
                towards(first + 3 * node + axis, turned[axis], sigma);
            }
        }
    }

    fn solve(mut self) -> Option<Vec<f64>> {
        let factor = Cholesky::new(self.size, self.matrix)?;
        factor.solve(&mut self.right, 1);
        let change = self.right;
        let finite = change.iter().all(|c| c.is_finite());
        let largest = change[4..]
            .iter()
            .fold(0.0, |most: f64, c| most.max(c.abs()));
        let shorter = (LARGEST_TURN / largest.max(1e-300)).min(1.0);
        finite.then(|| change.iter().map(|c| c * shorter).collect())
    }
}

/// A turn as an axis times an angle of at most pi.
fn near_turn(turn: DQuat) -> DVec3 {
    let turn = if turn.w < 0.0 { -turn } else { turn };
    turn.to_scaled_axis()
}
