//! The same bits on every machine: hashes of played assets, committed, at every level there is.
//!
//! `examples/cortex-m/run.sh --check` and `examples/web/run.sh` compare a Cortex-M and a browser's
//! engine with the same numbers.

use std::fmt::Write;
use std::fs;

use sinew_core::asset::crc32;
use sinew_core::deform::Level;
use sinew_host::bake::AssetBytes;
use sinew_host::play::fingerprint;
use sinew_tests::budgets::Fingerprints;
use sinew_tests::{human, root};

/// Set `SINEW_BLESS=1` to commit new hashes after a change of the arithmetic or the bake.
#[test]
fn every_level_gives_the_committed_bits() {
    let arm = fs::read(root().join("tests/golden/arm.sinew")).expect("the golden asset");
    let assets = [("arm", AssetBytes::new(&arm)), ("human", human::asset())];
    let levels = levels();
    let file = root().join("tests/golden/fingerprints.toml");
    if std::env::var_os("SINEW_BLESS").is_some() {
        let mut text = String::from(HEAD);
        for (name, asset) in &assets {
            let frames = fingerprint(&asset.asset().expect("sound"), Level::Scalar);
            let crc = crc32(asset.as_slice());
            write!(
                text,
                "\n[{name}]\nasset = \"{crc:08x}\"\nframes = \"{frames:016x}\"\n"
            )
            .expect("a string takes any text");
        }
        fs::write(&file, text).expect("writes");
    }
    let text = fs::read_to_string(&file).expect("tests/golden/fingerprints.toml");
    for (name, asset) in &assets {
        let committed = Fingerprints::of(&text, name).expect("committed hashes");
        let found = format!("{:08x}", crc32(asset.as_slice()));
        assert_eq!(found, committed.asset, "{name}: the bake gives other bytes");
        for &(level_name, level) in &levels {
            let found = fingerprint(&asset.asset().expect("sound"), level);
            let found = format!("{found:016x}");
            assert_eq!(found, committed.frames, "{name}, {level_name}");
        }
    }
    let names: Vec<_> = levels.iter().map(|(name, _)| *name).collect();
    println!("levels compared: {}", names.join(", "));
}

const HEAD: &str = "\
# Hashes that hold on every machine: of the positions and normals of an asset's first clip, as
# `sinew verify` prints it, and the CRC-32 of the asset that gave it.
# `SINEW_BLESS=1 cargo test -p sinew-tests --test fingerprint` writes this file.
";

/// Every level that this machine has.
fn levels() -> Vec<(&'static str, Level)> {
    let mut levels = vec![("scalar", Level::Scalar), ("best", Level::best())];
    #[cfg(target_arch = "x86_64")]
    {
        use fearless_simd::Level as Simd;
        let here = Simd::new();
        let mut add = |name, level: Option<Simd>| {
            levels.extend(level.map(|level| (name, Level::Simd(level))));
        };
        add("SSE2", here.as_sse2().map(Simd::Sse2));
        add("SSE4.2", here.as_sse4_2().map(Simd::Sse4_2));
        add("AVX2", here.as_avx2().map(Simd::Avx2));
    }
    levels
}
