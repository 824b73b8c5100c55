//! Flesh: muscles that bulge, breath, and soft parts that lag behind.
//!
//! Enters: a body and a performance. Leaves: modes, each a fixed field of offsets on the rest
//! shape, and one amplitude a mode and frame. The skin moves the rest shape plus offsets, so a
//! mode turns with the limb that it sits on. Nothing here is fitted to data: the shapes and sizes
//! are of the order that film and ultrasound show, and serve as a truth that is known.

mod mode;
mod muscles;
mod soft;

use glam::DVec3;

use super::anatomy::Anatomy;
use super::performance::Performance;
use super::random::Random;
use super::{StudioError, error::within};
use crate::model::Avatar;
use mode::Region;
use muscles::Muscle;
use soft::Soft;

pub use mode::Mode;

/// How much of everything there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FleshOptions {
    /// Size of muscle bulges; 1 is a trained man.
    pub muscle: f64,
    /// Depth of breath; 1 is after exercise.
    pub breath: f64,
    /// Softness of belly, chest, buttocks and limbs; 1 is a heavy person.
    pub jiggle: f64,
    /// Breaths a second.
    pub breath_rate: f64,
    /// No vertex is moved further, metres on a body of 1.73 m.
    pub limit: f64,
    /// Phases of the breath follow from it.
    pub seed: u64,
}

impl Default for FleshOptions {
    fn default() -> Self {
        Self {
            muscle: 1.0,
            breath: 1.0,
            jiggle: 1.0,
            breath_rate: 0.35,
            limit: 0.028,
            seed: 0,
        }
    }
}

/// The flesh of one body.
#[derive(Clone, Debug)]
pub struct Flesh {
    options: FleshOptions,
    modes: Vec<Mode>,
    muscles: Vec<Muscle>,
    breaths: usize,
    softs: Vec<Soft>,
    /// Metres.
    limit: f64,
    vertex_count: usize,
}

impl Flesh {
    /// Finds muscles, lungs and soft parts on a body; bones alone where it is not human, or where
    /// limbs are missing, for these. O(vertices x modes)
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn new(avatar: &Avatar, options: FleshOptions) -> Result<Self, StudioError> {
        for (name, value) in [
            ("muscle", options.muscle),
            ("breath", options.breath),
            ("jiggle", options.jiggle),
        ] {
            within(name, value, 0.0, 3.0, "between 0 and 3")?;
        }
        within(
            "breath rate",
            options.breath_rate,
            0.0,
            2.0,
            "between 0 and 2 a second",
        )?;
        within(
            "flesh limit",
            options.limit,
            1e-6,
            0.1,
            "between 1e-6 and 0.1 m",
        )?;
        let mut flesh = Self {
            options,
            modes: Vec::new(),
            muscles: Vec::new(),
            breaths: 0,
            softs: Vec::new(),
            limit: options.limit,
            vertex_count: avatar.mesh.positions.len(),
        };
        let Ok(anatomy) = Anatomy::new(avatar) else {
            return Ok(flesh);
        };
        flesh.limit *= anatomy.scale;
        let size = anatomy.scale;
        for (muscle, region) in muscles::of(&anatomy, avatar) {
            flesh.modes.push(region.directed(&muscle.name));
            flesh.muscles.push(muscle);
        }
        for (name, region) in breath_regions(&anatomy, avatar) {
            flesh.modes.push(region.directed(name));
            flesh.breaths += 1;
        }
        for (soft, region) in soft::of(&anatomy, avatar) {
            for (axis, letter) in [(DVec3::X, 'x'), (DVec3::Y, 'y'), (DVec3::Z, 'z')] {
                flesh
                    .modes
                    .push(region.along(axis, &format!("{} {letter}", soft.name)));
            }
            flesh.softs.push(soft);
        }
        for muscle in &mut flesh.muscles {
            muscle.resize(size * options.muscle);
        }
        for soft in &mut flesh.softs {
            soft.resize(size, options.jiggle);
        }
        Ok(flesh)
    }

