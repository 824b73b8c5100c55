//! The published mode: each part's quadratic transformation and radial-basis residual (equations
//! 6 to 9), blended over parts.
//!
//! Repairs against the paper: residuals are those of the blended surface and not of each part, or a
//! part would meet markers that hardly belong to it, far from where it alone takes them, and
//! overshoot between; a constant column beside the nine quadratic ones; a ridge toward the
//! identity in the pseudo-inverse; the support of the basis equals the dilation, which keeps its
//! systems positive definite; parts with few markers have rows of zeros for what they cannot fix.

use core::ops::Range;

use super::error::{below, length, numbers, starts};
use super::exact_frame::ExactHandles;
use super::slots::{PartBlocks, row};
use super::{PartsError, PartsTable, cross, tangents};
use crate::Level;
use crate::asset::LANES;
use crate::deform::blocks::{Kernel, run};
use crate::deform::lanes::Lanes;
use crate::deform::output::Output;
use crate::deform::skin::to_unit_length;
use crate::deform::store::Store;
use crate::math::{Affine12, inverse_sqrt};

/// Columns of a part's transformation: three linear, three squares, three products, a constant.
pub(super) const COLUMNS: usize = 10;

/// Tables of the exact mode.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExactTables<'a> {
    /// Rest shape and weights of parts.
    pub blocks: PartBlocks<'a>,
    /// `[slots]`: how the weights of eight vertices change along their two tangents, a metre.
    pub gradients: &'a [[[f32; LANES]; 2]],
    /// `[parts]`: from the rest pose to the part's reference frame, whose unit is its size.
    pub to_local: &'a [Affine12],
    /// `[parts]`: the inverse.
    pub from_local: &'a [Affine12],
    /// `[parts]`: two over the support of the radial basis, a metre.
    pub dilations: &'a [f32],
    /// `[parts + 1]`: first member of each part.
    pub member_starts: &'a [u32],
    /// Markers of parts.
    pub member_markers: &'a [u16],
    /// `[members]`: position in the part's reference frame (the paper's local part reference
    /// position), then the part's share in the surface there; the shares of a marker sum to one.
    pub member_local: &'a [[f32; 4]],
    /// `[members]`: what a marker's move adds to each column of the transformation (equation 6).
    pub member_inverse: &'a [[f32; COLUMNS]],
    /// Added to the diagonal of the radial-basis systems, so that noise is not interpolated.
    pub smoothing: f32,
}

/// A checked exact mode.
#[derive(Clone, Copy, Debug)]
pub struct Exact<'a> {
    pub(super) tables: ExactTables<'a>,
    pub(super) most_members: usize,
    pub(super) marker_count: usize,
}

