//! `choose_factors`, `prior_bounds`.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{DelayMeasure, FactorChange, FactorsConfig, Pair};

use crate::error::to_py;
use crate::named::{self, named};
use crate::tracking::Evaluator;

/// An entry a pair of factors.
fn table<'py>(py: Python<'py>, entries: &[FactorChange]) -> PyResult<Bound<'py, PyDict>> {
    let whole = |of: fn(&FactorChange) -> usize| entries.iter().map(of).collect::<Vec<_>>();
    let real = |of: fn(&FactorChange) -> f64| entries.iter().map(of).collect::<Vec<_>>();
    named!(py, (); ; data_decimation: whole(|c| c.data_decimation),
        frequency_decimation: whole(|c| c.frequency_decimation), n_bins: whole(|c| c.n_bins),
        amplitude: real(|c| c.amplitude), delay: real(|c| c.delay))
}

fn measure(measure: DelayMeasure) -> &'static str {
    if measure == DelayMeasure::Phase { "phase" } else { "relative" }
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
) -> PyResult<Bound<'py, PyDict>> {
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
    named!(py, found; data_decimation, frequency_decimation, amplitude_bound, delay_bound;
        delay_measure: measure(found.measure), reference: named::tracking(py, &found.tracking)?,
        changes: table(py, &found.table)?)
}

/// Bounds of P alone, of Q alone, and in which measure.
#[pyfunction]
pub(crate) fn prior_bounds<'py>(
    py: Python<'py>,
    evaluator: &Evaluator,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let found = py
        .detach(|| {
            evaluator.with_state(|plan, state| {
                rthstrack::prior_bounds(plan, state, &Pair::new(target, measured, plan.rate_hz())?)
            })
        })
        .map_err(|e| to_py(py, &e))?;
    named!(py, (); ; data: table(py, &found.data)?, frequency: table(py, &found.frequency)?,
        measure: measure(found.measure))
}
