//! A validated body in, an asset out.
//!
//! [`bake`] orders vertices into blocks of eight that share binds ([`blocks`]), turns clips into
//! sparse keys ([`clips`]) and lays everything out as `core/SPEC.md` says ([`mod@write`]). The same
//! input gives the same bytes.

pub mod blocks;
pub mod centres;
pub mod clips;
pub mod compress;
pub mod write;

use sinew_core::asset::{Asset, AssetError, Dims, SectionKind};

use crate::model::Avatar;
use clips::KeyTolerance;

/// How to bake.
#[derive(Clone, Copy, Debug, Default)]
pub struct BakeOptions {
    /// Keys whose absence changes less than this are left out.
    pub key_tolerance: KeyTolerance,
    /// Whether to find centres of rotation ([`centres`]), which one skinning mode needs.
    pub centres: bool,
    /// Metres that compressed clips may stray in joint space; `None` keeps 32-bit keys.
    pub compression: Option<f64>,
}

/// An asset and what is known about how it came about.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The file.
    pub bytes: AssetBytes,
    /// What was done.
    pub report: BakeReport,
}

/// What baking did.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeReport {
    /// Counts of the asset.
    pub dims: Dims,
    /// Length of each section.
    pub section_bytes: Vec<(SectionKind, usize)>,
    /// Largest change of a weight by rounding to 16 bits.
    pub weight_error: f64,
    /// Keys in the source and keys kept.
    pub keys: (usize, usize),
    /// Clips that were compressed.
    pub compression: Vec<compress::CompressionReport>,
}

/// A body that cannot be written as an asset.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// More of something than the format holds.
    #[error("{count} {what}, where the asset holds at most {limit}; simplify the body")]
    TooMany {
        /// What.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A value beyond the format's range.
    #[error("{what} is {value}, where the asset holds at most 1e6; check the unit of length")]
    TooLarge {
        /// What.
        what: String,
        /// Its value.
        value: f64,
    },
    /// The asset does not pass the core's own check.
    #[error("the asset written does not pass its check: {0}")]
    Unsound(#[from] AssetError),
}

/// The bytes of an asset at an address that suits the core.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssetBytes {
    words: Vec<u128>,
    length: usize,
}

impl AssetBytes {
    /// Copies bytes to a suitable address.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0_u128; bytes.len().div_ceil(16)];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            length: bytes.len(),
        }
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }

    /// The checked asset.
    ///
    /// # Errors
    /// Bytes that are not a sound asset.
    pub fn asset(&self) -> Result<Asset<'_>, AssetError> {
        Asset::new_checked(self.as_slice())
    }
}

/// Bakes a body. O(vertices log vertices + keys).
///
/// # Errors
/// [`BakeError`] where the body exceeds the format.
pub fn bake(avatar: &Avatar, options: &BakeOptions) -> Result<Baked, BakeError> {
    bake_with(avatar, options, None)
}

/// [`bake`] with a skin that markers drive beside the skeleton's.
///
/// # Errors
/// As [`bake`].
pub fn bake_with(
    avatar: &Avatar,
    options: &BakeOptions,
    marker_skin: Option<&write::MarkerSkinData>,
) -> Result<Baked, BakeError> {
    let blocks = blocks::arrange(&avatar.skin);
    let clips = clips::reduce(avatar, options.key_tolerance, options.compression);
    let centres = options
        .centres
        .then(|| centres::centres(&avatar.mesh, &avatar.skin));
    let extras = write::Extras {
        centres: centres.as_deref(),
        marker_skin,
    };
    let bytes = write::write(avatar, &blocks, &clips, &extras)?;
    let bytes = AssetBytes::new(&bytes);
    let dims = *bytes.asset()?.dims();
    let lengths = SectionKind::ALL.iter();
    let report = BakeReport {
        dims,
        section_bytes: lengths
            .map(|&kind| (kind, kind.bytes(&dims).unwrap_or(0)))
            .collect(),
        weight_error: blocks.weight_error,
        keys: (clips.source_keys, clips.kept_keys()),
        compression: clips.compression,
    };
    Ok(Baked { bytes, report })
}
