//! A body from markers nobody named: near-rigid groups, joined where they turn about a common
//! point.
//!
//! Markers whose distances stay the same belong together (complete linkage). Two groups share a
//! joint at the point that both carry alike: `R_a c + t_a = R_b c + t_b` in every frame, by least
//! squares. The tree that joins all groups with the least error is the skeleton (O'Brien et al.,
//! *Automatic Joint Parameter Estimation from Magnetic Motion Capture Data*, 2000).

use glam::{DMat3, DVec3};

use super::body::{Body, FIRST_NOISE, Marker, Segment};
use super::error::SolveError;
use crate::clean::linear::Cholesky;
use crate::clean::rigid::Rigid;
use crate::take::Take;

/// Largest deviation of a distance within a group, metres.
const RIGID: f64 = 0.012;
/// Markers that a group needs to have a direction.
const LEAST: usize = 3;
/// Frames looked at.
const FRAMES: usize = 400;
/// Pull of a joint toward the middle between its groups, against one radian of turning.
const HOLD: f64 = 1e-3;
/// Metres of error that a metre between two groups is worth when choosing what to join.
const FAR: f64 = 0.05;

/// Groups of markers, joined to a tree. O(markers^3 + groups^2 x frames)
///
/// # Errors
/// No three markers keep their distances.
pub fn body(take: &Take) -> Result<Body, SolveError> {
    let frames = spread_frames(take);
    let groups = cluster(take, &frames);
    if groups.is_empty() {
        return Err(SolveError::NoGroups {
            needed: LEAST,
            millimetres: 1e3 * RIGID,
        });
    }
    let reference = *frames
        .iter()
        .max_by_key(|&&frame| {
            let seen = |group: &&Vec<usize>| seen(take, group, frame) >= LEAST;
            let whole = groups.iter().filter(seen).count();
            (whole, take.seen(frame).count(), std::cmp::Reverse(frame))
        })
        .unwrap_or(&0);
    let groups: Vec<Group> = groups
        .into_iter()
        .filter_map(|columns| Group::new(take, columns, reference, &frames))
        .collect();
    if groups.is_empty() {
        return Err(SolveError::NoGroups {
            needed: LEAST,
            millimetres: 1e3 * RIGID,
        });
    }
    Ok(join(take, &groups))
}

fn spread_frames(take: &Take) -> Vec<usize> {
    let stride = take.frame_count().div_ceil(FRAMES).max(1);
    (0..take.frame_count()).step_by(stride).collect()
}

fn seen(take: &Take, group: &[usize], frame: usize) -> usize {
    let at = |column: &&usize| take.position(**column, frame).is_some();
    group.iter().filter(at).count()
}

