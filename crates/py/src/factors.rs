//! `choose_factors`, `prior_bounds`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{DelayMeasure, FactorChange, FactorsConfig, Pair};

use crate::error::to_py;
use crate::tracking::{Evaluator, Numbers, numbers};

/// data_decimation, frequency_decimation, n_bins, amplitude, delay: an entry a pair of factors
type Table<'py> = (
    Bound<'py, PyArray1<usize>>,
    Bound<'py, PyArray1<usize>>,
    Bound<'py, PyArray1<usize>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);
/// P, Q, bounds of amplitude and delay, whether the delay is near zero, the evaluation compared with, all changes
type Choice<'py> = (usize, usize, f64, f64, bool, Numbers, Table<'py>);

fn table<'py>(py: Python<'py>, entries: &[FactorChange]) -> Table<'py> {
    let whole = |f: fn(&FactorChange) -> usize| entries.iter().map(f).collect::<Vec<_>>().into_pyarray(py);
    let real = |f: fn(&FactorChange) -> f64| entries.iter().map(f).collect::<Vec<_>>().into_pyarray(py);
    (
        whole(|c| c.data_decimation),
        whole(|c| c.frequency_decimation),
        whole(|c| c.n_bins),
        real(|c| c.amplitude),
        real(|c| c.delay),
    )
}

#[pyfunction]
pub(crate) fn choose_factors<'py>(
    py: Python<'py>,
    evaluator: &Evaluator,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    tolerance: f64,
    data_decimation: Option<usize>,
    frequency_decimation: Option<usize>,
) -> PyResult<Choice<'py>> {
    let config = FactorsConfig { tolerance, data_decimation, frequency_decimation };
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let found = py
        .detach(|| {
            evaluator.with_state(|plan, state| {
                let pair = Pair::new(target, measured, plan.rate_hz())?;
                rthstrack::choose_factors(plan, state, &pair, &config)
            })
        })
        .map_err(|e| to_py(py, &e))?;
    Ok((
        found.data_decimation,
        found.frequency_decimation,
        found.amplitude_bound,
        found.delay_bound,
        found.measure == DelayMeasure::Phase,
        numbers(&found.tracking),
        table(py, &found.table),
    ))
}

/// Bounds of P alone, of Q alone, and whether the delay is near zero.
#[pyfunction]
pub(crate) fn prior_bounds<'py>(
    py: Python<'py>,
    evaluator: &Evaluator,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
) -> PyResult<(Table<'py>, Table<'py>, bool)> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let found = py
        .detach(|| {
            evaluator.with_state(|plan, state| {
                rthstrack::prior_bounds(plan, state, &Pair::new(target, measured, plan.rate_hz())?)
            })
        })
        .map_err(|e| to_py(py, &e))?;
    Ok((table(py, &found.data), table(py, &found.frequency), found.measure == DelayMeasure::Phase))
}
