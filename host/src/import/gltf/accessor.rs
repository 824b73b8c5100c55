//! Bytes into numbers (glTF 2.0, section 3.6 "Binary Data Storage").

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::buffer::Stride;
use gltf::json::validation::Checked;

use super::document::Document;
use super::{buffer, checked, item_fault};
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

/// A file may ask for this many numbers per byte it holds. Instanced meshes and sparse accessors
/// without base data need some; without a bound, a small file could ask for all memory.
const NUMBERS_PER_BYTE: u64 = 64;
/// Numbers that any file may ask for, however small.
const NUMBERS_FREE: u64 = 1 << 22;
/// Numbers that no file may go beyond: 4 GiB as `f64`.
const NUMBERS_LIMIT: u64 = 1 << 29;

/// How the numbers of an accessor may be stored.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Storage {
    /// `f32`, or integers that stand for fractions.
    Fraction,
    /// `f32` or integers of 8 or 16 bits, fractions or not (`KHR_mesh_quantization`).
    Quantised,
    /// Unsigned integers.
    Index,
}

/// Reads accessors of one document and collects notices.
pub(super) struct Reader<'a> {
    pub document: &'a Document,
    pub notices: Vec<Notice>,
    bin: Option<&'a [u8]>,
    folder: &'a Path,
    /// Loaded when the first accessor asks, so that a missing image buffer does no harm.
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    bytes_held: u64,
    numbers_read: u64,
}

impl<'a> Reader<'a> {
    pub fn new(
        document: &'a Document,
        bin: Option<&'a [u8]>,
        folder: &'a Path,
        file_bytes: usize,
        notices: Vec<Notice>,
    ) -> Self {
        Self {
            document,
            notices,
            bin,
            folder,
            buffers: vec![None; document.buffers.len()],
            bytes_held: file_bytes as u64,
            numbers_read: 0,
        }
    }

    pub fn notice(&mut self, item: impl Into<String>, text: impl Into<String>) {
        self.notices
            .push(Notice::new(Place::Item(item.into()), text));
    }

    /// Counts `numbers` that are about to be allocated against what the file's size allows.
    pub fn charge(&mut self, numbers: u64, item: &str) -> Result<(), ImportError> {
        let limit =
            (self.bytes_held.saturating_mul(NUMBERS_PER_BYTE) + NUMBERS_FREE).min(NUMBERS_LIMIT);
        self.numbers_read = self.numbers_read.saturating_add(numbers);
        if self.numbers_read <= limit {
            return Ok(());
        }
        let kind = ImportErrorKind::TooMany {
            what: "numbers in all accessors".into(),
            count: self.numbers_read,
            limit,
        };
        Err(item_fault(kind, item))
    }

