//! `evaluate_moving`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{MovingConfig, Pair};

use crate::error::to_py;
use crate::tracking::Settings;

/// time_s, amplitude, phase_rad, delay_s, equivalent_frequency_hz, valid
type Arrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
);

#[pyfunction]
pub(crate) fn evaluate_moving<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    window_s: f64,
    hop_s: f64,
    minimum_std_ratio: f64,
    settings: Settings,
) -> PyResult<Arrays<'py>> {
    let config = MovingConfig { window_s, hop_s, minimum_std_ratio, evaluator: settings.config(py)? };
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let moving = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::evaluate_moving(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    Ok((
        moving.time_s.into_pyarray(py),
        moving.amplitude.into_pyarray(py),
        moving.phase_rad.into_pyarray(py),
        moving.delay_s.into_pyarray(py),
        moving.equivalent_frequency_hz.into_pyarray(py),
        moving.valid.into_pyarray(py),
    ))
}
