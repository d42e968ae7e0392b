//! `frequency_response`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{Detrend, Pair, ResponseConfig, Window};

use crate::error::{choice, to_py};

/// frequency_hz, gain, phase_rad, delay_s, coherence, target_psd, measured_psd
type Arrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// The arrays, n_segments and segment_s.
#[pyfunction]
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    segment_s: Option<f64>,
    overlap: f64,
    window: &str,
    detrend: &str,
) -> PyResult<(Arrays<'py>, usize, f64)> {
    let config = ResponseConfig {
        segment_s,
        overlap,
        window: choice(py, "window", &Window::NAMES, window)?,
        detrend: choice(py, "detrend", &Detrend::NAMES, detrend)?,
    };
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let response = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::frequency_response(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let arrays = (
        response.frequency_hz.into_pyarray(py),
        response.gain.into_pyarray(py),
        response.phase_rad.into_pyarray(py),
        response.delay_s.into_pyarray(py),
        response.coherence.into_pyarray(py),
        response.target_psd.into_pyarray(py),
        response.measured_psd.into_pyarray(py),
    );
    Ok((arrays, response.n_segments, response.segment_s))
}
