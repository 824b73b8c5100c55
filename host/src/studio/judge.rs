//! How well a cleaned capture agrees with the truth.
//!
//! Enters: the truth of a [`Capture`], and what [`merge`](crate::clean::merge::merge) and
//! [`fill`](crate::clean::fill::fill) made of the points. Leaves: the counts of table 1 of Park &
//! Hodgins 2006, and the errors of the filled samples.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::capture::Capture;
use super::files::Trajectory;
use crate::clean::fill::Filled;
use crate::clean::merge::Merged;
use crate::take::{Take, TakeError};

/// What a capture's points really are.
#[derive(Clone, Debug)]
pub struct Key {
    /// Whose points each partial trajectory holds.
    pub trajectories: Vec<Trajectory>,
    /// Where every marker really was.
    pub truth: Take,
}

/// The counts of table 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labels {
    /// Partial trajectories that hold a marker's points, one for each marker that they follow.
    pub real: usize,
    /// Partial trajectories of ghosts.
    pub ghosts: usize,
    /// Markers that were seen at all.
    pub markers: usize,
    /// Markers of the result.
    pub found: usize,
    /// Partial trajectories, and ghosts, that were given to a marker that is not theirs; a second
    /// marker of the result for one true marker counts with all that it holds.
    pub wrong: usize,
    /// Partial trajectories of markers that were taken for ghosts: left to merge by hand.
    pub left: usize,
    /// Ghosts that were told as such.
    pub ghosts_told: usize,
    /// Samples that carry a wrong label.
    pub wrong_samples: usize,
    /// Samples of markers that carry a label.
    pub labelled_samples: usize,
    /// `[markers of the result]`: which true marker each is.
    pub true_marker: Vec<Option<u32>>,
    /// What went wrong: column, first frame, frames, true marker, given marker.
    pub faults: Vec<Fault>,
}

/// A partial trajectory that was judged wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Column of the capture.
    pub column: usize,
    /// Its first frame.
    pub first_frame: usize,
    /// Samples.
    pub frame_count: usize,
    /// Whose points they are; `None` for a ghost.
    pub marker: Option<u32>,
    /// Which true marker it was given to; `None` if it was left as a ghost.
    pub given: Option<u32>,
}

impl Key {
    /// The truth of a capture.
    ///
    /// # Errors
    /// Never for a capture that was filmed.
    pub fn new(capture: &Capture) -> Result<Self, TakeError> {
        Ok(Self {
            trajectories: capture.trajectories(),
            truth: capture.truth_take()?,
        })
    }

    /// Whether the truth is that of a take's points; if not, why.
    ///
    /// # Errors
    /// Frames or trajectories that the take does not have.
    pub fn check(&self, take: &Take) -> Result<(), String> {
        let (frames, columns) = (take.frame_count(), take.marker_count());
        if self.truth.frame_count() != frames {
            let found = self.truth.frame_count();
            return Err(format!(
                "the truth has {found} frames, the capture {frames}"
            ));
        }
        for one in &self.trajectories {
            for span in &one.spans {
                let end = span.first_frame.saturating_add(span.frame_count);
                if one.column >= columns || end > frames {
                    return Err(format!(
                        "a trajectory lies in column {}, frames {} to {end}; the capture has {columns} \
                         columns and {frames} frames",
                        one.column, span.first_frame
                    ));
                }
                if span
                    .marker
                    .is_some_and(|at| at as usize >= self.truth.marker_count())
                {
                    return Err("a trajectory names a marker that the truth does not have".into());
                }
            }
        }
        Ok(())
    }

    /// `[columns][frames]`: whose points a column holds; ghosts are `None` as well.
    fn owners(&self) -> Vec<Vec<Option<u32>>> {
        let frames = self.truth.frame_count();
        let columns = self.trajectories.iter().map(|one| one.column + 1).max();
        let mut owners = vec![vec![None; frames]; columns.unwrap_or(0)];
        for one in &self.trajectories {
            for span in &one.spans {
                let range = span.first_frame..span.first_frame + span.frame_count;
                owners[one.column][range].fill(span.marker);
            }
        }
        owners
    }

