//! Partial trajectories to markers (Park & Hodgins 2006, section 4.2, without the handwork).
//!
//! Enters: a take whose columns break at every occlusion. Leaves: one trajectory a marker, what
//! belongs to none, and the evidence for each merge.
//!
//! | stage | does |
//! | --- | --- |
//! | `fragments` | columns into runs without a gap or a jump |
//! | `swaps` | where a run goes over to another marker |
//! | `rings` | which tracks lie around a track, and how rigidly they move with it |
//! | `carry` | where neighbours expect a track that is out of sight, and how surely |
//! | `links` | how likely two tracks are one, against chance |
//! | `choose` | the likely merges that exclude each other |
//! | `rounds` | the surest first, short gaps before long ones: each merge helps the next |
//! | `amend` | halves of one marker that a wrong fragment keeps apart |
//!
//! No marker needs to be seen in any one frame: tracks grow from all fragments alike.

use glam::DVec3;

use super::surface::{BodyMesh, MarkerSurface, SurfaceError};
use crate::import::take::PointKind;
use crate::take::{Take, TakeError};

mod along;
mod amend;
mod carry;
mod choose;
mod fragments;
mod links;
mod rings;
mod rounds;
mod swaps;
mod tracks;

pub use fragments::Fragment;

use along::Along;
use rounds::Joined;
use tracks::Tracks;

/// Hears the share that is done, 0 to 1.
pub type Progress<'a> = dyn Fn(f64) + 'a;

/// What [`merge`] is asked to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergeOptions<'a> {
    /// Largest mean distance of two parts from where each expects the other, over the mean
    /// distance to the neighbours (the paper's alpha 1).
    pub mean: f64,
    /// The same for every frame compared (alpha 2).
    pub every: f64,
    /// The frame whose points come first among the markers of a take without names; by default the
    /// one that shows most.
    pub reference_frame: Option<usize>,
    /// The body in the reference frame; without it, neighbours along the body are found from the
    /// points of that frame.
    pub mesh: Option<BodyMesh<'a>>,
}

/// Why a take cannot be merged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// The result is no take; it cannot happen for a valid take.
    #[error(transparent)]
    Take(#[from] TakeError),
    /// The mesh is not the body of the reference frame.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

impl Default for MergeOptions<'_> {
    fn default() -> Self {
        Self {
            mean: 0.5,
            every: 0.6,
            reference_frame: None,
            mesh: None,
        }
    }
}

/// A decision about one fragment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Which fragment, of [`Merged::fragments`]: the first of those that were taken in together.
    pub fragment: usize,
    /// Which marker of the result.
    pub marker: usize,
    /// Mean distance from where the marker was expected, over its neighbour distance.
    pub mean: f64,
    /// Largest such distance.
    pub worst: f64,
    /// Least number of neighbours that carried the marker.
    pub support: usize,
    /// Logarithm of how much likelier the fragment's places are if it is the marker's than if it is
    /// not.
    pub odds: f64,
    /// The same for the best merge that this one excludes; minus infinity if there was none.
    pub rival: f64,
    /// Whether the odds are small, alone or against the rival.
    pub doubtful: bool,
}

/// A trajectory of the source that went over from one marker to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Swap {
    /// Column of the source.
    pub column: usize,
    /// First frame of the second marker.
    pub frame: usize,
    /// Marker of the result before it.
    pub from: usize,
    /// Marker of the result from it on.
    pub to: usize,
}

/// What became of a take.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// One trajectory a marker.
    pub take: Take,
    /// The partial trajectories of the source's unnamed columns, split where they jump.
    pub fragments: Vec<Fragment>,
    /// `[fragments]`: the marker that each belongs to; `None` for ghosts.
    pub owners: Vec<Option<usize>>,
    /// Merges, in the order in which they were made.
    pub decisions: Vec<Decision>,
    /// Frames in which a trajectory of the source jumped and was cut: (column, frame).
    pub jumps: Vec<(usize, usize)>,
    /// The frame that shows most, where no column had a name.
    pub reference_frame: Option<usize>,
}

