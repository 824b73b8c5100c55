//! Morph targets.

use super::{Asset, Lanes3};

/// Offsets that can be blended in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Morph<'a> {
    /// Name in the source mesh.
    pub name: &'a str,
    /// Weight when nothing animates it.
    pub rest_weight: f32,
}

/// Offsets of a block's vertices under one morph target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MorphRow<'a> {
    /// Which morph target.
    pub morph: usize,
    /// At weight one, metres.
    pub offsets: &'a Lanes3,
    /// Of the normals, where the asset has them.
    pub normals: Option<&'a Lanes3>,
}

impl<'a> Asset<'a> {
    /// A morph target; `None` for one that does not exist.
    #[must_use]
    pub fn morph(&self, index: usize) -> Option<Morph<'a>> {
        let &[name, name_bytes, rest_weight, _] = self.morphs.get(index)?;
        Some(Morph {
            name: self.name(name, name_bytes),
            rest_weight: f32::from_bits(rest_weight),
        })
    }

    /// Morph targets that move a block's vertices, ascending.
    #[inline]
    pub fn morph_rows(&self, block: usize) -> impl Iterator<Item = MorphRow<'a>> + use<'a> {
        let starts = (
            self.morph_starts.get(block),
            self.morph_starts.get(block + 1),
        );
        let range = match starts {
            (Some(&first), Some(&end)) => first as usize..end as usize,
            _ => 0..0,
        };
        let ids = self.morph_ids.get(range.clone()).unwrap_or_default();
        let offsets = self.morph_offsets.get(range.clone()).unwrap_or_default();
        let normals = self.morph_normals.get(range).unwrap_or_default();
        let rows = ids.iter().zip(offsets).enumerate();
        rows.map(move |(row, (&morph, offsets))| MorphRow {
            morph: usize::from(morph),
            offsets,
            normals: normals.get(row),
        })
    }
}
