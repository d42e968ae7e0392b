//! What is asked of a virtual test: to run, and what its loop bears.

use std::f64::consts::PI;

use num_complex::Complex;

use super::check::{Checks, configuration};
use super::delay::Delay;
use super::history::Motion;
use super::plant::Dynamics;
use super::sampled_actuator::SampledActuator;
use super::stability::{CriticalDelay, DelayDamping, Loop};
use super::virtual_test::{Drive, Noise, Run, Stepping, VirtualTest};
use super::{continuous, sampled};
use crate::error::{Error, Result, Signal};
use crate::pair::{check_finite, peak as peak_of};

/// Displacements beyond this many times the static one are out of bounds, where no bound is given.
const BOUND: f64 = 1e3;

impl VirtualTest {
    /// Runs the test under a ground acceleration, m/s^2, one value a sample, linear in between, after rest.
    ///
    /// # Errors
    /// [`Error::NotFinite`] and [`Error::TooShort`] for the ground motion; [`Error::Configuration`] for a delay longer than
    /// it, or for noise of another length; [`Error::Unstable`] with the time at which a displacement left its bound.
    pub fn run(&self, ground: &[f64], noise: &Noise) -> Result<Run> {
        if self.is_alone() {
            return Err(configuration("structure", "expected one under a ground motion, found none"));
        }
        if ground.len() < 2 {
            return Err(Error::TooShort { expected: 2, found: ground.len() });
        }
        check_finite(ground, Signal::GroundMotion)?;
        let duration = self.checked_duration(ground.len(), noise)?;
        let bound = self.bound(ground, duration);
        match self.config.stepping {
            Stepping::Continuous => continuous::run(self, Drive::Ground(ground), noise, bound),
            Stepping::Cr => sampled::run(self, ground, noise, bound),
        }
    }

    /// Moves the actuators, which have no structure, along one target: its motion at every sample, after rest.
    ///
    /// `continuous` takes the polynomial of fifth degree through both samples in between. The first displacement should be
    /// 0, from where the actuators begin.
    ///
    /// # Errors
    /// As [`run`](Self::run), of the target.
    pub fn follow(&self, target: &[Motion], noise: &Noise) -> Result<Run> {
        if !self.is_alone() {
            return Err(configuration("structure", "expected none where the target is given, found one"));
        }
        if target.len() < 2 {
            return Err(Error::TooShort { expected: 2, found: target.len() });
        }
        let sound = |m: &Motion| [m.displacement, m.velocity, m.acceleration].iter().all(|v| v.is_finite());
        if let Some(first) = target.iter().position(|m| !sound(m)) {
            let count = target.iter().filter(|m| !sound(m)).count();
            return Err(Error::NotFinite { signal: Signal::Target, count, first });
        }
        self.checked_duration(target.len(), noise)?;
        let peak = target.iter().fold(0.0, |peak: f64, m| peak.max(m.displacement.abs()));
        let gain = self.config.actuators.iter().fold(1.0, |most: f64, a| most.max(a.gain.abs()));
        let bound = self.config.bound_m.unwrap_or(if peak == 0.0 { BOUND } else { BOUND * gain * peak });
        match self.config.stepping {
            Stepping::Continuous => continuous::run(self, Drive::Target(target), noise, bound),
            Stepping::Cr => sampled::follow(self, target, noise, bound),
        }
    }

    /// Seconds from the first sample to the last, if delays and noise go with them.
    fn checked_duration(&self, n_samples: usize, noise: &Noise) -> Result<f64> {
        let duration = (n_samples - 1) as f64 / self.config.rate_hz;
        let mut checks = Checks::default();
        for (i, actuator) in self.config.actuators.iter().enumerate() {
            let longest = actuator.delay.range().1;
            let key = format!("actuator[{}].delay_s", i + 1);
            checks.demand(&key, longest < duration, &format!("less than the test's {duration} s"), longest);
        }
        for channel in noise.iter().flatten() {
            checks.demand("noise", channel.len() == n_samples, &format!("{n_samples} samples"), channel.len());
        }
        if checks.mistakes.is_empty() { Ok(duration) } else { Err(Error::Configuration(checks.mistakes)) }
    }

    fn bound(&self, ground: &[f64], duration: f64) -> f64 {
        let peak = peak_of(ground);
        if peak == 0.0 {
            return self.config.bound_m.unwrap_or(BOUND);
        }
        let omega = self.softest.iter().copied().find(|w| *w > 1e-6 * self.omega[self.omega.len() - 1]);
        let scale = omega.map_or(0.5 * duration * duration, |w| (1.0 / (w * w)).min(0.5 * duration * duration));
        let influence = self.config.structure.influence.amax().max(1.0);
        self.config.bound_m.unwrap_or(BOUND * influence * peak * scale)
    }

    /// The delay at which the loop of the only actuator begins to ring; see [`CriticalDelay`].
    ///
    /// # Errors
    /// [`Error::Configuration`] with more than one actuator.
    pub fn critical_delay(&self) -> Result<CriticalDelay> {
        Loop::new(self)?.critical_delay()
    }

    /// What a delay of the only actuator does to each mode's damping.
    ///
    /// # Errors
    /// [`Error::Configuration`] with more than one actuator, or a delay that is negative or not finite.
    pub fn delay_damping(&self, delay_s: f64) -> Result<DelayDamping> {
        if !(delay_s.is_finite() && delay_s >= 0.0) {
            return Err(configuration("delay_s", &format!("expected a number of at least 0, found {delay_s}")));
        }
        Loop::new(self)?.delay_damping(delay_s)
    }

    /// Measured over target of one actuator at a frequency, as configured; None where they are no one linear filter.
    pub fn true_response(&self, actuator: usize, frequency_hz: f64) -> Option<Complex<f64>> {
        let actuator = &self.config.actuators[actuator];
        let omega = 2.0 * PI * frequency_hz;
        let Delay::Constant(delay) = actuator.delay else { return None };
        let line = actuator.gain * Complex::from_polar(1.0, -omega * delay);
        let dynamics = match self.config.stepping {
            Stepping::Continuous if matches!(actuator.dynamics, Dynamics::None) => Complex::new(1.0, 0.0),
            Stepping::Continuous => actuator.linear_dynamics(false)?.response(Complex::new(0.0, omega)),
            Stepping::Cr => SampledActuator::planned(actuator, self.config.rate_hz).response(omega)?,
        };
        Some(actuator.compensation.response(omega, self.config.rate_hz)? * line * dynamics)
    }
}
