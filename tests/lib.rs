//! Helpers that several whole-program tests share.
//!
//! Recordings that the project does not ship lie in `../shared/data` beside the checkout. A test
//! that needs one calls [`shared`]; where the folder is absent the test says so and passes as
//! skipped.

pub mod bare;
pub mod body;
pub mod budgets;
pub mod cases;
pub mod cut;
pub mod dense;
pub mod driven;
pub mod filming;
pub mod gltf_oracle;
pub mod hidden;
pub mod human;
pub mod laplacian;
pub mod limb;
pub mod live;
pub mod marker_film;
pub mod storm;
pub mod tiny;

use std::path::{Path, PathBuf};

/// The project's root folder.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Path of a recording in `../shared/data`, or `None` (after saying so) where it is absent.
#[must_use]
pub fn shared(relative: &str) -> Option<PathBuf> {
    let path = root().join("../shared/data").join(relative);
    if path.exists() {
        return Some(path);
    }
    skip(&format!("../shared/data/{relative}"));
    None
}

/// Says that a test is skipped for want of something, past the test runner's capture of output, so
/// that skipped tests can be counted.
pub fn skip(needs: &str) {
    use std::io::Write;
    // Nobody can be told that nobody can be told.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: needs {needs}, which is not here"
    );
}

/// A small deterministic generator (`SplitMix64`) for seeded tests.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Below `limit`, which is not 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.bits() % limit as u64) as usize
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The programs in the README must compile and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
