//! `frequency_response` and `frequency_slopes`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{Detrend, Pair, ResponseConfig, Slope, SlopesConfig, Window};

use crate::error::{choice, to_py};

type Array<'py> = Bound<'py, PyArray1<f64>>;

/// Low and high, a row a frequency.
type Interval<'py> = Bound<'py, PyArray2<f64>>;

/// frequency_hz, gain, phase_rad, delay_s, coherence, target_psd, measured_psd
type Curves<'py> = (Array<'py>, Array<'py>, Array<'py>, Array<'py>, Array<'py>, Array<'py>, Array<'py>);

/// gain_std, gain_interval, delay_std_s, delay_interval_s
type Uncertainty<'py> = (Array<'py>, Interval<'py>, Array<'py>, Interval<'py>);

/// segment_s, overlap, window, detrend, align_s, dispersion
type Settings<'a> = (Option<f64>, f64, &'a str, &'a str, Option<f64>, bool);

fn config(py: Python<'_>, settings: Settings<'_>) -> PyResult<ResponseConfig> {
    let (segment_s, overlap, window, detrend, align_s, dispersion) = settings;
    Ok(ResponseConfig {
        segment_s,
        overlap,
        window: choice(py, "window", &Window::NAMES, window)?,
        detrend: choice(py, "detrend", &Detrend::NAMES, detrend)?,
        align_s,
        dispersion,
    })
}

/// The curves, their uncertainty, n_segments, segment_s, align_s and why it is 0 where it was to be found.
#[pyfunction]
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Settings<'_>,
) -> PyResult<(Curves<'py>, Uncertainty<'py>, usize, f64, f64, String)> {
    let config = config(py, settings)?;
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let response = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::frequency_response(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let curves = (
        response.frequency_hz.into_pyarray(py),
        response.gain.into_pyarray(py),
        response.phase_rad.into_pyarray(py),
        response.delay_s.into_pyarray(py),
        response.coherence.into_pyarray(py),
        response.target_psd.into_pyarray(py),
        response.measured_psd.into_pyarray(py),
    );
    let uncertainty = (
        response.gain_std.into_pyarray(py),
        interval(py, response.gain_interval)?,
        response.delay_std_s.into_pyarray(py),
        interval(py, response.delay_interval_s)?,
    );
    let why = response.unaligned.map_or_else(String::new, |why| why.to_string());
    Ok((curves, uncertainty, response.n_segments, response.segment_s, response.align_s, why))
}

fn interval(py: Python<'_>, rows: Vec<[f64; 2]>) -> PyResult<Interval<'_>> {
    let n_rows = rows.len();
    numpy::PyArrayMethods::reshape(&rows.into_flattened().into_pyarray(py), [n_rows, 2])
}

/// value, std, interval, slope, slope_std, slope_interval, misfit, varies
type SlopeNumbers = (f64, f64, (f64, f64), f64, f64, (f64, f64), f64, bool);

/// equivalent_frequency_hz, gain, delay, band_hz, n_bins, align_s, dispersion, n_segments, segment_s
type SlopesNumbers = (f64, SlopeNumbers, SlopeNumbers, (f64, f64), usize, f64, bool, usize, f64);

#[pyfunction]
pub(crate) fn frequency_slopes<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    band_hz: Option<(f64, f64)>,
    keep_alignment: bool,
    settings: Settings<'_>,
) -> PyResult<SlopesNumbers> {
    let config = SlopesConfig { response: config(py, settings)?, band_hz, keep_alignment };
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let found = py
        .detach(|| Pair::new(target, measured, rate_hz).and_then(|pair| rthstrack::frequency_slopes(&pair, &config)))
        .map_err(|e| to_py(py, &e))?;
    let numbers = |s: &Slope| {
        (s.value, s.std, s.interval.into(), s.slope, s.slope_std, s.slope_interval.into(), s.misfit, s.varies)
    };
    Ok((
        found.equivalent_frequency_hz,
        numbers(&found.gain),
        numbers(&found.delay),
        found.band_hz,
        found.n_bins,
        found.align_s,
        found.dispersion,
        found.n_segments,
        found.segment_s,
    ))
}
