//! Finds every section: header, then table, each proved before what depends on it is read.

use bytemuck::{Pod, try_cast_slice};

use super::header::{
    AT_CHECKED, AT_CHECKSUM, AT_DIMS, AT_RESERVED, AT_SECTION_COUNT, AT_TOTAL_BYTES, AT_VERSION,
    LAPLACIAN, word,
};
use super::{
    ALIGNMENT, AssetError, Dims, HEADER_BYTES, LANES, MAGIC, NO_PARENT, SECTION_ROW_BYTES,
    SectionKind, VERSION, crc32,
};

const KINDS: usize = SectionKind::ALL.len();

/// The bytes with the place of every section.
pub(super) struct Sections<'a> {
    bytes: &'a [u8],
    pub(super) dims: Dims,
    /// First byte and the one after the last, in the order of [`SectionKind::ALL`].
    places: [(usize, usize); KINDS],
}

impl<'a> Sections<'a> {
    /// Of bytes that [`check_header`] and [`check_sum`] found sound.
    ///
    /// # Errors
    /// The first fault of the counts or the table.
    pub(super) fn find(bytes: &'a [u8]) -> Result<Self, AssetError> {
        if !(bytes.as_ptr() as usize).is_multiple_of(ALIGNMENT) {
            return Err(AssetError::Misaligned);
        }
        all_zero(bytes, AT_RESERVED, AT_RESERVED + 8)?;
        let dims = Dims::read(bytes);
        for (index, count) in dims.to_words().into_iter().enumerate() {
            let at = AT_DIMS + 4 * index;
            if word(bytes, at) != count {
                return Err(AssetError::NotZero { at });
            }
        }
        check_counts(&dims)?;
        let rows = SectionKind::ALL.iter();
        let rows = rows.filter(|kind| kind.bytes(&dims) != Some(0)).count();
        let stated = word(bytes, AT_SECTION_COUNT);
        if stated != rows {
            return Err(AssetError::SectionCount {
                stated,
                expected: rows,
            });
        }
        let mut places = [(0, 0); KINDS];
        let mut end = HEADER_BYTES + rows * SECTION_ROW_BYTES;
        let mut row = 0;
        for (&section, place) in SectionKind::ALL.iter().zip(&mut places) {
            let expected = section.bytes(&dims);
            if expected == Some(0) {
                continue;
            }
            let at = HEADER_BYTES + row * SECTION_ROW_BYTES;
            let found = word(bytes, at) as u32;
            if found != section as u32 {
                return Err(AssetError::SectionOrder { row, found });
            }
            row += 1;
            let (offset, length) = (word(bytes, at + 4), word(bytes, at + 8));
            all_zero(bytes, at + 12, at + 16)?;
            if expected != Some(length) {
                let expected = expected.unwrap_or(usize::MAX);
                return Err(AssetError::SectionLength {
                    section,
                    expected,
                    found: length,
                });
            }
            let after = offset
                .checked_add(length)
                .filter(|&after| after <= bytes.len());
            match after {
                Some(after) if offset == end.next_multiple_of(ALIGNMENT) => {
                    all_zero(bytes, end, offset)?;
                    *place = (offset, after);
                    end = after;
                }
                _ => return Err(AssetError::SectionPlace { section, offset }),
            }
        }
        if end.next_multiple_of(ALIGNMENT) != bytes.len() {
            return Err(AssetError::Length {
                stated: end,
                found: bytes.len(),
            });
        }
        all_zero(bytes, end, bytes.len())?;
        Ok(Self {
            bytes,
            dims,
            places,
        })
    }

    /// The numbers of a section; none where the counts give it no length.
    pub(super) fn view<T: Pod>(&self, section: SectionKind) -> Result<&'a [T], AssetError> {
        let row = SectionKind::ALL
            .iter()
            .position(|&kind| kind as u32 == section as u32);
        let &(start, end) = row.and_then(|row| self.places.get(row)).unwrap_or(&(0, 0));
        // Lengths and alignment are proved; a failure here could only be an unaligned base.
        try_cast_slice(self.bytes.get(start..end).unwrap_or_default())
            .map_err(|_| AssetError::Misaligned)
    }
}

