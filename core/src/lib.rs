//! Real-time avatar runtime.
#![no_std]
#![forbid(unsafe_code)]
