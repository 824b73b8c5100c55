//! When the feet of a motion stand on the floor.

use std::ops::Range;

use glam::DVec3;

use crate::fit::Side;
use crate::fit::humanoid::{Humanoid, Part};
use crate::model::Motion;
use crate::reference::pose::sample;

/// Slower than this, metres a second on a leg of [`LEG`], a point stands...
const STILL: f64 = 0.22;
/// ... if it is not higher above its usual lowest place than this, metres on a leg of [`LEG`].
const LOW: f64 = 0.035;
/// Once it stands, it may exceed both by this factor.
const HOLDING: f64 = 1.6;
/// Hip to ankle of a body of 1.75 m, metres.
const LEG: f64 = 0.83;
/// Shorter contacts are none, shorter breaks are bridged, seconds.
const SHORTEST: f64 = 0.1;
const BREAK: f64 = 0.06;
/// Speeds are differences over so much time to either side, seconds.
const WINDOW: f64 = 0.025;
/// Share of frames in which a point is at its lowest.
const LOWEST: f64 = 0.1;

/// Contacts of one foot, frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// The heel, by the ankle.
    pub heel: Vec<Range<usize>>,
    /// The ball, by the joint of the toes; the ankle's where the skeleton has none.
    pub ball: Vec<Range<usize>>,
}

impl Contacts {
    /// Whether heel and ball stand in a frame.
    #[must_use]
    pub fn at(&self, frame: usize) -> [bool; 2] {
        [&self.heel, &self.ball].map(|all| all.iter().any(|range| range.contains(&frame)))
    }
}

/// Finds when heel and ball of a foot stand, from their speed and height. O(frames x joints)
#[must_use]
pub fn contacts(motion: &Motion, human: &Humanoid, side: Side, times: &[f64]) -> Contacts {
    let Some(foot) = human.limb(side, Part::Foot) else {
        return Contacts::default();
    };
    let ball = human.limb(side, Part::Toes).unwrap_or(foot);
    let rest = motion.skeleton.model(&motion.skeleton.rest());
    let leg = [Part::UpperLeg, Part::LowerLeg, Part::Foot];
    let leg = leg.map(|part| {
        human
            .limb(side, part)
            .map_or(DVec3::ZERO, |at| rest[at].translation)
    });
    let leg = leg[0].distance(leg[1]) + leg[1].distance(leg[2]);
    let mut ways: [Vec<DVec3>; 2] = [Vec::new(), Vec::new()];
    for &time in times {
        let local = sample(&motion.skeleton, &motion.clip, time);
        let model = motion.skeleton.model(&local);
        for (way, joint) in ways.iter_mut().zip([foot, ball]) {
            way.push(model[joint].translation);
        }
    }
    let [heel, ball] = ways.map(|way| standing(&way, times, leg / LEG));
    Contacts { heel, ball }
}

fn standing(way: &[DVec3], times: &[f64], size: f64) -> Vec<Range<usize>> {
    let mut heights: Vec<f64> = way.iter().map(|at| at.y).collect();
    heights.sort_by(f64::total_cmp);
    let Some(&floor) = heights.get((heights.len() as f64 * LOWEST) as usize) else {
        return Vec::new();
    };
    let last = times.len() - 1;
    let speed = |frame: usize| {
        let reach = |sign: f64| {
            let at = times.partition_point(|&time| time < times[frame] + sign * WINDOW - 1e-9);
            at.min(last)
        };
        let (from, to) = (
            reach(-1.0).min(frame.saturating_sub(1)),
            reach(1.0).max(frame + 1),
        );
        let to = to.min(last);
        let seconds = times[to] - times[from];
        if seconds > 0.0 {
            way[from].distance(way[to]) / seconds
        } else {
            0.0
        }
    };
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut holding = false;
    for frame in 0..way.len() {
        let slack = if holding { HOLDING } else { 1.0 };
        holding = speed(frame) < slack * STILL * size && way[frame].y - floor < slack * LOW * size;
        if !holding {
            continue;
        }
        match found.last_mut() {
            Some(open) if times[frame] - times[open.end - 1] <= BREAK => open.end = frame + 1,
            _ => found.push(frame..frame + 1),
        }
    }
    found.retain(|range| times[range.end - 1] - times[range.start] >= SHORTEST);
    found
}
