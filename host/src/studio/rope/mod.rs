//! A virtual rope: simulated, filmed by a marker system, with the truth kept.
//!
//! [`Scene::film`] gives a [`Take`]: where every marker of the rope and of the people around it
//! really was. [`Take::capture`] gives what a capture system would hand on: unlabelled points in
//! no order, with noise, drop-outs, occlusion, merged and ghost points, and the label that each
//! point should have had.

mod body;
mod capture;
mod columns;
mod held;
mod motion;
mod physics;
mod skip;

use glam::DVec3;

pub use body::{BODY_MARKERS, Capsule, Person};
pub use capture::{Capture, CaptureFrame, Disturbance, Label};
pub use held::{Grip, HeldRope, hold};
pub use motion::Motion;
pub use physics::RopeModel;
pub use skip::skipping;

use super::random::{self, Random};
use body::Stance;
use motion::{Draught, Driver};
use physics::Rope;

/// A scene that cannot be filmed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A number is not finite or out of its range.
    #[error("{name} is {value}; it must be {range}")]
    OutOfRange {
        /// Field.
        name: &'static str,
        /// What it holds.
        value: f64,
        /// What it may hold.
        range: &'static str,
    },
    /// A body without the limbs that hold or jump.
    #[error("no human body with arms, hands and legs is recognised by the names of its joints")]
    NoHuman,
    /// The simulation became unstable.
    #[error("the rope flew apart after {seconds:.3} s; use a heavier or less stiff rope")]
    Unstable {
        /// Time in the take.
        seconds: f64,
    },
}

/// A rope, what moves it and how long it is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// The rope.
    pub model: RopeModel,
    /// What happens to it.
    pub motion: Motion,
    /// 1 is brisk; 0.6 a moderate swing. Scales turns and strokes a second.
    pub tempo: f64,
    /// Frames a second.
    pub rate: f64,
    /// Seconds; the first 0.6 are rest.
    pub seconds: f64,
    /// Whether the people who move the rope are there: touched by it, seen by the cameras.
    pub people: bool,
    /// Everything that varies follows from it.
    pub seed: u64,
}

/// The truth of a take.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][markers]`, metres, in order along the rope.
    pub rope: Vec<Vec<DVec3>>,
    /// `[frames][body markers]`, metres; empty lists without people.
    pub body: Vec<Vec<DVec3>>,
    /// `[frames][capsules]`; empty lists without people.
    pub capsules: Vec<Vec<Capsule>>,
    seed: u64,
}

/// Middle of a standing person's feet along Z, metres.
const FEET: f64 = 0.05;
/// Frames that one take may hold.
const MOST_FRAMES: f64 = 100_000.0;

