//! The virtual test: a structure split in two, its actuators between the parts; or no structure, its actuators alone.

use nalgebra::{Cholesky, DMatrix};

use super::actuator::{Actuator, Delay, across};
use super::check::{Checks, Mistake, positive};
use super::history::Motion;
use super::law::Law;
use super::stability::{CriticalDelay, DelayDamping, Loop};
use super::structure::{Structure, lowest, modes};
use super::{continuous, sampled};
use crate::error::{Error, Result};

/// Displacements beyond this many times the static one are out of bounds, where no bound is given.
const BOUND: f64 = 1e3;
/// How far rounding may push an eigenvalue of what is left of the structure below zero.
const ROUNDING: f64 = 1e-9;

/// A restoring force of the numerical substructure, between two degrees of freedom numbered from 1; 0 is the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// The force.
    pub law: Law,
    /// Where it acts.
    pub dof: usize,
    /// What it stands on.
    pub from_dof: usize,
    /// Whether the structure's matrices contain its elastic stiffness and damping.
    pub part_of_structure: bool,
}

/// How time is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepping {
    /// The delay equation solved with Runge-Kutta steps of fourth order, halved until the result no longer changes.
    ///
    /// A step is stable while omega h < 2.83; steps begin below omega h = 0.5, so only the loop itself can be unstable.
    Continuous,
    /// Chen and Ricles (2008), one step a sample: x += dt v + dt^2 alpha a, v += dt alpha a,
    /// alpha = 4 (4 M + 2 dt C + dt^2 K)^-1 M. Stable for every omega dt, without a delay.
    Cr,
}

impl Stepping {
    /// Names in settings.
    pub const NAMES: [(&'static str, Self); 2] = [("continuous", Stepping::Continuous), ("cr", Stepping::Cr)];
}

/// What is tested.
#[derive(Debug, Clone, PartialEq)]
pub struct TestConfig {
    /// The whole structure, elastic; [`Structure::none`] where the actuators follow a target that is given.
    pub structure: Structure,
    /// Restoring forces of its numerical part.
    pub elements: Vec<Element>,
    /// Actuators with their specimens.
    pub actuators: Vec<Actuator>,
    /// Time stepping.
    pub stepping: Stepping,
    /// Samples a second.
    pub rate_hz: f64,
    /// `continuous`: largest change of target and measured (and force, without a structure), over their peaks, when the step
    /// is halved.
    pub tolerance: f64,
    /// Displacement at which the test stops as unstable, m; None: 1000 times the static one of the structure
    /// when all has yielded, or 1000 times the peak of a given target, times the largest gain above 1 (1000 m without a
    /// motion).
    pub bound_m: Option<f64>,
}

/// A finished test: one vector of samples an actuator, or a degree of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What the structure asks for, m.
    pub target: Vec<Vec<f64>>,
    /// What the compensation sends, m.
    pub command: Vec<Vec<f64>>,
    /// What the displacement sensor reports, m.
    pub measured: Vec<Vec<f64>>,
    /// What the force sensor reports, N.
    pub force: Vec<Vec<f64>>,
    /// Relative to the ground, m.
    pub displacement: Vec<Vec<f64>>,
    /// Internal steps a sample.
    pub steps_per_sample: usize,
    /// Largest change of target and measured (and force, without a structure) over their peaks on halving the step; NaN where
    /// the step is the sample.
    pub error_estimate: f64,
}

impl Run {
    pub(crate) fn sized(n_actuators: usize, n_dof: usize, n_samples: usize, steps_per_sample: usize) -> Self {
        let signals = |n| vec![vec![0.0; n_samples]; n];
        Self {
            target: signals(n_actuators),
            command: signals(n_actuators),
            measured: signals(n_actuators),
            force: signals(n_actuators),
            displacement: signals(n_dof),
            steps_per_sample,
            error_estimate: f64::NAN,
        }
    }
}

/// What drives a test, one value a sample.
#[derive(Clone, Copy)]
pub(crate) enum Drive<'a> {
    /// A ground acceleration under the structure, m/s^2.
    Ground(&'a [f64]),
    /// What every actuator is to do where there is no structure to ask it.
    Target(&'a [Motion]),
}

impl Drive<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Drive::Ground(samples) => samples.len(),
            Drive::Target(samples) => samples.len(),
        }
    }
}

/// Sensor noise, one optional vector a channel: command, displacement, force of the first actuator, then of the next.
pub type Noise = [Option<Vec<f64>>];

/// What is left of the structure when what is tested and what yields has been taken out.
#[derive(Debug, Clone)]
pub(crate) struct Numerical {
    pub(crate) mass: DMatrix<f64>,
    pub(crate) damping: DMatrix<f64>,
    pub(crate) stiffness: DMatrix<f64>,
}

