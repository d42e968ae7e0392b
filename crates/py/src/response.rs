//! `frequency_response` and `frequency_slopes`.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{Detrend, Pair, ResponseConfig, Slope, SlopesConfig, Window};

use crate::error::{choice, to_py};
use crate::named::named;

/// How segments are taken.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Settings {
    segment_s: Option<f64>,
    overlap: f64,
    window: String,
    detrend: String,
    align_s: Option<f64>,
    dispersion: bool,
}

fn config(py: Python<'_>, settings: Settings) -> PyResult<ResponseConfig> {
    let Settings { segment_s, overlap, window, detrend, align_s, dispersion } = settings;
    Ok(ResponseConfig {
        segment_s,
        overlap,
        window: choice(py, "window", &Window::NAMES, &window)?,
        detrend: choice(py, "detrend", &Detrend::NAMES, &detrend)?,
        align_s,
        dispersion,
    })
}

#[pyfunction]
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Settings,
) -> PyResult<Bound<'py, PyDict>> {
    let config = config(py, settings)?;
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let response = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::frequency_response(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let why = response.unaligned.map_or_else(String::new, |why| why.to_string());
    named!(py, response; frequency_hz, gain, phase_rad, delay_s, coherence, target_psd, measured_psd, gain_std,
        gain_interval, delay_std_s, delay_interval_s, n_segments, segment_s, align_s; unaligned: why)
}

#[pyfunction]
pub(crate) fn frequency_slopes<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    band_hz: Option<(f64, f64)>,
    keep_alignment: bool,
    settings: Settings,
) -> PyResult<Bound<'py, PyDict>> {
    let config = SlopesConfig { response: config(py, settings)?, band_hz, keep_alignment };
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let found = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::frequency_slopes(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let (gain, delay): (Slope, Slope) = (found.gain, found.delay);
    named!(py, found; equivalent_frequency_hz, band_hz, n_bins, align_s, dispersion, n_segments, segment_s;
        gain: gain.value, gain_std: gain.std, gain_interval: gain.interval, gain_per_hz: gain.slope,
        gain_per_hz_std: gain.slope_std, gain_per_hz_interval: gain.slope_interval, gain_misfit: gain.misfit,
        gain_varies: gain.varies, delay_s: delay.value, delay_std_s: delay.std, delay_interval_s: delay.interval,
        delay_s_per_hz: delay.slope, delay_s_per_hz_std: delay.slope_std,
        delay_s_per_hz_interval: delay.slope_interval, delay_misfit_s: delay.misfit, delay_varies: delay.varies)
}
