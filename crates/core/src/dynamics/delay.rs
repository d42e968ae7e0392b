//! How long an actuator lags: a constant, or a history.

use super::check::{Checks, nonnegative};

/// How long the actuator lags.
#[derive(Debug, Clone, PartialEq)]
pub enum Delay {
    /// tau, s.
    Constant(f64),
    /// tau(t), linear between the points and constant outside them.
    Varying {
        /// s, rising.
        time_s: Vec<f64>,
        /// s.
        delay_s: Vec<f64>,
    },
}

impl Delay {
    /// tau and its rate of change at time t.
    #[inline]
    pub fn at(&self, time: f64) -> (f64, f64) {
        match self {
            Delay::Constant(delay) => (*delay, 0.0),
            Delay::Varying { time_s, delay_s } => {
                let after = time_s.partition_point(|t| *t <= time);
                if after == 0 || after == time_s.len() {
                    return (delay_s[after.saturating_sub(1)], 0.0);
                }
                let slope = (delay_s[after] - delay_s[after - 1]) / (time_s[after] - time_s[after - 1]);
                (delay_s[after - 1] + slope * (time - time_s[after - 1]), slope)
            }
        }
    }

    /// A history that stands still is a constant.
    pub(crate) fn plain(self) -> Self {
        let (low, high) = self.range();
        if low == high { Delay::Constant(low) } else { self }
    }

    /// The shortest and the longest.
    pub fn range(&self) -> (f64, f64) {
        match self {
            Delay::Constant(delay) => (*delay, *delay),
            Delay::Varying { delay_s, .. } => {
                delay_s.iter().fold((f64::INFINITY, 0.0), |(low, high), d| (d.min(low), d.max(high)))
            }
        }
    }

    pub(super) fn check(&self, checks: &mut Checks) {
        match self {
            Delay::Constant(delay) => nonnegative(checks, "delay_s", *delay),
            Delay::Varying { time_s, delay_s } => {
                let same = time_s.len() == delay_s.len() && !time_s.is_empty();
                let lengths = format!("{} and {}", time_s.len(), delay_s.len());
                checks.demand("delay_s", same, "as many delays as times, at least one", lengths);
                let rising = time_s.iter().all(|t| t.is_finite()) && time_s.windows(2).all(|t| t[0] < t[1]);
                checks.demand("delay_s.time_s", rising, "finite times that rise", format!("{time_s:?}"));
                for delay in delay_s {
                    nonnegative(checks, "delay_s.delay_s", *delay);
                }
                let repeats = time_s.windows(2).zip(delay_s.windows(2)).any(|(t, d)| d[1] - d[0] >= t[1] - t[0]);
                checks.demand(
                    "delay_s.delay_s",
                    !(rising && repeats),
                    "delays that grow by less than time does",
                    "a faster growth (the past would repeat)",
                );
            }
        }
    }
}
