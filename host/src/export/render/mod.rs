//! A small software renderer for triangle meshes, markers and skeletons.
//!
//! In: borrowed positions (metres, Y up), triangles and colours in a [`Scene`], and a [`Camera`].
//! Out: an [`Image`]. The same scene gives the same pixels whatever the number of threads.
//!
//! Stages: `assemble` clips and projects triangles to fixed point; `raster` finds the nearest
//! triangle at every sample of a band of rows; `shade` lights it; `backdrop` supplies what
//! shows where there is none; `shadow_map` and `floor_shadow` say where light does not reach.

mod assemble;
mod backdrop;
mod camera;
mod draw;
mod floor_shadow;
mod image;
mod overlay;
mod raster;
mod scene;
mod shade;
mod shadow_map;
pub mod text;

pub use camera::{Bounds, Camera};
pub use draw::{render, render_on};
pub use image::{Image, Rgb};
pub use scene::{Colors, Floor, Lines, Mesh, Points, Quality, Scene};

#[cfg(test)]
mod tests;
