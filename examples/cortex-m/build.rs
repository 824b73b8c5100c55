//! Which asset goes into the firmware, and where the linker finds `memory.x`.

use std::path::Path;
use std::{env, fs};

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    println!("cargo:rustc-link-search={}", root.display());
    println!("cargo:rerun-if-changed={}", root.join("memory.x").display());

    println!("cargo:rerun-if-env-changed=SINEW_ASSET");
    let asset = match env::var_os("SINEW_ASSET") {
        Some(path) => path.into(),
        None => root.join("tests/golden/arm.sinew"),
    };
    let asset = fs::canonicalize(&asset)
        .unwrap_or_else(|error| panic!("the asset {}: {error}", asset.display()));
    println!("cargo:rerun-if-changed={}", asset.display());
    println!("cargo:rustc-env=SINEW_ASSET_PATH={}", asset.display());
}
