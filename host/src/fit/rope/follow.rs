//! Finds a rope and follows it, forwards and backwards from where it was found.

use glam::DVec3;
use sinew_core::track::rope::{
    Config, ConfigError, Method, Order, Phase, RopeTracker, Sample, Source,
};

use super::{Origin, PointFrames, RopeError, RopeSample, Trace};

/// Markers of a rope, and points of a frame, at most.
pub const MOST_MARKERS: usize = 96;
/// Points of a frame, at most.
pub const MOST_POINTS: usize = 768;

pub(super) type Tracker = RopeTracker<MOST_MARKERS, MOST_POINTS>;

/// Which points may be the rope.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Selection {
    /// All: the longest evenly spaced chain is the rope.
    #[default]
    Automatic,
    /// Those inside a box at the start, metres.
    Box {
        /// Smallest coordinates.
        low: DVec3,
        /// Largest coordinates.
        high: DVec3,
    },
    /// Samples of these markers of the take, in the first frame that shows all of them; their
    /// distances need not be even.
    Columns(Vec<usize>),
}

/// What is known about a rope.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowOptions {
    /// How it is followed.
    pub method: Method,
    /// How its markers are ordered at the start.
    pub order: Order,
    /// Where its markers are at the start.
    pub selection: Selection,
    /// How many it has.
    pub markers: Option<usize>,
    /// Metres between them.
    pub spacing: Option<f64>,
}

impl Default for FollowOptions {
    fn default() -> Self {
        Self {
            method: Method::Joint,
            order: Order::Spacing,
            selection: Selection::Automatic,
            markers: None,
            spacing: None,
        }
    }
}

/// Fewest markers that an automatic search takes for a rope: shorter chains are found on any body.
const SHORTEST_CHAIN: usize = 5;
/// Frames of the start: first a rope at rest, then one that moves.
const START_FRAMES: [u16; 2] = [20, 4];
/// Share of a chain's worth that a link's relative standard deviation takes.
const UNEVEN: f64 = 5.0;
/// Of a rope whose markers never show all at once, this share is followed.
const MOST_OF_IT: f64 = 0.8;
/// Windows in which the rope is sought, at most.
const MOST_WINDOWS: usize = 64;

impl FollowOptions {
    fn config(&self, rate: f64) -> Config {
        Config {
            method: self.method,
            order: self.order,
            spacing: self.spacing.map(|spacing| spacing as f32),
            markers: self.markers.map(|markers| markers.min(65_535) as u16),
            ..Config::new(rate as f32)
        }
    }

    fn is_selected(&self, position: DVec3) -> bool {
        match &self.selection {
            Selection::Box { low, high } => {
                position.cmpge(*low).all() && position.cmple(*high).all()
            }
            _ => true,
        }
    }

    fn fewest(&self) -> usize {
        self.markers.unwrap_or(match self.selection {
            Selection::Automatic => SHORTEST_CHAIN,
            _ => 3,
        })
    }
}

/// A rope in one frame.
struct Found {
    frame: usize,
    markers: Vec<[f32; 3]>,
}

impl Found {
    /// `[markers - 1]`: metres from each marker to the next.
    fn links(&self) -> Vec<f64> {
        let at = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        let pairs = self.markers.iter().zip(self.markers.iter().skip(1));
        pairs.map(|(a, b)| at(a).distance(at(b))).collect()
    }

    fn spacing(&self) -> f64 {
        super::median(self.links())
    }

    /// Its markers, the fewer the more uneven their distances are: among a body's markers a chain
    /// of many is soon found, but not an even one.
    fn worth(&self) -> f64 {
        let links = self.links();
        let count = links.len().max(1) as f64;
        let mean = links.iter().sum::<f64>() / count;
        let square = links.iter().map(|link| (link - mean).powi(2)).sum::<f64>() / count;
        let uneven = square.sqrt() / mean.max(1e-9);
        self.markers.len() as f64 * (1.0 - UNEVEN * uneven)
    }
}

fn single(position: DVec3) -> [f32; 3] {
    position.as_vec3().to_array()
}

