//! From values to pixels, and round numbers to label.

/// A linear scale from values to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Value at `start`.
    pub low: f64,
    /// Value at `end`.
    pub high: f64,
    /// Pixel of `low`.
    pub start: f64,
    /// Pixel of `high`; less than `start` on an axis that runs upward.
    pub end: f64,
}

impl Axis {
    pub fn pixel(&self, value: f64) -> f64 {
        self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)
    }

    /// Round values in the range, at most about `most` of them.
    pub fn ticks(&self, most: usize) -> Ticks {
        Ticks::new(self.low, self.high, most)
    }
}

/// Values at a constant step of 1, 2 or 5 times a power of ten (Heckbert 1990, *Nice numbers for
/// graph labels*).
pub(super) struct Ticks {
    pub values: Vec<f64>,
    step: f64,
}

impl Ticks {
    pub fn new(low: f64, high: f64, most: usize) -> Self {
        let step = nice_step(high - low, most);
        // A hair of slack keeps a tick that rounding puts just outside.
        let first = (low / step - 1e-9).ceil();
        let count = ((high / step + 1e-9).floor() - first).clamp(0.0, 1000.0) as usize;
        let values = (0..=count).map(|k| (first + k as f64) * step);
        Self {
            // Adding zero turns -0 into 0.
            values: values.map(|value| value + 0.0).collect(),
            step,
        }
    }

    /// The value with as many decimals as the step needs.
    pub fn label(&self, value: f64) -> String {
        let largest = self
            .values
            .iter()
            .fold(self.step, |most, value| most.max(value.abs()));
        if largest >= 1e7 || self.step < 1e-5 {
            let digits = (largest.log10().floor() - self.step.log10().floor()).clamp(0.0, 12.0);
            return if value == 0.0 {
                "0".to_owned()
            } else {
                format!("{value:.*e}", digits as usize)
            };
        }
        let decimals = (-self.step.log10() - 1e-9).ceil().max(0.0);
        format!("{value:.*}", decimals as usize)
    }
}

/// The least round step that divides `range` into at most `most` parts.
pub(super) fn nice_step(range: f64, most: usize) -> f64 {
    let raw = range / most.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let nice = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|nice| nice * power >= raw * (1.0 - 1e-9));
    nice.unwrap_or(10.0) * power
}

/// The range of the finite `values`, widened where it is empty or a single value.
pub(super) fn range_of(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] = values
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        });
    (low <= high).then(|| widened([low, high]))
}

/// A range that can be divided by: finite, ascending and wider than rounding.
pub(super) fn widened([low, high]: [f64; 2]) -> [f64; 2] {
    // Beyond this, differences overflow.
    let clamp = |value: f64| {
        if value.is_nan() {
            0.0
        } else {
            value.clamp(-1e300, 1e300)
        }
    };
    let (low, high) = (clamp(low.min(high)), clamp(high.max(low)));
    let least = low.abs().max(high.abs()) * 1e-9;
    if high - low > least.max(1e-290) {
        [low, high]
    } else {
        let half = (low.abs() * 0.1).max(if low == 0.0 { 0.5 } else { least });
        [low - half, high + half]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        assert_eq!(nice_step(10.0, 5), 2.0);
        assert_eq!(nice_step(10.0, 4), 5.0);
        assert_eq!(nice_step(0.7, 10), 0.1);
        assert!((nice_step(0.9, 3) - 0.5).abs() < 1e-12);
        assert_eq!(nice_step(1.0, 1), 1.0);
    }

    #[test]
    fn ticks_carry_the_needed_decimals() {
        let labels = |low, high, most| -> Vec<String> {
            let ticks = Ticks::new(low, high, most);
            ticks
                .values
                .iter()
                .map(|&value| ticks.label(value))
                .collect()
        };
        assert_eq!(
            labels(0.0, 1.0, 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(labels(-3.0, 9.0, 3), ["0", "5"]);
        assert_eq!(labels(-0.2, 0.1, 3), ["-0.2", "-0.1", "0.0", "0.1"]);
        assert_eq!(labels(0.0, 3e8, 3), ["0", "1e8", "2e8", "3e8"]);
        assert_eq!(labels(0.0, 2e-7, 2), ["0", "1e-7", "2e-7"]);
    }

    #[test]
    fn any_range_can_be_divided_by() {
        assert_eq!(range_of([3.0, f64::NAN, 1.0].into_iter()), Some([1.0, 3.0]));
        assert_eq!(range_of([f64::INFINITY].into_iter()), None);
        for range in [
            [0.0, 0.0],
            [5.0, 5.0],
            [-1e-300, -1e-300],
            [f64::NAN, f64::INFINITY],
            [9.0, 1.0],
        ] {
            let [low, high] = widened(range);
            assert!(high > low && (high - low).is_finite(), "{range:?}");
            assert!(Ticks::new(low, high, 5).values.len() < 20, "{range:?}");
        }
    }
}
