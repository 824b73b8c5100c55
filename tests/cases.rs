//! Which stages are measured and hashed over which assets.

use std::fs;

use sinew_host::bake::AssetBytes;

use crate::{human, root};

/// A stage over an asset.
#[derive(Clone, Debug)]
pub struct Case {
    /// One of [`sinew_stages::ALL`].
    pub stage: &'static str,
    /// Of the asset.
    pub name: &'static str,
    /// The asset.
    pub asset: AssetBytes,
}

impl Case {
    /// As in `tests/budgets.toml` and `tests/golden/fingerprints.toml`.
    #[must_use]
    pub fn key(&self) -> String {
        format!("{}.{}", self.stage, self.name)
    }
}

/// Every case. Add a row for a new stage or a new asset.
///
/// # Panics
/// When a bundled file is absent or no longer fits.
#[must_use]
pub fn all() -> Vec<Case> {
    let arm = fs::read(root().join("tests/golden/arm.sinew")).expect("the golden asset");
    let arm = AssetBytes::new(&arm);
    let case = |stage, name, asset| Case { stage, name, asset };
    vec![
        // The rope stage reads no asset.
        case("rope", "twenty", arm.clone()),
        case("skin", "arm", arm),
        case("skin", "human", human::asset()),
    ]
}
