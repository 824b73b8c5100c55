//! What a capture system makes of a take.

use glam::DVec3;

use super::random::Random;
use super::{Capsule, Take};

/// What a point really is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// Marker of the rope, numbered along it.
    Rope(usize),
    /// Marker of a person.
    Body(usize),
    /// Nothing is there.
    Ghost,
}

/// One frame of unlabelled points, in no order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CaptureFrame {
    /// Metres.
    pub points: Vec<DVec3>,
    /// `[points]`: for scoring only.
    pub labels: Vec<Label>,
}

/// What a capture system hands on.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Frames a second.
    pub rate: f64,
    /// All frames.
    pub frames: Vec<CaptureFrame>,
}

/// How a capture differs from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Standard deviation of each coordinate, metres.
    pub noise: f64,
    /// Share of samples that drop out, in bursts.
    pub drop_outs: f64,
    /// Mean length of a burst, frames.
    pub burst: f64,
    /// Ghost points as a share of the real ones; half of them near a real marker.
    pub ghosts: f64,
    /// Markers nearer than this are seen as one point half-way, metres.
    pub merge: f64,
    /// Cameras in a ring; a marker needs two that see past every capsule. 0: nothing is hidden.
    pub cameras: usize,
    /// Frames at the start that keep every marker.
    pub clean_start: usize,
    /// Everything that varies follows from it and from the take's own seed.
    pub seed: u64,
}

impl Disturbance {
    /// Noise of a well calibrated system, half a millimetre, and nothing else.
    #[must_use]
    pub const fn noise_only(seed: u64) -> Self {
        Self {
            noise: 0.0005,
            drop_outs: 0.0,
            burst: 4.0,
            ghosts: 0.0,
            merge: 0.0,
            cameras: 0,
            clean_start: 30,
            seed,
        }
    }

    /// Five per cent of drop-outs and of ghosts, merging at 8 mm.
    #[must_use]
    pub const fn rough(seed: u64) -> Self {
        Self {
            drop_outs: 0.05,
            ghosts: 0.05,
            merge: 0.008,
            ..Self::noise_only(seed)
        }
    }
}

impl Take {
    /// Films the take.
    #[must_use]
    pub fn capture(&self, how: &Disturbance) -> Capture {
        let mut random = Random::new(self.seed ^ how.seed.rotate_left(32) ^ 0x5EED);
        let cameras = camera_ring(how.cameras);
        let marker_count =
            self.rope.first().map_or(0, Vec::len) + self.body.first().map_or(0, Vec::len);
        let mut dropped = vec![false; marker_count];
        let mut ghosts: Vec<(DVec3, usize)> = Vec::new();
        let frames = (0..self.rope.len()).map(|frame| {
            let clean = frame < how.clean_start;
            let rope = self.rope[frame]
                .iter()
                .enumerate()
                .map(|(i, p)| (*p, Label::Rope(i)));
            let body = self.body[frame]
                .iter()
                .enumerate()
                .map(|(i, p)| (*p, Label::Body(i)));
            let mut seen: Vec<(DVec3, Label)> = Vec::with_capacity(marker_count);
            for (marker, (position, label)) in rope.chain(body).enumerate() {
                step_burst(&mut dropped[marker], how, &mut random);
                let noisy = position + random.normal3() * how.noise;
                let hidden = dropped[marker] || !visible(position, &cameras, &self.capsules[frame]);
                if clean || !hidden {
                    seen.push((noisy, label));
                }
            }
            if !clean {
                merge(&mut seen, how.merge);
                self.haunt(frame, how, &mut random, &mut ghosts);
                seen.extend(ghosts.iter().map(|(p, _)| (*p, Label::Ghost)));
            }
            // Fisher and Yates: no order that a tracker could lean on.
            for i in (1..seen.len()).rev() {
                seen.swap(i, random.index(i + 1));
            }
            let (points, labels) = seen.into_iter().unzip();
            CaptureFrame { points, labels }
        });
        Capture {
            rate: self.rate,
            frames: frames.collect(),
        }
    }

    /// Lets old ghosts go and new ones come.
    fn haunt(
        &self,
        frame: usize,
        how: &Disturbance,
        random: &mut Random,
        ghosts: &mut Vec<(DVec3, usize)>,
    ) {
        const MEAN_LIFE: f64 = 2.0;
        for ghost in ghosts.iter_mut() {
            ghost.1 -= 1;
            ghost.0 += random.normal3() * 0.002;
        }
        ghosts.retain(|g| g.1 > 0);
        let markers: Vec<DVec3> = self.rope[frame]
            .iter()
            .chain(&self.body[frame])
            .copied()
            .collect();
        let expected = how.ghosts * markers.len() as f64 / MEAN_LIFE;
        let mut born = expected.floor() as usize;
        born += usize::from(random.unit() < expected - born as f64);
        for _ in 0..born {
            let near = random.unit() < 0.5;
            let place = if near && !markers.is_empty() {
                markers[random.index(markers.len())] + random.normal3() * 0.04
            } else {
                random.in_box(DVec3::new(-1.5, 0.0, -1.2), DVec3::new(1.5, 2.4, 1.2))
            };
            ghosts.push((place, 1 + random.index(3)));
        }
    }
}

/// A two-state chain whose mean stay in "dropped" is `burst` and whose share is `drop_outs`.
fn step_burst(dropped: &mut bool, how: &Disturbance, random: &mut Random) {
    let end = 1.0 / how.burst.max(1.0);
    let share = how.drop_outs.clamp(0.0, 0.95);
    let begin = end * share / (1.0 - share);
    *dropped = random.unit() < if *dropped { 1.0 - end } else { begin };
}

/// Replaces pairs nearer than `distance` by their midpoint under the first one's label.
fn merge(seen: &mut Vec<(DVec3, Label)>, distance: f64) {
    let mut i = 0;
    while i < seen.len() {
        let twin = (i + 1..seen.len()).find(|&j| seen[i].0.distance(seen[j].0) < distance);
        if let Some(j) = twin {
            seen[i].0 = seen[i].0.midpoint(seen[j].0);
            seen.swap_remove(j);
        }
        i += 1;
    }
}

/// Cameras on a circle of 4 m, alternately at 1.2 and 2.6 m height.
fn camera_ring(count: usize) -> Vec<DVec3> {
    let place = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / count as f64;
        let height = if i.is_multiple_of(2) { 2.6 } else { 1.2 };
        DVec3::new(4.0 * angle.cos(), height, 4.0 * angle.sin())
    };
    (0..count).map(place).collect()
}

/// Two cameras are the least that give a position.
fn visible(position: DVec3, cameras: &[DVec3], capsules: &[Capsule]) -> bool {
    // A marker stands off the body that carries it: start the ray a little towards the camera.
    let sees = |camera: &&DVec3| {
        let start = position + (**camera - position).normalize_or_zero() * 0.01;
        !capsules
            .iter()
            .any(|capsule| capsule.blocks(start, **camera))
    };
    cameras.is_empty() || cameras.iter().filter(sees).take(2).count() == 2
}
