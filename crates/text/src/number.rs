//! Numbers: the value of a token is that of `str::parse::<f64>`, which is correctly rounded (as Python's `float` is).

const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The number that starts at `at`, with the offset after it, where that takes one rounding only.
///
/// Digits that fit 53 bits and a power of ten up to 22 are both exact, so their product or quotient is rounded once
/// and correctly (Clinger 1990). Everything else is None and goes the slow way.
#[inline]
pub(crate) fn exact(bytes: &[u8], mut at: usize, point: u8) -> Option<(f64, usize)> {
    let digit = |at: usize| match bytes.get(at) {
        Some(b) if b.is_ascii_digit() => Some(u64::from(b - b'0')),
        _ => None,
    };
    let negative = match bytes.get(at)? {
        b'-' => {
            at += 1;
            true
        }
        b'+' => {
            at += 1;
            false
        }
        _ => false,
    };
    let mut mantissa = 0u64;
    let first = at;
    while let Some(d) = digit(at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(d);
        at += 1;
    }
    let mut n_digits = at - first;
    let mut exponent = 0i32;
    if bytes.get(at) == Some(&point) {
        at += 1;
        let fraction = at;
        while let Some(d) = digit(at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(d);
            at += 1;
        }
        if point == b',' && at == fraction {
            return None;
        }
        n_digits += at - fraction;
        exponent = -i32::try_from(at - fraction).ok()?;
    }
    if n_digits == 0 || n_digits > 18 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        at += 1;
        let down = match bytes.get(at)? {
            b'-' => {
                at += 1;
                true
            }
            b'+' => {
                at += 1;
                false
            }
            _ => false,
        };
        let start = at;
        let mut power = 0i32;
        while let Some(d) = digit(at) {
            power = power * 10 + d as i32;
            at += 1;
            if at - start > 4 {
                return None;
            }
        }
        if at == start {
            return None;
        }
        exponent += if down { -power } else { power };
    }
    if mantissa > 1 << 53 {
        return None;
    }
    let value = mantissa as f64;
    let value = match exponent {
        0 => value,
        1..=22 => value * POWERS_OF_TEN[exponent as usize],
        -22..=-1 => value / POWERS_OF_TEN[-exponent as usize],
        _ => return None,
    };
    Some((if negative { -value } else { value }, at))
}

/// The value of a whole token without blanks around it, or None if it is no number.
///
/// Besides what `str::parse::<f64>` takes: a decimal comma, Fortran's exponent D, and the words for a value that is
/// missing or not finite (NaN, NA, null, 1.#QNAN, ...).
pub(crate) fn parse(token: &[u8], point: u8) -> Option<f64> {
    if let Some((value, end)) = exact(token, 0, point)
        && end == token.len()
    {
        return Some(value);
    }
    if token.len() > 400 || !token.is_ascii() {
        return None;
    }
    let mut lower = token.to_ascii_lowercase();
    if point == b',' {
        if token.contains(&b'.') && !token.contains(&b'#') || token.last() == Some(&b',') {
            return None;
        }
        for b in &mut lower {
            if *b == b',' {
                *b = b'.';
            }
        }
    }
    let text = std::str::from_utf8(&lower).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    match text {
        "na" | "n/a" | "#n/a" | "null" | "none" | "nan(ind)" | "-nan(ind)" | "1.#qnan" | "-1.#qnan" | "1.#ind"
        | "-1.#ind" | "1.#snan" => Some(f64::NAN),
        "1.#inf" => Some(f64::INFINITY),
        "-1.#inf" => Some(f64::NEG_INFINITY),
        _ => fortran(text),
    }
}

/// The value of a token with marks between groups of three digits: `1,234.5`, `1.234,5`, `1'234.5`, `1 234.5`.
///
/// `sure` asks that it cannot be read otherwise: `1,234` may have three decimals.
#[cold]
#[inline(never)]
pub(crate) fn grouped(token: &[u8], point: u8, sure: bool) -> Option<f64> {
    // Most tokens end here: one to three digits, no zero first, then a mark that is not the decimal one.
    let digits = token.strip_prefix(b"-").or_else(|| token.strip_prefix(b"+")).unwrap_or(token);
    let first = digits.iter().take(4).take_while(|b| b.is_ascii_digit()).count();
    let mark = *digits.get(first)?;
    if !(1..=3).contains(&first) || digits[0] == b'0' || mark == point || token.len() > 60 {
        return None;
    }
    let group = &digits[first + 1..];
    let three = group.iter().take(4).take_while(|b| b.is_ascii_digit()).count() == 3;
    let one_byte = three && matches!(mark, b',' | b'.' | b'\'' | b' ' | 0xa0);
    if !one_byte && !matches!(mark, 0xc2 | 0xe2) {
        return None;
    }
    let numeric = |b: &u8| b.is_ascii_digit() || matches!(b, b',' | b'.' | b'\'' | b' ' | 0x80..);
    if !digits.iter().all(numeric) {
        return None;
    }
    // The blanks that typesetters use: without a break, thin, narrow; the first in Latin-1 too.
    let text: String = match std::str::from_utf8(token) {
        Ok(text) => text.to_owned(),
        Err(_) => token.iter().map(|&b| char::from(b)).collect(),
    };
    let point = char::from(point);
    let (whole, decimals) = text.split_once(point).map_or((&*text, None), |(whole, rest)| (whole, Some(rest)));
    let digits = whole.strip_prefix(['-', '+']).unwrap_or(whole);
    let mark = digits.chars().find(|c| !c.is_ascii_digit())?;
    if mark == point || !matches!(mark, ',' | '.' | '\'' | ' ' | '\u{a0}' | '\u{2009}' | '\u{202f}' | '\u{2019}') {
        return None;
    }
    let groups: Vec<&str> = digits.split(mark).collect();
    let first = groups[0].len();
    let apart = groups[1..].iter().all(|group| group.len() == 3) && (1..=3).contains(&first);
    let numeric = groups.iter().all(|group| group.bytes().all(|b| b.is_ascii_digit()));
    let fraction = decimals.is_none_or(|rest| rest.bytes().all(|b| b.is_ascii_digit()));
    let doubtful = decimals.is_none() && groups.len() == 2 && matches!(mark, ',' | '.' | ' ');
    if !(apart && numeric && fraction) || sure && doubtful {
        return None;
    }
    let sign = if whole.starts_with('-') { "-" } else { "" };
    format!("{sign}{}.{}", groups.concat(), decimals.unwrap_or_default()).parse().ok()
}

