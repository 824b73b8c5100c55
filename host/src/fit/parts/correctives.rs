//! Learns what flesh does from how a skeleton moves: correctives without markers.
//!
//! In: frames of parts and residuals of markers over consecutive frames of a dense capture. Out:
//! for each marker a linear sum of a few features of its own part and of those that join it. The
//! springs and the ridge of each part are those that predict seconds held out best.

use glam::{DAffine3, DVec3};
use sinew_core::asset::NO_PARENT;
use sinew_core::deform::parts::{
    Corrective, CorrectiveState, CorrectiveTables, PART_FEATURES, PartsError,
};

use super::Segments;
use crate::clean::linear::Cholesky;

/// Frequencies tried, hertz, and damping ratios.
const FREQUENCIES: [[f64; 2]; 6] = [
    [2.0, 4.0],
    [3.0, 6.0],
    [4.0, 8.0],
    [5.0, 7.5],
    [6.0, 9.0],
    [7.5, 11.0],
];
const DAMPINGS: [f64; 2] = [0.2, 0.4];
/// Pulls of coefficients toward zero tried, as parts of each feature's own square.
const RIDGES: [f64; 3] = [3e-2, 3e-3, 3e-4];
/// Features of a bend, at the front of a part's features.
const BEND: usize = 4;
/// Frames after the start that only wind the springs up.
const WARM_UP: usize = 3;

/// Owned [`CorrectiveTables`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in CorrectiveTables")]
pub struct CorrectiveData {
    pub parents: Vec<u16>,
    pub pivots: Vec<[f32; 3]>,
    pub springs: Vec<[[f32; 2]; 2]>,
    pub starts: Vec<u32>,
    pub features: Vec<u16>,
    pub coefficients: Vec<[f32; 3]>,
    pub limit: f32,
}

impl CorrectiveData {
    /// The core's view, checked.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn view(&self) -> Result<Corrective<'_>, PartsError> {
        Corrective::new_checked(CorrectiveTables {
            parents: &self.parents,
            pivots: &self.pivots,
            springs: &self.springs,
            starts: &self.starts,
            features: &self.features,
            coefficients: &self.coefficients,
            limit: self.limit,
        })
    }
}

/// A stretch of consecutive frames.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][parts]`: rigid, from the rest pose.
    pub frames: Vec<Vec<DAffine3>>,
    /// `[frames][markers]`: residuals in the rest pose, metres.
    pub residuals: Vec<Vec<DVec3>>,
}

/// Learns a predictor. `memberships`: `[markers]` of (part, weight), heaviest first; `rest`:
/// `[markers]`, metres. O(springs (frames markers features + parts features^3))
///
/// # Errors
/// Tables that the core refuses.
pub fn learn(
    segments: &Segments,
    memberships: &[Vec<(u32, f64)>],
    rest: &[DVec3],
    stretches: &[Stretch],
) -> Result<CorrectiveData, PartsError> {
    let parts = segments.part_count();
    let longest = stretches
        .iter()
        .flat_map(|stretch| stretch.residuals.iter().flatten())
        .map(|r| r.length())
        .fold(0.0, f64::max);
    let main: Vec<usize> = memberships.iter().map(|row| row[0].0 as usize).collect();
    let pivot = |part: usize| {
        let own = rest.iter().zip(&main).filter(|(_, at)| **at == part);
        let own: Vec<DVec3> = own.map(|(&p, _)| p).collect();
        let middle = own.iter().sum::<DVec3>() / own.len().max(1) as f64;
        middle.as_vec3().to_array()
    };
    let empty = CorrectiveData {
        parents: segments
            .parents
            .iter()
            .map(|parent| parent.map_or(NO_PARENT, |parent| parent as u16))
            .collect(),
        pivots: (0..parts).map(pivot).collect(),
        springs: vec![[[20.0, 0.3]; 2]; parts],
        starts: vec![0],
        limit: (1.2 * longest) as f32,
        ..CorrectiveData::default()
    };
    let features_of = |data: &CorrectiveData| {
        let of = |stretch| features(data, stretch);
        stretches.iter().map(of).collect::<Result<Vec<_>, _>>()
    };
    let mut chosen = vec![(f64::INFINITY, [[1.0; 2]; 2], RIDGES[0]); parts];
    for frequency in FREQUENCIES {
        for damping in DAMPINGS {
            let springs = frequency.map(|f| [(std::f64::consts::TAU * f) as f32, damping as f32]);
            let mut data = empty.clone();
            data.springs = vec![springs; parts];
            let features = features_of(&data)?;
            for ridge in RIDGES {
                // Every third second is held out to choose, then learnt from too.
                let errors = fit(&mut data, &main, stretches, &features, &|_| ridge, true);
                for (error, chosen) in errors.into_iter().zip(&mut chosen) {
                    if error < chosen.0 {
                        *chosen = (error, springs, ridge);
                    }
                }
            }
        }
    }
    let mut data = empty;
    data.springs = chosen.iter().map(|chosen| chosen.1).collect();
    let features = features_of(&data)?;
    let ridge = |part: usize| chosen[part].2;
    fit(&mut data, &main, stretches, &features, &ridge, false);
    Ok(data)
}

