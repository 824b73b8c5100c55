//! A capture as a tracker sees it: points without names.

use glam::DVec3;

use crate::take::Take;

/// The points of every frame, in no order that means anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointFrames {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][points]`, metres.
    pub points: Vec<Vec<DVec3>>,
    /// `[frames][points]`: the take's marker that each point is a sample of.
    pub columns: Vec<Vec<usize>>,
}

impl PointFrames {
    /// All samples of a take; one of two that lie in one place to a micrometre counts, for
    /// Motive writes a rigid body's markers twice. O(frames x markers^2)
    #[must_use]
    pub fn of_take(take: &Take) -> Self {
        let mut frames = Self {
            rate: take.rate(),
            points: Vec::with_capacity(take.frame_count()),
            columns: Vec::with_capacity(take.frame_count()),
        };
        for frame in 0..take.frame_count() {
            let (mut points, mut columns) = (Vec::<DVec3>::new(), Vec::new());
            for (column, position) in take.seen(frame) {
                if !points.iter().any(|p| p.distance_squared(position) < 1e-12) {
                    points.push(position);
                    columns.push(column);
                }
            }
            frames.points.push(points);
            frames.columns.push(columns);
        }
        frames
    }

    /// Points alone; each frame's are numbered from 0.
    #[must_use]
    pub fn new(rate: f64, points: Vec<Vec<DVec3>>) -> Self {
        let columns = points.iter().map(|p| (0..p.len()).collect()).collect();
        Self {
            rate,
            points,
            columns,
        }
    }

    /// How many frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.points.len()
    }
}
