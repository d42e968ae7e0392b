//! The binding: conversion only, one file per core module.

use pyo3::prelude::*;
use pyo3::types::PyTuple;

mod dynamics;
mod error;
mod factors;
mod indices;
mod key_frequencies;
mod live;
mod monitor;
mod moving;
mod named;
mod pool;
mod response;
mod settings;
mod signal;
mod text;
mod tracking;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("LIVE_NUMBERS", PyTuple::new(m.py(), named::live_numbers())?)?;
    m.add_function(wrap_pyfunction!(settings::settings_table, m)?)?;
    m.add_function(wrap_pyfunction!(settings::checked_settings, m)?)?;
    m.add_function(wrap_pyfunction!(settings::usual_detrend, m)?)?;
    m.add_class::<tracking::Evaluator>()?;
    m.add_function(wrap_pyfunction!(tracking::bridged, m)?)?;
    m.add_class::<key_frequencies::KeyFrequencies>()?;
    m.add_class::<monitor::Monitor>()?;
    m.add_function(wrap_pyfunction!(monitor::causal_decimate, m)?)?;
    m.add_function(wrap_pyfunction!(factors::choose_factors, m)?)?;
    m.add_function(wrap_pyfunction!(factors::prior_bounds, m)?)?;
    m.add_function(wrap_pyfunction!(moving::evaluate_moving, m)?)?;
    m.add_function(wrap_pyfunction!(response::frequency_response, m)?)?;
    m.add_function(wrap_pyfunction!(response::frequency_slopes, m)?)?;
    m.add_function(wrap_pyfunction!(indices::indices, m)?)?;
    m.add_function(wrap_pyfunction!(indices::index_histories, m)?)?;
    dynamics::register(m)?;
    text::register(m)?;
    live::register(m)?;
    Ok(())
}
