//! Labels and completes the markers of a body, frame by frame, from points without names.
//!
//! | stage | does |
//! | --- | --- |
//! | `points` | usable points, in slices, so that a search looks at few |
//! | `associate` | a point for each marker where it is expected, jointly |
//! | `fill` | missing markers from their neighbours' motion and their own past |
//! | `seek` | lost markers from their distances to found ones |
//! | `seed` | the whole set from nothing, by constellations of four |
//! | `recall` | the whole set again after a moment out of sight |
//! | `audit` | markers that their neighbours contradict are exchanged or dropped |
//! | `rival` | another labelling, which takes over where it explains more |
//!
//! The host learns the [`Model`] from clean takes. A frame costs at most [`work_bound`]; nothing
//! is allocated, and points that are not finite are left out and counted. Filling follows Park &
//! Hodgins 2006, section 4.3, in the form of a local frame and a regression.

mod associate;
mod audit;
mod cost;
mod fill;
mod gap;
mod model;
mod pace;
mod points;
mod recall;
mod rival;
mod seed;
mod seek;
mod state;
mod turn;

use core::borrow::BorrowMut;

use glam::Vec3;

pub use crate::asset::{MarkerDims, MarkerError, MarkerTables};
use crate::solve::assignment::{ColumnSlot, RowSlot};
pub use cost::work_bound;
pub use model::Model;
pub use pace::Config;
use pace::Pace;
pub use points::Point;
use points::Points;
use state::{Course, NONE, OFFERS, Rival};
pub use state::{FixedWorkspace, MemoryError, Proposal, State, Trace, Workspace, state_len};

/// Where a marker's position comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// The caller's point of this index.
    Measured(u16),
    /// Its neighbours and its past.
    Filled,
    /// Nothing usable: the position is the last one known, or the origin.
    Lost,
}

/// One marker in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// Metres. After a gap it meets the measured point within [`Config::blend`].
    pub position: [f32; 3],
    /// Where it comes from.
    pub source: Source,
    /// Expected standard deviation an axis, metres; infinite where lost.
    pub sigma: f32,
    /// 0 to 1: certainty that the label is right where measured, that the place is within a
    /// centimetre where filled; 0 where lost.
    pub confidence: f32,
    /// Frames since it was measured.
    pub gap: u16,
}

/// What the tracker was doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// The set has not been recognised.
    #[default]
    Searching,
    /// It has.
    Tracking,
}

/// What a frame came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameReport {
    /// What the tracker was doing at the end.
    pub phase: Phase,
    /// Markers with a point.
    pub measured: usize,
    /// Markers filled in.
    pub filled: usize,
    /// Markers lost.
    pub lost: usize,
    /// Points that belong to no marker.
    pub strangers: usize,
    /// Points left out because they are not finite or beyond 1 km.
    pub unusable: usize,
    /// Points left out for want of memory.
    pub surplus: usize,
    /// Markers that changed places or were dropped because their neighbours contradicted them.
    pub corrected: usize,
    /// Inner steps, at most [`work_bound`].
    pub work: u32,
}

/// A model, what is remembered, and scratch: everything a frame needs.
#[derive(Debug)]
pub struct Tracker<'r, 'a> {
    model: Model<'a>,
    config: Config,
    pace: Pace,
    course: &'r mut Course,
    traces: &'r mut [Trace],
    /// Another labelling, which takes over where it explains more.
    rival: &'r mut Rival,
    rival_traces: &'r mut [Trace],
    rows: &'r mut [RowSlot<OFFERS>],
    proposals: &'r mut [Proposal],
    points: &'r mut [Point],
    columns: &'r mut [ColumnSlot],
    bins: &'r mut [u16; points::BINS + 1],
}

