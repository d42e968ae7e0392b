//! Arrays in: one channel borrowed as it is, several actuators copied column by column.

use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The actuators of one argument, each a contiguous run of samples.
pub(crate) enum Columns<'a> {
    /// `(n_samples,)`, borrowed.
    One(&'a [f64]),
    /// `(n_samples, n_actuators)`, copied.
    Many(Vec<Vec<f64>>),
}

impl<'a> Columns<'a> {
    /// The Python layer has made the array C-contiguous float64.
    pub(crate) fn new(array: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<Self> {
        let flat = array.as_slice().map_err(|_| PyValueError::new_err("the array must be C-contiguous"))?;
        match *array.shape() {
            [_] => Ok(Columns::One(flat)),
            [_, n_actuators] => Ok(Columns::Many(
                (0..n_actuators).map(|a| flat.iter().skip(a).step_by(n_actuators).copied().collect()).collect(),
            )),
            _ => Err(PyValueError::new_err("the array must have one or two dimensions")),
        }
    }

    /// Number of actuators.
    pub(crate) fn len(&self) -> usize {
        match self {
            Columns::One(_) => 1,
            Columns::Many(columns) => columns.len(),
        }
    }

    /// Samples of one actuator.
    pub(crate) fn at(&self, actuator: usize) -> &[f64] {
        match self {
            Columns::One(samples) => samples,
            Columns::Many(columns) => &columns[actuator],
        }
    }
}
