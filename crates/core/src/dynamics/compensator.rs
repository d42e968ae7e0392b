//! Delay compensation: from target to command, once a sample.

use num_complex::Complex;

use super::check::{Checks, positive};
use super::history::{History, Motion};

/// How the command is made from the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compensation {
    /// command = target
    None,
    /// u_n = alpha I_n - (alpha - 1) I_(n-1) (Chen and Ricles 2009).
    Inverse {
        /// alpha_es: the samples that the actuator is believed to take.
        alpha: f64,
    },
    /// The polynomial through the last order + 1 targets, `delay_s` apart, read `delay_s` ahead (Horiuchi et al. 1999).
    Extrapolation {
        /// 1, 2 or 3.
        order: usize,
        /// The delay that it makes up for, s.
        delay_s: f64,
    },
}

impl Compensation {
    /// The weights of the targets, the newest first, and the samples between them.
    fn taps(&self, rate_hz: f64) -> (&[f64], f64) {
        match self {
            Compensation::None => (&[1.0], 1.0),
            Compensation::Inverse { .. } => (&[], 1.0),
            Compensation::Extrapolation { order, delay_s } => {
                let weights: &[f64] = match order {
                    1 => &[2.0, -1.0],
                    2 => &[3.0, -3.0, 1.0],
                    _ => &[4.0, -6.0, 4.0, -1.0],
                };
                (weights, delay_s * rate_hz)
            }
        }
    }

    /// Command over target at omega, rad/s.
    pub(crate) fn response(&self, omega: f64, rate_hz: f64) -> Complex<f64> {
        if let Compensation::Inverse { alpha } = self {
            return alpha - (alpha - 1.0) * Complex::from_polar(1.0, -omega / rate_hz);
        }
        let (weights, spacing) = self.taps(rate_hz);
        let back = |i: usize| Complex::from_polar(1.0, -omega * i as f64 * spacing / rate_hz);
        weights.iter().enumerate().map(|(i, w)| w * back(i)).sum()
    }

    pub(crate) fn check(&self, checks: &mut Checks, rate_hz: f64) {
        match self {
            Compensation::None => {}
            Compensation::Inverse { alpha } => {
                checks.demand("alpha", (1.0..=1e6).contains(alpha), "a number of samples from 1 to 1e6", alpha);
            }
            Compensation::Extrapolation { order, delay_s } => {
                checks.demand("order", (1..=3).contains(order), "1, 2 or 3", order);
                positive(checks, "delay_s", *delay_s);
                checks.demand(
                    "delay_s",
                    delay_s * rate_hz <= 1e6 || !(delay_s * rate_hz).is_finite(),
                    "at most a million samples",
                    delay_s,
                );
            }
        }
    }

    /// What it remembers, for one actuator.
    pub(crate) fn state(&self, rate_hz: f64) -> CompensatorState {
        let (weights, spacing) = self.taps(rate_hz);
        let reach = weights.len().max(2) as f64 * spacing.max(1.0);
        CompensatorState { targets: History::new(reach, 1.0 / rate_hz) }
    }

    /// The next command. A compensator that adapts will want `measured`, the sensor's last word, too.
    #[inline]
    pub(crate) fn step(&self, state: &mut CompensatorState, target: Motion, rate_hz: f64, _measured: f64) -> Motion {
        match self {
            Compensation::None => target,
            Compensation::Inverse { alpha } => {
                let before = state.targets.newest();
                state.targets.push(target);
                target * *alpha + before * (1.0 - alpha)
            }
            Compensation::Extrapolation { .. } => {
                state.targets.push(target);
                let (weights, spacing) = self.taps(rate_hz);
                let mut command = Motion::default();
                for (i, weight) in weights.iter().enumerate() {
                    command = command + state.targets.behind_samples(i as f64 * spacing) * *weight;
                }
                command
            }
        }
    }
}

/// The targets that a compensation looks back on.
#[derive(Debug, Clone)]
pub(crate) struct CompensatorState {
    targets: History,
}
