//! Everything that is not the rope: a person's markers, mostly.
//!
//! A point that was followed as something else while a trace was being measured cannot be that
//! trace's marker, however well it lies. So the points that no trace takes are followed too, each
//! by its own velocity to the nearest point; what a collision swaps is thus told apart by history.

use glam::Vec3;

use super::points::{NONE, Points};
use super::state::Track;
use super::vector::dot;
use crate::row::Row;

/// How far from its prediction a body's marker may appear, metres: noise, and an acceleration in
/// metres a second squared between two frames.
const NEAR: f32 = 0.01;
const JERK: f32 = 60.0;
/// Farther for each frame it was hidden, metres.
const HIDDEN: f32 = 0.004;
/// Price of a point that was once too far from the rope: more than that of a missing one.
const COST_EXCLUDED: f32 = 16.0;
/// Most for one that has been followed as something else since before the trace could have lost
/// its own: less than that of a missing one, for it may be the trace's all the same.
const COST_OTHER: f32 = 11.0;
/// Below this distance, metres, neither expectation says anything.
const RIVAL_NOISE: f32 = 0.005;
/// That near to where something else was expected, metres, a point may be its own.
const CONTESTED: f32 = 0.008;
/// Seconds by which something else must have been followed longer than a trace's own certainty
/// reaches back, to be surely something else.
const CERTAIN: f32 = 0.15;
/// Frames hidden after which a prediction is no longer firm.
const RECENT: u16 = 2;
/// That near to where a missing trace is believed to be, metres, a point may be the rope's.
const AMBIGUOUS: f32 = 0.025;
/// How far from the rope's bounding box things are followed, in spacings.
const SURROUNDINGS: f32 = 4.0;
/// Frames in which everything is once compared with the rope.
const TURNS: usize = 8;
/// Seconds that a hidden one is remembered.
const MEMORY: f32 = 0.4;
/// Most that being hidden adds to its reach, metres.
const WIDEST: f32 = 0.02;
/// Things around a hidden one that it moves with, and how near they are, metres.
const COMPANIONS: usize = 3;
const AROUND: f32 = 0.25;
/// Hidden ones whose companions are sought in a frame.
pub(super) const MOST_SOUGHT: usize = 12;

#[derive(Clone, Copy, Debug)]
struct Other {
    position: Vec3,
    velocity: Vec3,
    /// Frames since it first appeared.
    age: u16,
    /// Frames in which it was seen.
    seen: u16,
    hidden: u16,
    /// Its point in this frame.
    point: u16,
    /// Bit `i` is set once it was farther from a neighbour of trace `i` than the rope allows.
    excluded: [u64; 4],
}

impl Other {
    fn is_excluded(&self, trace: usize) -> bool {
        let word = self.excluded.get(trace / 64).copied().unwrap_or(0);
        word >> (trace % 64) & 1 == 1
    }

    fn exclude(&mut self, trace: usize) {
        if let Some(word) = self.excluded.get_mut(trace / 64) {
            *word |= 1 << (trace % 64);
        }
    }
}

/// A point's history: frames, 0 for none, and the squared distance from where it was expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Claim {
    age: u16,
    square: f32,
    /// The thing was seen a moment ago and lies where it was expected.
    is_firm: bool,
    /// Place of the thing in the list.
    other: u16,
}

#[derive(Clone, Debug)]
pub(super) struct Others<const POINTS: usize> {
    list: heapless::Vec<Other, POINTS>,
    /// What each point of this frame continues.
    claims: Row<Claim, POINTS>,
    reach: f32,
    memory: u16,
    /// Share of certainty that a frame brings.
    sureness: f32,
    turn: usize,
}

impl<const POINTS: usize> Others<POINTS> {
    pub(super) fn new(rate: f32) -> Self {
        Self {
            list: heapless::Vec::new(),
            claims: Row::new(),
            reach: NEAR + JERK / (rate * rate),
            memory: (MEMORY * rate) as u16 + 1,
            turn: 0,
            sureness: (1.0 / (CERTAIN * rate)).min(1.0),
        }
    }

    /// How surely `point` is something else than a trace's marker, 0 to 1, if the trace surely had
    /// its own point `since` frames ago: what was followed longer than that is.
    fn strangeness(&self, claim: Claim, since: u16) -> f32 {
        let longer = claim.age.saturating_sub(since.saturating_add(1));
        (f32::from(longer) * self.sureness).min(1.0)
    }

