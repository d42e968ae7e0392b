//! What a setting is: its name, what it may be, its unit, its default, a line of help, and whom it concerns.
//!
//! [`configuration!`](crate::configuration!) makes a configuration and the table of its settings from one list. What comes from elsewhere (Python,
//! a command line, a file) is read by that table, so that every way in refuses the same in the same words.

use crate::error::{Error, Result};

/// A value as files, commands and other languages hand it over.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Nothing: not given, or without a limit.
    Nothing,
    /// Yes or no.
    Flag(bool),
    /// A whole number.
    Whole(i64),
    /// Any number.
    Number(f64),
    /// A word.
    Text(String),
    /// Two numbers.
    Pair(f64, f64),
    /// Something else, as it is written.
    Other(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Nothing => f.write_str("nothing"),
            Value::Flag(flag) => write!(f, "{flag}"),
            Value::Whole(number) => write!(f, "{number}"),
            Value::Number(number) => write!(f, "{number}"),
            Value::Text(text) => write!(f, "'{}'", text.escape_debug()),
            Value::Pair(low, high) => write!(f, "({low}, {high})"),
            // Whatever was written over several lines is told in one.
            Value::Other(text) => f.write_str(&text.split_whitespace().collect::<Vec<_>>().join(" ")),
        }
    }
}

/// What a setting may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Yes or no.
    Flag,
    /// A whole number in this range, both ends included.
    Whole(u64, u64),
    /// 1, 2, 4, ...
    PowerOfTwo,
    /// A finite number.
    Number,
    /// A finite number above zero.
    Positive,
    /// Zero or a finite number above it.
    NotNegative,
    /// A share from 0 to below 1.
    Share,
    /// Two frequencies, 0 <= low <= high.
    Band,
}

impl Kind {
    /// What is expected, in words.
    pub fn expected(&self, unit: &str) -> String {
        let (thing, unit) = match unit {
            "s" => ("duration", " in seconds"),
            "Hz" => ("frequency", " in hertz"),
            _ => ("number", ""),
        };
        match self {
            Kind::Choice(codes) => format!("one of {}", codes.join(", ")),
            Kind::Flag => "true or false".to_owned(),
            Kind::Whole(least, most) if *most == u64::from(u32::MAX) => format!("a whole number from {least} on"),
            Kind::Whole(least, most) => format!("a whole number from {least} to {most}"),
            Kind::PowerOfTwo => "a power of two (1, 2, 4, ...)".to_owned(),
            Kind::Number => format!("a finite number{unit}"),
            Kind::Positive => format!("a positive {thing}{unit}"),
            Kind::NotNegative => format!("zero or a positive {thing}{unit}"),
            Kind::Share => "a share from 0 to below 1".to_owned(),
            Kind::Band => "two finite frequencies 0 <= low <= high".to_owned(),
        }
    }

    /// Whether it may be this, as far as that can be said of it alone.
    fn takes(&self, value: &Value) -> bool {
        match (self, value) {
            (Kind::Whole(least, most), Value::Whole(n)) => {
                u64::try_from(*n).is_ok_and(|n| (*least..=*most).contains(&n))
            }
            (Kind::PowerOfTwo, Value::Whole(n)) => u64::try_from(*n).is_ok_and(u64::is_power_of_two),
            (Kind::Number | Kind::Positive | Kind::NotNegative | Kind::Share, Value::Whole(n)) => {
                self.takes(&Value::Number(*n as f64))
            }
            (Kind::Number, Value::Number(x)) => x.is_finite(),
            (Kind::Positive, Value::Number(x)) => x.is_finite() && *x > 0.0,
            (Kind::NotNegative, Value::Number(x)) => x.is_finite() && *x >= 0.0,
            (Kind::Share, Value::Number(x)) => (0.0..1.0).contains(x),
            (Kind::Band, Value::Pair(low, high)) => *low >= 0.0 && low <= high && high.is_finite(),
            (Kind::Choice(codes), Value::Text(text)) => codes.contains(&text.as_str()),
            (Kind::Flag, Value::Flag(_)) => true,
            _ => false,
        }
    }
}

