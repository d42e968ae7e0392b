//! Which delimiter and decimal mark a file uses, and what its columns hold.

use std::collections::BTreeMap;

use crate::delimiter::Delimiter;
use crate::line::{Lines, each_field, is_blank, uncommented, unquoted};
use crate::number;
use crate::stamp::{self, Order};

/// How much text each of the three samples (start, middle, end) takes.
const SAMPLE: usize = 48 * 1024;

/// What one field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Nothing,
    Number,
    Stamp,
    Text,
}

/// How a file writes its rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub(crate) delimiter: Delimiter,
    pub(crate) point: u8,
    /// Whether thousands are set apart.
    pub(crate) grouped: bool,
    /// What each column of an ordinary row holds; Nothing where the sample had no entry.
    pub(crate) kinds: Vec<Kind>,
    pub(crate) order: Order,
}

impl Dialect {
    /// How many fields a row must have: all up to the last column of numbers or stamps.
    pub(crate) fn n_required(&self) -> usize {
        self.kinds.iter().rposition(|k| matches!(k, Kind::Number | Kind::Stamp)).map_or(0, |last| last + 1)
    }

    /// What a field holds.
    pub(crate) fn kind(&self, field: &[u8]) -> Kind {
        match kind(field, self.point) {
            Kind::Text if self.grouped && number::grouped(&unquoted(field), self.point, false).is_some() => {
                Kind::Number
            }
            found => found,
        }
    }

    /// Whether a line has the fields of a row, at least one number among them.
    pub(crate) fn fits(&self, line: &[u8]) -> bool {
        let n_required = self.n_required();
        let (mut n_fields, mut n_numbers, mut fit) = (0, 0, true);
        each_field(line, self.delimiter, |field| {
            if fit && n_fields < n_required {
                let found = self.kind(field);
                let wanted = self.kinds[n_fields];
                n_numbers += usize::from(found == Kind::Number && wanted == Kind::Number);
                fit = found == wanted || found == Kind::Nothing || wanted == Kind::Text;
            }
            n_fields += 1;
        });
        fit && n_fields >= n_required && n_numbers > 0
    }
}

fn kind(field: &[u8], point: u8) -> Kind {
    kind_and_grouped(field, point).0
}

/// What a field holds, and whether it is a number only as thousands are set apart.
fn kind_and_grouped(field: &[u8], point: u8) -> (Kind, bool) {
    let token = unquoted(field);
    let kind = if token.is_empty() {
        Kind::Nothing
    } else if number::parse(&token, point).is_some() {
        Kind::Number
    } else if stamp::parse(&token, Order::MonthFirst).is_some() || stamp::parse(&token, Order::DayFirst).is_some() {
        Kind::Stamp
    } else if number::grouped(&token, point, true).is_some() {
        return (Kind::Number, true);
    } else {
        Kind::Text
    };
    (kind, false)
}

/// The dialect that explains most of the text as numbers and stamps, or None where hardly any of it is.
pub(crate) fn find(text: &[u8]) -> Option<Dialect> {
    const CANDIDATES: [(Delimiter, u8); 10] = [
        (Delimiter::Tab, b'.'),
        (Delimiter::Semicolon, b'.'),
        (Delimiter::Comma, b'.'),
        (Delimiter::Bar, b'.'),
        (Delimiter::Blanks, b'.'),
        (Delimiter::Tab, b','),
        (Delimiter::Semicolon, b','),
        (Delimiter::Comma, b','),
        (Delimiter::Bar, b','),
        (Delimiter::Blanks, b','),
    ];
    let lines = sample(text);
    let mut best: Option<(f64, Dialect)> = None;
    for (delimiter, point) in CANDIDATES {
        if let Some((score, dialect)) = judge(&lines, delimiter, point)
            && best.as_ref().is_none_or(|(highest, _)| score > highest * (1.0 + 1e-9))
        {
            best = Some((score, dialect));
        }
    }
    best.map(|(_, dialect)| dialect)
}

/// Lines from the start, the middle and the end; all of them where the text is short.
fn sample(text: &[u8]) -> Vec<&[u8]> {
    let wanted = |line: &&[u8]| !is_blank(line) && uncommented(line).is_none();
    if text.len() <= 3 * SAMPLE {
        return Lines { bytes: text, at: 0 }.map(|(_, line)| line).filter(wanted).collect();
    }
    let mut lines = Vec::new();
    for start in [0, text.len() / 2, text.len() - SAMPLE] {
        let piece = Lines { bytes: &text[start..start + SAMPLE], at: 0 }.map(|(_, line)| line);
        let first = lines.len();
        // A piece from within starts amid a line; one before the end stops amid a line.
        lines.extend(piece.skip(usize::from(start > 0)).filter(wanted));
        if start + SAMPLE < text.len() && lines.len() > first {
            lines.pop();
        }
    }
    lines
}

