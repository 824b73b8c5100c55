//! The same bits on every machine: hashes of played assets, committed, at every level there is.
//!
//! `examples/cortex-m/run.sh --check` and `examples/web/run.sh` compare a Cortex-M and a browser's
//! engine with the same numbers.

use std::fs;

use sinew_core::asset::crc32;
use sinew_core::deform::Level;
use sinew_stages::Unmeasured;
use sinew_tests::budgets::Fingerprints;
use sinew_tests::cases::{self, Case};
use sinew_tests::root;

/// Set `SINEW_BLESS=1` to commit new hashes after a change of the arithmetic or the bake.
#[test]
fn every_level_gives_the_committed_bits() {
    let cases = cases::all();
    let levels = levels();
    let file = root().join("tests/golden/fingerprints.toml");
    if std::env::var_os("SINEW_BLESS").is_some() {
        let mut text = String::from(HEAD);
        for case in &cases {
            let (key, crc) = (case.key(), crc32(case.asset.as_slice()));
            let frames = hash(case, Level::Scalar);
            let row = format!("\n[{key}]\nasset = \"{crc:08x}\"\nframes = \"{frames}\"\n");
            text.push_str(&row);
        }
        fs::write(&file, text).expect("writes");
    }
    let text = fs::read_to_string(&file).expect("tests/golden/fingerprints.toml");
    for case in &cases {
        let key = case.key();
        let committed = Fingerprints::of(&text, &key).expect("committed hashes");
        let found = format!("{:08x}", crc32(case.asset.as_slice()));
        assert_eq!(found, committed.asset, "{key}: the bake gives other bytes");
        for &(level_name, level) in &levels {
            assert_eq!(hash(case, level), committed.frames, "{key}, {level_name}");
        }
    }
    let names: Vec<_> = levels.iter().map(|(name, _)| *name).collect();
    println!("levels compared: {}", names.join(", "));
}

/// Of all that the stage puts out.
fn hash(case: &Case, level: Level) -> String {
    let stage = sinew_stages::ALL
        .iter()
        .find(|(name, _)| *name == case.stage);
    let (_, run) = stage.expect("a stage of that name");
    let mut memory = vec![f32::NAN; 4 << 20];
    let hash = run(case.asset.as_slice(), level, &mut memory, &mut Unmeasured);
    format!("{:016x}", hash.expect("runs"))
}

const HEAD: &str = "\
# Hashes that hold on every machine: of all that a stage puts out, by stage and asset, and the
# CRC-32 of the asset that gave it. Stages: tests/stages; assets: tests/cases.rs.
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
