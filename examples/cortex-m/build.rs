//! Which stage and which asset go into the firmware, and where the linker finds its scripts.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // The memory map of the board.
    let board = match env::var("TARGET")
        .unwrap_or_default()
        .starts_with("thumbv8m")
    {
        true => Path::new(env!("CARGO_MANIFEST_DIR")).join("an505"),
        false => root.clone(),
    };
    println!("cargo:rustc-link-search={}", board.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    if env::var_os("CARGO_FEATURE_LOG").is_some() {
        println!("cargo:rustc-link-arg-bin=log=-Tdefmt.x");
    }
    println!(
        "cargo:rerun-if-changed={}",
        board.join("memory.x").display()
    );

    println!("cargo:rerun-if-env-changed=SINEW_ASSET");
    let asset = match env::var_os("SINEW_ASSET") {
        Some(path) => path.into(),
        None => root.join("tests/golden/arm.sinew"),
    };
    let asset = fs::canonicalize(&asset)
        .unwrap_or_else(|error| panic!("the asset {}: {error}", asset.display()));
    println!("cargo:rerun-if-changed={}", asset.display());
    println!("cargo:rustc-env=SINEW_ASSET_PATH={}", asset.display());

    // A path instead of a look-up by name: the linker then drops all other stages.
    println!("cargo:rerun-if-env-changed=SINEW_STAGE");
    let stage = env::var("SINEW_STAGE").unwrap_or("skin".into());
    let out = env::var_os("OUT_DIR").expect("cargo sets it");
    let text = format!("pub use sinew_stages::{stage}::run;\n");
    fs::write(Path::new(&out).join("stage.rs"), text).expect("the build folder takes files");

    println!("cargo:rerun-if-env-changed=SINEW_PICTURE");
    let picture = env::var("SINEW_PICTURE").unwrap_or("frame.png".into());
    println!("cargo:rustc-env=SINEW_PICTURE={picture}");

    println!("cargo:rustc-env=SINEW_COMPILER={}", compiler());
}

/// Version of the compiler, as in "1.95.0".
fn compiler() -> String {
    let rustc = env::var_os("RUSTC").unwrap_or("rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let text = text.unwrap_or_default();
    text.split_whitespace().nth(1).unwrap_or("unknown").into()
}
