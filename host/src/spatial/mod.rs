//! Where rays meet a surface, which of its points lies nearest, which vertices are one, what lies
//! inside.

mod closest;
mod outward;
mod solid;
mod tree;
mod weld;

pub use closest::Nearest;
pub use outward::face_outward;
pub use solid::Solid;
pub use tree::{Hit, Tree};
pub use weld::weld;
