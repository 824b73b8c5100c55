//! Helpers that several whole-program tests share.
//!
//! Recordings that the project does not ship lie in `../shared/data` beside the checkout. A test
//! that needs one calls [`shared`]; where the folder is absent the test says so and passes as
//! skipped.

pub mod gltf_oracle;

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
    eprintln!("SKIPPED: needs ../shared/data/{relative}, which is not here");
    None
}