/// `[frames][features]` as the core finds them.
fn features(data: &CorrectiveData, stretch: &Stretch) -> Result<Vec<Vec<f32>>, PartsError> {
    let corrective = data.view()?;
    let mut state = CorrectiveState::with(vec![0.0; corrective.state_len()]);
    let seconds = (1.0 / stretch.rate) as f32;
    let one = |frames: &Vec<DAffine3>| {
        let frames: Vec<[f32; 12]> = frames.iter().map(rows).collect();
        let mut out = vec![0.0; corrective.feature_count()];
        let done = corrective.features(&frames, seconds, &mut state, &mut out);
        done.expect("the memory has the right size");
        out
    };
    Ok(stretch.frames.iter().map(one).collect())
}

/// Rows of a 3 x 4 matrix.
#[must_use]
pub fn rows(matrix: &DAffine3) -> [f32; 12] {
    crate::bake::write::rows(matrix).map(|x| x as f32)
}

/// Least squares of all markers; appends their terms, or, with `held_out`, only returns the squared
/// error of each part on the frames left out.
fn fit(
    data: &mut CorrectiveData,
    main: &[usize],
    stretches: &[Stretch],
    features: &[Vec<Vec<f32>>],
    ridge: &dyn Fn(usize) -> f64,
    held_out: bool,
) -> Vec<f64> {
    let parts = data.parents.len();
    let used: Vec<Vec<usize>> = (0..parts).map(|part| used(&data.parents, part)).collect();
    let mut solved: Vec<Vec<[f64; 3]>> = vec![Vec::new(); main.len()];
    let mut errors = vec![0.0; parts];
    for (part, columns) in used.iter().enumerate() {
        let markers: Vec<usize> = (0..main.len()).filter(|&at| main[at] == part).collect();
        if markers.is_empty() {
            continue;
        }
        let n = columns.len();
        let width = 3 * markers.len();
        let mut gram = vec![0.0; n * n];
        let mut right = vec![0.0; n * width];
        let mut frames = 0.0;
        let all = || {
            stretches
                .iter()
                .zip(features)
                .flat_map(|(stretch, features)| {
                    let second = stretch.rate.round().max(1.0) as usize;
                    let frames = features.iter().zip(&stretch.residuals).enumerate();
                    frames
                        .skip(WARM_UP)
                        .map(move |(at, (x, y))| (at / second % 3 == 1, x, y))
                })
        };
        for (_, x, y) in all().filter(|row| !(held_out && row.0)) {
            let x: Vec<f64> = columns.iter().map(|&at| f64::from(x[at])).collect();
            for (row, a) in x.iter().enumerate() {
                for (sum, b) in gram[row * n..][..n].iter_mut().zip(&x) {
                    *sum += a * b;
                }
                let to = right[row * width..][..width].chunks_exact_mut(3);
                for (to, &marker) in to.zip(&markers) {
                    for (to, value) in to.iter_mut().zip(y[marker].to_array()) {
                        *to += a * value;
                    }
                }
            }
            frames += 1.0;
        }
        // Features differ in size: each is pulled by its own mean square.
        for at in 0..n {
            let own = gram[at * n + at];
            gram[at * n + at] += ridge(part) * own + 1e-9 * frames + 1e-12;
        }
        let Some(factor) = Cholesky::new(n, gram) else {
            continue;
        };
        factor.solve(&mut right, width);
        for (slot, &marker) in markers.iter().enumerate() {
            let term = |row: usize| {
                let at = row * width + 3 * slot;
                [right[at], right[at + 1], right[at + 2]]
            };
            solved[marker] = (0..n).map(term).collect();
        }
        for (_, x, y) in all().filter(|row| held_out && row.0) {
            for &marker in &markers {
                let sum: DVec3 = columns
                    .iter()
                    .zip(&solved[marker])
                    .map(|(&at, c)| f64::from(x[at]) * DVec3::from_array(*c))
                    .sum();
                errors[part] += sum.distance_squared(y[marker]);
            }
        }
    }
    if !held_out {
        for (marker, terms) in solved.iter().enumerate() {
            for (&feature, term) in used[main[marker]].iter().zip(terms) {
                data.features.push(feature as u16);
                data.coefficients.push(term.map(|x| x as f32));
            }
            data.starts.push(data.features.len() as u32);
        }
    }
    errors
}

/// Features that may move the markers of a part: all its own, bends of the parts that hang on it,
/// the constant.
fn used(parents: &[u16], part: usize) -> Vec<usize> {
    let mut out: Vec<usize> = (part * PART_FEATURES..(part + 1) * PART_FEATURES).collect();
    for (child, &parent) in parents.iter().enumerate() {
        if usize::from(parent) == part && parent != NO_PARENT {
            out.extend(child * PART_FEATURES..child * PART_FEATURES + BEND);
        }
    }
    out.push(parents.len() * PART_FEATURES);
    out
}
