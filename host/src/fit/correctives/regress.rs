//! Residuals of markers as linear sums of what the core sees of a skeleton in motion.
//!
//! Ridge regression, part by part. A coefficient is held near zero by how large one is expected to
//! be, and noise is taken to be alike for half a second (breath, which no skeleton shows, is most of
//! it). How strongly, and which springs a part has, is what predicts stretches held out best.

use glam::DVec3;
use sinew_core::deform::parts::{
    BEND_FEATURES, CorrectiveState, PART_FEATURES, PartsError, corrective_feature_count,
    corrective_state_len,
};

use super::CorrectiveData;
use crate::clean::linear::Cholesky;

/// Consecutive frames.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][binds]`: from the rest pose.
    pub palettes: Vec<Vec<[f32; 12]>>,
    /// `[frames][markers]`: in the rest pose, metres.
    pub residuals: Vec<Vec<DVec3>>,
}

/// What was learnt.
#[derive(Clone, Debug, Default)]
pub struct Learnt {
    /// `[parts]`: features that move its markers.
    pub columns: Vec<Vec<usize>>,
    /// `[markers][columns of its part]`: what each adds to the residual, metres.
    pub coefficients: Vec<Vec<DVec3>>,
    /// `[frames][features]` of all stretches.
    pub features: Vec<Vec<f32>>,
    /// Root mean square of residuals, and of what is left of them, in stretches held out; metres.
    pub held_out: [f64; 2],
}

/// Frequencies tried, hertz, and damping ratios.
const FREQUENCIES: [f64; 9] = [2.0, 2.7, 3.4, 4.0, 4.7, 5.5, 6.5, 8.0, 10.0];
const DAMPINGS: [f64; 3] = [0.12, 0.2, 0.35];
/// Strengths of the pull toward zero tried.
const PULLS: [f64; 7] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];
/// Each stretch is cut into so many pieces; one of them is held out in turn.
const FOLDS: usize = 5;
/// Standard deviation of what cannot be predicted, metres, and how long it stays alike, seconds.
const NOISE: f64 = 2e-3;
const ALIKE: f64 = 0.5;
/// Expected size of a coefficient: of a bend, of gravity, of a spring, of the constant; metres.
const EXPECTED: [f64; 4] = [0.015, 0.010, 0.8, 0.01];
/// Of another part's.
const FARTHER: f64 = 0.5;
/// Frames after the start whose velocities are not known yet.
const WARM_UP: usize = 3;

/// Learns; sets the springs of `data`. `parts`: `[markers]`, the part of each.
/// O(springs parts frames + parts frames features^2)
///
/// # Errors
/// Tables that the core refuses.
pub fn learn(
    data: &mut CorrectiveData,
    binds: usize,
    parts: &[usize],
    stretches: &[Stretch],
) -> Result<Learnt, PartsError> {
    let count = data.parents.len();
    let markers_of =
        |part: usize| -> Vec<usize> { (0..parts.len()).filter(|&at| parts[at] == part).collect() };
    let own: Vec<Vec<usize>> = (0..count).map(markers_of).collect();
    choose_springs(data, binds, &own, stretches)?;
    let features = features(data, binds, stretches)?;
    let columns: Vec<Vec<usize>> = (0..count).map(|part| used(&data.parents, part)).collect();
    let mut learnt = Learnt {
        coefficients: vec![Vec::new(); parts.len()],
        ..Learnt::default()
    };
    let (mut before, mut left, mut samples) = (0.0, 0.0, 0.0);
    for (part, markers) in own.iter().enumerate().filter(|own| !own.1.is_empty()) {
        let columns = &columns[part];
        let sums = Sums::of_folds(columns, markers, stretches, &features);
        let expected: Vec<f64> = columns
            .iter()
            .map(|&column| expected(column, part, count))
            .collect();
        let error = |pull: f64| -> f64 { held_out(&sums, &expected, pull) };
        let tried = PULLS.map(|pull| (error(pull), pull));
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let (error, pull) = best.unwrap_or((0.0, 1.0));
        let whole = sums
            .iter()
            .skip(1)
            .fold(sums[0].clone(), |sum, fold| sum.plus(fold, 1.0));
        before += whole.squares;
        left += error;
        samples += whole.frames * markers.len() as f64;
        let Some(solved) = whole.solve(&expected, pull) else {
            continue;
        };
        let width = 3 * markers.len();
        for (slot, &marker) in markers.iter().enumerate() {
            let of = |column: usize| DVec3::from_slice(&solved[column * width + 3 * slot..]);
            learnt.coefficients[marker] = (0..columns.len()).map(of).collect();
        }
    }
    learnt.held_out = [before, left].map(|sum| f64::sqrt(sum / f64::max(samples, 1.0)));
    learnt.columns = columns;
    learnt.features = features.concat();
    Ok(learnt)
}

