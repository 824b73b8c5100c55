//! A rope as a chain of point masses, stepped by extended position-based dynamics.
//!
//! Many small steps with one constraint solve each (Macklin et al. 2019, *Small Steps in Physics
//! Simulation*). The stretch constraints of a chain couple only neighbours, so each solve is an
//! exact tridiagonal elimination instead of sweeps (Deul et al. 2018, *Direct Position-Based
//! Solver for Stiff Rods*); bending, drag and gravity are explicit forces.

use glam::DVec3;

use super::body::Capsule;
use super::motion::Draught;

/// Density of air at 20 degrees, kg/m3.
const AIR: f64 = 1.2;
/// Drag of a cylinder across and along its axis.
const DRAG_ACROSS: f64 = 1.2;
const DRAG_ALONG: f64 = 0.05;
/// Gravity, m/s2.
pub(super) const GRAVITY: DVec3 = DVec3::new(0.0, -9.81, 0.0);
/// The least steps a second; a slack rope needs no more (the tests hold its frequencies).
const STEPS_PER_SECOND: f64 = 2400.0;
/// Constraint solves and contact passes in one step.
const ROUNDS: usize = 2;

/// What the rope is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RopeModel {
    /// Markers along the rope, at least 2.
    pub markers: usize,
    /// Metres of rope between two markers.
    pub spacing: f64,
    /// Metres of bare rope beyond the first and the last marker.
    pub overhang: f64,
    /// Kilograms a metre.
    pub line_density: f64,
    /// Axial stiffness EA, newtons.
    pub stretch: f64,
    /// Bending stiffness EI, newton square metres.
    pub bend: f64,
    /// Inner friction against bending, newton square metre seconds.
    pub bend_damping: f64,
    /// Metres; what the air and a body touch.
    pub diameter: f64,
    /// Coulomb coefficient of contact.
    pub friction: f64,
}

impl RopeModel {
    /// A 6 mm braided rope: 35 g a metre.
    #[must_use]
    pub const fn braided(markers: usize) -> Self {
        Self {
            markers,
            spacing: 0.1,
            overhang: 0.05,
            line_density: 0.035,
            stretch: 3_000.0,
            bend: 4e-4,
            bend_damping: 2e-6,
            diameter: 0.006,
            friction: 0.3,
        }
    }

    /// Nodes between two markers; the wave that a node spacing of 25 mm carries is far shorter
    /// than what markers at 100 mm can show.
    pub(super) const NODES_PER_SPACING: usize = 4;

    pub(super) fn overhang_nodes(&self) -> usize {
        (self.overhang / self.node_spacing()).round() as usize
    }

    pub(super) fn node_spacing(&self) -> f64 {
        self.spacing / Self::NODES_PER_SPACING as f64
    }

    pub(super) fn node_count(&self) -> usize {
        (self.markers - 1) * Self::NODES_PER_SPACING + 1 + 2 * self.overhang_nodes()
    }

    /// Steps a second at which the explicit forces are stable, with a margin of two.
    ///
    /// The stiffest bending mode has frequency `sqrt(16 EI / (rho h^4))` and decay rate
    /// `16 c / (rho h^4)`; a step must stay below two over each.
    pub(super) fn steps_per_second(&self) -> f64 {
        let inertia = self.line_density * self.node_spacing().powi(4);
        let frequency = (16.0 * self.bend / inertia).sqrt();
        let decay = 16.0 * self.bend_damping / inertia;
        f64::max(STEPS_PER_SECOND, frequency.max(decay))
    }

    /// Node of each marker.
    pub(super) fn marker_node(&self, marker: usize) -> usize {
        self.overhang_nodes() + marker * Self::NODES_PER_SPACING
    }
}

/// The chain's state.
#[derive(Clone, Debug)]
pub(super) struct Rope {
    model: RopeModel,
    pub(super) positions: Vec<DVec3>,
    pub(super) velocities: Vec<DVec3>,
    before: Vec<DVec3>,
    forces: Vec<DVec3>,
    directions: Vec<DVec3>,
    diagonal: Vec<f64>,
    multipliers: Vec<f64>,
    right: Vec<f64>,
}

impl Rope {
    /// At rest in the given shape.
    pub(super) fn new(model: RopeModel, positions: Vec<DVec3>) -> Self {
        let count = positions.len();
        Self {
            model,
            before: positions.clone(),
            positions,
            velocities: vec![DVec3::ZERO; count],
            forces: vec![DVec3::ZERO; count],
            directions: vec![DVec3::ZERO; count.saturating_sub(1)],
            diagonal: vec![0.0; count.saturating_sub(1)],
            multipliers: vec![0.0; count.saturating_sub(1)],
            right: vec![0.0; count.saturating_sub(1)],
        }
    }

