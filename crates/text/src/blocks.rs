//! Rows that something interrupts: what is a block of its own, what only stands between its rows or behind them.

use crate::dialect::{Dialect, Kind};
use crate::line::{Lines, each_field, is_blank, uncommented};

/// A broken row is left out behind the last whole one only: more of them than this are no footer.
const LONGEST_FOOTER: usize = 20;

/// So many rows show whether the first column rises.
const ROWS_COMPARED: usize = 50;

/// Lines that are passed over: their first and last number, and where they begin and end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Stray {
    pub(crate) first_line: usize,
    pub(crate) last_line: usize,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

/// Rows of one width with the head above them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Block {
    /// Offset and number of the first line of the head.
    pub(crate) head: (usize, usize),
    /// Offset and number of the first row.
    pub(crate) start: (usize, usize),
    /// Offset behind the last row, and its number.
    pub(crate) end: (usize, usize),
    pub(crate) n_rows: usize,
    /// Lines between its rows, or behind the last, that are none.
    pub(crate) strays: Vec<Stray>,
    pub(crate) width: usize,
}

/// What a line may be to a table.
enum Class {
    Nothing,
    Row,
    /// Numbers and words where a row has numbers.
    Broken,
    Words {
        /// It may name the columns of a table.
        names: bool,
    },
}

struct Line<'a> {
    number: usize,
    start: usize,
    end: usize,
    bytes: &'a [u8],
    class: Class,
}

/// The blocks of a text of one dialect, or None where a row is broken amid the others.
pub(crate) fn split(text: &[u8], dialect: &Dialect) -> Option<Vec<Block>> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut gap: Vec<Line<'_>> = Vec::new();
    let mut lines = Lines { bytes: text, at: 0 };
    let mut number = 0;
    while let Some((start, bytes)) = lines.next() {
        number += 1;
        let end = lines.at;
        let (class, width) = classed(bytes, dialect);
        let line = Line { number, start, end, bytes, class };
        match line.class {
            Class::Nothing => {}
            Class::Row => {
                // A row that stands alone is no block: it belongs to the head of this one.
                let alone = blocks.last().is_some_and(|block| block.n_rows == 1 && block.width != width);
                let above = (alone && gap.is_empty()).then(|| blocks.pop()).flatten().map(|block| block.head);
                let spoken = above.is_some() || gap.iter().any(|one| matches!(one.class, Class::Words { .. }));
                let continues = above.is_none()
                    && blocks.last().is_some_and(|block| {
                        let same = width == block.width;
                        let repeated = || {
                            gap.iter().all(|one| is_repeated(one, text, block))
                                && !begins_anew(bytes, text, block, dialect)
                        };
                        let remarks =
                            || width > 1 && !gap.iter().any(|one| matches!(one.class, Class::Words { names: true }));
                        same && (gap.is_empty() || repeated() || remarks())
                    });
                if continues {
                    if gap.iter().any(|one| matches!(one.class, Class::Broken | Class::Row)) {
                        return None;
                    }
                    let block = blocks.last_mut()?;
                    block.strays.extend(stray(&gap));
                    block.n_rows += 1;
                    block.end = (end, number);
                    gap.clear();
                } else if blocks.is_empty() || spoken {
                    // Until a second row shows that it is a block, it may be a line of a head or a footer.
                    let first = above.or(gap.first().map(|one| (one.start, one.number))).unwrap_or((start, number));
                    let head = if blocks.is_empty() { (0, 1) } else { first };
                    finish(&mut blocks, &mut gap)?;
                    let (start, end) = ((start, number), (end, number));
                    blocks.push(Block { head, start, end, n_rows: 1, strays: Vec::new(), width });
                } else {
                    gap.push(line);
                }
            }
            Class::Broken | Class::Words { .. } => gap.push(line),
        }
    }
    if !blocks.is_empty() {
        footed(blocks.last_mut()?, &gap)?;
    }
    Some(whole(blocks))
}

/// Blocks with a row or two that stand alone joined to the head below or the footer above them.
fn whole(blocks: Vec<Block>) -> Vec<Block> {
    let mut kept: Vec<Block> = Vec::new();
    let mut head = None;
    for mut block in blocks {
        if block.n_rows > 1 {
            if let Some(first) = head.take() {
                block.head = first;
            }
            kept.push(block);
        } else if let Some(before) = kept.last_mut() {
            let start = block.head;
            let last = block.strays.last().map_or(block.end, |stray| (stray.end, stray.last_line));
            before.strays.push(Stray { first_line: start.1, last_line: last.1, start: start.0, end: last.0 });
        } else {
            head = head.or(Some(block.head));
        }
    }
    kept
}

