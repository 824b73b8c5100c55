//! The same bits on every machine: hashes of played assets, committed, at every level there is.
//!
//! `examples/cortex-m/run.sh --check` and `examples/web/run.sh` compare a Cortex-M and a browser's
//! engine with the same numbers.

use std::fs;

use sinew_core::deform::Level;
use sinew_tests::budgets::Fingerprints;
use sinew_tests::{cases, root};

/// Set `SINEW_BLESS=1` to commit new hashes after a change of the arithmetic or the bake.
#[test]
fn every_level_gives_the_committed_bits() {
    let levels = levels();
    let file = root().join("tests/golden/fingerprints.toml");
    let bless = std::env::var_os("SINEW_BLESS").is_some();
    let text = fs::read_to_string(&file).expect("tests/golden/fingerprints.toml");
    let mut blessed = String::from(HEAD);
    for case in cases::only(&[]) {
        let key = case.key();
        let scalar = case.fingerprints(Level::Scalar);
        for &(name, level) in &levels {
            assert_eq!(case.fingerprints(level), scalar, "{key}, {name}");
        }
        if !case.is_fitted {
            blessed.push_str(&scalar.to_table(&key));
            let committed = Fingerprints::of(&text, &key);
            assert!(
                bless || committed == Some(scalar),
                "{key}: other than committed"
            );
        }
    }
    if bless {
        fs::write(&file, blessed).expect("writes");
    }
    let names: Vec<_> = levels.iter().map(|(name, _)| *name).collect();
    println!("levels compared: {}", names.join(", "));
}

const HEAD: &str = "\
# Hashes that hold on every machine: of all that a stage puts out, by stage and asset, and the
# CRC-32 of the asset that gave it. Stages: tests/stages; assets: tests/cases.rs, those without fitted
# tables.
# `SINEW_BLESS=1 cargo test -p sinew-tests --test fingerprint` writes this file.
";

/// Every level that this machine has.
fn levels() -> Vec<(&'static str, Level)> {
    let mut levels = vec![("best", Level::best())];
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
