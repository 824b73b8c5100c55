//! One, two, four or eight vertices at a time, behind one set of operations.
//!
//! Kernels are written once against [`Lanes`]. Multiply and add stay separate everywhere.

use super::rest::{RestShape, Room};
use crate::asset::{LANES, Lanes3, WEIGHT_ONE};
use crate::math::{ROUGH_FACTORS, ROUGH_GUESS};

/// A weight of one in the asset, so that weights become parts of one.
const WEIGHT_UNIT: f32 = 1.0 / WEIGHT_ONE as f32;

/// The lanes of a block that one register holds.
pub(super) trait Lanes: Copy {
    /// Proof that the instructions exist.
    type Token: Copy;
    /// What a register holds once sums are complete: fewer lanes where registers are scarce.
    type Part: Lanes<Token = Self::Token>;
    /// x, y, z of each lane.
    type Rows: AsRef<[[f32; 3]]>;
    /// Lanes in a register; divides [`LANES`].
    const WIDTH: usize;

    fn splat(token: Self::Token, value: f32) -> Self;
    /// Lanes `first..first + WIDTH`; zero where `first` is out of range.
    fn load(token: Self::Token, from: &[f32; LANES], first: usize) -> Self;
    /// x, y and z of these lanes.
    #[inline(always)]
    fn load3(token: Self::Token, from: &Lanes3, first: usize) -> [Self; 3] {
        let [x, y, z] = from;
        [
            Self::load(token, x, first),
            Self::load(token, y, first),
            Self::load(token, z, first),
        ]
    }
    /// Parts of one, each rounded once.
    fn load_weights(token: Self::Token, from: &[u16; LANES], first: usize) -> Self;
    /// Whole numbers, exact.
    fn load_unsigned(token: Self::Token, from: &[u16; LANES], first: usize) -> Self;
    /// Whole numbers, exact.
    fn load_signed(token: Self::Token, from: &[i16; LANES], first: usize) -> Self;
    /// Whether lanes `first..first + WIDTH` are known to weigh nothing. Only asked where a branch
    /// costs less than the sums that it saves.
    #[inline(always)]
    fn weightless(_from: &[u16; LANES], _first: usize) -> bool {
        false
    }
    /// Writes lanes `first..first + WIDTH`.
    fn put(self, to: &mut [f32; LANES], first: usize);
    /// Some of the lanes, from lane `first` of this register on.
    fn part(self, first: usize) -> Self::Part;
    /// Vertices instead of axes.
    fn rows(xyz: [Self; 3]) -> Self::Rows;
    /// Writes vertices `first..first + WIDTH` of a block, nothing between them.
    #[cfg(feature = "simd")]
    fn store_rows(xyz: [Self; 3], to: &mut [f32; 3 * LANES], first: usize);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// The larger; either where they are equal, so the sign of a zero is not known.
    fn larger(self, other: Self) -> Self;
    /// The smaller, likewise.
    fn smaller(self, other: Self) -> Self;
    /// The magnitude.
    fn magnitude(self) -> Self;
    /// The magnitude of `self` with the sign of `of`.
    fn with_sign(self, of: Self) -> Self;
    /// First guess of [`Self::rough_inverse_sqrt`].
    fn inverse_sqrt_guess(self) -> Self;

    /// Unpacks a block and adds morph targets. Without vectors it is a function of its own: inside
    /// the kernel it would leave no register free.
    #[inline(always)]
    fn put_together(token: Self::Token, shape: &RestShape<'_, '_>, block: usize, room: &mut Room) {
        shape.put_together::<Self>(token, block, room);
    }

    /// The same operations in the same order as [`crate::math::rough_inverse_sqrt`].
    #[inline(always)]
    fn rough_inverse_sqrt(self, token: Self::Token) -> Self {
        let half = Self::splat(token, 0.5).mul(self);
        let mut y = self.inverse_sqrt_guess();
        for factor in ROUGH_FACTORS {
            let cubed = half.mul(y).mul(y.mul(y));
            y = Self::splat(token, factor).mul(y).sub(cubed);
        }
        y
    }
}

impl Lanes for f32 {
    type Token = ();
    type Part = Self;
    type Rows = [[f32; 3]; 1];
    const WIDTH: usize = 1;