    /// One step of `dt` seconds; `held` pins the first and the last node.
    pub(super) fn step(
        &mut self,
        dt: f64,
        held: [Option<DVec3>; 2],
        capsules: &[Capsule],
        draught: &Draught,
    ) {
        let last = self.positions.len() - 1;
        self.external_forces();
        let mass = self.model.line_density * self.model.node_spacing();
        for i in 0..=last {
            let acceleration = GRAVITY
                + self.forces[i] / mass
                + draught.acceleration(self.positions[i], self.velocities[i]);
            self.before[i] = self.positions[i];
            self.velocities[i] += acceleration * dt;
            self.positions[i] += self.velocities[i] * dt;
        }
        let mut inverse_mass = vec![1.0 / mass; last + 1];
        for (node, target) in [(0, held[0]), (last, held[1])] {
            if let Some(target) = target {
                self.positions[node] = target;
                inverse_mass[node] = 0.0;
            }
        }
        self.multipliers.fill(0.0);
        let mut pushes = vec![0.0; last + 1];
        for _ in 0..ROUNDS {
            self.solve_stretch(dt, &inverse_mass);
            self.collide(capsules, &inverse_mass, &mut pushes);
        }
        for (i, &push) in pushes.iter().enumerate() {
            self.velocities[i] = (self.positions[i] - self.before[i]) / dt;
            if push > 0.0 {
                // Coulomb: the tangential speed falls by at most friction times the normal one.
                let speed = self.velocities[i].length();
                let loss = self.model.friction * push / dt;
                self.velocities[i] *= 1.0 - (loss / speed.max(1e-9)).min(1.0);
            }
        }
    }

    /// Bending (discrete curvature energy, Kelvin-Voigt damped) and air drag.
    fn external_forces(&mut self) {
        let h = self.model.node_spacing();
        let count = self.positions.len();
        self.forces.fill(DVec3::ZERO);
        for i in 1..count.saturating_sub(1) {
            let second = |a: &[DVec3]| a[i - 1] - 2.0 * a[i] + a[i + 1];
            let moment = (self.model.bend * second(&self.positions)
                + self.model.bend_damping * second(&self.velocities))
                / (h * h * h);
            self.forces[i - 1] -= moment;
            self.forces[i] += 2.0 * moment;
            self.forces[i + 1] -= moment;
        }
        for i in 0..count {
            let ahead = self.positions[(i + 1).min(count - 1)];
            let tangent = (ahead - self.positions[i.saturating_sub(1)]).normalize_or_zero();
            let along = tangent * tangent.dot(self.velocities[i]);
            let across = self.velocities[i] - along;
            let area = 0.5 * AIR * self.model.diameter * h;
            self.forces[i] -= area
                * (DRAG_ACROSS * across.length() * across + DRAG_ALONG * along.length() * along);
        }
    }

    /// One Newton step on all stretch constraints: a tridiagonal system in the multipliers.
    fn solve_stretch(&mut self, dt: f64, inverse_mass: &[f64]) {
        let h = self.model.node_spacing();
        let compliance = h / self.model.stretch / (dt * dt);
        let segments = self.directions.len();
        for k in 0..segments {
            let d = self.positions[k + 1] - self.positions[k];
            let length = d.length();
            self.directions[k] = d / length.max(1e-12);
            self.right[k] = -(length - h) - compliance * self.multipliers[k];
            self.diagonal[k] = inverse_mass[k] + inverse_mass[k + 1] + compliance;
        }
        // Forward elimination, then back substitution (Thomas).
        for (k, mass) in inverse_mass.iter().enumerate().take(segments).skip(1) {
            let off = -mass * self.directions[k - 1].dot(self.directions[k]);
            let factor = off / self.diagonal[k - 1];
            self.diagonal[k] -= factor * off;
            self.right[k] -= factor * self.right[k - 1];
        }
        for k in (0..segments).rev() {
            let mut value = self.right[k];
            if k + 1 < segments {
                let off = -inverse_mass[k + 1] * self.directions[k].dot(self.directions[k + 1]);
                value -= off * self.right[k + 1];
            }
            self.right[k] = value / self.diagonal[k];
        }
        for k in 0..segments {
            let step = self.right[k];
            self.multipliers[k] += step;
            self.positions[k] -= self.directions[k] * (step * inverse_mass[k]);
            self.positions[k + 1] += self.directions[k] * (step * inverse_mass[k + 1]);
        }
    }

