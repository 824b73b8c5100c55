//! What a capture system makes of the dots: points, and trajectories that break.

use glam::DVec3;

use super::capture::{Sample, Shot};
use super::random::Random;
use super::visibility::Seen;

/// A trajectory that goes on.
#[derive(Clone, Copy, Debug)]
struct Live {
    trajectory: u32,
    last: DVec3,
    before: Option<DVec3>,
}

/// A point that no marker made.
#[derive(Clone, Copy, Debug)]
struct Ghost {
    trajectory: u32,
    /// It hangs about this marker.
    marker: usize,
    offset: DVec3,
    drift: DVec3,
    frames_left: u32,
}

/// The state of the system between frames.
#[derive(Clone, Debug)]
pub(super) struct Tracker {
    live: Vec<Option<Live>>,
    ghosts: Vec<Ghost>,
    next: u32,
    random: Random,
    /// Trajectories that took over another marker's points.
    pub swap_count: usize,
    pub ghost_count: usize,
}

impl Tracker {
    pub fn new(marker_count: usize, seed: u64) -> Self {
        Self {
            live: vec![None; marker_count],
            ghosts: Vec::new(),
            next: 0,
            random: Random::new(seed ^ 0x7BAC_4E00),
            swap_count: 0,
            ghost_count: 0,
        }
    }

    /// The samples of the next frame, in the order of their trajectories, each with its marker.
    pub fn step(&mut self, shot: &Shot, rate: f64, seen: &[Seen]) -> Vec<(Sample, Option<u32>)> {
        let mut points: Vec<Option<DVec3>> = Vec::with_capacity(seen.len());
        for (seen, live) in seen.iter().zip(&self.live) {
            // Drawn for all, so that an occlusion does not change the noise of the others.
            let noise = self.random.normal3() * shot.noise;
            let needed = if live.is_some() {
                shot.keep_cameras
            } else {
                shot.start_cameras
            };
            let enough = seen.cameras.count_ones() as usize >= needed;
            points.push(enough.then(|| seen.position + noise));
        }
        self.fuse(shot.sight.marker_diameter, &mut points);
        self.confuse(shot.swap_chance, &points);
        for (live, point) in self.live.iter_mut().zip(&points) {
            match (live.as_mut(), point) {
                (Some(live), Some(point)) => {
                    live.before = Some(live.last);
                    live.last = *point;
                }
                (_, None) => *live = None,
                (None, Some(_)) => {}
            }
        }
        self.begin(&points);
        let mut samples = Vec::with_capacity(points.len());
        for (marker, (live, point)) in self.live.iter().zip(&points).enumerate() {
            if let (Some(live), Some(position)) = (live, point) {
                let sample = Sample {
                    trajectory: live.trajectory,
                    position: *position,
                    cameras: seen[marker].cameras,
                };
                samples.push((sample, Some(marker as u32)));
            }
        }
        self.haunt(shot, rate, seen, &mut samples);
        samples.sort_by_key(|(sample, _)| sample.trajectory);
        samples
    }

    /// Points nearer than a marker is wide are one point; the trajectory that goes on keeps it.
    fn fuse(&self, width: f64, points: &mut [Option<DVec3>]) {
        let mut order: Vec<(usize, DVec3)> = points
            .iter()
            .enumerate()
            .filter_map(|(marker, point)| Some((marker, (*point)?)))
            .collect();
        order.sort_by(|a, b| a.1.x.total_cmp(&b.1.x));
        for (at, &(marker, point)) in order.iter().enumerate() {
            for &(other, place) in &order[at + 1..] {
                if place.x - point.x > width {
                    break;
                }
                if point.distance(place) < width {
                    let age = |m: usize| self.live[m].map_or(u32::MAX, |live| live.trajectory);
                    let loser = if age(marker) <= age(other) {
                        other
                    } else {
                        marker
                    };
                    points[loser] = None;
                }
            }
        }
    }

