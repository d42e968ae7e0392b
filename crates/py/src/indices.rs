//! `indices` and `index_histories`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{IndexHistories, Indices, Pair};

use crate::error::to_py;

/// In the order of `rthstrack.Indices`.
type Numbers = (f64, f64, f64, f64, f64, f64, f64, f64, Option<f64>);
/// In the order of `rthstrack.IndexHistories`.
type Arrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Option<Bound<'py, PyArray1<f64>>>,
);

#[pyfunction]
pub(crate) fn indices(
    py: Python<'_>,
    target: PyReadonlyArray1<'_, f64>,
    measured: PyReadonlyArray1<'_, f64>,
    rate_hz: f64,
    force: Option<PyReadonlyArray1<'_, f64>>,
    max_lag_s: f64,
) -> PyResult<Numbers> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let force = force.as_ref().map(|f| f.as_slice()).transpose()?;
    let found = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::indices(&pair, force, max_lag_s)))
        .map_err(|e| to_py(py, &e))?;
    let Indices {
        max_tracking_error,
        max_tracking_error_percent,
        rms_error,
        rms_error_percent,
        tracking_indicator,
        j1_s,
        j2_percent,
        j3_percent,
        energy_error,
    } = found;
    Ok((
        max_tracking_error,
        max_tracking_error_percent,
        rms_error,
        rms_error_percent,
        tracking_indicator,
        j1_s,
        j2_percent,
        j3_percent,
        energy_error,
    ))
}

#[pyfunction]
pub(crate) fn index_histories<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    force: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Arrays<'py>> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let force = force.as_ref().map(|f| f.as_slice()).transpose()?;
    let IndexHistories { max_tracking_error, rms_error, tracking_indicator, energy_error } = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::index_histories(&pair, force)))
        .map_err(|e| to_py(py, &e))?;
    Ok((
        max_tracking_error.into_pyarray(py),
        rms_error.into_pyarray(py),
        tracking_indicator.into_pyarray(py),
        energy_error.map(|e| e.into_pyarray(py)),
    ))
}
