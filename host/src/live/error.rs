//! What can be wrong with a stream.

use crate::fit::FitError;

/// A datagram that cannot be read, or a stream that cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// Fewer bytes than what they announce.
    #[error("byte {at}: the datagram ends inside {what}")]
    Short {
        /// Offset in the datagram.
        at: usize,
        /// What is cut off.
        what: &'static str,
    },
    /// Bytes that the protocol does not allow.
    #[error("byte {at}: {what}")]
    Malformed {
        /// Offset in the datagram.
        at: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A number that is not finite, or a quaternion without direction.
    #[error("{what} of {name:?} is no usable number")]
    NotFinite {
        /// Which.
        what: &'static str,
        /// Of what.
        name: String,
    },
    /// The actor's skeleton does not fit the body's.
    #[error("the stream's skeleton: {0}")]
    Fit(#[from] FitError),
    /// More points than a datagram holds.
    #[error("{count} points, where a datagram holds at most {limit}; send fewer")]
    TooMany {
        /// How many.
        count: usize,
        /// How many fit.
        limit: usize,
    },
}
