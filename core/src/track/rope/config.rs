//! What a caller decides, and what is refused.

/// How traces are followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Method {
    /// All points to all traces at once; segment lengths, inertia and gravity in the gaps.
    #[default]
    Joint,
    /// Porter 2012 as published: each trace takes the point nearest to its prediction.
    Published,
}

/// How the start orders the markers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Order {
    /// Along the longest evenly spaced chain; the rope may have any shape, other markers may be
    /// there.
    #[default]
    Spacing,
    /// From the highest (largest Y) down, as published: the rope hangs, and only its markers are
    /// selected.
    Height,
}

/// Which points the start considers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Selection {
    /// All.
    #[default]
    All,
    /// Those inside an axis-aligned box, metres.
    Box {
        /// Smallest coordinates.
        low: [f32; 3],
        /// Largest coordinates.
        high: [f32; 3],
    },
}

/// Settings of a tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Frames a second, 1 to 10,000.
    pub rate: f32,
    /// How traces are followed.
    pub method: Method,
    /// Frames that the start collects, at least 2.
    pub init_frames: u16,
    /// Metres: how far a point may be from where its trace is expected during the start, and from
    /// its prediction in [`Method::Published`].
    pub gamma: f32,
    /// Most frames of the start without a point before a trace is discarded.
    pub max_temp_markers: u16,
    /// [`Method::Published`]: temporary markers in a row before neighbours' positions count.
    pub neighbour_after: u16,
    /// How the start orders the markers.
    pub order: Order,
    /// Which points the start considers.
    pub selection: Selection,
    /// Distance between neighbouring markers in metres; found from the points if `None`.
    pub spacing: Option<f32>,
    /// Markers of the rope; as many as a chain has if `None`.
    pub markers: Option<u16>,
    /// Metres a second squared.
    pub gravity: [f32; 3],
}

impl Config {
    /// The usual settings at `rate` frames a second.
    #[must_use]
    pub const fn new(rate: f32) -> Self {
        Self {
            rate,
            method: Method::Joint,
            init_frames: 20,
            gamma: 0.05,
            max_temp_markers: 6,
            neighbour_after: 1,
            order: Order::Spacing,
            selection: Selection::All,
            spacing: None,
            markers: None,
            gravity: [0.0, -9.81, 0.0],
        }
    }

    /// Refuses numbers out of their ranges. NaN fails every comparison.
    pub(super) fn check(&self, capacity: usize) -> Result<(), ConfigError> {
        if !(self.rate >= 1.0 && self.rate <= 10_000.0) {
            return Err(ConfigError::Rate(self.rate));
        }
        if !(self.gamma > 0.0 && self.gamma <= 10.0) {
            return Err(ConfigError::Gamma(self.gamma));
        }
        if self.init_frames < 2 {
            return Err(ConfigError::InitFrames(self.init_frames));
        }
        if let Some(spacing) = self.spacing
            && !(spacing > 1e-3 && spacing <= 10.0)
        {
            return Err(ConfigError::Spacing(spacing));
        }
        if let Some(markers) = self.markers
            && !(3..=capacity).contains(&usize::from(markers))
        {
            return Err(ConfigError::Markers {
                given: usize::from(markers),
                capacity,
            });
        }
        if !self.gravity.iter().all(|g| g.abs() <= 1_000.0) {
            return Err(ConfigError::Gravity(self.gravity));
        }
        if let Selection::Box { low, high } = self.selection
            && !low.iter().zip(&high).all(|(low, high)| low <= high)
        {
            return Err(ConfigError::EmptyBox { low, high });
        }
        Ok(())
    }
}

/// Refuses ropes that cannot be followed.
pub(super) fn check_rope(positions: &[[f32; 3]], capacity: usize) -> Result<(), ConfigError> {
    if !(3..=capacity).contains(&positions.len()) {
        return Err(ConfigError::Markers {
            given: positions.len(),
            capacity,
        });
    }
    for (index, position) in positions.iter().enumerate() {
        if !position.iter().all(|c| c.abs() < 1e6) {
            return Err(ConfigError::NotANumber { index });
        }
    }
    for (index, (a, b)) in positions.iter().zip(positions.iter().skip(1)).enumerate() {
        let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        if square < 1e-6 {
            return Err(ConfigError::Coincident { index });
        }
    }
    Ok(())
}

/// Settings or a rope that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// `rate` is not between 1 and 10,000 Hz.
    Rate(f32),
    /// `gamma` is not between 0 and 10 m.
    Gamma(f32),
    /// `init_frames` is below 2.
    InitFrames(u16),
    /// `spacing` is not between 1 mm and 10 m.
    Spacing(f32),
    /// Fewer than 3 markers, or more than the tracker has traces.
    Markers {
        /// How many.
        given: usize,
        /// The tracker's `TRACES`.
        capacity: usize,
    },
    /// A component of `gravity` is beyond 1,000 m/s2.
    Gravity([f32; 3]),
    /// A side of the selection box is negative.
    EmptyBox {
        /// Smallest coordinates.
        low: [f32; 3],
        /// Largest coordinates.
        high: [f32; 3],
    },
    /// A marker's position is not a number below 1000 km.
    NotANumber {
        /// Its place in the list.
        index: usize,
    },
    /// A marker and the next one are less than 1 mm apart.
    Coincident {
        /// Place of the first of the two.
        index: usize,
    },
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Rate(rate) => write!(f, "rate is {rate} Hz; give 1 to 10,000"),
            Self::Gamma(gamma) => write!(f, "gamma is {gamma} m; give more than 0, at most 10"),
            Self::InitFrames(frames) => write!(f, "init_frames is {frames}; give at least 2"),
            Self::Spacing(spacing) => write!(f, "spacing is {spacing} m; give 0.001 to 10"),
            Self::Markers { given, capacity } => {
                write!(f, "{given} markers; this tracker takes 3 to {capacity}")
            }
            Self::Gravity([x, y, z]) => {
                write!(
                    f,
                    "gravity is [{x}, {y}, {z}] m/s2; give at most 1,000 each"
                )
            }
            Self::EmptyBox { low, high } => {
                write!(
                    f,
                    "the box from {low:?} to {high:?} is empty; swap its corners"
                )
            }
            Self::NotANumber { index } => {
                write!(f, "marker {index} has no position; give finite metres")
            }
            Self::Coincident { index } => {
                write!(
                    f,
                    "markers {index} and {} are in one place; leave one out",
                    index + 1
                )
            }
        }
    }
}

impl core::error::Error for ConfigError {}
