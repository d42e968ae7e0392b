//! `indices` and `index_histories`.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::Pair;

use crate::error::to_py;
use crate::named::named;

#[pyfunction]
pub(crate) fn indices<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    force: Option<PyReadonlyArray1<'py, f64>>,
    max_lag_s: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let force = force.as_ref().map(|f| f.as_slice()).transpose()?;
    let found = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::indices(&pair, force, max_lag_s)))
        .map_err(|e| to_py(py, &e))?;
    let dict = PyDict::new(py);
    found.named().try_for_each(|(name, index)| dict.set_item(name, index))?;
    Ok(dict)
}

#[pyfunction]
pub(crate) fn index_histories<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    force: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let force = force.as_ref().map(|f| f.as_slice()).transpose()?;
    let found = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::index_histories(&pair, force)))
        .map_err(|e| to_py(py, &e))?;
    named!(py, found; max_tracking_error, rms_error, tracking_indicator, energy_error)
}
