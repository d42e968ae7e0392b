//! The on-line monitor.

#![forbid(unsafe_code)]

pub mod alarm;
pub mod json;
pub mod layout;
pub mod line;
pub mod sequence;
