//! Delay compensation: from target to command, once a sample.

use std::fmt;

use num_complex::Complex;

use super::check::{Checks, configuration, positive};
use super::history::{History, Motion};
use crate::error::Result;

/// What a compensator knows of the sample at hand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) target: Motion,
    /// The command sent a sample ago.
    #[allow(dead_code, reason = "for compensators that adapt")]
    pub(crate) command: f64,
    /// What the sensor said last.
    #[allow(dead_code, reason = "for compensators that adapt")]
    pub(crate) measured: f64,
}

/// A compensator: the plan is immutable, what changes with the samples is its state.
pub(crate) trait Compensator: Sized {
    /// The names of its numbers.
    const PARAMETERS: &'static [&'static str];
    type State;

    /// What is wrong with its numbers.
    fn check(numbers: &[f64], checks: &mut Checks, rate_hz: f64);

    fn new(numbers: &[f64], rate_hz: f64) -> Self;

    /// Command over target at omega, rad/s; None where it is no linear filter.
    fn response(&self, omega: f64) -> Option<Complex<f64>>;

    fn state(&self) -> Self::State;

    /// The next command.
    fn step(&self, state: &mut Self::State, seen: Seen) -> Motion;
}

/// Every compensator, by the name that configurations give it.
static COMPENSATORS: &[Kind] = &[Kind::of::<Inverse>("inverse"), Kind::of::<Extrapolation>("extrapolation")];

/// u_n = alpha I_n - (alpha - 1) I_(n-1) (Chen and Ricles 2009); alpha: samples that the actuator is believed to take.
struct Inverse {
    alpha: f64,
    rate_hz: f64,
}

impl Compensator for Inverse {
    const PARAMETERS: &'static [&'static str] = &["alpha"];
    /// The target before.
    type State = Motion;

    fn check(numbers: &[f64], checks: &mut Checks, _: f64) {
        let alpha = numbers[0];
        checks.demand("alpha", (1.0..=1e6).contains(&alpha), "a number of samples from 1 to 1e6", alpha);
    }

    fn new(numbers: &[f64], rate_hz: f64) -> Self {
        Self { alpha: numbers[0], rate_hz }
    }

    fn response(&self, omega: f64) -> Option<Complex<f64>> {
        Some(self.alpha - (self.alpha - 1.0) * Complex::from_polar(1.0, -omega / self.rate_hz))
    }

    fn state(&self) -> Motion {
        Motion::default()
    }

    #[inline]
    fn step(&self, before: &mut Motion, seen: Seen) -> Motion {
        let before = std::mem::replace(before, seen.target);
        seen.target * self.alpha + before * (1.0 - self.alpha)
    }
}

/// The polynomial through the last order + 1 targets, `delay_s` apart, read `delay_s` ahead (Horiuchi et al. 1999).
struct Extrapolation {
    /// Of the targets, the newest first.
    weights: &'static [f64],
    /// Samples between them.
    spacing: f64,
    rate_hz: f64,
}

impl Compensator for Extrapolation {
    const PARAMETERS: &'static [&'static str] = &["order", "delay_s"];
    type State = History;

    fn check(numbers: &[f64], checks: &mut Checks, rate_hz: f64) {
        let (order, delay_s) = (numbers[0], numbers[1]);
        checks.demand("order", [1.0, 2.0, 3.0].contains(&order), "1, 2 or 3", order);
        positive(checks, "delay_s", delay_s);
        let samples = delay_s * rate_hz;
        checks.demand("delay_s", samples <= 1e6 || !samples.is_finite(), "at most a million samples", delay_s);
    }

    fn new(numbers: &[f64], rate_hz: f64) -> Self {
        let weights: &[f64] = match numbers[0] {
            1.0 => &[2.0, -1.0],
            2.0 => &[3.0, -3.0, 1.0],
            _ => &[4.0, -6.0, 4.0, -1.0],
        };
        Self { weights, spacing: numbers[1] * rate_hz, rate_hz }
    }

    fn response(&self, omega: f64) -> Option<Complex<f64>> {
        let back = |i: usize| Complex::from_polar(1.0, -omega * i as f64 * self.spacing / self.rate_hz);
        Some(self.weights.iter().enumerate().map(|(i, w)| w * back(i)).sum())
    }

    fn state(&self) -> History {
        History::new(self.weights.len() as f64 * self.spacing.max(1.0), 1.0 / self.rate_hz)
    }

    #[inline]
    fn step(&self, targets: &mut History, seen: Seen) -> Motion {
        targets.push(seen.target);
        let mut command = Motion::default();
        for (i, weight) in self.weights.iter().enumerate() {
            command = command + targets.behind_samples(i as f64 * self.spacing) * *weight;
        }
        command
    }
}

