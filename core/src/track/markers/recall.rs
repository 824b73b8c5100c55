//! The set again after a moment out of sight: the body is elsewhere, but nearly in the same pose.
//!
//! Four points that match a constellation carry the places in which the markers were last to where
//! they should be now; those found near by carry the farther ones. A limb cannot be taken for the
//! other one this way, and one frame is enough.

use glam::{Mat3, Vec3};

use super::Frame;
use super::associate::contradiction;
use super::state::{NONE, Trace};
use super::turn::align;

/// Seconds for which the last pose is worth trying, and for which nothing else is.
const SECONDS: f32 = 1.5;
const ALONE: f32 = 0.1;
/// How far from the found markers each pass looks, metres.
pub(super) const PASSES: [f32; 3] = [0.4, 0.8, 10.0];
/// How far from where it is carried a marker may be: metres, and share of its distance from the
/// found markers, at most.
const NEAR: f32 = 0.02;
const SHARE: f32 = 0.12;
const MOST: f32 = 0.1;
/// Square deviation that each distance may have on average beyond what is usual.
const AGAINST: f32 = 8.0;

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Recall {
    /// The last pose is unknown or too old.
    Unknown,
    /// It is not there.
    Contradicted,
    /// It is there.
    Found,
}

/// From the last places to this frame.
struct Motion {
    rotation: Mat3,
    from: Vec3,
    to: Vec3,
}

impl Motion {
    fn apply(&self, place: Vec3) -> Vec3 {
        self.rotation * (place - self.from) + self.to
    }
}

impl Frame<'_, '_> {
    /// Every marker loses its place; what was learned about its bias stays,
    /// and where it was.
    pub(super) fn forget(&mut self) {
        let was_tracking = self.course.is_tracking;
        self.course.is_tracking = false;
        self.course.poor = 0;
        if was_tracking {
            (self.course.away, self.course.back) = (0, 0);
        }
        for trace in self.traces.iter_mut() {
            let (last, is_remembered) = if was_tracking {
                (trace.position, trace.is_placed)
            } else {
                (trace.last, trace.is_remembered)
            };
            *trace = Trace {
                last,
                is_remembered,
                position: trace.position,
                bias: trace.bias,
                gap: trace.gap,
                ..Trace::EMPTY
            };
        }
    }

    /// Finds the markers around those that have a point, by where all were last.
    pub(super) fn recall(&mut self) -> Recall {
        let away = f32::from(self.course.away) * self.pace.step;
        let first = self.measured();
        if away > SECONDS || self.remembered() < first {
            return Recall::Unknown;
        }
        for reach in PASSES {
            let Some(motion) = self.motion() else {
                return Recall::Contradicted;
            };
            for marker in 0..self.traces.len() {
                let trace = self.trace(marker);
                let far = trace.last.distance_squared(motion.from);
                if trace.is_measured() || !trace.is_remembered || far > reach * reach {
                    continue;
                }
                let place = motion.apply(trace.last);
                let gate =
                    (NEAR + SHARE * far * crate::math::inverse_sqrt(far.max(1e-6))).min(MOST);
                let found = self
                    .points
                    .nearest(place, gate, |point| point.owner == NONE);
                let Some((point, _)) = found else { continue };
                let position = self.points.at(point).position;
                let (against, asked) =
                    contradiction(self.model, self.traces, marker, position, NONE);
                if against <= AGAINST * asked as f32 {
                    self.begin(marker, point);
                }
            }
        }
        let possible = self.points.len().min(self.traces.len());
        let found = self.measured();
        if 2 * found >= possible && found > first {
            Recall::Found
        } else if f32::from(self.course.back) * self.pace.step > ALONE {
            Recall::Unknown
        } else {
            Recall::Contradicted
        }
    }

    /// Markers with a point whose last place is known.
    fn remembered(&self) -> usize {
        let each = self.traces.iter();
        each.filter(|trace| trace.is_measured() && trace.is_remembered)
            .count()
    }

    /// The motion of the markers that have a point.
    fn motion(&mut self) -> Option<Motion> {
        self.points.work += self.traces.len() as u32;
        let both = self
            .traces
            .iter()
            .filter(|trace| trace.is_measured() && trace.is_remembered);
        let pairs = both.map(|trace| (trace.last, trace.position));
        let (rotation, from, to) = align(pairs)?;
        Some(Motion { rotation, from, to })
    }
}
