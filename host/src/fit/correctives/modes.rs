//! Few modes a part instead of a sum for each marker, spread over the surface as morph targets.
//!
//! The sums of a part's markers over all frames have few principal directions (reduced-rank
//! regression, Izenman 1975). Each becomes a morph target: biharmonic between the markers, nothing
//! at those of other parts.

use glam::DVec3;
use sinew_core::asset::LANES;

use super::CorrectiveData;
use super::regress::Learnt;
use crate::bake::blocks;
use crate::clean::linear::symmetric_eigen;
use crate::fit::parts::spread::Skin;
use crate::fit::parts::{Glued, PartsFitError};
use crate::model::{Avatar, Mesh, Morph};

/// A way in which the markers of a part move together.
#[derive(Clone, Debug)]
pub struct MarkerMode {
    /// (marker, metres at weight one).
    pub offsets: Vec<(usize, DVec3)>,
    /// (feature, what it adds to the weight).
    pub terms: Vec<(usize, f64)>,
    /// Least and largest weight over all frames.
    pub range: [f64; 2],
}

/// Modes that move a part's markers by less than this are left out, metres, rms.
const LEAST: f64 = 0.15e-3;
/// Most modes of a part.
const MOST: usize = 6;
/// Terms that change a weight by less than this share of it are left out.
const LEAST_TERM: f64 = 2e-3;
/// Weights may leave the range that was seen by this share of it.
const BEYOND: f64 = 0.15;
/// Offsets fade out below this, metres; further where that leaves too many rows.
const FADE: f64 = 0.05e-3;
/// Most modes that move a block, on average over all blocks: what bounds the cost of a frame.
const ROWS: f64 = 0.9;
/// A part with fewer markers says more about its frame than about its flesh.
const FEWEST: usize = 4;
/// Angles tried when two modes are turned into each other, and rounds over all pairs.
const ANGLES: usize = 32;
const ROUNDS: usize = 6;

/// Principal modes of every part. O(parts (frames columns^2 + markers^3))
#[must_use]
pub fn reduce(data: &CorrectiveData, parts: &[usize], learnt: &Learnt) -> Vec<MarkerMode> {
    let mut out = Vec::new();
    for (part, columns) in learnt.columns.iter().enumerate().take(data.parents.len()) {
        let own =
            |&marker: &usize| parts[marker] == part && !learnt.coefficients[marker].is_empty();
        let markers: Vec<usize> = (0..parts.len()).filter(own).collect();
        if markers.len() < FEWEST {
            continue;
        }
        let n = columns.len();
        let gram = gram(&learnt.features, columns);
        // `C' G C`: how the predicted residuals of all markers vary together.
        let width = 3 * markers.len();
        let coefficient = |column: usize, at: usize| {
            let of = learnt.coefficients[markers[at / 3]][column];
            of[at % 3]
        };
        let mut moved = vec![0.0; n * width];
        for row in 0..n {
            for column in 0..n {
                let shared = gram[row * n + column];
                let to = moved[row * width..][..width].iter_mut().enumerate();
                for (at, to) in to {
                    *to += shared * coefficient(column, at);
                }
            }
        }
        let mut covariance = vec![0.0; width * width];
        for column in 0..n {
            let row = &moved[column * width..][..width];
            for at in 0..width {
                let a = coefficient(column, at);
                for (to, b) in covariance[at * width..][..width].iter_mut().zip(row) {
                    *to += a * b;
                }
            }
        }
        let (values, vectors) = symmetric_eigen(width, covariance);
        // Directions as long as they are used, and the sums that use them.
        let mut found: Vec<(Vec<DVec3>, Vec<f64>)> = values
            .iter()
            .zip(vectors.chunks_exact(width))
            .take(MOST)
            .filter(|(value, _)| (**value / markers.len() as f64).max(0.0).sqrt() >= LEAST)
            .map(|(value, direction)| {
                let deviation = value.sqrt();
                let weight = |column: usize| -> f64 {
                    let all = direction.iter().enumerate();
                    let sum: f64 = all.map(|(at, d)| d * coefficient(column, at)).sum();
                    sum / deviation
                };
                let offsets = direction.chunks_exact(3);
                let offsets = offsets.map(|d| deviation * DVec3::from_slice(d));
                (offsets.collect(), (0..n).map(weight).collect())
            })
            .collect();
        localise(&mut found);
        for (offsets, weights) in found {
            // Weights of deviation one.
            let matters = |&(at, weight): &(usize, &f64)| {
                weight.abs() * gram[at * n + at].sqrt() > LEAST_TERM
            };
            let terms = weights.iter().enumerate().filter(matters);
            let terms: Vec<(usize, f64)> = terms.map(|(at, &w)| (columns[at], w)).collect();
            let seen = learnt.features.iter().map(|features| {
                let of = |&(feature, w): &(usize, f64)| w * f64::from(features[feature]);
                terms.iter().map(of).sum::<f64>()
            });
            let (low, high) = seen.fold((0.0_f64, 0.0_f64), |(low, high), weight| {
                (low.min(weight), high.max(weight))
            });
            // The largest weight is one, so that offsets are metres.
            let largest = high.max(-low).max(1e-9);
            let beyond = BEYOND * (high - low);
            out.push(MarkerMode {
                offsets: markers
                    .iter()
                    .zip(offsets)
                    .map(|(&marker, offset)| (marker, largest * offset))
                    .collect(),
                terms: terms.into_iter().map(|(f, w)| (f, w / largest)).collect(),
                range: [low - beyond, high + beyond].map(|weight| weight / largest),
            });
        }
    }
    out
}