    /// All modes, in the order of the amplitudes.
    #[must_use]
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }

    /// Amplitudes `[frames x modes]` in metres, at `rate` frames a second from time 0.
    ///
    /// Springs are integrated in steps of at most 1/480 s, whatever the frame rate. O(frames x
    /// joints)
    #[must_use]
    pub fn amplitudes(
        &self,
        performance: &Performance<'_>,
        rate: f64,
        frame_count: usize,
    ) -> Vec<f64> {
        let anatomy_scale = self.limit / self.options.limit;
        let mut out = Vec::with_capacity(frame_count * self.modes.len());
        let phase = Random::new(self.options.seed ^ 0xB4EA_7400).unit();
        let mut springs: Vec<_> = self
            .softs
            .iter()
            .map(|soft| soft.at_rest(performance))
            .collect();
        let substeps = (480.0 / rate).ceil().max(1.0) as usize;
        let step = 1.0 / rate / substeps as f64;
        for frame in 0..frame_count {
            let seconds = frame as f64 / rate;
            let pose = performance.pose(seconds);
            out.extend(self.muscles.iter().map(|muscle| muscle.amplitude(&pose)));
            let chest = breath(self.options.breath_rate * seconds + phase);
            let belly = breath(self.options.breath_rate * seconds + phase - 0.08);
            let depth = self.options.breath * anatomy_scale;
            out.extend(
                [chest * 0.010 * depth, belly * 0.012 * depth]
                    .iter()
                    .take(self.breaths),
            );
            for spring in &springs {
                out.extend(spring.amplitude().to_array());
            }
            for part in 1..=substeps {
                let at = seconds + part as f64 * step;
                let pose = performance.pose(at);
                for spring in &mut springs {
                    spring.step(&pose, step);
                }
            }
        }
        out
    }

    /// Offsets `[vertices]` on the rest shape, metres, for the amplitudes of one frame. Old
    /// contents of `offsets` do not matter. O(vertices moved)
    ///
    /// # Panics
    /// If there are not as many amplitudes as modes.
    pub fn offsets(&self, amplitudes: &[f64], offsets: &mut Vec<DVec3>) {
        assert_eq!(amplitudes.len(), self.modes.len(), "one amplitude a mode");
        offsets.clear();
        offsets.resize(self.vertex_count, DVec3::ZERO);
        for (mode, &amplitude) in self.modes.iter().zip(amplitudes) {
            for &(vertex, direction) in &mode.offsets {
                offsets[vertex as usize] += amplitude * direction;
            }
        }
        for offset in offsets.iter_mut() {
            *offset = bounded(*offset, self.limit);
        }
    }
}

/// Shortened so that it never reaches `limit`; hardly so below half of it.
fn bounded(offset: DVec3, limit: f64) -> DVec3 {
    let share = offset.length() / limit;
    if share < 0.3 {
        return offset;
    }
    offset / (1.0 + share.powi(6)).powf(1.0 / 6.0)
}

/// A breath from 0 to 1 to 0; out takes longer than in.
fn breath(cycles: f64) -> f64 {
    let phase = cycles.rem_euclid(1.0);
    let warped = if phase < 0.4 {
        phase / 0.8
    } else {
        0.5 + (phase - 0.4) / 1.2
    };
    (1.0 - (std::f64::consts::TAU * warped).cos()) / 2.0
}

/// Where breath moves the trunk: ribs, then abdomen.
fn breath_regions(anatomy: &Anatomy, avatar: &Avatar) -> Vec<(&'static str, Region)> {
    let trunk = anatomy.trunk(avatar);
    let hips = anatomy.at(anatomy.human.hips);
    let thorax = anatomy.at(anatomy.thorax());
    let length = (thorax - hips).dot(anatomy.up);
    let region = |centre: f64, half: f64| {
        Region::over(avatar, |vertex, position, normal| {
            let height = (position - hips).dot(anatomy.up) / length;
            let side = normal.dot(anatomy.front) * 0.6 + 0.4;
            let weight = mode::bump((height - centre) / half) * trunk[vertex];
            normal * (weight * side.max(0.0))
        })
    };
    vec![("ribs", region(0.95, 0.6)), ("abdomen", region(0.42, 0.5))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_and_leave_small_offsets_alone() {
        let limit = 0.028;
        assert_eq!(bounded(DVec3::X * 0.008, limit), DVec3::X * 0.008);
        assert!((bounded(DVec3::X * 0.014, limit).x - 0.014).abs() < 5e-5);
        assert!(bounded(DVec3::Y * 1e3, limit).y <= limit * (1.0 + 1e-12));
        assert_eq!(bounded(DVec3::ZERO, limit), DVec3::ZERO);
    }

    #[test]
    fn a_breath_goes_in_and_out() {
        assert_eq!([breath(0.0), breath(3.0)], [0.0, 0.0]);
        assert!((breath(0.4) - 1.0).abs() < 1e-12, "full after two fifths");
        assert!((breath(0.2) - 0.5).abs() < 1e-12 && (breath(0.7) - 0.5).abs() < 1e-12);
    }
}