/// Whom a setting concerns: a sum of these.
pub mod concerns {
    /// The evaluation of a record, whole or in moving windows.
    pub const EVALUATION: u8 = 1;
    /// Moving windows alone.
    pub const MOVING: u8 = 2;
    /// The monitor.
    pub const MONITOR: u8 = 4;
    /// A study over P and Q, in all its cells.
    pub const STUDY: u8 = 8;
    /// The monitor's alarms.
    pub const ALARMS: u8 = 16;
    /// It has no default: who sets the others must give it.
    pub const REQUIRED: u8 = 128;
}

/// A field of a configuration.
pub trait Field: Copy {
    /// Whether it may be nothing.
    const OPTIONAL: bool = false;

    /// From a value that its kind takes.
    fn read(value: &Value) -> Option<Self>;

    /// As a value.
    fn value(self) -> Value;
}

macro_rules! whole_fields {
    ($($type:ty),+) => {$(
        impl Field for $type {
            fn read(value: &Value) -> Option<Self> {
                if let Value::Whole(n) = value { Self::try_from(*n).ok() } else { None }
            }

            fn value(self) -> Value {
                Value::Whole(self as i64)
            }
        }
    )+};
}

whole_fields!(usize, u32, u64);

impl Field for f64 {
    fn read(value: &Value) -> Option<Self> {
        match value {
            Value::Number(x) => Some(*x),
            Value::Whole(n) => Some(*n as f64),
            _ => None,
        }
    }

    fn value(self) -> Value {
        Value::Number(self)
    }
}

impl Field for bool {
    fn read(value: &Value) -> Option<Self> {
        if let Value::Flag(flag) = value { Some(*flag) } else { None }
    }

    fn value(self) -> Value {
        Value::Flag(self)
    }
}

impl Field for (f64, f64) {
    fn read(value: &Value) -> Option<Self> {
        if let Value::Pair(low, high) = value { Some((*low, *high)) } else { None }
    }

    fn value(self) -> Value {
        Value::Pair(self.0, self.1)
    }
}

impl<T: Field> Field for Option<T> {
    const OPTIONAL: bool = true;

    fn read(value: &Value) -> Option<Self> {
        if *value == Value::Nothing { Some(None) } else { T::read(value).map(Some) }
    }

    fn value(self) -> Value {
        self.map_or(Value::Nothing, T::value)
    }
}

/// Words for an enum: its codes and how it is read and written as a setting. `NAMES` of the enum is the list.
macro_rules! choices {
    ($type:ty) => {
        impl $type {
            /// The names of all choices.
            pub const CODES: &'static [&'static str] = &{
                let mut codes = [""; Self::NAMES.len()];
                let mut i = 0;
                while i < codes.len() {
                    codes[i] = Self::NAMES[i].0;
                    i += 1;
                }
                codes
            };

            /// Its name.
            pub fn code(self) -> &'static str {
                Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(code, _)| code)
            }
        }

        impl $crate::setting::Field for $type {
            fn read(value: &$crate::setting::Value) -> Option<Self> {
                let $crate::setting::Value::Text(text) = value else { return None };
                Self::NAMES.iter().find(|(code, _)| code == text).map(|(_, choice)| *choice)
            }

            fn value(self) -> $crate::setting::Value {
                $crate::setting::Value::Text(self.code().to_owned())
            }
        }
    };
}
pub(crate) use choices;

/// A row of the table: one setting of the configuration `C`.
pub struct Setting<C> {
    /// Its name.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// Whether it may be nothing.
    pub optional: bool,
    /// Its unit: s, Hz, or nothing.
    pub unit: &'static str,
    /// Its name in a report.
    pub label: &'static str,
    /// What it does, lines that a space joins.
    pub help: &'static [&'static str],
    /// Whom it concerns, a sum of [`concerns`].
    pub concerns: u8,
    /// Its value.
    pub get: fn(&C) -> Value,
    /// Sets a value; nothing where it is of another kind.
    pub set: fn(&mut C, &Value) -> Option<()>,
}