/// What stands above a new block belongs to its head; broken rows among it belonged to the block before.
fn finish(blocks: &mut [Block], gap: &mut Vec<Line<'_>>) -> Option<()> {
    if let Some(block) = blocks.last_mut() {
        let n_broken = gap.iter().take_while(|one| !matches!(one.class, Class::Words { .. })).count();
        footed(block, &gap[..n_broken])?;
    }
    gap.clear();
    Some(())
}

/// Lines behind the last row are left out, unless so many of them are broken rows that these are the data.
fn footed(block: &mut Block, gap: &[Line<'_>]) -> Option<()> {
    let n_broken = gap.iter().filter(|one| matches!(one.class, Class::Broken | Class::Row)).count();
    if n_broken > LONGEST_FOOTER.min(block.n_rows) {
        return None;
    }
    block.strays.extend(stray(gap));
    Some(())
}

fn stray(gap: &[Line<'_>]) -> Option<Stray> {
    let (first, last) = (gap.first()?, gap.last()?);
    Some(Stray { first_line: first.number, last_line: last.number, start: first.start, end: last.end })
}

/// Whether a line stands in the block's head already, or only numbers a page.
fn is_repeated(line: &Line<'_>, text: &[u8], block: &Block) -> bool {
    let plain = trimmed(line.bytes);
    let head = Lines { bytes: &text[block.head.0..block.start.0], at: 0 };
    is_page(plain) || head.into_iter().any(|(_, above)| trimmed(above) == plain)
}

/// Whether a row under a repeated head is the first of another acquisition: what rose in the first column falls back.
fn begins_anew(row: &[u8], text: &[u8], block: &Block, dialect: &Dialect) -> bool {
    let first = |line: &[u8]| {
        let mut found = None;
        each_field(line, dialect.delimiter, |field| {
            found = found.or_else(|| Some(crate::number::parse(&crate::line::unquoted(field), dialect.point)));
        });
        found.flatten()
    };
    let rows = Lines { bytes: &text[..block.end.0], at: block.start.0 };
    let rising: Vec<f64> = rows.take(ROWS_COMPARED).filter_map(|(_, line)| first(line)).collect();
    let whole = rising.len() > 2 && rising.windows(2).all(|pair| pair[0] < pair[1]);
    whole && first(row).is_some_and(|value| value < rising[1])
}

fn trimmed(line: &[u8]) -> &[u8] {
    line.trim_ascii().strip_prefix(b"\x0c").unwrap_or(line).trim_ascii()
}

fn is_page(line: &[u8]) -> bool {
    let line = trimmed(line).to_ascii_lowercase();
    [&b"page"[..], b"seite", b"pagina", b"- page"]
        .iter()
        .any(|word| line.strip_prefix(*word).is_some_and(|rest| rest.first().is_none_or(|b| !b.is_ascii_alphabetic())))
}

/// Whether a line is neither a row nor one that was meant as a row.
pub(crate) fn is_words(line: &[u8], dialect: &Dialect) -> bool {
    matches!(classed(line, dialect).0, Class::Nothing | Class::Words { .. })
}

fn classed(line: &[u8], dialect: &Dialect) -> (Class, usize) {
    if is_blank(line) || uncommented(line).is_some() {
        return (Class::Nothing, 0);
    }
    let (mut n_fields, mut n_filled, mut n_numbers, mut n_stamps, mut n_texts) = (0, 0, 0, 0, 0);
    let mut begins = Kind::Nothing;
    each_field(line, dialect.delimiter, |field| {
        n_fields += 1;
        let kind = dialect.kind(field);
        if kind != Kind::Nothing {
            n_filled = n_fields;
        }
        if n_fields == 1 {
            begins = kind;
        }
        match kind {
            Kind::Number => n_numbers += 1,
            Kind::Stamp => n_stamps += 1,
            Kind::Text => n_texts += 1,
            Kind::Nothing => {}
        }
    });
    let usual = dialect.kinds.len();
    if dialect.fits(line) {
        return (Class::Row, usual);
    }
    if n_filled == 0 {
        return (Class::Nothing, 0);
    }
    if n_numbers > 0 && n_texts == 0 {
        // One without its last cells is as wide as it was meant.
        return (Class::Row, n_fields);
    }
    if n_numbers > 0 && !is_page(line) {
        let mostly = 2 * (n_numbers + n_stamps) >= n_filled;
        let begins = begins == Kind::Number || begins == Kind::Stamp;
        let as_wide = n_fields >= dialect.n_required() && n_fields <= usual;
        if as_wide && (mostly || begins) {
            return (Class::Broken, n_fields);
        }
        if mostly && begins {
            return (Class::Row, n_fields);
        }
    }
    (Class::Words { names: n_texts > 1 && n_numbers == 0 }, n_fields)
}
