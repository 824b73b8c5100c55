//! The markers and frames of cleaned captures that something can be learnt from: cleaning leaves
//! samples missing that nobody can know, and a few markers that were hardly ever seen.

use std::path::Path;

use glam::DVec3;

use super::Failure;
use super::say::Say;
use crate::fit::register::first_full;
use crate::take::Take;

/// Frames wanted, of those that there are.
const FRAMES: f64 = 0.25;
/// Markers that may be left out, of those that there are.
const LEFT_OUT: f64 = 0.1;
/// Markers named in a note.
const NAMED: usize = 6;

/// A frame's number and all markers in it.
pub(super) type Frame = (usize, Vec<DVec3>);

/// What of captures is usable.
pub(super) struct Usable {
    /// Markers, as numbers of the columns.
    pub kept: Vec<usize>,
    /// The frame of the first capture in which the subject stands in the mesh's pose.
    pub rest: usize,
    /// `[kept]`: positions in it, metres.
    pub standing: Vec<DVec3>,
    /// `[captures]`: frames that show all kept markers.
    pub frames: Vec<Vec<Frame>>,
}

/// Finds what is usable of captures of one marker set, each with its columns. The markers are those
/// that the frame at rest shows, less those whose gaps would leave too few complete frames.
///
/// # Errors
/// A rest frame that does not exist; so many gaps that more than a tenth of the markers would go.
pub(super) fn markers(
    path: &Path,
    takes: &[(&Take, Vec<usize>)],
    (option, rest): (&str, Option<usize>),
    say: &Say,
) -> Result<Usable, Failure> {
    let (first, columns) = &takes[0];
    let rest = match rest {
        Some(frame) if frame >= first.frame_count() => {
            return Err(Failure::Usage(format!(
                "{option} {frame}: the take has {} frames",
                first.frame_count()
            )));
        }
        Some(frame) => frame,
        None => {
            let shown = |frame| {
                columns
                    .iter()
                    .filter(|&&at| is_seen(first, at, frame))
                    .count()
            };
            let shown: Vec<usize> = (0..first.frame_count()).map(shown).collect();
            first_full(&shown)
        }
    };
    let count = columns.len();
    let mut kept: Vec<usize> = (0..count)
        .filter(|&at| is_seen(first, columns[at], rest))
        .collect();
    let total: usize = takes.iter().map(|(take, _)| take.frame_count()).sum();
    let missing: Vec<usize> = (0..count)
        .map(|at| {
            let gaps = takes.iter().map(|(take, columns)| {
                let frames = 0..take.frame_count();
                frames
                    .filter(|&frame| !is_seen(take, columns[at], frame))
                    .count()
            });
            gaps.sum()
        })
        .collect();
    kept.sort_by_key(|&at| (missing[at], at));
    let least = (FRAMES * total as f64) as usize;
    // The fullest markers first: the frames that they all share become fewer with each.
    let mut complete: Vec<Vec<bool>> = takes
        .iter()
        .map(|(take, _)| vec![true; take.frame_count()])
        .collect();
    let mut enough = 0;
    for &at in &kept {
        for ((take, columns), complete) in takes.iter().zip(&mut complete) {
            for (frame, complete) in complete.iter_mut().enumerate() {
                *complete &= is_seen(take, columns[at], frame);
            }
        }
        if complete.iter().flatten().filter(|&&all| all).count() < least.max(1) {
            break;
        }
        enough += 1;
    }
    kept.truncate(enough);
    kept.sort_unstable();
    let out: Vec<&str> = (0..count)
        .filter(|at| kept.binary_search(at).is_err())
        .map(|at| first.labels()[columns[at]].as_str())
        .collect();
    let mut names = out[..out.len().min(NAMED)].join(", ");
    if out.len() > NAMED {
        names += ", ...";
    }
    if out.len() as f64 > LEFT_OUT * count as f64 {
        return Err(Failure::Data(format!(
            "{}: frame {rest} and a quarter of all frames show only {} of {count} markers together \
             ({:.1} % of samples are missing; {names}); fill gaps first (sinew clean), or choose \
             another frame ({option})",
            path.display(),
            kept.len(),
            100.0 * first.missing_fraction(),
        )));
    }
    if !out.is_empty() {
        say.line(format!(
            "note: {}: {} of {count} markers are left out, missing where the body stands or too \
             often: {names}",
            path.display(),
            out.len()
        ));
    }
    let frames = takes.iter().map(|(take, columns)| {
        let of = |frame: usize| {
            let all = kept.iter().map(|&at| take.position(columns[at], frame));
            Some((frame, all.collect::<Option<Vec<_>>>()?))
        };
        (0..take.frame_count()).filter_map(of).collect()
    });
    let standing = kept
        .iter()
        .filter_map(|&at| first.position(columns[at], rest));
    Ok(Usable {
        standing: standing.collect(),
        rest,
        frames: frames.collect(),
        kept,
    })
}

fn is_seen(take: &Take, marker: usize, frame: usize) -> bool {
    take.position(marker, frame).is_some()
}
