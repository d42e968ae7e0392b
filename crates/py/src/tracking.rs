//! `Evaluator`: the plan, shared by threads; each call takes a state from the pool.

use numpy::{PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{EvaluatorState, Pair, Spectra};

use crate::error::{of_actuator, to_py};
use crate::named::{self, named};
use crate::pool::Pool;
use crate::settings::Settings;
use crate::signal::Columns;

/// Both signals with their bad samples bridged, and where; nothing where there are none.
#[pyfunction]
pub(crate) fn bridged<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Settings,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let pair = Pair::new(target.as_slice()?, measured.as_slice()?, rate_hz).map_err(|e| to_py(py, &e))?;
    let found = rthstrack::bridged(&pair, &settings.0);
    let Some(([target, measured], gaps)) = found else { return Ok(None) };
    let [target_gaps, measured_gaps] = gaps.map(|g| g.into_iter().map(|gap| [gap.start, gap.end]).collect::<Vec<_>>());
    named!(py, (); ; target: target, measured: measured, target_gaps: target_gaps, measured_gaps: measured_gaps)
        .map(Some)
}

/// The checked plan for records of one length and rate.
#[pyclass(frozen, module = "rthstrack._core")]
pub(crate) struct Evaluator {
    plan: rthstrack::Evaluator,
    states: Pool<EvaluatorState>,
}

#[pymethods]
impl Evaluator {
    #[new]
    fn new(py: Python<'_>, n_samples: usize, rate_hz: f64, settings: Settings) -> PyResult<Self> {
        let plan = rthstrack::Evaluator::new(n_samples, rate_hz, settings.0).map_err(|e| to_py(py, &e))?;
        Ok(Self { plan, states: Pool::new() })
    }

    #[getter]
    fn n_bins(&self) -> usize {
        self.plan.n_bins()
    }

    #[getter]
    fn delta_f_hz(&self) -> f64 {
        self.plan.delta_f_hz()
    }

    /// One tracking an actuator.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArrayDyn<'py, f64>,
        measured: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let found = self.each(py, &target, &measured, |state, pair| self.plan.evaluate(state, pair))?;
        found.iter().map(|tracking| named::tracking(py, tracking)).collect()
    }

    /// One tracking and its spectra an actuator.
    fn evaluate_with_spectra<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArrayDyn<'py, f64>,
        measured: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Vec<(Bound<'py, PyDict>, Bound<'py, PyDict>)>> {
        let found = self.each(py, &target, &measured, |state, pair| self.plan.evaluate_with_spectra(state, pair))?;
        let spectra =
            |s: Spectra| named!(py, s; frequency_hz, weights; target_spectrum: s.target, measured_spectrum: s.measured);
        found.into_iter().map(|(tracking, arrays)| Ok((named::tracking(py, &tracking)?, spectra(arrays)?))).collect()
    }
}

impl Evaluator {
    /// Runs `call` on each actuator's pair, without the interpreter's lock.
    fn each<T: Send>(
        &self,
        py: Python<'_>,
        target: &PyReadonlyArrayDyn<'_, f64>,
        measured: &PyReadonlyArrayDyn<'_, f64>,
        call: impl Fn(&mut EvaluatorState, &Pair<'_>) -> rthstrack::Result<T> + Sync,
    ) -> PyResult<Vec<T>> {
        let (target, measured) = (Columns::new(target)?, Columns::new(measured)?);
        let judge = |state: &mut EvaluatorState, a: usize| {
            call(state, &Pair::new(target.at(a), measured.at(a), self.plan.rate_hz())?)
        };
        let results: Result<Vec<T>, _> = py.detach(|| {
            self.with_state(|_, state| (0..target.len()).map(|a| judge(state, a).map_err(|e| (a, e))).collect())
        });
        results.map_err(|(actuator, error)| match target {
            Columns::One(_) => to_py(py, &error),
            Columns::Many(_) => of_actuator(py, actuator, &error),
        })
    }

    /// Calls with the plan and a state from the pool.
    pub(crate) fn with_state<T>(&self, call: impl FnOnce(&rthstrack::Evaluator, &mut EvaluatorState) -> T) -> T {
        self.states.with(|| self.plan.state(), |state| call(&self.plan, state))
    }
}
