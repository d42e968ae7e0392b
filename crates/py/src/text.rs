//! `rthstrack-text` as Python sees it.

use numpy::IntoPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rthstrack_text::{Part, Values};

/// Reads delimited text from its bytes.
///
/// Returns a dict: `columns`, a list of (index, name or None, unit or None, kind, values), with kind "numbers" and
/// values float64 (n_rows,), kind "stamps" (seconds of the day) or "dates" (since 1970) and values int64 nanoseconds
/// (n_rows,) with the least int64 for an empty cell, or kind "text" and values the number of cells that are not
/// empty; `preamble`, the lines above the numbers; `delimiter`, `decimal_comma`, `encoding`; `notes`, a list of (text,
/// code, values). `block` (from 1) and `lines` (first, last) choose a part.
/// Raises ValueError, one line and the number of the broken line or None, where the bytes are not such text.
#[pyfunction]
#[pyo3(signature = (content, block=None, lines=None))]
fn read_text<'py>(
    py: Python<'py>,
    content: &[u8],
    block: Option<usize>,
    lines: Option<(usize, usize)>,
) -> PyResult<Bound<'py, PyDict>> {
    let table = py
        .detach(|| rthstrack_text::read_part(content, Part { block, lines }))
        .map_err(|error| PyValueError::new_err((error.to_string(), error.line())))?;
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
    let notes: Vec<_> = table.notes.into_iter().map(|note| (note.text, note.code, note.values)).collect();
    result.set_item("notes", notes)?;
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