/// A row of the table: a compensator's name, the names of its numbers, and its type behind functions.
struct Kind {
    name: &'static str,
    parameters: &'static [&'static str],
    check: fn(&[f64], &mut Checks, f64),
    response: fn(&[f64], f64, f64) -> Option<Complex<f64>>,
    start: fn(&[f64], f64) -> Box<dyn Running>,
}

impl Kind {
    const fn of<C: Compensator + 'static>(name: &'static str) -> Self {
        Self {
            name,
            parameters: C::PARAMETERS,
            check: C::check,
            response: |numbers, rate_hz, omega| C::new(numbers, rate_hz).response(omega),
            start: |numbers, rate_hz| {
                let plan = C::new(numbers, rate_hz);
                Box::new(Started { state: plan.state(), plan })
            },
        }
    }
}

/// A compensator with its state, whichever it is.
pub(crate) trait Running {
    fn step(&mut self, seen: Seen) -> Motion;
}

struct Started<C: Compensator> {
    plan: C,
    state: C::State,
}

impl<C: Compensator> Running for Started<C> {
    #[inline]
    fn step(&mut self, seen: Seen) -> Motion {
        self.plan.step(&mut self.state, seen)
    }
}

/// How the command is made from the target: one of the compensators with its numbers, or none: command = target.
#[derive(Clone, Default)]
pub struct Compensation {
    chosen: Option<(&'static Kind, Vec<f64>)>,
}

impl Compensation {
    /// command = target
    pub const NONE: Self = Self { chosen: None };

    /// A compensator of the table, its numbers by name.
    ///
    /// # Errors
    /// [`Error::Configuration`](crate::Error::Configuration) for a name that is none; what the numbers may be is told
    /// with the rest of the test.
    pub fn new(name: &str, number: impl Fn(&str) -> Option<f64>) -> Result<Self> {
        let Some(kind) = COMPENSATORS.iter().find(|kind| kind.name == name) else {
            let names: Vec<_> = COMPENSATORS.iter().map(|kind| kind.name).collect();
            return Err(configuration("compensation.kind", &format!("expected {}, found {name}", names.join(" or "))));
        };
        let missing = |one: &str| configuration(&format!("compensation.{one}"), "missing: expected a number");
        let numbers = kind.parameters.iter().map(|one| number(one).ok_or_else(|| missing(one)));
        Ok(Self { chosen: Some((kind, numbers.collect::<Result<_>>()?)) })
    }

    pub(crate) fn check(&self, checks: &mut Checks, rate_hz: f64) {
        if let Some((kind, numbers)) = &self.chosen {
            (kind.check)(numbers, checks, rate_hz);
        }
    }

    /// Command over target at omega, rad/s; None where it is no linear filter.
    pub(crate) fn response(&self, omega: f64, rate_hz: f64) -> Option<Complex<f64>> {
        let Some((kind, numbers)) = &self.chosen else { return Some(Complex::new(1.0, 0.0)) };
        (kind.response)(numbers, rate_hz, omega)
    }

    /// Ready for the first sample of one actuator; None where command = target.
    pub(crate) fn start(&self, rate_hz: f64) -> Option<Box<dyn Running>> {
        self.chosen.as_ref().map(|(kind, numbers)| (kind.start)(numbers, rate_hz))
    }
}

impl PartialEq for Compensation {
    fn eq(&self, other: &Self) -> bool {
        let told = |one: &Self| one.chosen.as_ref().map(|(kind, numbers)| (kind.name, numbers.clone()));
        told(self) == told(other)
    }
}

impl fmt::Debug for Compensation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((kind, numbers)) = &self.chosen else { return f.write_str("None") };
        f.debug_tuple(kind.name).field(numbers).finish()
    }
}
