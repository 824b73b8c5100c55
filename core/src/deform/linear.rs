//! Linear blend skinning (Mažrimas & Beinaravičius, section 2).

use super::lanes::Lanes;
use super::skin::{Blend, Slots};
use crate::math::{Affine12, IDENTITY};

/// The weighted sum of the binds' matrices.
pub(super) struct Linear<'p> {
    /// `[binds]`
    pub palette: &'p [Affine12],
}

impl Blend for Linear<'_> {
    #[inline(always)]
    fn rigid(&self, bind: u16) -> &Affine12 {
        self.palette.get(usize::from(bind)).unwrap_or(&IDENTITY)
    }

    #[inline(always)]
    fn matrix<L: Lanes>(&self, token: L::Token, slots: &Slots<'_>, first: usize) -> [L; 12] {
        let mut sum = [L::splat(token, 0.0); 12];
        let mut slots = slots.binds.iter().zip(slots.weights);
        if let Some((&bind, weights)) = slots.next() {
            let weight = L::load_weights(token, weights, first);
            for (sum, &value) in sum.iter_mut().zip(self.rigid(bind)) {
                *sum = L::splat(token, value).mul(weight);
            }
        }
        for (&bind, weights) in slots {
            if L::weightless(weights, first) {
                continue;
            }
            let weight = L::load_weights(token, weights, first);
            for (sum, &value) in sum.iter_mut().zip(self.rigid(bind)) {
                *sum = sum.add(L::splat(token, value).mul(weight));
            }
        }
        sum
    }
}
