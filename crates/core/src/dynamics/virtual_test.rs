//! The virtual test: a structure split in two, its actuators between the parts; or no structure, its actuators alone.

use nalgebra::{Cholesky, DMatrix};

use super::actuator::Actuator;
use super::check::{Checks, configuration, positive};
use super::history::Motion;
use super::law::Law;
use super::structure::{Structure, across, add_across, lowest, modes};
use crate::error::{Error, Result};
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
    pub(super) omega: Vec<f64>,
    /// Undamped circular frequencies when all has yielded: what the bound is measured by.
    pub(super) softest: Vec<f64>,
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

    /// Whether there is no structure.
    pub(crate) fn is_alone(&self) -> bool {
        self.config.structure.n_dof() == 0
    }
}

impl Element {
    #[inline]
    pub(crate) fn across(&self, x: &[f64]) -> f64 {
        across(self.dof, self.from_dof, x)
    }
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
