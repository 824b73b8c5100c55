//! Which stages are measured and hashed over which assets.

use std::fs;

use sinew_host::bake::AssetBytes;
use sinew_host::studio::MarkerLayout;

use crate::{human, live, marker_film, root};

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
        case("skin", "arm", arm),
        case("skin", "human", human::asset()),
        case("markers", "set53", marker_set()),
    ]
}

/// 53 markers that kneel, known from a walk and from another part of the kneeling.
fn marker_set() -> AssetBytes {
    let body = human::avatar();
    let film = |clip: usize| {
        let clip = &body.clips[clip];
        marker_film::truth(&body, clip, MarkerLayout::Standard53, 120.0, 6.0)
    };
    let (walk, kneel) = (film(0), film(1));
    let half = kneel.frame_count() / 2;
    let lessons = [walk, live::cut(&kneel, 0, half)];
    marker_film::asset(&live::cut(&kneel, half, kneel.frame_count()), &lessons)
}