impl<'a> Exact<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(tables: ExactTables<'a>, marker_count: usize) -> Result<Self, PartsError> {
        let parts = tables.to_local.len();
        tables.blocks.check(parts)?;
        let slots = tables.blocks.parts.len();
        length(PartsTable::PartSlots, tables.gradients.len(), slots)?;
        let gradients = tables.gradients.as_flattened().as_flattened();
        numbers(PartsTable::PartSlots, gradients, 1e5)?;
        let modes = PartsTable::Modes;
        length(modes, tables.from_local.len(), parts)?;
        length(modes, tables.dilations.len(), parts)?;
        for frames in [tables.to_local, tables.from_local] {
            numbers(modes, frames.as_flattened(), 1e6)?;
        }
        numbers(modes, tables.dilations, 1e6)?;
        if let Some(at) = tables.dilations.iter().position(|&x| x <= 0.0) {
            return Err(PartsError::Number { table: modes, at });
        }
        numbers(modes, &[tables.smoothing], 10.0)?;
        let members = tables.member_markers.len();
        length(modes, tables.member_local.len(), members)?;
        length(modes, tables.member_inverse.len(), members)?;
        starts(tables.member_starts, parts, members)?;
        let of = tables.member_markers.iter().map(|&at| usize::from(at));
        below(PartsTable::Members, of, marker_count)?;
        numbers(modes, tables.member_local.as_flattened(), 1e4)?;
        numbers(modes, tables.member_inverse.as_flattened(), 1e4)?;
        let mut shares = tables.member_local.iter().map(|&[.., share]| share);
        if let Some(at) = shares.position(|share| !(0.0..=1.0).contains(&share)) {
            return Err(PartsError::Number { table: modes, at });
        }
        let count = |part| row(tables.member_starts, part).len();
        Ok(Self {
            tables,
            most_members: (0..parts).map(count).max().unwrap_or(0),
            marker_count,
        })
    }

    /// The tables.
    #[must_use]
    pub fn tables(&self) -> &ExactTables<'a> {
        &self.tables
    }

    /// Number of parts.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.tables.to_local.len()
    }

    /// Number of blocks of eight vertices.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.tables.blocks.block_count()
    }

    /// Multiplications of a frame with normals when all residuals are solved; an upper bound, which
    /// counts every member of a part although those out of a block's reach are passed over.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        let members = |part: usize| row(self.tables.member_starts, part).len();
        let solves: usize = (0..self.part_count())
            .map(members)
            .map(|n| n * n * n / 6 + 20 * n * n + 150 * n)
            .sum();
        let slots = self.tables.blocks.parts.iter();
        let streamed: usize = slots
            .map(|&part| 170 + 40 * members(usize::from(part)))
            .sum();
        solves + LANES * (streamed + 60 * self.block_count())
    }

    /// Vertices of a range of blocks, which is cut to those that exist. Ranges may go to different
    /// threads with outputs of their own.
    ///
    /// `handles`: from [`Self::handles`]. The bits do not depend on `level`. O(slots x members)
    pub fn blocks(
        &self,
        handles: &ExactHandles<'_>,
        blocks: Range<usize>,
        level: Level,
        output: &mut Output<'_>,
    ) {
        let stream = Stream {
            tables: &self.tables,
            handles,
        };
        run(&stream, blocks, level, output);
    }
}

struct Stream<'s, 'a> {
    tables: &'s ExactTables<'a>,
    handles: &'s ExactHandles<'s>,
}

/// A point and what two tangents become there.
struct Moved<L> {
    position: [L; 3],
    along: [L; 3],
    across: [L; 3],
}

impl Kernel for Stream<'_, '_> {
    fn order(&self) -> &[u32] {
        self.tables.blocks.order
    }

    #[inline(always)]
    fn blocks<L: Lanes, S: Store>(&self, token: L::Token, blocks: Range<usize>, store: &mut S) {
        let zero = L::splat(token, 0.0);
        let wants_normals = store.wants_normals();
        let rest = &self.tables.blocks;
        for block in blocks {
            let (slots, start) = rest.slots(block);
            for first in (0..LANES).step_by(L::WIDTH) {
                let position = rest.position::<L>(token, block, first);
                let tangents = tangents(token, rest.normal::<L>(token, block, first));
                let mut sum = Moved {
                    position: [zero; 3],
                    along: [zero; 3],
                    across: [zero; 3],
                };
                let all = slots.binds.iter().zip(slots.weights);
                for (slot, (&part, weights)) in (start..).zip(all) {
                    let part = usize::from(part);
                    let mut moved = self.deform::<L>(token, part, position, tangents);
                    self.add_residual::<L>(token, part, &mut moved);
                    let weight = L::load_weights(token, weights, first);
                    let [du, dv] = self.tables.gradients.get(slot).unwrap_or(&NONE);
                    let (du, dv) = (L::load(token, du, first), L::load(token, dv, first));
                    for axis in 0..3 {
                        let at = moved.position[axis];
                        sum.position[axis] = sum.position[axis].add(weight.mul(at));
                        sum.along[axis] = sum.along[axis]
                            .add(weight.mul(moved.along[axis]))
                            .add(du.mul(at));
                        sum.across[axis] = sum.across[axis]
                            .add(weight.mul(moved.across[axis]))
                            .add(dv.mul(at));
                    }
                }
                store.positions(block, first, sum.position);
                if wants_normals {
                    let normal = cross(sum.along, sum.across);
                    store.normals(block, first, to_unit_length(token, normal));
                }
            }
        }
    }
}

static NONE: [[f32; LANES]; 2] = [[0.0; LANES]; 2];

