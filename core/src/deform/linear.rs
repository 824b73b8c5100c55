//! Linear blend skinning (Mažrimas & Beinaravičius, section 2).

use super::lanes::Lanes;
use super::skin::{Blend, Slots};
use crate::math::{Affine12, IDENTITY};

/// A bind beyond the palette counts as weightless.
const NOTHING: Affine12 = [0.0; 12];

/// The weighted sum of the binds' matrices.
#[derive(Clone, Copy)]
pub(super) struct Linear<'p> {
    /// `[binds]`
    pub palette: &'p [Affine12],
}

impl Blend for Linear<'_> {
    const IS_COMMON: bool = true;

    #[inline(always)]
    fn rigid(&self, bind: u16) -> &Affine12 {
        self.palette.get(usize::from(bind)).unwrap_or(&IDENTITY)
    }

    #[inline(always)]
    fn matrix<L: Lanes>(&self, token: L::Token, slots: &Slots<'_>, first: usize) -> [L; 12] {
        let mut sum = [L::splat(token, 0.0); 12];
        let mut slots = slots.binds.iter().zip(slots.weights);
        if let Some((&bind, weights)) = slots.next() {
            let matrix = self.palette.get(usize::from(bind)).unwrap_or(&NOTHING);
            let weight = L::load_weights(token, weights, first);
            for (sum, &value) in sum.iter_mut().zip(matrix) {
                *sum = L::splat(token, value).mul(weight);
            }
        }
        for (&bind, weights) in slots {
            if L::weightless(weights, first) {
                continue;
            }
            if let Some(matrix) = self.palette.get(usize::from(bind)) {
                let weight = L::load_weights(token, weights, first);
                for (sum, &value) in sum.iter_mut().zip(matrix) {
                    *sum = sum.add(L::splat(token, value).mul(weight));
                }
            }
        }
        sum
    }
}
