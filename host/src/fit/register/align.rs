//! Where a body stands: turn, size and place of a whole mesh from markers that nobody has named.
//!
//! From many starts (turned about the vertical, and, where none of these fits, laid along the
//! markers' principal axes) the nearest points of the surface and the similarity that brings them
//! to the markers take turns (Besl & McKay 1992, with the scale of Umeyama 1991).

use glam::{DMat3, DQuat, DVec3};

use super::articulate::misfit;
use super::figure::{Figure, Stance};
use crate::clean::linear::symmetric_eigen;
use crate::fit::humanoid::SIDES;
use crate::fit::laplace::rotations::fit_rotation;
use crate::fit::{Part, Side};
use crate::spatial::Tree;

/// Turns about the vertical that are tried.
const YAWS: usize = 12;
/// Rounds of nearest points.
const ROUNDS: usize = 15;
/// A start that fits worse than this, over the body's size, does not stand upright.
const UPRIGHT: f64 = 0.02;

/// `p -> scale R p + shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Factor of size.
    pub scale: f64,
    /// Turn about the origin.
    pub rotation: DQuat,
    /// Metres.
    pub shift: DVec3,
}

impl Similarity {
    /// Changes nothing.
    pub const IDENTITY: Self = Self {
        scale: 1.0,
        rotation: DQuat::IDENTITY,
        shift: DVec3::ZERO,
    };

    /// Where a point goes.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point * self.scale + self.shift
    }

    fn undo(&self, point: DVec3) -> DVec3 {
        self.rotation.inverse() * (point - self.shift) / self.scale
    }

    /// The weighted least-squares similarity from the first points to the second (Umeyama 1991).
    fn fit(pairs: &[(DVec3, DVec3, f64)]) -> Option<Self> {
        let weight: f64 = pairs.iter().map(|pair| pair.2).sum();
        let mean = |of: &dyn Fn(&(DVec3, DVec3, f64)) -> DVec3| {
            pairs.iter().map(|pair| of(pair) * pair.2).sum::<DVec3>() / weight
        };
        let (from, to) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
        let arms = pairs.iter().map(|&(a, b, w)| (a - from, b - to, w));
        let rotation = fit_rotation(arms.clone());
        let along: f64 = arms
            .clone()
            .map(|(a, b, w)| w * (rotation * a).dot(b))
            .sum();
        let spread: f64 = arms.map(|(a, _, w)| w * a.length_squared()).sum();
        let scale = along / spread;
        let found = Self {
            scale,
            rotation,
            shift: to - rotation * from * scale,
        };
        (scale > 0.0 && found.shift.is_finite()).then_some(found)
    }
}

/// Where a search begins.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// Pose of the rig, if there is one.
    pub stance: Option<Stance>,
    /// From that pose's space to the markers'.
    pub similarity: Similarity,
    /// How badly it fits, over the body's size.
    pub misfit: f64,
}

/// Ways to stand in which `markers` lie near the surface, best first. The figure's arms are tried
/// in several poses. O(starts rounds markers log triangles)
pub(super) fn starts(
    figure: Option<&Figure>,
    rest: &[DVec3],
    triangles: &[[u32; 3]],
    markers: &[DVec3],
) -> Vec<Start> {
    let mut poses: Vec<(Option<Stance>, Vec<DVec3>)> = vec![(None, rest.to_vec())];
    if let Some(figure) = figure {
        poses = arm_poses(figure)
            .into_iter()
            .map(|stance| {
                let posed = figure.pose(&figure.place(&stance), rest);
                (Some(stance), posed)
            })
            .collect();
    }
    let upright = (0..YAWS)
        .map(|yaw| DQuat::from_rotation_y(std::f64::consts::TAU * yaw as f64 / YAWS as f64));
    let upright: Vec<DQuat> = upright.collect();
    let mut found = search(&poses, triangles, markers, &|_| upright.clone());
    if found.first().is_none_or(|best| best.misfit > UPRIGHT) {
        let lying = search(&poses, triangles, markers, &|posed| {
            axis_turns(posed, markers)
        });
        found.extend(lying);
        found.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    }
    found
}

