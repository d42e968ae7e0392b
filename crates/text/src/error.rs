use std::fmt;

/// Why bytes could not be read as a table of numbers: each message is one line and names the place.
///
/// Lines are counted from 1, as editors do. `found` is shortened and escaped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TextError {
    /// There are no bytes, or only blanks.
    Empty,
    /// The bytes are not text.
    Binary {
        /// Offset of the first byte that text does not contain.
        offset: usize,
        /// That byte.
        byte: u8,
    },
    /// UTF-16 with half a character in it.
    Utf16 {
        /// Offset of the broken unit in bytes.
        offset: usize,
    },
    /// Text, but without a line that looks like a row of numbers.
    NoNumbers {
        /// How many lines were looked at.
        n_lines: usize,
    },
    /// There is no such block of rows.
    NoBlock {
        /// How many there are.
        n_blocks: usize,
    },
    /// There are no such lines.
    NoLines {
        /// The first line asked for.
        first: usize,
        /// The last line asked for.
        last: usize,
        /// How many lines there are, as far as they were counted.
        n_lines: usize,
    },
    /// The names row has fewer names than the rows have fields.
    Names {
        /// Line of the names.
        line: usize,
        /// How many names it has.
        n_names: usize,
        /// First line of numbers.
        data_line: usize,
        /// How many fields that line has.
        n_fields: usize,
    },
    /// A row has too few or too many fields.
    Ragged {
        /// Line of the row.
        line: usize,
        /// Fewest fields a row may have.
        expected: usize,
        /// Fields found.
        found: usize,
        /// Name of the first column without a field, or of the last column when there are too many fields.
        column: String,
    },
    /// A field of a numeric column is not a number.
    NotANumber {
        /// Line of the field.
        line: usize,
        /// Name of its column.
        column: String,
        /// The field.
        found: String,
    },
    /// A field of a date or time column is neither.
    NotATime {
        /// Line of the field.
        line: usize,
        /// Name of its column.
        column: String,
        /// The field.
        found: String,
    },
}

impl fmt::Display for TextError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "the file is empty; expected lines of numbers"),
            Self::Binary { offset, byte } => write!(
                f,
                "not a text file: byte 0x{byte:02x} at offset {offset}; expected lines of numbers, found binary content"
            ),
            Self::Utf16 { offset } => {
                write!(f, "damaged UTF-16 text: half a character at byte offset {offset}; save the file again as UTF-8")
            }
            Self::NoNumbers { n_lines } => write!(
                f,
                "no rows of numbers in {n_lines} line(s) of text; expected columns separated by comma, semicolon, tab, '|' or spaces"
            ),
            Self::NoBlock { n_blocks } => {
                write!(f, "no such block of rows; expected 1 to {n_blocks}")
            }
            Self::NoLines { first, last, n_lines } => {
                write!(f, "no lines {first} to {last}; the file has {n_lines}")
            }
            Self::Names { line, n_names, data_line, n_fields } => write!(
                f,
                "line {line} names {n_names} columns, but line {data_line} has {n_fields} fields; expected one name per \
                 column (a comma cannot be both delimiter and decimal mark)"
            ),
            Self::Ragged { line, expected, found, column } => {
                let side = if found < expected { "the first one missing is" } else { "the last column is" };
                write!(
                    f,
                    "line {line}: expected {expected} fields, found {found} ({side} '{column}'); \
                     complete the line, or put '#' before it"
                )
            }
            Self::NotANumber { line, column, found } => write!(
                f,
                "line {line}, column '{column}': expected a number, found {found}; correct it, empty the cell, or put \
                 '#' before the line"
            ),
            Self::NotATime { line, column, found } => write!(
                f,
                "line {line}, column '{column}': expected a date or time like those in the other lines, found {found}"
            ),
        }
    }
}

impl TextError {
    /// The line that is broken, where one line is.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::Ragged { line, .. } | Self::NotANumber { line, .. } | Self::NotATime { line, .. } => Some(*line),
            _ => None,
        }
    }
}

impl std::error::Error for TextError {}

/// At most 40 characters, control characters escaped.
pub(crate) fn short(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push_str("...");
    }
    short
}
