//! What the hands do to the rope, with parameters drawn from a seed inside human ranges.

use std::f64::consts::TAU;

use glam::DVec3;

use super::random::Random;

/// How a virtual rope is moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Motion {
    /// A ribbon held at one end and swung in figures of eight, 0.6 to 0.9 a second.
    Ribbon,
    /// A long rope between two turners, 1.0 to 1.3 turns a second.
    Turned,
    /// One person skipping, 1.6 to 2.0 turns a second.
    Skipping,
    /// Strokes of a whip held at one end.
    Whip,
    /// Held at both ends, let go, falling to the floor.
    FreeFall,
}

impl Motion {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Ribbon,
        Self::Turned,
        Self::Skipping,
        Self::Whip,
        Self::FreeFall,
    ];
}

/// Seconds of rest before the motion sets in.
pub(super) const REST: f64 = 0.6;

/// The hands of one take.
#[derive(Clone, Debug)]
pub(super) struct Driver {
    motion: Motion,
    /// Turns or strokes a second.
    rate: f64,
    size: DVec3,
    phases: [f64; 4],
    release: [f64; 2],
    /// Rest positions of the hands.
    anchors: [DVec3; 2],
    drift: DVec3,
}

/// A draught that carries the rope along.
///
/// A slack rope does not follow hands that start to turn at full speed: real turners swing it
/// first. The draught stands for that and has gone when the rope flies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draught {
    /// A point of the axis, which is parallel to X.
    pub(super) axis: DVec3,
    /// Radians a second, from -Y towards +Z.
    pub(super) turning: f64,
    /// How fast the rope takes on the draught's velocity, 1/s.
    pub(super) coupling: f64,
}

impl Draught {
    /// Still air that slows everything down.
    pub(super) fn still(coupling: f64) -> Self {
        Self {
            axis: DVec3::ZERO,
            turning: 0.0,
            coupling,
        }
    }

    /// The same about an axis `scale` times as far from the origin.
    pub(super) fn scaled(self, scale: f64) -> Self {
        Self {
            axis: self.axis * scale,
            ..self
        }
    }

    pub(super) fn acceleration(&self, position: DVec3, velocity: DVec3) -> DVec3 {
        let arm = position - self.axis;
        let wind = DVec3::new(0.0, arm.z, -arm.y) * self.turning;
        (wind - velocity) * self.coupling
    }
}

impl Driver {
    /// `length` is that of the whole rope in metres.
    pub(super) fn new(motion: Motion, tempo: f64, length: f64, random: &mut Random) -> Self {
        let phases = std::array::from_fn(|_| random.range(0.0, TAU));
        let high = DVec3::Y * (length + 0.25).max(1.4);
        let (rate, size, anchors) = match motion {
            Motion::Ribbon => (
                random.range(0.6, 0.9),
                DVec3::new(
                    random.range(0.3, 0.4),
                    random.range(0.1, 0.2),
                    random.range(0.1, 0.25),
                ),
                [high, high],
            ),
            Motion::Turned => {
                let half = DVec3::X * 0.5 * length * random.range(0.74, 0.82);
                let size = random.range(0.10, 0.15);
                let up = DVec3::Y * 1.1;
                (
                    random.range(1.0, 1.3),
                    DVec3::splat(size),
                    [half + up, up - half],
                )
            }
            Motion::Skipping => {
                let half = DVec3::new(random.range(0.36, 0.42), 0.0, 0.0);
                let up = DVec3::new(0.0, 1.05, 0.15);
                let size = random.range(0.07, 0.10);
                (
                    random.range(1.6, 2.0),
                    DVec3::splat(size),
                    [up + half, up - half],
                )
            }
            Motion::Whip => (
                random.range(0.9, 1.3),
                DVec3::new(random.range(0.3, 0.4), random.range(0.05, 0.15), 0.1),
                [high, high],
            ),
            Motion::FreeFall => {
                let half = DVec3::X * 0.5 * length * random.range(0.5, 0.8);
                let up = DVec3::Y * random.range(1.8, 2.1);
                (
                    random.range(0.7, 1.1),
                    DVec3::splat(0.12),
                    [up + half, up - half],
                )
            }
        };
        let first = REST + random.range(1.2, 1.6);
        let release = match motion {
            Motion::FreeFall => [first, first + random.range(0.0, 0.08)],
            _ => [f64::INFINITY; 2],
        };
        let drift = DVec3::new(random.range(0.05, 0.1), random.range(0.02, 0.05), 0.07);
        Self {
            motion,
            rate: rate * tempo,
            size,
            phases,
            release,
            anchors,
            drift,
        }
    }