/// Magic, version and length.
pub(super) fn check_header(bytes: &[u8]) -> Result<(), AssetError> {
    let magic = MAGIC.len().min(bytes.len());
    if bytes.get(..magic) != MAGIC.get(..magic) {
        return Err(AssetError::NotAnAsset);
    }
    if bytes.len() < HEADER_BYTES {
        return Err(AssetError::TooShort {
            needed: HEADER_BYTES,
            found: bytes.len(),
        });
    }
    let version = word(bytes, AT_VERSION) as u32;
    if version != VERSION {
        return Err(AssetError::Version { found: version });
    }
    let stated = word(bytes, AT_TOTAL_BYTES);
    if stated != bytes.len() {
        return Err(AssetError::Length {
            stated,
            found: bytes.len(),
        });
    }
    Ok(())
}

/// Whether the bytes, long enough for a header, are those that were written.
pub(super) fn check_sum(bytes: &[u8]) -> Result<(), AssetError> {
    let (stated, found) = (
        word(bytes, AT_CHECKSUM) as u32,
        crc32(bytes.get(AT_CHECKED..).unwrap_or_default()),
    );
    if stated == found {
        Ok(())
    } else {
        Err(AssetError::Checksum { stated, found })
    }
}

fn all_zero(bytes: &[u8], start: usize, end: usize) -> Result<(), AssetError> {
    let gap = bytes.get(start..end).unwrap_or_default();
    match gap.iter().position(|&byte| byte != 0) {
        Some(at) => Err(AssetError::NotZero { at: start + at }),
        None => Ok(()),
    }
}

fn check_counts(dims: &Dims) -> Result<(), AssetError> {
    let words = dims.to_words();
    let fault = |index: usize| {
        Err(AssetError::Counts {
            index,
            value: words.get(index).copied().unwrap_or(0),
        })
    };
    if dims.joint_count == 0 || dims.joint_count >= usize::from(NO_PARENT) {
        return fault(0);
    }
    if dims.bind_count == 0 || dims.bind_count >= usize::from(NO_PARENT) {
        return fault(1);
    }
    if dims.vertex_count == 0 {
        return fault(2);
    }
    if dims.block_count != dims.vertex_count.div_ceil(LANES) {
        return fault(3);
    }
    let short_indices = dims.index_bytes == 2 && dims.vertex_count <= 1 << 16;
    if !(short_indices || dims.index_bytes == 4) {
        return fault(7);
    }
    if dims.morph_count >= usize::from(NO_PARENT) {
        return fault(18);
    }
    if dims.morph_count == 0 && dims.morph_row_count != 0 {
        return fault(19);
    }
    if dims.morph_normal_count != 0 && dims.morph_normal_count != dims.morph_row_count {
        return fault(20);
    }
    let all_or_none = |count: usize, all: usize| count == 0 || count == all;
    if !all_or_none(dims.shapes.block_count, dims.block_count) {
        return fault(21);
    }
    if !all_or_none(dims.shapes.tangent_block_count, dims.block_count) {
        return fault(22);
    }
    if !all_or_none(dims.bounds.box_count, dims.bind_count) {
        return fault(23);
    }
    if !all_or_none(dims.level.source_count, dims.vertex_count) {
        return fault(27);
    }
    if dims.max_clip_tracks > dims.track_count.saturating_add(dims.packed.track_count) {
        return fault(11);
    }
    if dims.max_track_keys > dims.key_time_count.max(dims.packed.frame_count) {
        return fault(12);
    }
    if let Some(index) = dims.laplacian.fault(dims.joint_count) {
        return fault(LAPLACIAN + index);
    }
    if let Some(index) = dims.markers.fault() {
        return fault(index);
    }
    Ok(())
}
