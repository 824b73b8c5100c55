//! Missing samples, estimated from neighbours and from the marker's own past and future.
//!
//! Enters: a [`Take`] with gaps. Leaves: the take without them, and the standard deviation of each
//! filled sample. The default learns a local regression (`regression`) and weighs it against
//! inertia (`smoother`) by how both err; how far its deviations can be trusted is measured
//! (`trust`); the published principal components and plain
//! interpolation stand beside it for comparison. Park & Hodgins 2006, section 4.3.

use std::ops::Range;

use glam::DVec3;

use crate::take::Take;

mod baseline;
mod drift;
mod pca;
mod plan;
pub(crate) mod regression;
mod smoother;
mod trust;
mod view;
mod window;

pub(crate) use plan::in_parallel;
pub(crate) use view::View;

/// How missing samples are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FillMethod {
    /// Ridge regression in a local frame, weighed against inertia.
    #[default]
    Regression,
    /// Principal components of each neighbourhood, 99 % of the variance, as published.
    Pca,
    /// Natural cubic splines in time.
    Spline,
    /// Straight lines in time.
    Linear,
}

/// What [`fill`] is asked to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillOptions {
    /// How samples are estimated.
    pub method: FillMethod,
    /// Estimates with a larger standard deviation an axis, in metres, are left missing. Only the
    /// default method states deviations.
    pub limit: f64,
}

impl Default for FillOptions {
    fn default() -> Self {
        Self {
            method: FillMethod::default(),
            limit: 0.05,
        }
    }
}

/// A take after filling.
#[derive(Clone, Debug, PartialEq)]
pub struct Filled {
    /// The take; missing where no estimate was good enough.
    pub take: Take,
    /// `[markers x frames]`, metres: 0 where measured, the standard deviation an axis where filled
    /// (infinite where the method states none), NaN where missing.
    pub sigma: Vec<f32>,
}

impl Filled {
    /// How many samples were filled.
    #[must_use]
    pub fn filled_count(&self) -> usize {
        self.sigma.iter().filter(|sigma| **sigma > 0.0).count()
    }

    /// Standard deviation an axis of one sample in metres: 0 where measured, NaN where missing.
    ///
    /// # Panics
    /// If the marker or the frame does not exist.
    #[must_use]
    pub fn sigma(&self, marker: usize, frame: usize) -> f32 {
        assert!(
            frame < self.take.frame_count(),
            "frame {frame} does not exist"
        );
        self.sigma[marker * self.take.frame_count() + frame]
    }
}

/// Fills every gap of every marker.
///
/// Markers that were never seen stay missing. `progress` is called with each finished marker, from
/// several threads; the result does not depend on them. Linear in missing samples, and in frames
/// for each marker with gaps.
pub fn fill(take: &Take, options: &FillOptions, progress: &(dyn Fn() + Sync)) -> Filled {
    let markers: Vec<usize> = (0..take.marker_count()).collect();
    fill_markers(take, &markers, options, progress)
}

/// [`fill`], only for some markers; gaps of the others stay.
///
/// # Panics
/// If a marker does not exist.
pub fn fill_markers(
    take: &Take,
    markers: &[usize],
    options: &FillOptions,
    progress: &(dyn Fn() + Sync),
) -> Filled {
    let mut filled = Filled {
        sigma: measured_sigma(take),
        take: take.clone(),
    };
    match options.method {
        FillMethod::Regression => plan::run(&mut filled, markers, options.limit, progress),
        FillMethod::Pca => {
            let source = filled.clone();
            for &marker in markers {
                fill_by_components(&source, marker, &mut filled);
                progress();
            }
        }
        FillMethod::Spline | FillMethod::Linear => {
            for &marker in markers {
                let path = take.trajectory(marker);
                let path = if options.method == FillMethod::Spline {
                    baseline::spline(path)
                } else {
                    baseline::linear(path)
                };
                for gap in take.gaps(marker) {
                    for frame in gap {
                        filled.set(marker, frame, path[frame], f64::INFINITY);
                    }
                }
                progress();
            }
        }
    }
    filled
}

/// Gaps that no ring can fill fall back to straight lines.
fn fill_by_components(source: &Filled, marker: usize, filled: &mut Filled) {
    let frames: Vec<usize> = source.take.gaps(marker).flatten().collect();
    if frames.is_empty() {
        return;
    }
    let view = source.view();
    let found = pca::estimate(&view, marker, &frames);
    let line = baseline::linear(source.take.trajectory(marker));
    for (&frame, position) in frames.iter().zip(found) {
        let position = position.unwrap_or(line[frame]);
        filled.set(marker, frame, position, f64::INFINITY);
    }
}

fn measured_sigma(take: &Take) -> Vec<f32> {
    let markers = 0..take.marker_count();
    let sigma = |position: &DVec3| if position.is_nan() { f32::NAN } else { 0.0 };
    markers
        .flat_map(|marker| take.trajectory(marker).iter().map(sigma))
        .collect()
}

impl Filled {
    pub(in crate::clean) fn view(&self) -> View<'_> {
        View {
            take: &self.take,
            sigma: &self.sigma,
        }
    }

    fn set(&mut self, marker: usize, frame: usize, position: DVec3, sigma: f64) {
        if position.is_finite() {
            self.take.set_position(marker, frame, Some(position));
            self.sigma[marker * self.take.frame_count() + frame] = sigma as f32;
        }
    }
}

/// Gaps of one marker that are so close that they are solved together.
type Cluster = Range<usize>;

#[cfg(test)]
mod tests;
