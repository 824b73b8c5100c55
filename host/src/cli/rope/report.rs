//! What `sinew rope` says about its ropes.

use std::fmt::Write;

use serde_json::{Value, json};

use super::super::say::Say;
use crate::export::plot::{Timeline, TimelineRow};
use crate::fit::rope::{Origin, Trace, separate::marker_names};

/// Samples of one rope by where they come from.
pub(super) struct Count {
    markers: usize,
    start: usize,
    spacing: f64,
    measured: usize,
    filled: usize,
    lost: usize,
    gaps: usize,
    longest_gap: usize,
    rate: f64,
}

pub(super) fn count(traces: &[Trace]) -> Vec<Count> {
    traces.iter().map(count_one).collect()
}

fn count_one(trace: &Trace) -> Count {
    let lengths = trace.segment_lengths();
    let known = lengths.iter().filter(|length| length.is_finite());
    let mut count = Count {
        markers: trace.marker_count(),
        start: trace.start,
        spacing: known.clone().sum::<f64>() / known.count().max(1) as f64,
        measured: 0,
        filled: 0,
        lost: 0,
        gaps: 0,
        longest_gap: 0,
        rate: trace.rate,
    };
    for marker in 0..trace.marker_count() {
        let mut gap = 0;
        for frame in &trace.frames {
            match frame[marker].origin {
                Origin::Measured(_) => count.measured += 1,
                Origin::Filled => count.filled += 1,
                Origin::Lost => count.lost += 1,
            }
            if frame[marker].point().is_some() {
                gap = 0;
            } else {
                count.gaps += usize::from(gap == 0);
                gap += 1;
                count.longest_gap = count.longest_gap.max(gap);
            }
        }
    }
    count
}

pub(super) fn tell(counts: &[Count], say: &Say) {
    for (rope, count) in counts.iter().enumerate() {
        let all = (count.measured + count.filled + count.lost).max(1) as f64;
        let percent = |samples: usize| 100.0 * samples as f64 / all;
        say.line(format!(
            "rope {}: {} markers, {:.3} m apart, found in frame {}",
            rope + 1,
            count.markers,
            count.spacing,
            count.start + 1,
        ));
        say.line(format!(
            "  {:.2} % of samples measured, {:.2} % filled in {} gaps (the longest {:.2} s), \
             {:.2} % lost",
            percent(count.measured),
            percent(count.filled),
            count.gaps,
            count.longest_gap as f64 / count.rate,
            percent(count.lost),
        ));
    }
}

pub(super) fn to_json(counts: &[Count], traces: &[Trace]) -> Value {
    let one = |(count, trace): (&Count, &Trace)| {
        json!({
            "markers": count.markers,
            "found_in_frame": count.start,
            "segment_lengths_m": trace.segment_lengths(),
            "measured": count.measured,
            "filled": count.filled,
            "lost": count.lost,
            "gaps": count.gaps,
            "longest_gap_frames": count.longest_gap,
        })
    };
    counts.iter().zip(traces).map(one).collect()
}

/// One line a sample.
pub(super) fn samples_csv(traces: &[Trace]) -> String {
    let mut text = "frame,marker,source,gap_frames,confidence\n".to_owned();
    for (rope, trace) in traces.iter().enumerate() {
        let names = marker_names(rope, trace.marker_count());
        for (frame, samples) in trace.frames.iter().enumerate() {
            for (name, sample) in names.iter().zip(samples) {
                let source = match sample.origin {
                    Origin::Measured(_) => "measured",
                    Origin::Filled => "filled",
                    Origin::Lost => "lost",
                };
                let (gap, confidence) = (sample.gap, sample.confidence);
                // Writing into a string cannot fail.
                let _ = writeln!(text, "{frame},{name},{source},{gap},{confidence:.3}");
            }
        }
    }
    text
}

/// When each marker was not measured.
pub(super) fn timeline(traces: &[Trace], name: &str) -> Timeline {
    let mut rows = Vec::new();
    for (rope, trace) in traces.iter().enumerate() {
        for (marker, name) in marker_names(rope, trace.marker_count())
            .into_iter()
            .enumerate()
        {
            let mut spans: Vec<[f64; 2]> = Vec::new();
            for (frame, samples) in trace.frames.iter().enumerate() {
                let (from, to) = (frame as f64 / trace.rate, (frame + 1) as f64 / trace.rate);
                if samples[marker].point().is_some() {
                    continue;
                }
                match spans.last_mut() {
                    Some(span) if span[1] == from => span[1] = to,
                    _ => spans.push([from, to]),
                }
            }
            rows.push(TimelineRow { name, spans });
        }
    }
    let frames = traces.first().map_or(0, |trace| trace.frames.len());
    let rate = traces.first().map_or(1.0, |trace| trace.rate);
    Timeline {
        title: format!("{name}: samples that are filled in"),
        x_label: "seconds".into(),
        rows,
        x_range: Some([0.0, frames as f64 / rate]),
    }
}
