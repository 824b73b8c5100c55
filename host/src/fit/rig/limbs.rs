//! Arms and legs, followed from their ends to the trunk.

use std::collections::BTreeMap;

use glam::DVec3;

use super::error::RigError;
use super::figure::{Axes, Limb};
use super::trunk::at_height;
use crate::spatial::Solid;

/// Thickness of a slice, in cells.
const SLICE: f64 = 1.5;

/// What lies at one distance from the end of a limb.
#[derive(Clone, Copy, Debug)]
struct Slice {
    /// Metres from the end, through the inside.
    distance: f64,
    centre: DVec3,
    /// Square metres.
    area: f64,
}

/// Slices by distance from a cell, until `reach` metres.
fn slices(solid: &Solid, end: u32, reach: f64) -> Vec<Slice> {
    let (away, _) = solid.march(&[(end, 0.0, 0)]);
    let step = SLICE * solid.size();
    let mut sums = vec![(DVec3::ZERO, 0.0); (reach / step).ceil() as usize];
    for (cell, away) in away.iter().enumerate() {
        if let Some((sum, count)) = sums.get_mut((f64::from(*away) / step) as usize) {
            *sum += solid.centre(cell as u32);
            *count += 1.0;
        }
    }
    let slice = |(at, (sum, count)): (usize, (DVec3, f64))| Slice {
        distance: (at as f64 + 0.5) * step,
        centre: sum / count,
        area: count * solid.size().powi(2) / SLICE,
    };
    let filled = sums
        .into_iter()
        .enumerate()
        .filter(|(_, (_, count))| *count > 0.0);
    filled.map(slice).collect()
}