impl<C> Setting<C> {
    /// Sets it.
    ///
    /// # Errors
    /// Those of [`Setting::refuse`].
    pub fn read(&self, config: &mut C, value: &Value) -> Result<()> {
        self.refuse(value)?;
        (self.set)(config, value).ok_or_else(|| self.error(value))
    }

    /// Refuses what it may not be.
    ///
    /// # Errors
    /// [`Error::Setting`], [`Error::NotPowerOfTwo`] and [`Error::Band`] for a number out of range; [`Error::Value`] for another kind.
    pub fn refuse(&self, value: &Value) -> Result<()> {
        if self.kind.takes(value) || (self.optional && *value == Value::Nothing) {
            Ok(())
        } else {
            Err(self.error(value))
        }
    }

    fn row(&self, usual: &C) -> Row {
        let Self { name, kind, optional, unit, label, help, concerns, .. } = *self;
        let help = help.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
        Row { name, kind, optional, unit, label, help, concerns, default: (self.get)(usual) }
    }

    fn error(&self, value: &Value) -> Error {
        let name = self.name;
        let expected = || self.kind.expected(self.unit);
        match (self.kind, value) {
            (Kind::PowerOfTwo, Value::Whole(n)) if *n >= 0 => Error::NotPowerOfTwo { name, found: *n as usize },
            (Kind::Band, Value::Pair(low_hz, high_hz)) => Error::Band { low_hz: *low_hz, high_hz: *high_hz },
            (Kind::Band | Kind::Choice(_) | Kind::Flag, _) => {
                Error::Value { name, expected: expected(), found: value.to_string() }
            }
            (_, Value::Whole(n)) => Error::Setting { name, expected: expected(), found: *n as f64 },
            (Kind::Whole(..) | Kind::PowerOfTwo, _) => {
                Error::Value { name, expected: expected(), found: value.to_string() }
            }
            (_, Value::Number(found)) => Error::Setting { name, expected: expected(), found: *found },
            _ => Error::Value { name, expected: expected(), found: value.to_string() },
        }
    }
}

/// What is known of a setting without a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// Whether it may be nothing.
    pub optional: bool,
    /// Its unit: s, Hz, or nothing.
    pub unit: &'static str,
    /// Its name in a report.
    pub label: &'static str,
    /// What it does.
    pub help: String,
    /// Whom it concerns, a sum of [`concerns`].
    pub concerns: u8,
    /// What it is where it is not given.
    pub default: Value,
}

/// A configuration with a table, and with another configuration in it, or [`()`] for none.
pub trait Configuration: Default + 'static {
    /// Its own settings, in their order.
    const TABLE: &'static [Setting<Self>];

    /// Which settings of the inner one are its own too.
    const CONCERNS: u8;

    /// The inner configuration's type.
    type Inner: Configuration;

    /// The inner configuration.
    fn inner(&self) -> Option<&Self::Inner>;

    /// The inner configuration, to be set.
    fn inner_mut(&mut self) -> Option<&mut Self::Inner>;

    /// All settings with their defaults, its own first.
    fn rows() -> Vec<Row> {
        let usual = Self::default();
        let mut rows: Vec<Row> = Self::TABLE.iter().map(|setting| setting.row(&usual)).collect();
        if let Some(inner) = usual.inner() {
            let shared = Self::Inner::TABLE.iter().filter(|setting| setting.concerns & Self::CONCERNS != 0);
            rows.extend(shared.map(|setting| setting.row(inner)));
        }
        rows
    }

    /// The names of all settings, its own first.
    fn names() -> impl Iterator<Item = &'static str> {
        let shared = Self::Inner::TABLE.iter().filter(|setting| setting.concerns & Self::CONCERNS != 0);
        Self::TABLE.iter().map(|setting| setting.name).chain(shared.map(|setting| setting.name))
    }

    /// A setting's value; `None` where there is no setting of this name.
    fn get(&self, name: &str) -> Option<Value> {
        if let Some(setting) = Self::TABLE.iter().find(|setting| setting.name == name) {
            return Some((setting.get)(self));
        }
        let shared = Self::Inner::TABLE.iter().find(|setting| setting.name == name);
        Some((shared.filter(|setting| setting.concerns & Self::CONCERNS != 0)?.get)(self.inner()?))
    }

    /// Sets one by its name; `None` where there is no setting of this name.
    fn set(&mut self, name: &str, value: &Value) -> Option<Result<()>> {
        if let Some(setting) = Self::TABLE.iter().find(|setting| setting.name == name) {
            return Some(setting.read(self, value));
        }
        let shared = Self::Inner::TABLE.iter().find(|setting| setting.name == name);
        Some(shared.filter(|setting| setting.concerns & Self::CONCERNS != 0)?.read(self.inner_mut()?, value))
    }

    /// Refuses what may be refused of each setting alone, the inner ones' too.
    ///
    /// # Errors
    /// Those of [`Setting::refuse`], of the first.
    fn check_each(&self) -> Result<()> {
        Self::TABLE.iter().try_for_each(|setting| setting.refuse(&(setting.get)(self)))?;
        self.inner().map_or(Ok(()), Self::Inner::check_each)
    }
}

