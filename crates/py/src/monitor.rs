//! `Monitor`: one stream, for one thread.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack::{CausalDecimator, MonitorConfig, MonitorState, Reading};

use crate::error::to_py;
use crate::named::{self, named};
use crate::settings::Given;

/// The plan and the state of one stream.
#[pyclass(module = "rthstrack._core")]
pub(crate) struct Monitor {
    plan: rthstrack::Monitor,
    state: MonitorState,
}

#[pymethods]
impl Monitor {
    #[new]
    fn new(py: Python<'_>, settings: Given<MonitorConfig>) -> PyResult<Self> {
        let plan = rthstrack::Monitor::new(settings.0).map_err(|e| to_py(py, &e))?;
        let state = plan.state();
        Ok(Self { plan, state })
    }

    #[getter]
    fn update_hz(&self) -> f64 {
        self.plan.update_hz()
    }

    #[getter]
    fn latency_s(&self) -> f64 {
        self.plan.latency_s()
    }

    #[getter]
    fn age_s(&self) -> f64 {
        self.plan.age_s()
    }

    #[getter]
    fn evaluated_rate_hz(&self) -> f64 {
        self.plan.evaluated_rate_hz()
    }

    #[getter]
    fn samples_until_reading(&self) -> usize {
        self.plan.samples_until_reading(&self.state)
    }

    #[getter]
    fn no_readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays(py, &[])
    }

    /// Takes arrays of shape (n_samples, n_actuators); None where they bring no reading.
    fn process<'py>(
        &mut self,
        py: Python<'py>,
        target: PyReadonlyArray2<'py, f64>,
        measured: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let n_samples = target.shape()[0];
        let (target, measured) = (target.as_slice()?, measured.as_slice()?);
        let Self { plan, state } = self;
        let readings = py.detach(|| {
            let mut readings = vec![Reading::EMPTY; plan.readings_in(state, n_samples)];
            plan.process(state, target, measured, &mut readings);
            readings
        });
        if readings.is_empty() { Ok(None) } else { arrays(py, &readings).map(Some) }
    }

    fn restart(&mut self, index: u64) {
        self.plan.restart(&mut self.state, index);
    }
}

/// The outputs of the causal decimator: output m speaks for sample m P + its delay, which is returned too.
#[pyfunction]
pub(crate) fn causal_decimate<'py>(
    py: Python<'py>,
    samples: PyReadonlyArray1<'py, f64>,
    data_decimation: usize,
) -> PyResult<(Bound<'py, PyArray1<f64>>, usize)> {
    let plan = CausalDecimator::new(data_decimation).map_err(|e| to_py(py, &e))?;
    let samples = samples.as_slice()?;
    Ok((py.detach(|| plan.process(samples)).into_pyarray(py), plan.delay()))
}

/// Readings as columns.
fn arrays<'py>(py: Python<'py>, readings: &[Reading]) -> PyResult<Bound<'py, PyDict>> {
    let each = readings.iter().map(|r| &r.tracking);
    let whole = |of: fn(&Reading) -> u64| readings.iter().map(|r| of(r) as i64).collect::<Vec<_>>();
    let numbers = |of: fn(&Reading) -> f64| readings.iter().map(of).collect::<Vec<_>>();
    let [reason, reason_code, reason_values] = named::reasons(py, each.clone())?;
    named!(py, (); ;
        index: whole(|r| r.index), time_s: numbers(|r| r.time_s), centre_s: numbers(|r| r.centre_s),
        actuator: whole(|r| r.actuator as u64), numbers: named::columns(py, each, false)?,
        valid: readings.iter().map(Reading::is_valid).collect::<Vec<_>>(),
        reason: reason, reason_code: reason_code, reason_values: reason_values)
}
