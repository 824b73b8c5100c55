//! A template brought onto a scan: principal axes, their ambiguities resolved, then refined
//! (de Aguiar et al. 2007, section 3.2).
//!
//! Principal axes have no sign and, where a body's extents are alike, no order. All 24 proper
//! turns are tried; each is improved by a few rounds of closest points, and the one that fits best
//! is refined (Besl & McKay 1992; scale by Umeyama 1991).

use glam::{DMat3, DQuat, DVec3};

use super::LaplaceError;
use super::nearest::Nearest;
use super::rotations::fit_rotation;
use super::template::Template;

/// Rotation, scale and translation, in that order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factor.
    pub scale: f64,
    /// Metres.
    pub translation: DVec3,
}

impl Similarity {
    /// No change.
    pub const IDENTITY: Self = Self {
        rotation: DQuat::IDENTITY,
        scale: 1.0,
        translation: DVec3::ZERO,
    };

    /// Moves a point.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * (point * self.scale) + self.translation
    }

    /// The one that best takes `from` to `to`, in the least squares sense (Umeyama 1991), with the
    /// scale given or found. O(points)
    #[must_use]
    pub fn between(from: &[DVec3], to: &[DVec3], scale: Option<f64>) -> Self {
        let middle = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let (a, b) = (middle(from), middle(to));
        let pairs = || from.iter().zip(to).map(|(p, q)| (*p - a, *q - b));
        let rotation = fit_rotation(pairs().map(|(p, q)| (p, q, 1.0)));
        let along: f64 = pairs().map(|(p, q)| (rotation * p).dot(q)).sum();
        let square: f64 = pairs().map(|(p, _)| p.length_squared()).sum();
        let found = if square > 0.0 { along / square } else { 1.0 };
        let scale = scale.unwrap_or(if found > 1e-6 { found } else { 1.0 });
        Self {
            rotation,
            scale,
            translation: b - rotation * (a * scale),
        }
    }
}

/// How a template was brought onto a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// From the template's space to the scan's.
    pub similarity: Similarity,
    /// Mean distance of the better nine tenths of the template's points from the scan, metres.
    pub residual: f64,
    /// Mean distance of the template from the scan and of the scan from the template together,
    /// metres: how alike their poses are.
    pub misfit: f64,
    /// How much better it fits than the best of another direction: 1 is a draw.
    pub lead: f64,
}

/// Points of either side that take part for each of the 24 turns, and for the best of them.
const SAMPLES: [usize; 2] = [120, 500];
/// Rounds of closest points, likewise.
const ROUNDS: [usize; 2] = [5, 30];
/// Closest pairs beyond the better part of this size are left out.
const KEPT: f64 = 0.9;
/// A turn that lays the template down must fit better by this factor: importers know what is up.
const LYING: f64 = 1.3;

/// Aligns a template's `points` in a pose with those of a `scan` in about the same pose, metres.
/// `scale`: of the template, where it is known. O(24 rounds points log points)
///
/// # Errors
/// [`LaplaceError::Flat`] where either has no extent to align by.
pub fn align(
    points: &[DVec3],
    scan: &[DVec3],
    scale: Option<f64>,
) -> Result<Alignment, LaplaceError> {
    let from = Shape::new(points).ok_or(LaplaceError::Flat { what: "template" })?;
    let to = Shape::new(scan).ok_or(LaplaceError::Flat { what: "scan" })?;
    let (few, few_of_scan) = (thinned(points, SAMPLES[0]), thinned(scan, SAMPLES[0]));
    let (many, many_of_scan) = (thinned(points, SAMPLES[1]), thinned(scan, SAMPLES[1]));
    let tree = Nearest::new(scan);
    let start_scale = scale.unwrap_or(to.extent / from.extent);
    let mut tries: Vec<(f64, Similarity)> = Vec::new();
    for turn in turns() {
        let rotation = DQuat::from_mat3(&(to.axes * turn * from.axes.transpose())).normalize();
        let start = Similarity {
            rotation,
            scale: start_scale,
            translation: to.middle - rotation * (from.middle * start_scale),
        };
        let found = refine(&few, &tree, scan, start, scale, ROUNDS[0]);
        let lying = if (found.rotation * DVec3::Y).y < 0.7 {
            LYING
        } else {
            1.0
        };
        tries.push((lying * misfit(&few, &few_of_scan, &tree, &found), found));
    }
    tries.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (best, start) = tries[0];
    let similarity = refine(&many, &tree, scan, start, scale, ROUNDS[1]);
    let apart = |other: &Similarity| {
        (other.rotation * start.rotation.inverse())
            .to_axis_angle()
            .1
    };
    let second = tries.iter().find(|(_, other)| apart(other) > 0.5);
    let (_, residual) = kept(&many, &tree, &similarity);
    Ok(Alignment {
        similarity,
        residual,
        misfit: misfit(&many, &many_of_scan, &tree, &similarity),
        lead: second.map_or(f64::INFINITY, |(error, _)| error / best.max(1e-12)),
    })
}