/// `1.5d+03`: the exponent letter of double precision in Fortran.
fn fortran(text: &str) -> Option<f64> {
    let (digits, power) = text.split_once('d')?;
    if !digits.ends_with(|c: char| c.is_ascii_digit() || c == '.') || power.is_empty() {
        return None;
    }
    format!("{digits}e{power}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::{exact, grouped, parse};
    use proptest::prelude::*;

    #[test]
    fn words_for_a_missing_value_are_nan() {
        for word in ["nan", "NaN", "-nan", "NA", "n/a", "null", "1.#QNAN", "-1.#IND"] {
            assert!(parse(word.as_bytes(), b'.').unwrap().is_nan(), "{word}");
        }
        assert_eq!(parse(b"-Inf", b'.'), Some(f64::NEG_INFINITY));
        assert_eq!(parse(b"1.#INF", b'.'), Some(f64::INFINITY));
    }

    #[test]
    fn what_is_not_a_number_is_refused() {
        for word in ["", "-", ".", "e5", "1e", "1_000", "0x10", "1,5", "1.5 mm", "1-2", "--1", "abc", "d5", "1d"] {
            assert_eq!(parse(word.as_bytes(), b'.'), None, "{word}");
        }
        for word in ["1.5", "1,", ",", "1,5,5", "1.234,5"] {
            assert_eq!(parse(word.as_bytes(), b','), None, "{word}");
        }
    }

    #[test]
    fn digits_beyond_64_bits_do_not_wrap_around() {
        // 2^64 + 1, 2^64 / 10 and their like.
        for token in ["18446744073709551617", "1844674407370955.1617", "9007199254740993", "0.18446744073709551617e20"]
        {
            assert_eq!(parse(token.as_bytes(), b'.'), token.parse().ok(), "{token}");
        }
    }

    #[test]
    fn marks_between_thousands_are_none_within_numbers() {
        let cases: [(&str, u8, f64); 7] = [
            ("1,234.5", b'.', 1234.5),
            ("-1,234,567", b'.', -1_234_567.0),
            ("1.234,5", b',', 1234.5),
            ("1'234.25", b'.', 1234.25),
            ("1'234", b'.', 1234.0),
            ("+12 345,5", b',', 12345.5),
            ("1\u{a0}234.5", b'.', 1234.5),
        ];
        for (token, point, value) in cases {
            assert_eq!(grouped(token.as_bytes(), point, true), Some(value), "{token}");
        }
        assert_eq!(grouped(b"1,234", b'.', false), Some(1234.0));
        assert_eq!(grouped(b"1,234", b'.', true), None);
        for token in ["0,123.5", "12,34.5", "1,2345", "1,234e5", "1234.5", "1,234.5.6", ",123.5", "1,,234.5"] {
            assert_eq!(grouped(token.as_bytes(), b'.', false), None, "{token}");
        }
    }

    #[test]
    fn a_fortran_exponent_is_an_exponent() {
        assert_eq!(parse(b"1.5D+03", b'.'), Some(1500.0));
        assert_eq!(parse(b"-2d-1", b'.'), Some(-0.2));
    }

    fn same(token: &str) -> Result<(), TestCaseError> {
        let expected: f64 = token.parse().unwrap();
        let found = parse(token.as_bytes(), b'.').unwrap();
        prop_assert_eq!(found.to_bits(), expected.to_bits(), "{}", token);
        let with_comma = token.replace('.', ",");
        if !token.ends_with('.') {
            let found = parse(with_comma.as_bytes(), b',').unwrap();
            prop_assert_eq!(found.to_bits(), expected.to_bits(), "{}", with_comma);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn every_token_has_the_value_of_the_standard_library(
            token in r"[-+]?([0-9]{1,22}(\.[0-9]{0,22})?|\.[0-9]{1,22})([eE][-+]?[0-9]{1,3})?"
        ) {
            same(&token)?;
        }

        #[test]
        fn every_double_comes_back_from_its_shortest_form(value in any::<f64>()) {
            prop_assume!(value.is_finite());
            same(&format!("{value:?}"))?;
            same(&format!("{value:e}"))?;
        }

        #[test]
        fn the_fast_way_never_reads_past_a_number(digits in "[0-9]{1,9}", rest in "[,; x]?[0-9]{0,3}") {
            let line = format!("{digits}{rest}");
            if let Some((_, end)) = exact(line.as_bytes(), 0, b'.') {
                prop_assert!(end <= line.len());
            }
        }
    }
}
