//! One entry for every marker file format.

use std::path::Path;

use super::super::{ImportError, ImportErrorKind, Place, c3d, marker_csv, motive_csv, trc};
use super::{RawTake, TakeOptions};

/// The marker file formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakeFormat {
    /// C3D, binary.
    C3d,
    /// TRC of Motion Analysis and OpenSim, text.
    Trc,
    /// CSV export of OptiTrack Motive.
    MotiveCsv,
    /// A plain table: time, then three columns a marker.
    MarkerCsv,
}

impl TakeFormat {
    /// Tells the format from the first bytes, whatever the file is called.
    #[must_use]
    pub fn detect(content: &[u8]) -> Option<Self> {
        let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
        let begins = |text: &str| {
            content
                .get(..text.len())
                .is_some_and(|start| start.eq_ignore_ascii_case(text.as_bytes()))
        };
        if begins("PathFileType") {
            return Some(Self::Trc);
        }
        if begins("Format Version") || begins("\"Format Version") {
            return Some(Self::MotiveCsv);
        }
        let head = &content[..content.len().min(512)];
        let binary = head.contains(&0);
        let header = content.iter().position(|byte| *byte != 0).unwrap_or(0);
        if binary && content.get(header + 1) == Some(&0x50) {
            return Some(Self::C3d);
        }
        (!binary && head.contains(&b',')).then_some(Self::MarkerCsv)
    }

    /// The format that a file's name ending promises.
    #[must_use]
    pub fn from_extension(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match ending.as_str() {
            "c3d" => Self::C3d,
            "trc" => Self::Trc,
            "csv" => Self::MarkerCsv,
            _ => return None,
        })
    }
}

/// Reads a marker file of any supported format, told by its content, else by its name.
///
/// # Errors
/// The file cannot be opened, or what the reader of its format returns.
pub fn read_take(path: impl AsRef<Path>, options: &TakeOptions) -> Result<RawTake, ImportError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let content = std::fs::read(path)
        .map_err(|error| ImportErrorKind::Io(error.to_string()).at(&file, Place::File))?;
    if content.is_empty() {
        return Err(ImportErrorKind::Empty.at(&file, Place::File));
    }
    let format = TakeFormat::detect(&content).or_else(|| TakeFormat::from_extension(path));
    match format {
        Some(TakeFormat::C3d) => c3d::parse(&content, &file, options),
        Some(TakeFormat::Trc) => trc::parse(&content, &file, options),
        Some(TakeFormat::MotiveCsv) => motive_csv::parse(&content, &file, options),
        Some(TakeFormat::MarkerCsv) => marker_csv::parse(&content, &file, options),
        None => {
            let kind = ImportErrorKind::NotThisFormat {
                expected: "a marker file (C3D, TRC, Motive CSV or marker CSV)",
                found: "neither its content nor its name is known".into(),
            };
            Err(kind.at(&file, Place::File))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_content() {
        let c3d = [&[2, 0x50][..], &[0; 600]].concat();
        assert_eq!(TakeFormat::detect(&c3d), Some(TakeFormat::C3d));
        assert_eq!(
            TakeFormat::detect(&[&[0; 9][..], &c3d].concat()),
            Some(TakeFormat::C3d)
        );
        assert_eq!(
            TakeFormat::detect(b"\xef\xbb\xbfPathFileType\t4"),
            Some(TakeFormat::Trc)
        );
        assert_eq!(
            TakeFormat::detect(b"Format Version,1.23"),
            Some(TakeFormat::MotiveCsv)
        );
        assert_eq!(
            TakeFormat::detect(b"time,A_x,A_y,A_z\n"),
            Some(TakeFormat::MarkerCsv)
        );
        assert_eq!(TakeFormat::detect(b"HIERARCHY\n"), None);
        assert_eq!(TakeFormat::detect(b""), None);
        assert_eq!(
            TakeFormat::from_extension(Path::new("a/b.C3D")),
            Some(TakeFormat::C3d)
        );
        assert_eq!(TakeFormat::from_extension(Path::new("c3d")), None);
    }
}