/// The checked plan of a virtual test.
#[derive(Debug, Clone)]
pub struct VirtualTest {
    pub(crate) config: TestConfig,
    pub(crate) numerical: Numerical,
    /// M i of the whole structure.
    pub(crate) load: Vec<f64>,
    omega: Vec<f64>,
    /// Undamped circular frequencies when all has yielded: what the bound is measured by.
    softest: Vec<f64>,
}

/// matrix += value b b^T
pub(crate) fn add_across(matrix: &mut DMatrix<f64>, dof: usize, from_dof: usize, value: f64) {
    matrix[(dof - 1, dof - 1)] += value;
    if from_dof > 0 {
        matrix[(from_dof - 1, from_dof - 1)] += value;
        matrix[(dof - 1, from_dof - 1)] -= value;
        matrix[(from_dof - 1, dof - 1)] -= value;
    }
}

impl VirtualTest {
    /// Checks everything and splits the structure.
    ///
    /// # Errors
    /// [`Error::Configuration`] with every mistake and its key.
    pub fn new(mut config: TestConfig) -> Result<Self> {
        let mut checks = Checks::default();
        positive(&mut checks, "test.rate_hz", config.rate_hz);
        checks.demand(
            "test.tolerance",
            (1e-12..=0.1).contains(&config.tolerance),
            "a number from 1e-12 to 0.1",
            config.tolerance,
        );
        if let Some(bound) = config.bound_m {
            positive(&mut checks, "test.bound_m", bound);
        }
        checks.demand("actuator", !config.actuators.is_empty(), "at least one actuator", "none");
        let n = config.structure.n_dof();
        let place = |checks: &mut Checks, dof: usize, from_dof: usize| {
            checks.demand("dof", (1..=n).contains(&dof), &format!("a degree of freedom from 1 to {n}"), dof);
            checks.demand(
                "from_dof",
                from_dof <= n && from_dof != dof,
                &format!("another one, from 0 (ground) to {n}"),
                from_dof,
            );
            (1..=n).contains(&dof) && from_dof <= n && from_dof != dof
        };
        // A rate that is none makes nothing else a mistake.
        let rate_hz = if config.rate_hz > 0.0 { config.rate_hz } else { f64::INFINITY };
        let structure = &config.structure;
        let mut left = Numerical {
            mass: structure.mass.clone(),
            damping: structure.damping.clone(),
            stiffness: structure.stiffness.clone(),
        };
        let mut placed = true;
        if n == 0 {
            checks.demand("element", config.elements.is_empty(), "none without a structure", config.elements.len());
        }
        for (i, element) in config.elements.iter().enumerate().filter(|_| n > 0) {
            checks.under(&format!("element[{}]", i + 1), |checks| {
                element.law.check(checks);
                if config.stepping == Stepping::Cr {
                    element.law.check_rate(checks, rate_hz);
                }
                if !place(checks, element.dof, element.from_dof) {
                    placed = false;
                } else if element.part_of_structure {
                    let (k, c) = (element.law.elastic_stiffness(), element.law.viscous_damping());
                    add_across(&mut left.stiffness, element.dof, element.from_dof, -k);
                    add_across(&mut left.damping, element.dof, element.from_dof, -c);
                }
            });
        }
        for (i, actuator) in config.actuators.iter().enumerate() {
            checks.under(&format!("actuator[{}]", i + 1), |checks| {
                if n == 0 {
                    let late = actuator.force_delay_samples;
                    checks.demand("force_delay_samples", late == 0, "0 without a structure that waits for it", late);
                    return actuator.check(checks, config.stepping == Stepping::Cr, rate_hz);
                }
                actuator.check_specimen(checks);
                actuator.check(checks, config.stepping == Stepping::Cr, rate_hz);
                if !place(checks, actuator.dof, actuator.from_dof) {
                    placed = false;
                } else if actuator.part_of_structure {
                    add_across(&mut left.stiffness, actuator.dof, actuator.from_dof, -actuator.elastic_stiffness());
                    add_across(&mut left.damping, actuator.dof, actuator.from_dof, -actuator.viscous_damping());
                    add_across(&mut left.mass, actuator.dof, actuator.from_dof, -actuator.specimen_mass);
                }
            });
        }
        if n > 0 && placed && checks.mistakes.is_empty() {
            for (what, name, matrix, whole) in [
                ("stiffness", "stiffness_n_per_m", &left.stiffness, &structure.stiffness),
                ("damping", "damping_n_s_per_m", &left.damping, &structure.damping),
                ("mass", "mass_kg", &left.mass, &structure.mass),
            ] {
                let least = lowest(matrix);
                let room = if what == "mass" { least <= 0.0 } else { least < -ROUNDING * whole.amax() };
                if room {
                    checks.mistake(
                        &format!("structure.{name}"),
                        format!(
                            "expected at least the {what} of the specimens and elements that are part of it, found less \
                             (eigenvalue {least:.6e} left); part_of_structure = false adds them instead"
                        ),
                    );
                }
            }
        }
        if !checks.mistakes.is_empty() {
            return Err(Error::Configuration(checks.mistakes));
        }
        let load = (&structure.mass * &structure.influence).as_slice().to_vec();
        let (omega, softest) = if n == 0 { (Vec::new(), Vec::new()) } else { frequencies(&config, &left)? };
        for actuator in &mut config.actuators {
            actuator.delay = actuator.delay.clone().plain();
        }
        Ok(Self { config, numerical: left, load, omega, softest })
    }