fn search(
    poses: &[(Option<Stance>, Vec<DVec3>)],
    triangles: &[[u32; 3]],
    markers: &[DVec3],
    turns: &dyn Fn(&[DVec3]) -> Vec<DQuat>,
) -> Vec<Start> {
    let mut found = Vec::new();
    for (stance, posed) in poses {
        let tree = Tree::new(triangles, posed);
        let points = on_surface(posed, triangles);
        for turn in turns(posed) {
            let first = first_guess(&points, markers, turn);
            let (similarity, misfit) = settle(&tree, markers, first, extent(posed));
            found.push(Start {
                stance: stance.clone(),
                similarity,
                misfit,
            });
        }
    }
    found.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    found
}

/// Largest side of the box around points.
pub(super) fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    (high - low).max_element()
}

/// Nearest points and the similarity, in turn; in the mesh's space, so that its tree stays.
fn settle(tree: &Tree, markers: &[DVec3], first: Similarity, size: f64) -> (Similarity, f64) {
    let mut at = first;
    for round in 0..ROUNDS {
        let width = size * 0.15 * (0.15_f64).powf(round as f64 / (ROUNDS - 1) as f64);
        let pairs: Vec<_> = markers
            .iter()
            .filter_map(|&marker| {
                let near = tree.closest(at.undo(marker), |_| true)?;
                let robust = (1.0 + (near.distance / width).powi(2)).powi(-2);
                Some((near.position, marker, robust))
            })
            .collect();
        match Similarity::fit(&pairs) {
            // A body that shrinks to a point fits everything.
            Some(next) if (0.5..2.0).contains(&(next.scale / first.scale)) => at = next,
            _ => break,
        }
    }
    let own: Vec<DVec3> = markers.iter().map(|&marker| at.undo(marker)).collect();
    (at, misfit(tree, &own, size) / size)
}

/// The same middle and the same spread along the vertical (after the turn).
fn first_guess(points: &[DVec3], markers: &[DVec3], turn: DQuat) -> Similarity {
    let (from, to) = (mean(points), mean(markers));
    let spread = |points: &[DVec3], middle: DVec3, turn: DQuat| {
        let squared = points.iter().map(|p| (turn * (*p - middle)).y.powi(2));
        (squared.sum::<f64>() / points.len() as f64).sqrt()
    };
    let scale = spread(markers, to, DQuat::IDENTITY) / spread(points, from, turn);
    let scale = if scale.is_finite() && scale > 0.0 {
        scale
    } else {
        1.0
    };
    Similarity {
        scale,
        rotation: turn,
        shift: to - turn * from * scale,
    }
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// About a thousand points that are spread over a surface as its area is.
pub(super) fn on_surface(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    const COUNT: f64 = 1000.0;
    let corners = |t: &[u32; 3]| t.map(|at| positions[at as usize]);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        (b - a).cross(c - a).length()
    };
    let step = triangles.iter().map(area).sum::<f64>() / COUNT;
    let (mut points, mut left) = (Vec::new(), step / 2.0);
    for triangle in triangles {
        left -= area(triangle);
        if left < 0.0 {
            let [a, b, c] = corners(triangle);
            points.push((a + b + c) / 3.0);
            left += step * (-left / step).ceil();
        }
    }
    points
}

/// The 24 ways to lay the principal axes of points along those of the markers.
fn axis_turns(points: &[DVec3], markers: &[DVec3]) -> Vec<DQuat> {
    let (from, to) = (principal_axes(points), principal_axes(markers));
    let mut turns = Vec::new();
    for order in [
        [0, 1, 2],
        [1, 2, 0],
        [2, 0, 1],
        [0, 2, 1],
        [2, 1, 0],
        [1, 0, 2],
    ] {
        for signs in 0..4 {
            let sign = |bit: usize| if signs >> bit & 1 == 1 { -1.0 } else { 1.0 };
            let x = to[order[0]] * sign(0);
            let y = to[order[1]] * sign(1);
            let target = DMat3::from_cols(x, y, x.cross(y));
            let source = DMat3::from_cols(from[0], from[1], from[0].cross(from[1]));
            turns.push(DQuat::from_mat3(&(target * source.transpose())).normalize());
        }
    }
    turns
}

