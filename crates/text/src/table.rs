use crate::delimiter::Delimiter;
use crate::dialect::{self, Dialect, Kind};
use crate::encoding::{self, Encoding};
use crate::error::TextError;
use crate::header::{self, HeadLine, Header, column_name};
use crate::line::{Lines, after_end, field_end, fields, is_blank, is_end, uncommented, unquoted};
use crate::number;
use crate::stamp::{self, Order};

/// What stands in [`Values::Stamps`] for an empty cell.
pub const MISSING_STAMP: i64 = i64::MIN;

/// How many lines above the numbers are kept.
const PREAMBLE_LINES: usize = 5000;

/// A text file as columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The columns from left to right. All that hold numbers or stamps have `n_rows` of them.
    pub columns: Vec<Column>,
    /// The number of rows.
    pub n_rows: usize,
    /// The lines above the first row, names and units among them.
    pub preamble: Vec<String>,
    /// What stands between two fields.
    pub delimiter: Delimiter,
    /// Whether the decimal mark is a comma.
    pub decimal_comma: bool,
    /// How the file spells characters.
    pub encoding: Encoding,
    /// What was left out, each in one sentence.
    pub notes: Vec<String>,
}

/// One column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its place in the file, from 0.
    pub index: usize,
    /// Its name in the row of names.
    pub name: Option<String>,
    /// Its unit in the row of units.
    pub unit: Option<String>,
    /// What it holds.
    pub values: Values,
}

/// What a column holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers (n_rows,); an empty cell is NaN.
    Numbers(Vec<f64>),
    /// Points in time in nanoseconds (n_rows,), since 1970 where `dated`, since midnight otherwise; an empty cell is
    /// [`MISSING_STAMP`].
    Stamps {
        /// The points in time.
        ns: Vec<i64>,
        /// Whether they have a date.
        dated: bool,
    },
    /// Words, or dates without a time of day: how many cells are not empty.
    Text {
        /// Cells that are not empty.
        n_entries: usize,
    },
}

/// Reads a text file, given as its bytes.
///
/// # Errors
/// [`TextError`] if the bytes are not text, hold no rows of numbers, or a row is broken.
pub fn read(bytes: &[u8]) -> Result<Table, TextError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(TextError::Empty);
    }
    let (text, encoding) = encoding::decode(bytes)?;
    let text = &*text;
    if text.iter().all(u8::is_ascii_whitespace) {
        return Err(TextError::Empty);
    }
    let no_numbers = || TextError::NoNumbers { n_lines: Lines { bytes: text, at: 0 }.count() };
    let dialect = dialect::find(text).ok_or_else(no_numbers)?;
    let mut head: Vec<HeadLine<'_>> = Vec::new();
    let mut start = None;
    for (at, line) in (Lines { bytes: text, at: 0 }) {
        if !is_blank(line) && uncommented(line).is_none() && dialect.fits(line) {
            start = Some((at, HeadLine { number: head.len() + 1, bytes: line }));
            break;
        }
        head.push(HeadLine { number: head.len() + 1, bytes: line });
    }
    let (start, first) = start.ok_or_else(no_numbers)?;
    let mut header = header::read(&head, &first, &dialect)?;
    let mut notes: Vec<String> = header.note.take().into_iter().collect();
    let rows = Rows::read(text, start, &first, &dialect, &header, &mut notes)?;
    let preamble = head.iter().take(PREAMBLE_LINES).map(|line| encoding::text(line.bytes).into_owned()).collect();
    let n_rows = rows.n_rows;
    let columns = rows.into_columns(&first, header)?;
    Ok(Table {
        columns,
        n_rows,
        preamble,
        delimiter: dialect.delimiter,
        decimal_comma: dialect.point == b',',
        encoding,
        notes,
    })
}

/// A column while it is being read.
enum Sink {
    Numbers(Vec<f64>),
    Stamps {
        ns: Vec<i64>,
        dated: Option<bool>,
        timed: bool,
    },
    Text {
        n_entries: usize,
    },
    /// No entry in the sample. `values` ends at the last number; `n_fields` counts fields, empty ones too.
    Sparse {
        values: Vec<f64>,
        n_texts: usize,
        n_fields: usize,
    },
}

/// The field does not belong into its column.
enum Wrong {
    NotANumber,
    NotATime,
}

impl Sink {
    fn new(kind: Kind, n_rows: usize) -> Self {
        match kind {
            Kind::Number => Self::Numbers(Vec::with_capacity(n_rows)),
            Kind::Stamp => Self::Stamps { ns: Vec::with_capacity(n_rows), dated: None, timed: false },
            Kind::Text => Self::Text { n_entries: 0 },
            Kind::Nothing => Self::Sparse { values: Vec::new(), n_texts: 0, n_fields: 0 },
        }
    }

