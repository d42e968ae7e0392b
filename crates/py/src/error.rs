//! One function from the core's errors to the exceptions of `rthstrack.errors`.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyTuple, PyType};
use rthstrack::Error;

static SIGNAL_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static CONFIGURATION_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static SETTING_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// `SignalError` for what is wrong with the samples, `SettingError` for what is wrong with the settings.
pub(crate) fn to_py(py: Python<'_>, error: &Error) -> PyErr {
    with_message(py, error, error.to_string())
}

/// The same for one of several actuators, which the message names.
pub(crate) fn of_actuator(py: Python<'_>, actuator: usize, error: &Error) -> PyErr {
    with_message(py, error, format!("actuator {}: {error}", actuator + 1))
}

fn with_message(py: Python<'_>, error: &Error, message: String) -> PyErr {
    if let Error::Configuration(mistakes) = error {
        let pairs: Vec<(String, String)> = mistakes.iter().map(|m| (m.key.clone(), m.message.clone())).collect();
        let class = CONFIGURATION_ERROR.import(py, "rthstrack.errors", "ConfigurationError");
        return class.map_or_else(|e| e, |class| PyErr::from_type(class.clone(), ("", pairs)));
    }
    let class = match error {
        Error::Length { .. }
        | Error::TooShort { .. }
        | Error::NotFinite { .. }
        | Error::ConstantTarget { .. }
        | Error::Range { .. }
        | Error::NoEnergy
        | Error::FewBins { .. }
        | Error::TooShortForChebyshev { .. } => SIGNAL_ERROR.import(py, "rthstrack.errors", "SignalError"),
        _ => setting_class(py),
    };
    class.and_then(|class| told(class, &message, error)).unwrap_or_else(|e| e)
}

/// The exception, with its code and values.
fn told(class: &Bound<'_, PyType>, message: &str, error: &Error) -> PyResult<PyErr> {
    let exception = class.call1((message,))?;
    exception.setattr("code", error.code())?;
    exception.setattr("values", PyTuple::new(class.py(), error.values())?)?;
    Ok(PyErr::from_value(exception))
}

/// A `SettingError` for a name that is not one of the choices.
pub(crate) fn choice<T: Copy>(py: Python<'_>, setting: &str, names: &[(&str, T)], found: &str) -> PyResult<T> {
    if let Some((_, value)) = names.iter().find(|(name, _)| *name == found) {
        return Ok(*value);
    }
    let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
    Err(setting_error(py, format!("{setting} must be one of {}, not '{found}'", known.join(", "))))
}

/// A `SettingError` that says this.
pub(crate) fn setting_error(py: Python<'_>, message: String) -> PyErr {
    setting_class(py).map_or_else(|e| e, |class| PyErr::from_type(class.clone(), message))
}

fn setting_class(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    SETTING_ERROR.import(py, "rthstrack.errors", "SettingError")
}
