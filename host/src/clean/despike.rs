//! Spikes: one or two samples that jump away from their trajectory and back.
//!
//! They come from merged or ghost images. Each is taken out before anything is learned, so that it
//! neither bends what is filled nor is smeared by smoothing.

use glam::DVec3;

use crate::take::Take;

/// A removed spike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spike {
    /// Index of the marker.
    pub marker: usize,
    /// Its first frame.
    pub frame: usize,
    /// How many frames: 1 or 2.
    pub len: usize,
    /// Metres from where the samples around it expect it.
    pub height: f64,
}

/// Least height, metres.
const LEAST: f64 = 2e-3;
/// Least height over what nine of ten departures around it stay below.
const TIMES: f64 = 5.0;
/// Seconds on each side that say what is usual.
const AROUND: f64 = 0.5;

/// Removes spikes from a take and says which.
///
/// A spike stands out from the cubic through two samples on each side both absolutely (2 mm) and
/// against how well such cubics fit within half a second around it, so that impacts, which shake
/// more than two frames, stay. Linear in samples times half the rate.
pub fn despike(take: &mut Take) -> Vec<Spike> {
    let mut spikes = Vec::new();
    for marker in 0..take.marker_count() {
        let path = take.trajectory(marker);
        let mut candidates = candidates(path, 1, take.rate());
        candidates.extend(self::candidates(path, 2, take.rate()));
        // The highest first: a spike bends the cubics of its neighbours, which are then innocent.
        candidates.sort_by(|a, b| b.height.total_cmp(&a.height));
        for mut spike in candidates {
            if height(take.trajectory(marker), spike.frame, spike.len).is_nan() {
                continue;
            }
            for frame in spike.frame..spike.frame + spike.len {
                take.set_position(marker, frame, None);
            }
            spike.marker = marker;
            spikes.push(spike);
        }
    }
    spikes.sort_by_key(|spike| (spike.marker, spike.frame));
    spikes
}

/// What stands out, of one length.
fn candidates(path: &[DVec3], len: usize, rate: f64) -> Vec<Spike> {
    let heights: Vec<f64> = (0..path.len()).map(|at| height(path, at, len)).collect();
    let around = (AROUND * rate).ceil().clamp(8.0, 500.0) as usize;
    let mut found = Vec::new();
    for (at, &height) in heights.iter().enumerate() {
        if height.is_nan() || height < LEAST {
            continue;
        }
        // The spike also spoils the cubics that use it: they do not count as usual.
        let mut usual: Vec<f64> = (at.saturating_sub(around)..(at + around).min(path.len()))
            .filter(|other| other.abs_diff(at) > len + 2)
            .map(|other| heights[other])
            .filter(|height| !height.is_nan())
            .collect();
        if usual.len() < 4 {
            continue;
        }
        let most = usual.len() * 9 / 10;
        let (_, most, _) = usual.select_nth_unstable_by(most, f64::total_cmp);
        if height > TIMES * *most {
            found.push(Spike {
                marker: 0,
                frame: at,
                len,
                height,
            });
        }
    }
    found
}

/// Least distance of `len` samples from the cubic through two samples on each side, and from the
/// straight course on either side: after a kick or a stop one side still fits. NaN where one of
/// the samples is missing.
fn height(path: &[DVec3], at: usize, len: usize) -> f64 {
    if at < 2 || at + len + 2 > path.len() {
        return f64::NAN;
    }
    let knots = [-2.0, -1.0, len as f64, len as f64 + 1.0];
    let values = [
        path[at - 2],
        path[at - 1],
        path[at + len],
        path[at + len + 1],
    ];
    (0..len)
        .map(|inner| {
            let x = inner as f64;
            let cubic: DVec3 = (0..4)
                .map(|i| {
                    let others = (0..4).filter(|j| *j != i);
                    let weight = others.map(|j| (x - knots[j]) / (knots[i] - knots[j]));
                    weight.product::<f64>() * values[i]
                })
                .sum();
            let [a, b, c, d] = values;
            let from_left = b + (b - a) * (x + 1.0);
            let from_right = c - (d - c) * (len as f64 - x);
            let departure = |expected: DVec3| path[at + inner].distance(expected);
            [cubic, from_left, from_right]
                .map(departure)
                .into_iter()
                .fold(f64::INFINITY, nan_or_min)
        })
        .fold(f64::INFINITY, nan_or_min)
}

fn nan_or_min(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.min(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave() -> Vec<DVec3> {
        (0..200)
            .map(|frame| {
                let time = frame as f64 / 100.0;
                DVec3::new(time, (6.0 * time).sin(), 1e-5 * (frame as f64 * 37.0).sin())
            })
            .collect()
    }

    fn take_of(path: Vec<DVec3>) -> Take {
        Take::new(vec!["A".into()], 100.0, path.len(), path).unwrap()
    }

    #[test]
    fn spikes_go_and_impacts_stay() {
        let mut path = wave();
        path[50] += DVec3::X * 0.02;
        path[120] += DVec3::Y * 0.05;
        path[121] += DVec3::Y * 0.04;
        let mut take = take_of(path);
        let spikes = despike(&mut take);
        let places: Vec<_> = spikes
            .iter()
            .map(|spike| (spike.frame, spike.len))
            .collect();
        assert_eq!(places, [(50, 1), (120, 2)], "{spikes:?}");
        assert!((spikes[0].height - 0.02).abs() < 1e-3);
        assert_eq!(take.missing_count(0), 3);

        // A dead stop is motion.
        let mut path = wave();
        for position in &mut path[100..] {
            position.x = 1.0;
        }
        assert_eq!(despike(&mut take_of(path)), []);
        assert_eq!(despike(&mut take_of(vec![DVec3::X; 3])), []);
    }
}