impl<'r, 'a> Tracker<'r, 'a> {
    /// Brings the parts together; costs nothing, so many trackers can share a workspace.
    ///
    /// # Errors
    /// [`MemoryError`] where state or workspace hold fewer rows than the model has markers, or no
    /// point.
    pub fn new<B, R, M, P, C>(
        model: &Model<'a>,
        config: Config,
        state: &'r mut State<B>,
        workspace: &'r mut Workspace<R, M, P, C>,
    ) -> Result<Self, MemoryError>
    where
        B: BorrowMut<[Trace]>,
        R: BorrowMut<[RowSlot<OFFERS>]>,
        M: BorrowMut<[Proposal]>,
        P: BorrowMut<[Point]>,
        C: BorrowMut<[ColumnSlot]>,
    {
        let count = model.dims().marker_count;
        let all = first(
            state.traces.borrow_mut(),
            state_len(model.dims()),
            "marker state",
        )?;
        let (traces, rival_traces) = all.split_at_mut_checked(count).unwrap_or_default();
        let points = workspace.points.borrow_mut();
        let columns = workspace.columns.borrow_mut();
        let room = points.len().min(columns.len());
        Ok(Self {
            model: *model,
            config,
            pace: Pace::new(&config, count),
            course: &mut state.course,
            traces,
            rival: &mut state.rival,
            rival_traces,
            rows: first(workspace.rows.borrow_mut(), count, "marker rows")?,
            proposals: first(workspace.proposals.borrow_mut(), count, "marker proposals")?,
            points: first(points, room.max(1), "points")?,
            columns: first(columns, room.max(1), "columns")?,
            bins: &mut workspace.bins,
        })
    }

    /// Labels the points of the next frame, metres, in any order.
    ///
    /// An empty slice is a frame in which nothing was seen. Points beyond the workspace's memory
    /// are left out.
    pub fn step(&mut self, points: &[[f32; 3]]) -> FrameReport {
        let (points, refused) = Points::load(self.points, self.bins, points);
        let mut frame = Frame {
            model: &self.model,
            config: &self.config,
            pace: &self.pace,
            course: self.course,
            traces: self.traces,
            rows: self.rows,
            proposals: self.proposals,
            columns: self.columns,
            points,
            corrected: 0,
            search: self.config.search,
        };
        frame.run();
        rival::step(&mut frame, self.rival, self.rival_traces);
        let mut report = FrameReport {
            strangers: frame.points.len(),
            unusable: refused.unusable,
            surplus: refused.surplus,
            corrected: frame.corrected,
            work: frame.points.work,
            ..FrameReport::default()
        };
        if self.course.is_tracking {
            report.phase = Phase::Tracking;
        }
        for sample in self.samples() {
            match sample.source {
                Source::Measured(_) => report.measured += 1,
                Source::Filled => report.filled += 1,
                Source::Lost => report.lost += 1,
            }
        }
        report.strangers = report.strangers.saturating_sub(report.measured);
        report
    }

    /// The markers after the last step, `[markers]`, in the model's order.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        self.traces.iter().map(|trace| self.sample(trace))
    }

    fn sample(&self, trace: &Trace) -> Sample {
        let filled = trace.is_placed && trace.sigma <= self.config.limit;
        let (source, sigma, confidence) = if trace.is_measured() {
            let doubt = 1.0 + f32::from(trace.doubt);
            let seen = f32::from(trace.streak.min(8));
            let sure = (seen + 1.0) / (9.0 * doubt * doubt);
            (Source::Measured(trace.source), self.config.noise, sure)
        } else if filled {
            let relative = trace.sigma * 100.0;
            let sure = 1.0 / (1.0 + relative * relative);
            (Source::Filled, trace.sigma, sure)
        } else {
            (Source::Lost, f32::INFINITY, 0.0)
        };
        Sample {
            position: (trace.position + trace.offset).to_array(),
            source,
            sigma,
            confidence,
            gap: trace.gap,
        }
    }
}

fn first<'r, T>(
    slots: &'r mut [T],
    count: usize,
    buffer: &'static str,
) -> Result<&'r mut [T], MemoryError> {
    let found = slots.len();
    slots.get_mut(..count).ok_or(MemoryError {
        buffer,
        needed: count,
        found,
    })
}

/// One frame under way.
struct Frame<'f, 'a> {
    model: &'f Model<'a>,
    config: &'f Config,
    pace: &'f Pace,
    course: &'f mut Course,
    traces: &'f mut [Trace],
    rows: &'f mut [RowSlot<OFFERS>],
    proposals: &'f mut [Proposal],
    columns: &'f mut [ColumnSlot],
    points: Points<'f>,
    corrected: usize,
    /// Inner steps left for seeking.
    search: u32,
}

impl Frame<'_, '_> {
    fn run(&mut self) {
        if self.points.len() == 0 {
            self.course.blank = self.course.blank.saturating_add(1);
            if self.course.blank > self.pace.blank {
                self.forget();
            }
        } else {
            self.course.blank = 0;
        }
        self.advance();
        self.course.away = self.course.away.saturating_add(1);
        if self.course.is_tracking {
            self.associate_seen();
            self.fill_missing();
            self.associate_filled();
            self.audit();
            self.seek_in_turn();
            self.judge();
        } else if self.points.len() >= 4 {
            self.course.back = self.course.back.saturating_add(1);
            let before = self.points.work;
            self.recognise(before.saturating_add(self.search));
            self.spend(before);
        }
        self.settle();
    }