    #[inline(always)]
    fn splat((): (), value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn load((): (), from: &[f32; LANES], first: usize) -> Self {
        from.get(first).copied().unwrap_or(0.0)
    }
    /// By one address.
    #[inline(always)]
    fn load3((): (), from: &Lanes3, first: usize) -> [Self; 3] {
        let from = from.as_flattened().get(first..);
        match from {
            Some([x, _, _, _, _, _, _, _, y, _, _, _, _, _, _, _, z, ..]) => [*x, *y, *z],
            _ => [0.0; 3],
        }
    }
    #[inline(always)]
    fn load_weights((): (), from: &[u16; LANES], first: usize) -> Self {
        from.get(first)
            .map_or(0.0, |&weight| f32::from(weight) * WEIGHT_UNIT)
    }
    #[inline(always)]
    fn load_unsigned((): (), from: &[u16; LANES], first: usize) -> Self {
        from.get(first).map_or(0.0, |&number| f32::from(number))
    }
    #[inline(always)]
    fn load_signed((): (), from: &[i16; LANES], first: usize) -> Self {
        from.get(first).map_or(0.0, |&number| f32::from(number))
    }
    #[inline(always)]
    fn weightless(from: &[u16; LANES], first: usize) -> bool {
        from.get(first) == Some(&0)
    }
    #[inline(always)]
    fn put(self, to: &mut [f32; LANES], first: usize) {
        if let Some(to) = to.get_mut(first) {
            *to = self;
        }
    }
    #[inline(always)]
    fn part(self, _: usize) -> Self {
        self
    }
    #[inline(always)]
    fn rows(xyz: [Self; 3]) -> Self::Rows {
        [xyz]
    }
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn store_rows(xyz: [Self; 3], to: &mut [f32; 3 * LANES], first: usize) {
        if let Some(to) = to.as_chunks_mut::<3>().0.get_mut(first) {
            *to = xyz;
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
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        self.min(other)
    }
    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn with_sign(self, of: Self) -> Self {
        self.copysign(of)
    }
    #[inline(always)]
    fn inverse_sqrt_guess(self) -> Self {
        f32::from_bits(ROUGH_GUESS.wrapping_sub(self.to_bits() >> 1))
    }
    #[inline(never)]
    fn put_together((): (), shape: &RestShape<'_, '_>, block: usize, room: &mut Room) {
        shape.put_together::<f32>((), block, room);
    }
}

/// Two vertices without vector instructions: a matrix is fetched once for both, and their sums
/// just fit the 32 registers of a Cortex-M. What follows the sums would not, so it is done singly.
impl Lanes for [f32; 2] {
    type Token = ();
    type Part = f32;
    type Rows = [[f32; 3]; 2];
    const WIDTH: usize = 2;

    #[inline(always)]
    fn splat((): (), value: f32) -> Self {
        [value; 2]
    }
    #[inline(always)]
    fn load((): (), from: &[f32; LANES], first: usize) -> Self {
        let pairs = from.as_chunks().0;
        pairs.get(first / 2).copied().unwrap_or_default()
    }
    #[inline(always)]
    fn load_weights((): (), from: &[u16; LANES], first: usize) -> Self {
        let pairs = from.as_chunks().0;
        let [a, b]: [u16; 2] = pairs.get(first / 2).copied().unwrap_or_default();
        [f32::from(a) * WEIGHT_UNIT, f32::from(b) * WEIGHT_UNIT]
    }
    #[inline(always)]
    fn load_unsigned((): (), from: &[u16; LANES], first: usize) -> Self {
        let pairs = from.as_chunks().0;
        let pair: [u16; 2] = pairs.get(first / 2).copied().unwrap_or_default();
        pair.map(f32::from)
    }
    #[inline(always)]
    fn load_signed((): (), from: &[i16; LANES], first: usize) -> Self {
        let pairs = from.as_chunks().0;
        let pair: [i16; 2] = pairs.get(first / 2).copied().unwrap_or_default();
        pair.map(f32::from)
    }
    #[inline(always)]
    fn weightless(from: &[u16; LANES], first: usize) -> bool {
        from.as_chunks().0.get(first / 2) == Some(&[0, 0])
    }
    #[inline(always)]
    fn put(self, to: &mut [f32; LANES], first: usize) {
        if let Some(to) = to.as_chunks_mut().0.get_mut(first / 2) {
            *to = self;
        }
    }
    #[inline(always)]
    fn part(self, first: usize) -> f32 {
        let [a, b] = self;
        if first == 0 { a } else { b }
    }
    #[inline(always)]
    fn rows([[ax, bx], [ay, by], [az, bz]]: [Self; 3]) -> Self::Rows {
        [[ax, ay, az], [bx, by, bz]]
    }
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn store_rows(xyz: [Self; 3], to: &mut [f32; 3 * LANES], first: usize) {
        if let Some(to) = to.as_chunks_mut::<6>().0.get_mut(first / 2) {
            to.copy_from_slice(Self::rows(xyz).as_flattened());
        }
    }
    #[inline(always)]
    fn add(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a + c, b + d]
    }
    #[inline(always)]
    fn sub(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a - c, b - d]
    }
    #[inline(always)]
    fn mul(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a * c, b * d]
    }
    #[inline(always)]
    fn div(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a / c, b / d]
    }
    #[inline(always)]
    fn larger(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a.max(c), b.max(d)]
    }
    #[inline(always)]
    fn smaller(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a.min(c), b.min(d)]
    }
    #[inline(always)]
    fn magnitude(self) -> Self {
        let [a, b] = self;
        [a.abs(), b.abs()]
    }
    #[inline(always)]
    fn with_sign(self, [c, d]: Self) -> Self {
        let [a, b] = self;
        [a.copysign(c), b.copysign(d)]
    }
    #[inline(always)]
    fn inverse_sqrt_guess(self) -> Self {
        let [a, b] = self;
        [a.inverse_sqrt_guess(), b.inverse_sqrt_guess()]
    }
    #[inline(always)]
    fn put_together((): (), shape: &RestShape<'_, '_>, block: usize, room: &mut Room) {
        f32::put_together((), shape, block, room);
    }
}

