//! One call a frame: input in, vertices out, within a budget.

mod avatar;
mod budget;
mod buffers;
mod fingerprint;
#[cfg(feature = "laplacian")]
mod follow;
#[cfg(feature = "modes")]
mod mode;
mod parts_cost;
mod probe;
mod report;
mod rota;

pub use avatar::{Avatar, Input};
pub use budget::{Budget, Cost, cost, even_cost, mode_cost};
pub use buffers::{State, Workspace, any_mode_workspace_len, state_len, workspace_len};
pub use fingerprint::Fingerprint;
#[cfg(feature = "modes")]
pub use mode::ModeError;
pub use parts_cost::{follow_cost, parts_cost};
pub use report::{Flags, FrameReport};
pub use rota::{Due, Rota};
