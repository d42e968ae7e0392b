use std::borrow::Cow;

use crate::error::{TextError, short};

/// How the bytes of a file spell characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8, of which ASCII is a part.
    Utf8,
    /// UTF-16, little end first.
    Utf16Le,
    /// UTF-16, big end first.
    Utf16Be,
    /// Bytes that are no UTF-8: taken as ISO 8859-1.
    Latin1,
}

impl Encoding {
    /// The usual name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Utf8 => "UTF-8",
            Self::Utf16Le | Self::Utf16Be => "UTF-16",
            Self::Latin1 => "Latin-1",
        }
    }
}

/// How far into the file its kind is judged.
const HEAD: usize = 4096;

/// The bytes with ASCII as ASCII (UTF-8 or Latin-1, without a byte order mark), how the file spelt them, and whether it
/// ends amid a character.
pub(crate) fn decode(bytes: &[u8]) -> Result<(Cow<'_, [u8]>, Encoding, bool), TextError> {
    let utf16 = match bytes {
        [0xff, 0xfe, rest @ ..] => Some((rest, Encoding::Utf16Le)),
        [0xfe, 0xff, rest @ ..] => Some((rest, Encoding::Utf16Be)),
        _ => unmarked_utf16(bytes).map(|encoding| (bytes, encoding)),
    };
    let (ascii, encoding) = match utf16 {
        Some((units, encoding)) => {
            let offset = bytes.len() - units.len();
            (Cow::Owned(from_utf16(units, encoding, offset)?), encoding)
        }
        None => {
            let body = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
            // Columns are ASCII in either; a name that is no UTF-8 shows within the head of any real file.
            let encoding = if is_utf8(&body[..body.len().min(16 * HEAD)]) { Encoding::Utf8 } else { Encoding::Latin1 };
            (Cow::Borrowed(body), encoding)
        }
    };
    let offset = bytes.len() - ascii.len().min(bytes.len());
    if ascii.contains(&0) {
        let at = ascii.iter().position(|&b| b == 0).unwrap_or(0);
        return Err(TextError::Binary { offset: at + offset, byte: 0 });
    }
    let head = &ascii[..ascii.len().min(HEAD)];
    let strange = |b: &u8| *b < 0x20 && !matches!(b, b'\t' | b'\n' | b'\r' | 0x0c | 0x1a);
    if let Some(at) = head.iter().position(strange) {
        return Err(TextError::Binary { offset: at + offset, byte: head[at] });
    }
    let halved = matches!(encoding, Encoding::Utf16Le | Encoding::Utf16Be) && !bytes.len().is_multiple_of(2);
    Ok((ascii, encoding, halved))
}

/// The characters of a piece of text: UTF-8 where it is valid, Latin-1 otherwise.
pub(crate) fn text(piece: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(piece) {
        Ok(valid) => Cow::Borrowed(valid),
        Err(_) => Cow::Owned(piece.iter().map(|&b| char::from(b)).collect()),
    }
}

/// A field as an error message shows it: one line, shortened, quoted.
pub(crate) fn shown(field: &[u8]) -> String {
    if field.is_empty() {
        return "nothing".to_owned();
    }
    format!("'{}'", short(&text(field)))
}

fn is_utf8(piece: &[u8]) -> bool {
    match std::str::from_utf8(piece) {
        Ok(_) => true,
        // A character cut in two by the end of the piece is no mistake.
        Err(error) => error.error_len().is_none(),
    }
}

/// UTF-16 without a mark: ASCII text has a NUL in every second byte, and hardly any in the others.
fn unmarked_utf16(bytes: &[u8]) -> Option<Encoding> {
    let head = &bytes[..bytes.len().min(HEAD) & !1];
    if head.len() < 4 {
        return None;
    }
    let (mut low, mut high) = (0, 0);
    for pair in head.chunks_exact(2) {
        low += usize::from(pair[0] == 0);
        high += usize::from(pair[1] == 0);
    }
    let n_pairs = head.len() / 2;
    if high * 10 > n_pairs * 9 && low * 100 <= n_pairs {
        Some(Encoding::Utf16Le)
    } else if low * 10 > n_pairs * 9 && high * 100 <= n_pairs {
        Some(Encoding::Utf16Be)
    } else {
        None
    }
}

fn from_utf16(bytes: &[u8], encoding: Encoding, start: usize) -> Result<Vec<u8>, TextError> {
    let units = bytes.chunks_exact(2).map(|pair| match encoding {
        Encoding::Utf16Be => u16::from_be_bytes([pair[0], pair[1]]),
        _ => u16::from_le_bytes([pair[0], pair[1]]),
    });
    let mut decoded = Vec::with_capacity(bytes.len() / 2 + 16);
    let mut at = start;
    for character in char::decode_utf16(units) {
        let character = character.map_err(|_| TextError::Utf16 { offset: at })?;
        decoded.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
        at += 2 * character.len_utf16();
    }
    Ok(decoded)
}