impl Scene {
    /// A braided rope of the usual length for `motion`, filmed at 100 Hz.
    #[must_use]
    pub fn new(motion: Motion, seed: u64) -> Self {
        let model = match motion {
            Motion::Ribbon => RopeModel {
                line_density: 0.025,
                ..RopeModel::braided(16)
            },
            Motion::Turned => RopeModel {
                line_density: 0.06,
                diameter: 0.008,
                ..RopeModel::braided(31)
            },
            Motion::Skipping => RopeModel {
                line_density: 0.05,
                diameter: 0.005,
                ..RopeModel::braided(25)
            },
            Motion::Whip => RopeModel {
                line_density: 0.06,
                bend: 1.5e-3,
                ..RopeModel::braided(16)
            },
            Motion::FreeFall => RopeModel::braided(20),
        };
        let seconds = if motion == Motion::FreeFall { 3.5 } else { 6.0 };
        Self {
            model,
            motion,
            tempo: 1.0,
            rate: 100.0,
            seconds,
            people: false,
            seed,
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        let m = &self.model;
        let rules: [(&'static str, f64, f64, f64, &'static str); 11] = [
            ("markers", m.markers as f64, 2.0, 200.0, "between 2 and 200"),
            ("spacing", m.spacing, 0.02, 1.0, "between 0.02 and 1 m"),
            ("overhang", m.overhang, 0.0, 1.0, "between 0 and 1 m"),
            (
                "line_density",
                m.line_density,
                0.002,
                10.0,
                "between 0.002 and 10 kg/m",
            ),
            ("stretch", m.stretch, 1.0, 1e7, "between 1 and 1e7 N"),
            ("bend", m.bend, 0.0, 0.1, "between 0 and 0.1 N m2"),
            (
                "bend_damping",
                m.bend_damping,
                0.0,
                1e-3,
                "between 0 and 0.001 N m2 s",
            ),
            ("diameter", m.diameter, 0.0, 0.1, "between 0 and 0.1 m"),
            ("tempo", self.tempo, 0.1, 3.0, "between 0.1 and 3"),
            ("rate", self.rate, 1.0, 1e4, "between 1 and 10,000 Hz"),
            (
                "seconds",
                self.seconds,
                0.0,
                MOST_FRAMES / self.rate.max(1.0),
                "at most 100,000 frames",
            ),
        ];
        for (name, value, low, high, range) in rules {
            if !(low..=high).contains(&value) {
                return Err(SceneError::OutOfRange { name, value, range });
            }
        }
        Ok(())
    }

    /// Simulates the take.
    ///
    /// # Errors
    /// A parameter out of its range, or a simulation that did not stay finite.
    pub fn film(&self) -> Result<Take, SceneError> {
        self.check()?;
        if !(self.people && self.motion == Motion::Skipping) {
            return self.run(self.people, 1.0, &|_| 0.0);
        }
        // A skipper jumps when the rope comes: find out when it does, then let them meet.
        let passes = self.passes(1.0)?;
        self.run(true, 1.0, &|t| jump(&passes, t))
    }

    /// When the rope passes below the feet, seconds, if nobody stands there; hands are `scale`
    /// times as high and as far apart as the driver has them.
    fn passes(&self, scale: f64) -> Result<Vec<f64>, SceneError> {
        let alone = self.run(false, scale, &|_| 0.0)?;
        let middle = self.model.markers / 2;
        let below = |(frame, w): (usize, &[Vec<DVec3>])| {
            let (from, to) = (w[0][middle], w[1][middle]);
            let feet = FEET * scale;
            let meets = from.z < feet && to.z >= feet && from.y.min(to.y) < 0.3 * scale;
            let part = (feet - from.z) / (to.z - from.z);
            meets.then(|| (frame as f64 + part) / self.rate)
        };
        let times = alone.rope.windows(2).enumerate().filter_map(below);
        Ok(times.filter(|t| *t > motion::REST + 0.3).collect())
    }

    fn driver(&self) -> Driver {
        let length = self.model.node_spacing() * (self.model.node_count() - 1) as f64;
        Driver::new(self.motion, self.tempo, length, &mut Random::new(self.seed))
    }

    /// The people at time `t`: a skipper, or one person behind each end that is held.
    fn stand(&self, driver: &Driver, t: f64, lift: f64) -> Vec<Person> {
        let hands = driver.palms(t);
        if self.motion == Motion::Skipping {
            return vec![Person::new(&Stance {
                ground: DVec3::ZERO,
                lift,
                hands,
            })];
        }
        let rest = driver.palms(0.0);
        let ends = if driver.two_handed() { 2 } else { 1 };
        let one = |end: usize| {
            let side = if end == 0 { 1.0 } else { -1.0 };
            let ground = DVec3::new(rest[end].x + 0.25 * side, 0.0, rest[end].z - 0.35);
            let idle = ground + DVec3::new(0.3 * side, 0.85, 0.05);
            let hands = if end == 0 {
                [idle, hands[0]]
            } else {
                [hands[1], idle]
            };
            Person::new(&Stance {
                ground,
                lift: 0.01 * (t * 2.1).sin(),
                hands,
            })
        };
        (0..ends).map(one).collect()
    }

    fn run(&self, people: bool, scale: f64, lift: &dyn Fn(f64) -> f64) -> Result<Take, SceneError> {
        let driver = self.driver();
        let hands = |t: f64| driver.hands(t).map(|hand| hand.map(|place| place * scale));
        let mut rope = self.settled(hands(0.0));
        let steps = (self.model.steps_per_second() / self.rate).ceil() as usize;
        let dt = 1.0 / (self.rate * steps as f64);
        let frames = (self.seconds * self.rate) as usize;
        let mut take = Take {
            rate: self.rate,
            rope: Vec::with_capacity(frames),
            body: Vec::with_capacity(frames),
            capsules: Vec::with_capacity(frames),
            seed: self.seed,
        };
        let stand = |driver: &Driver, t: f64| {
            if people {
                self.stand(driver, t, lift(t))
            } else {
                Vec::new()
            }
        };
        for frame in 0..frames {
            let now = frame as f64 / self.rate;
            let persons = stand(&driver, now);
            let markers =
                (0..self.model.markers).map(|m| rope.positions[self.model.marker_node(m)]);
            take.rope.push(markers.collect());
            take.body
                .push(persons.iter().flat_map(Person::markers).collect());
            take.capsules
                .push(persons.into_iter().flat_map(|p| p.capsules).collect());
            for step in 1..=steps {
                let t = now + step as f64 * dt;
                let capsules = Self::touched(stand(&driver, t));
                rope.step(dt, hands(t), &capsules, &driver.draught(t).scaled(scale));
            }
            if rope
                .velocities
                .iter()
                .any(|v| !v.is_finite() || v.length() > 300.0)
            {
                return Err(SceneError::Unstable { seconds: now });
            }
        }
        Ok(take)
    }

    /// A hand holds the rope: the forearms do not push it away.
    fn touched(people: Vec<Person>) -> Vec<Capsule> {
        let arms = 3..7;
        people
            .into_iter()
            .flat_map(|p| p.capsules.into_iter().enumerate())
            .filter(|(part, _)| !arms.contains(part))
            .map(|(_, capsule)| capsule)
            .collect()
    }

    /// The rope at rest before the take.
    fn settled(&self, hands: [Option<DVec3>; 2]) -> Rope {
        let count = self.model.node_count();
        let h = self.model.node_spacing();
        let first = hands[0].unwrap_or(DVec3::Y);
        let nodes = (0..count).map(|i| match hands[1] {
            // A V between the hands has the rope's length; the settling rounds it.
            Some(other) => {
                let half = 0.5 * h * (count - 1) as f64;
                let across = 0.5 * first.distance(other);
                let depth = (half * half - across * across).max(0.0).sqrt();
                let s = i as f64 / (count - 1) as f64;
                first.lerp(other, s) - DVec3::Y * depth * (1.0 - (2.0 * s - 1.0).abs())
            }
            None => first - DVec3::Y * h * i as f64,
        });
        let mut rope = Rope::new(self.model, nodes.collect());
        let dt = 1.0 / self.model.steps_per_second();
        for step in 0..(3.0 / dt) as usize {
            let damping = if step as f64 * dt < 2.5 { 6.0 } else { 2.0 };
            rope.step(dt, hands, &[], &Draught::still(damping));
        }
        rope
    }
}

/// Hip lift at `t`: a crouch, then a flight of a quarter of a second about each pass of the rope.
fn jump(passes: &[f64], t: f64) -> f64 {
    const HALF_FLIGHT: f64 = 0.15;
    const HEIGHT: f64 = 0.11;
    let nearest = passes
        .iter()
        .map(|p| (t - p).abs())
        .fold(f64::INFINITY, f64::min);
    let s = nearest / HALF_FLIGHT;
    if s < 1.0 {
        HEIGHT * (1.0 - s * s)
    } else {
        let crouch = (1.0 - ((s - 1.5) / 0.5).abs()).max(0.0);
        -0.04 * crouch
    }
}
