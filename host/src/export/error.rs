//! What goes wrong while writing a file, and what to do about it.

use std::io;
use std::path::Path;

/// A file that could not be written. Nothing half-written is left behind.
///
/// Its text reads `FILE: what is wrong; what to do`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}: {kind}; {}", kind.remedy())]
pub struct ExportError {
    /// The file, as the caller named it.
    pub file: String,
    /// What is wrong.
    pub kind: ExportErrorKind,
}

/// The ways in which an export can fail. Each carries the facts.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportErrorKind {
    /// No room on the disk, or the user's quota is used up.
    #[error("the disk is full")]
    DiskFull,
    /// The folder the file should stand in.
    #[error("its folder does not exist")]
    NoFolder,
    /// A folder of this name is already there.
    #[error("this is a folder")]
    IsFolder,
    /// The user may not write there, or the file system is read-only.
    #[error("writing there is not permitted")]
    Permission,
    /// Anything else the operating system reports.
    #[error("cannot be written ({0})")]
    Io(String),
    /// NaN or infinity.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which value.
        what: String,
    },
    /// Nothing to write.
    #[error("there is no {what} to write")]
    Empty {
        /// What there should be at least one of.
        what: &'static str,
    },
    /// Two sizes that must agree.
    #[error("{what}: {expected} expected, {found} given")]
    SizeMismatch {
        /// What is counted.
        what: String,
        /// The count that was announced.
        expected: u64,
        /// The count that came.
        found: u64,
    },
    /// A value or size that the format cannot hold.
    #[error("{what} is {value}, which must be {expected}")]
    OutOfRange {
        /// Which value.
        what: String,
        /// What it is.
        value: String,
        /// What it may be.
        expected: String,
    },
}

impl ExportErrorKind {
    /// One sentence on what to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::DiskFull => "free some space, or write to another disk",
            Self::NoFolder => "create the folder first, or correct the path",
            Self::IsFolder => "name a file inside it",
            Self::Permission => "choose a folder that you may write to",
            Self::Io(_) => "check the path and the disk",
            Self::NotFinite { .. } => "repair the input: fill its gaps, remove NaN and infinity",
            Self::Empty { .. } => "check that the input has frames",
            Self::SizeMismatch { .. } => "every frame must have the announced size",
            Self::OutOfRange { .. } => "choose a value in that range",
        }
    }

    /// Attaches the file.
    #[must_use]
    pub fn at(self, file: impl AsRef<Path>) -> ExportError {
        ExportError {
            file: file.as_ref().display().to_string(),
            kind: self,
        }
    }
}

impl From<io::Error> for ExportErrorKind {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::StorageFull
            | io::ErrorKind::QuotaExceeded
            | io::ErrorKind::WriteZero => Self::DiskFull,
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Self::NoFolder,
            io::ErrorKind::IsADirectory => Self::IsFolder,
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => Self::Permission,
            _ => Self::Io(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_names_the_file_the_fault_and_the_remedy() {
        let error = ExportErrorKind::from(io::Error::from(io::ErrorKind::StorageFull)).at("a.npy");
        assert_eq!(
            error.to_string(),
            "a.npy: the disk is full; free some space, or write to another disk"
        );
        let error = ExportErrorKind::from(io::Error::from(io::ErrorKind::PermissionDenied)).at("b");
        assert_eq!(error.kind, ExportErrorKind::Permission);
    }
}