/// How well the lines are rows of this form: the sum over rows of the square of the share of each that is numbers and
/// stamps. (The square keeps a long preamble of `key value` lines from outvoting a few rows.)
fn judge(lines: &[&[u8]], delimiter: Delimiter, point: u8) -> Option<(f64, Dialect)> {
    let mut rows: Vec<(usize, f64, f64)> = Vec::new();
    let mut by_count: BTreeMap<usize, f64> = BTreeMap::new();
    for line in lines {
        let (mut n_fields, mut n_numbers, mut explained) = (0usize, 0usize, 0usize);
        each_field(line, delimiter, |field| {
            n_fields += 1;
            match kind(field, point) {
                Kind::Number => n_numbers += 1,
                Kind::Stamp => {}
                Kind::Nothing | Kind::Text => return,
            }
            explained += inked(field);
        });
        let share = explained as f64 / inked(line).max(1) as f64;
        // With a comma as decimal mark a single field could as well be two of integers: that reading goes first.
        if n_numbers == 0 || point == b',' && n_fields < 2 {
            rows.push((0, 0.0, 0.0));
            continue;
        }
        let weight = share * share;
        rows.push((n_fields, weight, share));
        *by_count.entry(n_fields).or_default() += weight;
    }
    let (n_columns, _) = by_count.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
    let mut counts = vec![[0.0f64; 3]; n_columns];
    let (mut n_rows, mut share_sum) = (0usize, 0.0);
    let n_below = lines.len() - rows.iter().position(|row| row.0 == n_columns).unwrap_or(0);
    let mut decided = None;
    let mut customary = None;
    let mut grouped = false;
    for (line, &(n_fields, weight, share)) in lines.iter().zip(&rows) {
        if n_fields != n_columns {
            continue;
        }
        n_rows += 1;
        share_sum += share;
        let mut column = 0;
        each_field(line, delimiter, |field| {
            let (kind, is_grouped) = kind_and_grouped(field, point);
            grouped |= is_grouped;
            match kind {
                Kind::Nothing => {}
                Kind::Number => counts[column][0] += weight,
                Kind::Stamp => {
                    counts[column][1] += weight;
                    let token = unquoted(field);
                    decided = decided.or_else(|| stamp::decided_order(&token));
                    customary = customary.or_else(|| Some(stamp::customary_order(&token)));
                }
                Kind::Text => counts[column][2] += weight,
            }
            column += 1;
        });
    }
    // A row of a table is numbers for a good part, and other rows follow; prose with a number in it is neither.
    if share_sum < 0.25 * n_rows as f64 || 4 * n_rows < n_below {
        return None;
    }
    let kinds: Vec<Kind> = counts
        .into_iter()
        .map(|[numbers, stamps, texts]| {
            if numbers == 0.0 && stamps == 0.0 && texts == 0.0 {
                Kind::Nothing
            } else if numbers >= stamps && numbers >= texts {
                Kind::Number
            } else if stamps >= texts {
                Kind::Stamp
            } else {
                Kind::Text
            }
        })
        .collect();
    if !kinds.contains(&Kind::Number) {
        return None;
    }
    let order = decided.or(customary).unwrap_or(Order::MonthFirst);
    let dialect = Dialect { delimiter, point, grouped, kinds, order };
    // Lines of the preamble may have as many fields, but not of these kinds.
    let ours = lines.iter().zip(rows).filter(|(line, row)| row.0 == n_columns && dialect.fits(line));
    let score = ours.map(|(_, row)| row.1).sum();
    Some((score, dialect))
}

/// How many bytes of a field are not blank.
fn inked(field: &[u8]) -> usize {
    field.iter().filter(|b| !b.is_ascii_whitespace()).count()
}

#[cfg(test)]
mod tests {
    use super::{Kind, find};
    use crate::delimiter::Delimiter;

    fn found(text: &str) -> (Delimiter, char, usize) {
        let dialect = find(text.as_bytes()).unwrap_or_else(|| panic!("{text}"));
        (dialect.delimiter, char::from(dialect.point), dialect.kinds.len())
    }

    #[test]
    fn the_usual_dialects_are_told_apart() {
        assert_eq!(found("a,b\n1,2.5\n2,3.5\n"), (Delimiter::Comma, '.', 2));
        assert_eq!(found("a;b\n1;2,5\n2;3,5\n"), (Delimiter::Semicolon, ',', 2));
        assert_eq!(found("a\tb\n1\t2,5\n2\t3,5\n"), (Delimiter::Tab, ',', 2));
        assert_eq!(found("1,5 2,5\n2,5 3,5\n"), (Delimiter::Blanks, ',', 2));
        assert_eq!(found(" 1.5  2.5\n 2.5  3.5\n"), (Delimiter::Blanks, '.', 2));
        assert_eq!(found("1, 2, 3\n4, 5, 6\n"), (Delimiter::Comma, '.', 3));
        assert_eq!(found("\"1,5\",\"2,5\"\n\"1,5\",\"3,5\"\n"), (Delimiter::Comma, ',', 2));
        assert_eq!(found("1|2\n3|4\n"), (Delimiter::Bar, '.', 2));
        assert_eq!(found("1.5\n2.5\n").2, 1);
    }

    #[test]
    fn integers_with_commas_between_are_two_columns() {
        assert_eq!(found("1,20\n2,21\n"), (Delimiter::Comma, '.', 2));
    }

    #[test]
    fn a_long_preamble_does_not_outvote_three_rows() {
        let mut text = "Sampling Rate: 1000\n".repeat(40);
        text.push_str("0.0 1.0 2.0\n0.1 1.1 2.1\n0.2 1.2 2.2\n");
        assert_eq!(found(&text), (Delimiter::Blanks, '.', 3));
    }

    #[test]
    fn a_date_with_blanks_is_one_field() {
        let dialect =
            find(b"1, 05/25/2022 05:46:08.066 PM, 0.5, go\n2, 05/25/2022 05:46:08.067 PM, 0.6, on\n").unwrap();
        assert_eq!(dialect.kinds, [Kind::Number, Kind::Stamp, Kind::Number, Kind::Text]);
        assert_eq!(dialect.n_required(), 3);
    }

    #[test]
    fn prose_is_no_table() {
        assert!(find(b"The quick brown fox jumps over 13 lazy dogs.\nAnd 2 more of them came later.\n").is_none());
        assert!(find(b"t,x,y\n").is_none());
    }
}
