//! Where the bytes of a buffer lie: the binary chunk, a data URI or a file beside the glTF file.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::buffer::Buffer;
use percent_encoding::percent_decode_str;

use crate::import::ImportErrorKind;

/// Some exporters leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_allow_trailing_bits(true)
        .with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes of `buffer`, at least as many as it announces.
pub(super) fn load<'a>(
    buffer: &Buffer,
    bin: Option<&'a [u8]>,
    folder: &Path,
) -> Result<Cow<'a, [u8]>, ImportErrorKind> {
    let announced = buffer.byte_length.0;
    let bytes = match &buffer.uri {
        None => Cow::Borrowed(bin.ok_or_else(|| ImportErrorKind::Missing {
            what: "the binary chunk or a URI".into(),
        })?),
        Some(uri) => Cow::Owned(match strip_scheme(uri, "data:") {
            Some(data) => decode_data(data)?,
            None => read_file(&inside(uri, folder)?, announced)?,
        }),
    };
    if (bytes.len() as u64) < announced {
        return Err(ImportErrorKind::Truncated {
            what: "the buffer".into(),
            needed: announced,
            found: bytes.len() as u64,
        });
    }
    Ok(bytes)
}

fn strip_scheme<'u>(uri: &'u str, scheme: &str) -> Option<&'u str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme)
        .then(|| &uri[scheme.len()..])
}

/// Decodes what follows `data:` (RFC 2397).
fn decode_data(data: &str) -> Result<Vec<u8>, ImportErrorKind> {
    let (head, payload) = data
        .split_once(',')
        .ok_or_else(|| ImportErrorKind::Missing {
            what: "the comma of a data URI".into(),
        })?;
    if !head.to_ascii_lowercase().ends_with(";base64") {
        let what = format!("a data URI that is not base64 ({head:?})");
        return Err(ImportErrorKind::Unsupported { what });
    }
    let payload: Cow<'_, [u8]> = percent_decode_str(payload).into();
    BASE64
        .decode(payload)
        .map_err(|error| ImportErrorKind::NotThisFormat {
            expected: "base64",
            found: error.to_string(),
        })
}

/// The path that a relative URI names, if it lies in `folder` or below.
///
/// Dots are resolved in the text, so that no link on the way can change their meaning.
fn inside(uri: &str, folder: &Path) -> Result<PathBuf, ImportErrorKind> {
    let refuse = |why: &str| ImportErrorKind::Unsupported {
        what: format!("the buffer URI {uri:?}, which {why},"),
    };
    let scheme = uri.split(['/', '\\']).next().unwrap_or_default();
    // This holds for web addresses and for Windows drive letters alike.
    if scheme.contains(':') {
        return Err(refuse("is no relative path"));
    }
    let decoded = percent_decode_str(uri).decode_utf8();
    let decoded = decoded.map_err(|_| refuse("is not UTF-8"))?;
    if decoded.starts_with(['/', '\\']) {
        return Err(refuse("is an absolute path"));
    }
    let mut parts = Vec::new();
    for part in decoded.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => {
                if parts.pop().is_none() {
                    return Err(refuse("leaves the file's folder"));
                }
            }
            // An encoded colon could still name a drive or an alternate stream.
            _ if part.contains(':') => return Err(refuse("is no relative path")),
            _ => parts.push(part),
        }
    }
    Ok(parts.iter().fold(folder.to_owned(), |path, p| path.join(p)))
}

fn read_file(path: &Path, announced: u64) -> Result<Vec<u8>, ImportErrorKind> {
    let io = |error: std::io::Error| ImportErrorKind::Io(format!("{}: {error}", path.display()));
    // A pipe or device would block or never end.
    if !path.metadata().map_err(io)?.is_file() {
        return Err(ImportErrorKind::Io(format!(
            "{}: not a regular file",
            path.display()
        )));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(io)?;
    file.take(announced).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_decode_with_and_without_padding() {
        let plain = decode_data("application/octet-stream;base64,AAECAw==").unwrap();
        assert_eq!(plain, [0, 1, 2, 3]);
        assert_eq!(decode_data(";base64,AAECAw").unwrap(), [0, 1, 2, 3]);
        assert_eq!(strip_scheme("DATA:;base64,", "data:"), Some(";base64,"));
        let text = decode_data("text/plain,hello").unwrap_err();
        assert!(matches!(text, ImportErrorKind::Unsupported { .. }));
        let garbage = decode_data(";base64,A$==").unwrap_err();
        assert!(matches!(garbage, ImportErrorKind::NotThisFormat { .. }));
        let comma = decode_data(";base64").unwrap_err();
        assert!(matches!(comma, ImportErrorKind::Missing { .. }));
    }

    #[test]
    fn relative_paths_stay_inside() {
        let folder = Path::new("base");
        let path = |uri| inside(uri, folder).unwrap();
        assert_eq!(path("a.bin"), Path::new("base/a.bin"));
        assert_eq!(
            path("./sub/../my%20data.bin"),
            Path::new("base/my data.bin")
        );
        assert_eq!(path("sub\\a.bin"), Path::new("base/sub/a.bin"));
        for uri in [
            "../a.bin",
            "sub/../../a.bin",
            "%2e%2e/a.bin",
            "%2e%2e%2fa.bin",
            "/etc/passwd",
            "%2Fetc/passwd",
            "\\\\server\\share",
            "C:\\a.bin",
            "C%3A/a.bin",
            "https://example.org/a.bin",
            "file:///a.bin",
            "%FF.bin",
        ] {
            let error = inside(uri, folder).unwrap_err();
            assert!(
                matches!(error, ImportErrorKind::Unsupported { .. }),
                "{uri}"
            );
        }
    }
}
