//! Where the markers of a scan go, frame by frame.
//!
//! In: a template, its pairs with a scan. Out: a position and a rotation for each marker and frame.
//! A scan of the template's own proportions takes its positions; for others, positional constraints
//! are scaled part by part (`carry`) and feet kept on the floor (`feet`).

mod carry;
mod feet;

use glam::{DQuat, DVec3};

use super::align::Similarity;
use super::pairs::Pairs;
use super::rotations::{by_neighbours, by_spanning_tree, rigid_neighbours};
use super::template::Template;
use super::{LaplaceError, MarkerTarget};
use carry::Body;

/// Where rotations come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rotations {
    /// From what carries the marker, where the template knows it; else as [`Self::Neighbours`].
    #[default]
    Template,
    /// From the markers around that keep their distance over the motion.
    Neighbours,
    /// From the edges of a spanning tree: the paper's mode (section 3.3).
    Tree,
}

/// Whether positions are scaled part by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Retarget {
    /// Where scan and template differ in proportions.
    #[default]
    Auto,
    /// In any case.
    Always,
    /// Never.
    Never,
}

/// How to drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveOptions {
    /// Source of rotations.
    pub rotations: Rotations,
    /// Whether to adapt positions.
    pub retarget: Retarget,
    /// Leave feet where scaled positions put them.
    pub keep_feet: bool,
}

/// Poses of the markers of a scan.
#[derive(Clone, Debug)]
pub struct Driven {
    /// `[frames][markers]`.
    pub poses: Vec<Vec<MarkerTarget>>,
    /// Frames a second.
    pub rate: f64,
    /// What was done.
    pub report: DriveReport,
}

/// What driving found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveReport {
    /// From the template's space to the scan's.
    pub similarity: Similarity,
    /// Root mean square distance of t-markers from v-markers in the reference frame, metres; 0
    /// without one.
    pub misfit: f64,
    /// Whether positions were scaled part by part.
    pub retargeted: bool,
    /// Stretches of frames in which a marker of a foot stands still.
    pub plants: usize,
    /// Largest way of a planted marker within its stretch, metres, horizontally.
    pub slide: f64,
}

/// Beyond this misfit, in parts of the scan's root mean square size, proportions differ.
const PROPORTIONS: f64 = 0.04;

/// Markers around one that say how it turns.
const AROUND: usize = 4;

/// Frames that say which markers move together.
const SAMPLES: usize = 200;

/// Drives a scan: `positions` `[vertices]` at rest, metres. O(frames (markers^2 + retarget
/// markers^3))
///
/// # Errors
/// [`LaplaceError::MarkerCount`] with fewer than three pairs.
pub fn drive(
    template: &Template,
    pairs: &Pairs,
    positions: &[DVec3],
    options: &DriveOptions,
) -> Result<Driven, LaplaceError> {
    let count = pairs.pairs.len();
    if count < 3 {
        let limit = usize::from(u16::MAX / 2);
        return Err(LaplaceError::MarkerCount { count, limit });
    }
    let points = pairs.points();
    let rest: Vec<DVec3> = pairs
        .vertices()
        .iter()
        .map(|&v| positions[v as usize])
        .collect();
    let start = Start::new(template, pairs, &points, &rest);
    let Start {
        frame,
        similarity,
        ref aligned,
        misfit,
    } = start;
    let retargeted = match options.retarget {
        Retarget::Always => true,
        Retarget::Never => false,
        Retarget::Auto => misfit > PROPORTIONS || (similarity.scale - 1.0).abs() > PROPORTIONS,
    };
    let frames = template.motion();
    let paths: Vec<Vec<DVec3>> = frames
        .clone()
        .map(|frame| {
            let now = template.positions(&points, frame);
            now.into_iter().map(|p| similarity.apply(p)).collect()
        })
        .collect();
    let turns = rotations(template, &points, &start, &paths, options);
    let mut report = DriveReport {
        similarity,
        misfit: misfit * size(&rest),
        retargeted,
        plants: 0,
        slide: 0.0,
    };
    let placed: Vec<Vec<DVec3>> = if retargeted {
        let body = Body::new(&rest, aligned, frame.is_none());
        let free = |(now, turns): (&Vec<DVec3>, &Vec<DQuat>)| body.place(now, turns, &[]);
        let mut placed: Vec<Vec<DVec3>> = paths.iter().zip(&turns).map(free).collect();
        if !options.keep_feet {
            let floor = positions.iter().fold(f64::INFINITY, |low, p| low.min(p.y));
            let plants = feet::plants(&rest, floor, &paths, template.rate);
            let held = feet::hold(&plants, &rest, &placed, template.rate);
            for (frame, held) in held.iter().enumerate().filter(|(_, held)| !held.is_empty()) {
                placed[frame] = body.place(&paths[frame], &turns[frame], held);
            }
            report.plants = plants.len();
            report.slide = feet::slide(&plants, &placed);
        }
        placed
    } else {
        // A marker's vertex is not quite where the marker is; the difference turns with it.
        let offset: Vec<DVec3> = rest.iter().zip(aligned).map(|(v, t)| *v - *t).collect();
        let place = |(now, turns): (&Vec<DVec3>, &Vec<DQuat>)| {
            let moved = now.iter().zip(turns).zip(&offset);
            moved
                .map(|((p, turn), offset)| *p + *turn * *offset)
                .collect()
        };
        paths.iter().zip(&turns).map(place).collect()
    };
    let poses = placed.into_iter().zip(turns).map(|(positions, turns)| {
        let pairs = positions.into_iter().zip(turns);
        pairs
            .map(|(position, rotation)| MarkerTarget { position, rotation })
            .collect()
    });
    Ok(Driven {
        poses: poses.collect(),
        rate: template.rate,
        report,
    })
}

