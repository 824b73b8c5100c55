//! What `sinew clean` says it did.

use serde_json::{Value, json};

use super::super::say::{Say, thousands};
use super::Outcome;
use crate::clean::smooth::amplitude_kept;
use crate::export::plot::{Timeline, TimelineRow};
use crate::studio::judge::Key;
use crate::take::Take;

/// Counts for the table: missing samples, gaps, longest gap, complete frames.
fn counts(take: &Take) -> [usize; 4] {
    let markers = || 0..take.marker_count();
    let gaps = || markers().flat_map(|marker| take.gaps(marker));
    [
        markers().map(|marker| take.missing_count(marker)).sum(),
        gaps().count(),
        gaps().map(|gap| gap.len()).max().unwrap_or(0),
        take.complete_frame_count(),
    ]
}

impl Outcome {
    /// Standard deviations of the filled samples in millimetres, ascending.
    fn deviations(&self) -> Vec<f64> {
        let filled = self.filled.sigma.iter().filter(|sigma| **sigma > 0.0);
        let mut all: Vec<f64> = filled.map(|sigma| 1e3 * f64::from(*sigma)).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    pub(super) fn tell(&self, say: &Say) {
        let take = &self.merged.take;
        if !self.merged.fragments.is_empty() {
            say.line(format!(
                "{} partial trajectories became {} markers; {} are ghosts, {} merges are doubtful, {} swaps were undone",
                thousands(self.merged.fragments.len() as u64),
                take.marker_count(),
                self.merged.ghosts().len(),
                self.merged.doubtful().count(),
                self.merged.swaps().len(),
            ));
        }
        self.tell_names(say);
        say.line(format!(
            "{} markers, {} frames at {:.2} Hz ({:.1} s), cleaned in {:.1} s",
            take.marker_count(),
            thousands(take.frame_count() as u64),
            take.rate(),
            take.frame_count() as f64 / take.rate(),
            self.seconds
        ));
        say.line(format!("{:>18} {:>12} {:>12}", "", "before", "after"));
        let names = ["missing samples", "gaps", "longest gap", "complete frames"];
        let rows = names
            .iter()
            .zip(counts(take))
            .zip(counts(&self.filled.take));
        for ((name, before), after) in rows {
            let [before, after] = [before, after].map(|count| thousands(count as u64));
            say.line(format!("{name:>18} {before:>12} {after:>12}"));
        }
        say.line(format!(
            "{:>18} {:>12} {:>12}",
            "spikes",
            self.spikes.len(),
            0
        ));
        let deviations = self.deviations();
        let at = |share: f64| deviations[((deviations.len() - 1) as f64 * share) as usize];
        if !deviations.is_empty() && at(1.0).is_finite() {
            say.line(format!(
                "filled samples are sure to {:.2} mm an axis (median), {:.2} mm (95 %)",
                at(0.5),
                at(0.95)
            ));
        }
        if self.passes > 0 {
            let kept = |frequency| 100.0 * amplitude_kept(frequency, take.rate(), self.passes);
            say.line(format!(
                "smoothing keeps {:.1} % of local motion at 5 Hz, {:.1} % at 10 Hz, {:.1} % at 20 Hz",
                kept(5.0),
                kept(10.0),
                kept(20.0)
            ));
        }
        for (marker, label) in take.labels().iter().enumerate() {
            let missing = self.filled.take.missing_count(marker);
            if missing > 0 {
                let why = if take.missing_count(marker) == take.frame_count() {
                    "it was never seen"
                } else {
                    "too far from any sight of it or its neighbours (--limit)"
                };
                say.line(format!(
                    "note: {label}: {missing} samples stay missing: {why}"
                ));
            }
        }
    }

    /// Names that were exchanged or stray, with the evidence.
    fn tell_names(&self, say: &Say) {
        let labels = self.before.labels();
        let (undone, removed) = if self.names_kept {
            ("left so", "left there")
        } else {
            ("undone", "removed")
        };
        for one in &self.misnamed.exchanges {
            let [a, b] = one.columns.map(|column| &labels[column]);
            say.line(format!(
                "{a} and {b} carry each other's marker in frames {} to {}: {:.0} mm from where their \
                 neighbours expect them, {:.0} mm once exchanged; {undone}",
                one.frames.start,
                one.frames.end - 1,
                1e3 * one.before,
                1e3 * one.after,
            ));
        }
        for one in &self.misnamed.strays {
            say.line(format!(
                "{} is a stray point in frames {} to {}, at least {:.0} mm from where its neighbours \
                 expect it; {removed}",
                labels[one.column],
                one.frames.start,
                one.frames.end - 1,
                1e3 * one.distance,
            ));
        }
    }

    fn names(&self) -> Value {
        let labels = self.before.labels();
        let exchanges = self.misnamed.exchanges.iter().map(|one| {
            json!({
                "markers": one.columns.map(|column| &labels[column]),
                "first_frame": one.frames.start,
                "frames": one.frames.len(),
                "distance_before_m": one.before,
                "distance_after_m": one.after,
                "log_odds": one.odds,
            })
        });
        let strays = self.misnamed.strays.iter().map(|one| {
            json!({
                "marker": labels[one.column],
                "first_frame": one.frames.start,
                "frames": one.frames.len(),
                "least_distance_m": one.distance,
            })
        });
        json!({
            "undone": !self.names_kept,
            "exchanges": exchanges.collect::<Vec<_>>(),
            "strays": strays.collect::<Vec<_>>(),
        })
    }

    pub(super) fn to_json(&self) -> Value {
        let table = |take: &Take| {
            let [missing, gaps, longest, complete] = counts(take);
            json!({
                "missing_samples": missing,
                "gaps": gaps,
                "longest_gap": longest,
                "complete_frames": complete,
            })
        };
        let take = &self.merged.take;
        let labels = take.labels();
        let markers = (0..take.marker_count()).map(|marker| {
            let sigma = (0..take.frame_count()).map(|frame| self.filled.sigma(marker, frame));
            let filled: Vec<f32> = sigma.filter(|sigma| *sigma > 0.0).collect();
            let worst = filled.iter().copied().fold(0.0, f32::max);
            json!({
                "label": labels[marker],
                "missing_before": take.missing_count(marker),
                "filled": filled.len(),
                "missing_after": self.filled.take.missing_count(marker),
                "worst_sigma_m": worst.is_finite().then_some(worst),
            })
        });
        let spikes = self.spikes.iter().map(|spike| {
            json!({
                "label": labels[spike.marker],
                "frame": spike.frame,
                "frames": spike.len,
                "height_m": spike.height,
            })
        });
        let kept = [1.0, 2.0, 5.0, 10.0, 20.0].map(|frequency| {
            let kept = amplitude_kept(frequency, take.rate(), self.passes);
            json!({ "hz": frequency, "kept": kept })
        });
        json!({
            "frames": take.frame_count(),
            "rate_hz": take.rate(),
            "seconds": self.seconds,
            "before": table(take),
            "after": table(&self.filled.take),
            "markers": markers.collect::<Vec<_>>(),
            "names": self.names(),
            "merging": self.merging(),
            "spikes": spikes.collect::<Vec<_>>(),
            "smoothing": { "passes": self.passes, "amplitude_kept": kept },
        })
    }

    /// How far the outcome is from the truth.
    pub(super) fn judge(&self, key: &Key, say: &Say) -> Value {
        let labels = key.labels(&self.merged);
        let errors = key.fill_errors(&labels, &self.filled);
        let mm = |share: f64| {
            let at = errors.len().saturating_sub(1) as f64 * share;
            errors.get(at as usize).map_or(0.0, |metres| 1e3 * metres)
        };
        say.line(format!(
            "against the truth: {} of {} trajectories are labelled wrong, {} were left out; {} of {} \
             markers; {} of {} ghosts told",
            labels.wrong,
            thousands(labels.real as u64),
            labels.left,
            labels.found,
            labels.markers,
            labels.ghosts_told,
            labels.ghosts
        ));
        say.line(format!(
            "filled samples miss it by {:.2} mm (median), {:.2} mm (95 %), {:.1} mm (most)",
            mm(0.5),
            mm(0.95),
            mm(1.0)
        ));
        let mut object = labels.to_json();
        object["fill_error_mm"] =
            json!({ "median": mm(0.5), "percentile_95": mm(0.95), "largest": mm(1.0) });
        object
    }

    /// Trajectories before and after, ghosts, and the evidence of each doubtful merge.
    fn merging(&self) -> Value {
        let merged = &self.merged;
        let place = |at: usize| {
            let fragment = merged.fragments[at];
            json!({
                "column": self.before.labels()[fragment.column],
                "first_frame": fragment.start,
                "frames": fragment.frame_count(),
            })
        };
        let doubtful = merged.doubtful().map(|decision| {
            json!({
                "trajectory": place(decision.fragment),
                "marker": merged.take.labels()[decision.marker],
                "mean_over_spacing": decision.mean,
                "worst_over_spacing": decision.worst,
                "neighbours": decision.support,
                "log_odds": decision.odds,
                "rival_log_odds": decision.rival.is_finite().then_some(decision.rival),
            })
        });
        let swaps = merged.swaps().into_iter().map(|swap| {
            json!({
                "column": self.before.labels()[swap.column],
                "frame": swap.frame,
                "from": merged.take.labels()[swap.from],
                "to": merged.take.labels()[swap.to],
            })
        });
        json!({
            "trajectories": merged.fragments.len(),
            "markers": merged.take.marker_count(),
            "reference_frame": merged.reference_frame,
            "ghosts": merged.ghosts().into_iter().map(place).collect::<Vec<_>>(),
            "doubtful": doubtful.collect::<Vec<_>>(),
            "swaps": swaps.collect::<Vec<_>>(),
        })
    }

    /// Rows of the markers with gaps: what was missing, and below it what still is.
    pub(super) fn timeline(&self) -> Timeline {
        let spans = |take: &Take, marker| {
            let seconds = |frame| take.seconds(frame);
            take.gaps(marker)
                .map(|gap| [seconds(gap.start), seconds(gap.end)])
                .collect::<Vec<_>>()
        };
        let mut rows = Vec::new();
        for (marker, label) in self.merged.take.labels().iter().enumerate() {
            let before = spans(&self.merged.take, marker);
            if before.is_empty() {
                continue;
            }
            let after = spans(&self.filled.take, marker);
            rows.push(TimelineRow {
                name: label.clone(),
                spans: before,
            });
            if !after.is_empty() {
                rows.push(TimelineRow {
                    name: format!("{label} (left)"),
                    spans: after,
                });
            }
        }
        Timeline {
            title: "Gaps of each marker".into(),
            x_label: "seconds".into(),
            rows,
            x_range: Some([0.0, self.before.seconds(self.before.frame_count())]),
        }
    }
}
