//! What both firmwares share: the asset, and how to count instructions and stack.
#![no_std]

pub mod counter;
pub mod stack;

use sinew_core::asset::Dims;

/// The asset in flash, see `build.rs`.
pub const ASSET: &[u8] = sinew_core::include_asset!(env!("SINEW_ASSET_PATH"));

/// Its counts, for array sizes.
pub const DIMS: Dims = Dims::of(ASSET);