/// Frames of a template that are tried for the pose of a scan.
const FRAMES: usize = 16;

/// The frame of a template whose pose is most like a scan's, and its alignment. Cost as [`align`],
/// for some frames.
///
/// # Errors
/// As [`align`].
pub fn best_frame(template: &Template, scan: &[DVec3]) -> Result<(usize, Alignment), LaplaceError> {
    let all: Vec<u32> = (0..template.point_count() as u32).collect();
    let motion = template.motion();
    let step = motion.len().div_ceil(FRAMES).max(1);
    let (before, behind) = (0..motion.start, motion.end..template.frame_count());
    let frames = before.chain(motion.step_by(step)).chain(behind);
    let mut best: Option<(usize, Alignment)> = None;
    for frame in frames {
        let found = align(&template.positions(&all, frame), scan, None)?;
        if best.is_none_or(|(_, best)| found.misfit < best.misfit) {
            best = Some((frame, found));
        }
    }
    best.ok_or(LaplaceError::NoTemplate)
}

/// Middle, principal axes and size of points.
struct Shape {
    middle: DVec3,
    /// Columns, right-handed, longest first.
    axes: DMat3,
    /// Root mean square distance from the middle.
    extent: f64,
}

impl Shape {
    fn new(points: &[DVec3]) -> Option<Self> {
        let count = points.len().max(1) as f64;
        let middle = points.iter().sum::<DVec3>() / count;
        let mut sum = DMat3::ZERO;
        for point in points {
            let p = *point - middle;
            sum += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
        }
        let extent = ((sum.x_axis.x + sum.y_axis.y + sum.z_axis.z) / count).sqrt();
        let usable = points.len() >= 3 && extent.is_finite() && extent > 1e-6;
        usable.then(|| Self {
            middle,
            axes: principal_axes(sum),
            extent,
        })
    }
}

/// Eigenvectors of a symmetric matrix, of the largest eigenvalue first (cyclic Jacobi).
fn principal_axes(matrix: DMat3) -> DMat3 {
    let mut a = matrix;
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off.abs() < 1e-300 {
                continue;
            }
            let angle = 0.5 * (2.0 * off).atan2(a.col(q)[q] - a.col(p)[p]);
            let (sine, cosine) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cosine;
            turn.col_mut(q)[q] = cosine;
            turn.col_mut(q)[p] = sine;
            turn.col_mut(p)[q] = -sine;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a.col(j)[j].total_cmp(&a.col(i)[i]));
    let (first, second) = (vectors.col(order[0]), vectors.col(order[1]));
    DMat3::from_cols(first, second, first.cross(second))
}

/// The 24 rotations of a cube: every order and sign of axes that keeps hands apart.
fn turns() -> Vec<DMat3> {
    const AXES: [DVec3; 6] = [
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        DVec3::NEG_X,
        DVec3::NEG_Y,
        DVec3::NEG_Z,
    ];
    let mut turns = Vec::with_capacity(24);
    for first in AXES {
        for second in AXES.into_iter().filter(|axis| first.dot(*axis) == 0.0) {
            turns.push(DMat3::from_cols(first, second, first.cross(second)));
        }
    }
    turns
}

