//! `Evaluator`: the plan, shared by threads; each call takes a state from the pool.

use num_complex::Complex;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use rthstrack::{BadCount, BadFound, BadKind, EvaluatorState, Pair, Reason, Spectra, Tracking};

use crate::error::{of_actuator, to_py};
use crate::pool::Pool;
use crate::settings::Settings;
use crate::signal::Columns;

/// amplitude, phase_rad, delay_s, equivalent_frequency_hz, fei
type Averaged = (f64, f64, f64, f64, Complex<f64>);
/// amplitude_std, amplitude_interval, delay_std_s, delay_interval_s, residual_coherence, goodness,
/// target_noise_std, bad samples, reason
type Precision = (f64, (f64, f64), f64, (f64, f64), f64, f64, f64, Vec<BadEntry>, String);
/// channel, kind, count, first, every
pub(crate) type BadEntry = (&'static str, &'static str, u32, u32, u32);
pub(crate) type Numbers = (Averaged, Precision);
/// frequency_hz, weights, target_spectrum, measured_spectrum
type SpectraArrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<Complex<f64>>>,
    Bound<'py, PyArray1<Complex<f64>>>,
);

pub(crate) fn numbers(t: &Tracking) -> Numbers {
    (
        (t.amplitude, t.phase_rad, t.delay_s, t.equivalent_frequency_hz, t.fei),
        (
            t.amplitude_std,
            t.amplitude_interval,
            t.delay_std_s,
            t.delay_interval_s,
            t.residual_coherence,
            t.goodness,
            t.target_noise,
            bad_entries(&t.bad_samples),
            words(t.reason.as_ref()),
        ),
    )
}

/// What was found, an entry a channel and kind.
pub(crate) fn bad_entries(found: &BadFound) -> Vec<BadEntry> {
    let entry = |(channel, kind, bad): (usize, BadKind, BadCount)| {
        (["target", "measured"][channel], kind.code(), bad.count, bad.first, bad.every)
    };
    found.iter().map(entry).collect()
}

/// A reason in words, nothing where there is none.
pub(crate) fn words(reason: Option<&Reason>) -> String {
    reason.map_or_else(String::new, Reason::to_string)
}

/// target, measured; and of each, from and to of what is bridged
type Bridged<'py> = ([Bound<'py, PyArray1<f64>>; 2], [Vec<(usize, usize)>; 2]);

/// Both signals with their bad samples bridged, and where; nothing where there are none.
#[pyfunction]
pub(crate) fn bridged<'py>(
    py: Python<'py>,
    target: PyReadonlyArray1<'py, f64>,
    measured: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
    settings: Settings,
) -> PyResult<Option<Bridged<'py>>> {
    let pair = Pair::new(target.as_slice()?, measured.as_slice()?, rate_hz).map_err(|e| to_py(py, &e))?;
    let found = rthstrack::bridged(&pair, &settings.0);
    Ok(found.map(|(signals, gaps)| {
        (signals.map(|s| s.into_pyarray(py)), gaps.map(|g| g.into_iter().map(|gap| (gap.start, gap.end)).collect()))
    }))
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

    /// One tuple of numbers an actuator.
    fn evaluate(
        &self,
        py: Python<'_>,
        target: PyReadonlyArrayDyn<'_, f64>,
        measured: PyReadonlyArrayDyn<'_, f64>,
    ) -> PyResult<Vec<Numbers>> {
        let found = self.each(py, &target, &measured, |state, pair| self.plan.evaluate(state, pair))?;
        Ok(found.iter().map(numbers).collect())
    }

    /// One tuple of numbers and one of arrays an actuator.
    fn evaluate_with_spectra<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArrayDyn<'py, f64>,
        measured: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Vec<(Numbers, SpectraArrays<'py>)>> {
        let found = self.each(py, &target, &measured, |state, pair| self.plan.evaluate_with_spectra(state, pair))?;
        Ok(found
            .into_iter()
            .map(|(tracking, Spectra { frequency_hz, weights, target, measured })| {
                let arrays = (
                    frequency_hz.into_pyarray(py),
                    weights.into_pyarray(py),
                    target.into_pyarray(py),
                    measured.into_pyarray(py),
                );
                (numbers(&tracking), arrays)
            })
            .collect())
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
