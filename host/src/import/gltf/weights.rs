//! Morph weight channels of several meshes into one track over all targets.
//!
//! Each mesh may have key times of its own. The merged track has a key wherever one of them has
//! one, which changes no value: a straight line or a cubic that is cut at a point keeps its shape
//! when the point gets the curve's own value and slope.

use super::accessor::Reader;
use super::item_fault;
use crate::import::{ImportError, ImportErrorKind, Interpolation};

/// The weight channel of one mesh.
pub(super) struct WeightTrack {
    pub first_morph: usize,
    pub interpolation: Interpolation,
    pub times: Vec<f64>,
    /// `[keys x targets]`; `[keys x 3 x targets]` for splines.
    pub values: Vec<f64>,
}

/// Interpolation, key times and values of all targets.
type Merged = (Interpolation, Vec<f64>, Vec<f64>);

/// In-tangent, value and out-tangent of one target at one time.
type SplineKey = [f64; 3];

/// Merges the tracks; targets without one keep their rest weight.
pub(super) fn merge(
    reader: &mut Reader<'_>,
    tracks: &[WeightTrack],
    rest: &[f64],
    item: &str,
) -> Result<Option<Merged>, ImportError> {
    let Some(interpolation) = common_interpolation(tracks, item)? else {
        return Ok(None);
    };
    let mut times: Vec<f64> = tracks
        .iter()
        .flat_map(|track| &track.times)
        .copied()
        .collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let numbers = (times.len() as u64).saturating_mul(3 * rest.len() as u64);
    reader.charge(numbers, item)?;

    let spline = interpolation == Interpolation::CubicSpline;
    let mut values = Vec::with_capacity(times.len() * rest.len() * if spline { 3 } else { 1 });
    let mut keys: Vec<SplineKey> = rest.iter().map(|&weight| [0.0, weight, 0.0]).collect();
    for &time in &times {
        for track in tracks {
            let count = track.target_count();
            for target in 0..count {
                keys[track.first_morph + target] = track.key_at(target, time);
            }
        }
        if spline {
            for part in 0..3 {
                values.extend(keys.iter().map(|key| key[part]));
            }
        } else {
            values.extend(keys.iter().map(|key| key[1]));
        }
    }
    Ok(Some((interpolation, times, values)))
}

/// The interpolation that all tracks can be written in: straight lines are splines too, but
/// steps are neither.
fn common_interpolation(
    tracks: &[WeightTrack],
    item: &str,
) -> Result<Option<Interpolation>, ImportError> {
    let has = |wanted| tracks.iter().any(|track| track.interpolation == wanted);
    let (step, linear, spline) = (
        has(Interpolation::Step),
        has(Interpolation::Linear),
        has(Interpolation::CubicSpline),
    );
    if step && (linear || spline) {
        let what = "STEP for the morph weights of one mesh and smooth ones for another".into();
        return Err(item_fault(ImportErrorKind::Unsupported { what }, item));
    }
    Ok(if spline {
        Some(Interpolation::CubicSpline)
    } else if linear {
        Some(Interpolation::Linear)
    } else {
        step.then_some(Interpolation::Step)
    })
}

