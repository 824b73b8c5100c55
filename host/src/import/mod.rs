//! Files in, `Raw…` values out.
//!
//! An importer reads one format, keeps what the file states, converts units and axes to the
//! host's (metres, radians, seconds, Y up) and refuses what it cannot read with an
//! [`ImportError`] that names the place and the remedy. What it repaired it says in a
//! [`Notice`]. Whether the parts agree with each other is checked once, in [`crate::model`].

mod bvh;
pub mod c3d;
mod error;
pub mod gltf;
pub mod marker_csv;
pub mod motive_csv;
mod obj;
mod ply;
mod raw;
mod select;
mod table;
pub mod take;
mod text;
pub mod trc;

pub use bvh::{BvhOptions, BvhPositions, read_bvh, read_bvh_with};
pub use error::{ImportError, ImportErrorKind, Notice, Place};
pub use obj::read_obj;
pub use ply::{read_ply, read_ply_points};
pub use raw::{
    Channel, Interpolation, RawAvatar, RawClip, RawJoint, RawMesh, RawMorph, RawMotion,
    RawPrimitive, RawSkeleton, RawSkin, RawTrack, Transform,
};
