//! Skin from dense markers, straight from the equations of Park & Hodgins 2006, section 5.3, and of
//! the two forms that stand for it in real time. Markers are complete here.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use sinew_core::asset::{LANES, WEIGHT_ONE};

use crate::clean::linear::Cholesky;
use crate::clean::rigid::Rigid;
use crate::fit::parts::{BlockTables, ModeData, ModeTables, RigTables, SlotRows};

/// Vertices `[vertices]` in the source's order, metres, for markers `[markers]`; `quadratic` and
/// `residual` switch terms of the exact mode.
#[must_use]
pub fn positions(
    rig: &RigTables,
    mode: &ModeData,
    markers: &[DVec3],
    (quadratic, residual): (bool, bool),
) -> Vec<DVec3> {
    let mut out = vec![DVec3::ZERO; mode.order().len()];
    match mode {
        ModeData::Collapsed { order, slots } => {
            add(order, &slots.positions, markers, &mut out);
        }
        ModeData::Hybrid {
            blocks,
            slots,
            linear,
        } => {
            let frames = frames(rig, markers);
            let blend = if *linear { mean } else { blend };
            let residuals = residuals(rig, markers, &frames, blend);
            for (block, vertices) in blocks.order.chunks(LANES).enumerate() {
                for (lane, &vertex) in vertices.iter().enumerate() {
                    out[vertex as usize] = vector(blocks.positions[block].map(|x| x[lane]));
                }
            }
            add(&blocks.order, &slots.positions, &residuals, &mut out);
            for (block, lane, vertex) in lanes(blocks) {
                let row = weights(blocks, block, lane);
                out[vertex] = blend(&frames, &row).transform_point3(out[vertex]);
            }
        }
        ModeData::Exact { blocks, modes } => {
            let frames = frames(rig, markers);
            let mut parts: Vec<Part> = (0..frames.len())
                .map(|part| Part::new(modes, part, &frames[part], markers, quadratic))
                .collect();
            if residual {
                add_residuals(&mut parts, modes, markers);
            }
            for (block, lane, vertex) in lanes(blocks) {
                let rest = vector(blocks.positions[block].map(|x| x[lane]));
                // Equation 9.
                out[vertex] = weights(blocks, block, lane)
                    .into_iter()
                    .map(|(part, weight)| weight * parts[part].point(rest))
                    .sum();
            }
        }
    }
    out
}

/// Frames `[parts]` that bring the rest pose nearest to the markers (Horn 1987).
fn frames(rig: &RigTables, markers: &[DVec3]) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::new();
    for part in 0..rig.parents.len() {
        let members = rig.member_starts[part] as usize..rig.member_starts[part + 1] as usize;
        let pairs = members.map(|at| {
            let marker = usize::from(rig.member_markers[at]);
            let weight = f64::from(rig.member_weights[at]);
            (vector(rig.rest[marker]), markers[marker], weight)
        });
        let parent = out.get(usize::from(rig.parents[part])).copied();
        // The joint, and points beside it that turn as the parent does.
        let held = parent.iter().flat_map(|above| {
            let [x, y, z, weight] = rig.pivots[part].map(f64::from);
            let at = DVec3::new(x, y, z);
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
                let share = if axis == DVec3::ZERO { 1.0 } else { 0.01 };
                let from = at + 0.1 * axis;
                (from, above.transform_point3(from), share * weight)
            })
        });
        let pairs: Vec<(DVec3, DVec3, f64)> = pairs.chain(held).collect();
        let fit = |pairs: &[(DVec3, DVec3, f64)]| {
            Rigid::fit(pairs.iter().copied()).map(|motion| DAffine3 {
                matrix3: motion.rotation,
                translation: motion.translation,
            })
        };
        let mut fitted = fit(&pairs);
        // Markers taken for others count the less the further they are off (Cauchy's weights).
        let limit2 = f64::from(rig.residual_limit).powi(2);
        for _ in 0..2 {
            let Some(frame) = fitted else {
                break;
            };
            let off2 = |from: DVec3, to| frame.transform_point3(from).distance_squared(to);
            if pairs.iter().all(|&(from, to, _)| off2(from, to) <= limit2) {
                break;
            }
            let weighed = pairs.iter().map(|&(from, to, weight)| {
                let share = limit2 / (limit2 + off2(from, to) + 1e-12);
                (from, to, weight * share)
            });
            fitted = fit(&weighed.collect::<Vec<_>>());
        }
        out.push(fitted.or(parent).unwrap_or(DAffine3::IDENTITY));
    }
    out
}