    /// Radians turned and radians a second at `t`.
    fn turn(&self, t: f64, ramp: f64) -> (f64, f64) {
        let since = (t - REST).max(0.0);
        let full = TAU * self.rate;
        if since < ramp {
            (full * since * since / (2.0 * ramp), full * since / ramp)
        } else {
            (full * (since - 0.5 * ramp), full)
        }
    }

    /// What carries the rope at `t`.
    pub(super) fn draught(&self, t: f64) -> Draught {
        if !matches!(self.motion, Motion::Turned | Motion::Skipping) {
            return Draught::still(0.0);
        }
        let since = t - REST;
        let coupling = 15.0 * (since / 0.3).min((1.8 - since) / 0.8).clamp(0.0, 1.0);
        let axis = self.anchors[0].midpoint(self.anchors[1]);
        Draught {
            axis,
            turning: self.turn(t, 0.8).1,
            coupling,
        }
    }

    /// The held ends at time `t`, first and last node.
    pub(super) fn hands(&self, t: f64) -> [Option<DVec3>; 2] {
        let since = (t - REST).max(0.0);
        let ease = {
            let s = (since / 0.8).min(1.0);
            s * s * (3.0 - 2.0 * s)
        };
        // A hand never repeats itself exactly: a slow wander on top of the figure.
        let wander = |phase: f64| {
            let slow = TAU * 0.23 * t + phase;
            self.drift * DVec3::new(slow.sin(), (1.3 * slow).cos(), (0.7 * slow).sin()) * ease
        };
        let (angle, _) = self.turn(t, 0.8);
        let [p, q, r, s] = self.phases;
        match self.motion {
            Motion::Ribbon => {
                let figure = DVec3::new(
                    (angle + p).sin() - p.sin(),
                    (2.0 * angle + q).sin() - q.sin(),
                    (angle + q).cos() - q.cos(),
                );
                [
                    Some(self.anchors[0] + self.size * figure * ease + wander(p)),
                    None,
                ]
            }
            Motion::Whip => {
                let stroke = (angle.sin() + 0.25 * (2.0 * angle).sin()) * self.size.x;
                let lift = ((2.0 * angle + q).sin() - q.sin()) * self.size.y;
                let aside = ((0.5 * angle + p).sin() - p.sin()) * self.size.z;
                let figure = DVec3::new(stroke, lift, aside) * ease;
                [Some(self.anchors[0] + figure + wander(p)), None]
            }
            Motion::Turned | Motion::Skipping => {
                let circle = |lag: f64| {
                    // The hands lead the rope; that is what keeps it turning.
                    let a = angle + 0.4 + lag;
                    let radius = self.size.x * ease;
                    DVec3::new(0.0, -radius * a.cos(), radius * a.sin())
                };
                [
                    Some(self.anchors[0] + circle(0.0) + wander(r) * 0.4),
                    Some(self.anchors[1] + circle(0.1 * p.sin()) + wander(s) * 0.4),
                ]
            }
            Motion::FreeFall => std::array::from_fn(|end| {
                let p = self.phases[end];
                let swing = DVec3::new(
                    0.3 * ((angle + p).sin() - p.sin()),
                    0.3 * ((angle + 2.0 * p).cos() - (2.0 * p).cos()),
                    (angle + p).sin() - p.sin(),
                );
                (t < self.release[end]).then(|| self.anchors[end] + self.size * swing * ease)
            }),
        }
    }

    /// The hands, and where they rest once they have let go.
    pub(super) fn palms(&self, t: f64) -> [DVec3; 2] {
        let hands = self.hands(t);
        std::array::from_fn(|end| hands[end].unwrap_or(self.anchors[end]))
    }

    /// Whether the second end is held at the start.
    pub(super) fn two_handed(&self) -> bool {
        !matches!(self.motion, Motion::Ribbon | Motion::Whip)
    }
}