    /// Price of giving `point` to `trace`, which surely had its own point `since` frames ago, and is
    /// expected at the squared distance `square` from it.
    #[inline]
    pub(super) fn price(&self, point: u16, trace: usize, since: u16, square: f32) -> f32 {
        let claim = self.claims.at(usize::from(point));
        if claim.age == 0 {
            return 0.0;
        }
        let other = self.list.get(usize::from(claim.other));
        let is_near = claim.square < CONTESTED * CONTESTED;
        if is_near && other.is_some_and(|other| other.is_excluded(trace)) {
            return COST_EXCLUDED;
        }
        // Full where the point lies much nearer to the other's prediction than to the trace's.
        let rival = 4.0 * claim.square + RIVAL_NOISE * RIVAL_NOISE;
        COST_OTHER * self.strangeness(claim, since) * square / (square + rival)
    }

    /// Whether `point` is surely something else than the marker of a trace that surely had its own
    /// point `since` frames ago.
    #[inline]
    pub(super) fn is_contested(&self, point: u16, since: u16) -> bool {
        let claim = self.claims.at(usize::from(point));
        claim.is_firm && self.strangeness(claim, since) > 0.5
    }

    /// Gives each followed thing its point of this frame, before the rope takes any: first those
    /// that were seen in the frame before, then the hidden ones, which move as what is around them.
    pub(super) fn explain(&mut self, points: &mut Points<POINTS>) {
        self.claims.fill(Claim::default());
        for index in 0..self.list.len() {
            let Some(other) = self.list.get(index).filter(|other| other.hidden == 0) else {
                continue;
            };
            let expected = other.position + other.velocity;
            self.match_one(index, expected, self.reach, points);
        }
        let mut sought = 0;
        for index in 0..self.list.len() {
            let Some(&other) = self.list.get(index).filter(|other| other.hidden > 0) else {
                continue;
            };
            // Those beyond coast: the work of a frame is bounded.
            let step = if sought < MOST_SOUGHT {
                self.drift(&other, points)
            } else {
                None
            };
            sought += 1;
            let step = step.unwrap_or(other.velocity);
            if let Some(other) = self.list.get_mut(index) {
                other.velocity = step;
            }
            let reach = self.reach + (HIDDEN * f32::from(other.hidden)).min(WIDEST);
            self.match_one(index, other.position + step, reach, points);
        }
        points.release_all();
    }

    fn match_one(&mut self, index: usize, expected: Vec3, reach: f32, points: &mut Points<POINTS>) {
        let Some(other) = self.list.get_mut(index) else {
            return;
        };
        let point = points.nearest(expected, reach);
        other.point = point.unwrap_or(NONE);
        other.age = other.age.saturating_add(1);
        if let Some(point) = point {
            points.claim(point);
            let off = points.at(usize::from(point)) - expected;
            let square = dot(off, off);
            let is_firm = other.hidden <= RECENT && square < CONTESTED * CONTESTED;
            let claim = Claim {
                age: other.age,
                square,
                is_firm,
                other: index as u16,
            };
            self.claims.set(usize::from(point), claim);
        }
    }

    /// How far the nearest things that are seen now and were seen before have moved, on average.
    fn drift(&self, hidden: &Other, points: &mut Points<POINTS>) -> Option<Vec3> {
        let mut nearest = [(AROUND * AROUND, Vec3::ZERO); COMPANIONS];
        for other in &self.list {
            if other.hidden > 0 || other.point == NONE || other.age < 3 {
                continue;
            }
            let off = other.position - hidden.position;
            let moved = points.at(usize::from(other.point)) - other.position;
            let mut carried = (dot(off, off), moved);
            for slot in &mut nearest {
                if carried.0 < slot.0 {
                    core::mem::swap(slot, &mut carried);
                }
            }
        }
        points.work = points.work.wrapping_add(self.list.len() as u32);
        let found = nearest.iter().filter(|one| one.0 < AROUND * AROUND);
        let count = found.clone().count();
        let sum = found.fold(Vec3::ZERO, |sum, one| sum + one.1);
        (count > 0).then(|| sum * (1.0 / count as f32))
    }

