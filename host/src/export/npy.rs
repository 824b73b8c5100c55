//! NumPy `.npy` arrays: a streaming float32 writer and a small reader.
//!
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

use std::io::Write;
use std::path::Path;

use super::atomic::AtomicFile;
use super::error::{ExportError, ExportErrorKind};
use crate::import::{ImportError, ImportErrorKind, Place};

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Writes a float32 little-endian array in C order, piece by piece, in constant memory.
///
/// The file appears only in [`NpyWriter::finish`], complete.
pub struct NpyWriter {
    file: AtomicFile,
    expected: u64,
    written: u64,
    bytes: Vec<u8>,
}

impl NpyWriter {
    /// Opens `path` for an array of `shape`, slowest axis first (`[frames, vertices, 3]`).
    ///
    /// # Errors
    /// The file cannot be created, or the product of the sizes exceeds 64 bits.
    pub fn create(path: impl AsRef<Path>, shape: &[usize]) -> Result<Self, ExportError> {
        let expected = shape
            .iter()
            .try_fold(1u64, |count, &size| count.checked_mul(size as u64))
            .ok_or_else(|| {
                ExportErrorKind::OutOfRange {
                    what: "the array's size".into(),
                    value: format!("{shape:?}"),
                    expected: "below 2^64 values".into(),
                }
                .at(&path)
            })?;
        let mut file = AtomicFile::create(path)?;
        if let Err(error) = file.write_all(&header(shape)) {
            return Err(ExportErrorKind::from(error).at(file.path()));
        }
        Ok(Self {
            file,
            expected,
            written: 0,
            bytes: Vec::new(),
        })
    }

    /// Appends finite values in C order; any number of values at a time.
    ///
    /// # Errors
    /// A value is NaN or infinite, more values come than the shape holds, or the disk refuses.
    pub fn push(&mut self, values: &[f32]) -> Result<(), ExportError> {
        self.append(values, f32::is_finite)
    }

    /// Appends values in C order, where NaN stands for a gap.
    ///
    /// # Errors
    /// A value is infinite, more values come than the shape holds, or the disk refuses.
    pub fn push_with_gaps(&mut self, values: &[f32]) -> Result<(), ExportError> {
        self.append(values, |value| !value.is_infinite())
    }

    fn append(&mut self, values: &[f32], allowed: fn(f32) -> bool) -> Result<(), ExportError> {
        if let Some(index) = values.iter().position(|&value| !allowed(value)) {
            let what = format!("value {}", self.written + index as u64);
            return Err(ExportErrorKind::NotFinite { what }.at(self.file.path()));
        }
        self.written += values.len() as u64;
        if self.written > self.expected {
            return Err(self.count_error());
        }
        self.bytes.clear();
        self.bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self.file
            .write_all(&self.bytes)
            .map_err(|error| ExportErrorKind::from(error).at(self.file.path()))
    }

    /// Publishes the file.
    ///
    /// # Errors
    /// Fewer values came than the shape holds, or the disk refuses; then no file is left.
    pub fn finish(self) -> Result<(), ExportError> {
        if self.written != self.expected {
            return Err(self.count_error());
        }
        self.file.commit()
    }

    fn count_error(&self) -> ExportError {
        ExportErrorKind::SizeMismatch {
            what: "values".into(),
            expected: self.expected,
            found: self.written,
        }
        .at(self.file.path())
    }
}

/// Magic, version 1.0, and the dictionary padded so that the data starts at a multiple of 64.
///
/// Version 1.0 counts the dictionary in 16 bits; a shape would need thousands of axes to exceed it.
fn header(shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut text = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sizes.join(", ")
    );
    let unpadded = MAGIC.len() + 4 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

/// An array read from a `.npy` file.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyArray {
    /// Slowest axis first.
    pub shape: Vec<usize>,
    /// In C order, widened to f64.
    pub values: Vec<f64>,
}

/// Reads a float32 or float64, little-endian, C-order array (format versions 1 to 3).
///
/// `file` is the name that errors carry.
///
/// # Errors
/// Another format or element type, Fortran order, or a length that contradicts the shape.
pub fn parse_npy(bytes: &[u8], file: &str) -> Result<NpyArray, ImportError> {
    parse(bytes).map_err(|kind| kind.at(file, Place::File))
}

