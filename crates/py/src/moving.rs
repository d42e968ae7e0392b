//! `evaluate_moving`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{MovingConfig, Pair};

use crate::error::to_py;
use crate::settings::Given;
use crate::tracking::{BadEntry, bad_entries, words};

type Numbers<'py> = Bound<'py, PyArray1<f64>>;
/// (n_readings, 2)
type Pairs<'py> = Bound<'py, PyArray2<f64>>;

/// time_s, amplitude, phase_rad, delay_s, equivalent_frequency_hz, valid; amplitude_std, amplitude_interval, delay_std_s,
/// delay_interval_s, residual_coherence, goodness, target_noise_std, bad samples, reason
type Arrays<'py> = (
    (Numbers<'py>, Numbers<'py>, Numbers<'py>, Numbers<'py>, Numbers<'py>, Bound<'py, PyArray1<bool>>),
    (
        Numbers<'py>,
        Pairs<'py>,
        Numbers<'py>,
        Pairs<'py>,
        Numbers<'py>,
        Numbers<'py>,
        Numbers<'py>,
        Vec<BadEntry>,
        Vec<String>,
    ),
);

#[pyfunction]
pub(crate) fn evaluate_moving<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Given<MovingConfig>,
) -> PyResult<Arrays<'py>> {
    let Given(config) = settings;
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let moving = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::evaluate_moving(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let pairs = |of: Vec<(f64, f64)>| of.into_iter().map(|(low, high)| [low, high]).collect::<Vec<_>>();
    let pairs = |of| numpy::ndarray::Array2::from(pairs(of)).into_pyarray(py);
    Ok((
        (
            moving.time_s.into_pyarray(py),
            moving.amplitude.into_pyarray(py),
            moving.phase_rad.into_pyarray(py),
            moving.delay_s.into_pyarray(py),
            moving.equivalent_frequency_hz.into_pyarray(py),
            moving.valid.into_pyarray(py),
        ),
        (
            moving.amplitude_std.into_pyarray(py),
            pairs(moving.amplitude_interval),
            moving.delay_std_s.into_pyarray(py),
            pairs(moving.delay_interval_s),
            moving.residual_coherence.into_pyarray(py),
            moving.goodness.into_pyarray(py),
            moving.target_noise.into_pyarray(py),
            bad_entries(&moving.bad_samples),
            moving.reason.iter().map(|r| words(r.as_ref())).collect(),
        ),
    ))
}
