//! What both firmwares share: the stage, the asset, memory, and how to count instructions and stack.
#![no_std]

pub mod counter;
pub mod png;
pub mod report;
pub mod stack;

/// The stage that this firmware runs, see `build.rs`.
pub mod stage {
    include!(concat!(env!("OUT_DIR"), "/stage.rs"));
}

/// The asset in flash, see `build.rs`.
pub const ASSET: &[u8] = sinew_core::include_asset!(env!("SINEW_ASSET_PATH"));

/// Numbers of memory that a stage may hand out: most of the board's 4 MiB.
pub const MEMORY: usize = 3 << 18;
