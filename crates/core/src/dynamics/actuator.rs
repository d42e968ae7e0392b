//! Actuators: from command to the motion that the specimen really makes, and the force that it answers with.

use nalgebra::{DMatrix, DVector};

use super::check::{Checks, LEAST, MOST, nonnegative, positive};
use super::compensator::Compensation;
use super::converter::Converter;
use super::delay::Delay;
use super::law::Law;
use super::plant::{Dynamics, MAX_PACE, ServoHydraulic, StateSpace};
use super::structure::across;
/// One actuator with its compensation, its specimen and its sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Actuator {
    /// Degree of freedom that it moves, numbered from 1.
    pub dof: usize,
    /// The one that it stands on; 0 is the ground.
    pub from_dof: usize,
    /// Restoring forces of the specimen, side by side.
    pub specimen: Vec<Law>,
    /// Mass that moves with the specimen, kg.
    pub specimen_mass: f64,
    /// Whether the structure's matrices contain the specimen.
    pub part_of_structure: bool,
    /// K.
    pub gain: f64,
    /// tau.
    pub delay: Delay,
    /// What follows them.
    pub dynamics: Dynamics,
    /// From target to command.
    pub compensation: Compensation,
    /// The command's way out.
    pub command_converter: Converter,
    /// The measured displacement's way in.
    pub displacement_sensor: Converter,
    /// The measured force's way in.
    pub force_sensor: Converter,
    /// Samples by which the force comes late.
    pub force_delay_samples: usize,
}

impl Actuator {
    /// k before yielding, N/m.
    pub fn elastic_stiffness(&self) -> f64 {
        self.specimen.iter().map(Law::elastic_stiffness).sum()
    }

    /// c, N s/m.
    pub fn viscous_damping(&self) -> f64 {
        self.specimen.iter().map(Law::viscous_damping).sum()
    }

    /// x_dof - x_from_dof of a vector over the degrees of freedom.
    #[inline]
    pub(crate) fn across(&self, x: &[f64]) -> f64 {
        across(self.dof, self.from_dof, x)
    }

    /// That there is something to be tested, which an actuator alone need not have.
    pub(crate) fn check_specimen(&self, checks: &mut Checks) {
        checks.demand("specimen", !self.specimen.is_empty(), "at least one restoring force", "none");
    }

    pub(crate) fn check(&self, checks: &mut Checks, sampled: bool, rate_hz: f64) {
        for (i, law) in self.specimen.iter().enumerate() {
            checks.under(&self.specimen_key(i), |c| law.check(c));
        }
        nonnegative(checks, "specimen_mass_kg", self.specimen_mass);
        let size = (LEAST..=MOST).contains(&self.gain.abs());
        let usual = self.gain == 0.0 || !self.gain.is_finite();
        let expected = if usual { "a finite number other than 0" } else { "a size between 1e-30 and 1e30" };
        checks.demand("gain", size, expected, self.gain);
        self.delay.check(checks);
        checks.under("command_converter", |c| self.command_converter.check(c));
        checks.under("displacement_sensor", |c| self.displacement_sensor.check(c));
        checks.under("force_sensor", |c| self.force_sensor.check(c));
        checks.under("compensation", |c| self.compensation.check(c, rate_hz));
        if !sampled {
            let only = |checks: &mut Checks, key: &str, ideal: bool, what: &str| {
                if !ideal {
                    checks.mistake(
                        key,
                        format!("{what} works once a sample: expected test.stepping = \"cr\", found \"continuous\""),
                    );
                }
            };
            only(checks, "compensation", self.compensation == Compensation::NONE, "compensation");
            only(checks, "dynamics", !matches!(self.dynamics, Dynamics::FirstOrder { .. }), "a discrete actuator");
            only(checks, "command_converter", self.command_converter.is_ideal(), "a converter in the loop");
            only(checks, "force_sensor", self.force_sensor.is_ideal(), "a force sensor in the loop");
            only(checks, "force_delay_samples", self.force_delay_samples == 0, "a force that is late by samples");
        }
        checks.demand(
            "force_delay_samples",
            self.force_delay_samples <= 4096,
            "at most 4096",
            self.force_delay_samples,
        );
        checks.under("dynamics", |checks| self.dynamics.check(checks, rate_hz));
        if let Dynamics::ServoHydraulic(_) = self.dynamics {
            positive(checks, "specimen_mass_kg", self.specimen_mass);
            let pace = self.fastest_pole().map(|pole| pole / rate_hz);
            if checks.mistakes.is_empty() && pace.is_none_or(|pace| pace > MAX_PACE) {
                checks.mistake(
                    "specimen_mass_kg",
                    "expected a mass that this plant and rate can follow, found too little",
                );
            }
        }
        if sampled {
            for (i, law) in self.specimen.iter().enumerate() {
                checks.under(&self.specimen_key(i), |c| law.check_rate(c, rate_hz));
            }
        }
    }