/// Seconds that a track must be seen to be a marker, whatever it does.
const OWN_LIFE: f64 = 0.25;
/// The same if it moves with the skin around it.
const SHORT_LIFE: f64 = 0.1;
/// How often it must be seen in one place if it is seen more briefly still.
const AGAIN: usize = 3;

/// Merges the partial trajectories of a take.
///
/// Named columns are markers already; unnamed ones ([`PointKind::Unlabelled`]) are taken apart
/// into fragments at every gap, and merged into them or, where none is named, with each other to
/// markers `M1`, `M2` and so on. What is seen only briefly and fits no marker is a ghost. A take
/// without unnamed columns comes back as it is. `progress` hears the share done. About fragments
/// times those that end within two seconds before each, and quadratic in what is left then.
///
/// # Errors
/// The mesh is not the body of the reference frame.
///
/// # Panics
/// If the reference frame does not exist.
pub fn merge(
    take: &Take,
    options: &MergeOptions<'_>,
    progress: &Progress<'_>,
) -> Result<Merged, MergeError> {
    if let Some(frame) = options.reference_frame {
        assert!(
            frame < take.frame_count(),
            "reference frame {frame} does not exist"
        );
    }
    let (unnamed, named): (Vec<usize>, Vec<usize>) =
        (0..take.marker_count()).partition(|&column| take.kinds()[column] == PointKind::Unlabelled);
    let mut merged = Merged {
        take: take.clone(),
        fragments: Vec::new(),
        owners: Vec::new(),
        decisions: Vec::new(),
        jumps: Vec::new(),
        reference_frame: None,
    };
    if unnamed.is_empty() {
        return Ok(merged);
    }
    (merged.fragments, merged.jumps) = fragments::split(take);
    let mut tracks = Tracks::new(take, &merged.fragments, &named);
    let fullest = || fragments::fullest_frame(take, &tracks.fragments);
    let reference = options.reference_frame.or_else(fullest);
    if named.is_empty() {
        merged.reference_frame = reference;
    }
    let found = swaps::find(&tracks, &rings::touches(&tracks), merged.fragments.len());
    if !found.is_empty() {
        merged.cut(&found);
        tracks = Tracks::new(take, &merged.fragments, &named);
    }
    let along = along(&tracks, reference, options.mesh)?;
    let joined = rounds::run(&mut tracks, &along, options, progress);
    let markers = markers(&tracks, &along, merged.reference_frame);
    merged.assign(&tracks, &markers, &joined);
    merged.take = trajectories(&tracks, &markers)?;
    Ok(merged)
}

/// The marker surface of the reference frame.
fn along(
    tracks: &Tracks<'_>,
    reference: Option<usize>,
    mesh: Option<BodyMesh<'_>>,
) -> Result<Along, SurfaceError> {
    let Some(frame) = reference else {
        return Ok(Along::default());
    };
    let shown = |at: &usize| {
        let Fragment { start, end, .. } = tracks.fragments[*at];
        (start..end).contains(&frame)
    };
    let fragments: Vec<usize> = (0..tracks.fragments.len()).filter(shown).collect();
    let points: Vec<DVec3> = fragments
        .iter()
        .map(|&at| tracks.sample(at, frame))
        .collect();
    let surface = match mesh {
        Some(mesh) => MarkerSurface::of_mesh(&points, mesh, frame)?,
        None => MarkerSurface::of_points(&points),
    };
    Ok(Along::new(surface, fragments))
}

/// Tracks that are markers, in order: named ones, those of the reference frame, the others by
/// their first frame.
fn markers(tracks: &Tracks<'_>, along: &Along, reference: Option<usize>) -> Vec<usize> {
    let rings = rings::rings(tracks, &rings::touches(tracks), along);
    let rate = tracks.take().rate();
    let all = tracks.members.len();
    let mut named: Vec<usize> = (0..all).filter(|&t| tracks.named[t].is_some()).collect();
    let mut in_reference = Vec::new();
    let mut others = Vec::new();
    for track in tracks.alive() {
        if tracks.named[track].is_some() {
            continue;
        }
        let seconds = tracks.frame_count(track) as f64 / rate;
        let again = tracks.members[track].len() >= AGAIN;
        let brief = seconds >= SHORT_LIFE || again;
        if !(seconds >= OWN_LIFE || brief && rounds::moves_with_skin(tracks, &rings[track], track))
        {
            continue;
        }
        if reference.is_some_and(|frame| tracks.position(track, frame).is_some()) {
            in_reference.push(track);
        } else {
            others.push(track);
        }
    }
    others.sort_by_key(|&track| tracks.members[track][0]);
    named.extend(in_reference);
    named.extend(others);
    named
}

