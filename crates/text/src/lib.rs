//! Reads the delimited text that laboratory data acquisition writes: bytes in, named columns out.
//!
//! Nothing has to be said about the file. Encoding (UTF-8, UTF-16, Latin-1), line ends, delimiter, decimal mark, the
//! end of the preamble, the row of names and the row of units are found from the content:
//!
//! ```
//! let table = rthstrack_text::read(b"Sampling Rate: 1000\nTime;Disp\ns;mm\n0,000;1,5\n0,001;2,5\n")?;
//! assert_eq!(table.preamble[0], "Sampling Rate: 1000");
//! assert_eq!(table.columns[1].name.as_deref(), Some("Disp"));
//! assert_eq!(table.columns[1].unit.as_deref(), Some("mm"));
//! assert_eq!(table.columns[1].values, rthstrack_text::Values::Numbers(vec![1.5, 2.5]));
//! # Ok::<(), rthstrack_text::TextError>(())
//! ```
//!
//! Every row counts: a ragged row or a word among numbers is an error with its line. What is left out (a footer, a
//! repeated header, a last line that is cut off, other blocks of rows) is told in a note with its line. Every number has
//! exactly the value that `str::parse::<f64>` gives its token. No input makes this crate panic.

mod blocks;
mod delimiter;
mod dialect;
mod encoding;
mod error;
mod header;
mod line;
mod number;
mod repair;
mod stamp;
mod table;
mod unit;

pub use delimiter::Delimiter;
pub use encoding::Encoding;
pub use error::TextError;
pub use table::{Column, MISSING_STAMP, Note, Part, Table, Values, read, read_part};
pub use unit::{Quantity, Unit, is_unit_suffix, unit};