    /// A trajectory is continued by the point nearest to where it was going. Where that is
    /// another marker's point, it breaks, or takes it over.
    fn confuse(&mut self, swap_chance: f64, points: &[Option<DVec3>]) {
        for marker in 0..points.len() {
            let (Some(live), Some(own)) = (self.live[marker], points[marker]) else {
                continue;
            };
            let Some(before) = live.before else { continue };
            let expected = 2.0 * live.last - before;
            let miss = expected.distance(own);
            let others = points
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != marker);
            let nearer = others
                .filter_map(|(other, point)| Some((other, expected.distance((*point)?))))
                .filter(|(_, distance)| *distance < miss)
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((other, _)) = nearer else { continue };
            if self.random.unit() < swap_chance && self.live[other].is_some() {
                self.live.swap(marker, other);
                self.swap_count += 1;
            } else {
                self.live[marker] = None;
            }
        }
    }

    /// New trajectories for points that have none, numbered in no order of the markers.
    fn begin(&mut self, points: &[Option<DVec3>]) {
        let has = |marker: &usize| points[*marker].is_some() && self.live[*marker].is_none();
        let mut fresh: Vec<usize> = (0..points.len()).filter(has).collect();
        for at in (1..fresh.len()).rev() {
            let other = self.random.index(at + 1);
            fresh.swap(at, other);
        }
        for marker in fresh {
            if let Some(last) = points[marker] {
                let trajectory = self.number();
                self.live[marker] = Some(Live {
                    trajectory,
                    last,
                    before: None,
                });
            }
        }
    }

    fn number(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    /// Rays of different markers that meet by chance: short, near the body, a little unsteady.
    fn haunt(
        &mut self,
        shot: &Shot,
        rate: f64,
        seen: &[Seen],
        samples: &mut Vec<(Sample, Option<u32>)>,
    ) {
        if !samples.is_empty() && self.random.unit() < shot.ghosts_per_second / rate {
            let (_, marker) = samples[self.random.index(samples.len())];
            let direction = self.random.normal3().normalize_or(DVec3::Y);
            let ghost = Ghost {
                trajectory: self.number(),
                marker: marker.unwrap_or(0) as usize,
                offset: direction * self.random.range(0.012, 0.08),
                drift: self.random.normal3() * 1e-3,
                frames_left: 1 + (-2.0 * (1.0 - self.random.unit()).ln()) as u32,
            };
            self.ghosts.push(ghost);
            self.ghost_count += 1;
        }
        for ghost in &mut self.ghosts {
            let noise = self.random.normal3() * (3.0 * shot.noise);
            let sample = Sample {
                trajectory: ghost.trajectory,
                position: seen[ghost.marker].position + ghost.offset + noise,
                cameras: 0b11,
            };
            ghost.offset += ghost.drift;
            ghost.frames_left -= 1;
            samples.push((sample, None));
        }
        self.ghosts.retain(|ghost| ghost.frames_left > 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> Shot {
        Shot {
            noise: 0.0,
            ghosts_per_second: 0.0,
            ..Shot::default()
        }
    }

    fn at(x: f64, cameras: u32) -> Seen {
        Seen {
            cameras,
            position: DVec3::X * x,
        }
    }

    fn ids(samples: &[(Sample, Option<u32>)]) -> Vec<(u32, u32)> {
        samples
            .iter()
            .map(|(sample, marker)| (marker.unwrap(), sample.trajectory))
            .collect()
    }

    #[test]
    fn three_cameras_start_a_trajectory_two_keep_it_one_breaks_it() {
        let mut tracker = Tracker::new(1, 0);
        let mut step = |cameras| tracker.step(&quiet(), 100.0, &[at(0.0, cameras)]);
        assert!(step(0b011).is_empty(), "two do not start");
        assert_eq!(ids(&step(0b111)), [(0, 0)]);
        assert_eq!(ids(&step(0b101)), [(0, 0)]);
        assert!(step(0b100).is_empty());
        assert!(step(0b101).is_empty(), "two do not start again");
        assert_eq!(ids(&step(0b111)), [(0, 1)], "a new trajectory");
    }

    /// Two markers on one line that pass each other fast: each is nearer to where the other goes.
    fn crossing(swap_chance: f64) -> Vec<Vec<(u32, u32)>> {
        let shot = Shot {
            swap_chance,
            ..quiet()
        };
        let mut tracker = Tracker::new(2, 3);
        // They run at each other, then turn back: extrapolation takes each for the other.
        [0.10, 0.06, 0.02, 0.06]
            .map(|x| ids(&tracker.step(&shot, 100.0, &[at(-x, 0b111), at(x, 0b111)])))
            .to_vec()
    }

    #[test]
    fn a_confusion_breaks_or_swaps() {
        let broken = crossing(0.0);
        let first: Vec<u32> = broken[2].iter().map(|id| id.1).collect();
        let then: Vec<u32> = broken[3].iter().map(|id| id.1).collect();
        assert_eq!((first, then), (vec![0, 1], vec![2, 3]));
        let swapped = crossing(1.0);
        let marker_of = |frame: usize, id: u32| {
            swapped[frame]
                .iter()
                .find(|pair| pair.1 == id)
                .map(|pair| pair.0)
        };
        assert!(
            swapped[3].iter().all(|pair| pair.1 < 2),
            "nothing breaks: {swapped:?}"
        );
        assert_eq!(marker_of(0, 0), marker_of(2, 0));
    }

    #[test]
    fn two_points_closer_than_a_marker_become_one() {
        let mut tracker = Tracker::new(2, 0);
        tracker.step(&quiet(), 100.0, &[at(0.0, 0b111), at(0.1, 0b111)]);
        let samples = tracker.step(&quiet(), 100.0, &[at(0.0, 0b111), at(0.002, 0b111)]);
        assert_eq!(samples.len(), 1);
    }

    #[test]
    fn ghosts_come_at_their_rate_and_belong_to_no_marker() {
        let shot = Shot {
            ghosts_per_second: 20.0,
            ..quiet()
        };
        let mut tracker = Tracker::new(1, 9);
        let mut count = 0;
        for _ in 0..5000 {
            let samples = tracker.step(&shot, 100.0, &[at(0.0, 0b111)]);
            count += samples
                .iter()
                .filter(|(_, marker)| marker.is_none())
                .count();
        }
        assert!(
            (850..1150).contains(&tracker.ghost_count),
            "{}",
            tracker.ghost_count
        );
        let mean = count as f64 / tracker.ghost_count as f64;
        assert!((1.5..4.0).contains(&mean), "{mean} frames each");
    }
}
