//! Where rays meet a surface, which of its points lies nearest, which vertices are one, what lies
//! inside.

mod closest;
mod solid;
mod tree;
mod weld;

pub use closest::Nearest;
pub use solid::{Solid, face_outward};
pub use tree::{Hit, Tree};
pub use weld::weld;
