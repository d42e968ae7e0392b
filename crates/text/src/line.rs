//! Lines and fields.

use std::borrow::Cow;

use crate::delimiter::Delimiter;

/// The lines of a piece of text, ended by LF, CR LF or CR, without their ends.
pub(crate) struct Lines<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) at: usize,
}

impl<'a> Iterator for Lines<'a> {
    /// Offset of the line and the line.
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let start = self.at;
        let rest = self.bytes.get(start..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|&b| is_end(b)).unwrap_or(rest.len());
        self.at = after_end(self.bytes, start + length);
        Some((start, &rest[..length]))
    }
}

#[inline]
pub(crate) fn is_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

/// The offset after the line end at `at`.
#[inline]
pub(crate) fn after_end(bytes: &[u8], at: usize) -> usize {
    match (bytes.get(at), bytes.get(at + 1)) {
        (Some(b'\r'), Some(b'\n')) => at + 2,
        (Some(b'\r' | b'\n'), _) => at + 1,
        _ => at,
    }
}

/// Nothing but blanks, or the end-of-file mark of old systems.
pub(crate) fn is_blank(line: &[u8]) -> bool {
    line.iter().all(|b| matches!(b, b' ' | b'\t' | 0x0c | 0x1a))
}

/// The line without the comment mark in front (#, %, //), if it has one.
pub(crate) fn uncommented(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_start();
    line.strip_prefix(b"#").or_else(|| line.strip_prefix(b"%")).or_else(|| line.strip_prefix(b"//"))
}

/// The end of the field that starts at `at`: the delimiter or line end behind it.
///
/// A quote at the start runs to its closing quote ("" is a quote within); one that is never closed on its line is an
/// ordinary character.
pub(crate) fn field_end(bytes: &[u8], at: usize, delimiter: Delimiter) -> usize {
    let mut from = at;
    while bytes.get(from) == Some(&b' ') {
        from += 1;
    }
    if bytes.get(from) == Some(&b'"') {
        let mut scan = from + 1;
        while let Some(&b) = bytes.get(scan).filter(|b| !is_end(**b)) {
            scan += 1;
            if b == b'"' {
                if bytes.get(scan) == Some(&b'"') {
                    scan += 1;
                } else {
                    from = scan;
                    break;
                }
            }
        }
    }
    let rest = bytes.get(from..).unwrap_or_default();
    from + rest.iter().position(|&b| is_end(b) || delimiter.is(b)).unwrap_or(rest.len())
}

/// The fields of one line, blanks around them taken off and quotes kept.
pub(crate) fn fields(line: &[u8], delimiter: Delimiter) -> Vec<&[u8]> {
    let mut found = Vec::new();
    each_field(line, delimiter, |field| found.push(field));
    found
}

pub(crate) fn each_field<'a>(line: &'a [u8], delimiter: Delimiter, mut take: impl FnMut(&'a [u8])) {
    let mut at = 0;
    if delimiter == Delimiter::Blanks {
        loop {
            while line.get(at).is_some_and(|&b| delimiter.is(b)) {
                at += 1;
            }
            if at >= line.len() {
                return;
            }
            let end = field_end(line, at, delimiter);
            take(&line[at..end]);
            at = end;
        }
    }
    loop {
        let end = field_end(line, at, delimiter);
        take(line[at..end].trim_ascii());
        if end >= line.len() {
            return;
        }
        at = end + 1;
    }
}

/// A field without the quotes around it.
pub(crate) fn unquoted(field: &[u8]) -> Cow<'_, [u8]> {
    match field {
        [b'"', inner @ .., b'"'] if inner.windows(2).any(|w| w == b"\"\"") => {
            let mut plain = Vec::with_capacity(inner.len());
            let mut quotes = 0;
            for &b in inner {
                quotes = if b == b'"' { quotes + 1 } else { 0 };
                if quotes != 2 {
                    plain.push(b);
                } else {
                    quotes = 0;
                }
            }
            Cow::Owned(plain.trim_ascii().to_vec())
        }
        [b'"', inner @ .., b'"'] => Cow::Borrowed(inner.trim_ascii()),
        _ => Cow::Borrowed(field),
    }
}

#[cfg(test)]
mod tests {
    use super::{Lines, fields, unquoted};
    use crate::delimiter::Delimiter;

    #[test]
    fn lines_end_with_any_of_the_three_customs() {
        let lines: Vec<_> = Lines { bytes: b"a\r\nb\nc\r\rd", at: 0 }.map(|(_, line)| line).collect();
        assert_eq!(lines, [&b"a"[..], b"b", b"c", b"", b"d"]);
    }

    #[test]
    fn a_delimiter_within_quotes_does_not_divide() {
        assert_eq!(fields(br#" "a, b" , c,"#, Delimiter::Comma), [&br#""a, b""#[..], b"c", b""]);
        assert_eq!(fields(br#""a ""b, c"" d", 1"#, Delimiter::Comma), [&br#""a ""b, c"" d""#[..], b"1"]);
        assert_eq!(fields(br#"5" stroke, 1"#, Delimiter::Comma), [&br#"5" stroke"#[..], b"1"]);
        assert_eq!(fields(br#""never closed, 1"#, Delimiter::Comma), [&br#""never closed"#[..], b"1"]);
        assert_eq!(fields(b"  1\t 2  3 ", Delimiter::Blanks), [b"1", b"2", b"3"]);
    }

    #[test]
    fn quotes_come_off() {
        assert_eq!(&*unquoted(br#""a ""b"" c""#), br#"a "b" c"#);
        assert_eq!(&*unquoted(br#"""#), br#"""#);
        assert_eq!(&*unquoted(br#""""#), b"");
    }
}
