//! Bytes into JSON text and the binary chunk (glTF 2.0, section 4.4 "GLB File Format").

use super::fault;
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The parts of a file, still undecoded.
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    /// Where the JSON text starts in a binary file.
    pub json_offset: Option<u64>,
    pub bin: Option<&'a [u8]>,
}

/// Tells text from binary files by their first bytes and splits the latter.
pub(super) fn split<'a>(
    bytes: &'a [u8],
    notices: &mut Vec<Notice>,
) -> Result<Container<'a>, ImportError> {
    if bytes.is_empty() {
        return Err(fault(ImportErrorKind::Empty, Place::File));
    }
    if bytes.starts_with(MAGIC) || MAGIC.starts_with(bytes) {
        return split_binary(bytes, notices);
    }
    let json = match bytes.strip_prefix(b"\xEF\xBB\xBF") {
        Some(rest) => {
            notices.push(Notice::new(Place::Byte(0), "byte order mark skipped"));
            rest
        }
        None => bytes,
    };
    let first = json.iter().find(|byte| !byte.is_ascii_whitespace());
    if first == Some(&b'{') {
        return Ok(Container {
            json,
            json_offset: None,
            bin: None,
        });
    }
    let head = &bytes[..bytes.len().min(8)];
    let kind = ImportErrorKind::NotThisFormat {
        expected: "a glTF file, text or binary",
        found: format!("it starts with \"{}\"", head.escape_ascii()),
    };
    Err(fault(kind, Place::Byte(0)))
}

fn split_binary<'a>(
    bytes: &'a [u8],
    notices: &mut Vec<Notice>,
) -> Result<Container<'a>, ImportError> {
    let [_, version, length] = words(bytes, 0, "the GLB header")?;
    if version != 2 {
        let what = format!("GLB version {version}");
        return Err(fault(ImportErrorKind::Unsupported { what }, Place::Byte(4)));
    }
    let announced = length as usize;
    if announced > bytes.len() {
        return Err(truncated("the file", length.into(), bytes.len(), 8));
    }
    if announced < HEADER_BYTES + CHUNK_HEADER_BYTES {
        let kind = ImportErrorKind::OutOfRange {
            what: "the GLB length".into(),
            value: announced.to_string(),
            expected: "at least 20".into(),
        };
        return Err(fault(kind, Place::Byte(8)));
    }
    if announced < bytes.len() {
        let extra = bytes.len() - announced;
        let text = format!("{extra} bytes after the announced end ignored");
        notices.push(Notice::new(Place::Byte(length.into()), text));
    }
    let bytes = &bytes[..announced];

    let mut json = None;
    let mut bin = None;
    let mut at = HEADER_BYTES;
    while at < bytes.len() {
        let [chunk_length, chunk_type] = words(bytes, at, "a chunk header")?;
        let start = at + CHUNK_HEADER_BYTES;
        let rest = &bytes[start..];
        let Some(data) = rest.get(..chunk_length as usize) else {
            return Err(truncated("a chunk", chunk_length.into(), rest.len(), at));
        };
        match chunk_type {
            CHUNK_JSON if json.is_none() => json = Some((start, data)),
            CHUNK_BIN if bin.is_none() => bin = Some(data),
            // Section 4.4.3: unknown chunks are for extensions and must be skipped.
            _ => {
                let text = format!("chunk of type {chunk_type:#010x} skipped");
                notices.push(Notice::new(Place::Byte(at as u64), text));
            }
        }
        at = start + data.len();
    }
    let Some((start, json)) = json else {
        let what = "the JSON chunk".into();
        return Err(fault(ImportErrorKind::Missing { what }, Place::Byte(12)));
    };
    Ok(Container {
        json,
        json_offset: Some(start as u64),
        bin,
    })
}

/// `N` little-endian words at byte `at`.
fn words<const N: usize>(bytes: &[u8], at: usize, what: &str) -> Result<[u32; N], ImportError> {
    let rest = &bytes[at.min(bytes.len())..];
    if rest.len() < 4 * N {
        return Err(truncated(what, 4 * N as u64, rest.len(), at));
    }
    let (words, _) = rest.as_chunks::<4>();
    Ok(std::array::from_fn(|i| u32::from_le_bytes(words[i])))
}

fn truncated(what: &str, needed: u64, found: usize, at: usize) -> ImportError {
    let kind = ImportErrorKind::Truncated {
        what: what.into(),
        needed,
        found: found as u64,
    };
    fault(kind, Place::Byte(at as u64))
}
