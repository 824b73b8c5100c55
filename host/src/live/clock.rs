//! What of a stream is new, and how late it comes.
//!
//! Sender and receiver need no common clock: the quickest datagram of the last half minute counts as
//! having taken no time, and every other is as late as it took longer.

use std::collections::VecDeque;

/// What to do with a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Newer than all before.
    New,
    /// More of the newest frame.
    More,
    /// An older frame than the newest: not to be shown.
    Late,
    /// On its way for longer than is allowed: not to be shown.
    Stale,
}

/// Seconds after which the quickest datagram is forgotten, so that clocks may drift apart.
const MEMORY: f64 = 30.0;

/// A sender whose time falls back by more has started again.
const RESTART: f64 = 2.0;

/// Sender's time against arrival.
#[derive(Clone, Debug)]
pub struct Clock {
    allowed: f64,
    newest: Option<f64>,
    /// Of the memory's two halves: when it began, the least of arrival less sending.
    least: [Option<(f64, f64)>; 2],
    /// How many times the sender has started again.
    pub restarts: u64,
}

impl Clock {
    /// Datagrams that take over `allowed` seconds longer than the quickest are stale.
    #[must_use]
    pub fn new(allowed: f64) -> Self {
        Self {
            allowed,
            newest: None,
            least: [None; 2],
            restarts: 0,
        }
    }

    /// Judges a datagram by the sender's time and its arrival, both seconds. The second value is how
    /// much longer than the quickest it took.
    pub fn judge(&mut self, sent: f64, arrived: f64) -> (Verdict, f64) {
        if self.newest.is_some_and(|newest| sent < newest - RESTART) {
            self.restarts += 1;
            self.newest = None;
            self.least = [None; 2];
        }
        let took = arrived - sent;
        let [now, before] = &mut self.least;
        if now.is_some_and(|(began, _)| arrived - began > MEMORY / 2.0) {
            *before = now.take();
        }
        let (_, least) = now.get_or_insert((arrived, took));
        *least = least.min(took);
        let least = before.map_or(*least, |(_, before)| least.min(before));
        let longer = took - least;
        let verdict = match self.newest {
            Some(newest) if sent < newest => Verdict::Late,
            _ if longer > self.allowed => Verdict::Stale,
            Some(newest) if sent == newest => Verdict::More,
            _ => Verdict::New,
        };
        if matches!(verdict, Verdict::New) {
            self.newest = Some(sent);
        }
        (verdict, longer)
    }
}

/// How many frames never came, where frames carry no number: gaps in the sender's time over the
/// usual gap.
#[derive(Clone, Debug, Default)]
pub struct Missing {
    last: Option<f64>,
    gaps: VecDeque<f64>,
    count: u64,
}

impl Missing {
    /// Takes note of a new frame.
    pub fn frame(&mut self, sent: f64) {
        let gap = self.last.replace(sent).map(|last| sent - last);
        let Some(gap) = gap.filter(|gap| *gap > 0.0 && *gap < RESTART) else {
            return;
        };
        self.gaps.push_back(gap);
        if self.gaps.len() > 31 {
            self.gaps.pop_front();
        }
        let mut sorted: Vec<f64> = self.gaps.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted[sorted.len() / 2];
        self.count += ((gap / usual).round() as u64).saturating_sub(1);
    }

    /// So far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// Latencies in steps of a tenth of a millisecond, up to a second.
#[derive(Clone, Debug)]
pub struct Latencies {
    steps: Vec<u64>,
    count: u64,
    largest: f64,
}

const STEP: f64 = 1e-4;

impl Default for Latencies {
    fn default() -> Self {
        Self {
            steps: vec![0; 10_000],
            count: 0,
            largest: 0.0,
        }
    }
}

impl Latencies {
    /// Adds one, seconds.
    pub fn add(&mut self, seconds: f64) {
        let step = (seconds / STEP) as usize;
        let last = self.steps.len() - 1;
        self.steps[step.min(last)] += 1;
        self.count += 1;
        self.largest = self.largest.max(seconds);
    }

    /// Seconds that a part of all stay within, `part` from 0 to 1.
    #[must_use]
    pub fn within(&self, part: f64) -> f64 {
        let wanted = (part * self.count as f64).ceil() as u64;
        let mut seen = 0;
        for (step, count) in self.steps.iter().enumerate() {
            seen += count;
            if seen >= wanted {
                return (STEP * (step + 1) as f64).min(self.largest);
            }
        }
        self.largest
    }

    /// The largest, seconds.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn older_frames_and_slow_ones_are_not_new() {
        let mut clock = Clock::new(0.05);
        assert_eq!(clock.judge(10.0, 100.0), (Verdict::New, 0.0));
        assert_eq!(clock.judge(10.0, 100.001).0, Verdict::More);
        assert_eq!(clock.judge(10.02, 100.02).0, Verdict::New);
        assert_eq!(clock.judge(10.01, 100.021).0, Verdict::Late);
        let (verdict, longer) = clock.judge(10.03, 100.1);
        assert_eq!(verdict, Verdict::Stale);
        assert!((longer - 0.07).abs() < 1e-9);
        assert_eq!(clock.judge(10.1, 100.1).0, Verdict::New);
        assert_eq!(clock.judge(0.0, 101.0).0, Verdict::New);
        assert_eq!(clock.restarts, 1);
    }

    #[test]
    fn clocks_that_drift_apart_are_followed() {
        // A second in a thousand: after ten minutes they are 0.6 s apart.
        let mut clock = Clock::new(0.05);
        for frame in 0..72_000 {
            let sent = f64::from(frame) / 120.0;
            let (verdict, _) = clock.judge(sent, 1.001 * sent);
            assert_eq!(verdict, Verdict::New, "frame {frame}");
        }
    }

    #[test]
    fn missing_frames_and_latencies_are_counted() {
        let mut missing = Missing::default();
        for frame in (0..100).filter(|frame| ![20, 50, 51].contains(frame)) {
            missing.frame(f64::from(frame) * 0.01);
        }
        assert_eq!(missing.count(), 3);
        let mut latencies = Latencies::default();
        (1..=100).for_each(|n| latencies.add(f64::from(n) * 1e-3));
        assert!((latencies.within(0.5) - 0.05).abs() < 2e-4);
        assert!((latencies.within(0.99) - 0.099).abs() < 2e-4);
        assert_eq!(latencies.largest(), 0.1);
    }
}