    /// What was spent since the work stood at `before` is gone for the rest of the frame.
    fn spend(&mut self, before: u32) {
        let spent = self.points.work.saturating_sub(before);
        self.search = self.search.saturating_sub(spent);
    }

    /// Moves every marker to where its motion takes it.
    fn advance(&mut self) {
        for trace in self.traces.iter_mut() {
            trace.before = trace.position;
            trace.point = NONE;
            if trace.is_placed {
                trace.position += trace.velocity + trace.acceleration * 0.5;
            }
        }
    }

    fn trace(&self, marker: usize) -> Trace {
        self.traces.get(marker).copied().unwrap_or(Trace::EMPTY)
    }

    /// Gives a marker a point for this frame.
    fn take(&mut self, marker: usize, point: usize) {
        self.points.edit(point, |point| point.owner = marker as u16);
        let position = self.points.at(point).position;
        if let Some(trace) = self.traces.get_mut(marker) {
            // What was filled meets what is measured without a jump.
            if trace.is_placed && trace.gap > 0 {
                trace.offset += trace.position - position;
            }
            trace.point = point as u16;
            trace.predicted = trace.position;
            trace.position = position;
            trace.sigma = 0.0;
            trace.is_firm &= trace.is_placed && trace.gap <= self.pace.old;
            if !trace.is_placed {
                // Never seen before: nothing is known about its motion.
                trace.is_placed = true;
                trace.predicted = position;
                trace.before = position;
                trace.offset = Vec3::ZERO;
                trace.velocity = Vec3::ZERO;
                trace.acceleration = Vec3::ZERO;
                trace.surprise = self.pace.sprint;
                trace.streak = 0;
            }
        }
    }

    /// Takes a marker's point away; it stays where `position` says.
    fn drop_point(&mut self, marker: usize) {
        let point = self.trace(marker).point;
        self.points
            .edit(usize::from(point), |point| point.owner = NONE);
        if let Some(trace) = self.traces.get_mut(marker) {
            trace.point = NONE;
            trace.streak = 0;
        }
    }

    /// Whether the frame was explained; a set poorly explained for a while is sought anew.
    fn judge(&mut self) {
        let markers = self.traces.len();
        let measured = self
            .traces
            .iter()
            .filter(|trace| trace.is_measured())
            .count();
        let seen = self.points.len();
        let possible = markers.min(seen);
        if 2 * measured >= possible {
            self.course.poor = 0;
        } else {
            self.course.poor = self.course.poor.saturating_add(1);
            if self.course.poor > self.pace.patience {
                self.forget();
            }
        }
    }

    /// Learns each marker's motion from this frame.
    fn settle(&mut self) {
        let pace = *self.pace;
        for trace in self.traces.iter_mut() {
            trace.offset *= pace.blend;
            if trace.is_measured() {
                trace.source = self.points.at(usize::from(trace.point)).source;
                learn(trace, &pace);
            } else {
                trace.gap = trace.gap.saturating_add(1);
                if trace.streak > 0 {
                    trace.streak_before = trace.streak;
                }
                trace.streak = 0;
                if trace.is_placed && trace.gap > 1 {
                    // The fill knows better than inertia; a slow following keeps it calm.
                    let moved = trace.position - trace.before;
                    trace.velocity += (moved - trace.velocity) * 0.3;
                    trace.acceleration = Vec3::ZERO;
                }
                trace.velocity *= pace.coast;
            }
        }
    }
}

/// The fading-memory filter of second degree, shorter while young.
fn learn(trace: &mut Trace, pace: &Pace) {
    let miss = trace.position - trace.predicted;
    match trace.streak {
        // Back from a gap: its velocity is that of the fill, or none.
        0 => trace.acceleration = Vec3::ZERO,
        1 => {
            trace.velocity = trace.position - trace.before;
            trace.acceleration = Vec3::ZERO;
        }
        _ => {
            trace.velocity += trace.acceleration + miss * pace.velocity_gain;
            trace.acceleration += miss * pace.acceleration_gain;
        }
    }
    if trace.streak > 1 {
        let square = miss.length_squared() * (1.0 / 3.0);
        trace.surprise += 0.15 * (square.min(1e-3) - trace.surprise);
    }
    trace.streak = trace.streak.saturating_add(1);
    trace.gap = 0;
}
