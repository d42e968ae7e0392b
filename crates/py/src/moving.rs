//! `evaluate_moving`.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{MovingConfig, Pair, Tracking};

use crate::error::to_py;
use crate::named::{self, named};
use crate::settings::Given;

#[pyfunction]
pub(crate) fn evaluate_moving<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Given<MovingConfig>,
) -> PyResult<Bound<'py, PyDict>> {
    let Given(config) = settings;
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let moving = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::evaluate_moving(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let each = moving.tracking.iter();
    let [reason, reason_code, reason_values] = named::reasons(py, each.clone())?;
    let valid: Vec<bool> = each.clone().map(Tracking::is_valid).collect();
    named!(py, moving; time_s; numbers: named::columns(py, each, false)?, valid: valid,
        bad_samples: named::bad_samples(py, &moving.bad_samples)?, reason: reason, reason_code: reason_code,
        reason_values: reason_values)
}
