//! A surface cut into near-rigid parts (Park & Hodgins 2006, section 5.2).
//!
//! In: a surface (of markers, or a whole mesh) in a range of motions. Out: a part for each triangle
//! and point, every part connected and close to rigid, and which part hangs on which.
//!
//! | stage | does |
//! | --- | --- |
//! | `patches` | triangles, or small patches of large meshes; how they turn in each frame |
//! | `mean_shift` | groups those that turn alike (James & Twigg 2005) |
//! | `regions` | what the paper adjusts by hand: connected parts, none too small, borders where rigid motions meet |
//! | [`rig`] | the parts of a rig instead |

pub mod agreement;
mod error;
mod mean_shift;
mod patches;
mod regions;
pub mod rig;
mod rigidity;

use glam::DVec3;

pub use agreement::Agreement;
pub use error::SegmentError;
use mean_shift::{mean_shift, reduce};
use patches::{Patches, check, neighbours};
use regions::Regions;
pub use rig::parts_of_rig;
use rigidity::Piece;

/// Fewest frames that show how parts move.
const FEWEST_FRAMES: usize = 3;
/// Groups are made smaller down to this part of the bandwidth.
const FINEST: f64 = 0.1;
/// A frame counts if this share of the points is seen.
const SEEN: f64 = 0.7;

/// How to segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentOptions {
    /// How many parts; without it, as many as move apart by more than `apart`.
    pub parts: Option<usize>,
    /// Root mean square angle by which triangles of one group differ, radians.
    pub bandwidth: f64,
    /// Parts are joined while that moves the points of the smaller one by less than this, root mean
    /// square, over the size of the surface.
    pub apart: f64,
    /// No part covers a smaller share of the surface.
    pub smallest: f64,
    /// Most frames to look at, spread evenly.
    pub frames: usize,
}

impl Default for SegmentOptions {
    fn default() -> Self {
        Self {
            parts: None,
            bandwidth: 0.2,
            apart: 0.006,
            smallest: 0.006,
            frames: 64,
        }
    }
}

/// Near-rigid parts of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// `[parts]`
    pub names: Vec<String>,
    /// `[parts]`: the part that each hangs on, before the part itself; none for the first.
    pub parents: Vec<Option<usize>>,
    /// `[triangles]`
    pub triangle_parts: Vec<u32>,
    /// `[points]`: that of most of the area around each.
    pub point_parts: Vec<u32>,
    /// What was done.
    pub report: SegmentReport,
}

/// What segmenting did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SegmentReport {
    /// Frames looked at.
    pub frames: usize,
    /// Pieces that were clustered.
    pub patches: usize,
    /// Clusters that mean shift found.
    pub clusters: usize,
    /// Connected regions of these.
    pub regions: usize,
    /// Share of the surface in regions too small to be parts: black in the paper's figure.
    pub scattered: f64,
    /// `[parts]`: share of the surface.
    pub shares: Vec<f64>,
    /// `[parts]`: root mean square distance from a rigid motion, metres.
    pub deviations: Vec<f64>,
}

impl Segmentation {
    /// How many parts.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.names.len()
    }
}

