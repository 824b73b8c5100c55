//! One call a frame: input in, vertices out, within a budget.

mod avatar;
mod budget;
mod buffers;
mod fingerprint;
mod follow;
mod probe;
mod report;

pub use avatar::{Avatar, Input, ModeError};
pub use budget::{Budget, Cost, cost, mode_cost};
pub use buffers::{State, Workspace, any_mode_workspace_len, state_len, workspace_len};
pub use fingerprint::Fingerprint;
pub use report::{Flags, FrameReport};