/// `[stretches][frames][features]` as the core finds them.
fn features(
    data: &CorrectiveData,
    binds: usize,
    stretches: &[Stretch],
) -> Result<Vec<Vec<Vec<f32>>>, PartsError> {
    let corrective = data.view(binds)?;
    let parts = corrective.part_count();
    let of = |stretch: &Stretch| {
        let mut state = CorrectiveState::with(vec![0.0; corrective_state_len(parts)]);
        let seconds = (1.0 / stretch.rate) as f32;
        let one = |palette: &Vec<[f32; 12]>| {
            let mut out = vec![0.0; corrective_feature_count(parts)];
            let done = corrective.features(palette, seconds, &mut state, &mut out);
            done.expect("the memory has the right size");
            out
        };
        stretch.palettes.iter().map(one).collect()
    };
    Ok(stretches.iter().map(of).collect())
}

/// The spring that explains a part's own markers best, then the one that adds most to it.
fn choose_springs(
    data: &mut CorrectiveData,
    binds: usize,
    own: &[Vec<usize>],
    stretches: &[Stretch],
) -> Result<(), PartsError> {
    let count = own.len();
    for spring in 0..2 {
        let mut best = vec![(f64::INFINITY, [20.0, 0.3]); count];
        let chosen = data.springs.clone();
        for frequency in FREQUENCIES {
            for damping in DAMPINGS {
                let tried = [(std::f64::consts::TAU * frequency) as f32, damping as f32];
                for (to, chosen) in data.springs.iter_mut().zip(&chosen) {
                    *to = *chosen;
                    to[spring] = tried;
                }
                let features = features(data, binds, stretches)?;
                for (part, markers) in own.iter().enumerate().filter(|own| !own.1.is_empty()) {
                    // The second spring is not looked at while the first is sought.
                    let last = PART_FEATURES - 3 * (1 - spring);
                    let mut columns: Vec<usize> =
                        (part * PART_FEATURES..part * PART_FEATURES + last).collect();
                    columns.push(count * PART_FEATURES);
                    let sums = Sums::of_folds(&columns, markers, stretches, &features);
                    let expected: Vec<f64> = columns
                        .iter()
                        .map(|&column| expected(column, part, count))
                        .collect();
                    let error = held_out(&sums, &expected, 1.0);
                    if error < best[part].0 {
                        best[part] = (error, tried);
                    }
                }
            }
        }
        for ((to, chosen), best) in data.springs.iter_mut().zip(chosen).zip(best) {
            *to = chosen;
            to[spring] = best.1;
        }
    }
    Ok(())
}

/// Features that may move the markers of a part: all its own, of its parent and of the parts that
/// hang on it, the bends of those one further, the constant.
fn used(parents: &[u16], part: usize) -> Vec<usize> {
    let parent = |part: usize| Some(usize::from(parents[part])).filter(|&p| p < parents.len());
    let mut out = Vec::new();
    for other in 0..parents.len() {
        let first = other * PART_FEATURES;
        let above = parent(other);
        if other == part || parent(part) == Some(other) || above == Some(part) {
            out.extend(first..first + PART_FEATURES);
        } else if above.and_then(parent) == Some(part) {
            out.extend(first..first + BEND_FEATURES);
        }
    }
    out.push(parents.len() * PART_FEATURES);
    out
}

/// How large a coefficient may be, metres.
fn expected(column: usize, part: usize, parts: usize) -> f64 {
    if column == parts * PART_FEATURES {
        return EXPECTED[3];
    }
    let kind = match column % PART_FEATURES {
        at if at < BEND_FEATURES => 0,
        at if at < BEND_FEATURES + 3 => 1,
        _ => 2,
    };
    let near = if column / PART_FEATURES == part {
        1.0
    } else {
        FARTHER
    };
    near * EXPECTED[kind]
}

/// Squared error on each fold of what the others teach, m^2.
fn held_out(folds: &[Sums], expected: &[f64], pull: f64) -> f64 {
    let whole = folds[1..]
        .iter()
        .fold(folds[0].clone(), |sum, fold| sum.plus(fold, 1.0));
    let of = |fold: &Sums| match whole.plus(fold, -1.0).solve(expected, pull) {
        Some(solved) => fold.error(&solved),
        None => fold.squares,
    };
    folds.iter().map(of).sum()
}

/// Normal equations of a part's markers over some frames.
#[derive(Clone)]
struct Sums {
    n: usize,
    width: usize,
    /// `[n x n]`
    gram: Vec<f64>,
    /// `[n x width]`
    right: Vec<f64>,
    /// Sum of squares of all residuals.
    squares: f64,
    frames: f64,
    /// Independent samples are so many times fewer than frames.
    alike: f64,
}