/// Looks for the rope in windows over the capture, at rest first, and takes the longest even chain.
fn find(
    frames: &PointFrames,
    options: &FollowOptions,
    taken: &dyn Fn(usize, usize) -> bool,
) -> Result<Found, RopeError> {
    let config = options.config(frames.rate);
    let mut best: Option<Found> = None;
    for init_frames in START_FRAMES {
        let window = usize::from(init_frames);
        let config = Config {
            init_frames,
            max_temp_markers: init_frames / 4,
            ..config
        };
        let last = frames.frame_count().saturating_sub(window);
        let stride = (last / MOST_WINDOWS).max(window);
        for first in (0..=last).step_by(stride) {
            let mut starter = Box::new(Tracker::new(config)?);
            let mut phase = Phase::Starting;
            for frame in first..(first + window).min(frames.frame_count()) {
                let points = frames.points[frame].iter().enumerate();
                let selected = points
                    .filter(|(place, point)| options.is_selected(**point) && !taken(frame, *place));
                let list: Vec<[f32; 3]> = selected.map(|(_, p)| single(*p)).collect();
                phase = starter.step(&list).phase;
            }
            let markers: Vec<[f32; 3]> = starter.samples().map(|s| s.position).collect();
            let found = Found {
                frame: first + window - 1,
                markers,
            };
            let better = best
                .as_ref()
                .is_none_or(|best| found.worth() > best.worth());
            if phase != Phase::NotFound && found.markers.len() >= options.fewest() && better {
                best = Some(found);
            }
        }
        if best.is_some() {
            break;
        }
    }
    best.ok_or(RopeError::NotFound {
        wanted: options.fewest(),
        frames: frames.frame_count(),
    })
}

/// A rope of a known number of markers.
///
/// The longest even chain of any length tells the spacing: without it, as many markers are soon
/// found across a body. Where ends in a fist never show, what shows of the rope is followed.
fn counted(
    frames: &PointFrames,
    options: &FollowOptions,
    markers: usize,
    taken: &dyn Fn(usize, usize) -> bool,
) -> Result<Found, RopeError> {
    let any = FollowOptions {
        markers: None,
        ..options.clone()
    };
    let longest = find(frames, &any, taken)?;
    let whole = FollowOptions {
        spacing: options.spacing.or(Some(longest.spacing())),
        ..options.clone()
    };
    let fewest = (MOST_OF_IT * markers as f64).ceil() as usize;
    match find(frames, &whole, taken) {
        Err(RopeError::NotFound { .. }) if (fewest..=markers).contains(&longest.markers.len()) => {
            Ok(longest)
        }
        found => found,
    }
}

/// The listed markers, ordered along the shortest way that a walk to the nearest one finds.
fn listed(frames: &PointFrames, columns: &[usize]) -> Result<Found, RopeError> {
    let place = |frame: usize, column: &usize| {
        let at = frames.columns[frame].iter().position(|c| c == column)?;
        Some(frames.points[frame][at])
    };
    let sight = (0..frames.frame_count()).find_map(|frame| {
        let markers: Option<Vec<DVec3>> = columns.iter().map(|c| place(frame, c)).collect();
        Some((frame, markers?))
    });
    let Some((frame, markers)) = sight else {
        return Err(RopeError::NeverTogether {
            markers: columns.len(),
        });
    };
    let walks = (0..markers.len()).map(|start| {
        let mut left = markers.clone();
        let mut walk = vec![left.swap_remove(start)];
        let mut length = 0.0;
        while !left.is_empty() {
            let tip = walk[walk.len() - 1];
            let away = left.iter().map(|p| p.distance(tip)).enumerate();
            let (next, step) =
                away.fold(
                    (0, f64::INFINITY),
                    |best, one| {
                        if one.1 < best.1 { one } else { best }
                    },
                );
            length += step;
            walk.push(left.swap_remove(next));
        }
        (length, walk)
    });
    let shortest = walks.min_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Found {
        frame,
        markers: shortest
            .into_iter()
            .flat_map(|(_, walk)| walk)
            .map(single)
            .collect(),
    })
}

