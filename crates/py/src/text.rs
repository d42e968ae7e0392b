//! `rthstrack-text` as Python sees it.

use numpy::IntoPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack_text::Values;

/// Reads delimited text from its bytes.
///
/// Returns a dict: `columns`, a list of (index, name or None, unit or None, kind, values), with kind "numbers" and
/// values float64 (n_rows,), kind "stamps" (seconds of the day) or "dates" (since 1970) and values int64 nanoseconds
/// (n_rows,) with the least int64 for an empty cell, or kind "text" and values the number of cells that are not
/// empty; `preamble`, the lines above the numbers; `delimiter`, `decimal_comma`, `encoding`; `notes`.
/// Raises ValueError, one line, where the bytes are not such text.
#[pyfunction]
fn read_text<'py>(py: Python<'py>, content: &[u8]) -> PyResult<Bound<'py, PyDict>> {
    let table =
        py.detach(|| rthstrack_text::read(content)).map_err(|error| PyValueError::new_err(error.to_string()))?;
    let mut columns = Vec::with_capacity(table.columns.len());
    for column in table.columns {
        let (kind, values) = match column.values {
            Values::Numbers(numbers) => ("numbers", numbers.into_pyarray(py).into_any()),
            Values::Stamps { ns, dated: false } => ("stamps", ns.into_pyarray(py).into_any()),
            Values::Stamps { ns, dated: true } => ("dates", ns.into_pyarray(py).into_any()),
            Values::Text { n_entries } => ("text", n_entries.into_pyobject(py)?.into_any()),
        };
        columns.push((column.index, column.name, column.unit, kind, values));
    }
    let result = PyDict::new(py);
    result.set_item("columns", columns)?;
    result.set_item("preamble", table.preamble)?;
    result.set_item("delimiter", table.delimiter.name())?;
    result.set_item("decimal_comma", table.decimal_comma)?;
    result.set_item("encoding", table.encoding.name())?;
    result.set_item("notes", table.notes)?;
    Ok(result)
}

/// What a unit measures and how many of SI's are in one, or None for a text that is no known unit.
#[pyfunction]
fn unit(text: &str) -> Option<(&'static str, f64)> {
    rthstrack_text::unit(text).map(|unit| (unit.quantity.name(), unit.si))
}

/// Whether letters behind an underscore in a name are a unit, as they are written.
#[pyfunction]
fn is_unit_suffix(text: &str) -> bool {
    rthstrack_text::is_unit_suffix(text)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(read_text, module)?)?;
    module.add_function(wrap_pyfunction!(unit, module)?)?;
    module.add_function(wrap_pyfunction!(is_unit_suffix, module)?)
}
