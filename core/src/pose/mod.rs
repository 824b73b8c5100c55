//! From a clip or a caller's pose to joint matrices.
//!
//! [`sample`] turns a clip and a time into local transforms, [`to_model`] chains them down the
//! hierarchy, [`palette`] relates them to the bind pose. [`rotations`] and [`duals`] find what modes
//! other than linear blending need besides. Each works alone, over slices.

mod dual;
mod local;
mod model;

pub use dual::{Dual17, duals, rotations};
pub use local::{
    Local, Transform, accept, accept_morphs, rest, rest_morphs, sample, sample_morphs,
};
pub use model::{Joint12, palette, to_model};
