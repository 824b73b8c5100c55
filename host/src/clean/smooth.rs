//! Noise filtered out of each trajectory in the local frame of its neighbours.
//!
//! In that frame the body's large motion is gone, so that the filter touches only what the skin
//! does. Each pass subtracts a multiple of the fourth derivative (Park & Hodgins 2006, 4.4);
//! [`amplitude_kept`] says in closed form what is left of a wave.

use std::f64::consts::TAU;

use glam::DVec3;

use super::fill::{Filled, View, in_parallel};
use super::neighbours::rank;
use super::rigid::Rigid;

/// Damping factor of one pass: the largest for which no wave is turned over.
const DAMPING: f64 = 1.0 / 16.0;
/// Neighbours that carry the local frame.
const SET: usize = 8;
/// Variance, square metres, by which a rigid distance is expected to vary anyhow.
const NOISE: f64 = 1e-6;

/// What [`smooth`] is asked to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothOptions {
    /// Frequency in hertz at which 71 % of a wave's amplitude in the local frame is kept.
    pub cutoff: f64,
}

impl Default for SmoothOptions {
    /// 20 Hz: jiggling flesh stays below 10 Hz, of which 98 % is kept.
    fn default() -> Self {
        Self { cutoff: 20.0 }
    }
}

/// How many passes make `cutoff` the frequency at which 71 % is kept; 0 where the frame rate is
/// too low to hold that frequency.
#[must_use]
pub fn pass_count(cutoff: f64, rate: f64) -> usize {
    let kept = pass_gain(cutoff, rate);
    if !(cutoff > 0.0 && 2.0 * cutoff < rate && kept > 0.0) {
        return 0;
    }
    let passes = 0.5f64.sqrt().ln() / kept.ln();
    // Slower than this the filter would take longer than any take is worth.
    passes.round().clamp(0.0, 10_000.0) as usize
}

/// Share of a wave's amplitude that `passes` passes keep: `(1 - (2 - 2 cos w)^2 / 16)^passes` with
/// `w = 2 pi frequency / rate`. The phase is kept exactly.
#[must_use]
pub fn amplitude_kept(frequency: f64, rate: f64, passes: usize) -> f64 {
    pass_gain(frequency, rate).powi(i32::try_from(passes).unwrap_or(i32::MAX))
}

fn pass_gain(frequency: f64, rate: f64) -> f64 {
    let second = 2.0 - 2.0 * (TAU * frequency / rate).cos();
    1.0 - DAMPING * second * second
}

/// Filters every trajectory in its local frame. Samples that are missing stay missing, and bound
/// what is filtered together.
///
/// `progress` is called with each finished marker, from several threads. Linear in samples, passes
/// and neighbours.
pub fn smooth(filled: &mut Filled, options: &SmoothOptions, progress: &(dyn Fn() + Sync)) {
    let markers: Vec<usize> = (0..filled.take.marker_count()).collect();
    smooth_markers(filled, &markers, options, progress);
}

/// [`smooth`], only for some markers.
///
/// # Panics
/// If a marker does not exist.
pub fn smooth_markers(
    filled: &mut Filled,
    markers: &[usize],
    options: &SmoothOptions,
    progress: &(dyn Fn() + Sync),
) {
    let passes = pass_count(options.cutoff, filled.take.rate());
    if passes == 0 {
        return;
    }
    let paths = in_parallel(markers, |marker| {
        let path = smooth_marker(&filled.view(), marker, passes);
        progress();
        path
    });
    for (&marker, path) in markers.iter().zip(paths) {
        for (frame, position) in path.into_iter().enumerate() {
            if !position.is_nan() {
                filled.take.set_position(marker, frame, Some(position));
            }
        }
    }
}