/// Directions of most, middle and least spread.
fn principal_axes(points: &[DVec3]) -> [DVec3; 3] {
    let middle = mean(points);
    let mut matrix = vec![0.0; 9];
    for point in points {
        let away = (*point - middle).to_array();
        for row in 0..3 {
            for column in 0..3 {
                matrix[3 * row + column] += away[row] * away[column];
            }
        }
    }
    let (_, vectors) = symmetric_eigen(3, matrix);
    [0, 1, 2].map(|at| DVec3::from_slice(&vectors[3 * at..]))
}

/// The bound pose, and human arms level, half lowered and hanging.
fn arm_poses(figure: &Figure) -> Vec<Stance> {
    let mut poses = vec![figure.bound()];
    let Some(human) = &figure.human else {
        return poses;
    };
    let limb = |side: Side, part| {
        human
            .limb(side, part)
            .map(|joint| figure.bind[joint].translation)
    };
    let hips = SIDES.map(|side| limb(side, Part::UpperLeg));
    let [Some(left), Some(right)] = hips else {
        return poses;
    };
    for lowered in [0.0_f64, 40.0, 75.0] {
        let mut stance = figure.bound();
        for side in SIDES {
            let arm = (limb(side, Part::UpperArm), limb(side, Part::LowerArm));
            let (Some(shoulder), Some(elbow)) = arm else {
                continue;
            };
            let Some(joint) = human.limb(side, Part::UpperArm) else {
                continue;
            };
            let outward = (left - right).reject_from(DVec3::Y).normalize_or(DVec3::X);
            let outward = if side == Side::Left {
                outward
            } else {
                -outward
            };
            let angle = lowered.to_radians();
            let wanted = outward * angle.cos() - DVec3::Y * angle.sin();
            let now = (elbow - shoulder).normalize_or(wanted);
            stance.turns[figure.node_of[joint]] = DQuat::from_rotation_arc(now, wanted);
        }
        poses.push(stance);
    }
    poses
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 24 x 8 x 4 cells, and a knob that makes it unlike itself from any side.
    fn body() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        let mut quad = |corners: [DVec3; 4]| {
            let at = positions.len() as u32;
            positions.extend(corners);
            triangles.extend([[at, at + 1, at + 2], [at, at + 2, at + 3]]);
        };
        let mut block = |low: DVec3, high: DVec3| {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for end in [low, high] {
                    let corner = |a: bool, b: bool| {
                        let mut at = end;
                        at[u] = if a { high[u] } else { low[u] };
                        at[v] = if b { high[v] } else { low[v] };
                        at
                    };
                    quad([
                        corner(false, false),
                        corner(true, false),
                        corner(true, true),
                        corner(false, true),
                    ]);
                }
            }
        };
        block(DVec3::ZERO, DVec3::new(0.5, 1.6, 0.25));
        block(DVec3::new(0.1, 1.2, 0.25), DVec3::new(0.2, 1.5, 0.5));
        (positions, triangles)
    }

    #[test]
    fn a_turned_resized_and_even_a_lying_body_is_found() {
        let (positions, triangles) = body();
        let points = on_surface(&positions, &triangles);
        // Every triangle is larger than a step, so there are few points; corners and middles do.
        let mut sites: Vec<DVec3> = positions.clone();
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|at| positions[at as usize]);
            for (u, v) in [(0.2, 0.3), (0.6, 0.2), (0.1, 0.7), (0.4, 0.4)] {
                sites.push(a + (b - a) * u + (c - a) * v);
            }
        }
        assert!(!points.is_empty());
        for turn in [
            DQuat::from_rotation_y(2.0),
            DQuat::from_rotation_x(1.6) * DQuat::from_rotation_y(0.4),
        ] {
            let truth = Similarity {
                scale: 1.2,
                rotation: turn,
                shift: DVec3::new(0.3, 2.0, -1.0),
            };
            let markers: Vec<DVec3> = sites.iter().map(|p| truth.apply(*p)).collect();
            let best = &starts(None, &positions, &triangles, &markers)[0];
            for site in &sites {
                let away = best.similarity.apply(*site).distance(truth.apply(*site));
                assert!(away < 0.03, "{away} {:?}", best.similarity);
            }
        }
    }
}