/// Median absolute deviation of two markers' distance, as a standard deviation, metres.
fn deviation(take: &Take, a: usize, b: usize, frames: &[usize]) -> f64 {
    let both = |&frame: &usize| {
        let (a, b) = (take.position(a, frame)?, take.position(b, frame)?);
        Some(a.distance(b))
    };
    let mut all: Vec<f64> = frames.iter().filter_map(both).collect();
    if all.len() < 8.max(frames.len() / 20) {
        return f64::INFINITY;
    }
    let middle = median(&mut all);
    all.iter_mut()
        .for_each(|value| *value = (*value - middle).abs());
    // The bulk must be rigid, and rare bends must show: the 90 % quantile as of a normal law.
    all.sort_by(f64::total_cmp);
    all[(all.len() - 1) * 9 / 10] / 1.645
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Sets of columns, largest first.
fn cluster(take: &Take, frames: &[usize]) -> Vec<Vec<usize>> {
    let count = take.marker_count();
    let mut apart = vec![f64::INFINITY; count * count];
    for a in 0..count {
        for b in 0..a {
            let value = deviation(take, a, b, frames);
            (apart[a * count + b], apart[b * count + a]) = (value, value);
        }
    }
    let mut groups: Vec<Option<Vec<usize>>> = (0..count).map(|column| Some(vec![column])).collect();
    loop {
        let alive: Vec<usize> = (0..count).filter(|&at| groups[at].is_some()).collect();
        let pairs = alive.iter().flat_map(|&a| {
            alive
                .iter()
                .take_while(move |&&b| b < a)
                .map(move |&b| (a, b))
        });
        let best = pairs.min_by(|x, y| {
            let of = |&(a, b): &(usize, usize)| apart[a * count + b];
            of(x).total_cmp(&of(y))
        });
        let Some((a, b)) = best.filter(|&(a, b)| apart[a * count + b] <= RIGID) else {
            break;
        };
        let joined = groups[a].take().unwrap_or_default();
        if let Some(group) = &mut groups[b] {
            group.extend(joined);
        }
        for other in 0..count {
            let far = apart[a * count + other].max(apart[b * count + other]);
            (apart[b * count + other], apart[other * count + b]) = (far, far);
        }
    }
    let mut groups: Vec<Vec<usize>> = groups.into_iter().flatten().collect();
    groups.retain(|group| group.len() >= LEAST);
    for group in &mut groups {
        group.sort_unstable();
    }
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

/// A rigid group and how it moves.
struct Group {
    columns: Vec<usize>,
    /// `[columns]`: where they are in the reference frame, metres.
    at: Vec<DVec3>,
    /// `[frames]`: motion since the reference frame, where enough is seen.
    motion: Vec<Option<Rigid>>,
}

impl Group {
    fn new(take: &Take, columns: Vec<usize>, reference: usize, frames: &[usize]) -> Option<Self> {
        // A group unseen in the reference frame stands where it was seen nearest to it.
        let stand = frames
            .iter()
            .copied()
            .filter(|&frame| seen(take, &columns, frame) >= LEAST)
            .min_by_key(|&frame| frame.abs_diff(reference))?;
        let mut at: Vec<Option<DVec3>> = columns
            .iter()
            .map(|&column| take.position(column, stand))
            .collect();
        let motion_of = |at: &[Option<DVec3>], frame: usize| {
            let pairs = columns.iter().zip(at);
            let pairs = pairs.filter_map(|(&c, at)| Some(((*at)?, take.position(c, frame)?, 1.0)));
            (pairs.clone().count() >= LEAST)
                .then(|| Rigid::fit(pairs))
                .flatten()
        };
        for (index, &column) in columns.iter().enumerate() {
            if at[index].is_some() {
                continue;
            }
            let back = |&frame: &usize| {
                let motion = motion_of(&at, frame)?;
                Some(motion.inverse().apply(take.position(column, frame)?))
            };
            let all: Vec<DVec3> = frames.iter().filter_map(back).collect();
            at[index] = (!all.is_empty()).then(|| all.iter().sum::<DVec3>() / all.len() as f64);
        }
        let motion = frames.iter().map(|&frame| motion_of(&at, frame)).collect();
        let known = columns.iter().zip(&at);
        let (columns, at) = known
            .filter_map(|(&column, at)| Some((column, (*at)?)))
            .unzip();
        Some(Self {
            columns,
            at,
            motion,
        })
    }

    /// The point that both groups carry alike, in the reference frame, and how well they do,
    /// metres.
    fn pivot(&self, other: &Self) -> (DVec3, f64) {
        let pairs = self
            .at
            .iter()
            .flat_map(|a| other.at.iter().map(move |b| (*a, *b)));
        let nearest = pairs.min_by(|x, y| x.0.distance(x.1).total_cmp(&y.0.distance(y.1)));
        let (a, b) = nearest.unwrap_or_default();
        let middle = (a + b) / 2.0;
        let both: Vec<(DMat3, DVec3)> = self
            .motion
            .iter()
            .zip(&other.motion)
            .filter_map(|(a, b)| {
                let (a, b) = ((*a)?, (*b)?);
                Some((a.rotation - b.rotation, b.translation - a.translation))
            })
            .collect();
        let count = both.len().max(1) as f64;
        let mut matrix = DMat3::IDENTITY * (HOLD * count);
        let mut right = HOLD * count * middle;
        for (turn, shift) in &both {
            matrix += turn.transpose() * *turn;
            right += turn.transpose() * *shift;
        }
        let rows = matrix.transpose().to_cols_array().to_vec();
        let mut centre = right.to_array();
        let Some(factor) = Cholesky::new(3, rows) else {
            return (middle, f64::INFINITY);
        };
        factor.solve(&mut centre, 1);
        let centre = DVec3::from_array(centre);
        let miss = |(turn, shift): &(DMat3, DVec3)| (*turn * centre - *shift).length_squared();
        let error = (both.iter().map(miss).sum::<f64>() / count).sqrt();
        let error = if both.is_empty() { 1.0 } else { error };
        (centre, error + FAR * a.distance(b))
    }
}

/// The cheapest tree over all groups (Prim), from the largest group on.
fn join(take: &Take, groups: &[Group]) -> Body {
    let mut body = Body {
        scale: 1.0,
        noise: FIRST_NOISE,
        ..Body::default()
    };
    let mut joints: Vec<DVec3> = Vec::new();
    // Index of each group's segment.
    let mut placed: Vec<Option<usize>> = vec![None; groups.len()];
    let mut order: Vec<usize> = Vec::new();
    for _ in 0..groups.len() {
        let open = (0..groups.len()).filter(|&at| placed[at].is_none());
        let links = open.flat_map(|to| order.iter().map(move |&from| (from, to)));
        let best = links
            .map(|(from, to)| (from, to, groups[from].pivot(&groups[to])))
            .min_by(|a, b| a.2.1.total_cmp(&b.2.1));
        let (at, parent, joint) = match best {
            Some((from, to, (pivot, _))) => (to, placed[from], pivot),
            None => {
                let first = &groups[0].at;
                let middle = first.iter().sum::<DVec3>() / first.len() as f64;
                (0, None, middle)
            }
        };
        let segment = body.segments.len();
        placed[at] = Some(segment);
        order.push(at);
        let offset = parent.map_or(DVec3::ZERO, |parent| joint - joints[parent]);
        joints.push(joint);
        let furthest = groups[at]
            .at
            .iter()
            .map(|marker| *marker - joint)
            .max_by(|a, b| a.length().total_cmp(&b.length()));
        body.segments.push(Segment {
            name: name(take, &groups[at].columns, &body),
            parent,
            offset,
            expected: offset,
            spread: DVec3::splat(0.03),
            turn_spread: DVec3::splat(3.0),
            hinge: None,
            mirror: None,
            end: furthest,
        });
        for (&column, marker) in groups[at].columns.iter().zip(&groups[at].at) {
            body.markers.push(Marker {
                column,
                segment,
                offset: *marker - joint,
                anchor: None,
                shares: Vec::new(),
                expected: *marker - joint,
                spread: 0.005,
            });
        }
    }
    body
}

/// What the labels of a group begin with alike, else a number.
fn name(take: &Take, columns: &[usize], body: &Body) -> String {
    let plain = |&column: &usize| take.labels()[column].as_str();
    let mut labels = columns.iter().map(plain);
    let first = labels.next().unwrap_or_default();
    let shared = labels.fold(first.len(), |length, label| {
        let same = first.bytes().zip(label.bytes());
        length.min(same.take_while(|(a, b)| a == b).count())
    });
    let stem = first.get(..shared).unwrap_or_default();
    let stem = stem.rsplit(':').next().unwrap_or_default();
    let stem: String = stem
        .chars()
        .filter(|letter| letter.is_alphanumeric() || *letter == '_')
        .collect();
    let stem = stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    let stem = stem.strip_suffix("Marker").unwrap_or(stem);
    let stem = stem.trim_end_matches('_');
    let taken = |name: &str| body.segments.iter().any(|segment| segment.name == name);
    if stem.len() >= 2 && !taken(stem) {
        stem.to_owned()
    } else {
        format!("Group{}", body.segments.len() + 1)
    }
}
