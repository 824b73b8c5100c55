//! Which stages are measured and hashed over which assets.

use std::fs;

use sinew_core::asset::crc32;
use sinew_core::deform::Level;
use sinew_host::bake::AssetBytes;
use sinew_host::fit::laplace::rig::Solve;
use sinew_host::fit::parts::Mode;
use sinew_stages::Unmeasured;

use crate::budgets::Fingerprints;
use crate::{driven, human, root};

/// A stage over an asset.
#[derive(Clone, Debug)]
pub struct Case {
    /// One of [`sinew_stages::ALL`].
    pub stage: &'static str,
    /// Of the asset.
    pub name: &'static str,
    /// The asset.
    pub asset: AssetBytes,
    /// Whether tables in it were fitted by solvers that may round otherwise on another processor:
    /// then no hash is committed, and all machines are compared with a desktop's of the same run.
    pub is_fitted: bool,
}

impl Case {
    /// As in `tests/budgets.toml` and `tests/golden/fingerprints.toml`.
    #[must_use]
    pub fn key(&self) -> String {
        format!("{}.{}", self.stage, self.name)
    }

    /// Of all that the stage puts out.
    ///
    /// # Panics
    /// Where the stage does not run.
    #[must_use]
    pub fn fingerprints(&self, level: Level) -> Fingerprints {
        let stage = sinew_stages::ALL
            .iter()
            .find(|(name, _)| *name == self.stage);
        let (_, run) = stage.expect("a stage of that name");
        let mut memory = vec![f32::NAN; 4 << 20];
        let bytes = self.asset.as_slice();
        let hash = run(bytes, level, &mut memory, &mut Unmeasured);
        Fingerprints {
            asset: format!("{:08x}", crc32(bytes)),
            frames: format!("{:016x}", hash.expect("runs")),
        }
    }
}

/// How a case comes about.
struct Recipe {
    stage: &'static str,
    name: &'static str,
    is_fitted: bool,
    bake: fn() -> AssetBytes,
}

const fn plain(stage: &'static str, name: &'static str, bake: fn() -> AssetBytes) -> Recipe {
    Recipe {
        stage,
        name,
        is_fitted: false,
        bake,
    }
}

const fn fitted(stage: &'static str, name: &'static str, bake: fn() -> AssetBytes) -> Recipe {
    Recipe {
        is_fitted: true,
        ..plain(stage, name, bake)
    }
}

/// Add a row for a new stage or a new asset.
const RECIPES: &[Recipe] = &[
    // The rope stage reads no asset.
    plain("rope", "twenty", arm),
    plain("skin", "arm", arm),
    plain("skin", "hand", human::hand),
    plain("skin", "human", human::asset),
    plain("skin", "human_2k", human::small_asset),
    plain("modes", "human_2k", human::small_asset_of_every_mode),
    plain("crowd", "hand", human::hand),
    plain("halves", "human_2k", human::small_asset),
    fitted("markers", "walk_53", driven::film),
    fitted("actor", "rope_500", driven::actor),
    fitted("parts", "collapsed_2k", || driven::skin(Mode::Collapsed)),
    fitted("parts", "exact_2k", || driven::skin(Mode::Exact)),
    fitted("parts", "hybrid_2k", || driven::skin(Mode::Hybrid)),
    fitted("laplacian", "collapsed_2k", || {
        driven::scan(Solve::Collapsed { tolerance: 3e-3 })
    }),
    fitted("laplacian", "exact_2k", || driven::scan(Solve::Exact)),
];

fn arm() -> AssetBytes {
    let bytes = fs::read(root().join("tests/golden/arm.sinew"));
    AssetBytes::new(&bytes.expect("the golden asset"))
}

/// The cases of these keys; all where none is given. Each is baked when it is asked for.
///
/// # Panics
/// When a bundled file is absent or no longer fits.
pub fn only(wanted: &[String]) -> impl Iterator<Item = Case> {
    let recipes = RECIPES.iter().filter(|recipe| {
        let key = format!("{}.{}", recipe.stage, recipe.name);
        wanted.is_empty() || wanted.contains(&key)
    });
    recipes.map(|recipe| Case {
        stage: recipe.stage,
        name: recipe.name,
        asset: (recipe.bake)(),
        is_fitted: recipe.is_fitted,
    })
}