/// An arm: from the fingertip the thinnest slice is the wrist; where slices grow into the trunk the
/// arm ends, and the shoulder is one radius of the arm farther.
pub(super) fn arm(solid: &Solid, hand: u32, height: f64) -> Result<Limb, RigError> {
    /// Expected distance of the wrist from the fingertip, as a part of the height (Drillis & Contini
    /// 1966), and its spread, wide enough for curled fingers and fists.
    const HAND: (f64, f64) = (0.115, 0.035);
    /// Least length of an arm without its hand.
    const ARM: f64 = 0.17;
    /// Growth at which the slice is no longer the arm's alone.
    const GROWTH: f64 = 1.3;
    /// Growth at which it is the trunk.
    const TRUNK: f64 = 2.0;
    let slices = slices(solid, hand, 0.6 * height);
    let within = |low: f64, high: f64| {
        let range = low * height..high * height;
        slices
            .iter()
            .enumerate()
            .filter(move |(_, slice)| range.contains(&slice.distance))
    };
    let why = |why: &str| RigError::NoLimb {
        limb: "arm",
        why: why.to_owned(),
    };
    let forearm = median(within(0.14, 0.24).map(|(_, slice)| slice.area));
    let cost = |slice: &Slice| {
        let off = (slice.distance / height - HAND.0) / HAND.1;
        slice.area / forearm + 0.2 * off * off
    };
    // Fingers are thin too, but lie before the palm.
    let palm = within(0.03, 0.115).max_by(|a, b| a.1.area.total_cmp(&b.1.area));
    let palm = palm.map_or(0, |(at, _)| at);
    let wrist = within(0.05, 0.2)
        .filter(|&(at, _)| at > palm)
        .min_by(|a, b| cost(a.1).total_cmp(&cost(b.1)));
    let (wrist, _) = wrist.ok_or_else(|| why("it is too short"))?;
    let start = slices[wrist].distance + ARM * height;
    let first = slices.partition_point(|slice| slice.distance < start);
    let growth = |at: usize| {
        let away = |slice: &&Slice| (slices[at].distance - slice.distance) / height;
        let recent = slices[..at]
            .iter()
            .filter(|slice| (0.015..0.09).contains(&away(slice)));
        slices[at].area / median(recent.map(|slice| slice.area))
    };
    // Bent elbows grow too, but not as much, nor on and on.
    let goes_on = |at: usize| (at..at + 3).all(|at| growth(at) > GROWTH);
    let trunk = (first..slices.len().saturating_sub(3))
        .find(|&at| growth(at) > TRUNK && goes_on(at))
        .ok_or_else(|| why("it does not end at a trunk"))?;
    let grows = (first..=trunk).rev().take_while(|&at| growth(at) > GROWTH);
    let last = grows.last().unwrap_or(trunk);
    let before = |metres: f64| {
        let wanted = slices[last].distance - metres;
        slices.partition_point(|slice| slice.distance < wanted)
    };
    let back = &slices[before(0.06 * height)];
    let radius = (median(slices[before(0.08 * height)..last].iter().map(|s| s.area))
        / std::f64::consts::PI)
        .sqrt();
    let inward = (slices[last].centre - back.centre).normalize_or_zero();
    let mut axis = vec![slices[last].centre + radius * inward];
    axis.extend(slices[wrist..=last].iter().rev().map(|slice| slice.centre));
    Ok(Limb {
        axis,
        tip: solid.centre(hand),
    })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Height at which the legs meet: the lowest place equally far from both feet, within the bounds of
/// human bodies.
pub(super) fn crotch(solid: &Solid, feet: [u32; 2], floor: f64, height: f64) -> f64 {
    let (_, marks) = solid.march(&[(feet[0], 0.0, 0), (feet[1], 0.0, 1)]);
    let meets = |&cell: &u32| {
        let own = marks[cell as usize];
        own < 2
            && solid
                .neighbours(cell)
                .any(|next| marks[next as usize] == 1 - own)
    };
    let meeting = (0..solid.len() as u32).filter(meets);
    let lowest = meeting
        .map(|cell| solid.centre(cell).y)
        .fold(f64::INFINITY, f64::min);
    lowest.clamp(floor + 0.4 * height, floor + 0.54 * height)
}

/// The cells of a leg: what hangs together with a foot below the crotch.
pub(super) fn leg_cells(solid: &Solid, foot: u32, crotch: f64) -> Vec<u32> {
    let top = solid.layer_at(crotch, 1);
    let mut seen = vec![false; solid.len()];
    seen[foot as usize] = true;
    let mut cells = vec![foot];
    let mut at = 0;
    while let Some(&cell) = cells.get(at) {
        at += 1;
        for next in solid.neighbours(cell) {
            if solid.layer(next, 1) < top && !std::mem::replace(&mut seen[next as usize], true) {
                cells.push(next);
            }
        }
    }
    cells
}

/// A layer of a leg.
#[derive(Clone, Copy, Debug, Default)]
struct Layer {
    sum: DVec3,
    count: f64,
    back: f64,
    front: f64,
}

/// A leg: the middle of each layer; the ankle is where the foot no longer stands out in front.
#[allow(
    clippy::too_many_arguments,
    reason = "all of what is known about the body"
)]
pub(super) fn leg(
    solid: &Solid,
    cells: &[u32],
    foot: u32,
    axes: Axes,
    spine: &[DVec3],
    crotch: f64,
    floor: f64,
    height: f64,
) -> Result<Limb, RigError> {
    /// Height of the hip joint over the crotch.
    const HIP: f64 = 0.05;
    /// The foot begins where a layer is this much longer than the shin is thick.
    const FOOT: f64 = 1.35;
    let mut layers: BTreeMap<usize, Layer> = BTreeMap::new();
    for &cell in cells {
        let place = solid.centre(cell);
        let ahead = place.dot(axes.front);
        let layer = layers.entry(solid.layer(cell, 1)).or_insert(Layer {
            back: f64::INFINITY,
            front: f64::NEG_INFINITY,
            ..Layer::default()
        });
        layer.sum += place;
        layer.count += 1.0;
        layer.back = layer.back.min(ahead);
        layer.front = layer.front.max(ahead);
    }
    let part = |layer: &Layer| (layer.sum.y / layer.count - floor) / height;
    let length = |layer: &Layer| layer.front - layer.back + solid.size();
    let shin = layers
        .values()
        .filter(|layer| (0.06..0.2).contains(&part(layer)));
    let shin = shin.map(length).fold(f64::INFINITY, f64::min);
    let ankle = layers
        .values()
        .find(|layer| part(layer) > 0.02 && length(layer) <= FOOT * shin);
    let why = |why: &str| RigError::NoLimb {
        limb: "leg",
        why: why.to_owned(),
    };
    let ankle = ankle.ok_or_else(|| why("no part of it is thinner than the foot is long"))?;
    // A boot's top is no ankle.
    let ankle = part(ankle).clamp(0.03, 0.075);
    let places = layers.values().filter(|layer| part(layer) >= ankle);
    let mut axis: Vec<DVec3> = places.map(|layer| layer.sum / layer.count).collect();
    axis.reverse();
    let top = *axis.first().ok_or_else(|| why("it has no length"))?;
    if top.y < floor + 0.3 * height {
        return Err(why("it does not reach up to a trunk"));
    }
    let hip = crotch + HIP * height;
    // The head of the thigh bone stands above the middle of the thigh, amid the pelvis.
    let pelvis = at_height(spine, hip);
    let thigh: Vec<DVec3> = axis
        .iter()
        .take_while(|p| p.y > crotch - 0.06 * height)
        .copied()
        .collect();
    let thigh = thigh.iter().sum::<DVec3>() / thigh.len().max(1) as f64;
    let beside = thigh.dot(axes.left) - pelvis.dot(axes.left);
    let ahead = 0.5 * (thigh + pelvis).dot(axes.front) - pelvis.dot(axes.front);
    let hip = pelvis + beside * axes.left + ahead * axes.front;
    axis.retain(|place| place.y < crotch - 0.02 * height);
    axis.insert(0, hip);
    Ok(Limb {
        axis,
        tip: solid.centre(foot),
    })
}

