//! Surfaces driven by a handful of markers, without a skeleton (de Aguiar et al. 2007).

pub mod cholesky;
mod error;
pub mod operator;

pub use error::{Component, LaplaceError};
