use std::fmt;

use crate::blocks::{self, Block, Stray};
use crate::delimiter::Delimiter;
use crate::dialect::{self, Dialect, Kind};
use crate::encoding::{self, Encoding};
use crate::error::{TextError, short};
use crate::header::{self, HeadLine, Header, column_name};
use crate::line::{Lines, after_end, field_end, fields, is_blank, is_end, uncommented, unquoted};
use crate::number;
use crate::repair;
use crate::stamp;

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
    /// What was left out or taken otherwise than it stands, each in one sentence.
    pub notes: Vec<Note>,
}

/// What was left out or taken otherwise than it stands: a sentence, a code that never changes, lines or counts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// The sentence.
    pub text: String,
    /// The code.
    pub code: &'static str,
    /// The lines or counts that it speaks of.
    pub values: Vec<usize>,
}

impl Note {
    fn new(code: &'static str, values: &[usize], text: String) -> Self {
        Self { text, code, values: values.to_vec() }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Which part of a text is read; all of it by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Part {
    /// The block of rows, counted from 1.
    pub block: Option<usize>,
    /// First and last line with rows, counted from 1; the head is looked for in these and above them.
    pub lines: Option<(usize, usize)>,
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
    read_part(bytes, Part::default())
}

/// Reads a part of a text file, given as its bytes.
///
/// # Errors
/// [`TextError`] if the bytes are not text, hold no such part, or a row in it is broken.
pub fn read_part(bytes: &[u8], part: Part) -> Result<Table, TextError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(TextError::Empty);
    }
    let (text, encoding, halved) = encoding::decode(bytes)?;
    let text = &*text;
    if text.iter().all(u8::is_ascii_whitespace) {
        return Err(TextError::Empty);
    }
    let mut table = decoded(text, part)?;
    table.encoding = encoding;
    if halved {
        let text = "the last character of the file is cut in half and was left out".to_owned();
        table.notes.push(Note::new("cut_off", &[], text));
    }
    Ok(table)
}

/// The table in a text: as it stands if every row is whole, else without what is none, or repaired.
fn decoded(text: &[u8], part: Part) -> Result<Table, TextError> {
    if let Some((first, last)) = part.lines {
        return lines_of(text, first, last);
    }
    let dialect = dialect::find(text);
    let plain = match &dialect {
        Some(dialect) => all_of(text, dialect),
        None => Err(no_numbers(text)),
    };
    let whole = plain.as_ref().is_ok_and(|(_, earlier)| !earlier);
    let one_block = whole && part.block.is_none_or(|block| block == 1);
    let nameless = plain.as_ref().is_ok_and(|(table, _)| table.columns.iter().all(|column| column.name.is_none()));
    if one_block && !nameless {
        return plain.map(|(table, _)| table);
    }
    if (!whole || nameless)
        && let Some(table) = repaired(text, dialect.as_ref(), part, whole)
    {
        return Ok(table);
    }
    if one_block {
        return plain.map(|(table, _)| table);
    }
    let found = dialect.as_ref().and_then(|dialect| blocks::split(text, dialect));
    match (found, plain) {
        (Some(found), plain) if !found.is_empty() => match (chosen(text, &found, part.block), plain) {
            (Err(_), Ok((table, _))) if part.block.is_none() => Ok(table),
            (Err(_), Err(error)) if part.block.is_none() && found.len() == 1 => Err(error),
            (table, _) => table,
        },
        (_, Ok(_)) if part.block.is_some() => Err(TextError::NoBlock { n_blocks: 1 }),
        (_, plain) => plain.map(|(table, _)| table),
    }
}

fn no_numbers(text: &[u8]) -> TextError {
    TextError::NoNumbers { n_lines: Lines { bytes: text, at: 0 }.count() }
}

