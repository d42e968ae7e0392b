//! `Live`: the on-line monitor. Settings come as dicts, text and arrays go back.

use std::time::Duration;

use numpy::{IntoPyArray, ndarray::Array2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use rthstrack::MonitorConfig;
use rthstrack_live::event::LogState;
use rthstrack_live::{LiveConfig, LiveError, LoggedReading};
use serde_json::{Map, Number, Value};

use crate::error::setting_error;
use crate::named::{self, named};
use crate::settings::read_all;

/// A setting of plain Python types. Numbers that JSON does not know stay in words, so that their mistake can be told.
fn value(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    if object.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(flag) = object.cast::<PyBool>() {
        return Ok(Value::Bool(flag.is_true()));
    }
    if let Ok(text) = object.cast::<PyString>() {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if object.is_instance_of::<PyInt>()
        && let Ok(number) = object.extract::<i64>()
    {
        return Ok(Value::from(number));
    }
    if object.is_instance_of::<PyInt>() || object.is_instance_of::<PyFloat>() {
        let number = object.extract::<f64>()?;
        return Ok(Number::from_f64(number).map_or_else(|| Value::String(number.to_string()), Value::Number));
    }
    if let Ok(dict) = object.cast::<PyDict>() {
        let mut map = Map::new();
        for (key, item) in dict {
            map.insert(key.extract()?, value(&item)?);
        }
        return Ok(Value::Object(map));
    }
    if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        return Ok(Value::Array(object.try_iter()?.map(|item| value(&item?)).collect::<PyResult<_>>()?));
    }
    // A path.
    if let Ok(path) = object.call_method0("__fspath__") {
        return value(&path);
    }
    Err(PyTypeError::new_err(format!("a setting cannot be a {}", object.get_type().name()?)))
}

fn to_py(py: Python<'_>, error: LiveError) -> PyErr {
    match error {
        LiveError::Settings(mistakes) => setting_error(py, mistakes.join("\n")),
        LiveError::System(error) => error.into(),
    }
}

/// The on-line monitor; its threads are Rust's and never wait for Python.
#[pyclass(frozen, module = "rthstrack._core")]
struct Live {
    run: rthstrack_live::Live,
}

#[pymethods]
impl Live {
    #[new]
    fn new(
        py: Python<'_>,
        monitor: &Bound<'_, PyDict>,
        source: &Bound<'_, PyDict>,
        alarms: &Bound<'_, PyDict>,
        outputs: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let monitor = read_all::<MonitorConfig>(monitor)?;
        let [source, alarms, outputs] = [value(source)?, value(alarms)?, value(outputs)?];
        let opened = py.detach(|| {
            let config = LiveConfig::read(monitor, &source, &alarms, &outputs).map_err(LiveError::Settings)?;
            rthstrack_live::Live::new(config)
        });
        Ok(Self { run: opened.map_err(|error| to_py(py, error))? })
    }

    fn start(&self, py: Python<'_>) -> PyResult<()> {
        Ok(py.detach(|| self.run.start())?)
    }

    fn stop(&self, py: Python<'_>) {
        py.detach(|| self.run.stop());
    }

    /// True when the run has ended.
    fn wait(&self, py: Python<'_>, timeout_s: f64) -> bool {
        // A year stands for ever; what is no number does not wait.
        let timeout = Duration::from_secs_f64(if timeout_s.is_nan() { 0.0 } else { timeout_s.clamp(0.0, 3e7) });
        py.detach(|| self.run.wait(timeout))
    }

    fn address(&self) -> &str {
        self.run.address()
    }

    fn control_address(&self) -> &str {
        self.run.control_address()
    }

    fn fatal(&self) -> Option<String> {
        self.run.fatal()
    }

    fn reset(&self) {
        self.run.reset();
    }

    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        self.run.summary().named().iter().try_for_each(|(name, count)| dict.set_item(name, count))?;
        Ok(dict)
    }

    fn alarmed(&self) -> bool {
        self.run.alarmed()
    }

    fn hello(&self) -> String {
        self.run.hello()
    }

    /// JSON of what is new since the cursor, and the next cursor.
    fn frame(&self, py: Python<'_>, cursor: u64) -> (String, u64) {
        py.detach(|| self.run.frame(cursor))
    }

    fn status(&self, py: Python<'_>) -> String {
        py.detach(|| self.run.status())
    }

    /// Drains the samples that wait for the log.
    fn take_samples<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = py.detach(|| self.run.take_samples());
        let shape = (columns.index.len(), self.run.n_actuators());
        let signal = |values| Array2::from_shape_vec(shape, values).expect("one sample a row").into_pyarray(py);
        let (target, measured) = (signal(columns.target), signal(columns.measured));
        named!(py, columns; index, time_s, counter, filled; target: target, measured: measured)
    }

    /// Drains the readings that wait for the log.
    fn take_readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let logged = py.detach(|| self.run.take_readings());
        let each = logged.iter().map(|r| &r.reading.tracking);
        let numbers = |of: fn(&LoggedReading) -> f64| logged.iter().map(of).collect::<Vec<f64>>();
        let whole = |of: fn(&LoggedReading) -> u64| logged.iter().map(|r| of(r) as i64).collect::<Vec<i64>>();
        let [reason, reason_code, reason_values] = named::reasons(py, each.clone())?;
        let dict = named!(py, (); ;
            index: whole(|r| r.reading.index), time_s: numbers(|r| r.reading.time_s),
            centre_s: numbers(|r| r.reading.centre_s), actuator: whole(|r| r.reading.actuator as u64),
            valid: logged.iter().map(|r| r.reading.is_valid()).collect::<Vec<_>>(),
            reason: reason, reason_code: reason_code, reason_values: reason_values,
            received: whole(|r| r.totals.tally.received), lost: whole(|r| r.totals.tally.lost),
            repeated: whole(|r| r.totals.tally.repeated), reordered: whole(|r| r.totals.tally.reordered),
            malformed: whole(|r| r.totals.malformed), alarms: logged.iter().map(|r| r.alarms.clone()).collect::<Vec<_>>())?;
        dict.update(named::columns(py, each, true)?.as_mapping())?;
        Ok(dict)
    }

    /// Where the log's writer stands, "writing" or "stopped" with the reason; None when there is no log.
    #[pyo3(signature = (state, why = None))]
    fn note_log(&self, state: Option<&str>, why: Option<String>) -> PyResult<()> {
        let state = match state {
            None => None,
            Some("writing") => Some(LogState::Writing),
            Some("stopped") => Some(LogState::Stopped(why.unwrap_or_default())),
            Some(other) => {
                return Err(PyValueError::new_err(format!("a log is 'writing' or 'stopped', not '{other}'")));
            }
        };
        self.run.note_log(state);
        Ok(())
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Live>()
}
