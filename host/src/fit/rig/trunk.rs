//! Spine and neck, read from the layers of the trunk.

use glam::DVec3;

use super::figure::Axes;
use crate::spatial::Solid;

/// The spine's place between back and front: vertebral bodies stand behind the middle.
const SPINE: f64 = 0.3;
/// Half the breadth in which a layer is looked at: no arm is so near the middle.
const BREADTH: f64 = 0.05;

/// Extent of a layer near the body's middle: how broad, and from where to where along front.
#[derive(Clone, Copy, Debug)]
struct Extent {
    y: f64,
    width: f64,
    back: f64,
    front: f64,
}

/// Layers above a height, from below, looked at around the middle.
fn extents(solid: &Solid, axes: Axes, middle: f64, breadth: f64, from: f64) -> Vec<Extent> {
    let first = solid.layer_at(from, 1);
    let mut found: Vec<Option<(Extent, f64, f64)>> = Vec::new();
    for cell in 0..solid.len() as u32 {
        let Some(layer) = solid.layer(cell, 1).checked_sub(first) else {
            continue;
        };
        let place = solid.centre(cell);
        let (aside, ahead) = (place.dot(axes.left), place.dot(axes.front));
        if (aside - middle).abs() > breadth {
            continue;
        }
        if found.len() <= layer {
            found.resize(layer + 1, None);
        }
        let extent = Extent {
            y: place.y,
            width: 0.0,
            back: ahead,
            front: ahead,
        };
        let (extent, low, high) = found[layer].get_or_insert((extent, aside, aside));
        (*low, *high) = (low.min(aside), high.max(aside));
        extent.back = extent.back.min(ahead);
        extent.front = extent.front.max(ahead);
    }
    let finish = |(extent, low, high): (Extent, f64, f64)| Extent {
        width: high - low + solid.size(),
        ..extent
    };
    found.into_iter().flatten().map(finish).collect()
}

/// Where the spine passes, from the crotch up to the crown.
pub(super) fn spine(solid: &Solid, axes: Axes, crotch: f64) -> Vec<DVec3> {
    let all = (0..solid.len() as u32).map(|cell| solid.centre(cell));
    let (mut sum, mut count, mut high) = (0.0, 0.0_f64, f64::NEG_INFINITY);
    for place in all {
        high = high.max(place.y);
        if place.y > crotch {
            sum += place.dot(axes.left);
            count += 1.0;
        }
    }
    let middle = sum / count.max(1.0);
    let height = high - crotch;
    let layers = extents(solid, axes, middle, 2.0 * BREADTH * height, crotch);
    let place = |layer: &Extent| {
        let ahead = layer.back + SPINE * (layer.front - layer.back);
        middle * axes.left + ahead * axes.front + layer.y * DVec3::Y
    };
    layers.iter().map(place).collect()
}

/// Where the neck begins and ends: between shoulders and crown the body is thinnest in the middle of
/// the neck; it begins and ends where it gets broader.
pub(super) fn neck(
    solid: &Solid,
    axes: Axes,
    spine: &[DVec3],
    shoulder: f64,
    floor: f64,
    height: f64,
) -> [DVec3; 2] {
    /// The broadest neck, as a part of the height.
    const BROADEST: f64 = 0.12;
    /// Growth at which the neck has become shoulders or head.
    const SHOULDERS: f64 = 1.5;
    const HEAD: f64 = 1.3;
    /// Where both lie on human bodies, as parts of the height.
    const BASE: [f64; 2] = [0.82, 0.875];
    const SKULL: [f64; 2] = [0.885, 0.93];
    let middle = at_height(spine, shoulder).dot(axes.left);
    let layers = extents(solid, axes, middle, BROADEST * height, shoulder);
    let range = |low: f64, high: f64| {
        let range = floor + low * height..floor + high * height;
        layers
            .iter()
            .enumerate()
            .filter(move |(_, layer)| range.contains(&layer.y))
    };
    let thinnest = range(0.83, 0.92).min_by(|a, b| a.1.width.total_cmp(&b.1.width));
    let (mut base, mut skull) = (
        BASE.iter().sum::<f64>() / 2.0,
        SKULL.iter().sum::<f64>() / 2.0,
    );
    if let Some((at, thin)) = thinnest {
        let part = |layer: &Extent| (layer.y - floor) / height;
        let broad = |times: f64| move |layer: &&Extent| layer.width > times * thin.width;
        base = layers[..at]
            .iter()
            .rev()
            .find(broad(SHOULDERS))
            .map_or(base, part);
        skull = layers[at..].iter().find(broad(HEAD)).map_or(skull, part);
    }
    let place = |part: f64| at_height(spine, floor + part * height);
    [
        place(base.clamp(BASE[0], BASE[1])),
        place(skull.clamp(SKULL[0], SKULL[1])),
    ]
}

/// The place of a line that rises steadily at a height, held at its ends.
pub(super) fn at_height(line: &[DVec3], y: f64) -> DVec3 {
    let after = line.partition_point(|place| place.y < y);
    match (
        after.checked_sub(1).and_then(|at| line.get(at)),
        line.get(after),
    ) {
        (Some(&below), Some(&above)) => below.lerp(above, (y - below.y) / (above.y - below.y)),
        (Some(&only), None) | (None, Some(&only)) => only.with_y(y),
        (None, None) => DVec3::Y * y,
    }
}