/// `[markers]`: where a marker is, carried back to the rest pose, less where it was there.
fn residuals(rig: &RigTables, markers: &[DVec3], frames: &[DAffine3], blend: Blend) -> Vec<DVec3> {
    let one = |(marker, &position): (usize, &DVec3)| {
        let range = rig.carrier_starts[marker] as usize..rig.carrier_starts[marker + 1] as usize;
        let row: Vec<(usize, f64)> = range
            .map(|at| {
                let part = usize::from(rig.carrier_parts[at]);
                (part, f64::from(rig.carrier_weights[at]))
            })
            .collect();
        let frame = blend(frames, &row);
        frame.inverse().transform_point3(position) - vector(rig.rest[marker])
    };
    markers.iter().enumerate().map(one).collect()
}

/// Frames and (part, weight) to one motion.
type Blend = fn(&[DAffine3], &[(usize, f64)]) -> DAffine3;

/// Matrices blended.
fn mean(frames: &[DAffine3], row: &[(usize, f64)]) -> DAffine3 {
    let mut sum = DAffine3::ZERO;
    for &(part, weight) in row {
        sum.matrix3 += frames[part].matrix3 * weight;
        sum.translation += frames[part].translation * weight;
    }
    sum
}

/// Dual quaternions blended (Kavan et al. 2008, section 3).
fn blend(frames: &[DAffine3], row: &[(usize, f64)]) -> DAffine3 {
    let (mut real, mut dual) = ([0.0; 4], [0.0; 4]);
    for &(part, weight) in row {
        let q = DQuat::from_mat3(&frames[part].matrix3).normalize();
        let t = frames[part].translation;
        let half = (DQuat::from_xyzw(t.x, t.y, t.z, 0.0) * q) * 0.5;
        let near: f64 = real.iter().zip(q.to_array()).map(|(a, b)| a * b).sum();
        let signed = if near < 0.0 { -weight } else { weight };
        for (sum, value) in real.iter_mut().zip(q.to_array()) {
            *sum += signed * value;
        }
        for (sum, value) in dual.iter_mut().zip(half.to_array()) {
            *sum += signed * value;
        }
    }
    let length = real.iter().map(|x| x * x).sum::<f64>().sqrt();
    let rotation = DQuat::from_array(real.map(|x| x / length));
    let half = DQuat::from_array(dual.map(|x| x / length));
    let shift = (half * rotation.conjugate()).to_array();
    DAffine3 {
        matrix3: DMat3::from_quat(rotation),
        translation: DVec3::new(shift[0], shift[1], shift[2]) * 2.0,
    }
}

/// A part in a frame: equations 6 to 8.
struct Part {
    to_local: DAffine3,
    to_world: DAffine3,
    /// Columns of the transformation, the constant last.
    columns: [DVec3; 10],
    dilation: f64,
    /// Centre and weight of each member, in world space.
    basis: Vec<(DVec3, DVec3)>,
}

impl Part {
    fn new(
        modes: &ModeTables,
        part: usize,
        frame: &DAffine3,
        markers: &[DVec3],
        quadratic: bool,
    ) -> Self {
        let to_local = affine(&modes.to_local[part]);
        let mut out = Self {
            to_local,
            to_world: *frame * affine(&modes.from_local[part]),
            columns: [DVec3::ZERO; 10],
            dilation: f64::from(modes.dilations[part]),
            basis: Vec::new(),
        };
        (out.columns[0], out.columns[1], out.columns[2]) = (DVec3::X, DVec3::Y, DVec3::Z);
        let members = modes.member_starts[part] as usize..modes.member_starts[part + 1] as usize;
        let back = to_local * frame.inverse();
        if quadratic {
            for at in members {
                let marker = markers[usize::from(modes.member_markers[at])];
                let [x, y, z, _] = modes.member_local[at];
                let moved = back.transform_point3(marker) - vector([x, y, z]);
                for (column, share) in out.columns.iter_mut().zip(modes.member_inverse[at]) {
                    *column += moved * f64::from(share);
                }
            }
        }
        out
    }