    /// Takes the field of row `row`, blanks around it taken off.
    fn take(&mut self, field: &[u8], row: usize, point: u8, order: Order) -> Result<(), Wrong> {
        let token = unquoted(field);
        match self {
            Self::Numbers(values) if token.is_empty() => values.push(f64::NAN),
            Self::Numbers(values) => values.push(number::parse(&token, point).ok_or(Wrong::NotANumber)?),
            Self::Stamps { ns, .. } if is_no_stamp(&token, point) => ns.push(MISSING_STAMP),
            Self::Stamps { ns, dated, timed } => {
                let stamp = stamp::parse(&token, order).ok_or(Wrong::NotATime)?;
                if *dated.get_or_insert(stamp.day.is_some()) != stamp.day.is_some() {
                    return Err(Wrong::NotATime);
                }
                *timed |= stamp.ns.is_some();
                ns.push(stamp.total_ns());
            }
            Self::Text { n_entries } => *n_entries += usize::from(!token.is_empty()),
            Self::Sparse { values, n_texts, n_fields } => {
                *n_fields += 1;
                if let Some(value) = number::parse(&token, point) {
                    values.resize(row, f64::NAN);
                    values.push(value);
                } else {
                    *n_texts += usize::from(!token.is_empty());
                }
            }
        }
        Ok(())
    }

    /// Takes back rows at the end.
    fn truncate(&mut self, n_rows: usize) {
        match self {
            Self::Numbers(values) | Self::Sparse { values, .. } => values.truncate(n_rows),
            Self::Stamps { ns, .. } => ns.truncate(n_rows),
            Self::Text { .. } => {}
        }
    }
}

/// An empty cell, or a word for a missing value.
fn is_no_stamp(token: &[u8], point: u8) -> bool {
    token.is_empty() || number::parse(token, point).is_some_and(f64::is_nan)
}

struct Rows {
    sinks: Vec<Sink>,
    n_rows: usize,
    /// How many columns an ordinary row has.
    n_usual: usize,
}

impl Rows {
    fn read(
        text: &[u8],
        start: usize,
        first: &HeadLine<'_>,
        dialect: &Dialect,
        header: &Header,
        notes: &mut Vec<String>,
    ) -> Result<Self, TextError> {
        let Dialect { delimiter, point, order, .. } = *dialect;
        let names = header.names.as_deref().unwrap_or_default();
        let n_columns = names.len().max(dialect.kinds.len());
        let n_required = dialect.n_required();
        let n_expected = expected_rows(&text[start..]);
        let kinds = dialect.kinds.iter().copied().chain(std::iter::repeat(Kind::Nothing));
        let mut sinks: Vec<Sink> = kinds.take(n_columns).map(|kind| Sink::new(kind, n_expected)).collect();
        let (mut n_rows, mut n_empty, mut n_comments) = (0usize, 0usize, 0usize);
        let blank = |byte: Option<&u8>| match byte {
            Some(b' ') => true,
            Some(b'\t') => delimiter != Delimiter::Tab,
            _ => false,
        };
        let mut at = start;
        let mut line = first.number;
        while at < text.len() {
            let line_start = at;
            while blank(text.get(at)) {
                at += 1;
            }
            match text.get(at) {
                None => break,
                Some(&b) if is_end(b) => {
                    at = after_end(text, at);
                    line += 1;
                    continue;
                }
                Some(b'#' | b'%' | b'/' | b'"' | 0x0c | 0x1a) => {
                    let end = line_end(text, at);
                    let whole = &text[line_start..end];
                    let comment = uncommented(whole).is_some() || is_remark(whole, delimiter, n_required);
                    if comment || is_blank(whole) {
                        n_comments += usize::from(comment);
                        at = after_end(text, end);
                        line += 1;
                        continue;
                    }
                }
                _ => {}
            }
            let mut ended = false;
            let mut empty = true;
            let ragged = |expected, column| {
                let whole = &text[line_start..line_end(text, line_start)];
                TextError::Ragged {
                    line,
                    expected,
                    found: fields(whole, delimiter).len(),
                    column: column_name(names, column),
                }
            };
            for (column, sink) in sinks.iter_mut().enumerate() {
                if !ended {
                    while blank(text.get(at)) {
                        at += 1;
                    }
                    ended = delimiter == Delimiter::Blanks && text.get(at).is_none_or(|&b| is_end(b));
                }
                if ended {
                    if column < n_required {
                        return Err(ragged(n_required, column));
                    }
                    break;
                }
                if let Sink::Numbers(values) = sink
                    && let Some((value, mut end)) = number::exact(text, at, point)
                {
                    while delimiter != Delimiter::Blanks && blank(text.get(end)) {
                        end += 1;
                    }
                    let over = text.get(end).is_none_or(|&b| is_end(b));
                    if over || delimiter.is(text[end]) {
                        values.push(value);
                        empty = false;
                        ended = over;
                        at = end + usize::from(!over);
                        continue;
                    }
                }
                let end = field_end(text, at, delimiter);
                let field = text[at..end].trim_ascii();
                empty &= field.is_empty();
                sink.take(field, n_rows, point, order).map_err(|wrong| {
                    let (column, found) = (column_name(names, column), encoding::shown(field));
                    match wrong {
                        Wrong::NotANumber => TextError::NotANumber { line, column, found },
                        Wrong::NotATime => TextError::NotATime { line, column, found },
                    }
                })?;
                ended = text.get(end).is_none_or(|&b| is_end(b));
                at = end + usize::from(!ended);
            }
            if !ended {
                let end = line_end(text, at);
                let rest = &text[at..end];
                if !rest.iter().all(|&b| b == b' ' || b == b'\t' || delimiter.is(b)) {
                    return Err(ragged(n_columns, n_columns.saturating_sub(1)));
                }
                at = end;
            }
            n_rows += 1;
            n_empty = if empty { n_empty + 1 } else { 0 };
            at = after_end(text, at);
            line += 1;
        }
        if n_empty > 0 {
            n_rows -= n_empty;
            sinks.iter_mut().for_each(|sink| sink.truncate(n_rows));
            notes.push(format!("{n_empty} line(s) of empty cells at the end of the file were left out"));
        }
        if n_comments > 0 {
            notes.push(format!("{n_comments} comment line(s) among the numbers were left out"));
        }
        Ok(Self { sinks, n_rows, n_usual: dialect.kinds.len() })
    }

