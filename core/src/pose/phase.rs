//! Loops that keep step: clips of different lengths, brought to the same phase by marks.

/// A loop with marks that mean the same in all loops which keep step, such as the moments at which
/// the left and the right foot come down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop<'m> {
    /// Seconds, above 0.
    pub duration: f32,
    /// Seconds, ascending, from 0 to below the duration. Without any, the start is the only one.
    pub marks: &'m [f32],
}

impl Loop<'_> {
    /// How many stretches the marks make.
    #[must_use]
    pub fn stretches(&self) -> usize {
        self.marks.len().max(1)
    }

    /// Start and length of a stretch, seconds; it may end beyond the loop's end.
    fn stretch(&self, index: usize) -> (f32, f32) {
        let start = self.marks.get(index).copied().unwrap_or(0.0);
        let first = self.marks.first().copied().unwrap_or(0.0);
        let end = match self.marks.get(index + 1) {
            Some(&end) => end,
            None => first + self.duration,
        };
        (start, end - start)
    }

    /// Seconds into the loop at a phase: whole numbers are marks, 0 the first. O(1)
    #[must_use]
    pub fn seconds_at(&self, phase: f32) -> f32 {
        let (index, fraction) = split(phase, self.stretches());
        let (start, length) = self.stretch(index);
        let seconds = start + length * fraction;
        if seconds >= self.duration {
            seconds - self.duration
        } else {
            seconds
        }
    }

    /// The phase at a time within the loop, seconds. O(marks)
    #[must_use]
    pub fn phase_at(&self, seconds: f32) -> f32 {
        let after = self.marks.partition_point(|&mark| mark <= seconds);
        let (index, seconds) = match after.checked_sub(1) {
            Some(index) => (index, seconds),
            // Before the first mark runs the last stretch.
            None if self.marks.is_empty() => (0, seconds),
            None => (self.marks.len() - 1, seconds + self.duration),
        };
        let (start, length) = self.stretch(index);
        let fraction = if length > 0.0 {
            (seconds - start) / length
        } else {
            0.0
        };
        index as f32 + fraction.clamp(0.0, 0.999_999_9)
    }
}

/// Advances the common phase of loops by `seconds`; a stretch lasts as long as the loops' own on
/// weighted average.
///
/// `weights: [loops]`, those not above 0 do not count; where none counts the phase stays. Loops with
/// another number of stretches than the first do not count either. A step may cross at most
/// `MOST_STRETCHES` marks; what is beyond is left out. O(loops x marks crossed)
#[must_use]
pub fn advance(phase: f32, seconds: f32, loops: &[Loop<'_>], weights: &[f32]) -> f32 {
    let count = loops.first().map_or(1, Loop::stretches);
    let (mut index, mut fraction) = split(phase, count);
    if !(0.0..f32::INFINITY).contains(&seconds) {
        return index as f32 + fraction;
    }
    let mut left = seconds;
    for _ in 0..MOST_STRETCHES {
        let (mut sum, mut whole) = (0.0, 0.0);
        for (one, &weight) in loops.iter().zip(weights) {
            if weight > 0.0 && weight < f32::INFINITY && one.stretches() == count {
                sum += weight * one.stretch(index).1;
                whole += weight;
            }
        }
        let length = sum / whole;
        // Neither holds for a NaN.
        if !(length > 0.0 && length < f32::INFINITY) {
            break;
        }
        let rest = (1.0 - fraction) * length;
        if left < rest {
            fraction += left / length;
            break;
        }
        left -= rest;
        fraction = 0.0;
        index = if index + 1 < count { index + 1 } else { 0 };
    }
    index as f32 + fraction.min(0.999_999_9)
}

/// Most marks that one step of [`advance`] crosses.
pub const MOST_STRETCHES: usize = 64;

/// A phase as stretch and fraction; one that is no number or out of range starts afresh.
fn split(phase: f32, count: usize) -> (usize, f32) {
    if !(phase >= 0.0 && phase < count as f32) {
        return (0, 0.0);
    }
    let index = phase as usize;
    (index, phase - index as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALK: Loop<'_> = Loop {
        duration: 1.2,
        marks: &[0.1, 0.7],
    };
    const RUN: Loop<'_> = Loop {
        duration: 0.8,
        marks: &[0.3, 0.7],
    };

    #[test]
    fn marks_are_whole_phases_and_come_back() {
        for one in [WALK, RUN] {
            assert_eq!(one.seconds_at(0.0), one.marks[0]);
            assert_eq!(one.seconds_at(1.0), one.marks[1]);
            for step in 0..80 {
                let seconds = one.duration * step as f32 / 80.0;
                let back = one.seconds_at(one.phase_at(seconds));
                assert!((back - seconds).abs() < 1e-5, "{seconds} {back}");
            }
        }
        let plain = Loop {
            duration: 2.0,
            marks: &[],
        };
        assert_eq!(plain.seconds_at(0.25), 0.5);
        assert_eq!(plain.phase_at(0.5), 0.25);
        assert_eq!(plain.seconds_at(f32::NAN), 0.0);
    }

    #[test]
    fn a_mixed_loop_lasts_as_long_as_its_weights_say() {
        let loops = [WALK, RUN];
        for (weights, lasts) in [([1.0, 0.0], 1.2), ([0.0, 3.0], 0.8), ([1.0, 1.0], 1.0)] {
            let mut phase = 0.25;
            let mut rounds = 0;
            let steps = 1000;
            for _ in 0..steps {
                let next = advance(phase, lasts / 100.0, &loops, &weights);
                rounds += u32::from(next < phase);
                phase = next;
            }
            assert_eq!(rounds, 10);
            assert!((phase - 0.25).abs() < 1e-3, "{phase}");
        }
        assert_eq!(advance(0.5, f32::NAN, &loops, &[1.0, 1.0]), 0.5);
        assert_eq!(advance(0.5, 0.1, &loops, &[0.0, f32::NAN]), 0.5);
        assert!(advance(0.5, 1e30, &loops, &[1.0, 1.0]) < 2.0);
    }
}
