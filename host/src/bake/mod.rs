//! A validated body in, an asset out.
//!
//! [`bake`] orders vertices into blocks of eight that share binds ([`blocks`]), packs them where that
//! is wanted ([`quantise`]), does the same for coarser levels ([`crate::simplify`]), turns clips into
//! sparse keys ([`clips`]) and lays everything out as `core/SPEC.md` says ([`mod@write`]). The same
//! input gives the same bytes.

pub mod blocks;
pub mod bounds;
pub mod centres;
pub mod clips;
pub mod compress;
pub mod quantise;
pub mod write;

use sinew_core::asset::{Asset, AssetError, Dims, SectionKind};

use crate::fit::correctives::CorrectiveData;
use crate::fit::laplace::rig::{Rig, Tables};
use crate::fit::live::MarkerModel;
use crate::model::{Avatar, Mesh, Skin};
use crate::simplify::{self, Simplified};
use blocks::Blocks;
use clips::{KeyTolerance, SparseClips};
use quantise::PackError;
use write::Level;

/// How to bake.
#[derive(Clone, Debug, Default)]
pub struct BakeOptions {
    /// Keys whose absence changes less than this are left out.
    pub key_tolerance: KeyTolerance,
    /// Whether to find centres of rotation ([`centres`]), which one skinning mode needs.
    pub centres: bool,
    /// Whether positions and normals are stored in 16-bit numbers ([`quantise`]).
    pub quantised: bool,
    /// Vertices of coarser levels ([`crate::simplify`]).
    pub levels: Vec<usize>,
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
    /// What 16-bit positions and normals changed, where they were wanted; levels included.
    pub pack_error: Option<PackError>,
    /// Coarser levels.
    pub levels: Vec<LevelReport>,
}

/// A coarser level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelReport {
    /// Vertices; more than were asked for where borders and seams allow no fewer.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Blocks of eight vertices.
    pub blocks: usize,
    /// See [`crate::simplify::Simplified::error`].
    pub error: f64,
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
    bake_with(avatar, options, None, None)
}

/// [`bake`] with a skin that markers drive beside the skeleton's, and a marker set for live
/// labelling.
///
/// # Errors
/// As [`bake`].
pub fn bake_with(
    avatar: &Avatar,
    options: &BakeOptions,
    marker_skin: Option<&write::MarkerSkinData>,
    markers: Option<&MarkerModel>,
) -> Result<Baked, BakeError> {
    let additions = Additions {
        marker_skin,
        markers,
        correctives: None,
    };
    bake_adding(avatar, options, &additions)
}

/// What an asset holds besides a skeleton's skin and its clips.
#[derive(Clone, Copy, Debug, Default)]
pub struct Additions<'a> {
    /// A skin that markers drive.
    pub marker_skin: Option<&'a write::MarkerSkinData>,
    /// A marker set for live labelling.
    pub markers: Option<&'a MarkerModel>,
    /// What moves the body's last morph targets, see
    /// [`Correctives::on`](crate::fit::correctives::Correctives::on).
    pub correctives: Option<&'a CorrectiveData>,
}

/// [`bake`] with more in it.
///
/// # Errors
/// As [`bake`].
pub fn bake_adding(
    avatar: &Avatar,
    options: &BakeOptions,
    additions: &Additions<'_>,
) -> Result<Baked, BakeError> {
    let blocks = blocks::arrange(&avatar.skin);
    let clips = clips::reduce(avatar, options.key_tolerance, options.compression);
    let find_centres =
        |mesh: &Mesh, skin: &Skin| options.centres.then(|| centres::centres(mesh, skin));
    let pack =
        |mesh: &Mesh, blocks: &Blocks| options.quantised.then(|| quantise::pack(mesh, blocks));
    let centres = find_centres(&avatar.mesh, &avatar.skin);
    let packed = pack(&avatar.mesh, &blocks);
    let mut pack_error = packed.as_ref().map(|packed| packed.error);
    let (mut levels, mut level_reports) = (Vec::new(), Vec::new());
    for coarser in simplify_to(avatar, &options.levels) {
        let Simplified {
            mesh, skin, source, ..
        } = coarser;
        let blocks = blocks::arrange(&skin);
        let packed = pack(&mesh, &blocks);
        if let (Some(worst), Some(packed)) = (&mut pack_error, &packed) {
            worst.position = worst.position.max(packed.error.position);
            worst.normal = worst.normal.max(packed.error.normal);
        }
        level_reports.push(LevelReport {
            vertices: mesh.positions.len(),
            triangles: mesh.triangles.len(),
            blocks: blocks.blocks.len(),
            error: coarser.error,
        });
        levels.push(Level {
            centres: find_centres(&mesh, &skin),
            packed,
            blocks,
            source,
            avatar: Avatar {
                mesh,
                skin,
                skeleton: avatar.skeleton.clone(),
                clips: Vec::new(),
            },
        });
    }
    let wider = pack_error.map_or(0.0, |error| error.position);
    let ranges = additions.correctives.map_or(&[][..], |data| &data.ranges);
    let bounds = bounds::rest_bounds(&avatar.mesh, &avatar.skin, wider, ranges);
    let extras = write::Extras {
        centres: centres.as_deref(),
        packed: packed.as_ref(),
        bounds: Some(&bounds),
        levels: &levels,
        marker_skin: additions.marker_skin,
        laplacian: None,
        markers: additions.markers,
        correctives: additions.correctives,
    };
    let baked = finish(avatar, &blocks, &clips, &extras)?;
    Ok(Baked {
        report: BakeReport {
            pack_error,
            levels: level_reports,
            ..baked.report
        },
        ..baked
    })
}

/// Bakes a scan that follows markers, without what only a skinned body has.
/// O(vertices + keys + tables)
///
/// # Errors
/// [`BakeError`] where it exceeds the format.
pub fn bake_rig(rig: &Rig, options: &BakeOptions) -> Result<Baked, BakeError> {
    let order = match &rig.tables {
        Tables::Collapsed(tables) => &tables.order,
        Tables::Exact(tables) => &tables.order,
    };
    let blocks = blocks::in_order(&rig.body.skin, order);
    let clips = clips::reduce(&rig.body, options.key_tolerance, options.compression);
    let extras = write::Extras {
        laplacian: Some(&rig.tables),
        ..write::Extras::default()
    };
    finish(&rig.body, &blocks, &clips, &extras)
}

fn finish(
    avatar: &Avatar,
    blocks: &Blocks,
    clips: &SparseClips,
    extras: &write::Extras<'_>,
) -> Result<Baked, BakeError> {
    let bytes = write::write(avatar, blocks, clips, extras)?;
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
        pack_error: None,
        levels: Vec::new(),
        compression: clips.compression.clone(),
    };
    Ok(Baked { bytes, report })
}

/// Coarser and coarser; counts that would not leave fewer vertices than before are passed over.
fn simplify_to(avatar: &Avatar, counts: &[usize]) -> Vec<Simplified> {
    let mut counts = counts.to_vec();
    counts.sort_unstable_by(|a, b| b.cmp(a));
    let mut before = avatar.mesh.positions.len();
    let mut levels = Vec::new();
    for count in counts {
        let level = simplify::simplify(avatar, count);
        if count > 0 && level.mesh.positions.len() < before {
            before = level.mesh.positions.len();
            levels.push(level);
        }
    }
    levels
}
