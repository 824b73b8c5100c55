//! Rest shapes in 16-bit numbers: positions in the box of their block, directions as octahedral
//! pairs. What that costs is measured with the core's own arithmetic.

use glam::DVec3;
use sinew_core::asset::LANES;

use super::blocks::Blocks;
use crate::model::Mesh;

/// Packed positions and normals of all blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed {
    /// `[blocks]`: origin and step, x, y, z each.
    pub boxes: Vec<[f32; 6]>,
    /// `[blocks]`
    pub positions: Vec<[[u16; LANES]; 3]>,
    /// `[blocks]`
    pub normals: Vec<[[i16; LANES]; 2]>,
    /// What packing changed.
    pub error: PackError,
}

/// Largest changes by packing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackError {
    /// Metres.
    pub position: f64,
    /// Radians.
    pub normal: f64,
}

/// Packs positions and normals. O(vertices)
#[must_use]
pub fn pack(mesh: &Mesh, blocks: &Blocks) -> Packed {
    let mut packed = Packed::default();
    for block in blocks.order.chunks(LANES) {
        let lanes = lanes(block);
        let positions = lanes.map(|vertex| mesh.positions[vertex]);
        let (mut place, mut numbers) = ([0.0_f32; 6], [[0; LANES]; 3]);
        for axis in 0..3 {
            let of = positions.map(|position| position[axis]);
            let low = of.iter().copied().fold(f64::INFINITY, f64::min) as f32;
            let high = of.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let steps = f64::from(u16::MAX);
            let step = ((high - f64::from(low)).max(0.0) / steps) as f32;
            (place[axis], place[axis + 3]) = (low, step);
            for (number, wanted) in numbers[axis].iter_mut().zip(of) {
                let exact = (wanted - f64::from(low)) / f64::from(step);
                // A box without extent has no steps.
                *number = if exact.is_finite() {
                    exact.round() as u16
                } else {
                    0
                };
            }
        }
        for (lane, position) in positions.iter().enumerate() {
            let found =
                |axis: usize| place[axis] + f32::from(numbers[axis][lane]) * place[axis + 3];
            let found = DVec3::from_array([0, 1, 2].map(|axis| f64::from(found(axis))));
            packed.error.position = packed.error.position.max(found.distance(*position));
        }
        packed.boxes.push(place);
        packed.positions.push(numbers);
        let (normals, error) = directions(lanes.map(|vertex| mesh.normals[vertex]));
        packed.error.normal = packed.error.normal.max(error);
        packed.normals.push(normals);
    }
    packed
}

/// Tangents of all blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tangents {
    /// `[blocks]`
    pub directions: Vec<[[i16; LANES]; 2]>,
    /// `[blocks]`: bits of those with negative handedness.
    pub signs: Vec<u8>,
}

/// Packs tangents; `None` where the mesh has none. O(vertices)
#[must_use]
pub fn tangents(mesh: &Mesh, blocks: &Blocks) -> Option<Tangents> {
    let tangents = mesh.tangents.as_ref()?;
    let all = blocks.order.chunks(LANES).map(|block| {
        let lanes = lanes(block).map(|vertex| tangents[vertex]);
        let (packed, _) = directions(lanes.map(|[x, y, z, _]| DVec3::new(x, y, z)));
        let negative = lanes
            .iter()
            .enumerate()
            .filter(|(_, tangent)| tangent[3] < 0.0);
        (
            packed,
            negative.fold(0_u8, |signs, (lane, _)| signs | 1 << lane),
        )
    });
    let (directions, signs) = all.unzip();
    Some(Tangents { directions, signs })
}

/// Vertices of a block; a short one repeats its last.
fn lanes(block: &[u32]) -> [usize; LANES] {
    std::array::from_fn(|lane| *block.get(lane).unwrap_or(&block[block.len() - 1]) as usize)
}

/// Octahedral pairs and the largest angle by which one is off.
fn directions(lanes: [DVec3; LANES]) -> ([[i16; LANES]; 2], f64) {
    let (mut packed, mut worst) = ([[0; LANES]; 2], 0.0_f64);
    for (lane, direction) in lanes.into_iter().enumerate() {
        let (pair, error) = octahedral(direction);
        (packed[0][lane], packed[1][lane]) = pair;
        worst = worst.max(error);
    }
    (packed, worst)
}

const ONE: f64 = i16::MAX as f64;

/// The pair nearest to a direction, and the angle between; +Z for a direction of no length.
fn octahedral(direction: DVec3) -> ((i16, i16), f64) {
    let sum = direction.abs().element_sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return ((0, 0), 0.0);
    }
    let (mut x, mut y) = (direction.x / sum, direction.y / sum);
    if direction.z < 0.0 {
        (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    }
    let around = |value: f64| [value.floor(), value.ceil()].map(|n| n.clamp(-ONE, ONE) as i16);
    let mut best = ((0, 0), f64::INFINITY);
    for x in around(x * ONE) {
        for y in around(y * ONE) {
            let angle = unpacked((x, y)).angle_between(direction);
            if angle < best.1 {
                best = ((x, y), angle);
            }
        }
    }
    best
}

/// The direction of a pair, of any length.
fn unpacked((x, y): (i16, i16)) -> DVec3 {
    let (x, y) = (f64::from(x), f64::from(y));
    let z = ONE - x.abs() - y.abs();
    let beyond = (-z).max(0.0);
    DVec3::new(x - beyond.copysign(x), y - beyond.copysign(y), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_come_back_within_a_hundredth_of_a_degree() {
        for step in 0..2000 {
            let (a, b) = (f64::from(step) * 2.399_963, f64::from(step) / 1000.0 - 1.0);
            let round = (1.0 - b * b).max(0.0).sqrt();
            let direction = DVec3::new(round * a.cos(), b, round * a.sin());
            let (pair, angle) = octahedral(direction);
            assert!(angle < 1e-4, "{direction} {angle}");
            assert!(unpacked(pair).angle_between(direction) < 1e-4);
        }
        assert_eq!(octahedral(DVec3::ZERO).0, (0, 0));
    }
}
