//! Converters between computer and rig.

use super::check::{Checks, LEAST, nonnegative};

/// Limit and quantum of a channel between computer and rig; its noise comes from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Largest magnitude; infinite for none.
    pub limit: f64,
    /// Step between neighbouring values; 0 for none.
    pub quantum: f64,
}

impl Default for Converter {
    fn default() -> Self {
        Self { limit: f64::INFINITY, quantum: 0.0 }
    }
}

impl Converter {
    /// The value that comes out.
    #[inline]
    pub fn convert(&self, value: f64) -> f64 {
        let held = value.clamp(-self.limit, self.limit);
        if self.quantum > 0.0 { (held / self.quantum).round() * self.quantum } else { held }
    }

    /// Whether it changes nothing.
    pub fn is_ideal(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn check(&self, checks: &mut Checks) {
        checks.demand("limit", self.limit >= LEAST, "a positive number", self.limit);
        nonnegative(checks, "quantum", self.quantum);
    }
}
