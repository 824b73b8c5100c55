//! Which instructions the kernels use.

/// Instruction set of the kernels. The output's bits do not depend on it.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Level {
    /// One vertex at a time.
    Scalar,
    /// Four or eight vertices at a time.
    #[cfg(feature = "simd")]
    Simd(fearless_simd::Level),
}

impl Level {
    /// The best this program can use: detected at run time with the feature `std`, else what the
    /// target is known to have, else scalar.
    #[must_use]
    pub fn best() -> Self {
        #[cfg(all(feature = "simd", feature = "std"))]
        let level = Self::Simd(fearless_simd::Level::new());
        #[cfg(all(feature = "simd", not(feature = "std")))]
        let level = Self::Simd(fearless_simd::Level::baseline());
        #[cfg(not(feature = "simd"))]
        let level = Self::Scalar;
        match level {
            // A fallback level would emulate vectors; one vertex at a time is faster.
            #[cfg(feature = "simd")]
            Self::Simd(level) if level.is_fallback() => Self::Scalar,
            // Where AVX-512 is, AVX2 was faster in every skinning benchmark.
            #[cfg(all(feature = "simd", any(target_arch = "x86", target_arch = "x86_64")))]
            Self::Simd(level) => {
                Self::Simd(level.as_avx2().map_or(level, fearless_simd::Level::Avx2))
            }
            level => level,
        }
    }
}

impl Default for Level {
    fn default() -> Self {
        Self::best()
    }
}