/// Where a limb bends, by the place along its axis at which two straight lines fit best; `expected`
/// is the upper bone's part of both.
pub(super) fn bend(axis: &[DVec3], expected: f64) -> DVec3 {
    /// How far bodies differ from the expectation, as a part of both bones.
    const SPREAD: f64 = 0.05;
    /// How far axes are off, metres.
    const NOISE: f64 = 0.003;
    let (Some(&root), Some(&end)) = (axis.first(), axis.last()) else {
        return DVec3::ZERO;
    };
    let cost = |at: usize| {
        let middle = axis[at];
        let upper = axis[..=at].iter().map(|&p| off_line(p, root, middle));
        let lower = axis[at..].iter().map(|&p| off_line(p, middle, end));
        let off = upper.chain(lower).sum::<f64>() / axis.len() as f64;
        let part = root.distance(middle) / (root.distance(middle) + middle.distance(end));
        off / NOISE.powi(2) + ((part - expected) / SPREAD).powi(2)
    };
    let inner = 1..axis.len().saturating_sub(1).max(1);
    let best = inner.min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
    best.map_or(root, |at| corner(axis, at))
}

/// The place where both straight parts of a bent axis would meet: the axis itself cuts the corner.
fn corner(axis: &[DVec3], bend: usize) -> DVec3 {
    /// Part of the limb that is left out around the bend.
    const ROUND: f64 = 0.07;
    /// Limbs whose parts differ less, as the cosine, have no corner.
    const STRAIGHT: f64 = 0.95;
    let at = axis[bend];
    let length: f64 = axis.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let line = |points: &[DVec3]| {
        let far = points
            .iter()
            .filter(|point| point.distance(at) > ROUND * length);
        let far: Vec<DVec3> = far.copied().collect();
        let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
        let (first, second) = far.split_at(far.len() / 2);
        (far.len() >= 4).then(|| (mean(&far), (mean(second) - mean(first)).normalize_or_zero()))
    };
    let (Some((a, along_a)), Some((b, along_b))) = (line(&axis[..=bend]), line(&axis[bend..]))
    else {
        return at;
    };
    let cosine = along_a.dot(along_b);
    if cosine.abs() > STRAIGHT {
        return at;
    }
    // The nearest points of both lines.
    let (between, under) = (b - a, 1.0 - cosine * cosine);
    let [on_a, on_b] = [between.dot(along_a), between.dot(along_b)];
    let meet_a = a + along_a * ((on_a - cosine * on_b) / under);
    let meet_b = b + along_b * ((cosine * on_a - on_b) / under);
    (meet_a + meet_b) / 2.0
}

/// Square of the distance from a line.
fn off_line(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = (to - from).normalize_or_zero();
    (point - from).reject_from(along).length_squared()
}