    /// Judges labels. Linear in samples.
    #[must_use]
    pub fn labels(&self, merged: &Merged) -> Labels {
        let owners = self.owners();
        let mut votes: Vec<HashMap<u32, usize>> = vec![HashMap::new(); merged.take.marker_count()];
        let mut given: Vec<Vec<Option<usize>>> = owners
            .iter()
            .map(|column| vec![None; column.len()])
            .collect();
        for (fragment, owner) in merged.fragments.iter().zip(&merged.owners) {
            let Some(marker) = *owner else { continue };
            given[fragment.column][fragment.start..fragment.end].fill(Some(marker));
            for truth in owners[fragment.column][fragment.start..fragment.end]
                .iter()
                .flatten()
            {
                *votes[marker].entry(*truth).or_insert(0) += 1;
            }
        }
        let mut out = Labels {
            found: votes.len(),
            ..Labels::default()
        };
        // The result's marker with most of a true marker's samples is that marker.
        let mut holder: HashMap<u32, (usize, usize)> = HashMap::new();
        for (marker, votes) in votes.iter().enumerate() {
            let most = votes.iter().max_by_key(|(truth, count)| (**count, **truth));
            if let Some((&truth, &count)) = most {
                let held = holder.entry(truth).or_insert((marker, count));
                if count > held.1 {
                    *held = (marker, count);
                }
            }
        }
        out.true_marker = vec![None; votes.len()];
        for (&truth, &(marker, _)) in &holder {
            out.true_marker[marker] = Some(truth);
        }
        let mut seen: Vec<u32> = Vec::new();
        for one in &self.trajectories {
            for span in &one.spans {
                self.judge_span(one.column, span, &given, &mut out);
                seen.extend(span.marker);
            }
        }
        seen.sort_unstable();
        seen.dedup();
        out.markers = seen.len();
        out
    }

    fn judge_span(
        &self,
        column: usize,
        span: &super::files::Span,
        given: &[Vec<Option<usize>>],
        out: &mut Labels,
    ) {
        let range = span.first_frame..span.first_frame + span.frame_count;
        let labels = &given[column][range];
        let true_of = |label: &Option<usize>| label.map(|marker| out.true_marker[marker]);
        // `Some(None)`: a marker of the result that is no true one.
        let bad = |label: &Option<usize>| match true_of(label) {
            None => false,
            Some(found) => found.is_none() || found != span.marker,
        };
        let wrong = labels.iter().filter(|label| bad(label)).count();
        let open = labels.iter().filter(|label| label.is_none()).count();
        let fault = |given| Fault {
            column,
            first_frame: span.first_frame,
            frame_count: span.frame_count,
            marker: span.marker,
            given,
        };
        let first_bad = labels.iter().find(|label| bad(label));
        let faulty = first_bad.map(|label| fault(true_of(label).flatten()));
        if span.marker.is_some() {
            out.real += 1;
            out.labelled_samples += labels.len() - open;
        } else {
            out.ghosts += 1;
            out.ghosts_told += usize::from(open == labels.len());
        }
        out.wrong_samples += wrong;
        if wrong > 0 {
            out.wrong += 1;
            out.faults.extend(faulty);
        } else if span.marker.is_some() && 2 * open > labels.len() {
            out.left += 1;
            out.faults.push(fault(None));
        }
    }

    /// Distances in metres, ascending, of all filled samples from the truth. Linear in samples.
    #[must_use]
    pub fn fill_errors(&self, labels: &Labels, filled: &Filled) -> Vec<f64> {
        let mut errors = Vec::new();
        for (marker, truth) in labels.true_marker.iter().enumerate() {
            let Some(truth) = truth else { continue };
            let path = self.truth.trajectory(*truth as usize);
            for (frame, truth) in path.iter().enumerate() {
                if filled.sigma(marker, frame) > 0.0 {
                    errors.push(filled.take.trajectory(marker)[frame].distance(*truth));
                }
            }
        }
        errors.sort_by(f64::total_cmp);
        errors
    }
}

impl Labels {
    /// The same as an object.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let fault = |fault: &Fault| {
            json!({
                "column": fault.column,
                "first_frame": fault.first_frame,
                "frames": fault.frame_count,
                "marker": fault.marker,
                "given": fault.given,
            })
        };
        json!({
            "real_trajectories": self.real,
            "ghosts": self.ghosts,
            "markers": self.markers,
            "markers_found": self.found,
            "wrong": self.wrong,
            "left_to_hand": self.left,
            "ghosts_told": self.ghosts_told,
            "wrong_samples": self.wrong_samples,
            "labelled_samples": self.labelled_samples,
            "faults": self.faults.iter().map(fault).collect::<Vec<_>>(),
        })
    }
}