    fn specimen_key(&self, i: usize) -> String {
        if self.specimen.len() == 1 { "specimen".into() } else { format!("specimen[{}]", i + 1) }
    }

    /// The fastest pole of the dynamics, elastic, rad/s; None where it cannot be found.
    pub(crate) fn fastest_pole(&self) -> Option<f64> {
        let Some(system) = self.linear_dynamics(true) else { return Some(0.0) };
        Some(system.poles()?.iter().map(|p| p.norm()).fold(0.0, f64::max))
    }

    /// The servo-hydraulic plant, or the transfer function, as one linear system; None where there is none, or where the
    /// specimen yields (then of its elastic stiffness if `linearised`).
    pub(crate) fn linear_dynamics(&self, linearised: bool) -> Option<StateSpace> {
        match &self.dynamics {
            Dynamics::None | Dynamics::FirstOrder { .. } => None,
            Dynamics::TransferFunction { numerator, denominator } => Some(StateSpace::of(numerator, denominator)),
            Dynamics::ServoHydraulic(servo) => {
                if !linearised && !self.specimen.iter().all(Law::is_linear) {
                    return None;
                }
                let relaxing: Vec<(f64, f64)> = self
                    .specimen
                    .iter()
                    .filter_map(|law| match law {
                        Law::Maxwell { stiffness, damping } => Some((*stiffness, *damping)),
                        _ => None,
                    })
                    .collect();
                let n = 5 + relaxing.len();
                let mut system =
                    StateSpace { a: DMatrix::zeros(n, n), b: DVector::zeros(n), c: DVector::zeros(n), d: 0.0 };
                let a = &mut system.a;
                let (k, c) = (self.elastic_stiffness(), self.viscous_damping());
                a[(0, 1)] = 1.0;
                (a[(1, 0)], a[(1, 1)], a[(1, 3)]) = (-servo.b2, -servo.b1, -servo.a1b0);
                (a[(2, 0)], a[(2, 2)], a[(2, 4)]) = (1.0, -servo.a3, -servo.a2);
                a[(3, 4)] = 1.0;
                (a[(4, 2)], a[(4, 3)], a[(4, 4)]) =
                    (1.0 / self.specimen_mass, -k / self.specimen_mass, -c / self.specimen_mass);
                for (i, (stiffness, damping)) in relaxing.into_iter().enumerate() {
                    a[(4, 5 + i)] = -1.0 / self.specimen_mass;
                    a[(5 + i, 4)] = stiffness;
                    a[(5 + i, 5 + i)] = -stiffness / damping;
                }
                system.b[1] = servo.a1b0 * servo.gain;
                system.c[3] = 1.0;
                Some(system)
            }
        }
    }

    /// Rates of the plant and of its specimen's memory; returns the specimen's restoring force without inertia.
    #[inline]
    pub(super) fn servo_rate(&self, servo: &ServoHydraulic, w: &[f64], command: f64, out: &mut [f64]) -> f64 {
        let mut restoring = 0.0;
        for (i, law) in self.specimen.iter().enumerate() {
            let memory = [w[5 + 2 * i], w[6 + 2 * i]];
            restoring += law.force(w[3], w[4], &memory);
            let rate = law.rate(w[4], &memory);
            (out[5 + 2 * i], out[6 + 2 * i]) = (rate[0], rate[1]);
        }
        servo.rate(w, command, restoring, self.specimen_mass, &mut out[..5]);
        restoring
    }
}
