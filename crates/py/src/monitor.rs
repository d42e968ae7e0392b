//! `Monitor`: one stream, for one thread.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rthstrack::{CausalDecimator, MonitorConfig, MonitorState, Reading, Tracking};

use crate::error::to_py;
use crate::settings::Given;
use crate::tracking::words;

type Numbers<'py> = Bound<'py, PyArray1<f64>>;
/// (n_readings, 2)
type Pairs<'py> = Bound<'py, PyArray2<f64>>;

/// index, actuator, valid; time_s, centre_s, amplitude, delay_s, phase_rad, equivalent_frequency_hz; amplitude_interval,
/// delay_interval_s, reason
type Arrays<'py> = (
    (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<bool>>),
    (Numbers<'py>, Numbers<'py>, Numbers<'py>, Numbers<'py>, Numbers<'py>, Numbers<'py>),
    (Pairs<'py>, Pairs<'py>, Vec<String>),
);

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

    /// Arrays of shape (n_samples, n_actuators).
    fn process<'py>(
        &mut self,
        py: Python<'py>,
        target: PyReadonlyArray2<'py, f64>,
        measured: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Arrays<'py>> {
        let n_samples = target.shape()[0];
        let (target, measured) = (target.as_slice()?, measured.as_slice()?);
        let Self { plan, state } = self;
        let readings = py.detach(|| {
            let mut readings = vec![Reading::EMPTY; plan.readings_in(state, n_samples)];
            plan.process(state, target, measured, &mut readings);
            readings
        });
        Ok(arrays(py, &readings))
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
) -> PyResult<(Numbers<'py>, usize)> {
    let plan = CausalDecimator::new(data_decimation).map_err(|e| to_py(py, &e))?;
    let samples = samples.as_slice()?;
    Ok((py.detach(|| plan.process(samples)).into_pyarray(py), plan.delay()))
}

/// Readings as columns.
fn arrays<'py>(py: Python<'py>, readings: &[Reading]) -> Arrays<'py> {
    let numbers = |of: fn(&Reading) -> f64| readings.iter().map(of).collect::<Vec<_>>().into_pyarray(py);
    let pairs = |of: fn(&Tracking) -> (f64, f64)| {
        let rows: Vec<[f64; 2]> = readings.iter().map(|r| of(&r.tracking)).map(|(low, high)| [low, high]).collect();
        numpy::ndarray::Array2::from(rows).into_pyarray(py)
    };
    (
        (
            readings.iter().map(|r| r.index as i64).collect::<Vec<_>>().into_pyarray(py),
            readings.iter().map(|r| r.actuator as i64).collect::<Vec<_>>().into_pyarray(py),
            readings.iter().map(Reading::is_valid).collect::<Vec<_>>().into_pyarray(py),
        ),
        (
            numbers(|r| r.time_s),
            numbers(|r| r.centre_s),
            numbers(|r| r.tracking.amplitude),
            numbers(|r| r.tracking.delay_s),
            numbers(|r| r.tracking.phase_rad),
            numbers(|r| r.tracking.equivalent_frequency_hz),
        ),
        (
            pairs(|t| t.amplitude_interval),
            pairs(|t| t.delay_interval_s),
            readings.iter().map(|r| words(r.tracking.reason.as_ref())).collect(),
        ),
    )
}