/// Rows of the lines from `first` to `last` and the head above the first of them.
fn lines_of(text: &[u8], first: usize, last: usize) -> Result<Table, TextError> {
    let mut lines = Lines { bytes: text, at: 0 };
    let (mut number, mut start, mut end) = (0, text.len(), text.len());
    while let Some((at, _)) = lines.next() {
        number += 1;
        if number == first {
            start = at;
        }
        if number == last {
            end = lines.at;
            break;
        }
    }
    if first < 1 || last < first || start >= end {
        return Err(TextError::NoLines { first, last, n_lines: number });
    }
    let text = &text[..end];
    let dialect = dialect::find(&text[start..]).ok_or_else(|| no_numbers(&text[start..]))?;
    let mut head = Vec::new();
    let mut row = None;
    for (number, (at, line)) in (1..).zip(Lines { bytes: text, at: 0 }) {
        let fits = !is_blank(line) && uncommented(line).is_none() && dialect.fits(line);
        // Rows above the chosen ones are no head.
        let above = at >= start || blocks::is_words(line, &dialect);
        let line = HeadLine { number, bytes: line };
        if fits && at >= start {
            row = Some((at, line));
            break;
        }
        if above {
            head.push(line);
        }
    }
    let (at, row) = row.ok_or_else(|| no_numbers(&text[start..]))?;
    let mut table = table_of(text, &head, at, &row, &dialect, &[])?;
    let note = format!("only the lines {first} to {last} were read, as asked");
    table.notes.push(Note::new("lines", &[first, last], note));
    Ok(table)
}

/// The whole text as one table, and whether rows of another form stand in its head.
fn all_of(text: &[u8], dialect: &Dialect) -> Result<(Table, bool), TextError> {
    let mut head: Vec<HeadLine<'_>> = Vec::new();
    let mut first = None;
    for (at, line) in (Lines { bytes: text, at: 0 }) {
        if !is_blank(line) && uncommented(line).is_none() && dialect.fits(line) {
            first = Some((at, HeadLine { number: head.len() + 1, bytes: line }));
            break;
        }
        head.push(HeadLine { number: head.len() + 1, bytes: line });
    }
    let (start, first) = first.ok_or_else(|| no_numbers(text))?;
    let earlier = has_rows(&head, dialect);
    Ok((table_of(text, &head, start, &first, dialect, &[])?, earlier))
}