/// The better nine tenths of the points with their closest on the scan, and their mean distance.
fn kept(points: &[DVec3], tree: &Nearest, now: &Similarity) -> (Vec<(usize, u32)>, f64) {
    let mut pairs: Vec<(f64, usize, u32)> = points
        .iter()
        .enumerate()
        .filter_map(|(at, &point)| {
            let (to, distance) = tree.find(now.apply(point))?;
            Some((distance, at, to))
        })
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    pairs.truncate(((pairs.len() as f64 * KEPT) as usize).max(3));
    let mean = pairs.iter().map(|pair| pair.0).sum::<f64>() / pairs.len().max(1) as f64;
    (pairs.iter().map(|&(_, at, to)| (at, to)).collect(), mean)
}

fn refine(
    points: &[DVec3],
    tree: &Nearest,
    scan: &[DVec3],
    start: Similarity,
    scale: Option<f64>,
    rounds: usize,
) -> Similarity {
    let mut now = start;
    for _ in 0..rounds {
        let (pairs, _) = kept(points, tree, &now);
        let (from, to): (Vec<DVec3>, Vec<DVec3>) = pairs
            .iter()
            .map(|&(at, to)| (points[at], scan[to as usize]))
            .unzip();
        let mut next = Similarity::between(&from, &to, scale);
        // Points inside a surface would shrink toward it for ever; a body's size is known better.
        next.scale = next.scale.clamp(0.8 * start.scale, 1.25 * start.scale);
        let still = next.rotation.dot(now.rotation).abs() > 1.0 - 1e-12
            && next.translation.distance(now.translation) < 1e-7;
        now = next;
        if still {
            break;
        }
    }
    now
}

/// Mean distance both ways: a template must lie on the scan and reach all of it.
fn misfit(points: &[DVec3], scan: &[DVec3], tree: &Nearest, now: &Similarity) -> f64 {
    let (_, there) = kept(points, tree, now);
    let moved: Vec<DVec3> = points.iter().map(|&p| now.apply(p)).collect();
    let (_, back) = kept(scan, &Nearest::new(&moved), &Similarity::IDENTITY);
    there + back
}

/// Every so many-th point.
fn thinned(points: &[DVec3], count: usize) -> Vec<DVec3> {
    let step = points.len().div_ceil(count).max(1);
    points.iter().copied().step_by(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something like a body: tall, wide at the arms, with feet to the front.
    fn body() -> Vec<DVec3> {
        let mut points = Vec::new();
        for k in 0..200 {
            let t = f64::from(k) / 199.0;
            points.push(DVec3::new(
                0.15 * (9.0 * t).sin(),
                1.8 * t,
                0.05 * (7.0 * t).cos(),
            ));
            points.push(DVec3::new(1.5 * t - 0.75, 1.45, 0.02 * (20.0 * t).sin()));
            if k % 4 == 0 {
                points.push(DVec3::new(0.1, 0.02, 0.25 * t));
                points.push(DVec3::new(-0.1, 0.02, 0.25 * t));
            }
        }
        points
    }

    #[test]
    fn any_turn_and_size_is_found_again() {
        let scan = body();
        for seed in 0..6 {
            let angle = f64::from(seed) * 1.1;
            let truth = Similarity {
                rotation: DQuat::from_rotation_y(angle),
                scale: 0.9 + 0.05 * f64::from(seed),
                translation: DVec3::new(3.0, -1.0, 0.5 * f64::from(seed)),
            };
            let template: Vec<_> = scan.iter().map(|&p| truth.apply(p)).collect();
            let found = align(&template, &scan, None).expect("aligns");
            let off = template.iter().zip(&scan);
            let off = off.map(|(t, s)| found.similarity.apply(*t).distance(*s));
            assert!(off.fold(0.0, f64::max) < 2e-3, "{seed}: {found:?}");
            assert!(found.lead > 1.05, "{found:?}");
        }
    }

    #[test]
    fn a_scan_that_lies_is_stood_up() {
        let scan: Vec<_> = body()
            .iter()
            .map(|p| DQuat::from_rotation_x(-1.57) * *p)
            .collect();
        let found = align(&body(), &scan, Some(1.0)).expect("aligns");
        assert!(found.residual < 2e-3, "{found:?}");
    }

    #[test]
    fn points_in_one_place_are_refused() {
        let same = [DVec3::X; 9];
        let error = align(&same, &body(), None).expect_err("refused");
        assert_eq!(error, LaplaceError::Flat { what: "template" });
        assert!(align(&body(), &[], None).is_err());
    }
}
