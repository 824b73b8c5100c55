//! Linear blend skinning (Mažrimas & Beinaravičius, section 2).

use super::lanes::Lanes;
use super::skin::{Blend, Slots};
use crate::asset::WEIGHT_ONE;
use crate::math::{Affine12, IDENTITY};

/// The weighted sum of the binds' matrices.
pub(super) struct Linear<'p> {
    /// `[binds]`
    pub palette: &'p [Affine12],
}

impl Linear<'_> {
    #[inline(always)]
    fn row(&self, bind: u16) -> &Affine12 {
        self.palette.get(usize::from(bind)).unwrap_or(&IDENTITY)
    }
}

impl Blend for Linear<'_> {
    #[inline(always)]
    fn matrix<L: Lanes>(&self, token: L::Token, slots: Slots<'_>, first: usize) -> [L; 12] {
        let mut sum = [L::splat(token, 0.0); 12];
        let ([bind, binds @ ..], [weights, more_weights @ ..]) = (slots.binds, slots.weights)
        else {
            return sum;
        };
        if binds.is_empty() {
            // One bind: its weight is one.
            for (sum, &value) in sum.iter_mut().zip(self.row(*bind)) {
                *sum = L::splat(token, value);
            }
            return sum;
        }
        // A power of two, so scaling the weights rounds nothing.
        let unit = L::splat(token, 1.0 / WEIGHT_ONE as f32);
        let weight = L::load_weights(token, weights, first).mul(unit);
        for (sum, &value) in sum.iter_mut().zip(self.row(*bind)) {
            *sum = L::splat(token, value).mul(weight);
        }
        for (&bind, weights) in binds.iter().zip(more_weights) {
            let weight = L::load_weights(token, weights, first).mul(unit);
            for (sum, &value) in sum.iter_mut().zip(self.row(bind)) {
                *sum = sum.add(L::splat(token, value).mul(weight));
            }
        }
        sum
    }
}
