//! Results by name: the one way from the core's structs to Python's dicts, and from many trackings to columns.

use num_complex::Complex;
use numpy::{Element, IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};
use rthstrack::{BadCount, BadFound, BadKind, Getter, NumberKind, Reason, Tracking};

/// A dict: `named!(py, found; a, b; c: value)` holds the fields a and b of `found`, and c.
macro_rules! named {
    ($py:expr, $found:expr; $($field:ident),* $(; $($name:ident: $value:expr),+)? $(,)?) => {{
        let dict = pyo3::types::PyDict::new($py);
        $(dict.set_item(pyo3::intern!($py, stringify!($field)), $crate::named::ToPy::to_py($found.$field, $py)?)?;)*
        $($(dict.set_item(pyo3::intern!($py, stringify!($name)), $crate::named::ToPy::to_py($value, $py)?)?;)+)?
        pyo3::PyResult::Ok(dict)
    }};
}
pub(crate) use named;

/// What a result is made of: vectors become arrays.
pub(crate) trait ToPy<'py> {
    fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>>;
}

macro_rules! plain {
    ($($type:ty),+) => {$(
        impl<'py> ToPy<'py> for $type {
            fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                Ok(self.into_pyobject(py)?.to_owned().into_any())
            }
        }
    )+};
}
plain!(f64, usize, bool, &str, String, Complex<f64>, (f64, f64), Vec<String>);

macro_rules! arrays {
    ($($type:ty),+) => {$(
        impl<'py> ToPy<'py> for Vec<$type> {
            fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                Ok(self.into_pyarray(py).into_any())
            }
        }
    )+};
}
arrays!(f64, usize, i64, bool, Complex<f64>);

impl<'py> ToPy<'py> for [f64; 2] {
    fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        <(f64, f64)>::from(self).to_py(py)
    }
}

/// A row a pair.
impl<'py, T: Element> ToPy<'py> for Vec<[T; 2]> {
    fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let n_rows = self.len();
        Ok(self.into_flattened().into_pyarray(py).reshape([n_rows, 2])?.into_any())
    }
}

impl<'py, T: ToPy<'py>> ToPy<'py> for Option<T> {
    fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.map_or_else(|| Ok(py.None().into_bound(py)), |value| value.to_py(py))
    }
}

/// What is Python's already.
impl<'py, T> ToPy<'py> for Bound<'py, T> {
    fn to_py(self, _: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.into_any())
    }
}

impl<'py> ToPy<'py> for Vec<Bound<'py, PyDict>> {
    fn to_py(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(PyList::new(py, self)?.into_any())
    }
}

/// The kinds of numbers, each with its name as Python keeps it.
fn kinds(py: Python<'_>) -> &'static [(Py<PyString>, NumberKind)] {
    static KINDS: PyOnceLock<Vec<(Py<PyString>, NumberKind)>> = PyOnceLock::new();
    KINDS.get_or_init(py, || {
        Tracking::NUMBERS.iter().map(|kind| (PyString::intern(py, kind.name).unbind(), *kind)).collect()
    })
}

/// The names of the numbers that live readings are written with.
pub(crate) fn live_numbers() -> Vec<&'static str> {
    Tracking::NUMBERS.iter().filter(|kind| kind.live).map(|kind| kind.name).collect()
}

/// One tracking: its `numbers` by name, and what else is known of it.
pub(crate) fn tracking<'py>(py: Python<'py>, t: &Tracking) -> PyResult<Bound<'py, PyDict>> {
    let numbers = PyDict::new(py);
    for (name, kind) in kinds(py) {
        match kind.of {
            Getter::Number(of) => numbers.set_item(name, of(t))?,
            Getter::Interval(of) => numbers.set_item(name, of(t))?,
        }
    }
    named!(py, t; fei; numbers: numbers, bad_samples: bad_samples(py, &t.bad_samples)?,
        reason: words(t.reason), reason_code: code(t.reason), reason_values: values(py, t.reason)?)
}

/// Many trackings: an array a number, those that live readings are written with or all.
pub(crate) fn columns<'a, 'py>(
    py: Python<'py>,
    each: impl Iterator<Item = &'a Tracking> + Clone,
    only_live: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let numbers = PyDict::new(py);
    for (name, kind) in kinds(py).iter().filter(|(_, kind)| kind.live || !only_live) {
        let each = each.clone();
        let column = match kind.of {
            Getter::Number(of) => each.map(of).collect::<Vec<_>>().to_py(py)?,
            Getter::Interval(of) => each.map(|t| of(t).into()).collect::<Vec<[f64; 2]>>().to_py(py)?,
        };
        numbers.set_item(name, column)?;
    }
    Ok(numbers)
}

/// Why there are no numbers or intervals: a list each of words, codes and values.
pub(crate) fn reasons<'a, 'py>(
    py: Python<'py>,
    each: impl Iterator<Item = &'a Tracking> + Clone,
) -> PyResult<[Bound<'py, PyAny>; 3]> {
    let reason = || each.clone().map(|t| t.reason);
    let told: Vec<Bound<'py, PyTuple>> = reason().map(|r| values(py, r)).collect::<PyResult<_>>()?;
    Ok([
        PyList::new(py, reason().map(words).collect::<Vec<_>>())?.into_any(),
        PyList::new(py, reason().map(code).collect::<Vec<_>>())?.into_any(),
        PyList::new(py, told)?.into_any(),
    ])
}

/// What was found, an entry a channel and kind.
pub(crate) fn bad_samples<'py>(py: Python<'py>, found: &BadFound) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let entry = |(channel, kind, bad): (usize, BadKind, BadCount)| {
        let whole = |n: u32| n as usize;
        named!(py, (); ; channel: ["target", "measured"][channel], kind: kind.code(), count: whole(bad.count),
            first: whole(bad.first), every: whole(bad.every))
    };
    found.iter().map(entry).collect()
}

/// A reason in words, nothing where there is none.
fn words(reason: Option<Reason>) -> String {
    reason.map_or_else(String::new, |reason| reason.to_string())
}

fn code(reason: Option<Reason>) -> &'static str {
    reason.map_or("", |reason| reason.kind().code)
}

fn values(py: Python<'_>, reason: Option<Reason>) -> PyResult<Bound<'_, PyTuple>> {
    PyTuple::new(py, reason.iter().flat_map(Reason::told).collect::<Vec<_>>())
}
