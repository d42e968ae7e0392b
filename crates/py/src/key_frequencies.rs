//! `KeyFrequencies`: the choice, shared by threads; each call takes a state from the pool.

use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rthstrack::{KeyFrequenciesConfig, KeyFrequenciesState, Pair};

use crate::error::to_py;
use crate::tracking::{Numbers, Settings, numbers};

/// The bins of one target, and the plan to evaluate pairs at them.
#[pyclass(frozen, module = "rthstrack._core")]
pub(crate) struct KeyFrequencies {
    plan: rthstrack::KeyFrequencies,
    states: Mutex<Vec<KeyFrequenciesState>>,
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
        let config = KeyFrequenciesConfig { share, evaluator: settings.config(py)? };
        let target = target.as_slice()?;
        let plan = py.detach(|| rthstrack::KeyFrequencies::new(target, rate_hz, config)).map_err(|e| to_py(py, &e))?;
        Ok(Self { plan, states: Mutex::default() })
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

    fn evaluate(
        &self,
        py: Python<'_>,
        target: PyReadonlyArray1<'_, f64>,
        measured: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Numbers> {
        let (target, measured) = (target.as_slice()?, measured.as_slice()?);
        // A state holds nothing between calls, so one left by a panic is as good as new.
        let states = || self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let found = py.detach(|| {
            let mut state = states().pop().unwrap_or_else(|| self.plan.state());
            let found =
                Pair::new(target, measured, self.plan.rate_hz()).and_then(|pair| self.plan.evaluate(&mut state, &pair));
            states().push(state);
            found
        });
        found.map(|t| numbers(&t)).map_err(|e| to_py(py, &e))
    }
}