/// Cuts a surface into near-rigid parts. `rest`: `[points]`; `frames`: `[frames][points]`, metres,
/// NaN where missing. `progress` hears how many of five stages are done.
/// O(frames triangles + patches^2)
///
/// # Errors
/// A surface and frames that contradict each other, too few frames, a count of parts that cannot be
/// had.
pub fn segment(
    rest: &[DVec3],
    triangles: &[[u32; 3]],
    frames: &[Vec<DVec3>],
    options: &SegmentOptions,
    progress: &dyn Fn(usize),
) -> Result<Segmentation, SegmentError> {
    check(rest, triangles, frames)?;
    let beside = neighbours(triangles);
    let patches = Patches::new(rest, triangles, &beside);
    let count = patches.areas.len();
    if let Some(wanted) = options.parts
        && !(1..=count.min(1000)).contains(&wanted)
    {
        let most = count.min(1000);
        return Err(SegmentError::PartCount { wanted, most });
    }
    let frames = choose(frames, options.frames);
    if frames.len() < FEWEST_FRAMES {
        return Err(SegmentError::FewFrames {
            frames: frames.len(),
            needed: FEWEST_FRAMES,
        });
    }
    progress(1);
    let points = turns(&patches, triangles, rest, &frames);
    let points = reduce(&points);
    progress(2);
    let own = |list: &[u32]| piece(list, triangles, rest, &frames);
    let pieces: Vec<Piece> = patches.triangles.iter().map(|list| own(list)).collect();
    let low = rest.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = rest.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    let apart = options.apart * (high - low).max_element();
    let mut report = SegmentReport {
        frames: frames.len(),
        patches: count,
        ..SegmentReport::default()
    };
    let mut clusters = mean_shift(&points, &patches.areas, options.bandwidth);
    let mut bandwidth = options.bandwidth;
    let mut regions = loop {
        let mut regions = Regions::new(&clusters, &pieces, &patches.areas, &patches.beside);
        report.clusters = clusters.iter().max().map_or(0, |most| *most as usize + 1);
        report.regions = regions.count();
        report.scattered = regions.share_below(options.smallest);
        let loose = regions.loose(options.smallest, apart);
        regions.absorb(options.smallest);
        bandwidth /= 2.0;
        let enough = options.parts.is_none_or(|wanted| regions.count() >= wanted);
        if (enough && loose.is_empty()) || bandwidth < FINEST * options.bandwidth {
            break regions;
        }
        let whole = (0..count).collect();
        // Limbs that bend evenly turn into each other without a gap: such groups are cut finer.
        for region in if enough { loose } else { vec![whole] } {
            let own: Vec<Vec<f64>> = region
                .iter()
                .map(|&at: &usize| points[at].clone())
                .collect();
            let areas: Vec<f64> = region.iter().map(|&at| patches.areas[at]).collect();
            let first = clusters.iter().max().map_or(0, |most| most + 1);
            for (at, cluster) in region.iter().zip(mean_shift(&own, &areas, bandwidth)) {
                clusters[*at] = first + cluster;
            }
        }
    };
    progress(3);
    regions.join(options.parts, apart);
    regions.settle();
    progress(4);
    let of_patch = regions.labels();
    let mut of_triangle: Vec<u32> = patches
        .of_triangle
        .iter()
        .map(|&patch| of_patch[patch as usize])
        .collect();
    if count < triangles.len() {
        let single = |at: usize| piece(&[at as u32], triangles, rest, &frames);
        regions.settle_finely(&mut of_triangle, &beside, &single);
    }
    let (parts, parents) = order(&of_triangle, &beside, triangles, rest);
    let part_count = parents.len();
    let areas: Vec<f64> = triangles.iter().map(|t| area(rest, *t)).collect();
    let total: f64 = areas.iter().sum();
    for part in 0..part_count {
        let list: Vec<u32> = (0..parts.len() as u32)
            .filter(|&at| parts[at as usize] as usize == part)
            .collect();
        let own: f64 = list.iter().map(|&at| areas[at as usize]).sum();
        report.shares.push(own / total);
        let left = piece(&list, triangles, rest, &frames).left();
        report.deviations.push((left / own.max(1e-300)).sqrt());
    }
    progress(5);
    Ok(Segmentation {
        names: (1..=part_count).map(|at| format!("part {at}")).collect(),
        parents,
        point_parts: by_points(&parts, triangles, &areas, rest.len()),
        triangle_parts: parts,
        report,
    })
}

/// At most `most` frames, spread evenly over those that show enough.
fn choose(frames: &[Vec<DVec3>], most: usize) -> Vec<&Vec<DVec3>> {
    let shows = |frame: &&Vec<DVec3>| {
        let seen = frame.iter().filter(|at| at.is_finite()).count();
        seen as f64 >= SEEN * frame.len() as f64
    };
    let good: Vec<&Vec<DVec3>> = frames.iter().filter(shows).collect();
    let most = most.max(FEWEST_FRAMES).min(good.len());
    (0..most).map(|at| good[at * good.len() / most]).collect()
}