impl Stream<'_, '_> {
    /// The quadratic transformation of a part, in world space.
    #[inline(always)]
    fn deform<L: Lanes>(
        &self,
        token: L::Token,
        part: usize,
        position: [L; 3],
        tangents: [[L; 3]; 2],
    ) -> Moved<L> {
        let zero = L::splat(token, 0.0);
        let two = L::splat(token, 2.0);
        let to_local = self.tables.to_local.get(part);
        let to_local = to_local.unwrap_or(&crate::math::IDENTITY);
        let mut local = [[zero; 3]; 3];
        for (axis, &[a, b, c, t]) in to_local.as_chunks::<4>().0.iter().enumerate().take(3) {
            let (a, b, c) = (L::splat(token, a), L::splat(token, b), L::splat(token, c));
            local[0][axis] = dot([a, b, c], position).add(L::splat(token, t));
            local[1][axis] = dot([a, b, c], tangents[0]);
            local[2][axis] = dot([a, b, c], tangents[1]);
        }
        let [[x, y, z], along, across] = local;
        let terms = [
            [x, y, z],
            [x.mul(x), y.mul(y), z.mul(z)],
            [x.mul(y), y.mul(z), z.mul(x)],
        ];
        let at = [x, y, z];
        let doubled = [two.mul(x), two.mul(y), two.mul(z)];
        let along = change(at, doubled, along);
        let across = change(at, doubled, across);
        let mut moved = Moved {
            position: [zero; 3],
            along: [zero; 3],
            across: [zero; 3],
        };
        let map = self.handles.maps.get(part).unwrap_or(&[0.0; 3 * COLUMNS]);
        let rows = map.as_chunks::<COLUMNS>().0.iter().enumerate().take(3);
        for (axis, &[a, b, c, d, e, f, g, h, i, constant]) in rows {
            let linear = [a, b, c];
            let (squares, products) = ([d, e, f], [g, h, i]);
            let of = [linear, squares, products];
            moved.position[axis] = product(token, of, &terms).add(L::splat(token, constant));
            moved.along[axis] = product(token, of, &along);
            moved.across[axis] = product(token, of, &across);
        }
        moved
    }

    /// The radial-basis residual of a part (equation 8) and its derivative.
    #[inline(always)]
    fn add_residual<L: Lanes>(&self, token: L::Token, part: usize, moved: &mut Moved<L>) {
        let zero = L::splat(token, 0.0);
        let (one, two, tiny) = (
            L::splat(token, 1.0),
            L::splat(token, 2.0),
            L::splat(token, 1e-20),
        );
        let (half, sixth) = (L::splat(token, 0.5), L::splat(token, 1.0 / 6.0));
        let four = L::splat(token, 4.0);
        let dilation = self.tables.dilations.get(part).copied().unwrap_or(0.0);
        let ball = Ball::around(moved.position, 2.0 / dilation);
        let dilation = L::splat(token, dilation);
        let [x, y, z] = moved.position;
        let mut shift = [zero; 3];
        let mut slope = [[zero; 3]; 3];
        let range = row(self.tables.member_starts, part);
        for &[cx, cy, cz, wx, wy, wz] in self.handles.members.get(range).unwrap_or_default() {
            // It would add zeros, so leaving it out changes no bit.
            if ball.is_beyond([cx, cy, cz]) {
                continue;
            }
            let dx = x.sub(L::splat(token, cx)).mul(dilation);
            let dy = y.sub(L::splat(token, cy)).mul(dilation);
            let dz = z.sub(L::splat(token, cz)).mul(dilation);
            let squared = dx.mul(dx).add(dy.mul(dy)).add(dz.mul(dz));
            let inverse = squared.add(tiny).rough_inverse_sqrt(token);
            let distance = squared.mul(inverse);
            let outer = positive(token, two.sub(distance));
            let inner = positive(token, one.sub(distance));
            let (outer2, inner2) = (outer.mul(outer), inner.mul(inner));
            let value = outer2
                .mul(outer)
                .sub(four.mul(inner2.mul(inner)))
                .mul(sixth);
            let change = two.mul(inner2).sub(half.mul(outer2));
            let change = change.mul(inverse).mul(dilation);
            let direction = [dx.mul(change), dy.mul(change), dz.mul(change)];
            let (wx, wy, wz) = (
                L::splat(token, wx),
                L::splat(token, wy),
                L::splat(token, wz),
            );
            shift = [
                shift[0].add(wx.mul(value)),
                shift[1].add(wy.mul(value)),
                shift[2].add(wz.mul(value)),
            ];
            slope = [
                add_scaled(slope[0], wx, direction),
                add_scaled(slope[1], wy, direction),
                add_scaled(slope[2], wz, direction),
            ];
        }
        for tangent in [&mut moved.along, &mut moved.across] {
            let before = *tangent;
            for (to, slope) in tangent.iter_mut().zip(slope) {
                *to = to.add(dot(slope, before));
            }
        }
        for (at, shift) in moved.position.iter_mut().zip(shift) {
            *at = at.add(shift);
        }
    }
}