    /// A point of the reference frame by the quadratic transformation, in world space.
    fn transformed(&self, p: DVec3) -> DVec3 {
        let [x, y, z] = p.to_array();
        let terms = [x, y, z, x * x, y * y, z * z, x * y, y * z, z * x, 1.0];
        let local = self.columns.iter().zip(terms).map(|(c, t)| *c * t).sum();
        self.to_world.transform_point3(local)
    }

    fn value(&self, distance: f64) -> f64 {
        let x = self.dilation * distance;
        let (outer, inner) = ((2.0 - x).max(0.0), (1.0 - x).max(0.0));
        (outer.powi(3) - 4.0 * inner.powi(3)) / 6.0
    }

    /// Equation 7; nothing where the system is not positive definite.
    fn solve(&self, centres: &[DVec3], left: &[DVec3], smoothing: f64) -> Vec<DVec3> {
        let n = centres.len();
        let mut matrix = Vec::with_capacity(n * n);
        for (row, a) in centres.iter().enumerate() {
            for (column, b) in centres.iter().enumerate() {
                let diagonal = if row == column { smoothing } else { 0.0 };
                matrix.push(self.value(a.distance(*b)) + diagonal);
            }
        }
        let Some(factor) = Cholesky::new(n, matrix) else {
            return vec![DVec3::ZERO; n];
        };
        let mut right: Vec<f64> = left.iter().flat_map(DVec3::to_array).collect();
        factor.solve(&mut right, 3);
        right.chunks_exact(3).map(DVec3::from_slice).collect()
    }

    /// Equation 8.
    fn point(&self, rest: DVec3) -> DVec3 {
        let moved = self.transformed(self.to_local.transform_point3(rest));
        let residual =
            |(centre, weight): &(DVec3, DVec3)| *weight * self.value(moved.distance(*centre));
        moved + self.basis.iter().map(residual).sum::<DVec3>()
    }
}

/// The radial basis of each part, which meets what is left between markers and the surface that all
/// parts move together.
fn add_residuals(parts: &mut [Part], modes: &ModeTables, markers: &[DVec3]) {
    let members =
        |part: usize| modes.member_starts[part] as usize..modes.member_starts[part + 1] as usize;
    let mut left = markers.to_vec();
    for (at, part) in parts.iter_mut().enumerate() {
        for member in members(at) {
            let [x, y, z, share] = modes.member_local[member];
            let centre = part.transformed(vector([x, y, z]));
            left[usize::from(modes.member_markers[member])] -= f64::from(share) * centre;
            part.basis.push((centre, DVec3::ZERO));
        }
    }
    for (at, part) in parts.iter_mut().enumerate() {
        let of = members(at).map(|at| left[usize::from(modes.member_markers[at])]);
        let right: Vec<DVec3> = of.collect();
        let centres: Vec<DVec3> = part.basis.iter().map(|basis| basis.0).collect();
        let weights = part.solve(&centres, &right, f64::from(modes.smoothing));
        part.basis = centres.into_iter().zip(weights).collect();
    }
}

/// Adds shares of handles to vertices.
fn add(order: &[u32], slots: &SlotRows<[f32; LANES]>, handles: &[DVec3], out: &mut [DVec3]) {
    for (block, vertices) in order.chunks(LANES).enumerate() {
        for slot in slots.starts[block] as usize..slots.starts[block + 1] as usize {
            let handle = handles[usize::from(slots.markers[slot])];
            for (lane, &vertex) in vertices.iter().enumerate() {
                out[vertex as usize] += f64::from(slots.shares[slot][lane]) * handle;
            }
        }
    }
}

fn lanes(blocks: &BlockTables) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
    let places = blocks.order.iter().enumerate();
    places.map(|(at, &vertex)| (at / LANES, at % LANES, vertex as usize))
}

fn weights(blocks: &BlockTables, block: usize, lane: usize) -> Vec<(usize, f64)> {
    let slots = blocks.starts[block] as usize..blocks.starts[block + 1] as usize;
    let weight = |slot: usize| f64::from(blocks.weights[slot][lane]) / f64::from(WEIGHT_ONE);
    slots
        .map(|slot| (usize::from(blocks.parts[slot]), weight(slot)))
        .collect()
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

fn affine(rows: &[f32; 12]) -> DAffine3 {
    let m = rows.map(f64::from);
    DAffine3 {
        matrix3: DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]),
        translation: DVec3::new(m[3], m[7], m[11]),
    }
}