fn parse(bytes: &[u8]) -> Result<NpyArray, ImportErrorKind> {
    let wrong = |found: &str| ImportErrorKind::NotThisFormat {
        expected: "a .npy array",
        found: found.to_owned(),
    };
    if bytes.is_empty() {
        return Err(ImportErrorKind::Empty);
    }
    if !bytes.starts_with(MAGIC) {
        return Err(wrong("the first six bytes are not \\x93NUMPY"));
    }
    let cut = || ImportErrorKind::Truncated {
        what: "the header".into(),
        needed: 12,
        found: bytes.len() as u64,
    };
    let (start, length): (usize, usize) = match bytes.get(6).ok_or_else(cut)? {
        1 => {
            let size = bytes.get(8..10).ok_or_else(cut)?;
            (10, usize::from(u16::from_le_bytes([size[0], size[1]])))
        }
        2 | 3 => {
            let size = bytes.get(8..12).ok_or_else(cut)?;
            (12, u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize)
        }
        other => {
            return Err(ImportErrorKind::Unsupported {
                what: format!(".npy version {other}"),
            });
        }
    };
    let text = bytes.get(start..start.saturating_add(length)).ok_or_else(cut)?;
    let text = std::str::from_utf8(text).map_err(|_| wrong("the header is not text"))?;
    let entry = |key: &str| {
        let quoted = format!("'{key}':");
        text.split_once(&quoted).map(|(_, rest)| rest.trim_start()).ok_or_else(|| {
            ImportErrorKind::Missing {
                what: format!("{key} in the header"),
            }
        })
    };
    let wide = match entry("descr")?.get(..5) {
        Some("'<f4'") => false,
        Some("'<f8'") => true,
        _ => {
            return Err(ImportErrorKind::Unsupported {
                what: "an element type other than <f4 and <f8".into(),
            });
        }
    };
    if !entry("fortran_order")?.starts_with("False") {
        return Err(ImportErrorKind::Unsupported {
            what: "Fortran order".into(),
        });
    }
    let sizes = entry("shape")?.strip_prefix('(').and_then(|rest| rest.split_once(')'));
    let (sizes, _) = sizes.ok_or_else(|| wrong("the shape is not a tuple"))?;
    let mut shape = Vec::new();
    for size in sizes.split(',').map(str::trim).filter(|size| !size.is_empty()) {
        shape.push(size.parse().map_err(|_| ImportErrorKind::BadNumber {
            what: "a size of the array".into(),
            text: size.to_owned(),
        })?);
    }
    let data = &bytes[start + length..];
    let width = if wide { 8 } else { 4 };
    let needed = shape
        .iter()
        .try_fold(width as u64, |count, &size: &usize| count.checked_mul(size as u64))
        .unwrap_or(u64::MAX);
    if needed != data.len() as u64 {
        return Err(ImportErrorKind::Truncated {
            what: format!("the data of shape {shape:?}"),
            needed,
            found: data.len() as u64,
        });
    }
    let values = if wide {
        let numbers = data.as_chunks().0.iter();
        numbers.map(|&bytes| f64::from_le_bytes(bytes)).collect()
    } else {
        let numbers = data.as_chunks().0.iter();
        numbers.map(|&bytes| f64::from(f32::from_le_bytes(bytes))).collect()
    };
    Ok(NpyArray { shape, values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::test_folder::TestFolder;

    #[test]
    fn header_is_what_numpy_writes() {
        let bytes = header(&[2, 3]);
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }";
        assert_eq!(&bytes[10..10 + text.len()], text.as_bytes());
        assert!(bytes[10 + text.len()..127].iter().all(|&byte| byte == b' '));
        assert_eq!((bytes.len(), bytes[127]), (128, b'\n'));
        assert!(String::from_utf8_lossy(&header(&[5])).contains("(5,), }"));
        assert!(String::from_utf8_lossy(&header(&[])).contains("(), }"));
    }

    #[test]
    fn pieces_come_back_whole() {
        let folder = TestFolder::new();
        let path = folder.path("a.npy");
        let mut writer = NpyWriter::create(&path, &[2, 2, 1]).unwrap();
        writer.push(&[1.0, -2.5]).unwrap();
        writer.push(&[]).unwrap();
        writer.push_with_gaps(&[f32::NAN, 4.0]).unwrap();
        assert_eq!(folder.names().len(), 1);
        assert!(!path.exists(), "nothing under the final name before finish");
        writer.finish().unwrap();
        let array = parse_npy(&std::fs::read(&path).unwrap(), "a.npy").unwrap();
        assert_eq!(array.shape, [2, 2, 1]);
        assert_eq!(array.values[..2], [1.0, -2.5]);
        assert!(array.values[2].is_nan());
        assert_eq!(array.values[3], 4.0);
    }

    #[test]
    fn wrong_counts_and_infinities_are_refused_and_leave_nothing() {
        let folder = TestFolder::new();
        let path = folder.path("a.npy");
        let mut writer = NpyWriter::create(&path, &[3]).unwrap();
        writer.push(&[1.0]).unwrap();
        let error = writer.push(&[0.0, f32::NAN]).unwrap_err();
        let what = "value 2".to_owned();
        assert_eq!(error.kind, ExportErrorKind::NotFinite { what });
        assert!(writer.push_with_gaps(&[f32::INFINITY]).is_err());
        let mismatch = |found| ExportErrorKind::SizeMismatch {
            what: "values".into(),
            expected: 3,
            found,
        };
        assert_eq!(writer.finish().unwrap_err().kind, mismatch(1));
        let mut writer = NpyWriter::create(&path, &[3]).unwrap();
        assert_eq!(writer.push(&[0.0; 4]).unwrap_err().kind, mismatch(4));
        drop(writer);
        assert!(folder.names().is_empty());
        assert!(NpyWriter::create(&path, &[usize::MAX, 3]).is_err());
    }

    #[test]
    fn reader_takes_f8_and_refuses_every_truncation() {
        let mut bytes = header(&[2]);
        let at = bytes.windows(3).position(|window| window == b"<f4").unwrap();
        bytes[at + 2] = b'8';
        bytes.extend(1.5f64.to_le_bytes());
        bytes.extend((-3.0f64).to_le_bytes());
        assert_eq!(parse_npy(&bytes, "x").unwrap().values, [1.5, -3.0]);
        for length in 0..bytes.len() {
            assert!(parse_npy(&bytes[..length], "x").is_err(), "{length}");
        }
        let fortran = String::from_utf8_lossy(&header(&[0])[10..]).replace("False", "True ");
        let mut bytes = header(&[0])[..10].to_vec();
        bytes.extend(fortran.as_bytes());
        let error = parse_npy(&bytes, "x").unwrap_err();
        assert!(matches!(error.kind, ImportErrorKind::Unsupported { .. }));
    }
}