/// Turns modes into each other so that each moves few markers, and those much (varimax, Kaiser
/// 1958): the surface that each one moves is smaller then.
fn localise(modes: &mut [(Vec<DVec3>, Vec<f64>)]) {
    let turned = |a: &[DVec3], b: &[DVec3], angle: f64| -> f64 {
        let (sine, cosine) = angle.sin_cos();
        let fourth = |p: DVec3| p.length_squared().powi(2);
        let pairs = a.iter().zip(b);
        pairs
            .map(|(&a, &b)| fourth(cosine * a + sine * b) + fourth(cosine * b - sine * a))
            .sum()
    };
    for _ in 0..ROUNDS {
        for second in 1..modes.len() {
            let (before, after) = modes.split_at_mut(second);
            let (b, b_weights) = &mut after[0];
            for (a, a_weights) in before {
                let angle = |at: usize| std::f64::consts::FRAC_PI_2 * at as f64 / ANGLES as f64;
                let best = (0..ANGLES).map(|at| (turned(a, b, angle(at)), at));
                let best = best.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
                let (sine, cosine) = angle(best.map_or(0, |best| best.1)).sin_cos();
                for (a, b) in a.iter_mut().zip(b.iter_mut()) {
                    (*a, *b) = (cosine * *a + sine * *b, cosine * *b - sine * *a);
                }
                for (a, b) in a_weights.iter_mut().zip(b_weights.iter_mut()) {
                    (*a, *b) = (cosine * *a + sine * *b, cosine * *b - sine * *a);
                }
            }
        }
    }
}

/// `[n x n]`: mean products of features.
fn gram(features: &[Vec<f32>], columns: &[usize]) -> Vec<f64> {
    let n = columns.len();
    let mut gram = vec![0.0; n * n];
    let share = 1.0 / features.len().max(1) as f64;
    for frame in features {
        let x: Vec<f64> = columns.iter().map(|&at| f64::from(frame[at])).collect();
        for (row, a) in x.iter().enumerate() {
            for (to, b) in gram[row * n..][..n].iter_mut().zip(&x) {
                *to += share * a * b;
            }
        }
    }
    gram
}

