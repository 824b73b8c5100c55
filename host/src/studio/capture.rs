//! Films a body: what the system hands on, and the truth beside it.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

use super::StudioError;
use super::body::{Body, Surface};
use super::cameras::{Camera, Ring};
use super::error::within;
use super::markers::MarkerSet;
use super::random::Random;
use super::track::Tracker;
use super::visibility::{Seen, Sight};
use crate::spatial::Tree;

/// How a body is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// The cameras.
    pub ring: Ring,
    /// What they make out.
    pub sight: Sight,
    /// Cameras needed to begin a trajectory.
    pub start_cameras: usize,
    /// Cameras needed to keep one.
    pub keep_cameras: usize,
    /// Standard deviation of a measured coordinate, metres.
    pub noise: f64,
    /// Points without a marker that begin in a second.
    pub ghosts_per_second: f64,
    /// Chance that a trajectory which meets another goes on with the other's marker, instead of
    /// breaking.
    pub swap_chance: f64,
    /// Everything that happens by chance follows from it.
    pub seed: u64,
}

impl Default for Shot {
    fn default() -> Self {
        Self {
            ring: Ring::default(),
            sight: Sight::default(),
            start_cameras: 3,
            keep_cameras: 2,
            noise: 0.15e-3,
            ghosts_per_second: 5.0,
            swap_chance: 0.0,
            seed: 0,
        }
    }
}

/// One measured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Which trajectory it belongs to.
    pub trajectory: u32,
    /// Metres.
    pub position: DVec3,
    /// Bit `n` is set if camera `n` saw it.
    pub cameras: u32,
}

/// What really was.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// `[markers]`
    pub names: Vec<String>,
    /// `[frames][markers]`, metres.
    pub positions: Vec<Vec<DVec3>>,
    /// `[frames][samples]`: whose point each sample is; `None` for a ghost.
    pub owners: Vec<Vec<Option<u32>>>,
    /// `[frames][markers]`: bit `n` is set if camera `n` saw the marker.
    pub cameras: Vec<Vec<u32>>,
    /// Trajectories that went over to another marker.
    pub swap_count: usize,
}

/// A virtual capture: unlabelled points with trajectories, and the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Frames a second.
    pub rate: f64,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// `[frames][samples]`, by rising trajectory.
    pub frames: Vec<Vec<Sample>>,
    /// The truth.
    pub truth: Truth,
}

/// Counts of a capture, as in the table 1 of Park & Hodgins 2006.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Frames.
    pub frame_count: usize,
    /// Markers.
    pub marker_count: usize,
    /// Trajectories, ghosts included: "before merging".
    pub trajectory_count: usize,
    /// Trajectories of ghosts.
    pub ghost_count: usize,
    /// Trajectories that went over to another marker.
    pub swap_count: usize,
    /// Samples that are missing: "holes".
    pub missing_count: usize,
    /// The same over all samples.
    pub missing_fraction: f64,
    /// Runs of missing samples.
    pub gap_count: usize,
    /// Mean and longest of them, frames.
    pub mean_gap: f64,
    /// The longest of them, frames.
    pub longest_gap: usize,
    /// Frames in which every marker is there.
    pub complete_frame_count: usize,
    /// Markers missing in the first frame.
    pub missing_at_start: usize,
}