    /// All numbers of accessor `index`, element after element; every one is finite.
    ///
    /// `what` names the attribute in errors; `user` is the item that refers to the accessor.
    pub fn read(
        &mut self,
        index: usize,
        shape: Type,
        storage: Storage,
        what: &str,
        user: &str,
    ) -> Result<Vec<f64>, ImportError> {
        let document = self.document;
        checked(&document.accessors, index, "accessor", user)?;
        let accessor = &document.accessors[index];
        let item = format!("accessors[{index}]");
        let layout = Layout::of(accessor, shape, storage, what, &item)?;
        let count = accessor.count.0;
        let size = count.saturating_mul(layout.width as u64);

        let mut numbers = match accessor.buffer_view {
            // Section 3.6.2.1: without a buffer view all elements are zero.
            None => {
                self.charge(size, &item)?;
                vec![0.0; size as usize]
            }
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let numbers = self.elements(view.value(), offset, count, &layout, &item)?;
                self.charge(size, &item)?;
                numbers
            }
        };
        if accessor.sparse.is_some() {
            self.substitute(accessor, &layout, &mut numbers, &item)?;
        }
        if let Some(at) = numbers.iter().position(|number| !number.is_finite()) {
            let what = format!("{what} of element {}", at / layout.width);
            return Err(item_fault(ImportErrorKind::NotFinite { what }, item));
        }
        Ok(numbers)
    }

    /// The same as vectors.
    pub fn read_vectors(
        &mut self,
        index: usize,
        storage: Storage,
        what: &str,
        user: &str,
    ) -> Result<Vec<DVec3>, ImportError> {
        let numbers = self.read(index, Type::Vec3, storage, what, user)?;
        let (vectors, _) = numbers.as_chunks::<3>();
        Ok(vectors.iter().copied().map(DVec3::from_array).collect())
    }

    /// The same as indices.
    pub fn read_indices(
        &mut self,
        index: usize,
        shape: Type,
        what: &str,
        user: &str,
    ) -> Result<Vec<u32>, ImportError> {
        let numbers = self.read(index, shape, Storage::Index, what, user)?;
        Ok(numbers.into_iter().map(|number| number as u32).collect())
    }

    /// Overwrites the elements that a sparse accessor lists (section 3.6.2.3).
    fn substitute(
        &mut self,
        accessor: &Accessor,
        layout: &Layout,
        numbers: &mut [f64],
        item: &str,
    ) -> Result<(), ImportError> {
        let Some(sparse) = &accessor.sparse else {
            return Ok(());
        };
        let item = format!("{item}.sparse");
        let total = accessor.count.0;
        if sparse.count.0 > total {
            let kind = ImportErrorKind::OutOfRange {
                what: "count".into(),
                value: sparse.count.0.to_string(),
                expected: format!("at most {total}, the accessor's own"),
            };
            return Err(item_fault(kind, item));
        }
        let count = sparse.count.0;
        self.charge(count.saturating_mul(layout.width as u64 + 1), &item)?;

        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(item_fault(unknown("indices.componentType"), item));
        };
        let indices = Layout {
            component: component.0,
            normalised: false,
            width: 1,
        };
        let view = sparse.indices.buffer_view.value();
        let offset = sparse.indices.byte_offset.0;
        let places = self.elements(view, offset, count, &indices, &item)?;
        let view = sparse.values.buffer_view.value();
        let offset = sparse.values.byte_offset.0;
        let values = self.elements(view, offset, count, layout, &item)?;

        let mut next_free = 0.0;
        for (place, value) in places.iter().zip(values.chunks_exact(layout.width)) {
            if *place < next_free {
                let what = format!("index {place} comes after one that is not smaller");
                return Err(item_fault(ImportErrorKind::Contradiction { what }, item));
            }
            if *place >= total as f64 {
                let kind = ImportErrorKind::BadIndex {
                    what: "element".into(),
                    index: *place as i64,
                    count: total,
                };
                return Err(item_fault(kind, item));
            }
            let start = *place as usize * layout.width;
            numbers[start..start + layout.width].copy_from_slice(value);
            next_free = place + 1.0;
        }
        Ok(())
    }

    /// The numbers of `count` elements of a buffer view.
    ///
    /// Memory stays in proportion to the buffer: elements may not overlap.
    fn elements(
        &mut self,
        view_index: usize,
        offset: u64,
        count: u64,
        layout: &Layout,
        item: &str,
    ) -> Result<Vec<f64>, ImportError> {
        let document = self.document;
        checked(&document.views, view_index, "buffer view", item)?;
        let view = &document.views[view_index];
        let size = layout.bytes();
        let stride = match view.byte_stride {
            // Zero is written by some exporters and read as "none" by every reader.
            None | Some(Stride(0)) => size,
            Some(Stride(stride)) => stride,
        };
        if stride < size {
            let kind = ImportErrorKind::OutOfRange {
                what: format!("byteStride of bufferViews[{view_index}]"),
                value: stride.to_string(),
                expected: format!("at least {size}, the size of an element"),
            };
            return Err(item_fault(kind, item));
        }
        let Some(last) = count.checked_sub(1) else {
            return Ok(Vec::new());
        };
        let needed = last
            .saturating_mul(stride as u64)
            .saturating_add(size as u64)
            .saturating_add(offset);
        if needed > view.byte_length.0 {
            let kind = ImportErrorKind::Truncated {
                what: format!("bufferViews[{view_index}] (bytes)"),
                needed,
                found: view.byte_length.0,
            };
            return Err(item_fault(kind, item));
        }
        let bytes = &self.view(view_index)?[offset as usize..needed as usize];
        Ok(layout.decode(bytes, stride))
    }

    /// The bytes of a buffer view.
    fn view(&mut self, index: usize) -> Result<&[u8], ImportError> {
        let document = self.document;
        let view = &document.views[index];
        let item = format!("bufferViews[{index}]");
        let buffer = view.buffer.value();
        checked(&document.buffers, buffer, "buffer", &item)?;
        let loaded = match self.buffers[buffer].take() {
            Some(loaded) => loaded,
            None => {
                let loaded = buffer::load(&document.buffers[buffer], self.bin, self.folder)
                    .map_err(|kind| item_fault(kind, format!("buffers[{buffer}]")))?;
                if let Cow::Owned(bytes) = &loaded {
                    self.bytes_held += bytes.len() as u64;
                    // Many buffers may name one large file.
                    self.charge(bytes.len() as u64 / 8, &item)?;
                }
                loaded
            }
        };
        let loaded = self.buffers[buffer].insert(loaded);
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.saturating_add(view.byte_length.0);
        let found = loaded.len() as u64;
        if end > found {
            let kind = ImportErrorKind::Truncated {
                what: format!("buffers[{buffer}] (bytes)"),
                needed: end,
                found,
            };
            return Err(item_fault(kind, item));
        }
        Ok(&loaded[start as usize..end as usize])
    }
}

