//! Where rays meet a surface, which of its points lies nearest, which vertices are one.

mod closest;
mod tree;
mod weld;

pub use closest::Nearest;
pub use tree::{Hit, Tree};
pub use weld::weld;