    /// The configuration, as checked.
    pub fn config(&self) -> &TestConfig {
        &self.config
    }

    /// Undamped natural frequencies of structure and specimens together, rising, rad/s.
    pub(crate) fn natural_frequencies(&self) -> &[f64] {
        &self.omega
    }

    /// M, C, K of the numerical part with the elastic specimens and elements put back: what an integrator is tuned to.
    pub(crate) fn whole(&self) -> Numerical {
        whole(&self.config, &self.numerical)
    }

    /// M, C, K of the numerical part with its elements, elastic.
    pub(crate) fn elastic(&self) -> Numerical {
        with_elements(&self.config, &self.numerical)
    }

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
        crate::pair::check_finite(ground, crate::Signal::GroundMotion)?;
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
            return Err(Error::NotFinite { signal: crate::Signal::Target, count, first });
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

    /// Whether there is no structure.
    pub(crate) fn is_alone(&self) -> bool {
        self.config.structure.n_dof() == 0
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
        let peak = crate::pair::peak(ground);
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
    pub fn true_response(&self, actuator: usize, frequency_hz: f64) -> Option<num_complex::Complex<f64>> {
        use num_complex::Complex;
        let actuator = &self.config.actuators[actuator];
        let omega = 2.0 * std::f64::consts::PI * frequency_hz;
        let Delay::Constant(delay) = actuator.delay else { return None };
        let line = actuator.gain * Complex::from_polar(1.0, -omega * delay);
        let dynamics = match self.config.stepping {
            Stepping::Continuous if matches!(actuator.dynamics, super::Dynamics::None) => Complex::new(1.0, 0.0),
            Stepping::Continuous => actuator.linear_dynamics(false)?.response(Complex::new(0.0, omega)),
            Stepping::Cr => super::SampledActuator::planned(actuator, self.config.rate_hz).response(omega)?,
        };
        Some(actuator.compensation.response(omega, self.config.rate_hz) * line * dynamics)
    }
}

impl Element {
    #[inline]
    pub(crate) fn across(&self, x: &[f64]) -> f64 {
        across(self.dof, self.from_dof, x)
    }
}

pub(crate) fn configuration(key: &str, message: &str) -> Error {
    Error::Configuration(vec![Mistake { key: key.into(), message: message.into() }])
}

/// Circular frequencies of structure and specimens together, elastic, and when all has yielded.
fn frequencies(config: &TestConfig, left: &Numerical) -> Result<(Vec<f64>, Vec<f64>)> {
    let whole = whole(config, left);
    let factor = Cholesky::new(whole.mass.clone())
        .ok_or_else(|| configuration("structure.mass_kg", "expected a positive definite matrix"))?;
    let mut yielded = left.stiffness.clone();
    for element in &config.elements {
        add_across(&mut yielded, element.dof, element.from_dof, element.law.lasting_stiffness());
    }
    for actuator in &config.actuators {
        let lasting = actuator.specimen.iter().map(Law::lasting_stiffness).sum();
        add_across(&mut yielded, actuator.dof, actuator.from_dof, lasting);
    }
    Ok((modes(&factor, &whole.stiffness).0, modes(&factor, &yielded).0))
}

fn with_elements(config: &TestConfig, left: &Numerical) -> Numerical {
    let mut whole = left.clone();
    for element in &config.elements {
        add_across(&mut whole.stiffness, element.dof, element.from_dof, element.law.elastic_stiffness());
        add_across(&mut whole.damping, element.dof, element.from_dof, element.law.viscous_damping());
    }
    whole
}

fn whole(config: &TestConfig, left: &Numerical) -> Numerical {
    let mut whole = with_elements(config, left);
    for actuator in &config.actuators {
        add_across(&mut whole.stiffness, actuator.dof, actuator.from_dof, actuator.elastic_stiffness());
        add_across(&mut whole.damping, actuator.dof, actuator.from_dof, actuator.viscous_damping());
        add_across(&mut whole.mass, actuator.dof, actuator.from_dof, actuator.specimen_mass);
    }
    whole
}

/// A force between two degrees of freedom added to a vector over all of them.
#[inline]
pub(crate) fn across_add(x: &mut [f64], dof: usize, from_dof: usize, value: f64) {
    x[dof - 1] += value;
    if from_dof > 0 {
        x[from_dof - 1] -= value;
    }
}
