//! Laplacian deformation, straight from the equations of de Aguiar et al. 2007, section 3.3.

use glam::{DQuat, DVec3};

use crate::fit::laplace::operator::Laplacian;
use crate::fit::laplace::{MarkerTarget, Surface};

/// Signs such that neighbours along the tree are at most half a revolution apart.
#[must_use]
pub fn consistent_signs(targets: &[MarkerTarget], edges: &[[u16; 2]]) -> Vec<DQuat> {
    let mut rotations: Vec<DQuat> = targets.iter().map(|t| t.rotation.normalize()).collect();
    for &[one, other] in edges {
        if rotations[usize::from(one)].dot(rotations[usize::from(other)]) < 0.0 {
            let other = &mut rotations[usize::from(other)];
            *other = -*other;
        }
    }
    rotations
}

/// Harmonic fields of the quaternions' components: `L q = 0`, `q` given at the markers.
#[must_use]
pub fn rotations(surface: &Surface, targets: &[MarkerTarget]) -> Vec<DQuat> {
    let given = consistent_signs(targets, &surface.marker_edges);
    let mut field = vec![[0.0; 4]; surface.positions.len()];
    for (&vertex, rotation) in surface.markers.iter().zip(&given) {
        for (neighbour, weight) in surface.laplacian.row(vertex as usize) {
            for (sum, x) in field[neighbour].iter_mut().zip(rotation.to_array()) {
                *sum += Laplacian::conducts(weight) * x;
            }
        }
    }
    for (&vertex, rotation) in surface.markers.iter().zip(&given) {
        field[vertex as usize] = rotation.to_array();
    }
    surface.harmonic.solve_vectors(&mut field);
    field
        .into_iter()
        .map(|q| DQuat::from_array(q).normalize())
        .collect()
}

/// Where the mean place of its markers and its own rotation put each vertex, metres.
#[must_use]
pub fn guess(surface: &Surface, targets: &[MarkerTarget], rotations: &[DQuat]) -> Vec<DVec3> {
    let rest = surface.marker_rest();
    let places = surface.positions.iter().zip(rotations);
    let mut guesses = Vec::with_capacity(rotations.len());
    for ((position, rotation), (markers, weights)) in places.zip(&surface.guides) {
        let (mut from, mut to) = (DVec3::ZERO, DVec3::ZERO);
        for (&marker, &weight) in markers.iter().zip(weights) {
            from += weight * rest[usize::from(marker)];
            to += weight * targets[usize::from(marker)].position;
        }
        guesses.push(to + *rotation * (*position - from));
    }
    guesses
}

/// Equation 2 with mass weights and a pull `C` toward the [`guess`] `g`:
/// `(L' M^-1 L + A + C) v = L' M^-1 (q d q*) + A p + C g`. `[vertices]`, metres.
#[must_use]
pub fn positions(surface: &Surface, targets: &[MarkerTarget]) -> Vec<DVec3> {
    let laplacian = &surface.laplacian;
    let rotations = rotations(surface, targets);
    let guess = guess(surface, targets, &rotations);
    let turned: Vec<DVec3> = laplacian
        .apply(&surface.positions)
        .into_iter()
        .zip(rotations)
        .zip(&laplacian.mass)
        .map(|((differential, rotation), mass)| rotation * differential / *mass)
        .collect();
    let mut right: Vec<[f64; 3]> = laplacian
        .apply(&turned)
        .iter()
        .map(DVec3::to_array)
        .collect();
    for (&vertex, target) in surface.markers.iter().zip(targets) {
        for (sum, p) in right[vertex as usize]
            .iter_mut()
            .zip(target.position.to_array())
        {
            *sum += surface.stiffness * p;
        }
    }
    for ((sums, guess), pull) in right.iter_mut().zip(guess).zip(&surface.pull) {
        for (sum, p) in sums.iter_mut().zip(guess.to_array()) {
            *sum += pull * p;
        }
    }
    surface.bilaplacian.solve_vectors(&mut right);
    right.into_iter().map(DVec3::from_array).collect()
}