/// Whether three lines in a row hold two numbers or more and nothing else.
fn has_rows(head: &[HeadLine<'_>], dialect: &Dialect) -> bool {
    let mut n_alike = 0;
    let mut width = 0;
    for line in head {
        let found = fields(line.bytes, dialect.delimiter);
        let numbers = found.len() > 1 && found.iter().all(|field| dialect.kind(field) == Kind::Number);
        n_alike = if !numbers {
            0
        } else if found.len() == width {
            n_alike + 1
        } else {
            1
        };
        width = found.len();
        if n_alike == 3 {
            return true;
        }
    }
    false
}

/// The text once commas have one meaning and columns are apart, if it is a table then.
fn repaired(text: &[u8], dialect: Option<&Dialect>, part: Part, whole: bool) -> Option<Table> {
    if let Some(dialect) = dialect.filter(|dialect| dialect.delimiter == Delimiter::Comma && dialect.point == b'.') {
        let lines = Lines { bytes: text, at: 0 };
        let (start, head) = {
            let mut head = Vec::new();
            let mut start = None;
            for (at, line) in lines {
                if !is_blank(line) && uncommented(line).is_none() && dialect.fits(line) {
                    start = Some(at);
                    break;
                }
                head.push(line);
            }
            (start?, head)
        };
        let names = head.iter().rev().find(|line| !is_blank(line)).map(|line| fields(line, Delimiter::Comma).len());
        if let Some(other) = repair::decimal_commas(text, start, names) {
            let dialect = dialect::find(&other)?;
            let (mut table, _) = all_of(&other, &dialect).ok()?;
            table.decimal_comma = true;
            let note = "commas stand both between and within the numbers: every second one was taken as decimal mark";
            table.notes.push(Note::new("decimal_commas", &[], note.to_owned()));
            return Some(table);
        }
    }
    if whole {
        return None;
    }
    let other = repair::unfused(text)?;
    let dialect = dialect::find(&other)?;
    if dialect.delimiter != Delimiter::Blanks {
        return None;
    }
    let plain = all_of(&other, &dialect).map(|(table, _)| table);
    let mut table =
        plain.or_else(|_| chosen(&other, &blocks::split(&other, &dialect).unwrap_or_default(), part.block)).ok()?;
    let note = "columns without a blank between them were divided at signs and decimals".to_owned();
    table.notes.push(Note::new("fused", &[], note));
    Some(table)
}

/// The block asked for, or the longest, with notes on what was left out.
fn chosen(text: &[u8], found: &[Block], asked: Option<usize>) -> Result<Table, TextError> {
    let no_block = TextError::NoBlock { n_blocks: found.len() };
    let index = match asked {
        Some(block) => block.checked_sub(1).filter(|index| *index < found.len()).ok_or(no_block)?,
        None => (0..found.len()).rev().max_by_key(|index| found[*index].n_rows).ok_or(no_block)?,
    };
    let block = &found[index];
    let (mut table, names) = block_of(text, block)?;
    if index > 0 {
        // What the file says of itself at its beginning holds for every block.
        let above = Lines { bytes: &text[..found[0].start.0], at: 0 };
        let above = above.take(PREAMBLE_LINES).map(|(_, line)| encoding::text(line).into_owned());
        table.preamble = above.chain(table.preamble).collect();
    }
    for stray in &block.strays {
        table.notes.push(left_out(text, stray, block));
    }
    if found.len() > 1 {
        let mut listed: Vec<String> = Vec::new();
        for (number, one) in (1..).zip(found).take(8) {
            let names = if one == block { names.clone() } else { names_of(text, one) };
            let called = if names.is_empty() { String::new() } else { format!(": {}", names.join(", ")) };
            listed
                .push(format!("block {number}, lines {} to {} ({} rows{called})", one.start.1, one.end.1, one.n_rows));
        }
        if found.len() > 8 {
            listed.push(format!("and {} more", found.len() - 8));
        }
        let (n_blocks, number) = (found.len(), index + 1);
        let how = if asked.is_some() { "as asked" } else { "the longest; --block N reads another" };
        let text =
            format!("the file holds {n_blocks} blocks of rows, {}: block {number} was read, {how}", listed.join("; "));
        table.notes.push(Note::new("blocks", &[n_blocks, number, block.start.1, block.end.1], text));
    }
    Ok(table)
}

fn left_out(text: &[u8], stray: &Stray, block: &Block) -> Note {
    let found = short(&encoding::text(text[stray.start..stray.end].trim_ascii()));
    let found = found.split("\\n").next().unwrap_or_default().trim_end_matches("\\r").to_owned();
    let (first, last) = (stray.first_line, stray.last_line);
    let (which, were) =
        if first == last { (format!("line {first}"), "was") } else { (format!("lines {first} to {last}"), "were") };
    let number = found.starts_with(|c: char| c.is_ascii_digit() || "+-.\"".contains(c));
    let cut = number && first == last && stray.end == text.len() && !text.last().is_some_and(|&b| is_end(b));
    if cut {
        return Note::new("cut_off", &[first], format!("{which} {were} left out, for it is cut off: '{found}'"));
    }
    let place = if stray.start >= block.end.0 { "behind the last row" } else { "between rows" };
    Note::new("left_out", &[first, last], format!("{which}, {place}, {were} left out: '{found}'"))
}

/// The rows of a block as a table, and its names.
fn block_of(text: &[u8], block: &Block) -> Result<(Table, Vec<String>), TextError> {
    let text = &text[..block.end.0];
    let dialect = dialect::find(&text[block.head.0..]).ok_or_else(|| no_numbers(text))?;
    let mut head = Vec::new();
    for (number, (at, line)) in (block.head.1..).zip(Lines { bytes: text, at: block.head.0 }) {
        let line = HeadLine { number, bytes: line };
        if at >= block.start.0 {
            let table = table_of(text, &head, at, &line, &dialect, &block.strays)?;
            let names = table.columns.iter().filter_map(|column| column.name.clone()).collect();
            return Ok((table, names));
        }
        head.push(line);
    }
    Err(no_numbers(text))
}

fn names_of(text: &[u8], block: &Block) -> Vec<String> {
    // A few rows are enough to tell the names.
    let rows = Lines { bytes: &text[..block.end.0], at: block.start.0 };
    let end = rows.take(20).last().map_or(block.end.0, |(at, line)| at + line.len());
    let short = Block { end: (end, block.end.1), strays: Vec::new(), ..block.clone() };
    block_of(text, &short).map(|(_, names)| names).unwrap_or_default()
}

/// The table whose first row is `first`, at `start`.
fn table_of(
    text: &[u8],
    head: &[HeadLine<'_>],
    start: usize,
    first: &HeadLine<'_>,
    dialect: &Dialect,
    strays: &[Stray],
) -> Result<Table, TextError> {
    let mut header = header::read(head, first, dialect)?;
    let mut notes: Vec<Note> = header.note.take().map(|text| Note::new("no_names", &[], text)).into_iter().collect();
    let rows = Rows::read(text, start, first, dialect, &header, strays, &mut notes)?;
    let preamble = head.iter().take(PREAMBLE_LINES).map(|line| encoding::text(line.bytes).into_owned()).collect();
    let n_rows = rows.n_rows;
    let columns = rows.into_columns(first, header)?;
    Ok(Table {
        columns,
        n_rows,
        preamble,
        delimiter: dialect.delimiter,
        decimal_comma: dialect.point == b',',
        encoding: Encoding::Utf8,
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
    fn take(&mut self, field: &[u8], row: usize, dialect: &Dialect) -> Result<(), Wrong> {
        let (point, order) = (dialect.point, dialect.order);
        let token = unquoted(field);
        match self {
            Self::Numbers(values) if token.is_empty() => values.push(f64::NAN),
            Self::Numbers(values) => {
                let grouped = || number::grouped(&token, point, !dialect.grouped);
                values.push(number::parse(&token, point).or_else(grouped).ok_or(Wrong::NotANumber)?);
            }
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
            Self::Text { n_entries } => *n_entries = (*n_entries).min(n_rows),
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
        strays: &[Stray],
        notes: &mut Vec<Note>,
    ) -> Result<Self, TextError> {
        let Dialect { delimiter, point, .. } = *dialect;
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
        let mut behind: Option<(usize, usize)> = None;
        let mut strays = strays.iter();
        let mut stray = strays.next();
        while at < text.len() {
            if let Some(one) = stray.filter(|one| one.start <= at) {
                (at, line) = (one.end, one.last_line + 1);
                stray = strays.next();
                continue;
            }
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
                sink.take(field, n_rows, dialect).map_err(|wrong| {
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
                    // Words behind the last column are remarks; numbers are columns that nobody named.
                    let remarks = delimiter != Delimiter::Blanks
                        && fields(rest, delimiter)
                            .iter()
                            .all(|f| matches!(dialect.kind(f), Kind::Text | Kind::Nothing));
                    if !remarks {
                        return Err(ragged(n_columns, n_columns.saturating_sub(1)));
                    }
                    behind = Some(behind.map_or((line, 1), |(first, n)| (first, n + 1)));
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
            let text = format!("{n_empty} line(s) of empty cells at the end of the file were left out");
            notes.push(Note::new("empty_lines", &[n_empty], text));
        }
        if n_comments > 0 {
            let text = format!("{n_comments} comment line(s) among the numbers were left out");
            notes.push(Note::new("comments", &[n_comments], text));
        }
        if let Some((first, n)) = behind {
            let text =
                format!("{n} line(s) with words behind the last column, first line {first}: these were left out");
            notes.push(Note::new("words_behind", &[first, n], text));
        }
        if n_empty == 0 && n_rows > SURE_ROWS && ends_short(text, delimiter, point) {
            n_rows -= 1;
            sinks.iter_mut().for_each(|sink| sink.truncate(n_rows));
            let last = line.saturating_sub(1);
            let text = format!(
                "line {last} was left out: it has no line end, and its last number fewer decimals than all others"
            );
            notes.push(Note::new("cut_off", &[last], text));
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
                    let n_entries = n_texts + values.iter().filter(|v| !v.is_nan()).count();
                    Values::Text { n_entries: n_entries.min(n_rows) }
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

/// So many rows of as many decimals show how numbers are written.
const SURE_ROWS: usize = 8;

/// Whether the text ends amid a number: without a line end, and with fewer decimals than the rows above it have.
fn ends_short(text: &[u8], delimiter: Delimiter, point: u8) -> bool {
    if text.last().is_none_or(|&b| is_end(b)) {
        return false;
    }
    let decimals = |line: &[u8]| {
        let field = fields(line, delimiter).last().copied().unwrap_or_default();
        let plain = field.iter().all(|&b| b.is_ascii_digit() || b == point || b == b'-' || b == b'+');
        let at = field.iter().position(|b| *b == point);
        // Nothing at all is less than a whole number.
        plain.then(|| at.map_or(usize::from(!field.is_empty()), |at| field.len() - at))
    };
    let mut lines = text.rsplit(|&b| is_end(b)).filter(|line| !line.is_empty());
    let Some(last) = lines.next().and_then(decimals) else { return false };
    let above: Vec<_> = lines.take(SURE_ROWS).map(decimals).collect();
    above.len() == SURE_ROWS && above.iter().all(|one| *one == above[0]) && above[0].is_some_and(|n| n > last)
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
