//! Labels of named trajectories, checked against the body they move with.
//!
//! Enters: a take with names. Leaves: where two trajectories carry each other's marker, and brief
//! sights that are no marker's, each with its evidence.
//!
//! | stage | does |
//! | --- | --- |
//! | `place` | where each marker stands among the markers most rigid with it |
//! | `suspects` | pairs of which one is seen where the other is expected |
//! | `course` | from when to when a pair is exchanged |
//!
//! Places are medians, so they hold where less than half of what is seen of a marker and its
//! neighbours is labelled wrongly. Which of two parts of a take is right cannot be told from the
//! take: the shorter one is called exchanged.

use std::ops::Range;

use super::merge::Progress;
use crate::import::take::PointKind;
use crate::take::Take;

mod course;
mod place;
mod suspects;

use place::{Places, log_density};

/// Two trajectories that carry each other's marker for a while.
#[derive(Clone, Debug, PartialEq)]
pub struct Exchange {
    /// The two columns, the smaller first.
    pub columns: [usize; 2],
    /// Frames in which they are exchanged.
    pub frames: Range<usize>,
    /// Mean distance in metres from where the neighbours expect them, as labelled.
    pub before: f64,
    /// The same once exchanged.
    pub after: f64,
    /// Logarithm of how much likelier the places are once exchanged, summed over independent frames.
    pub odds: f64,
}

/// A brief sight under a name that is not that marker's.
#[derive(Clone, Debug, PartialEq)]
pub struct Stray {
    /// Its column.
    pub column: usize,
    /// Its frames: one run without a gap.
    pub frames: Range<usize>,
    /// Least distance in metres from where the neighbours expect the marker.
    pub distance: f64,
}

/// What is wrong with the names of a take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Misnamed {
    /// In the order in which they were found; to be undone in this order.
    pub exchanges: Vec<Exchange>,
    /// By column and frame, once the exchanges are undone.
    pub strays: Vec<Stray>,
}

/// Rounds: what is undone makes the places truer.
const ROUNDS: usize = 4;
/// Longest stray, seconds.
const BRIEF: f64 = 0.3;
/// A stray is so many metres and deviations from its marker's place in every frame.
const FAR: f64 = 0.03;
const TIMES: f64 = 6.0;

/// Finds exchanged and stray stretches of the named columns. `progress` hears the share done.
///
/// Markers squared times at most 400 frames, then markers times frames; suspect pairs times frames.
#[must_use]
pub fn find(take: &Take, progress: &Progress<'_>) -> Misnamed {
    let named: Vec<usize> = (0..take.marker_count())
        .filter(|&column| take.kinds()[column] == PointKind::Marker)
        .collect();
    let mut found = Misnamed::default();
    let mut take = take.clone();
    for round in 0..ROUNDS {
        let places = Places::learn(&take, &named);
        let pairs = suspects::pairs(&take, &places);
        let mut exchanges: Vec<Exchange> = pairs
            .into_iter()
            .flat_map(|pair| course::follow(&take, &places, pair))
            .collect();
        exchanges.sort_by(|a, b| b.odds.total_cmp(&a.odds));
        let mut made: Vec<Exchange> = Vec::new();
        for one in exchanges {
            // What touches a surer one is looked at again once that is undone.
            if !made.iter().any(|other| meet(&one, other)) {
                exchange(&mut take, &one);
                made.push(one);
            }
        }
        progress((round + 1) as f64 / ROUNDS as f64);
        let is_over = made.is_empty();
        found.exchanges.extend(made);
        if is_over {
            found.strays = strays(&take, &places);
            break;
        }
    }
    progress(1.0);
    found
}

fn meet(a: &Exchange, b: &Exchange) -> bool {
    let share = a.columns.iter().any(|column| b.columns.contains(column));
    share && a.frames.start < b.frames.end && b.frames.start < a.frames.end
}

fn exchange(take: &mut Take, one: &Exchange) {
    let [a, b] = one.columns;
    for frame in one.frames.clone() {
        let (at_a, at_b) = (take.position(a, frame), take.position(b, frame));
        take.set_position(a, frame, at_b);
        take.set_position(b, frame, at_a);
    }
}

impl Misnamed {
    /// Gives exchanged samples back and removes stray ones.
    ///
    /// # Panics
    /// If this was found in another take.
    pub fn undo(&self, take: &mut Take) {
        for one in &self.exchanges {
            exchange(take, one);
        }
        for stray in &self.strays {
            for frame in stray.frames.clone() {
                take.set_position(stray.column, frame, None);
            }
        }
    }

    /// Whether all names are right as far as can be told.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.exchanges.is_empty() && self.strays.is_empty()
    }
}

/// Brief runs that are far from where the neighbours expect them throughout.
fn strays(take: &Take, places: &Places) -> Vec<Stray> {
    let longest = ((BRIEF * take.rate()) as usize).max(1);
    let mut strays = Vec::new();
    for column in places.markers() {
        for frames in take.traces(column).filter(|trace| trace.len() <= longest) {
            let away = frames.clone().map(|frame| {
                let place = places.expect(take, column, frame, column)?;
                let distance = place.position.distance(take.position(column, frame)?);
                (distance > TIMES * place.sigma).then_some(distance)
            });
            let nearest = away.map(|distance| distance.unwrap_or(0.0));
            let distance = nearest.fold(f64::INFINITY, f64::min);
            if distance > FAR && distance.is_finite() {
                strays.push(Stray {
                    column,
                    frames,
                    distance,
                });
            }
        }
    }
    strays
}

#[cfg(test)]
mod tests;