    /// Pushes nodes out of the floor (y = 0) and of the capsules.
    fn collide(&mut self, capsules: &[Capsule], inverse_mass: &[f64], pushes: &mut [f64]) {
        let radius = 0.5 * self.model.diameter;
        for (i, position) in self.positions.iter_mut().enumerate() {
            if inverse_mass[i] == 0.0 {
                continue;
            }
            if position.y < radius {
                pushes[i] += radius - position.y;
                position.y = radius;
            }
            for capsule in capsules {
                let away = *position - capsule.nearest_on_axis(*position);
                let reach = capsule.radius + radius;
                let distance = away.length();
                if distance < reach && distance > 1e-9 {
                    pushes[i] += reach - distance;
                    *position += away * ((reach - distance) / distance);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hang(model: RopeModel, seconds: f64, damping: f64) -> Rope {
        let h = model.node_spacing();
        let top = DVec3::new(0.0, 3.0, 0.0);
        let nodes = (0..model.node_count()).map(|i| top - DVec3::Y * h * i as f64);
        let mut rope = Rope::new(model, nodes.collect());
        let dt = 1.0 / 2400.0;
        for _ in 0..(seconds / dt) as usize {
            rope.step(dt, [Some(top), None], &[], &Draught::still(damping));
        }
        rope
    }

    #[test]
    fn hanging_rope_stretches_by_its_weight() {
        // Extension of a hanging bar: w L^2 / (2 EA) with w the weight a metre.
        let model = RopeModel {
            stretch: 100.0,
            ..RopeModel::braided(11)
        };
        let rope = hang(model, 3.0, 5.0);
        let length = model.node_spacing() * (model.node_count() - 1) as f64;
        let expected = model.line_density * 9.81 * length * length / (2.0 * model.stretch);
        let bottom = 3.0 - rope.positions.last().unwrap().y;
        assert!(
            (bottom - length - expected).abs() < 0.05 * expected,
            "{}",
            bottom - length
        );
    }

    #[test]
    fn hanging_rope_swings_at_the_bessel_frequency() {
        // A hanging chain's lowest mode: omega = 2.4048 / 2 * sqrt(g / L) (Bernoulli 1732).
        let model = RopeModel {
            bend: 0.0,
            bend_damping: 0.0,
            diameter: 0.0,
            ..RopeModel::braided(11)
        };
        let mut rope = hang(model, 0.1, 5.0);
        let length = model.node_spacing() * (model.node_count() - 1) as f64;
        for (i, v) in rope.velocities.iter_mut().enumerate() {
            *v = DVec3::X * 0.02 * i as f64 / (model.node_count() - 1) as f64;
        }
        let expected = std::f64::consts::TAU / (1.2024 * (9.81 / length).sqrt());
        let dt = 1.0 / 2400.0;
        let (mut crossings, mut last_x, mut t) = (Vec::new(), 0.0, 0.0);
        while crossings.len() < 5 && t < 10.0 {
            rope.step(
                dt,
                [Some(DVec3::new(0.0, 3.0, 0.0)), None],
                &[],
                &Draught::still(0.0),
            );
            t += dt;
            let x: f64 = rope.positions.iter().map(|p| p.x).sum();
            if last_x < 0.0 && x >= 0.0 {
                crossings.push(t);
            }
            last_x = x;
        }
        let period = (crossings[4] - crossings[0]) / 4.0;
        assert!(
            (period - expected).abs() < 0.03 * expected,
            "{period} {expected}"
        );
    }

    #[test]
    fn rope_rests_on_a_capsule() {
        let model = RopeModel::braided(11);
        let h = model.node_spacing();
        let half = 0.5 * h * (model.node_count() - 1) as f64;
        let nodes = (0..model.node_count()).map(|i| DVec3::new(h * i as f64 - half, 1.0, 0.0));
        let mut rope = Rope::new(model, nodes.collect());
        let bar = Capsule {
            a: DVec3::new(0.0, 0.9, -1.0),
            b: DVec3::new(0.0, 0.9, 1.0),
            radius: 0.05,
        };
        for _ in 0..4800 {
            rope.step(1.0 / 2400.0, [None, None], &[bar], &Draught::still(0.5));
        }
        let nearest = rope
            .positions
            .iter()
            .map(|p| p.distance(bar.nearest_on_axis(*p)))
            .fold(f64::INFINITY, f64::min);
        assert!((nearest - 0.053).abs() < 0.002, "{nearest}");
        assert!(rope.positions[0].y < 0.7, "the ends hang down");
    }
}