impl Sums {
    fn of_folds(
        columns: &[usize],
        markers: &[usize],
        stretches: &[Stretch],
        features: &[Vec<Vec<f32>>],
    ) -> Vec<Self> {
        let (n, width) = (columns.len(), 3 * markers.len());
        let empty = Self {
            n,
            width,
            gram: vec![0.0; n * n],
            right: vec![0.0; n * width],
            squares: 0.0,
            frames: 0.0,
            alike: 1.0,
        };
        let mut folds = vec![empty; FOLDS];
        let (mut x, mut y) = (vec![0.0; n], vec![0.0; width]);
        for (stretch, features) in stretches.iter().zip(features) {
            let count = features.len().max(1);
            for (at, (all, residuals)) in features.iter().zip(&stretch.residuals).enumerate() {
                if at < WARM_UP {
                    continue;
                }
                for (to, marker) in y.as_chunks_mut::<3>().0.iter_mut().zip(markers) {
                    *to = residuals[*marker].to_array();
                }
                if y.iter().any(|value| !value.is_finite()) {
                    continue;
                }
                for (to, &column) in x.iter_mut().zip(columns) {
                    *to = f64::from(all[column]);
                }
                let fold = &mut folds[at * FOLDS / count];
                fold.alike = (ALIKE * stretch.rate).max(1.0);
                fold.add(&x, &y);
            }
        }
        folds
    }

    fn add(&mut self, x: &[f64], y: &[f64]) {
        for (row, a) in x.iter().enumerate() {
            // The lower half is enough.
            for (sum, b) in self.gram[row * self.n..][..=row].iter_mut().zip(x) {
                *sum += a * b;
            }
            let to = &mut self.right[row * self.width..][..self.width];
            for (to, value) in to.iter_mut().zip(y) {
                *to += a * value;
            }
        }
        self.squares += y.iter().map(|value| value * value).sum::<f64>();
        self.frames += 1.0;
    }

    fn plus(&self, other: &Self, sign: f64) -> Self {
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + sign * b).collect();
        Self {
            gram: sum(&self.gram, &other.gram),
            right: sum(&self.right, &other.right),
            squares: self.squares + sign * other.squares,
            frames: self.frames + sign * other.frames,
            alike: self.alike.max(other.alike),
            ..*self
        }
    }

    /// Coefficients `[n x width]`.
    fn solve(&self, expected: &[f64], pull: f64) -> Option<Vec<f64>> {
        let mut matrix = self.gram.clone();
        for (at, expected) in expected.iter().enumerate() {
            matrix[at * self.n + at] += pull * self.alike * (NOISE / expected).powi(2);
        }
        let mut right = self.right.clone();
        Cholesky::new(self.n, matrix)?.solve(&mut right, self.width);
        Some(right)
    }

    /// Squared error of coefficients on these frames.
    fn error(&self, solved: &[f64]) -> f64 {
        let rows = |of: &[f64], row: usize| of[row * self.width..][..self.width].to_vec();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut error = self.squares;
        for row in 0..self.n {
            let mut moved = rows(&self.right, row);
            for value in &mut moved {
                *value *= -2.0;
            }
            for column in 0..self.n {
                let (low, high) = (row.min(column), row.max(column));
                let shared = self.gram[high * self.n + low];
                let other = &solved[column * self.width..][..self.width];
                for (to, value) in moved.iter_mut().zip(other) {
                    *to += shared * value;
                }
            }
            error += dot(&moved, &solved[row * self.width..][..self.width]);
        }
        error.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_core::asset::NO_PARENT;

    #[test]
    fn sums_find_what_made_them_and_count_what_is_left() {
        let empty = Sums {
            n: 2,
            width: 3,
            gram: vec![0.0; 4],
            right: vec![0.0; 6],
            squares: 0.0,
            frames: 0.0,
            alike: 1.0,
        };
        let mut folds = vec![empty; 2];
        for at in 0..40 {
            let x = [f64::from(at % 7) - 3.0, f64::from(at % 5) - 2.0];
            let off = if at % 2 == 0 { 0.25 } else { -0.25 };
            let y = [0.5 * x[0] - x[1], 0.0, 2.0 * x[1] + off];
            folds[at as usize / 20].add(&x, &y);
        }
        let whole = folds[0].plus(&folds[1], 1.0);
        let solved = whole.solve(&[1e3; 2], 1.0).expect("definite");
        for (found, expected) in solved.iter().zip([0.5, 0.0, 0.0, -1.0, 0.0, 2.0]) {
            assert!((found - expected).abs() < 0.03, "{solved:?}");
        }
        assert!((whole.error(&solved) / 40.0 - 0.0625).abs() < 2e-3);
        assert!((held_out(&folds, &[1e3; 2], 1.0) / 40.0 - 0.0625).abs() < 8e-3);
        assert!(held_out(&folds, &[1e-9; 2], 1.0) > 0.9 * whole.squares);
    }

    #[test]
    fn a_part_sees_itself_its_parent_and_two_generations_below() {
        let parents = [NO_PARENT, 0, 1, 2, 0];
        let parts = |part| {
            let mut seen: Vec<usize> = used(&parents, part)
                .into_iter()
                .map(|column| column / PART_FEATURES)
                .collect();
            seen.dedup();
            seen
        };
        assert_eq!(parts(0), [0, 1, 2, 4, 5]);
        assert_eq!(parts(2), [1, 2, 3, 5]);
        assert_eq!(
            used(&parents, 0).len(),
            3 * PART_FEATURES + BEND_FEATURES + 1
        );
    }
}
