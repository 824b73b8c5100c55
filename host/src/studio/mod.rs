//! Virtual captures: a known motion is filmed, disturbed and written down, and the truth is kept.

pub mod rope;
