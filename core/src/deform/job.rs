//! What a skinning call is asked to do, and the choice of kernel.

use core::ops::Range;

use super::Level;
#[cfg(feature = "modes")]
use super::dual::{Centres, DualQuaternion};
use super::linear::Linear;
use super::morph::Morphs;
use super::output::{Output, SizeError};
use super::rest::RestShape;
use super::skin::{self, Blend, Either, Task};
use super::vertices;
use crate::asset::Asset;
#[cfg(feature = "simd")]
use crate::asset::LANES;
use crate::math::Affine12;
use crate::pose::Dual17;

/// How the transforms of several binds become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SkinMode {
    /// Weighted sum of matrices (Mažrimas & Beinaravičius, section 2). Bends and twists lose volume.
    #[default]
    Linear,
    /// Weighted sum of unit dual quaternions, after a linear blend of what is not rotation
    /// (Kavan, Collins, Zara and O'Sullivan, *Geometric Skinning with Approximate Dual Quaternion
    /// Blending*, 2008). Twists keep their volume, bends bulge a little.
    #[cfg(feature = "modes")]
    DualQuaternion,
    /// Blended rotation about a centre found beforehand (Le and Hodgins, *Real-time Skeletal
    /// Skinning with Optimized Centers of Rotation*, 2016). Needs an asset with centres.
    #[cfg(feature = "modes")]
    CentresOfRotation,
}

/// What moves normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NormalMode {
    /// The matrix of the position: exact for rotation and uniform scale.
    #[default]
    Fast,
    /// Its inverse transpose: exact for every matrix that can be inverted.
    #[cfg(feature = "modes")]
    InverseTranspose,
}

/// A skinning call over borrowed handles; [`SkinJob::linear`] and struct update make one.
#[derive(Clone, Copy, Debug)]
pub struct SkinJob<'p> {
    /// `[binds]` from [`crate::pose::palette`].
    pub palette: &'p [Affine12],
    /// `[binds]` from [`crate::pose::duals`]; unused in [`SkinMode::Linear`].
    pub duals: &'p [Dual17],
    /// Whether some bind has a stretch, as [`crate::pose::duals`] said.
    pub stretched: bool,
    /// How transforms are blended.
    pub mode: SkinMode,
    /// What moves normals.
    pub normals: NormalMode,
    /// `[morphs]`; missing ones count as zero.
    pub morph_weights: &'p [f32],
    /// Instructions; the output's bits do not depend on them.
    pub level: Level,
}

impl<'p> SkinJob<'p> {
    /// Linear blend, fast normals, no morph targets, best level.
    #[must_use]
    pub fn linear(palette: &'p [Affine12]) -> Self {
        Self {
            palette,
            duals: &[],
            stretched: false,
            mode: SkinMode::Linear,
            normals: NormalMode::Fast,
            morph_weights: &[],
            level: Level::best(),
        }
    }

    /// Skins a range of blocks; those that do not exist are left out, vertices of other blocks are
    /// not touched.
    ///
    /// Where the asset has no centres of rotation they count as the origin.
    /// O(slots + vertices)
    pub fn run(&self, asset: &Asset<'_>, blocks: Range<usize>, output: &mut Output<'_>) {
        match self.mode {
            SkinMode::Linear => self.blend(asset, blocks, self.linear_blend(), output),
            #[cfg(feature = "modes")]
            SkinMode::DualQuaternion => self.blend(asset, blocks, self.dual_blend(), output),
            #[cfg(feature = "modes")]
            SkinMode::CentresOfRotation => {
                self.blend(asset, blocks, Centres(self.dual_blend()), output);
            }
        }
    }

    /// Skins single vertices, for ray casts and attachment points: the same bits as in their blocks.
    ///
    /// `ids`: places in block order, as the asset's triangles name them ([`Asset::source_order`]
    /// says which vertex of the source each is); those that do not exist are left out. `positions`
    /// and `normals`: a place for each id; old contents do not matter. O(ids x (runs + slots of a
    /// block))
    ///
    /// # Errors
    /// [`SizeError::TooSmall`] where there are more ids than places.
    pub fn vertices(
        &self,
        asset: &Asset<'_>,
        ids: &[u32],
        positions: &mut [[f32; 3]],
        normals: Option<&mut [[f32; 3]]>,
    ) -> Result<(), SizeError> {
        let room = normals.as_ref().map(|normals| normals.len());
        vertices::check(ids.len(), positions.len(), room)?;
        let normals = normals.unwrap_or_default();
        match self.mode {
            SkinMode::Linear => {
                let blend = self.linear_blend();
                vertices::some(&self.task(asset, blend, 0..0), ids, positions, normals);
            }
            #[cfg(feature = "modes")]
            SkinMode::DualQuaternion => {
                let blend = self.dual_blend();
                vertices::some(&self.task(asset, blend, 0..0), ids, positions, normals);
            }
            #[cfg(feature = "modes")]
            SkinMode::CentresOfRotation => {
                let blend = Centres(self.dual_blend());
                vertices::some(&self.task(asset, blend, 0..0), ids, positions, normals);
            }
        }
        Ok(())
    }

    fn task<'j, 'a, B>(
        &'j self,
        asset: &'j Asset<'a>,
        blend: B,
        blocks: Range<usize>,
    ) -> Task<'j, 'a, B> {
        Task {
            shape: RestShape {
                asset,
                morphs: Morphs::new(asset, self.morph_weights),
            },
            blend,
            normals: Either {
                exact: self.normals != NormalMode::Fast,
            },
            blocks,
        }
    }

    fn linear_blend(&self) -> Linear<'p> {
        Linear {
            palette: self.palette,
        }
    }

    #[cfg(feature = "modes")]
    fn dual_blend(&self) -> DualQuaternion<'p> {
        DualQuaternion {
            palette: self.palette,
            duals: self.duals,
            stretched: self.stretched,
        }
    }

    fn blend<B: Blend>(
        &self,
        asset: &Asset<'_>,
        blocks: Range<usize>,
        blend: B,
        output: &mut Output<'_>,
    ) {
        let end = blocks.end.min(asset.dims().block_count);
        let blocks = blocks.start.min(end)..end;
        let task = |blocks| self.task(asset, blend, blocks);
        match self.level {
            Level::Scalar => skin::scalar(&task(blocks), output),
            #[cfg(feature = "simd")]
            Level::Simd(level) => {
                // A short last block is not worth a vector kernel that can leave lanes out.
                let full = asset.dims().vertex_count / LANES;
                let middle = blocks.end.min(full.max(blocks.start));
                let (whole, short) = (task(blocks.start..middle), task(middle..blocks.end));
                fearless_simd::dispatch!(level, simd => skin::by_width(simd, &whole, output));
                skin::scalar(&short, output);
            }
        }
    }
}

/// Skins a range of blocks: `v = (sum_i w_i M_i D_i^-1) v_d`, normals by the same matrix without
/// its translation, then to unit length (exact for rotation and uniform scale).
///
/// `palette: [binds]` from [`crate::pose::palette`]; `blocks` is cut to those that exist. Vertices
/// outside the range are not touched. O(slots + vertices)
pub fn skin_blocks(
    asset: &Asset<'_>,
    palette: &[Affine12],
    blocks: Range<usize>,
    level: Level,
    output: &mut Output<'_>,
) {
    let job = SkinJob {
        level,
        ..SkinJob::linear(palette)
    };
    job.run(asset, blocks, output);
}
