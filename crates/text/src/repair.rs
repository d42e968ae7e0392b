//! Rows whose fields run into each other, written as the program that made them meant them.

use crate::line::{Lines, is_blank, is_end, uncommented};

/// Commas both within and between numbers: `0,01,-1,5` under two names. Each first comma of two becomes a point.
///
/// `n_names` is what the header says. Without one every second field must be digits of one width, some with a zero in
/// front, as decimals are, and none of the others. None where this does not explain every row.
pub(crate) fn decimal_commas(text: &[u8], start: usize, n_names: Option<usize>) -> Option<Vec<u8>> {
    let mut width = None;
    let mut decimals: Vec<(usize, bool)> = Vec::new();
    let (mut n_rows, mut even) = (0, true);
    for (_, line) in (Lines { bytes: &text[start..], at: 0 }) {
        if is_blank(line) || uncommented(line).is_some() {
            continue;
        }
        let fields: Vec<&[u8]> = line.split(|&b| b == b',').map(<[u8]>::trim_ascii).collect();
        if *width.get_or_insert(fields.len()) != fields.len() || fields.len() % 2 == 1 || fields.len() < 4 {
            return None;
        }
        decimals.resize(fields.len() / 2, (0, false));
        for (pair, known) in fields.chunks_exact(2).zip(&mut decimals) {
            let whole = pair[0].strip_prefix(b"-").or_else(|| pair[0].strip_prefix(b"+")).unwrap_or(pair[0]);
            let digits = |piece: &[u8]| !piece.is_empty() && piece.iter().all(u8::is_ascii_digit);
            if !digits(whole) || !digits(pair[1]) {
                return None;
            }
            even &= (n_rows == 0 || known.0 == pair[1].len()) && (whole.len() == 1 || !whole.starts_with(b"0"));
            *known = (pair[1].len(), known.1 || pair[1].starts_with(b"0"));
        }
        n_rows += 1;
    }
    let width = width?;
    let digits = decimals.iter().all(|&(digits, _)| digits > 1) && decimals.iter().any(|&(_, zero)| zero);
    let plain = even && digits && n_rows >= 10;
    match n_names {
        Some(n_names) if 2 * n_names == width => {}
        None if plain => {}
        _ => return None,
    }
    let mut repaired = text.to_vec();
    let mut n_commas = 0;
    let mut comment = false;
    let mut begun = false;
    for (at, byte) in repaired.iter_mut().enumerate().skip(start) {
        if is_end(*byte) {
            (n_commas, begun) = (0, false);
        } else {
            if !begun && !byte.is_ascii_whitespace() {
                begun = true;
                comment = uncommented(&text[at..]).is_some();
            }
            if *byte == b',' && !comment {
                if n_commas % 2 == 0 {
                    *byte = b'.';
                }
                n_commas += 1;
            }
        }
    }
    Some(repaired)
}

/// Columns of a fixed width that leave no blank between two numbers: one is put there. None where there are none.
///
/// A sign behind a digit begins a number unless an exponent's letter stands between; without a sign a number ends behind
/// as many decimals as the last of the token has.
pub(crate) fn unfused(text: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() + text.len() / 8);
    let mut n_fused = 0;
    let mut at = 0;
    while at < text.len() {
        if text[at].is_ascii_whitespace() {
            out.push(text[at]);
            at += 1;
            continue;
        }
        let rest = &text[at..];
        let token = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        at += token.len();
        match pieces(token) {
            Some(found) => {
                n_fused += 1;
                out.extend_from_slice(&found.join(&b' '));
            }
            None => out.extend_from_slice(token),
        }
    }
    (n_fused > 0).then_some(out)
}

/// The numbers that a token is made of, two at least, each with a decimal point.
fn pieces(token: &[u8]) -> Option<Vec<&[u8]>> {
    let numeric = |b: &u8| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E' | b'd' | b'D');
    if token.len() > 4096 || token.iter().filter(|b| **b == b'.').count() < 2 || !token.iter().all(numeric) {
        return None;
    }
    let mut found = Vec::new();
    let mut from = 0;
    for at in 1..token.len() {
        let begins = matches!(token[at], b'+' | b'-') && (token[at - 1].is_ascii_digit() || token[at - 1] == b'.');
        if begins {
            found.push(&token[from..at]);
            from = at;
        }
    }
    found.push(&token[from..]);
    let mut divided = Vec::new();
    for piece in found {
        divided.extend(by_decimals(piece)?);
    }
    let whole = |piece: &&[u8]| piece.contains(&b'.') && crate::number::parse(piece, b'.').is_some();
    (divided.len() > 1 && divided.iter().all(whole)).then_some(divided)
}

/// Numbers of as many decimals as the last of them has.
fn by_decimals(piece: &[u8]) -> Option<Vec<&[u8]>> {
    if piece.iter().filter(|b| **b == b'.').count() < 2 {
        return Some(vec![piece]);
    }
    let n_decimals = piece.len() - 1 - piece.iter().rposition(|b| *b == b'.')?;
    let mut found = Vec::new();
    let mut rest = piece;
    while !rest.is_empty() {
        let end = rest.iter().position(|b| *b == b'.')? + 1 + n_decimals;
        let one = rest.get(..end)?;
        if n_decimals < 2 || !one[end - n_decimals..].iter().all(u8::is_ascii_digit) {
            return None;
        }
        found.push(one);
        rest = &rest[end..];
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::{decimal_commas, unfused};

    #[test]
    fn every_first_comma_of_two_is_a_point() {
        let text = b"t,x\n0,01,-1,5\n1,20,2,75\n";
        let found = decimal_commas(text, 4, Some(2)).unwrap();
        assert_eq!(found, b"t,x\n0.01,-1.5\n1.20,2.75\n");
        // Three names above four fields, a row with a whole number, and numbers that may be columns of their own.
        assert_eq!(decimal_commas(text, 4, Some(3)), None);
        assert_eq!(decimal_commas(b"0,01,-1,5\n1,2\n", 0, Some(2)), None);
        assert_eq!(decimal_commas(b"1,20,3,40\n2,21,4,41\n", 0, None), None);
    }

    #[test]
    fn numbers_without_a_blank_between_are_divided_by_sign_or_by_decimals() {
        let found = |text: &str| unfused(text.as_bytes()).map(|found| String::from_utf8(found).unwrap());
        assert_eq!(found("0.00-0.123-4.500\n").as_deref(), Some("0.00 -0.123 -4.500\n"));
        assert_eq!(found("1.5E-02-2.5E+01 3").as_deref(), Some("1.5E-02 -2.5E+01 3"));
        assert_eq!(found("12345.678912345.6789\n").as_deref(), Some("12345.6789 12345.6789\n"));
        for text in ["1.5 -2.5", "2021-03-04", "03.04.2021", "1.2.3", "1.5e-3", "v1.2-3.4"] {
            assert_eq!(found(text), None, "{text}");
        }
    }
}
