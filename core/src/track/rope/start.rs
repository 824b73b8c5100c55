//! The first frames: which points stay in place, and which of them are the rope.
//!
//! Porter 2012, section 3.4: points near a trace's average position belong to it, a frame without
//! one counts as a temporary marker, and a trace with too many is discarded. The order along the
//! rope then comes from the spacing, or from the height as published. That asks for a rope at
//! rest; the tracker's own method expects points where the last two frames lead instead, and
//! orders the last positions, so that the rope may move.

use glam::Vec3;

use super::chain::{Chain, longest};
use super::points::{NONE, Points};
use super::{Config, Method, Order, Selection};
use crate::row::Row;

/// Traces while the first frames are collected; any point may yet be the rope's.
#[derive(Clone, Debug)]
pub(super) struct Start<const POINTS: usize> {
    count: usize,
    sum: Row<Vec3, POINTS>,
    seen: Row<u16, POINTS>,
    /// Where the trace was in the last frame, and how far it moved in it.
    last: Row<Vec3, POINTS>,
    velocity: Row<Vec3, POINTS>,
    frames: u16,
}

impl<const POINTS: usize> Start<POINTS> {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            sum: Row::new(),
            seen: Row::new(),
            last: Row::new(),
            velocity: Row::new(),
            frames: 0,
        }
    }

    pub(super) fn frames(&self) -> u16 {
        self.frames
    }

    fn average(&self, trace: usize) -> Vec3 {
        let seen = self.seen.at(trace).max(1);
        self.sum.at(trace) * (1.0 / f32::from(seen))
    }

    /// Takes one frame.
    pub(super) fn feed(&mut self, config: &Config, points: &mut Points<POINTS>) {
        self.frames += 1;
        for trace in 0..self.count {
            let expected = match config.method {
                Method::Joint => self.last.at(trace) + self.velocity.at(trace),
                Method::Published => self.average(trace),
            };
            let mut position = expected;
            if let Some(point) = points.nearest(expected, config.gamma) {
                points.claim(point);
                position = points.at(usize::from(point));
                self.sum.edit(trace, |sum| *sum += position);
                self.seen.edit(trace, |seen| *seen += 1);
            }
            self.velocity.set(trace, position - self.last.at(trace));
            self.last.set(trace, position);
        }
        // What no trace has claimed begins one: a marker may be hidden in the first frame.
        for index in 0..points.count() {
            let position = points.at(index);
            if !points.is_claimed(index) && is_selected(config, position) && self.count < POINTS {
                self.sum.set(self.count, position);
                self.seen.set(self.count, 1);
                self.last.set(self.count, position);
                self.velocity.set(self.count, Vec3::ZERO);
                self.count += 1;
            }
        }
    }

    /// The rope's markers in order, by their average or last positions; fewer than three if none is found.
    pub(super) fn conclude<const TRACES: usize>(
        &self,
        config: &Config,
        points: &mut Points<POINTS>,
    ) -> heapless::Vec<Vec3, TRACES> {
        let mut positions = heapless::Vec::<[f32; 3], POINTS>::new();
        for trace in 0..self.count {
            let temporary = self.frames.saturating_sub(self.seen.at(trace));
            if temporary <= config.max_temp_markers {
                let position = match config.method {
                    Method::Joint => self.last.at(trace),
                    Method::Published => self.average(trace),
                };
                let _ = positions.push(position.to_array());
            }
        }
        points.load(&positions);
        let chain = match config.order {
            Order::Spacing => {
                let wanted = usize::from(config.markers.unwrap_or(0));
                longest::<POINTS, TRACES>(points, config.spacing, wanted)
            }
            Order::Height => by_height(points),
        };
        let too_few = config
            .markers
            .is_some_and(|wanted| chain.len() < usize::from(wanted));
        let mut ordered = heapless::Vec::new();
        if !too_few {
            for &point in chain.iter().filter(|&&point| point != NONE) {
                let _ = ordered.push(points.at(usize::from(point)));
            }
        }
        ordered
    }
}

fn is_selected(config: &Config, position: Vec3) -> bool {
    match config.selection {
        Selection::All => true,
        Selection::Box { low, high } => {
            let inside = |p: f32, low: f32, high: f32| p >= low && p <= high;
            let sides = position
                .to_array()
                .into_iter()
                .zip(low.into_iter().zip(high));
            sides
                .into_iter()
                .all(|(p, (low, high))| inside(p, low, high))
        }
    }
}

/// All points, the highest first.
fn by_height<const P: usize, const T: usize>(points: &Points<P>) -> Chain<T> {
    let mut chain = Chain::new();
    let mut taken = Row::<bool, P>::new();
    for _ in 0..points.count().min(T) {
        let mut highest = (f32::MIN, None);
        for index in (0..points.count()).filter(|&i| !taken.at(i)) {
            if points.at(index).y > highest.0 {
                highest = (points.at(index).y, Some(index));
            }
        }
        if let Some(index) = highest.1 {
            taken.set(index, true);
            let _ = chain.push(index as u16);
        }
    }
    chain
}
