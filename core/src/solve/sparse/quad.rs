//! Four right-hand sides of a row, in a register or in an array.

/// Multiply and add stay separate, so both kinds give the same bits.
pub(super) trait Quad: Copy {
    /// Proof that the instructions exist.
    type Token: Copy;

    fn load(token: Self::Token, from: [f32; 4]) -> Self;
    fn to_array(self) -> [f32; 4];
    fn add(self, other: Self) -> Self;
    /// `self - factor * other`.
    fn less(self, factor: f32, other: Self) -> Self;
    fn scale(self, factor: f32) -> Self;
    fn sub(self, other: Self) -> Self;
}

impl Quad for [f32; 4] {
    type Token = ();

    #[inline(always)]
    fn load((): (), from: [f32; 4]) -> Self {
        from
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 4] {
        self
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self, other);
        [a + e, b + f, c + g, d + h]
    }
    #[inline(always)]
    fn less(self, factor: f32, other: Self) -> Self {
        self.sub(other.scale(factor))
    }
    #[inline(always)]
    fn scale(self, factor: f32) -> Self {
        self.map(|value| value * factor)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self, other);
        [a - e, b - f, c - g, d - h]
    }
}

#[cfg(feature = "simd")]
impl<S: fearless_simd::Simd> Quad for fearless_simd::f32x4<S> {
    type Token = S;

    #[inline(always)]
    fn load(token: S, from: [f32; 4]) -> Self {
        fearless_simd::SimdFrom::simd_from(token, from)
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 4] {
        self.into()
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn less(self, factor: f32, other: Self) -> Self {
        self - other * factor
    }
    #[inline(always)]
    fn scale(self, factor: f32) -> Self {
        self * factor
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
}