/// Morph targets from modes, whose terms and ranges go into `data`.
/// O(markers vertices^1.5 + modes markers vertices)
///
/// # Errors
/// A surface that cannot be factored.
pub fn spread(
    body: &Avatar,
    markers: &[Glued],
    data: &mut CorrectiveData,
    modes: Vec<MarkerMode>,
) -> Result<Vec<Morph>, PartsFitError> {
    let mesh = &body.mesh;
    let skin = Skin::new(&mesh.positions, &mesh.normals, &mesh.triangles, markers);
    let spread = skin.local(skin.biharmonic(markers)?, markers);
    let field = |mode: &MarkerMode| {
        let mut positions = vec![DVec3::ZERO; mesh.positions.len()];
        for &(marker, offset) in &mode.offsets {
            for (to, weight) in positions.iter_mut().zip(&spread[marker]) {
                *to += *weight * offset;
            }
        }
        positions
    };
    let mut fields: Vec<Vec<DVec3>> = modes.iter().map(field).collect();
    let fade = fade(&blocks::arrange(&body.skin).order, &fields);
    let mut out = Vec::with_capacity(modes.len());
    for (number, (mode, positions)) in modes.into_iter().zip(&mut fields).enumerate() {
        for offset in positions.iter_mut() {
            *offset *= ((offset.length() - fade) / fade).clamp(0.0, 1.0);
        }
        out.push(Morph {
            name: format!("corrective {number}"),
            normals: normals(mesh, &skin, positions),
            positions: std::mem::take(positions),
            rest_weight: 0.0,
        });
        for (feature, weight) in mode.terms {
            data.features.push(feature as u16);
            data.coefficients.push(weight as f32);
        }
        data.starts.push(data.features.len() as u32);
        data.ranges.push(mode.range.map(|weight| weight as f32));
    }
    Ok(out)
}

/// The length below which offsets are left out, so that rows of blocks stay within their bound.
fn fade(order: &[u32], fields: &[Vec<DVec3>]) -> f64 {
    let mut largest: Vec<f64> = Vec::new();
    for block in order.chunks(LANES) {
        for field in fields {
            let offsets = block.iter().map(|&vertex| field[vertex as usize].length());
            largest.push(offsets.fold(0.0, f64::max));
        }
    }
    largest.sort_by(|a, b| b.total_cmp(a));
    let most = (ROWS * order.len().div_ceil(LANES) as f64) as usize;
    largest.get(most).copied().unwrap_or(0.0).max(FADE)
}

/// How unit normals change with offsets, to first order; nothing where nothing moves.
fn normals(mesh: &Mesh, skin: &Skin, offsets: &[DVec3]) -> Vec<DVec3> {
    let change = |(vertex, normal): (usize, &DVec3)| {
        if offsets[vertex] == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let [along, across] = sinew_core::deform::parts::tangents_of(normal.as_vec3().to_array())
            .map(|t| DVec3::from_array(t.map(f64::from)));
        let slopes = [0, 1, 2].map(|axis| skin.derivative(vertex, |at| offsets[at][axis]));
        let [du, dv] = [0, 1].map(|side| DVec3::from_array(slopes.map(|slope| slope[side])));
        let change = du.cross(across) + along.cross(dv);
        change - normal.dot(change) * *normal
    };
    mesh.normals.iter().enumerate().map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixed_modes_come_apart_and_their_sums_with_them() {
        let [x, y] = [DVec3::X, 2.0 * DVec3::Y];
        let (sine, cosine) = 0.6_f64.sin_cos();
        // One moves the first marker, the other the second; both were turned by 0.6.
        let mut modes = vec![
            (vec![cosine * x, sine * y], vec![cosine, sine]),
            (vec![-sine * x, cosine * y], vec![-sine, cosine]),
        ];
        localise(&mut modes);
        for (offsets, weights) in &modes {
            let moved: Vec<f64> = offsets.iter().map(|p| p.length()).collect();
            assert!(moved[0].min(moved[1]) < 0.06, "{moved:?}");
            assert!(weights[0].abs().min(weights[1].abs()) < 0.06, "{weights:?}");
        }
        // What they do together has not changed.
        let sum: DVec3 = modes.iter().map(|(o, w)| w[1] * o[1]).sum();
        assert!(sum.distance(y) < 1e-12, "{sum}");
    }

    #[test]
    fn rows_stay_within_their_bound() {
        let order: Vec<u32> = (0..80).collect();
        let field = |k: usize| {
            let of = |v: usize| DVec3::X * 1e-3 * ((v + 7 * k) % 80) as f64 / 80.0;
            (0..80).map(of).collect::<Vec<_>>()
        };
        let fields: Vec<Vec<DVec3>> = (0..6).map(field).collect();
        let fade = fade(&order, &fields);
        let moves = |block: &[u32], field: &[DVec3]| {
            block.iter().any(|&v| field[v as usize].length() > fade)
        };
        let rows: usize = order
            .chunks(LANES)
            .map(|block| fields.iter().filter(|field| moves(block, field)).count())
            .sum();
        let most = (10.0 * ROWS) as usize;
        assert!(rows <= most && rows + 2 >= most, "{rows}");
    }
}