fn unknown(what: &str) -> ImportErrorKind {
    ImportErrorKind::OutOfRange {
        what: what.into(),
        value: "something else".into(),
        expected: "one of the values that the specification lists".into(),
    }
}

/// How one element lies in memory: `width` components one after another.
///
/// The padding of matrices with 8 and 16-bit columns never arises: the only matrices that the
/// reader asks for are 4 x 4.
struct Layout {
    component: ComponentType,
    normalised: bool,
    width: usize,
}

impl Layout {
    fn of(
        accessor: &Accessor,
        shape: Type,
        storage: Storage,
        what: &str,
        item: &str,
    ) -> Result<Self, ImportError> {
        let Checked::Valid(component) = accessor.component_type else {
            return Err(item_fault(unknown("componentType"), item));
        };
        if accessor.type_ != Checked::Valid(shape) {
            let found = match accessor.type_ {
                Checked::Valid(other) => format!("{other:?}"),
                Checked::Invalid => "unknown".into(),
            };
            let kind = ImportErrorKind::OutOfRange {
                what: format!("the type of {what}"),
                value: found,
                expected: format!("{shape:?}"),
            };
            return Err(item_fault(kind, item));
        }
        let (component, normalised) = (component.0, accessor.normalized);
        let (fits, expected) = match (storage, component) {
            (Storage::Fraction, ComponentType::F32) => (true, ""),
            (Storage::Fraction, _) => (normalised, "f32 or normalised integers"),
            (Storage::Quantised, ComponentType::U32) => (false, "f32 or 8 or 16-bit integers"),
            (Storage::Quantised, _) => (true, ""),
            (Storage::Index, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) => {
                (!normalised, "plain integers")
            }
            (Storage::Index, _) => (false, "unsigned integers"),
        };
        if !fits {
            let prefix = if normalised { "normalised " } else { "" };
            let kind = ImportErrorKind::OutOfRange {
                what: format!("the component type of {what}"),
                value: format!("{prefix}{component:?}"),
                expected: expected.into(),
            };
            return Err(item_fault(kind, item));
        }
        Ok(Self {
            component,
            normalised,
            width: shape.multiplicity(),
        })
    }

    fn bytes(&self) -> usize {
        self.component.size() * self.width
    }

    /// The numbers of elements that start `stride` bytes apart.
    fn decode(&self, bytes: &[u8], stride: usize) -> Vec<f64> {
        let size = self.component.size();
        let elements = bytes.chunks(stride);
        let components = elements.flat_map(|element| element[..self.bytes()].chunks_exact(size));
        components.map(|bytes| self.number(bytes)).collect()
    }

    /// One number; section 3.6.2.2 says how integers stand for fractions.
    fn number(&self, bytes: &[u8]) -> f64 {
        let (value, max) = match (self.component, bytes) {
            (ComponentType::I8, &[a]) => (f64::from(a as i8), 127.0),
            (ComponentType::U8, &[a]) => (f64::from(a), 255.0),
            (ComponentType::I16, &[a, b]) => (i16::from_le_bytes([a, b]).into(), 32_767.0),
            (ComponentType::U16, &[a, b]) => (u16::from_le_bytes([a, b]).into(), 65_535.0),
            (ComponentType::U32, &[a, b, c, d]) => {
                (u32::from_le_bytes([a, b, c, d]).into(), u32::MAX.into())
            }
            (ComponentType::F32, &[a, b, c, d]) => {
                return f32::from_le_bytes([a, b, c, d]).into();
            }
            _ => unreachable!("chunks are as long as the component"),
        };
        if self.normalised {
            (value / max).max(-1.0)
        } else {
            value
        }
    }
}