    fn into_columns(self, first: &HeadLine<'_>, header: Header) -> Result<Vec<Column>, TextError> {
        let Self { sinks, n_rows, n_usual } = self;
        let n_names = header.names.as_ref().map_or(0, Vec::len);
        let given = |list: &Option<Vec<String>>, index: usize| {
            list.as_ref().and_then(|l| l.get(index)).filter(|entry| !entry.is_empty()).cloned()
        };
        let mut columns = Vec::with_capacity(sinks.len());
        for (index, sink) in sinks.into_iter().enumerate() {
            let name = given(&header.names, index);
            let values = match sink {
                Sink::Numbers(values) => Values::Numbers(values),
                Sink::Stamps { ns, timed: false, .. } => {
                    Values::Text { n_entries: ns.iter().filter(|n| **n != MISSING_STAMP).count() }
                }
                Sink::Stamps { ns, dated, .. } => Values::Stamps { ns, dated: dated == Some(true) },
                Sink::Text { n_entries } => Values::Text { n_entries },
                Sink::Sparse { values, n_texts, .. } if n_texts > 0 => {
                    Values::Text { n_entries: n_texts + values.iter().filter(|v| !v.is_nan()).count() }
                }
                Sink::Sparse { mut values, .. } if !values.is_empty() => {
                    values.resize(n_rows, f64::NAN);
                    Values::Numbers(values)
                }
                Sink::Sparse { n_fields, .. } => {
                    let remark = name.as_deref().is_some_and(is_remark_name);
                    if index >= n_usual && n_fields == 0 && !remark {
                        let (line, data_line) = (header.names_line, first.number);
                        return Err(TextError::Names { line, n_names, data_line, n_fields: n_usual });
                    }
                    if name.is_none() {
                        // The empty field behind a delimiter at the line's end.
                        continue;
                    }
                    Values::Text { n_entries: 0 }
                }
            };
            let unit = given(&header.units, index);
            columns.push(Column { index, name, unit, values });
        }
        Ok(columns)
    }
}

/// Columns that data acquisition names and seldom fills.
fn is_remark_name(name: &str) -> bool {
    let name = name.to_lowercase();
    ["event", "comment", "remark", "marker", "note", "label", "message", "status", "bemerkung", "kommentar"]
        .iter()
        .any(|word| name.contains(word))
}

/// A line that is one quoted text where a row has several fields.
fn is_remark(line: &[u8], delimiter: Delimiter, n_required: usize) -> bool {
    line.trim_ascii_start().starts_with(b"\"") && n_required > 1 && fields(line, delimiter).len() == 1
}

fn line_end(text: &[u8], at: usize) -> usize {
    let rest = &text[at..];
    at + rest.iter().position(|&b| is_end(b)).unwrap_or(rest.len())
}

/// About how many lines the rows take, from the first of them.
fn expected_rows(rows: &[u8]) -> usize {
    let piece = &rows[..rows.len().min(1 << 16)];
    let n_lines = Lines { bytes: piece, at: 0 }.count().max(1);
    (rows.len() / (piece.len() / n_lines).max(1)).saturating_mul(103) / 100 + 1
}
