//! Motion as it arrives over a network, frame by frame.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | [`osc`] | a datagram | Open Sound Control messages |
//! | [`vmc`] | messages | joint rotations of the Virtual Motion Capture protocol |
//! | [`points`] | a datagram | raw points of the project's own protocol |
//! | [`clock`] | sent and arrived | what is new, what is late; latencies |
//! | [`actor`] | joint rotations | a skeleton, poses of a body, a recorded motion |
//! | [`session`] | a socket | all of it, for a receiver |
//! | [`replay`] | a motion or a take | datagrams, and a network's faults if wanted |
//!
//! Nothing here trusts a datagram: what cannot be read is counted and dropped, what comes too late
//! is never shown as new.

pub mod actor;
pub mod clock;
mod error;
pub mod osc;
pub mod points;
pub mod replay;
pub mod session;
pub mod vmc;

pub use error::LiveError;

/// Largest datagram that UDP over IPv4 carries.
pub const LARGEST_DATAGRAM: usize = 65_507;
