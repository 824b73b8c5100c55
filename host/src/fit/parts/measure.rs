//! How good each mode is on what it has not seen: frames held out, at markers held out.
//!
//! Where no true surface is known, markers are the only truth. So a tenth of them is left out,
//! every mode is learnt from the others in part of the frames, and the skin at the places of those
//! left out is compared with where they really were in the other frames.

use glam::DVec3;

use super::{Glued, Learnt, Mode, Options, PartsFitError, Segments, learn, marker_frame};
use crate::model::Mesh;

/// One marker in so many is left out.
const EVERY: usize = 10;
/// The frames fall into so many stretches; every third is held out.
const STRETCHES: usize = 15;
/// Most frames compared.
const MOST_FRAMES: usize = 150;
/// A cheaper mode is recommended where it is this much worse at most, metres.
const AS_GOOD: f64 = 0.05e-3;

/// Errors of one mode at markers that it has not seen, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Which.
    pub mode: Mode,
    /// Mean distance.
    pub mean: f64,
    /// What 95 of 100 stay below.
    pub percentile_95: f64,
    /// Largest.
    pub max: f64,
    /// Multiplications of a frame; an upper bound.
    pub multiply_adds: usize,
}

/// All modes, cheapest first.
pub const MODES: [Mode; 3] = [Mode::Collapsed, Mode::Hybrid, Mode::Exact];

/// Learns every mode from part of the markers and frames and measures it on the rest.
/// Cost as [`learn`].
///
/// # Errors
/// As [`learn`].
pub fn measure(
    mesh: &Mesh,
    segments: &Segments,
    (markers, rest): (&[Glued], &[DVec3]),
    frames: &[Vec<DVec3>],
    options: &Options,
) -> Result<Vec<Score>, PartsFitError> {
    let out: Vec<usize> = (EVERY / 2..markers.len()).step_by(EVERY).collect();
    let kept: Vec<usize> = (0..markers.len()).filter(|at| !out.contains(at)).collect();
    let pick = |frame: &[DVec3]| kept.iter().map(|&at| frame[at]).collect::<Vec<_>>();
    let stretch = |frame: usize| frame * STRETCHES / frames.len().max(1);
    let held_out = |frame: &usize| stretch(*frame) % 3 == 1;
    let numbers: Vec<usize> = (0..frames.len()).collect();
    let train: Vec<Vec<DVec3>> = numbers
        .iter()
        .filter(|frame| !held_out(frame))
        .map(|&frame| pick(&frames[frame]))
        .collect();
    let test: Vec<usize> = numbers.into_iter().filter(held_out).collect();
    let step = test.len().div_ceil(MOST_FRAMES).max(1);
    let glued: Vec<Glued> = kept.iter().map(|&at| markers[at]).collect();
    let learnt = learn(mesh, segments, (&glued, &pick(rest)), &train, options)?;
    let mut scores = Vec::new();
    for mode in MODES {
        let mut player = learnt.player(mode)?;
        let mut errors = Vec::new();
        for &frame in test.iter().step_by(step) {
            player.step(&marker_frame(&pick(&frames[frame])));
            for &marker in &out {
                let corners = markers[marker].vertices.map(|v| v as usize);
                let at = |of: &[[f32; 3]]| -> DVec3 {
                    let corners = corners.iter().zip(markers[marker].weights);
                    corners
                        .map(|(&v, weight)| weight * DVec3::from_array(of[v].map(f64::from)))
                        .sum()
                };
                // A marker stands off the skin by its radius, along the normal.
                let off = rest[marker] - markers[marker].on(&mesh.positions);
                let height = off.dot(markers[marker].on(&mesh.normals).normalize_or_zero());
                let skin = at(player.positions()) + height * at(player.normals());
                errors.push(skin.distance(frames[frame][marker]));
            }
        }
        scores.push(score(mode, errors, player.multiply_adds()));
    }
    Ok(scores)
}

fn score(mode: Mode, mut errors: Vec<f64>, multiply_adds: usize) -> Score {
    errors.sort_by(f64::total_cmp);
    let last = errors.len().saturating_sub(1);
    let at = |place: usize| errors.get(place).copied().unwrap_or(0.0);
    Score {
        mode,
        mean: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
        percentile_95: at(last * 95 / 100),
        max: at(last),
        multiply_adds,
    }
}

/// The cheapest mode that is as good as the best.
#[must_use]
pub fn recommended(scores: &[Score]) -> Option<Mode> {
    let best = scores.iter().map(|s| s.mean).fold(f64::INFINITY, f64::min);
    let good = scores.iter().filter(|s| s.mean <= best + AS_GOOD);
    good.min_by_key(|s| s.multiply_adds).map(|s| s.mode)
}

/// The tables of a learnt mode, by value.
#[must_use]
pub fn into_mode(learnt: Learnt, mode: Mode) -> (super::RigTables, super::ModeData) {
    let data = match mode {
        Mode::Exact => learnt.exact,
        Mode::Collapsed => learnt.collapsed,
        Mode::Hybrid => learnt.hybrid,
    };
    (learnt.rig, data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_of_equals_is_recommended() {
        let score = |mode, mean: f64, multiply_adds| Score {
            mode,
            mean,
            percentile_95: 0.0,
            max: 0.0,
            multiply_adds,
        };
        let mut scores = vec![
            score(Mode::Collapsed, 1.02e-3, 10),
            score(Mode::Hybrid, 1.0e-3, 20),
            score(Mode::Exact, 2.0e-3, 90),
        ];
        assert_eq!(recommended(&scores), Some(Mode::Collapsed));
        scores[0].mean = 1.2e-3;
        assert_eq!(recommended(&scores), Some(Mode::Hybrid));
        assert_eq!(recommended(&[]), None);
    }
}