/// The take of the markers.
fn trajectories(tracks: &Tracks<'_>, markers: &[usize]) -> Result<Take, TakeError> {
    let take = tracks.take();
    let frames = take.frame_count();
    let mut positions = vec![DVec3::NAN; markers.len() * frames];
    let mut labels: Vec<String> = Vec::with_capacity(markers.len());
    let mut number = 0;
    for (marker, &track) in markers.iter().enumerate() {
        let path = &mut positions[marker * frames..][..frames];
        for &at in &tracks.members[track] {
            let Fragment { column, start, end } = tracks.fragments[at];
            path[start..end].copy_from_slice(&take.trajectory(column)[start..end]);
        }
        labels.push(match tracks.named[track] {
            Some(column) => take.labels()[column].clone(),
            None => loop {
                number += 1;
                let label = format!("M{number}");
                if !take.labels().contains(&label) {
                    break label;
                }
            },
        });
    }
    take.with_trajectories(labels, positions)
}

impl Merged {
    /// Cuts fragments at frames (fragment, frame), which ascend.
    fn cut(&mut self, at: &[(usize, usize)]) {
        for &(fragment, frame) in at.iter().rev() {
            let whole = &mut self.fragments[fragment];
            let rest = Fragment {
                start: frame,
                ..*whole
            };
            whole.end = frame;
            self.jumps.push((rest.column, frame));
            self.fragments.push(rest);
        }
        self.fragments
            .sort_by_key(|fragment| (fragment.start, fragment.column));
        self.jumps.sort_unstable();
    }

    fn assign(&mut self, tracks: &Tracks<'_>, markers: &[usize], joined: &[Joined]) {
        let mut marker_of = vec![None; tracks.members.len()];
        for (marker, &track) in markers.iter().enumerate() {
            marker_of[track] = Some(marker);
        }
        let owner = |fragment: usize| marker_of[tracks.track_of[fragment]];
        self.owners = (0..self.fragments.len()).map(owner).collect();
        let decision = |one: &Joined| {
            let Joined {
                fragment,
                pair,
                rival,
            } = *one;
            let [least, margin] = rounds::DOUBTFUL;
            Some(Decision {
                fragment,
                marker: owner(fragment)?,
                mean: pair.mean,
                worst: pair.worst,
                support: pair.support,
                odds: pair.odds,
                rival,
                doubtful: pair.odds < least || pair.odds < rival + margin,
            })
        };
        self.decisions = joined.iter().filter_map(decision).collect();
    }

    /// Fragments that belong to no marker.
    #[must_use]
    pub fn ghosts(&self) -> Vec<usize> {
        let all = 0..self.fragments.len();
        all.filter(|&at| self.owners[at].is_none()).collect()
    }

    /// Frames in which a trajectory of the source went over from one marker to another. Other jumps
    /// were spikes, or ghosts.
    #[must_use]
    pub fn swaps(&self) -> Vec<Swap> {
        let owner = |column: usize, frame: usize| {
            let holds = |f: &Fragment| f.column == column && (f.start..f.end).contains(&frame);
            let at = self.fragments.iter().position(holds)?;
            self.owners[at]
        };
        let swap = |&(column, frame): &(usize, usize)| {
            let from = owner(column, frame.checked_sub(1)?)?;
            let to = owner(column, frame)?;
            (from != to).then_some(Swap {
                column,
                frame,
                from,
                to,
            })
        };
        self.jumps.iter().filter_map(swap).collect()
    }

    /// Merges that a person may want to look at.
    pub fn doubtful(&self) -> impl Iterator<Item = &Decision> {
        self.decisions.iter().filter(|decision| decision.doubtful)
    }
}

#[cfg(test)]
mod tests;