impl Shot {
    fn check(&self) -> Result<Vec<Camera>, StudioError> {
        let cameras = self.ring.cameras()?;
        let count = cameras.len() as f64;
        within(
            "cameras to keep a trajectory",
            self.keep_cameras as f64,
            2.0,
            count,
            "between 2 and the cameras",
        )?;
        within(
            "cameras to start a trajectory",
            self.start_cameras as f64,
            self.keep_cameras as f64,
            count,
            "between those to keep one and all cameras",
        )?;
        within("noise", self.noise, 0.0, 0.1, "between 0 and 0.1 m")?;
        within(
            "ghosts",
            self.ghosts_per_second,
            0.0,
            1e4,
            "between 0 and 10,000 a second",
        )?;
        within("swap chance", self.swap_chance, 0.0, 1.0, "between 0 and 1")?;
        let sight = self.sight;
        within(
            "marker diameter",
            sight.marker_diameter,
            1e-4,
            0.1,
            "between 0.0001 and 0.1 m",
        )?;
        within(
            "facing limit",
            sight.facing_limit,
            0.1,
            1.57,
            "between 0.1 and 1.57 rad",
        )?;
        within(
            "facing spread",
            sight.facing_spread,
            0.0,
            0.5,
            "between 0 and 0.5 rad",
        )?;
        within("chance of a miss", sight.miss, 0.0, 1.0, "between 0 and 1")?;
        within("exposure", sight.exposure, 0.0, 1.0, "between 0 and 1 s")?;
        within("blur", sight.blur, 0.0, 100.0, "between 0 and 100 pixels")?;
        Ok(cameras)
    }

    /// Films a body with markers on it. `progress` hears how many frames are done.
    ///
    /// Frames are seen in parallel; the same seed gives the same capture with any number of
    /// threads. O(frames x (vertices + markers x cameras x log triangles))
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn film(
        &self,
        body: &Body<'_>,
        markers: &MarkerSet,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Capture, StudioError> {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        self.film_with(body, markers, threads, progress)
    }

    /// [`Self::film`] with this many threads.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn film_with(
        &self,
        body: &Body<'_>,
        markers: &MarkerSet,
        threads: usize,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Capture, StudioError> {
        let cameras = self.check()?;
        let frame_count = body.frame_count();
        let done = AtomicUsize::new(0);
        let mut views: Vec<View> = vec![View::default(); frame_count];
        let chunk = frame_count.div_ceil(threads.max(1));
        let rest = Tree::new(&body.avatar().mesh.triangles, &body.avatar().mesh.positions);
        std::thread::scope(|scope| {
            for (part, views) in views.chunks_mut(chunk.max(1)).enumerate() {
                let (rest, cameras, done) = (&rest, &cameras, &done);
                scope.spawn(move || {
                    let mut tree = rest.clone();
                    let mut surface = Surface::default();
                    // The frame before the part gives the speeds in its first.
                    body.surface_into((part * chunk).saturating_sub(1), &mut surface);
                    let mut before = markers.positions(&surface);
                    for (at, view) in views.iter_mut().enumerate() {
                        let frame = part * chunk + at;
                        body.surface_into(frame, &mut surface);
                        tree.refit(&surface.positions);
                        let points = markers.positions(&surface);
                        let speeds = speeds(&before, &points, body.scene().rate);
                        let normals = markers.normals(&surface);
                        let mut random = self.luck(frame);
                        let seen = self.sight.look(
                            &tree,
                            cameras,
                            &points,
                            &normals,
                            &speeds,
                            &mut random,
                        );
                        before.clone_from(&points);
                        *view = View { points, seen };
                        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                    }
                });
            }
        });
        Ok(self.track(body.scene().rate, cameras, markers, views))
    }

    /// One stream a frame, so that the frames may be seen in any order.
    fn luck(&self, frame: usize) -> Random {
        let of_seed = Random::new(self.seed.wrapping_add(0xF1F0)).bits();
        Random::new(of_seed ^ (frame as u64).wrapping_mul(0xD134_2543_DE82_EF95))
    }

    fn track(
        &self,
        rate: f64,
        cameras: Vec<Camera>,
        markers: &MarkerSet,
        views: Vec<View>,
    ) -> Capture {
        let mut tracker = Tracker::new(markers.markers.len(), self.seed);
        let mut capture = Capture {
            rate,
            cameras,
            frames: Vec::with_capacity(views.len()),
            truth: Truth {
                names: markers
                    .markers
                    .iter()
                    .map(|marker| marker.name.clone())
                    .collect(),
                positions: Vec::with_capacity(views.len()),
                owners: Vec::with_capacity(views.len()),
                cameras: Vec::with_capacity(views.len()),
                swap_count: 0,
            },
        };
        let truth = &mut capture.truth;
        for view in views {
            let (samples, owners) = tracker.step(self, rate, &view.seen).into_iter().unzip();
            capture.frames.push(samples);
            truth.owners.push(owners);
            truth
                .cameras
                .push(view.seen.iter().map(|seen| seen.cameras).collect());
            truth.positions.push(view.points);
        }
        truth.swap_count = tracker.swap_count;
        capture
    }
}

/// Metres a second between two frames.
fn speeds(before: &[DVec3], now: &[DVec3], rate: f64) -> Vec<f64> {
    let pairs = before.iter().zip(now);
    pairs
        .map(|(before, now)| before.distance(*now) * rate)
        .collect()
}

/// One frame before tracking.
#[derive(Clone, Debug, Default)]
struct View {
    points: Vec<DVec3>,
    seen: Vec<Seen>,
}

impl Capture {
    /// How many trajectories there are.
    #[must_use]
    pub fn trajectory_count(&self) -> usize {
        let ids = self
            .frames
            .iter()
            .flatten()
            .map(|sample| sample.trajectory as usize + 1);
        ids.max().unwrap_or(0)
    }