pub(super) fn check_points(frames: &PointFrames) -> Result<(), RopeError> {
    for (frame, points) in frames.points.iter().enumerate() {
        if points.len() > MOST_POINTS {
            return Err(RopeError::TooManyPoints {
                frame,
                points: points.len(),
                most: MOST_POINTS,
            });
        }
    }
    Ok(())
}

/// Runs a tracker over `order` (frame numbers), which starts with the rope at `markers`; fills
/// `out` and leaves out points that are `taken`.
pub(super) fn run(
    config: Config,
    frames: &PointFrames,
    markers: &[[f32; 3]],
    order: impl Iterator<Item = usize>,
    taken: &dyn Fn(usize, usize) -> bool,
    mut out: impl FnMut(usize, Vec<RopeSample>),
) -> Result<(), ConfigError> {
    let mut tracker = Box::new(Tracker::starting_at(config, markers)?);
    for frame in order {
        let all = &frames.points[frame];
        let free: Vec<usize> = (0..all.len()).filter(|&p| !taken(frame, p)).collect();
        let list: Vec<[f32; 3]> = free.iter().map(|&p| single(all[p])).collect();
        tracker.step(&list);
        let sample = |sample: Sample| widened(&sample, all, &free);
        out(frame, tracker.samples().map(sample).collect());
    }
    Ok(())
}

/// With the point's own place and position, which the tracker has in single precision.
fn widened(sample: &Sample, all: &[DVec3], free: &[usize]) -> RopeSample {
    let [x, y, z] = sample.position.map(f64::from);
    let mut position = DVec3::new(x, y, z);
    let origin = match sample.source {
        Source::Measured(place) => match free.get(usize::from(place)) {
            Some(&point) => {
                position = all[point];
                Origin::Measured(point)
            }
            None => Origin::Filled,
        },
        Source::Predicted => Origin::Filled,
        Source::Lost => Origin::Lost,
    };
    RopeSample {
        position,
        origin,
        gap: u32::from(sample.gap),
        confidence: f64::from(sample.confidence),
    }
}

/// Follows one rope through the capture. O(frames x points x markers)
///
/// Frames before the one in which the rope was found are followed backwards.
///
/// # Errors
/// No rope is found, or a frame has more than [`MOST_POINTS`] points.
pub fn follow(frames: &PointFrames, options: &FollowOptions) -> Result<Trace, RopeError> {
    follow_free(frames, options, &|_, _| false)
}

fn follow_free(
    frames: &PointFrames,
    options: &FollowOptions,
    taken: &dyn Fn(usize, usize) -> bool,
) -> Result<Trace, RopeError> {
    check_points(frames)?;
    let found = match &options.selection {
        Selection::Columns(columns) => listed(frames, columns)?,
        _ => match options.markers {
            Some(markers) => counted(frames, options, markers, taken)?,
            None => find(frames, options, taken)?,
        },
    };
    let config = options.config(frames.rate);
    let count = frames.frame_count();
    let mut samples = vec![Vec::new(); count];
    let mut keep = |frame: usize, list| samples[frame] = list;
    run(
        config,
        frames,
        &found.markers,
        found.frame..count,
        taken,
        &mut keep,
    )?;
    run(
        config,
        frames,
        &found.markers,
        (0..found.frame).rev(),
        taken,
        &mut keep,
    )?;
    Ok(Trace {
        rate: frames.rate,
        start: found.frame,
        frames: samples,
    })
}

/// Follows several ropes, one after the other: a point that one has taken is not another's.
///
/// # Errors
/// As [`follow`]; each of the ropes must be found.
pub fn follow_all(frames: &PointFrames, ropes: &[FollowOptions]) -> Result<Vec<Trace>, RopeError> {
    let mut traces: Vec<Trace> = Vec::with_capacity(ropes.len());
    for options in ropes {
        let trace = {
            let taken = |frame: usize, point: usize| {
                let mut samples = traces.iter().flat_map(|trace| &trace.frames[frame]);
                samples.any(|sample| sample.point() == Some(point))
            };
            follow_free(frames, options, &taken)?
        };
        traces.push(trace);
    }
    Ok(traces)
}
