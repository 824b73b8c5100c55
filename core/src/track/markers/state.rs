//! What the tracker remembers between frames, and its scratch.

use core::borrow::BorrowMut;

use glam::Vec3;

use super::points::{BINS, Point};
use crate::math::Quat4;
use crate::solve::assignment::{ColumnSlot, RowSlot};

/// Points that a marker may choose from in a frame.
pub(super) const OFFERS: usize = 4;

/// No point.
pub(super) const NONE: u16 = u16::MAX;

/// Memory that is too small for a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryError {
    /// Which.
    pub buffer: &'static str,
    /// Rows needed.
    pub needed: usize,
    /// Rows given.
    pub found: usize,
}

impl core::fmt::Display for MemoryError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self {
            buffer,
            needed,
            found,
        } = self;
        write!(
            f,
            "{buffer}: {found} rows, {needed} needed; size it by the model's counts"
        )
    }
}

impl core::error::Error for MemoryError {}

/// Memory of one marker.
#[derive(Clone, Copy, Debug)]
pub struct Trace {
    /// Measured or filled, this frame and the one before, metres.
    pub(super) position: Vec3,
    pub(super) before: Vec3,
    /// Where its motion or its neighbours expected it, metres.
    pub(super) predicted: Vec3,
    /// Metres a frame, and a frame squared.
    pub(super) velocity: Vec3,
    pub(super) acceleration: Vec3,
    /// From the local frame to the world, as last fitted.
    pub(super) turn: Quat4,
    /// Lasting error of the fill in the local frame, metres: markers never sit quite as learned.
    pub(super) bias: Vec3,
    /// What is left of the error at the start of the gap, and its change a frame.
    pub(super) error: Vec3,
    pub(super) slope: Vec3,
    /// Where it was when the set was last lost, metres.
    pub(super) last: Vec3,
    /// From `position` to what is shown, fading after a gap, metres.
    pub(super) offset: Vec3,
    /// Standard deviation of `position` an axis, metres; 0 where measured.
    pub(super) sigma: f32,
    /// Mean square of a coordinate's surprise, square metres.
    pub(super) surprise: f32,
    /// Share of `error` that the gap has kept.
    pub(super) kept: f32,
    /// Point of this frame in working order, and in the caller's.
    pub(super) point: u16,
    pub(super) source: u16,
    /// Frames since it was measured, and frames in a row in which it was.
    pub(super) gap: u16,
    pub(super) streak: u16,
    /// `streak` when the gap began.
    pub(super) streak_before: u16,
    /// Frames in a row in which its neighbours contradicted it.
    pub(super) doubt: u8,
    /// Whether its label was confirmed and its sight has hardly been interrupted since: distances
    /// that change now change because the pose does.
    pub(super) is_firm: bool,
    /// Whether few distances speak for its label.
    pub(super) is_weak: bool,
    /// Whether `last` says anything.
    pub(super) is_remembered: bool,
    /// Whether `position` says anything.
    pub(super) is_placed: bool,
    /// Whether `turn` says anything.
    pub(super) is_turned: bool,
}

impl Trace {
    /// A marker that was never seen.
    pub const EMPTY: Self = Self {
        position: Vec3::ZERO,
        before: Vec3::ZERO,
        predicted: Vec3::ZERO,
        velocity: Vec3::ZERO,
        acceleration: Vec3::ZERO,
        turn: [0.0, 0.0, 0.0, 1.0],
        bias: Vec3::ZERO,
        error: Vec3::ZERO,
        slope: Vec3::ZERO,
        last: Vec3::ZERO,
        offset: Vec3::ZERO,
        sigma: 0.0,
        surprise: 0.0,
        kept: 0.0,
        point: NONE,
        source: NONE,
        gap: 0,
        streak: 0,
        streak_before: 0,
        doubt: 0,
        is_firm: false,
        is_weak: false,
        is_remembered: false,
        is_placed: false,
        is_turned: false,
    };

    /// The local frame's last rotation, if known.
    pub(super) fn turn(&self) -> Option<Quat4> {
        self.is_turned.then_some(self.turn)
    }

    pub(super) fn is_measured(&self) -> bool {
        self.point != NONE
    }
}

impl Default for Trace {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// What a tracker remembers; `B` holds `[Trace]`, [`state_len`] of them.
#[derive(Clone, Debug)]
pub struct State<B> {
    pub(super) course: Course,
    pub(super) rival: Rival,
    pub(super) traces: B,
}

/// Rows that a [`State`] needs: two labellings.
#[must_use]
pub const fn state_len(dims: &super::MarkerDims) -> usize {
    2 * dims.marker_count
}

/// Where the second labelling stands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rival {
    pub course: Course,
    pub is_running: bool,
    /// Frames since it began; until the next begins; attempts that came to nothing.
    pub age: u16,
    pub wait: u16,
    pub waits: u16,
    /// Frames in a row in which the first left points unexplained.
    pub short: u16,
}