/// What a centre must be in to reach one of some lanes.
struct Ball {
    middle: [f32; 3],
    radius2: f32,
}

impl Ball {
    #[inline(always)]
    fn around<L: Lanes>(position: [L; 3], reach: f32) -> Self {
        let mut lanes = [[0.0; LANES]; 3];
        let mut middle = [0.0; 3];
        for ((lanes, position), middle) in lanes.iter_mut().zip(position).zip(&mut middle) {
            position.put(lanes, 0);
            *middle = lanes.iter().take(L::WIDTH).sum::<f32>() * (1.0 / L::WIDTH as f32);
        }
        let ([mx, my, mz], [xs, ys, zs]) = (middle, lanes);
        let mut widest = 0.0_f32;
        for ((x, y), z) in xs.into_iter().zip(ys).zip(zs).take(L::WIDTH) {
            let (x, y, z) = (x - mx, y - my, z - mz);
            widest = widest.max(x * x + y * y + z * z);
        }
        // A thousandth more than exact numbers would need, for what rounding adds.
        let radius = 1.001 * (reach + widest * inverse_sqrt(widest + 1e-20));
        Self {
            middle,
            radius2: radius * radius,
        }
    }

    #[inline(always)]
    fn is_beyond(&self, [x, y, z]: [f32; 3]) -> bool {
        let [a, b, c] = self.middle;
        let (x, y, z) = (x - a, y - b, z - c);
        x * x + y * y + z * z > self.radius2
    }
}

#[inline(always)]
fn dot<L: Lanes>([a, b, c]: [L; 3], [x, y, z]: [L; 3]) -> L {
    a.mul(x).add(b.mul(y)).add(c.mul(z))
}

#[inline(always)]
fn add_scaled<L: Lanes>([a, b, c]: [L; 3], by: L, [x, y, z]: [L; 3]) -> [L; 3] {
    [a.add(by.mul(x)), b.add(by.mul(y)), c.add(by.mul(z))]
}

/// A row of a transformation times nine terms.
#[inline(always)]
fn product<L: Lanes>(token: L::Token, of: [[f32; 3]; 3], terms: &[[L; 3]; 3]) -> L {
    let [[a, b, c], [d, e, f], [g, h, i]] = of;
    let [[x, y, z], [xx, yy, zz], [xy, yz, zx]] = *terms;
    L::splat(token, a)
        .mul(x)
        .add(L::splat(token, b).mul(y))
        .add(L::splat(token, c).mul(z))
        .add(L::splat(token, d).mul(xx))
        .add(L::splat(token, e).mul(yy))
        .add(L::splat(token, f).mul(zz))
        .add(L::splat(token, g).mul(xy))
        .add(L::splat(token, h).mul(yz))
        .add(L::splat(token, i).mul(zx))
}

/// How the quadratic terms at a point change along a tangent.
#[inline(always)]
fn change<L: Lanes>([x, y, z]: [L; 3], [x2, y2, z2]: [L; 3], [a, b, c]: [L; 3]) -> [[L; 3]; 3] {
    [
        [a, b, c],
        [x2.mul(a), y2.mul(b), z2.mul(c)],
        [
            x.mul(b).add(y.mul(a)),
            y.mul(c).add(z.mul(b)),
            z.mul(a).add(x.mul(c)),
        ],
    ]
}

/// The value where it is positive, else zero.
#[inline(always)]
fn positive<L: Lanes>(token: L::Token, value: L) -> L {
    let magnitude = value.with_sign(L::splat(token, 1.0));
    value.add(magnitude).mul(L::splat(token, 0.5))
}
