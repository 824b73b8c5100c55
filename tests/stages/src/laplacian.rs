//! A surface that follows its joints as markers, solved or collapsed: the first clip of an asset
//! with such a surface, which a frame plays as it plays any other.

pub use crate::skin::run;
