//! Folds taken out of a posed mesh.
//!
//! Skinning turns triangles inside out where a limb is bent far, as in armpits. Around each such
//! place the mesh is laid out again as rigidly as it can be (Sorkine & Alexa 2007), held by what is
//! around it.

use glam::{DMat3, DVec3};

use super::fold::folded;
use crate::fit::laplace::LaplaceError;
use crate::fit::laplace::cholesky::Cholesky;
use crate::fit::laplace::graph::Graph;
use crate::fit::laplace::operator::Laplacian;
use crate::fit::laplace::rotations::fit_rotation;

/// Rounds, each with a wider surrounding.
const ROUNDS: usize = 6;
/// How far the surrounding reaches at first, over the body's size.
const REACH: f64 = 0.015;
/// Alternations of turns and places.
const STEPS: usize = 12;

/// Lays folded places of `posed` out again as they are in `rest`; what cannot be unfolded stays.
/// O(rounds (triangles + steps region))
///
/// # Errors
/// A mesh that cannot be factored.
pub(super) fn unfold(
    rest: &[DVec3],
    posed: &mut [DVec3],
    triangles: &[[u32; 3]],
    size: f64,
) -> Result<(), LaplaceError> {
    let mut worst = folded(rest, posed, triangles);
    if worst.is_empty() {
        return Ok(());
    }
    let graph = Graph::new(posed, triangles);
    let laplacian = Laplacian::new(rest, triangles);
    for round in 1..=ROUNDS {
        let corners: Vec<u32> = worst.iter().flat_map(|&at| triangles[at]).collect();
        let reach = REACH * size * round as f64;
        let distances = graph.distances(&corners);
        let fixed: Vec<bool> = distances.iter().map(|&d| f64::from(d) > reach).collect();
        lay_out(rest, posed, &laplacian, &fixed)?;
        worst = folded(rest, posed, triangles);
        if worst.is_empty() {
            break;
        }
    }
    Ok(())
}

/// Places of all vertices that are not fixed, with turns that vary smoothly to begin with.
fn lay_out(
    rest: &[DVec3],
    posed: &mut [DVec3],
    laplacian: &Laplacian,
    fixed: &[bool],
) -> Result<(), LaplaceError> {
    let factor = Cholesky::new(rest.len(), &laplacian.harmonic(fixed), None)?;
    let around = |posed: &[DVec3], at: usize| {
        let edges = laplacian
            .row(at)
            .map(|(to, weight)| (rest[to] - rest[at], posed[to] - posed[at], weight.max(1e-3)));
        fit_rotation(edges)
    };
    // The harmonic blend of the turns outside, not those of the folds.
    let mut turns: Vec<[f64; 9]> = (0..rest.len())
        .map(|at| match fixed[at] {
            true => DMat3::from_quat(around(posed, at)).to_cols_array(),
            false => [0.0; 9],
        })
        .collect();
    let right = |value: &dyn Fn(usize, usize) -> f64, at: usize, column: usize| -> f64 {
        let known = laplacian.row(at).filter(|&(to, _)| fixed[to]);
        known.map(|(to, weight)| weight * value(to, column)).sum()
    };
    let outside = turns.clone();
    for (at, turn) in turns.iter_mut().enumerate().filter(|(at, _)| !fixed[*at]) {
        for (column, x) in turn.iter_mut().enumerate() {
            *x = right(&|to, column| outside[to][column], at, column);
        }
    }
    factor.solve_vectors(&mut turns);
    let mut turns: Vec<DMat3> = turns
        .iter()
        .map(|turn| {
            DMat3::from_quat(crate::model::nearest_rotation(&DMat3::from_cols_array(
                turn,
            )))
        })
        .collect();
    let area = |points: &[DVec3], at: usize| -> f64 {
        laplacian
            .row(at)
            .map(|(to, _)| points[to].distance(points[at]))
            .sum()
    };
    let sums = (0..rest.len())
        .filter(|&at| fixed[at])
        .fold((1e-300, 1e-300), |(now, then), at| {
            (now + area(posed, at), then + area(rest, at))
        });
    let scale = sums.0 / sums.1;
    for step in 0..STEPS {
        if step > 0 {
            for at in (0..rest.len()).filter(|&at| !fixed[at]) {
                turns[at] = DMat3::from_quat(around(posed, at));
            }
        }
        let mut places: Vec<[f64; 3]> = (0..rest.len())
            .map(|at| {
                if fixed[at] {
                    return posed[at].to_array();
                }
                let sum = laplacian.row(at).map(|(to, weight)| {
                    let turn = (turns[at] + turns[to]) * (0.5 * scale);
                    let held = if fixed[to] {
                        posed[to] * weight
                    } else {
                        DVec3::ZERO
                    };
                    turn * (rest[at] - rest[to]) * weight + held
                });
                sum.sum::<DVec3>().to_array()
            })
            .collect();
        factor.solve_vectors(&mut places);
        for (place, found) in posed.iter_mut().zip(&places) {
            *place = DVec3::from_array(*found);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crumpled_middle_of_a_turned_sheet_is_smoothed_out() {
        let side = 15_u32;
        let rest: Vec<DVec3> = (0..side * side)
            .map(|at| DVec3::new(f64::from(at % side), f64::from(at / side), 0.0) * 0.1)
            .collect();
        let mut triangles = Vec::new();
        for y in 0..side - 1 {
            for x in 0..side - 1 {
                let (a, b) = (y * side + x, (y + 1) * side + x);
                triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
        let turn = DMat3::from_rotation_x(1.0) * 1.5;
        let flat: Vec<DVec3> = rest.iter().map(|p| turn * *p).collect();
        let mut posed = flat.clone();
        posed[112] = 0.5 * (posed[114] + posed[115]);
        posed[113] = posed[111];
        assert!(!folded(&rest, &posed, &triangles).is_empty());
        unfold(&rest, &mut posed, &triangles, 10.0).unwrap();
        assert!(folded(&rest, &posed, &triangles).is_empty());
        for (found, wanted) in posed.iter().zip(&flat) {
            assert!(found.distance(*wanted) < 0.02, "{found} {wanted}");
        }
    }
}
