//! Porter's rope tracker in `f64`, straight from the equations.
//!
//! B. Z. Porter, *Motion Capture of Character Interactions with a Rope* (2012), section 3.5. What the
//! text leaves open is decided as in the core, whose oracle this is.

use glam::DVec3;

/// One marker's trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedTrace {
    /// Metres: measured, or a temporary marker.
    pub position: DVec3,
    /// The point of this frame.
    pub point: Option<usize>,
    /// Temporary markers in a row.
    pub temporary: u32,
}

/// The published tracker after its start.
#[derive(Clone, Debug)]
pub struct PublishedRope {
    gamma: f64,
    neighbour_after: u32,
    traces: Vec<PublishedTrace>,
    /// Positions of the frame before the last one.
    before: Vec<DVec3>,
    /// Was measured in the frame before.
    steady: Vec<bool>,
    /// Metres along the rope at the start.
    arc: Vec<f64>,
    /// Positions at the start, from which the distance in eq. 3.5 is taken.
    rest: Vec<DVec3>,
}

impl PublishedRope {
    /// A rope at rest at `positions`; `gamma` in metres.
    #[must_use]
    pub fn new(positions: &[DVec3], gamma: f64, neighbour_after: u32) -> Self {
        let mut arc = vec![0.0];
        for pair in positions.windows(2) {
            arc.push(arc[arc.len() - 1] + pair[0].distance(pair[1]));
        }
        let trace = |&position: &DVec3| PublishedTrace {
            position,
            point: None,
            temporary: 0,
        };
        Self {
            gamma,
            neighbour_after,
            traces: positions.iter().map(trace).collect(),
            before: positions.to_vec(),
            steady: vec![false; positions.len()],
            arc,
            rest: positions.to_vec(),
        }
    }

    /// `[markers]`
    #[must_use]
    pub fn traces(&self) -> &[PublishedTrace] {
        &self.traces
    }

    /// Takes one frame of points, metres. O(markers x points)
    pub fn step(&mut self, points: &[DVec3]) {
        let count = self.traces.len();
        let last: Vec<DVec3> = self.traces.iter().map(|trace| trace.position).collect();
        let velocity: Vec<DVec3> = last
            .iter()
            .zip(&self.before)
            .map(|(a, b)| *a - *b)
            .collect();
        let mut free = vec![true; points.len()];
        let mut known = vec![false; count];
        // Eq. 3.1 and 3.2.
        for j in 0..count {
            self.traces[j].point = None;
            if self.traces[j].temporary == 0 {
                let expected = last[j] + velocity[j];
                known[j] = self.take(j, expected, points, &mut free);
            }
        }
        for j in 0..count {
            if known[j] {
                continue;
            }
            let temporary = self.traces[j].temporary + 1;
            let by_velocity = last[j] + self.neighbour_velocity(j, &known, &last, velocity[j]);
            let mut estimate = by_velocity;
            if temporary > self.neighbour_after
                && let Some(by_position) = self.neighbour_position(j, &known)
            {
                // Eq. 3.6.
                let alpha = 1.0 / f64::from(temporary);
                estimate = by_velocity * alpha + by_position * (1.0 - alpha);
            }
            if self.take(j, estimate, points, &mut free) {
                known[j] = true;
            } else {
                self.traces[j].position = estimate;
                self.traces[j].temporary = temporary;
            }
        }
        self.before = last;
        self.steady = known;
    }

    fn take(&mut self, j: usize, expected: DVec3, points: &[DVec3], free: &mut [bool]) -> bool {
        let near = points.iter().enumerate().filter(|(index, _)| free[*index]);
        let distances = near.map(|(index, point)| (point.distance(expected), index));
        let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, index)) = nearest.filter(|(away, _)| *away < self.gamma) else {
            return false;
        };
        free[index] = false;
        self.traces[j] = PublishedTrace {
            position: points[index],
            point: Some(index),
            temporary: 0,
        };
        true
    }

    /// Eq. 3.3, metres a frame.
    fn neighbour_velocity(&self, j: usize, known: &[bool], last: &[DVec3], own: DVec3) -> DVec3 {
        let usable = |k: &usize| known[*k] && self.steady[*k];
        let velocity = |k: usize| self.traces[k].position - last[k];
        let left = (0..j).rev().find(usable);
        let right = (j + 1..known.len()).find(usable);
        match (left, right) {
            (Some(l), Some(r)) => {
                let (to_left, to_right) = (self.arc[j] - self.arc[l], self.arc[r] - self.arc[j]);
                let beta = to_right / (to_left + to_right);
                velocity(l) * beta + velocity(r) * (1.0 - beta)
            }
            (Some(one), None) | (None, Some(one)) => velocity(one),
            (None, None) => own,
        }
    }

    /// Eq. 3.4 and 3.5.
    fn neighbour_position(&self, j: usize, known: &[bool]) -> Option<DVec3> {
        let left: Vec<usize> = (0..j).rev().filter(|k| known[*k]).take(3).collect();
        let right: Vec<usize> = (j + 1..known.len()).filter(|k| known[*k]).take(3).collect();
        let side = match (left.len() == 3, right.len() == 3) {
            (true, true) if j - left[0] <= right[0] - j => left,
            (true, true) | (false, true) => right,
            (true, false) => left,
            (false, false) => return None,
        };
        let at = |k: usize| self.traces[side[k]].position;
        let direction = (((at(0) - at(1)) + (at(1) - at(2))) / 2.0).normalize_or_zero();
        let distance = self.rest[j].distance(self.rest[side[0]]);
        Some(at(0) + direction * distance)
    }
}

#[cfg(test)]
mod tests {
    use sinew_core::track::rope::{Config, Method, RopeTracker, Source};

    use super::*;
    use crate::studio::rope::{CaptureFrame, Disturbance, Label, Motion, Scene};

    /// The core's published method takes the same points and invents the same positions.
    #[test]
    fn the_core_follows_the_equations() {
        let mut scene = Scene::new(Motion::Ribbon, 5);
        scene.seconds = 4.0;
        let take = scene.film().unwrap();
        let capture = take.capture(&Disturbance {
            drop_outs: 0.05,
            ghosts: 0.05,
            ..Disturbance::noise_only(3)
        });
        let start = &take.rope[0];
        let single: Vec<[f32; 3]> = start.iter().map(|p| p.as_vec3().to_array()).collect();
        let config = Config {
            method: Method::Published,
            ..Config::new(100.0)
        };
        let mut core = RopeTracker::<32, 64>::starting_at(config, &single).unwrap();
        let mut oracle = PublishedRope::new(start, 0.05, 1);
        let (mut temporary, mut worst) = (0, 0.0_f64);
        for frame in &capture.frames {
            let points: Vec<[f32; 3]> = frame
                .points
                .iter()
                .map(|p| p.as_vec3().to_array())
                .collect();
            core.step(&points);
            oracle.step(&frame.points);
            for (sample, trace) in core.samples().zip(oracle.traces()) {
                let point = match sample.source {
                    Source::Measured(point) => Some(usize::from(point)),
                    _ => None,
                };
                assert_eq!(point, trace.point);
                temporary += usize::from(point.is_none());
                let [x, y, z] = sample.position.map(f64::from);
                worst = worst.max(DVec3::new(x, y, z).distance(trace.position));
            }
        }
        let seen = |frame: &&CaptureFrame| frame.labels.contains(&Label::Rope(3));
        assert!(capture.frames.iter().filter(seen).count() > capture.frames.len() / 2);
        assert!(temporary > 100, "{temporary} gaps tell something");
        assert!(worst < 2e-5, "{worst} m between f32 and f64");
    }
}