    /// `[frames][markers]`: the measured points under their true names, missing where there is
    /// none: what a perfect merging would give. O(samples)
    #[must_use]
    pub fn labelled(&self) -> Vec<Vec<Option<DVec3>>> {
        let marker_count = self.truth.names.len();
        let frames = self.frames.iter().zip(&self.truth.owners);
        let of = |(samples, owners): (&Vec<Sample>, &Vec<Option<u32>>)| {
            let mut row = vec![None; marker_count];
            for (sample, owner) in samples.iter().zip(owners) {
                if let Some(owner) = owner {
                    row[*owner as usize] = Some(sample.position);
                }
            }
            row
        };
        frames.map(of).collect()
    }

    /// Counts. O(samples)
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        let (frame_count, marker_count) = (self.frames.len(), self.truth.names.len());
        let labelled = self.labelled();
        let mut out = Statistics {
            frame_count,
            marker_count,
            trajectory_count: self.trajectory_count(),
            swap_count: self.truth.swap_count,
            ..Statistics::default()
        };
        let mut ghosts: HashMap<u32, bool> = HashMap::new();
        for (samples, owners) in self.frames.iter().zip(&self.truth.owners) {
            for (sample, owner) in samples.iter().zip(owners) {
                *ghosts.entry(sample.trajectory).or_insert(true) &= owner.is_none();
            }
        }
        out.ghost_count = ghosts.values().filter(|ghost| **ghost).count();
        for marker in 0..marker_count {
            let mut length = 0;
            for row in &labelled {
                if row[marker].is_some() {
                    length = 0;
                    continue;
                }
                length += 1;
                out.missing_count += 1;
                out.gap_count += usize::from(length == 1);
                out.longest_gap = out.longest_gap.max(length);
            }
        }
        let complete = |row: &&Vec<Option<DVec3>>| row.iter().all(Option::is_some);
        out.complete_frame_count = labelled.iter().filter(complete).count();
        let first = labelled.first().into_iter().flatten();
        out.missing_at_start = first.filter(|point| point.is_none()).count();
        out.missing_fraction =
            out.missing_count as f64 / (frame_count * marker_count).max(1) as f64;
        out.mean_gap = out.missing_count as f64 / out.gap_count.max(1) as f64;
        out
    }

    /// `[frames]`: the share of markers that have a point. O(samples)
    #[must_use]
    pub fn visible_fractions(&self) -> Vec<f64> {
        let marker_count = self.truth.names.len().max(1) as f64;
        let owned = |owners: &Vec<Option<u32>>| owners.iter().flatten().count() as f64;
        self.truth
            .owners
            .iter()
            .map(|owners| owned(owners) / marker_count)
            .collect()
    }
}