fn smooth_marker(view: &View<'_>, marker: usize, passes: usize) -> Vec<DVec3> {
    let mut path = view.trajectory(marker).to_vec();
    let mut ranked = rank(view, marker);
    ranked.truncate(SET);
    let Some(home) = reference(view, &ranked.iter().map(|n| n.marker).collect::<Vec<_>>()) else {
        return path;
    };
    // A frame of other neighbours has another origin: it bounds what is filtered together.
    let present = |frame: usize| {
        let each = ranked.iter().enumerate();
        each.fold(0_u32, |bits, (at, neighbour)| {
            bits | u32::from(!view.sigma(neighbour.marker, frame).is_nan()) << at
        })
    };
    let usable = |frame: usize, set: u32| !path[frame].is_nan() && set.count_ones() >= 3;
    let mut runs: Vec<(usize, usize, u32)> = Vec::new();
    for frame in 0..path.len() {
        let set = present(frame);
        if !usable(frame, set) {
            continue;
        }
        match runs.last_mut() {
            Some((_, end, same)) if *end == frame && *same == set => *end += 1,
            _ => runs.push((frame, frame + 1, set)),
        }
    }
    for (start, end, set) in runs {
        let poses: Vec<Rigid> = (start..end)
            .map(|frame| {
                let members = ranked.iter().zip(&home).enumerate();
                let pairs = members.filter(|(at, _)| set >> at & 1 == 1);
                let pairs = pairs.map(|(_, (neighbour, &home))| {
                    let position = view.trajectory(neighbour.marker)[frame];
                    (position, home, (neighbour.variance + NOISE).recip())
                });
                Rigid::fit(pairs).unwrap_or(Rigid::IDENTITY)
            })
            .collect();
        let own = path[start..end].iter().zip(&poses);
        let mut local: Vec<DVec3> = own.map(|(position, pose)| pose.apply(*position)).collect();
        damp(&mut local, passes);
        let back = local.iter().zip(&poses);
        for (position, (local, pose)) in path[start..end].iter_mut().zip(back) {
            *position = pose.inverse().apply(*local);
        }
    }
    path
}

/// Positions of a set in the frame that shows the most of it: those of its own frame first.
fn reference(view: &View<'_>, set: &[usize]) -> Option<Vec<DVec3>> {
    let seen = |frame: usize| {
        let known = set.iter().filter(|&&m| !view.sigma(m, frame).is_nan());
        known.count()
    };
    let best =
        (0..view.take.frame_count()).max_by_key(|&frame| (seen(frame), usize::MAX - frame))?;
    if seen(best) < set.len() || set.len() < 3 {
        return None;
    }
    Some(set.iter().map(|&m| view.trajectory(m)[best]).collect())
}

/// Subtracts a multiple of the fourth derivative, several times. At the ends the operator is the
/// second difference's own adjoint, so that a straight line passes unchanged everywhere.
fn damp(path: &mut [DVec3], passes: usize) {
    let count = path.len();
    if count < 3 {
        return;
    }
    let mut second = vec![DVec3::ZERO; count];
    for _ in 0..passes {
        for at in 1..count - 1 {
            second[at] = path[at - 1] - 2.0 * path[at] + path[at + 1];
        }
        for at in 0..count {
            let before = if at > 0 { second[at - 1] } else { DVec3::ZERO };
            let after = if at + 1 < count {
                second[at + 1]
            } else {
                DVec3::ZERO
            };
            path[at] -= DAMPING * (before - 2.0 * second[at] + after);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_keep_the_stated_amplitude() {
        let rate = 120.0;
        for frequency in [3.0, 10.0, 20.0, 40.0] {
            let passes = pass_count(20.0, rate);
            let wave = |frame: usize| (TAU * frequency * frame as f64 / rate).sin();
            let mut path: Vec<DVec3> = (0..600).map(|frame| DVec3::X * wave(frame)).collect();
            damp(&mut path, passes);
            let kept = amplitude_kept(frequency, rate, passes);
            for (frame, position) in path.iter().enumerate().take(400).skip(200) {
                assert!(
                    (position.x - kept * wave(frame)).abs() < 1e-9,
                    "{frequency} {frame}"
                );
            }
        }
        let passes = pass_count(20.0, rate);
        assert!((amplitude_kept(20.0, rate, passes) - 0.5f64.sqrt()).abs() < 0.03);
        assert!(amplitude_kept(10.0, rate, passes) > 0.97);
        assert_eq!(pass_count(20.0, 30.0), 0, "above half the rate");
        assert_eq!(pass_count(f64::NAN, 30.0), 0);
    }

    #[test]
    fn lines_and_short_pieces_pass() {
        let line: Vec<DVec3> = (0..50).map(|at| DVec3::new(at as f64, 1.0, -2.0)).collect();
        for count in [0, 1, 2, 3, 50] {
            let mut path = line[..count].to_vec();
            damp(&mut path, 100);
            for (found, expected) in path.iter().zip(&line) {
                assert!(found.distance(*expected) < 1e-9);
            }
        }
    }
}
