//! Laplacian deformers. Their own checks, which the tables need outside an asset too, do the work.

use crate::asset::{Asset, AssetError};
use crate::deform::laplacian::{Collapsed, Exact};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let (dims, fault) = (&asset.dims.laplacian, AssetError::Laplacian);
    if dims.is_collapsed() {
        Collapsed::new_checked(asset.collapsed_parts()).map_err(fault)?;
    }
    if dims.is_exact() {
        Exact::new_checked(asset.exact_parts()).map_err(fault)?;
    }
    Ok(())
}