#[cfg(feature = "simd")]
macro_rules! simd_lanes {
    ($vector:ident, $bits:ident, $width:literal, $transpose:path, $($lane:literal)*) => {
        impl<S: fearless_simd::Simd> Lanes for fearless_simd::$vector<S> {
            type Token = S;
            type Part = Self;
            type Rows = [[f32; 3]; $width];
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
                let weights = <Self as Lanes>::load_unsigned(token, from, first);
                weights * <Self as Lanes>::splat(token, WEIGHT_UNIT)
            }
            #[inline(always)]
            fn load_unsigned(token: S, from: &[u16; LANES], first: usize) -> Self {
                let part = from.as_chunks::<$width>().0.get(first / $width);
                // Small enough for a signed conversion, which every instruction set has.
                let part = part.unwrap_or(&[0; $width]).map(i32::from);
                let part: fearless_simd::$bits<S> = fearless_simd::SimdFrom::simd_from(token, part);
                fearless_simd::SimdInt::to_float(part)
            }
            #[inline(always)]
            fn load_signed(token: S, from: &[i16; LANES], first: usize) -> Self {
                let part = from.as_chunks::<$width>().0.get(first / $width);
                let part = part.unwrap_or(&[0; $width]).map(i32::from);
                let part: fearless_simd::$bits<S> = fearless_simd::SimdFrom::simd_from(token, part);
                fearless_simd::SimdInt::to_float(part)
            }
            #[inline(always)]
            fn put(self, to: &mut [f32; LANES], first: usize) {
                if let Some(to) = to.as_chunks_mut::<$width>().0.get_mut(first / $width) {
                    *to = self.into();
                }
            }
            #[inline(always)]
            fn part(self, _: usize) -> Self {
                self
            }
            #[inline(always)]
            fn rows([x, y, z]: [Self; 3]) -> Self::Rows {
                let (x, y, z): ([f32; $width], [f32; $width], [f32; $width]) =
                    (x.into(), y.into(), z.into());
                // Fixed indices become shuffles of registers.
                [$([x[$lane], y[$lane], z[$lane]]),*]
            }
            #[inline(always)]
            fn store_rows(xyz: [Self; 3], to: &mut [f32; 3 * LANES], first: usize) {
                let token = fearless_simd::ExtractToken::token(&xyz[0]);
                let to = to.as_chunks_mut::<{ 3 * $width }>().0;
                if let Some(to) = to.get_mut(first / $width) {
                    let rows = $transpose(token, xyz);
                    for (to, row) in to.as_chunks_mut::<$width>().0.iter_mut().zip(rows) {
                        *to = row.into();
                    }
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
            fn div(self, other: Self) -> Self {
                self / other
            }
            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                fearless_simd::SimdBase::max(self, other)
            }
            #[inline(always)]
            fn smaller(self, other: Self) -> Self {
                fearless_simd::SimdBase::min(self, other)
            }
            #[inline(always)]
            fn magnitude(self) -> Self {
                fearless_simd::SimdBase::abs(self)
            }
            #[inline(always)]
            fn with_sign(self, of: Self) -> Self {
                fearless_simd::SimdFloat::copysign(self, of)
            }
            #[inline(always)]
            fn inverse_sqrt_guess(self) -> Self {
                let bits = fearless_simd::SimdFloat::to_bits(self) >> 1;
                fearless_simd::SimdFloat::from_bits(ROUGH_GUESS - bits)
            }
        }
    };
}

#[cfg(feature = "simd")]
simd_lanes!(f32x4, i32x4, 4, super::transpose::four, 0 1 2 3);
#[cfg(feature = "simd")]
simd_lanes!(f32x8, i32x8, 8, super::transpose::eight, 0 1 2 3 4 5 6 7);
