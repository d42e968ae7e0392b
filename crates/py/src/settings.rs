//! Settings from Python's objects: one table in the core says what there is and what each may be.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple};
use rthstrack::setting::{Configuration, Kind, Row, Value, concerns, read};
use rthstrack::{Error, EvaluatorConfig, MonitorConfig, MovingConfig};
use rthstrack_live::alarm::AlarmConfig;

use crate::error::to_py;

/// A value of plain Python types, or of NumPy's scalars.
fn value(object: &Bound<'_, PyAny>) -> Value {
    if object.is_none() {
        return Value::Nothing;
    }
    if let Ok(flag) = object.cast::<PyBool>() {
        return Value::Flag(flag.is_true());
    }
    if let Ok(text) = object.cast::<PyString>() {
        return Value::Text(text.to_string_lossy().into_owned());
    }
    // What stands for a whole number says so by __index__, whatever its type.
    if !object.is_instance_of::<PyFloat>()
        && let Ok(number) = object.extract::<i64>()
    {
        return Value::Whole(number);
    }
    if let Ok(number) = object.extract::<f64>() {
        return Value::Number(number);
    }
    if let Ok((low, high)) = pair(object) {
        return Value::Pair(low, high);
    }
    Value::Other(object.repr().map_or_else(|_| "something else".to_owned(), |text| text.to_string()))
}

fn pair(object: &Bound<'_, PyAny>) -> PyResult<(f64, f64)> {
    let mut items = object.try_iter()?;
    match (items.next(), items.next(), items.next()) {
        (Some(low), Some(high), None) => Ok((low?.extract()?, high?.extract()?)),
        _ => Err(PyValueError::new_err("not two")),
    }
}

/// A value as a plain Python object.
fn object<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Nothing => py.None().into_bound(py),
        Value::Flag(flag) => PyBool::new(py, *flag).to_owned().into_any(),
        Value::Whole(number) => number.into_pyobject(py)?.into_any(),
        Value::Number(number) => PyFloat::new(py, *number).into_any(),
        Value::Text(text) | Value::Other(text) => PyString::new(py, text).into_any(),
        Value::Pair(low, high) => PyTuple::new(py, [*low, *high])?.into_any(),
    })
}

/// A configuration from a mapping, or from the attributes of an object that has them all; and what is wrong with it.
pub(crate) fn read_all<C: Configuration>(given: &Bound<'_, PyAny>) -> PyResult<(C, Vec<Error>)> {
    let Ok(mapping) = given.cast::<PyMapping>() else {
        let named = |name: &'static str| Ok((name, value(&given.getattr(name)?)));
        return Ok(read(C::names().map(named).collect::<PyResult<Vec<_>>>()?));
    };
    let mut entries = Vec::new();
    for item in mapping.items()? {
        let (name, given): (String, Bound<'_, PyAny>) = item.extract()?;
        entries.push((name, value(&given)));
    }
    Ok(read(entries))
}

/// The same where the first mistake is told.
pub(crate) fn read_config<C: Configuration>(given: &Bound<'_, PyAny>) -> PyResult<C> {
    let (config, errors) = read_all::<C>(given)?;
    errors.first().map_or(Ok(config), |error| Err(to_py(given.py(), error)))
}

/// A configuration, as an argument.
pub(crate) struct Given<C>(pub(crate) C);

/// `rthstrack.Settings`.
pub(crate) type Settings = Given<EvaluatorConfig>;

impl<C: Configuration> FromPyObject<'_, '_> for Given<C> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        read_config(&object).map(Self)
    }
}

fn rows(py: Python<'_>, of: &str) -> PyResult<Vec<Row>> {
    match of {
        "evaluation" => Ok(EvaluatorConfig::rows()),
        "moving" => Ok(MovingConfig::rows()),
        "monitor" => Ok(MonitorConfig::rows()),
        "alarms" => Ok(AlarmConfig::rows()),
        _ => Err(to_py(
            py,
            &Error::UnknownSetting { name: of.to_owned(), known: "evaluation, moving, monitor, alarms".to_owned() },
        )),
    }
}