impl Configuration for () {
    const TABLE: &'static [Setting<Self>] = &[];
    const CONCERNS: u8 = 0;
    type Inner = ();

    fn inner(&self) -> Option<&()> {
        None
    }

    fn inner_mut(&mut self) -> Option<&mut ()> {
        None
    }
}

/// A configuration from entries, what is left out by default; and everything that is wrong with them.
pub fn read<C: Configuration, N: AsRef<str>>(entries: impl IntoIterator<Item = (N, Value)>) -> (C, Vec<Error>) {
    let (mut config, mut errors) = (C::default(), Vec::new());
    for (name, value) in entries {
        match config.set(name.as_ref(), &value) {
            Some(read) => errors.extend(read.err()),
            None => {
                let known = C::names().collect::<Vec<_>>().join(", ");
                errors.push(Error::UnknownSetting { name: name.as_ref().to_owned(), known });
            }
        }
    }
    (config, errors)
}

/// Makes a configuration, its defaults and its table of one list. The lines of documentation are the help.
///
/// `name: type = default, kind, "unit", "label in a report", concerns;`, then `with inner: Type = default;` where there is one.
#[macro_export]
macro_rules! configuration {
    ($(#[$meta:meta])* pub struct $config:ident for $of_inner:expr => {
        $($(#[doc = $help:literal])+ $name:ident: $type:ty = $default:expr, $kind:expr, $unit:literal, $label:literal, $concerns:expr;)+
        $(with $(#[$inner_meta:meta])* $inner:ident: $inner_type:ty = $inner_default:expr;)?
    }) => {
        $(#[$meta])*
        pub struct $config {
            $($(#[doc = $help])+ pub $name: $type,)+
            $($(#[$inner_meta])* pub $inner: $inner_type,)?
        }

        impl Default for $config {
            fn default() -> Self {
                Self { $($name: $default,)+ $($inner: $inner_default,)? }
            }
        }

        impl $crate::setting::Configuration for $config {
            const CONCERNS: u8 = $of_inner;

            const TABLE: &'static [$crate::setting::Setting<Self>] = &[$($crate::setting::Setting {
                name: stringify!($name),
                kind: $kind,
                optional: <$type as $crate::setting::Field>::OPTIONAL,
                unit: $unit,
                label: $label,
                help: &[$($help),+],
                concerns: $concerns,
                get: |config| $crate::setting::Field::value(config.$name),
                set: |config, value| {
                    config.$name = $crate::setting::Field::read(value)?;
                    Some(())
                },
            }),+];

            $crate::configuration!(@inner $($inner: $inner_type)?);
        }
    };
    (@inner) => {
        type Inner = ();

        fn inner(&self) -> Option<&()> {
            None
        }

        fn inner_mut(&mut self) -> Option<&mut ()> {
            None
        }
    };
    (@inner $inner:ident: $type:ty) => {
        type Inner = $type;

        fn inner(&self) -> Option<&$type> {
            Some(&self.$inner)
        }

        fn inner_mut(&mut self) -> Option<&mut $type> {
            Some(&mut self.$inner)
        }
    };
}
