//! Feet that stand still stay where they are, on the floor.

use std::ops::Range;

use glam::DVec3;

use super::carry::Hold;

/// Markers of the scan this far above its lowest point belong to the feet, metres.
const FOOT: f64 = 0.12;
/// A marker slower than this, metres a second, ...
const STILL: f64 = 0.2;
/// ... no higher above its lowest places than this, metres, ...
const LOW: f64 = 0.025;
/// ... and for at least this long, seconds, stands.
const LONG: f64 = 0.1;
/// Time in which a foot is taken up and let go, seconds.
const RAMP: f64 = 0.12;

/// A marker that stands in a stretch of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Plant {
    pub marker: usize,
    pub frames: Range<usize>,
}

/// When which markers stand: `rest` `[markers]` on the scan, `floor` its height there; `paths`
/// `[frames][markers]`. O(frames x markers)
pub(super) fn plants(rest: &[DVec3], floor: f64, paths: &[Vec<DVec3>], rate: f64) -> Vec<Plant> {
    let mut plants = Vec::new();
    let feet = (0..rest.len()).filter(|&marker| rest[marker].y - floor < FOOT);
    for marker in feet {
        let way: Vec<DVec3> = paths.iter().map(|frame| frame[marker]).collect();
        let mut heights: Vec<f64> = way.iter().map(|p| p.y).collect();
        heights.sort_by(f64::total_cmp);
        let lowest = heights[heights.len() / 20];
        let stands = |at: usize| {
            let (before, after) = (at.saturating_sub(1), (at + 1).min(way.len() - 1));
            let seconds = (after - before).max(1) as f64 / rate;
            let speed = way[after].distance(way[before]) / seconds;
            speed < STILL && way[at].y < lowest + LOW
        };
        let mut start = None;
        for at in 0..=way.len() {
            match (start, at < way.len() && stands(at)) {
                (None, true) => start = Some(at),
                (Some(first), false) => {
                    if (at - first) as f64 >= LONG * rate {
                        let frames = first..at;
                        plants.push(Plant { marker, frames });
                    }
                    start = None;
                }
                _ => {}
            }
        }
    }
    plants
}

/// Where standing markers are held, `[frames]`: in the middle of where they would be, as high
/// above the floor as at rest. Between stretches they move over within [`RAMP`].
pub(super) fn hold(
    plants: &[Plant],
    rest: &[DVec3],
    placed: &[Vec<DVec3>],
    rate: f64,
) -> Vec<Vec<Hold>> {
    let mut holds = vec![Vec::new(); placed.len()];
    let ramp = (RAMP * rate).ceil().max(1.0) as usize;
    for Plant { marker, frames } in plants {
        let mean = frames
            .clone()
            .map(|frame| placed[frame][*marker])
            .sum::<DVec3>();
        let mean = mean / frames.len() as f64;
        let place = DVec3::new(mean.x, rest[*marker].y, mean.z);
        let around = frames.start.saturating_sub(ramp)..(frames.end + ramp).min(placed.len());
        for frame in around {
            let out = if frame < frames.start {
                frames.start - frame
            } else {
                (frame + 1).saturating_sub(frames.end)
            };
            // Strength falls off so steeply because the edges it works against are weak.
            let part = 1.0 - out as f64 / (ramp + 1) as f64;
            let here = placed[frame][*marker];
            let (place, strength) = if out == 0 {
                (place, 1.0)
            } else {
                let ease = part * part * (3.0 - 2.0 * part);
                (here.lerp(place, ease), ease.powi(2))
            };
            holds[frame].push(Hold {
                marker: *marker,
                place,
                strength,
            });
        }
    }
    holds
}

/// Largest horizontal way of a standing marker from where it stood first, metres.
pub(super) fn slide(plants: &[Plant], placed: &[Vec<DVec3>]) -> f64 {
    let flat = |p: DVec3| DVec3::new(p.x, 0.0, p.z);
    let way = |plant: &Plant| {
        let first = flat(placed[plant.frames.start][plant.marker]);
        let ways = plant
            .frames
            .clone()
            .map(|f| flat(placed[f][plant.marker]).distance(first));
        ways.fold(0.0, f64::max)
    };
    plants.iter().map(way).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_found_and_held() {
        // Stands for 30 frames, lifts and goes on for 30, stands again; drifts all the while.
        let at = |k: usize| {
            let (x, y) = match k {
                0..30 => (0.0, 0.02),
                30..60 => (0.02 * (k - 30) as f64, 0.15),
                _ => (0.6, 0.02),
            };
            vec![
                DVec3::new(x + 1e-4 * k as f64, y, 0.0),
                DVec3::new(0.0, 1.0, 0.0),
            ]
        };
        let paths: Vec<_> = (0..90).map(at).collect();
        let rest = [DVec3::new(0.0, 0.03, 0.0), DVec3::Y];
        let plants = plants(&rest, 0.0, &paths, 100.0);
        assert_eq!(plants.len(), 2);
        assert!(plants[0].frames.len() >= 28 && plants.iter().all(|p| p.marker == 0));
        let holds = hold(&plants, &rest, &paths, 100.0);
        let steady = holds[5][0];
        assert_eq!((steady.strength, steady.place.y), (1.0, 0.03));
        assert_eq!(holds[5][0].place, holds[25][0].place);
        assert!(holds[34][0].strength < 1.0 && holds[45].is_empty());
        assert!((slide(&plants, &paths) - 2.9e-3).abs() < 3e-4);
    }
}
