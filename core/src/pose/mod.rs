//! From a clip or a caller's pose to joint matrices.
//!
//! [`sample`] turns a clip and a time into local transforms, [`to_model`] chains them down the
//! hierarchy, [`palette`] relates them to the bind pose. [`rotations`] and [`duals`] find what modes
//! other than linear blending need besides. [`crossfade`], [`add`], [`phase`], [`root_motion`] and
//! [`aim`] mix and change poses. Each works alone, over slices.

pub mod aim;
mod blend;
mod dual;
mod local;
mod model;
pub mod phase;
pub mod root_motion;

pub use blend::{add, crossfade, difference, mask_below};
pub use dual::{Dual17, duals, rotations};
pub use local::{
    Local, Transform, accept, accept_morphs, rest, rest_morphs, sample, sample_morphs,
};
pub use model::{Joint12, palette, to_model};