/// Where the tracker stands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    /// Whether the set has been recognised.
    pub is_tracking: bool,
    /// Frames in a row that were poorly explained.
    pub poor: u16,
    /// Frames in a row without any usable point.
    pub blank: u16,
    /// Where the search for the set goes on: seed, and first point of a pair.
    pub seed: usize,
    pub first: usize,
    /// Next seed whose lost markers are looked for.
    pub turn: usize,
    /// Next marker to be compared with its neighbours.
    pub next: usize,
    /// Free points and measured markers when lost markers were last sought; searches in a row that
    /// found none, and frames until the next.
    pub free: u16,
    pub held: u16,
    pub tries: u8,
    pub rest: u8,
    /// Frames since the set was lost, and those of them that showed points.
    pub away: u16,
    pub back: u16,
}

impl Course {
    const NEW: Self = Self {
        is_tracking: false,
        poor: 0,
        blank: 0,
        seed: 0,
        first: 0,
        turn: 0,
        next: 0,
        free: 0,
        held: 0,
        tries: 0,
        rest: 0,
        away: 0,
        back: 0,
    };
}

impl<B: BorrowMut<[Trace]>> State<B> {
    /// A state that knows nothing, in the caller's memory; old contents do not matter.
    #[must_use]
    pub fn with(mut traces: B) -> Self {
        traces.borrow_mut().fill(Trace::EMPTY);
        Self {
            course: Course::default(),
            rival: Rival::default(),
            traces,
        }
    }

    /// Forgets everything, what it learned about the markers' places too.
    pub fn reset(&mut self) {
        self.traces.borrow_mut().fill(Trace::EMPTY);
        self.course = Course::default();
        self.rival = Rival::default();
    }
}

impl<const N: usize> State<[Trace; N]> {
    /// A state with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            course: Course::NEW,
            rival: Rival {
                course: Course::NEW,
                is_running: false,
                age: 0,
                wait: 0,
                waits: 0,
                short: 0,
            },
            traces: [Trace::EMPTY; N],
        }
    }
}

impl<const N: usize> Default for State<[Trace; N]> {
    fn default() -> Self {
        Self::new()
    }
}

/// Where a lost marker may be: scratch of one marker.
#[derive(Clone, Copy, Debug)]
pub struct Proposal {
    /// Cheapest point, its cost, and the cost of the next.
    pub(super) point: u16,
    pub(super) cost: f32,
    pub(super) second: f32,
}

impl Proposal {
    /// Nowhere.
    pub const EMPTY: Self = Self {
        point: NONE,
        cost: f32::MAX,
        second: f32::MAX,
    };
}

/// Scratch of a frame. Its contents do not matter between frames, so one serves many trackers.
///
/// `R` holds `[RowSlot<4>]` and `M` `[Proposal]`, one a marker; `P` holds `[Point]` and `C`
/// `[ColumnSlot]`, one for each point that a frame may have.
#[derive(Clone, Debug)]
pub struct Workspace<R, M, P, C> {
    pub(super) rows: R,
    pub(super) proposals: M,
    pub(super) points: P,
    pub(super) columns: C,
    pub(super) bins: [u16; BINS + 1],
}

/// A workspace with memory of its own.
pub type FixedWorkspace<const MARKERS: usize, const POINTS: usize> = Workspace<
    [RowSlot<OFFERS>; MARKERS],
    [Proposal; MARKERS],
    [Point; POINTS],
    [ColumnSlot; POINTS],
>;

impl<const MARKERS: usize, const POINTS: usize> FixedWorkspace<MARKERS, POINTS> {
    /// A workspace with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self::with(
            [RowSlot::EMPTY; MARKERS],
            [Proposal::EMPTY; MARKERS],
            [Point::EMPTY; POINTS],
            [ColumnSlot::EMPTY; POINTS],
        )
    }
}

impl<const MARKERS: usize, const POINTS: usize> Default for FixedWorkspace<MARKERS, POINTS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R, M, P, C> Workspace<R, M, P, C> {
    /// A workspace in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(rows: R, proposals: M, points: P, columns: C) -> Self {
        Self {
            rows,
            proposals,
            points,
            columns,
            bins: [0; BINS + 1],
        }
    }
}
