//! Every mistake of a configuration at once, each with the key it is about.

use std::fmt::Display;

use crate::error::{Error, Mistake};

/// Gathers mistakes under a prefix of keys.
#[derive(Debug, Default)]
pub(crate) struct Checks {
    prefix: String,
    pub(crate) mistakes: Vec<Mistake>,
}

impl Checks {
    /// Runs `check` with keys that begin with `prefix`.
    pub(crate) fn under(&mut self, prefix: &str, check: impl FnOnce(&mut Self)) {
        let outer = std::mem::take(&mut self.prefix);
        self.prefix = format!("{outer}{prefix}.");
        check(self);
        self.prefix = outer;
    }

    /// A mistake in words.
    pub(crate) fn mistake(&mut self, key: &str, message: impl Into<String>) {
        self.mistakes.push(Mistake { key: format!("{}{key}", self.prefix), message: message.into() });
    }

    /// A mistake unless `holds`.
    pub(crate) fn demand(&mut self, key: &str, holds: bool, expected: &str, found: impl Display) {
        if !holds {
            self.mistake(key, format!("expected {expected}, found {found}"));
        }
    }
}

/// Numbers beyond these are no laboratory's, and their products would leave double precision.
pub(crate) const LEAST: f64 = 1e-30;
pub(crate) const MOST: f64 = 1e30;
pub(crate) const RANGE: &str = "a number between 1e-30 and 1e30";

pub(crate) fn positive(checks: &mut Checks, key: &str, found: f64) {
    let expected = if found > 0.0 { RANGE } else { "a positive number" };
    checks.demand(key, (LEAST..=MOST).contains(&found), expected, found);
}

pub(crate) fn nonnegative(checks: &mut Checks, key: &str, found: f64) {
    let sound = found == 0.0 || (LEAST..=MOST).contains(&found);
    checks.demand(key, sound, if found > 0.0 { RANGE } else { "a number of at least 0" }, found);
}

/// One mistake alone.
pub(crate) fn configuration(key: &str, message: &str) -> Error {
    Error::Configuration(vec![Mistake { key: key.into(), message: message.into() }])
}
