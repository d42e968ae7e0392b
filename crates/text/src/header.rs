//! The lines above the numbers: names and units of the columns.

use crate::delimiter::Delimiter;
use crate::dialect::{Dialect, Kind};
use crate::encoding;
use crate::error::{self, TextError};
use crate::line::{fields, is_blank, uncommented, unquoted};
use crate::unit::unit;

/// A line above the numbers.
pub(crate) struct HeadLine<'a> {
    pub(crate) number: usize,
    pub(crate) bytes: &'a [u8],
}

/// What the head says of the columns.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// One per column; empty where the row of names has an empty cell. None without such a row.
    pub(crate) names: Option<Vec<String>>,
    /// Line of the names.
    pub(crate) names_line: usize,
    pub(crate) units: Option<Vec<String>>,
    pub(crate) note: Option<String>,
}

/// How far above the numbers the names may stand, blank lines and rules not counted.
const REACH: usize = 5;

/// Finds names and units above the first row (`data`), which has `n_columns` fields.
///
/// # Errors
/// A line just above the first row that is a broken row, or a row of too few names.
pub(crate) fn read(head: &[HeadLine<'_>], data: &HeadLine<'_>, dialect: &Dialect) -> Result<Header, TextError> {
    let mut rows: Vec<Row> = Vec::new();
    let mut skipped = 0;
    let mut short_units = None;
    for (at, line) in head.iter().enumerate().rev() {
        if is_blank(line.bytes) || is_rule(line.bytes) {
            continue;
        }
        let row = Row::new(head, at, dialect);
        let named = !row.statement && row.fits(dialect) && row.is_text() && !row.has_sample(dialect);
        if named {
            rows.push(row);
            if rows.len() == 3 {
                break;
            }
        } else if rows.is_empty() && row.is_short_of_units(dialect) {
            // The names stand above it.
            short_units = Some(row);
        } else if rows.is_empty() {
            skipped += 1;
            // Words divided by blanks are a row of names only close to the numbers: further up they are prose.
            let close = dialect.delimiter != Delimiter::Blanks || row.is_numbers(dialect);
            if !close || skipped == REACH {
                break;
            }
        } else {
            break;
        }
    }
    let closest = head.iter().rposition(|line| !is_blank(line.bytes) && !is_rule(line.bytes));
    let closest = closest.map(|at| Row::new(head, at, dialect));
    if let Some(row) = &closest {
        refuse_broken_row(row, &rows, dialect)?;
    }
    let units_at = (rows.len() > 1).then(|| rows.iter().position(Row::is_units)).flatten();
    let units_at = units_at.or_else(|| (rows.len() > 1 && rows[0].is_units_under(&rows[1])).then_some(0));
    let names_at = match units_at {
        Some(at) if at + 1 < rows.len() => at + 1,
        _ => 0,
    };
    let Some(names) = rows.get(names_at) else {
        return no_names(closest, data, dialect);
    };
    let units = units_at.filter(|at| at + 1 == names_at).map(|at| rows[at].texts());
    // Where blanks divide, nobody knows which column has no unit.
    let short_units = short_units.filter(|_| dialect.delimiter != Delimiter::Blanks);
    let units = units.or_else(|| short_units.map(|row| row.texts()));
    Ok(Header { names: Some(names.texts()), names_line: names.number, units, note: None })
}

/// Without a row of names: an error where one was tried, a note where some other line stands in its place.
fn no_names(closest: Option<Row>, data: &HeadLine<'_>, dialect: &Dialect) -> Result<Header, TextError> {
    let Some(row) = closest.filter(|row| !row.statement) else {
        return Ok(Header::default());
    };
    let n_names = row.cells.len();
    let data_fields = fields(data.bytes, dialect.delimiter);
    let n_fields = data_fields.iter().rposition(|f| !f.is_empty()).map_or(0, |last| last + 1);
    let is_names = !row.comment && n_names > 1 && row.cells.iter().all(|c| dialect.kind(c) == Kind::Text);
    if is_names && n_names < n_fields && dialect.delimiter != Delimiter::Blanks {
        return Err(TextError::Names { line: row.number, n_names, data_line: data.number, n_fields });
    }
    let note = (n_names > 1)
        .then(|| format!("line {}: {n_names} words above {n_fields} columns were not taken as names", row.number));
    Ok(Header { note, ..Header::default() })
}

/// A line just above the first row that was meant as a row: with a broken field, or too short.
fn refuse_broken_row(row: &Row, rows: &[Row], dialect: &Dialect) -> Result<(), TextError> {
    if row.comment || row.statement {
        return Ok(());
    }
    let (line, cells) = (row.number, &row.cells);
    let n_required = dialect.n_required();
    let names_above = rows.iter().find(|above| above.number < line);
    let names = names_above.map(Row::texts).unwrap_or_default();
    let column = |at: usize| column_name(&names, at);
    let n_numbers = cells.iter().filter(|c| dialect.kind(c) == Kind::Number).count();
    if cells.len() < n_required {
        let only_numbers = n_numbers == cells.len() && n_numbers > 0;
        if only_numbers && (names_above.is_some() || dialect.delimiter != Delimiter::Blanks) && cells.len() > 1 {
            return Err(TextError::Ragged {
                line,
                expected: n_required,
                found: cells.len(),
                column: column(cells.len()),
            });
        }
        return Ok(());
    }
    let keyed = n_required == 2 && cells[0].first().is_some_and(u8::is_ascii_alphabetic);
    if keyed || !row.has_sample(dialect) {
        return Ok(());
    }
    for at in 0..n_required {
        let found = dialect.kind(&cells[at]);
        let found_text = || encoding::shown(&cells[at]);
        match dialect.kinds[at] {
            Kind::Number if !matches!(found, Kind::Number | Kind::Nothing) => {
                return Err(TextError::NotANumber { line, column: column(at), found: found_text() });
            }
            Kind::Stamp if !matches!(found, Kind::Stamp | Kind::Nothing) => {
                return Err(TextError::NotATime { line, column: column(at), found: found_text() });
            }
            _ => {}
        }
    }
    Ok(())
}

/// A line of the head as a row of cells.
struct Row {
    number: usize,
    cells: Vec<Vec<u8>>,
    comment: bool,
    /// It states something (`key = 5`, `Rate: 1000`) rather than naming columns.
    statement: bool,
}

impl Row {
    /// Row `at` of the head, joined with those above it where a quoted name contains the line break.
    fn new(head: &[HeadLine<'_>], at: usize, dialect: &Dialect) -> Self {
        let n_columns = dialect.kinds.len();
        let quotes = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'"').count();
        let mut line = head[at].bytes.to_vec();
        if quotes(&line) % 2 == 1 {
            let mut joined = line.clone();
            for above in head[..at].iter().rev().take(2 * n_columns) {
                joined = [above.bytes, b" ", &joined[..]].concat();
                if quotes(above.bytes) % 2 == 1 {
                    line = joined;
                    break;
                }
            }
        }
        let inner = uncommented(&line);
        let comment = inner.is_some();
        let plain = inner.unwrap_or(&line);
        let cells = cells(plain, dialect);
        let statement = is_statement(plain);
        Self { number: head[at].number, cells, comment, statement }
    }

    /// A cell for every column that must be there. More cells than columns may name text that few rows have.
    fn fits(&self, dialect: &Dialect) -> bool {
        let n_cells = self.cells.len();
        n_cells >= dialect.n_required() && (n_cells <= dialect.kinds.len() || dialect.delimiter != Delimiter::Blanks)
    }

    /// Whether there is a decimal fraction in a column of numbers. (Integers may be names.)
    fn has_sample(&self, dialect: &Dialect) -> bool {
        self.cells.iter().zip(&dialect.kinds).any(|(cell, kind)| {
            *kind == Kind::Number && cell.contains(&dialect.point) && dialect.kind(cell) == Kind::Number
        })
    }

    fn is_numbers(&self, dialect: &Dialect) -> bool {
        self.cells.iter().any(|cell| dialect.kind(cell) == Kind::Number) && !self.statement
    }

    fn is_text(&self) -> bool {
        self.cells.iter().any(|c| !c.is_empty() && crate::number::parse(&unquoted(c), b'.').is_none())
    }

    fn texts(&self) -> Vec<String> {
        self.cells.iter().map(|c| encoding::text(unquoted(c).trim_ascii()).into_owned()).collect()
    }

    /// A row of units with fewer cells than there are columns.
    fn is_short_of_units(&self, dialect: &Dialect) -> bool {
        self.cells.len() < dialect.n_required() && self.cells.len() > 1 && !self.statement && self.is_units()
    }

    /// Whether this is a row of units under a row of names: short words, of which some are known units, or repeat, or
    /// are missing, or stand under a name of time, while every one has its own name above it.
    fn is_units_under(&self, names: &Self) -> bool {
        let (units, above) = (self.texts(), names.texts());
        let named = |at: usize| above.get(at).is_some_and(|name| !name.is_empty());
        let number = |name: &String| crate::number::parse(name.as_bytes(), b'.').is_some();
        let is_name = |name: &String| !name.is_empty() && !number(name);
        let distinct = above.iter().enumerate().all(|(at, name)| is_name(name) && !above[..at].contains(name));
        let filled: Vec<&String> = units.iter().filter(|unit| !unit.is_empty()).collect();
        let short = filled.iter().all(|unit| is_short_word(unit));
        let under = (0..units.len()).all(|at| units[at].is_empty() || named(at));
        if !(distinct && short && under) || filled.is_empty() || units.iter().any(|unit| is_time_name(unit)) {
            return false;
        }
        // Letters may name columns, but seconds.
        let known = filled.iter().any(|unit| is_unit(unit) && (unit.len() > 1 || *unit == "s"));
        let repeated = filled.iter().enumerate().any(|(at, unit)| filled[..at].contains(unit));
        known || repeated || filled.len() < above.len() || above.iter().any(|name| is_time_name(name))
    }

    fn is_units(&self) -> bool {
        let texts = self.texts();
        texts.iter().any(|t| !t.is_empty()) && texts.iter().all(|t| t.is_empty() || is_unit(t))
    }
}

/// The cells of a header line; by another delimiter where that gives one cell per column and the rows' own does not.
fn cells(line: &[u8], dialect: &Dialect) -> Vec<Vec<u8>> {
    let (delimiter, n_columns) = (dialect.delimiter, dialect.kinds.len());
    let trimmed = |mut cells: Vec<Vec<u8>>| {
        // An empty cell above a column of numbers says that it has no name or unit.
        while cells.len() > dialect.n_required().max(1) && cells.last().is_some_and(Vec::is_empty) {
            cells.pop();
        }
        cells
    };
    let by = |d| trimmed(fields(line, d).into_iter().map(<[u8]>::to_vec).collect());
    let own = by(delimiter);
    if own.len() == n_columns {
        return own;
    }
    let others = [Delimiter::Tab, Delimiter::Semicolon, Delimiter::Comma, Delimiter::Bar];
    if let Some(other) = others.into_iter().map(by).find(|cells| cells.len() == n_columns && n_columns > 1) {
        return other;
    }
    let wide = trimmed(split_at_wide_blanks(line));
    if wide.len() == n_columns && n_columns > 1 { wide } else { own }
}

/// Cells divided by two blanks or more, so that names may contain single ones.
fn split_at_wide_blanks(line: &[u8]) -> Vec<Vec<u8>> {
    let mut cells = vec![Vec::new()];
    let mut blanks = 2;
    for &b in line.trim_ascii() {
        if b == b' ' || b == b'\t' {
            blanks += if b == b'\t' { 2 } else { 1 };
            continue;
        }
        let last = cells.len() - 1;
        if blanks >= 2 && !cells[last].is_empty() {
            cells.push(vec![b]);
        } else {
            if blanks == 1 {
                cells[last].push(b' ');
            }
            cells[last].push(b);
        }
        blanks = 0;
    }
    cells
}

/// A line of dashes and the like.
fn is_rule(line: &[u8]) -> bool {
    line.iter().all(|b| matches!(b, b'-' | b'=' | b'_' | b'+' | b'|' | b'*' | b'#' | b' ' | b'\t' | b',' | b';'))
        && line.iter().filter(|b| matches!(b, b'-' | b'=' | b'_' | b'*')).count() > 2
}

/// `key = value`, or a colon with a number behind it.
fn is_statement(line: &[u8]) -> bool {
    if line.contains(&b'=') {
        return true;
    }
    line.iter().enumerate().filter(|(_, b)| **b == b':').any(|(at, _)| {
        let rest = line[at + 1..].trim_ascii_start();
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        crate::number::parse(&rest[..end], b'.').is_some() && !line[..at].contains(&b',')
    })
}

/// Whether a cell may stand in a row of units: a known one, a sign for none, or anything in brackets.
fn is_unit(cell: &str) -> bool {
    let bracketed = |open, close| cell.starts_with(open) && cell.ends_with(close);
    // Letters that name a column (time, an index) more often than they are tonnes or kelvin.
    let letter = ["t", "k", "l", "j", "w"].contains(&cell.to_lowercase().as_str());
    let none = ["-", "--", "1"].contains(&cell);
    bracketed('(', ')') || bracketed('[', ']') || none || (!letter && unit(cell).is_some())
}

/// Whether a text is short enough for a unit: two words at most, and no number of its own.
fn is_short_word(text: &str) -> bool {
    let number = crate::number::parse(text.as_bytes(), b'.').is_some_and(|value| !value.is_nan());
    !number && text.chars().count() <= 16 && text.split_whitespace().count() <= 2
}

/// Whether a cell names the time, in some language, perhaps with its unit.
fn is_time_name(text: &str) -> bool {
    const NAMES: [&str; 12] =
        ["time", "zeit", "temps", "tiempo", "tempo", "t", "время", "时间", "時間", "時刻", "시간", "czas"];
    let stem = text.split(['(', '[', ',', '/']).next().unwrap_or_default().trim().to_lowercase();
    NAMES.contains(&stem.as_str()) || stem.starts_with("time ") || stem.ends_with(" time")
}

/// What messages call a column.
pub(crate) fn column_name(names: &[String], column: usize) -> String {
    match names.get(column) {
        Some(name) if !name.is_empty() => error::short(name),
        _ => format!("column {column}"),
    }
}
