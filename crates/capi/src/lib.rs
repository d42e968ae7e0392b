//! C interface of rthstrack: the on-line monitor for real-time programs, and a virtual actuator to try it with.
//!
//! 1. `status`: what a call answers, and why a reading has no numbers.
//! 2. `config`, `reading`: what goes in, what comes out; laid out as C lays it out.
//! 3. [`monitor`], [`actuator`]: the opaque objects and their functions.
//! 4. `boundary`: pointers, messages and panics.
//!
//! `include/rthstrack.h` is made of these files; its test compares them. Types, constants and functions have their
//! names in C here too. Any change of a struct's layout, a constant or a function's meaning raises
//! [`RTHSTRACK_ABI_VERSION`].
//!
//! What holds for every function: no panic leaves it, none but `_create` and `_destroy` use the heap, none locks,
//! waits, logs or makes a system call.

#![allow(unsafe_code, non_camel_case_types)]
#![deny(unsafe_op_in_unsafe_fn, clippy::undocumented_unsafe_blocks)]
// What pointers must be is told once, in the header's preamble.
#![allow(clippy::missing_safety_doc)]

#[cfg(not(panic = "unwind"))]
compile_error!("a panic must become a status: build the C interface with panic = \"unwind\"");

mod boundary;

// In the order of the header, which the blank lines keep.
mod status;

mod config;

mod reading;

pub mod monitor;

pub mod actuator;

pub use config::{
    RTHSTRACK_ABI_VERSION, rthstrack_detrend, rthstrack_estimator, rthstrack_monitor_config,
    rthstrack_monitor_config_default, rthstrack_window,
};
pub use reading::rthstrack_reading;
pub use status::{rthstrack_reason, rthstrack_reason_text, rthstrack_status, rthstrack_status_text};

use std::ffi::{CStr, c_char};

const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => c"",
};

/// The interface that the library speaks. A program and a library fit together where this is RTHSTRACK_ABI_VERSION.
///
/// Any thread; real-time safe.
#[unsafe(no_mangle)]
pub extern "C" fn rthstrack_abi_version() -> u32 {
    RTHSTRACK_ABI_VERSION
}

/// The library's version, such as "0.1.0". The text is the library's and lives as long as it.
///
/// Any thread; real-time safe.
#[unsafe(no_mangle)]
pub extern "C" fn rthstrack_version() -> *const c_char {
    VERSION.as_ptr()
}
