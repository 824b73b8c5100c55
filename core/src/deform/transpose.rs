//! Registers of x, y and z into registers of vertices, without a detour through memory.

use fearless_simd::{Simd, SimdFrom, f32x4, f32x8};

/// `[x0 y0 z0 x1] [y1 z1 x2 y2] [z2 x3 y3 z3]`
#[inline(always)]
pub(super) fn four<S: Simd>(simd: S, [x, y, z]: [f32x4<S>; 3]) -> [f32x4<S>; 3] {
    let (x, y, z): ([f32; 4], [f32; 4], [f32; 4]) = (x.into(), y.into(), z.into());
    // Fixed indices become shuffles.
    [
        f32x4::simd_from(simd, [x[0], y[0], z[0], x[1]]),
        f32x4::simd_from(simd, [y[1], z[1], x[2], y[2]]),
        f32x4::simd_from(simd, [z[2], x[3], y[3], z[3]]),
    ]
}

/// `[x0 y0 z0 x1 y1 z1 x2 y2] [z2 x3 y3 z3 x4 y4 z4 x5] [y5 z5 x6 y6 z6 x7 y7 z7]`
#[inline(always)]
pub(super) fn eight<S: Simd>(simd: S, [x, y, z]: [f32x8<S>; 3]) -> [f32x8<S>; 3] {
    let (x, y, z): ([f32; 8], [f32; 8], [f32; 8]) = (x.into(), y.into(), z.into());
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    if let fearless_simd::Level::Avx2(avx2) = simd.level() {
        let [a, b, c] = eight_avx2(
            avx2,
            f32x8::simd_from(avx2, x),
            f32x8::simd_from(avx2, y),
            f32x8::simd_from(avx2, z),
        );
        let (a, b, c): ([f32; 8], [f32; 8], [f32; 8]) = (a.into(), b.into(), c.into());
        return [
            f32x8::simd_from(simd, a),
            f32x8::simd_from(simd, b),
            f32x8::simd_from(simd, c),
        ];
    }
    [
        f32x8::simd_from(simd, [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2]]),
        f32x8::simd_from(simd, [z[2], x[3], y[3], z[3], x[4], y[4], z[4], x[5]]),
        f32x8::simd_from(simd, [y[5], z[5], x[6], y[6], z[6], x[7], y[7], z[7]]),
    ]
}

#[cfg(target_arch = "x86")]
use core::arch::x86::*;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use fearless_simd::Avx2;

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fearless_simd::kernel!(
    /// Left to itself, the compiler takes half as many instructions again, slow ones among them.
    #[inline(always)]
    fn eight_avx2(token: Avx2, x: f32x8<Avx2>, y: f32x8<Avx2>, z: f32x8<Avx2>) -> [f32x8<Avx2>; 3] {
        let (x, y, z): (__m256, __m256, __m256) = (x.into(), y.into(), z.into());
        // In each half: x0 y0 x2 y2, y1 z1 y3 z3, z0 x1 z2 x3; then pairs of them.
        let xy = _mm256_castps_pd(_mm256_blend_ps::<0xAA>(x, _mm256_moveldup_ps(y)));
        let yz = _mm256_castps_pd(_mm256_blend_ps::<0xAA>(_mm256_movehdup_ps(y), z));
        let zx = _mm256_castps_pd(_mm256_blend_ps::<0xAA>(z, x));
        let first = _mm256_castpd_ps(_mm256_unpacklo_pd(xy, zx));
        let middle = _mm256_castpd_ps(_mm256_shuffle_pd::<0b1010>(yz, xy));
        let last = _mm256_castpd_ps(_mm256_unpackhi_pd(zx, yz));
        [
            SimdFrom::simd_from(token, _mm256_permute2f128_ps::<0x20>(first, middle)),
            SimdFrom::simd_from(token, _mm256_permute2f128_ps::<0x30>(last, first)),
            SimdFrom::simd_from(token, _mm256_permute2f128_ps::<0x31>(middle, last)),
        ]
    }
);
