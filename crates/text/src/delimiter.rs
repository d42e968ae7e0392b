//! What stands between two fields of a row.

/// What stands between two fields of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delimiter {
    /// A tab.
    Tab,
    /// A semicolon.
    Semicolon,
    /// A comma.
    Comma,
    /// A vertical bar.
    Bar,
    /// Any number of blanks and tabs.
    Blanks,
}

impl Delimiter {
    /// The word for it in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tab => "tab",
            Self::Semicolon => "semicolon",
            Self::Comma => "comma",
            Self::Bar => "'|'",
            Self::Blanks => "blanks",
        }
    }

    #[inline]
    pub(crate) fn is(self, byte: u8) -> bool {
        match self {
            Self::Tab => byte == b'\t',
            Self::Semicolon => byte == b';',
            Self::Comma => byte == b',',
            Self::Bar => byte == b'|',
            Self::Blanks => byte == b' ' || byte == b'\t',
        }
    }
}