/// What motion is counted from.
struct Start {
    /// The template's frame; none for the scan's own pose.
    frame: Option<usize>,
    /// From the template's space to the scan's.
    similarity: Similarity,
    /// `[markers]`: where the template's are at the start, in the scan's space.
    aligned: Vec<DVec3>,
    /// How much proportions differ, in parts of the size of the scan.
    misfit: f64,
}

impl Start {
    fn new(template: &Template, pairs: &Pairs, points: &[u32], rest: &[DVec3]) -> Self {
        // A skeleton knows its rest pose, and rotations from there.
        let known = template.has_rotations().then_some(0);
        let Some(frame) = pairs.reference.or(known) else {
            return Self::on_the_scan(template, points, rest);
        };
        let reference = template.positions(points, frame);
        let similarity = similarity(&reference, rest);
        let aligned: Vec<DVec3> = reference.iter().map(|&p| similarity.apply(p)).collect();
        let square = aligned
            .iter()
            .zip(rest)
            .map(|(a, b)| a.distance_squared(*b));
        let misfit = (square.sum::<f64>() / rest.len() as f64).sqrt() / size(rest);
        Self {
            frame: Some(frame),
            similarity,
            aligned,
            misfit,
        }
    }

    /// Sizes are compared by the mean distances of neighbours over the motion.
    fn on_the_scan(template: &Template, points: &[u32], rest: &[DVec3]) -> Self {
        let edges = carry::spanning_tree(rest);
        let frames = template.motion();
        let step = frames.len().div_ceil(SAMPLES).max(1);
        let mut lengths = vec![0.0; edges.len()];
        let mut count = 0.0;
        for frame in frames.step_by(step) {
            let now = template.positions(points, frame);
            for (sum, [a, b]) in lengths.iter_mut().zip(&edges) {
                *sum += now[usize::from(*a)].distance(now[usize::from(*b)]);
            }
            count += 1.0;
        }
        let own = edges
            .iter()
            .map(|[a, b]| rest[usize::from(*a)].distance(rest[usize::from(*b)]));
        let mut ratios: Vec<f64> = own
            .zip(&lengths)
            .map(|(own, sum)| own * count / sum)
            .collect();
        ratios.retain(|ratio| ratio.is_finite());
        ratios.sort_by(f64::total_cmp);
        let scale = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
        Self {
            frame: None,
            similarity: Similarity {
                scale: if (scale - 1.0).abs() < PROPORTIONS {
                    1.0
                } else {
                    scale
                },
                ..Similarity::IDENTITY
            },
            aligned: rest.to_vec(),
            misfit: 0.0,
        }
    }
}

/// Root mean square distance from the middle.
fn size(points: &[DVec3]) -> f64 {
    let count = points.len().max(1) as f64;
    let middle = points.iter().sum::<DVec3>() / count;
    let square = points
        .iter()
        .map(|p| p.distance_squared(middle))
        .sum::<f64>();
    (square / count).sqrt()
}

/// From markers to vertices; sizes that differ by less than markers stand off are the same.
fn similarity(reference: &[DVec3], rest: &[DVec3]) -> Similarity {
    let free = Similarity::between(reference, rest, None);
    if (free.scale - 1.0).abs() < PROPORTIONS {
        return Similarity::between(reference, rest, Some(1.0));
    }
    free
}

/// `[frames][markers]`, in the scan's space, since the reference pose.
fn rotations(
    template: &Template,
    points: &[u32],
    start: &Start,
    paths: &[Vec<DVec3>],
    options: &DriveOptions,
) -> Vec<Vec<DQuat>> {
    let reference = &start.aligned;
    if options.rotations == Rotations::Template
        && template.has_rotations()
        && let Some(from_frame) = start.frame
    {
        let to = start.similarity.rotation;
        let from = to.inverse();
        let frames = template.motion();
        let turn = |frame| {
            let turns = template.rotations(points, from_frame, frame);
            let turns = turns.unwrap_or_else(|| vec![DQuat::IDENTITY; points.len()]);
            turns.into_iter().map(|q| to * q * from).collect()
        };
        return frames.map(turn).collect();
    }
    if options.rotations == Rotations::Tree {
        let edges = carry::spanning_tree(reference);
        return paths
            .iter()
            .map(|now| by_spanning_tree(reference, now, &edges))
            .collect();
    }
    let step = paths.len().div_ceil(SAMPLES).max(1);
    let seen: Vec<&[DVec3]> = paths.iter().step_by(step).map(Vec::as_slice).collect();
    let near = rigid_neighbours(reference, &seen, AROUND);
    paths
        .iter()
        .map(|now| by_neighbours(reference, now, &near))
        .collect()
}
