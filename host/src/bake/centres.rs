//! Optimised centres of rotation (Le and Hodgins, *Real-time Skeletal Skinning with Optimized
//! Centers of Rotation*, 2016).
//!
//! A mesh with its skin enters; the point that each vertex rotates about leaves: the mean of the
//! surface, weighted by how similarly it hangs on the binds.

use std::collections::HashMap;
use std::num::NonZero;

use glam::DVec3;

use crate::model::{Mesh, Skin};

/// Width of the similarity kernel (section 4.2 of the paper).
const SIGMA: f64 = 0.1;

/// A triangle as two binds see it.
#[derive(Clone, Copy)]
struct Sample {
    /// Mean weight of either bind.
    weights: [f64; 2],
    /// Area, square metres, times both weights.
    mass: f64,
    /// Mean of the corners.
    middle: DVec3,
}

/// `[vertices]`, mesh space: `p_i = sum_t s(w_i, w_t) a_t v_t / sum_t s(w_i, w_t) a_t` over
/// triangles, weights and place of a triangle being the means of its corners (equations 1 and 4 of
/// the paper).
///
/// A vertex that hangs on one bind is its own centre: every centre is right for it. Triangles are
/// listed once for each pair of binds that both move them, so a vertex looks only at those with
/// which it has a pair in common. O(vertices x triangles of a pair)
#[must_use]
pub fn centres(mesh: &Mesh, skin: &Skin) -> Vec<DVec3> {
    let pairs = pairs(mesh, skin);
    let count = mesh.positions.len();
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let share = count.div_ceil(threads).max(1);
    let mut centres = mesh.positions.clone();
    std::thread::scope(|scope| {
        for (part, centres) in centres.chunks_mut(share).enumerate() {
            let influences = &skin.influences[part * share..][..centres.len()];
            let pairs = &pairs;
            scope.spawn(move || {
                for (centre, influences) in centres.iter_mut().zip(influences) {
                    *centre = of_vertex(influences, pairs).unwrap_or(*centre);
                }
            });
        }
    });
    centres
}

/// Triangles that both binds of a pair move; the lower bind first.
fn pairs(mesh: &Mesh, skin: &Skin) -> HashMap<(u32, u32), Vec<Sample>> {
    let mut pairs: HashMap<(u32, u32), Vec<Sample>> = HashMap::new();
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let area = (b - a).cross(c - a).length() / 2.0;
        let mut weights: Vec<(u32, f64)> = Vec::new();
        for &(bind, weight) in corners
            .iter()
            .flat_map(|&corner| &skin.influences[corner as usize])
        {
            match weights.iter_mut().find(|(other, _)| *other == bind) {
                Some((_, sum)) => *sum += weight / 3.0,
                None => weights.push((bind, weight / 3.0)),
            }
        }
        weights.sort_by_key(|&(bind, _)| bind);
        for (at, &(first, one)) in weights.iter().enumerate() {
            for &(second, two) in &weights[at + 1..] {
                pairs.entry((first, second)).or_default().push(Sample {
                    weights: [one, two],
                    mass: area * one * two,
                    middle: (a + b + c) / 3.0,
                });
            }
        }
    }
    pairs
}

/// `None` where nothing is similar.
fn of_vertex(influences: &[(u32, f64)], pairs: &HashMap<(u32, u32), Vec<Sample>>) -> Option<DVec3> {
    let mut sorted = influences.to_vec();
    sorted.sort_by_key(|&(bind, _)| bind);
    let (mut sum, mut mass) = (DVec3::ZERO, 0.0);
    for (at, &(first, one)) in sorted.iter().enumerate() {
        for &(second, two) in &sorted[at + 1..] {
            for sample in pairs.get(&(first, second)).into_iter().flatten() {
                let [other_one, other_two] = sample.weights;
                let difference = (one * other_two - two * other_one) / SIGMA;
                let similar = one * two * sample.mass * (-difference * difference).exp();
                sum += similar * sample.middle;
                mass += similar;
            }
        }
    }
    (mass > 0.0)
        .then(|| sum / mass)
        .filter(|centre| centre.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_between_two_binds_turns_about_the_middle_of_those_like_it() {
        // Two triangles of equal area that hang alike, and one that hangs on one bind.
        let mut positions = Vec::new();
        let mut influences = Vec::new();
        for (height, half) in [(0.0, true), (2.0, true), (9.0, false)] {
            for corner in [DVec3::X, DVec3::Y, DVec3::ZERO] {
                positions.push(corner + DVec3::Z * height);
                influences.push(if half {
                    vec![(0, 0.5), (1, 0.5)]
                } else {
                    vec![(1, 1.0)]
                });
            }
        }
        let mesh = Mesh {
            name: String::new(),
            normals: positions.clone(),
            positions,
            tangents: None,
            texcoords: None,
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            parts: Vec::new(),
            morphs: Vec::new(),
        };
        let skin = Skin {
            binds: Vec::new(),
            influences,
        };
        let centres = centres(&mesh, &skin);
        let middle = DVec3::new(1.0 / 3.0, 1.0 / 3.0, 1.0);
        for centre in &centres[..6] {
            assert!(centre.distance(middle) < 1e-12, "{centre}");
        }
        assert_eq!(centres[6], mesh.positions[6]);
    }
}