    /// Moves on, after the rope has taken its points.
    pub(super) fn learn<const TRACES: usize>(
        &mut self,
        points: &Points<POINTS>,
        track: &Track<TRACES>,
    ) {
        let memory = self.memory;
        let (low, high) = surroundings(track);
        let is_near = |p: Vec3| {
            p.x > low.x
                && p.y > low.y
                && p.z > low.z
                && p.x < high.x
                && p.y < high.y
                && p.z < high.z
        };
        let claims = &mut self.claims;
        self.list.retain_mut(|other| {
            let point = usize::from(other.point);
            let claim = claims.at(point);
            let goes_on = if other.point == NONE {
                false
            } else if points.is_claimed(point) {
                // The rope has taken what was expected here: by right, if its trace is sure.
                claim.is_firm && !is_surely_taken(track, other.point)
            } else if other.hidden > 0 && is_ambiguous(track, points.at(point), claim.square) {
                // Perhaps the rope's own: it begins a history of its own.
                claims.set(point, Claim::default());
                false
            } else {
                true
            };
            if goes_on {
                let position = points.at(point);
                let moved = position - other.position;
                other.velocity = other.velocity + (moved - other.velocity) * 0.5;
                other.position = position;
                other.hidden = 0;
                other.seen = other.seen.saturating_add(1);
            } else {
                other.position += other.velocity;
                other.hidden += 1;
            }
            // What was seen for a moment only is forgotten as soon.
            other.hidden <= memory.min(other.seen) && is_near(other.position)
        });
        self.exclude_some(track);
        for point in 0..points.count() {
            let position = points.at(point);
            let is_new = self.claims.at(point).age == 0 && !points.is_claimed(point);
            if is_new && is_near(position) {
                let _ = self.list.push(Other {
                    position,
                    velocity: Vec3::ZERO,
                    age: 1,
                    seen: 1,
                    hidden: 0,
                    point: NONE,
                    excluded: [0; 4],
                });
            }
        }
    }
}

impl<const POINTS: usize> Others<POINTS> {
    /// A rope does not stretch: what is too far from a marker cannot be the next one, now or later.
    /// Takes one thing in [`TURNS`] a frame.
    fn exclude_some<const TRACES: usize>(&mut self, track: &Track<TRACES>) {
        self.turn = (self.turn + 1) % TURNS;
        let measures = &track.measures;
        let limit = |segment: usize| {
            let most = 1.08 * measures.length.at(segment) + 0.008;
            most * most
        };
        for other in self.list.iter_mut().skip(self.turn).step_by(TURNS) {
            if other.hidden > 0 {
                continue;
            }
            for i in 0..measures.count {
                if !track.pose.known.at(i) || track.since.at(i) > 0 {
                    continue;
                }
                let off = track.pose.now.at(i) - other.position;
                let square = dot(off, off);
                if i > 0 && square > limit(i - 1) {
                    other.exclude(i - 1);
                }
                if square > limit(i) {
                    other.exclude(i + 1);
                }
            }
        }
    }
}

/// The box around the rope in which something else can soon come near it.
fn surroundings<const TRACES: usize>(track: &Track<TRACES>) -> (Vec3, Vec3) {
    let markers = track.pose.now.as_slice(track.measures.count);
    let far = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN));
    let (low, high) = markers
        .iter()
        .fold(far, |(low, high), &p| (low.min(p), high.max(p)));
    let margin = Vec3::splat(SURROUNDINGS * track.measures.spacing);
    (low - margin, high + margin)
}

/// Whether the trace that has taken `point` surely has its own.
fn is_surely_taken<const TRACES: usize>(track: &Track<TRACES>, point: u16) -> bool {
    let mut owners = (0..track.measures.count).filter(|&i| track.point.at(i) == point);
    owners.any(|i| track.since.at(i) == 0)
}

/// Whether a point that lies `square` from where something hidden was expected could as well be
/// the marker of a trace that is missing.
fn is_ambiguous<const TRACES: usize>(track: &Track<TRACES>, position: Vec3, square: f32) -> bool {
    let reach = (AMBIGUOUS * AMBIGUOUS).max(4.0 * square);
    let mut missing = (0..track.measures.count).filter(|&i| !track.pose.known.at(i));
    missing.any(|i| {
        let off = position - track.pose.now.at(i);
        dot(off, off) < reach
    })
}

#[cfg(test)]
mod tests {
    use super::super::state::Pace;
    use super::*;

    #[test]
    fn history_survives_a_short_absence() {
        let mut others = Others::<8>::new(100.0);
        let rope = [0.1, 0.2, 0.3].map(|x| Vec3::new(x, 1.25, 0.0));
        let track = Track::<3>::new(Pace::new(100.0, [0.0; 3]), rope.into_iter());
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
            others.learn(&points, &track);
        }
        // A point that the rope has taken is not learned.
        points.load(&[[0.2, 1.4, 0.0]]);
        others.explain(&mut points);
        points.claim(0);
        others.learn(&points, &track);
        others.explain(&mut points);
        assert_eq!(others.claims.at(0).age, 0);
    }
}
