//! `KeyFrequencies`: the choice, shared by threads; each call takes a state from the pool.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{KeyFrequenciesConfig, KeyFrequenciesState, Pair};

use crate::error::to_py;
use crate::named;
use crate::pool::Pool;
use crate::settings::Settings;

/// The bins of one target, and the plan to evaluate pairs at them.
#[pyclass(frozen, module = "rthstrack._core")]
pub(crate) struct KeyFrequencies {
    plan: rthstrack::KeyFrequencies,
    states: Pool<KeyFrequenciesState>,
}

#[pymethods]
impl KeyFrequencies {
    #[new]
    fn new(
        py: Python<'_>,
        target: PyReadonlyArray1<'_, f64>,
        rate_hz: f64,
        share: f64,
        settings: Settings,
    ) -> PyResult<Self> {
        let config = KeyFrequenciesConfig { share, evaluator: settings.0 };
        let target = target.as_slice()?;
        let plan = py.detach(|| rthstrack::KeyFrequencies::new(target, rate_hz, config)).map_err(|e| to_py(py, &e))?;
        Ok(Self { plan, states: Pool::new() })
    }

    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.plan.frequency_hz().into_pyarray(py)
    }

    #[getter]
    fn share_held(&self) -> f64 {
        self.plan.share_held()
    }

    #[getter]
    fn direct(&self) -> bool {
        self.plan.is_direct()
    }

    #[getter]
    fn delta_f_hz(&self) -> f64 {
        self.plan.delta_f_hz()
    }

    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArray1<'py, f64>,
        measured: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (target, measured) = (target.as_slice()?, measured.as_slice()?);
        let found = py.detach(|| {
            let pair = Pair::new(target, measured, self.plan.rate_hz())?;
            self.states.with(|| self.plan.state(), |state| self.plan.evaluate(state, &pair))
        });
        named::tracking(py, &found.map_err(|e| to_py(py, &e))?)
    }
}
