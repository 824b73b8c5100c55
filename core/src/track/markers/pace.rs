//! Settings, and what they come to a frame.

/// What the model does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// Frames a second, 1 to 10,000.
    pub rate: f32,
    /// Standard deviation of a measured coordinate, metres.
    pub noise: f32,
    /// Inner steps that a frame may spend on seeking lost markers; see [`super::work_bound`].
    pub search: u32,
    /// Seconds in which what is shown meets a marker that comes back; 0 shows it at once.
    pub blend: f32,
    /// A fill with a larger standard deviation an axis counts as lost, metres.
    pub limit: f32,
}

impl Config {
    /// Settings for a frame rate, with a search of [`Self::default_search`].
    #[must_use]
    pub fn new(rate: f32, dims: &super::MarkerDims) -> Self {
        Self {
            rate,
            noise: 0.5e-3,
            search: Self::default_search(dims),
            blend: 0.06,
            limit: 0.05,
        }
    }

    /// Steps that find a set within a few frames: 100 a marker.
    #[must_use]
    pub const fn default_search(dims: &super::MarkerDims) -> u32 {
        100 * dims.marker_count as u32
    }
}

/// Times in frames, and shares a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Seconds a frame.
    pub step: f32,
    /// Gains of the fading-memory filter on velocity and acceleration (Morrison 1969), at most.
    pub velocity_gain: f32,
    pub acceleration_gain: f32,
    /// Variance of a coordinate that motion alone may add in a frame, square metres.
    pub jerk: f32,
    /// The same where the velocity is unknown.
    pub sprint: f32,
    /// What coasting adds: standard deviation a squared frame, metres.
    pub swerve: f32,
    /// Share of an offset that a frame keeps, and of a slope.
    pub blend: f32,
    pub slope: f32,
    /// Share of a velocity that coasting keeps.
    pub coast: f32,
    /// Share of a new value in a bias.
    pub bias: f32,
    /// Frames of patience with a poor frame, and with none at all.
    pub patience: u16,
    pub blank: u16,
    /// Frames after which a fill may have gone astray.
    pub old: u16,
    /// Frames after which a labelling that leaves points over is doubted.
    pub doubtful: u16,
    /// Markers that are compared with their neighbours in a frame.
    pub reviews: usize,
}

/// Every marker is compared with its neighbours once in so many frames.
pub(super) const REVIEW: usize = 8;

impl Pace {
    pub fn new(config: &Config, markers: usize) -> Self {
        let rate = config.rate.clamp(1.0, 1e4);
        let step = 1.0 / rate;
        // At low rates the motion between two frames outweighs the noise: a shorter memory.
        let theta = (0.1 + 0.003 * rate).min(0.6);
        let fresh = 1.0 - theta;
        let share = |seconds: f32| step / (seconds + step);
        Self {
            step,
            velocity_gain: 1.5 * (1.0 - theta * theta) * fresh,
            acceleration_gain: fresh * fresh * fresh,
            jerk: square(0.5 * 40.0 * step * step) + square(2.0 * config.noise),
            sprint: square(1.5 * step) + square(2.0 * config.noise),
            swerve: 0.5 * 25.0 * step * step,
            blend: if config.blend > 0.0 {
                1.0 - share(config.blend / 3.0)
            } else {
                0.0
            },
            slope: 1.0 - share(0.05),
            coast: 1.0 - share(0.15),
            bias: REVIEW as f32 * share(1.0),
            patience: ((0.1 * rate) as u16).max(3),
            blank: ((0.12 * rate) as u16).max(2),
            doubtful: ((0.04 * rate) as u16).max(2),
            old: ((0.25 * rate) as u16).max(4),
            reviews: markers.div_ceil(REVIEW),
        }
    }
}

pub(super) fn square(x: f32) -> f32 {
    x * x
}
