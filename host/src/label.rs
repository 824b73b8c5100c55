//! The core's marker tracker on the host: unlabelled takes in, labelled and complete takes out.

use glam::DVec3;
use sinew_core::solve::assignment::{ColumnSlot, RowSlot};
use sinew_core::track::markers::{
    Config, FrameReport, MarkerDims, MemoryError, Model, Point, Proposal, Sample, Source, State,
    Trace, Tracker, Workspace, state_len,
};

use crate::take::{Take, TakeError};

type Memory = Workspace<Vec<RowSlot<4>>, Vec<Proposal>, Vec<Point>, Vec<ColumnSlot>>;

/// A tracker with memory of its own.
#[derive(Debug)]
pub struct Labeller<'a> {
    model: Model<'a>,
    config: Config,
    state: State<Vec<Trace>>,
    workspace: Memory,
}

impl<'a> Labeller<'a> {
    /// A tracker for frames of at most `points` points.
    #[must_use]
    pub fn new(model: Model<'a>, config: Config, points: usize) -> Self {
        let MarkerDims { marker_count, .. } = *model.dims();
        let points = points.max(1);
        Self {
            model,
            config,
            state: State::with(vec![Trace::EMPTY; state_len(model.dims())]),
            workspace: Workspace::with(
                vec![RowSlot::EMPTY; marker_count],
                vec![Proposal::EMPTY; marker_count],
                vec![Point::EMPTY; points],
                vec![ColumnSlot::EMPTY; points],
            ),
        }
    }

    /// The next frame: a report, and the markers in `samples`, whose old contents do not matter.
    ///
    /// # Errors
    /// None that can happen: the memory was made for the model.
    pub fn step(
        &mut self,
        points: &[[f32; 3]],
        samples: &mut Vec<Sample>,
    ) -> Result<FrameReport, MemoryError> {
        let (state, workspace) = (&mut self.state, &mut self.workspace);
        let mut tracker = Tracker::new(&self.model, self.config, state, workspace)?;
        let report = tracker.step(points);
        samples.clear();
        samples.extend(tracker.samples());
        Ok(report)
    }
}

/// A take after labelling.
#[derive(Clone, Debug)]
pub struct Labelled {
    /// The model's markers; missing where lost.
    pub take: Take,
    /// `[frames][markers]`
    pub samples: Vec<Vec<Sample>>,
    /// `[frames]`
    pub reports: Vec<FrameReport>,
}

/// Labels all points of a take, whatever their names. `progress` hears how many frames are done.
///
/// # Errors
/// None but what [`Take::new`] refuses.
pub fn label(
    take: &Take,
    labels: &[String],
    model: Model<'_>,
    config: Config,
    progress: &dyn Fn(usize),
) -> Result<Labelled, TakeError> {
    let frames = take.frame_count();
    let mut labeller = Labeller::new(model, config, take.marker_count());
    let mut all = Vec::with_capacity(frames);
    let mut reports = Vec::with_capacity(frames);
    let mut trajectories = vec![DVec3::NAN; labels.len() * frames];
    for frame in 0..frames {
        let points: Vec<[f32; 3]> = take
            .seen(frame)
            .map(|(_, position)| position.as_vec3().to_array())
            .collect();
        let mut samples = Vec::new();
        if let Ok(report) = labeller.step(&points, &mut samples) {
            reports.push(report);
        }
        for (marker, sample) in samples.iter().enumerate() {
            if sample.source != Source::Lost {
                let position = glam::Vec3::from_array(sample.position).as_dvec3();
                trajectories[marker * frames + frame] = position;
            }
        }
        all.push(samples);
        progress(frame + 1);
    }
    Ok(Labelled {
        take: take.with_trajectories(labels.to_vec(), trajectories)?,
        samples: all,
        reports,
    })
}
