//! Weights of corrective morph targets from a skeleton in motion.

use glam::{DAffine3, DMat3, DVec3};
use sinew_core::deform::parts::{Corrective, PART_FEATURES};

/// What flesh remembers of one part: where its pivot was, how fast it went, its springs.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    place: DVec3,
    velocity: Option<DVec3>,
    /// Place and speed.
    springs: [[DVec3; 2]; 2],
}

/// Predicts the weights of an asset's last morph targets, frame after frame.
#[derive(Clone, Debug)]
pub struct Flesh<'a> {
    corrective: Corrective<'a>,
    parts: Vec<Part>,
    started: bool,
}

impl<'a> Flesh<'a> {
    /// At rest.
    #[must_use]
    pub fn new(corrective: Corrective<'a>) -> Self {
        Self {
            parts: vec![Part::default(); corrective.part_count()],
            corrective,
            started: false,
        }
    }

    /// Weights `[modes]` of a frame `seconds` after the last: `palette` `[binds]`, rigid, from the
    /// rest pose. O(terms)
    pub fn step(&mut self, palette: &[DAffine3], seconds: f64) -> Vec<f64> {
        let tables = *self.corrective.tables();
        let frame = |part: usize| palette[usize::from(tables.binds[part])];
        let mut features = Vec::with_capacity(self.parts.len() * PART_FEATURES + 1);
        for (at, part) in self.parts.iter_mut().enumerate() {
            let own = frame(at);
            let back = own.matrix3.transpose();
            let bend = match tables.parents.get(usize::from(tables.parents[at])) {
                Some(_) => bend(frame(usize::from(tables.parents[at])).matrix3, own.matrix3),
                None => DVec3::ZERO,
            };
            features.extend(bend.to_array());
            let [x, y, z] = bend.to_array();
            features.extend([x * x, y * y, z * z, x * y, y * z, z * x]);
            features.extend((back * DVec3::NEG_Y).to_array());
            let pivot = DVec3::from_array(tables.pivots[at].map(f64::from));
            let now = own.transform_point3(pivot);
            let acceleration = part.accelerate(now, seconds, !self.started);
            let gravity = DVec3::new(0.0, -9.81, 0.0);
            let pull = back * (gravity - acceleration) - gravity;
            for (spring, &numbers) in part.springs.iter_mut().zip(&tables.springs[at]) {
                let [frequency, damping] = numbers.map(f64::from);
                if self.started {
                    swing(spring, pull, (frequency, damping), seconds);
                } else {
                    *spring = [pull / (frequency * frequency), DVec3::ZERO];
                }
                let bounded = spring[0].clamp(DVec3::splat(-0.1), DVec3::splat(0.1));
                let inside = bounded.cmpeq(spring[0]);
                *spring = [bounded, DVec3::select(inside, spring[1], DVec3::ZERO)];
                features.extend(bounded.to_array());
            }
        }
        features.push(1.0);
        self.started = true;
        let weight = |(mode, range): (usize, &[f32; 2])| {
            let terms = tables.starts[mode] as usize..tables.starts[mode + 1] as usize;
            let of = |at: usize| {
                f64::from(tables.coefficients[at]) * features[usize::from(tables.features[at])]
            };
            let sum: f64 = terms.map(of).sum();
            sum.clamp(range[0].into(), range[1].into())
        };
        tables.ranges.iter().enumerate().map(weight).collect()
    }
}

impl Part {
    fn accelerate(&mut self, now: DVec3, seconds: f64, starts: bool) -> DVec3 {
        let velocity = (now - self.place) / seconds;
        self.place = now;
        if starts {
            self.velocity = None;
            return DVec3::ZERO;
        }
        // What moves faster was put elsewhere.
        let jumped = velocity.abs().cmpgt(DVec3::splat(25.0));
        let last = self.velocity.unwrap_or(velocity);
        let velocity = DVec3::select(jumped, last, velocity);
        self.velocity = Some(velocity);
        let most = DVec3::splat(80.0);
        ((velocity - last) / seconds).clamp(-most, most)
    }
}

/// The trapezoidal rule in two steps.
fn swing([place, speed]: &mut [DVec3; 2], pull: DVec3, spring: (f64, f64), seconds: f64) {
    let (frequency, damping) = spring;
    let (step, stiffness) = (seconds / 2.0, frequency * frequency);
    for _ in 0..2 {
        let held = damping * frequency * step + stiffness * step * step / 4.0;
        let before = *speed;
        *speed = (before * (1.0 - held) + step * (pull - stiffness * *place)) / (1.0 + held);
        *place += step * (before + *speed) / 2.0;
    }
}

/// Sine of half the angle times the axis of the turn from one rotation to another.
fn bend(above: DMat3, own: DMat3) -> DVec3 {
    let turn = above.transpose() * own;
    let size = turn.determinant().abs().cbrt();
    let turn = turn * (1.0 / size);
    let trace = turn.x_axis.x + turn.y_axis.y + turn.z_axis.z;
    let twice_sine = DVec3::new(
        turn.y_axis.z - turn.z_axis.y,
        turn.z_axis.x - turn.x_axis.z,
        turn.x_axis.y - turn.y_axis.x,
    );
    twice_sine / (2.0 * (1.0 + trace).max(0.04).sqrt())
}