/// The table of settings of "evaluation", "moving", "monitor" or "alarms", a dict each.
#[pyfunction]
pub(crate) fn settings_table<'py>(py: Python<'py>, of: &str) -> PyResult<Bound<'py, PyList>> {
    let all = PyList::empty(py);
    for row in rows(py, of)? {
        let (kind, choices, least, most) = match row.kind {
            Kind::Choice(codes) => ("choice", codes, 0, 0),
            Kind::Flag => ("flag", &[][..], 0, 0),
            Kind::Whole(least, most) => ("whole", &[][..], least, most),
            Kind::PowerOfTwo => ("power_of_two", &[][..], 0, 0),
            Kind::Number => ("number", &[][..], 0, 0),
            Kind::Positive => ("positive", &[][..], 0, 0),
            Kind::NotNegative => ("not_negative", &[][..], 0, 0),
            Kind::Share => ("share", &[][..], 0, 0),
            Kind::Band => ("band", &[][..], 0, 0),
        };
        let dict = PyDict::new(py);
        dict.set_item("name", row.name)?;
        dict.set_item("kind", kind)?;
        dict.set_item("choices", choices)?;
        dict.set_item("least", least)?;
        dict.set_item("most", most)?;
        dict.set_item("optional", row.optional)?;
        dict.set_item("required", row.concerns & concerns::REQUIRED != 0)?;
        dict.set_item("in_study", row.concerns & concerns::STUDY != 0)?;
        dict.set_item("expected", row.kind.expected(row.unit))?;
        dict.set_item("unit", row.unit)?;
        dict.set_item("label", row.label)?;
        dict.set_item("help", &row.help)?;
        dict.set_item("default", object(py, &row.default)?)?;
        all.append(dict)?;
    }
    Ok(all)
}

/// The settings of "evaluation", "moving", "monitor" or "alarms" that are given by name, checked each by itself, of plain types.
#[pyfunction]
pub(crate) fn checked_settings<'py>(
    py: Python<'py>,
    of: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    match of {
        "evaluation" => checked::<EvaluatorConfig>(given),
        "moving" => checked::<MovingConfig>(given),
        "monitor" => checked::<MonitorConfig>(given),
        "alarms" => checked::<AlarmConfig>(given),
        _ => rows(py, of).map(|_| PyDict::new(py)),
    }
}

/// What is subtracted before the window with this estimator, where nothing is asked for.
#[pyfunction]
pub(crate) fn usual_detrend(py: Python<'_>, estimator: &str) -> PyResult<&'static str> {
    let mut config = EvaluatorConfig::default();
    config.set("estimator", &Value::Text(estimator.to_owned())).unwrap_or(Ok(())).map_err(|error| to_py(py, &error))?;
    Ok(config.detrending().code())
}

fn checked<'py, C: Configuration>(given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let py = given.py();
    let dict = PyDict::new(py);
    if let Ok(mapping) = given.cast::<PyMapping>() {
        let config = read_config::<C>(given)?;
        for name in C::names() {
            if mapping.contains(name)? {
                dict.set_item(name, object(py, &config.get(name).unwrap_or(Value::Nothing))?)?;
            }
        }
        return Ok(dict);
    }
    let mut config = C::default();
    for name in C::names() {
        let found = given.getattr(name)?;
        config.set(name, &value(&found)).unwrap_or(Ok(())).map_err(|error| to_py(py, &error))?;
        let kept = config.get(name).unwrap_or(Value::Nothing);
        if !is_plain(&found, &kept) {
            dict.set_item(name, object(py, &kept)?)?;
        }
    }
    Ok(dict)
}

/// Whether an object is of the plain type of its value already.
fn is_plain(object: &Bound<'_, PyAny>, value: &Value) -> bool {
    match value {
        Value::Nothing | Value::Flag(_) => true,
        Value::Whole(_) => object.is_exact_instance_of::<PyInt>(),
        Value::Number(_) => object.is_exact_instance_of::<PyFloat>(),
        Value::Text(_) => object.is_exact_instance_of::<PyString>(),
        Value::Pair(..) | Value::Other(_) => false,
    }
}
