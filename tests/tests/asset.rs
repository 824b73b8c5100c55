//! The asset: the same bytes from the same input, and nothing accepted that is damaged.

use sinew_core::asset::{Asset, AssetError, crc32};
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_tests::{Random, body::checked_arm, root};

const GOLDEN: &str = "tests/golden/arm.sinew";

fn golden() -> AssetBytes {
    AssetBytes::new(&std::fs::read(root().join(GOLDEN)).expect("the golden asset"))
}

/// Set `SINEW_BLESS=1` to write the golden file anew after a change of the format.
#[test]
fn baking_gives_the_golden_bytes() {
    let baked = bake(&checked_arm(), &BakeOptions::default()).expect("bakes");
    let again = bake(&checked_arm(), &BakeOptions::default()).expect("bakes");
    assert_eq!(baked.bytes, again.bytes);
    if std::env::var_os("SINEW_BLESS").is_some() {
        std::fs::write(root().join(GOLDEN), baked.bytes.as_slice()).expect("writes");
    }
    assert!(
        baked.bytes == golden(),
        "the asset format or the bake changed"
    );
}

#[test]
fn every_truncation_and_every_extension_is_refused() {
    let golden = golden();
    for length in 0..golden.as_slice().len() {
        let cut = AssetBytes::new(&golden.as_slice()[..length]);
        let error = cut.asset().expect_err("a truncated asset");
        assert!(
            matches!(
                error,
                AssetError::TooShort { .. } | AssetError::Length { .. } | AssetError::NotAnAsset
            ),
            "{length}: {error}"
        );
    }
    let longer = [golden.as_slice(), &[0; 16]].concat();
    let error = AssetBytes::new(&longer).asset().expect_err("extra bytes");
    assert!(matches!(error, AssetError::Length { .. }));
}

#[test]
fn every_changed_byte_is_refused() {
    let golden = golden();
    let mut bytes = golden.as_slice().to_vec();
    let mut random = Random(7);
    for at in 0..bytes.len() {
        let flip = 1 + random.below(255) as u8;
        bytes[at] ^= flip;
        assert!(
            AssetBytes::new(&bytes).asset().is_err(),
            "byte {at} ^ {flip}"
        );
        bytes[at] ^= flip;
    }
}

/// Damage that the checksum would hide: the contents must be refused or harmless in a frame.
#[test]
fn ten_thousand_flips_under_a_matching_checksum_are_refused_or_harmless() {
    let golden = golden();
    let mut random = Random(11);
    let (mut refused, mut harmless) = (0, 0);
    for _ in 0..10_000 {
        let mut bytes = golden.as_slice().to_vec();
        for _ in 0..=random.below(3) {
            let at = 20 + random.below(bytes.len() - 20);
            bytes[at] ^= 1 << random.below(8);
        }
        let checksum = crc32(&bytes[20..]);
        bytes[16..20].copy_from_slice(&checksum.to_le_bytes());
        match AssetBytes::new(&bytes).asset() {
            Err(error) => {
                assert!(error.to_string().contains("; "), "{error}");
                refused += 1;
            }
            Ok(asset) => {
                play(&asset);
                harmless += 1;
            }
        }
    }
    assert!(refused > 1_000 && harmless > 1_000, "{refused} {harmless}");
}

fn play(asset: &Asset<'_>) {
    let dims = *asset.dims();
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
    let mut positions = vec![0.0; 3 * dims.vertex_count];
    let mut normals = positions.clone();
    let mut avatar = Avatar::new(asset, &mut state, &mut workspace).expect("sizes fit");
    let mut output =
        Output::separate(&dims, &mut positions, Some(&mut normals)).expect("sizes fit");
    for index in 0..=dims.clip_count {
        for seconds in [0.0, 0.3, 1.0, f32::NAN] {
            let input = Input::Clip {
                index,
                seconds,
                looped: true,
            };
            avatar.step(&input, Budget::UNLIMITED, &mut output);
        }
    }
    assert!(positions.iter().chain(&normals).all(|x| x.is_finite()));
}

#[test]
fn what_is_no_asset_is_named() {
    let of = |bytes: &[u8]| AssetBytes::new(bytes).asset().expect_err("not an asset");
    assert!(matches!(of(&[]), AssetError::TooShort { .. }));
    assert!(matches!(of(&[0; 4096]), AssetError::NotAnAsset));
    let mut newer = golden().as_slice().to_vec();
    newer[8] = 2;
    assert!(matches!(of(&newer), AssetError::Version { found: 2 }));
    let golden = golden();
    let shifted = AssetBytes::new(&[&[0_u8; 4], golden.as_slice()].concat());
    let error = Asset::new_checked(&shifted.as_slice()[4..]).expect_err("misaligned");
    assert!(matches!(error, AssetError::Misaligned), "{error}");
}
