//! Joints, binds and their names.

use super::{below, name, numbers, unit_length};
use crate::asset::{Asset, AssetError, LARGEST, NO_PARENT, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    for (joint, &parent) in asset.parents.iter().enumerate() {
        if parent != NO_PARENT {
            // A parent that comes first cannot close a cycle.
            below(SectionKind::Parents, joint, usize::from(parent), joint)?;
        }
    }
    numbers(
        SectionKind::Rest,
        asset.rest.as_flattened().iter().copied(),
        LARGEST,
    )?;
    for (joint, rest) in asset.rest.iter().enumerate() {
        unit_length(
            SectionKind::Rest,
            joint * rest.len(),
            rest.get(..4).unwrap_or_default(),
        )?;
    }
    for (bind, &joint) in asset.bind_joints.iter().enumerate() {
        below(
            SectionKind::BindJoints,
            bind,
            usize::from(joint),
            asset.dims.joint_count,
        )?;
    }
    numbers(
        SectionKind::InverseBind,
        asset.inverse_bind.as_flattened().iter().copied(),
        LARGEST,
    )?;
    for (bind, rotation) in asset.bind_rotations.iter().enumerate() {
        unit_length(SectionKind::BindRotations, 4 * bind, rotation)?;
    }
    for (joint, &[offset, length]) in asset.joint_names.iter().enumerate() {
        name(asset, SectionKind::JointNames, joint, (offset, length))?;
    }
    Ok(())
}