/// `[patches]`: turns in all frames as one vector, so that the distance of two is the root mean
/// square angle between them (of small angles). A patch that is not seen turns as those beside it.
fn turns(
    patches: &Patches,
    triangles: &[[u32; 3]],
    rest: &[DVec3],
    frames: &[&Vec<DVec3>],
) -> Vec<Vec<f64>> {
    let scale = 1.0 / (2.0 * frames.len() as f64).sqrt();
    let mut points = vec![Vec::with_capacity(9 * frames.len()); patches.areas.len()];
    for frame in frames {
        let mut turns = patches.turns(triangles, rest, frame);
        loop {
            let fill = |at: usize| {
                let near = patches.beside[at]
                    .iter()
                    .filter_map(|&other| turns[other as usize]);
                let (sum, count) = near.fold((glam::DMat3::ZERO, 0.0), |(sum, count), turn| {
                    (sum + turn, count + 1.0)
                });
                (count > 0.0).then(|| (at, sum * (1.0 / count)))
            };
            let missing = (0..turns.len()).filter(|&at| turns[at].is_none());
            let filled: Vec<_> = missing.filter_map(fill).collect();
            if filled.is_empty() {
                break;
            }
            for (at, turn) in filled {
                turns[at] = Some(turn);
            }
        }
        for (point, turn) in points.iter_mut().zip(turns) {
            let turn = turn.unwrap_or(glam::DMat3::IDENTITY);
            point.extend(turn.to_cols_array().map(|x| x * scale));
        }
    }
    points
}

/// A few triangles in all frames: their corners, each with a third of the area.
fn piece(list: &[u32], triangles: &[[u32; 3]], rest: &[DVec3], frames: &[&Vec<DVec3>]) -> Piece {
    let mut piece = Piece::empty(frames.len());
    for &at in list {
        let triangle = triangles[at as usize];
        let third = area(rest, triangle) / 3.0;
        for corner in triangle.map(|at| at as usize) {
            for (at, frame) in frames.iter().enumerate() {
                piece.point(at, rest[corner], frame[corner], third);
            }
        }
    }
    piece
}

fn area(rest: &[DVec3], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|at| rest[at as usize]);
    (b - a).cross(c - a).length() / 2.0
}

/// Parts renumbered from the largest outward, each after the one that it hangs on: the placed one
/// with which it shares most of its border.
fn order(
    labels: &[u32],
    beside: &[Vec<u32>],
    triangles: &[[u32; 3]],
    rest: &[DVec3],
) -> (Vec<u32>, Vec<Option<usize>>) {
    let count = labels.iter().max().map_or(0, |most| *most as usize + 1);
    let mut areas = vec![0.0; count];
    let mut borders = vec![vec![0_u32; count]; count];
    for (at, &label) in labels.iter().enumerate() {
        areas[label as usize] += area(rest, triangles[at]);
        for &other in &beside[at] {
            borders[label as usize][labels[other as usize] as usize] += 1;
        }
    }
    let mut placed: Vec<usize> = Vec::new();
    let mut parents: Vec<Option<usize>> = Vec::new();
    let mut left: Vec<usize> = (0..count).filter(|&at| areas[at] > 0.0).collect();
    while !left.is_empty() {
        let tie = |&part: &usize| {
            let best =
                (0..placed.len()).max_by_key(|&at| (borders[part][placed[at]], usize::MAX - at));
            best.map_or((0, None), |at| (borders[part][placed[at]], Some(at)))
        };
        let next = (0..left.len()).max_by(|&a, &b| {
            let (a, b) = (left[a], left[b]);
            let by = |part: usize| (tie(&part).0, areas[part]);
            by(a).0.cmp(&by(b).0).then(by(a).1.total_cmp(&by(b).1))
        });
        let part = left.swap_remove(next.unwrap_or(0));
        // A component of its own hangs on the first part.
        let (shared, parent) = tie(&part);
        parents.push(if shared > 0 {
            parent
        } else {
            (!placed.is_empty()).then_some(0)
        });
        placed.push(part);
    }
    let mut number = vec![0; count];
    for (at, &part) in placed.iter().enumerate() {
        number[part] = at as u32;
    }
    (
        labels.iter().map(|&label| number[label as usize]).collect(),
        parents,
    )
}

/// `[points]`: the part of most of the area around each.
fn by_points(parts: &[u32], triangles: &[[u32; 3]], areas: &[f64], points: usize) -> Vec<u32> {
    let mut votes: Vec<Vec<(u32, f64)>> = vec![Vec::new(); points];
    for ((triangle, &part), &area) in triangles.iter().zip(parts).zip(areas) {
        for &corner in triangle {
            let votes = &mut votes[corner as usize];
            match votes.iter_mut().find(|(known, _)| *known == part) {
                Some((_, sum)) => *sum += area,
                None => votes.push((part, area)),
            }
        }
    }
    let most = |votes: &Vec<(u32, f64)>| {
        let best = votes
            .iter()
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        best.map_or(0, |&(part, _)| part)
    };
    votes.iter().map(most).collect()
}

#[cfg(test)]
mod tests;
