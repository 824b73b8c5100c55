//! What goes wrong while reading a file, and where.

use std::fmt;

/// A position inside the file that is at fault.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// The file as a whole.
    File,
    /// One-based line of a text file.
    Line(usize),
    /// Zero-based byte offset of a binary file.
    Byte(u64),
    /// A path of names inside a structured file, such as `meshes[0].primitives[2]`.
    Item(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ":{line}"),
            Self::Byte(offset) => write!(f, " at byte {offset}"),
            Self::Item(item) => write!(f, " in {item}"),
        }
    }
}

/// A file that cannot be used.
///
/// Its text reads `FILE:LINE: what is wrong; what to do`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{place}: {kind}; {}", kind.remedy())]
pub struct ImportError {
    /// The file, as the caller named it.
    pub file: String,
    /// Where in the file.
    pub place: Place,
    /// What is wrong.
    pub kind: ImportErrorKind,
}

/// The ways in which a file can be at fault. Each carries the facts.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImportErrorKind {
    /// The operating system refused.
    #[error("cannot be read ({0})")]
    Io(String),
    /// Nothing in it.
    #[error("the file is empty")]
    Empty,
    /// Some other format, or garbage.
    #[error("this is not {expected}: {found}")]
    NotThisFormat {
        /// The format that was expected.
        expected: &'static str,
        /// What stands there instead.
        found: String,
    },
    /// The file ends too early.
    #[error("the file ends inside {what}: {needed} needed, {found} there")]
    Truncated {
        /// What was being read.
        what: String,
        /// Count or bytes that the file announces.
        needed: u64,
        /// Count or bytes present.
        found: u64,
    },
    /// Text that should be a number.
    #[error("{text:?} is not a number ({what})")]
    BadNumber {
        /// What the number stands for.
        what: String,
        /// The text found.
        text: String,
    },
    /// NaN or infinity.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which value.
        what: String,
    },
    /// A number that is finite but makes no sense.
    #[error("{what} is {value}, which must be {expected}")]
    OutOfRange {
        /// Which value.
        what: String,
        /// What it is.
        value: String,
        /// What it may be.
        expected: String,
    },
    /// A reference to something that does not exist.
    #[error("{what} {index} does not exist: there are {count}")]
    BadIndex {
        /// What is referred to.
        what: String,
        /// The index, as the file states it.
        index: i64,
        /// How many there are.
        count: u64,
    },
    /// A header that asks for more than anything real needs.
    #[error("{what}: {count} announced, at most {limit} are accepted")]
    TooMany {
        /// What is counted.
        what: String,
        /// The announced count.
        count: u64,
        /// The limit.
        limit: u64,
    },
    /// Something that must be there is not.
    #[error("{what} is missing")]
    Missing {
        /// What is missing.
        what: String,
    },
    /// A block that is opened and never closed, or closed twice.
    #[error("{what} is never closed")]
    Unclosed {
        /// The block.
        what: String,
    },
    /// A parent chain that returns to itself.
    #[error("the hierarchy has a cycle through {joint:?}")]
    Cycle {
        /// A joint on the cycle.
        joint: String,
    },
    /// Two statements of the file that cannot both hold.
    #[error("contradiction: {what}")]
    Contradiction {
        /// Both statements.
        what: String,
    },
    /// Valid, but outside what this reader handles.
    #[error("{what} is not supported")]
    Unsupported {
        /// The feature.
        what: String,
    },
}

impl ImportErrorKind {
    /// One sentence on what to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Io(_) => "check the path and its permissions",
            Self::Empty => "export the file again",
            Self::NotThisFormat { .. } => "check the file's name ending, or export it again",
            Self::Truncated { .. } => "the file was cut short: copy or export it again",
            Self::BadNumber { .. } => "correct the value at that place",
            Self::NotFinite { .. } => "remove the NaN or infinite value, or export it again",
            Self::OutOfRange { .. } => "correct the value at that place",
            Self::BadIndex { .. } => "the file contradicts itself: export it again",
            Self::TooMany { .. } => "the header is damaged, or the file must be split",
            Self::Missing { .. } => "export the file again with it included",
            Self::Unclosed { .. } => "add the closing brace, or export the file again",
            Self::Cycle { .. } => "give every joint one parent that comes before it",
            Self::Contradiction { .. } => "correct one of the two, or export the file again",
            Self::Unsupported { .. } => "export the file without it",
        }
    }

    /// Attaches the file and the place.
    #[must_use]
    pub fn at(self, file: &str, place: Place) -> ImportError {
        ImportError {
            file: file.to_owned(),
            place,
            kind: self,
        }
    }
}

/// Something that was odd and has been put right, or left alone, without stopping.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// Where in the file.
    pub place: Place,
    /// What was found and what was done.
    pub text: String,
}

impl Notice {
    /// A notice about `place`.
    #[must_use]
    pub fn new(place: Place, text: impl Into<String>) -> Self {
        Self {
            place,
            text: text.into(),
        }
    }
}
