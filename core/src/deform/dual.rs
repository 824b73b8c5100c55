//! Dual quaternions (Kavan et al. 2008) and optimised centres of rotation (Le & Hodgins 2016).
//!
//! A bind's matrix is taken apart as rotation after stretch. Stretches are blended linearly, then
//! the blended rotation acts: a joint that only scales moves its vertices as in linear blending.

use super::lanes::Lanes;
use super::skin::{Blend, Slots};
use crate::math::{Affine12, IDENTITY};
use crate::pose::Dual17;

/// Blends rotation and translation as dual quaternions.
#[derive(Clone, Copy)]
pub(super) struct DualQuaternion<'p> {
    /// `[binds]`
    pub palette: &'p [Affine12],
    /// `[binds]`
    pub duals: &'p [Dual17],
    /// Whether some bind has a stretch.
    pub stretched: bool,
}

/// Blends rotations about centres that move with the linear blend.
#[derive(Clone, Copy)]
pub(super) struct Centres<'p>(pub DualQuaternion<'p>);

/// No rotation, no translation, no stretch.
const REST: Dual17 = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0,
];

impl DualQuaternion<'_> {
    #[inline(always)]
    fn dual(&self, bind: u16) -> &Dual17 {
        self.duals.get(usize::from(bind)).unwrap_or(&REST)
    }

    /// Weighted sums: the first `N` numbers of the dual quaternions, of two opposite ones each the
    /// one nearer to the sum so far; and the numbers of the stretches.
    #[inline(always)]
    fn sums<L: Lanes, const N: usize>(
        &self,
        token: L::Token,
        slots: &Slots<'_>,
        first: usize,
    ) -> ([L; N], [L; 9]) {
        let zero = L::splat(token, 0.0);
        let (mut motion, mut stretch) = ([zero; N], [zero; 9]);
        for (at, (&bind, weights)) in slots.binds.iter().zip(slots.weights).enumerate() {
            if L::weightless(weights, first) {
                continue;
            }
            let dual = self.dual(bind);
            let weight = L::load_weights(token, weights, first);
            let mut signed = weight;
            if at > 0 {
                let mut near = zero;
                for (&sum, &value) in motion.iter().zip(dual).take(4) {
                    near = near.add(sum.mul(L::splat(token, value)));
                }
                signed = weight.with_sign(near);
            }
            for (sum, &value) in motion.iter_mut().zip(dual) {
                *sum = sum.add(L::splat(token, value).mul(signed));
            }
            if self.stretched {
                for (sum, &value) in stretch.iter_mut().zip(dual.iter().skip(8)) {
                    *sum = sum.add(L::splat(token, value).mul(weight));
                }
            }
        }
        (motion, stretch)
    }

    /// The rotation of a quaternion of any length, after the stretch; rows of three.
    #[inline(always)]
    fn turned<L: Lanes>(
        &self,
        token: L::Token,
        [x, y, z, w]: [L; 4],
        two_by_length2: L,
        stretch: &[L; 9],
    ) -> [L; 9] {
        let one = L::splat(token, 1.0);
        let [xs, ys, zs] = [
            x.mul(two_by_length2),
            y.mul(two_by_length2),
            z.mul(two_by_length2),
        ];
        let (xx, yy, zz) = (x.mul(xs), y.mul(ys), z.mul(zs));
        let (xy, xz, yz) = (x.mul(ys), x.mul(zs), y.mul(zs));
        let (wx, wy, wz) = (w.mul(xs), w.mul(ys), w.mul(zs));
        let rotation = [
            one.sub(yy.add(zz)),
            xy.sub(wz),
            xz.add(wy),
            xy.add(wz),
            one.sub(xx.add(zz)),
            yz.sub(wx),
            xz.sub(wy),
            yz.add(wx),
            one.sub(xx.add(yy)),
        ];
        if !self.stretched {
            return rotation;
        }
        let mut product = rotation;
        for (row, turn) in product
            .as_chunks_mut::<3>()
            .0
            .iter_mut()
            .zip(rotation.as_chunks::<3>().0)
        {
            for (column, to) in row.iter_mut().enumerate() {
                *to = turn[0].mul(stretch[column]);
                *to = to.add(turn[1].mul(stretch[column + 3]));
                *to = to.add(turn[2].mul(stretch[column + 6]));
            }
        }
        product
    }
}

/// `2 / |q|^2`. The sum is never near zero: no part of it points away from the rest.
#[inline(always)]
fn two_by_length2<L: Lanes>(token: L::Token, [x, y, z, w]: [L; 4]) -> L {
    let length2 = x.mul(x).add(y.mul(y)).add(z.mul(z)).add(w.mul(w));
    L::splat(token, 2.0).div(length2)
}

impl Blend for DualQuaternion<'_> {
    #[inline(always)]
    fn rigid(&self, bind: u16) -> &Affine12 {
        self.palette.get(usize::from(bind)).unwrap_or(&IDENTITY)
    }

    #[inline(always)]
    fn matrix<L: Lanes>(&self, token: L::Token, slots: &Slots<'_>, first: usize) -> [L; 12] {
        let ([x, y, z, w, ex, ey, ez, ew], stretch) = self.sums::<L, 8>(token, slots, first);
        let factor = two_by_length2(token, [x, y, z, w]);
        let [m00, m01, m02, m10, m11, m12, m20, m21, m22] =
            self.turned(token, [x, y, z, w], factor, &stretch);
        // 2 (w e - e_w v + v x e)
        let tx = w.mul(ex).sub(ew.mul(x)).add(y.mul(ez).sub(z.mul(ey)));
        let ty = w.mul(ey).sub(ew.mul(y)).add(z.mul(ex).sub(x.mul(ez)));
        let tz = w.mul(ez).sub(ew.mul(z)).add(x.mul(ey).sub(y.mul(ex)));
        let [tx, ty, tz] = [tx.mul(factor), ty.mul(factor), tz.mul(factor)];
        [m00, m01, m02, tx, m10, m11, m12, ty, m20, m21, m22, tz]
    }
}

impl Blend for Centres<'_> {
    #[inline(always)]
    fn rigid(&self, bind: u16) -> &Affine12 {
        self.0.rigid(bind)
    }

    #[inline(always)]
    fn matrix<L: Lanes>(&self, token: L::Token, slots: &Slots<'_>, first: usize) -> [L; 12] {
        let (rotation, stretch) = self.0.sums::<L, 4>(token, slots, first);
        let factor = two_by_length2(token, rotation);
        let turned = self.0.turned(token, rotation, factor, &stretch);
        let linear = super::linear::Linear {
            palette: self.0.palette,
        };
        // Where the centre goes, less where the rotation alone would take it.
        let mut moved = linear.matrix::<L>(token, slots, first);
        let centre = L::load3(token, slots.centre, first);
        for (row, turned) in moved
            .as_chunks_mut::<4>()
            .0
            .iter_mut()
            .zip(turned.as_chunks::<3>().0)
        {
            for (column, &coordinate) in centre.iter().enumerate() {
                let difference = row[column].sub(turned[column]);
                row[3] = row[3].add(difference.mul(coordinate));
                row[column] = turned[column];
            }
        }
        moved
    }
}