impl WeightTrack {
    fn parts(&self) -> usize {
        match self.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Step | Interpolation::Linear => 1,
        }
    }

    fn target_count(&self) -> usize {
        self.values.len() / (self.times.len() * self.parts())
    }

    /// One number of a key; `part` counts in-tangent, value, out-tangent.
    fn number(&self, key: usize, part: usize, target: usize) -> f64 {
        let part = if self.parts() == 3 { part } else { 0 };
        self.values[(key * self.parts() + part) * self.target_count() + target]
    }

    /// Value of one target at `time`, and the slopes before and after it.
    fn key_at(&self, target: usize, time: f64) -> SplineKey {
        // Number of keys at or before `time`.
        let after = self.times.partition_point(|&key| key <= time);
        let Some(at) = after.checked_sub(1) else {
            return [0.0, self.number(0, 1, target), 0.0];
        };
        let last = self.times.len() - 1;
        if self.times[at] < time {
            if at == last {
                return [0.0, self.number(last, 1, target), 0.0];
            }
            let (value, slope) = self.between(at, target, time);
            return [slope, value, slope];
        }
        // On a key: the slopes of its neighbours, none outside the track.
        let incoming = if at == 0 {
            0.0
        } else {
            self.slope_at(at - 1, at, target)
        };
        let outgoing = if at == last {
            0.0
        } else {
            self.slope_at(at, at, target)
        };
        [incoming, self.number(at, 1, target), outgoing]
    }

    /// Slope at key `at` of the segment that starts at key `segment`.
    fn slope_at(&self, segment: usize, at: usize, target: usize) -> f64 {
        match self.interpolation {
            Interpolation::Step => 0.0,
            Interpolation::Linear => self.between(segment, target, self.times[segment]).1,
            // The out-tangent of the segment's start or the in-tangent of its end.
            Interpolation::CubicSpline => {
                self.number(at, if at == segment { 2 } else { 0 }, target)
            }
        }
    }

    /// Value and slope inside the segment that starts at key `key` (glTF 2.0, appendix C).
    fn between(&self, key: usize, target: usize, time: f64) -> (f64, f64) {
        let span = self.times[key + 1] - self.times[key];
        let u = (time - self.times[key]) / span;
        let (start, end) = (self.number(key, 1, target), self.number(key + 1, 1, target));
        match self.interpolation {
            Interpolation::Step => (start, 0.0),
            Interpolation::Linear => (start + (end - start) * u, (end - start) / span),
            Interpolation::CubicSpline => {
                let leaving = span * self.number(key, 2, target);
                let arriving = span * self.number(key + 1, 0, target);
                let (u2, u3) = (u * u, u * u * u);
                let value = (2.0 * u3 - 3.0 * u2 + 1.0) * start
                    + (u3 - 2.0 * u2 + u) * leaving
                    + (3.0 * u2 - 2.0 * u3) * end
                    + (u3 - u2) * arriving;
                let slope = (6.0 * u2 - 6.0 * u) * (start - end)
                    + (3.0 * u2 - 4.0 * u + 1.0) * leaving
                    + (3.0 * u2 - 2.0 * u) * arriving;
                (value, slope / span)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spline() -> WeightTrack {
        // One target: 0 with slope 3 at t = 1, 2 with slope 0 at t = 3.
        WeightTrack {
            first_morph: 0,
            interpolation: Interpolation::CubicSpline,
            times: vec![1.0, 3.0],
            values: vec![9.0, 0.0, 3.0, 0.0, 2.0, 9.0],
        }
    }

    #[test]
    fn slopes_are_zero_outside_a_track() {
        let track = spline();
        assert_eq!(track.key_at(0, 0.0), [0.0, 0.0, 0.0]);
        assert_eq!(track.key_at(0, 1.0), [0.0, 0.0, 3.0]);
        assert_eq!(track.key_at(0, 3.0), [0.0, 2.0, 0.0]);
        assert_eq!(track.key_at(0, 4.0), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn a_spline_cut_in_two_keeps_its_shape() {
        let track = spline();
        // u = 1/2, span 2: value 1/2 * 2 + 1/8 * 2 * 3 = 1.75.
        let [slope, value, _] = track.key_at(0, 2.0);
        assert!((value - 1.75).abs() < 1e-15);
        let cut = WeightTrack {
            times: vec![1.0, 2.0, 3.0],
            values: vec![0.0, 0.0, 3.0, slope, value, slope, 0.0, 2.0, 0.0],
            ..spline()
        };
        for time in [1.25, 1.5, 2.25, 2.9] {
            let (a, b) = (track.key_at(0, time), cut.key_at(0, time));
            assert!((a[1] - b[1]).abs() < 1e-14, "{time}: {a:?} {b:?}");
        }
    }

    #[test]
    fn a_straight_line_as_spline_stays_straight() {
        let line = WeightTrack {
            first_morph: 0,
            interpolation: Interpolation::Linear,
            times: vec![0.0, 2.0, 3.0],
            values: vec![0.0, 4.0, 1.0],
        };
        assert_eq!(line.key_at(0, 0.0), [0.0, 0.0, 2.0]);
        assert_eq!(line.key_at(0, 1.0), [2.0, 2.0, 2.0]);
        assert_eq!(line.key_at(0, 2.0), [2.0, 4.0, -3.0]);
        assert_eq!(line.key_at(0, 3.0), [-3.0, 1.0, 0.0]);
    }
}
