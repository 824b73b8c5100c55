//! Fits a motion to a body.
//!
//! In: a captured motion and the skeleton of a body. Out: a clip for that skeleton. The joints of
//! the two are matched ([`correspond`]), the motion is carried over by rotation alone
//! ([`retarget`](mod@retarget)), and the soles are put on the floor ([`floor`]).

pub mod correctives;
pub mod correspond;
pub mod cut;
mod error;
pub mod feet;
pub mod floor;
pub mod humanoid;
pub mod inside;
pub mod laplace;
pub mod live;
mod names;
pub mod parts;
pub mod register;
pub mod retarget;
pub mod rig;
pub mod rope;
pub mod segment;
pub mod solve;
pub mod weights;

pub use correspond::{Correspondence, Drive};
pub use error::{FitError, Which};
pub use humanoid::{Finger, Humanoid, Part, Role, Side};
pub use retarget::{Options, Reference, Retargeted, retarget, retarget_pose};
