//! One, four or eight vertices at a time, behind one set of operations.
//!
//! Kernels are written once against [`Lanes`]. Multiply and add stay separate everywhere.

use crate::asset::LANES;

/// The lanes of a block that one register holds.
pub(super) trait Lanes: Copy {
    /// Proof that the instructions exist.
    type Token: Copy;
    /// Lanes in a register; divides [`LANES`].
    const WIDTH: usize;

    fn splat(token: Self::Token, value: f32) -> Self;
    /// Lanes `first..first + WIDTH`; zero where `first` is out of range.
    fn load(token: Self::Token, from: &[f32; LANES], first: usize) -> Self;
    fn load_weights(token: Self::Token, from: &[u16; LANES], first: usize) -> Self;
    fn store(self, to: &mut [f32; LANES], first: usize);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// First guess of [`Self::inverse_sqrt`].
    fn inverse_sqrt_guess(self) -> Self;

    /// The same operations in the same order as [`crate::math::inverse_sqrt`].
    #[inline(always)]
    fn inverse_sqrt(self, token: Self::Token) -> Self {
        let half = Self::splat(token, 0.5).mul(self);
        let three_halves = Self::splat(token, 1.5);
        let mut y = self.inverse_sqrt_guess();
        for _ in 0..3 {
            y = y.mul(three_halves.sub(half.mul(y).mul(y)));
        }
        y
    }
}

impl Lanes for f32 {
    type Token = ();
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat((): (), value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn load((): (), from: &[f32; LANES], first: usize) -> Self {
        from.get(first).copied().unwrap_or(0.0)
    }
    #[inline(always)]
    fn load_weights((): (), from: &[u16; LANES], first: usize) -> Self {
        from.get(first).map_or(0.0, |&weight| f32::from(weight))
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; LANES], first: usize) {
        if let Some(to) = to.get_mut(first) {
            *to = self;
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn inverse_sqrt_guess(self) -> Self {
        f32::from_bits(0x5f37_5a86_u32.wrapping_sub(self.to_bits() >> 1))
    }
}

#[cfg(feature = "simd")]
macro_rules! simd_lanes {
    ($vector:ident, $bits:ident, $width:literal) => {
        impl<S: fearless_simd::Simd> Lanes for fearless_simd::$vector<S> {
            type Token = S;
            const WIDTH: usize = $width;

            #[inline(always)]
            fn splat(token: S, value: f32) -> Self {
                fearless_simd::SimdBase::splat(token, value)
            }
            #[inline(always)]
            fn load(token: S, from: &[f32; LANES], first: usize) -> Self {
                let part = from.as_chunks::<$width>().0.get(first / $width);
                fearless_simd::SimdFrom::simd_from(token, *part.unwrap_or(&[0.0; $width]))
            }
            #[inline(always)]
            fn load_weights(token: S, from: &[u16; LANES], first: usize) -> Self {
                let part = from.as_chunks::<$width>().0.get(first / $width);
                // Small enough for a signed conversion, which every instruction set has.
                let part = part.unwrap_or(&[0; $width]).map(i32::from);
                let part: fearless_simd::$bits<S> = fearless_simd::SimdFrom::simd_from(token, part);
                fearless_simd::SimdInt::to_float(part)
            }
            #[inline(always)]
            fn store(self, to: &mut [f32; LANES], first: usize) {
                if let Some(to) = to.as_chunks_mut::<$width>().0.get_mut(first / $width) {
                    *to = self.into();
                }
            }
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                self + other
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                self - other
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                self * other
            }
            #[inline(always)]
            fn inverse_sqrt_guess(self) -> Self {
                let bits = fearless_simd::SimdFloat::to_bits(self) >> 1;
                fearless_simd::SimdFloat::from_bits(0x5f37_5a86_u32 - bits)
            }
        }
    };
}

#[cfg(feature = "simd")]
simd_lanes!(f32x4, i32x4, 4);
#[cfg(feature = "simd")]
simd_lanes!(f32x8, i32x8, 8);
