//! Everything that is not the rope: a person's markers, mostly.
//!
//! A point that was followed as something else while a trace was being measured cannot be that
//! trace's marker, however well it lies. So the points that no trace takes are followed too, each
//! by its own velocity to the nearest point; what a collision swaps is thus told apart by history.

use glam::Vec3;

use super::points::{NONE, Points};
use super::vector::dot;
use crate::row::Row;

/// How far from its prediction a body's marker may appear, metres: noise, and an acceleration in
/// metres a second squared between two frames.
const NEAR: f32 = 0.01;
const JERK: f32 = 60.0;
/// Farther for each frame it was hidden, metres.
const HIDDEN: f32 = 0.004;
/// Price of a point that has been followed as something else since before the trace could have
/// lost its own: more than that of a missing one.
const COST_OTHER: f32 = 16.0;
/// Below this distance, metres, neither expectation says anything.
const RIVAL_NOISE: f32 = 0.005;
/// Seconds that a hidden one is remembered.
const MEMORY: f32 = 0.15;

#[derive(Clone, Copy, Debug)]
struct Other {
    position: Vec3,
    velocity: Vec3,
    /// Frames since it first appeared.
    age: u16,
    hidden: u16,
    /// Its point in this frame.
    point: u16,
}

/// A point's history: frames, 0 for none, and the squared distance from where it was expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Claim {
    age: u16,
    square: f32,
}

#[derive(Clone, Debug)]
pub(super) struct Others<const POINTS: usize> {
    list: heapless::Vec<Other, POINTS>,
    /// What each point of this frame continues.
    claims: Row<Claim, POINTS>,
    reach: f32,
    memory: u16,
}

impl<const POINTS: usize> Others<POINTS> {
    pub(super) fn new(rate: f32) -> Self {
        Self {
            list: heapless::Vec::new(),
            claims: Row::new(),
            reach: NEAR + JERK / (rate * rate),
            memory: (MEMORY * rate) as u16 + 1,
        }
    }

    /// Price of giving `point` to a trace that surely had its own point `since` frames ago, and is
    /// expected at the squared distance `square` from it.
    #[inline]
    pub(super) fn price(&self, point: u16, since: u16, square: f32) -> f32 {
        let claim = self.claims.at(usize::from(point));
        if claim.age <= since.saturating_add(1) {
            return 0.0;
        }
        // Full where the point lies much nearer to the other's prediction than to the trace's.
        let rival = 4.0 * claim.square + RIVAL_NOISE * RIVAL_NOISE;
        COST_OTHER * square / (square + rival)
    }

    /// Gives each followed thing its point of this frame, before the rope takes any.
    pub(super) fn explain(&mut self, points: &mut Points<POINTS>) {
        self.claims.fill(Claim::default());
        for other in &mut self.list {
            let expected = other.position + other.velocity;
            let reach = self.reach + HIDDEN * f32::from(other.hidden);
            let point = points.nearest(expected, reach);
            other.point = point.unwrap_or(NONE);
            other.age = other.age.saturating_add(1);
            if let Some(point) = point {
                points.claim(point);
                let off = points.at(usize::from(point)) - expected;
                let claim = Claim {
                    age: other.age,
                    square: dot(off, off),
                };
                self.claims.set(usize::from(point), claim);
            }
        }
        points.release_all();
    }

    /// Moves on, after the rope has taken its points.
    pub(super) fn learn(&mut self, points: &Points<POINTS>) {
        let memory = self.memory;
        self.list.retain_mut(|other| {
            let point = usize::from(other.point);
            if other.point != NONE && !points.is_claimed(point) {
                let position = points.at(point);
                let moved = position - other.position;
                other.velocity = other.velocity + (moved - other.velocity) * 0.5;
                other.position = position;
                other.hidden = 0;
            } else {
                other.position += other.velocity;
                other.hidden += 1;
            }
            other.hidden <= memory
        });
        for point in 0..points.count() {
            if self.claims.at(point).age == 0 && !points.is_claimed(point) {
                let _ = self.list.push(Other {
                    position: points.at(point),
                    velocity: Vec3::ZERO,
                    age: 1,
                    hidden: 0,
                    point: NONE,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn history_survives_a_short_absence() {
        let mut others = Others::<8>::new(100.0);
        let mut points = Points::<8>::new();
        // Starts slowly enough to be followed from its first frame on.
        let place = |frame: u16| [0.0005 * f32::from(frame * frame), 1.0, 0.0];
        for frame in 0..30 {
            let hidden = (12..17).contains(&frame);
            let seen = [[9.0; 3], place(frame)];
            points.load(if hidden { &[] } else { &seen });
            others.explain(&mut points);
            if !hidden && frame > 0 {
                assert_eq!(others.claims.at(1).age, frame + 1, "frame {frame}");
            }
            others.learn(&points);
        }
        // A point that the rope has taken is not learned.
        points.load(&[[5.0; 3]]);
        others.explain(&mut points);
        points.claim(0);
        others.learn(&points);
        others.explain(&mut points);
        assert_eq!(others.claims.at(0).age, 0);
    }
}
