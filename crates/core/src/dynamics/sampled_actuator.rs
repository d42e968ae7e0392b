//! An actuator that is moved once a sample, as a controller's computer does.

use nalgebra::{Complex, DMatrix, DVector};

use super::actuator::Actuator;
use super::check::Checks;
use super::history::{History, Motion};
use super::law::{Law, Memory};
use super::plant::{Dynamics, ServoHydraulic, StateSpace, solve_response};
use super::structure::rows;
use crate::error::{Error, Result};
use crate::pair::check_rate;

/// Internal Runge-Kutta steps of a servo-hydraulic plant: no longer than this over its fastest pole.
const PACE: f64 = 0.25;

/// The plan of an actuator that is moved once a sample, as a controller's computer does.
#[derive(Debug, Clone)]
pub struct SampledActuator {
    actuator: Actuator,
    rate_hz: f64,
    kind: Kind,
    /// Of each law's memory.
    limits: Vec<f64>,
}

#[derive(Debug, Clone)]
enum Kind {
    Ideal,
    FirstOrder(f64),
    Linear { system: StateSpace, held: (Vec<f64>, Vec<f64>) },
    Servo { servo: ServoHydraulic, n_steps: usize },
}

/// What a [`SampledActuator`] remembers.
#[derive(Debug, Clone)]
pub struct SampledActuatorState {
    commands: History,
    dynamics: Vec<f64>,
    scratch: Vec<f64>,
    input: f64,
    memory: Vec<Memory>,
    motion: Motion,
    n_steps: usize,
}

impl SampledActuator {
    /// The plan of a checked actuator at this rate.
    pub(crate) fn planned(actuator: &Actuator, rate_hz: f64) -> Self {
        let kind = match &actuator.dynamics {
            Dynamics::None => Kind::Ideal,
            Dynamics::FirstOrder { alpha } => Kind::FirstOrder(*alpha),
            Dynamics::TransferFunction { numerator, denominator } => {
                let system = StateSpace::of(numerator, denominator);
                let (a, b) = system.held(1.0 / rate_hz);
                Kind::Linear { held: (rows(&a), b.as_slice().to_vec()), system }
            }
            Dynamics::ServoHydraulic(servo) => {
                let fastest = actuator.fastest_pole().unwrap_or(0.0);
                Kind::Servo { servo: *servo, n_steps: (fastest / rate_hz / PACE).ceil().max(1.0) as usize }
            }
        };
        let limits = actuator.specimen.iter().map(Law::limit).collect();
        Self { actuator: actuator.clone(), rate_hz, kind, limits }
    }

    /// The plan of an actuator on its own, for a program that steps it.
    ///
    /// # Errors
    /// [`Error::Configuration`] with every mistake; [`Error::Rate`].
    pub fn new(actuator: &Actuator, rate_hz: f64) -> Result<Self> {
        check_rate(rate_hz)?;
        let mut checks = Checks::default();
        checks.under("actuator[1]", |c| {
            actuator.check_specimen(c);
            actuator.check(c, true, rate_hz);
        });
        if checks.mistakes.is_empty() {
            Ok(Self::planned(actuator, rate_hz))
        } else {
            Err(Error::Configuration(checks.mistakes))
        }
    }

    /// At rest.
    pub fn state(&self) -> SampledActuatorState {
        let n = match &self.kind {
            Kind::Ideal | Kind::FirstOrder(_) => 0,
            Kind::Linear { system, .. } => system.order(),
            Kind::Servo { .. } => 5 + 2 * self.actuator.specimen.len(),
        };
        SampledActuatorState {
            commands: History::new(self.actuator.delay.range().1 * self.rate_hz, 1.0 / self.rate_hz),
            dynamics: vec![0.0; n],
            scratch: vec![0.0; 6 * n],
            input: 0.0,
            memory: vec![[0.0; 2]; self.actuator.specimen.len()],
            motion: Motion::default(),
            n_steps: 0,
        }
    }

    /// One sample: the command's motion in, the specimen's motion and force out. Allocates nothing.
    ///
    /// The command's velocity is used by gain, delay and the discrete actuator; plants with dynamics of their own hold its
    /// displacement for a sample, as a converter does, and so lag by half a sample more.
    #[inline]
    pub fn step(&self, state: &mut SampledActuatorState, command: Motion) -> (Motion, f64) {
        let dt = 1.0 / self.rate_hz;
        state.commands.push(command);
        let (delay, delay_rate) = self.actuator.delay.at(state.n_steps as f64 * dt);
        state.n_steps += 1;
        let mut input = state.commands.behind_samples(delay * self.rate_hz) * self.actuator.gain;
        input.velocity *= 1.0 - delay_rate;
        let before = state.motion;
        let motion = match &self.kind {
            Kind::Ideal => input,
            Kind::FirstOrder(alpha) => before + (input + before * -1.0) * (1.0 / alpha),
            Kind::Linear { system, held } => self.linear(state, system, held, input),
            Kind::Servo { servo, n_steps } => return self.servo(state, servo, *n_steps, input),
        };
        let acceleration = (motion.velocity - before.velocity) * self.rate_hz;
        let motion = Motion { acceleration, ..motion };
        let mut force = self.actuator.specimen_mass * acceleration;
        for ((law, memory), limit) in self.actuator.specimen.iter().zip(&mut state.memory).zip(&self.limits) {
            law.advance(before.displacement, motion.displacement, dt, memory, *limit);
            force += law.force(motion.displacement, motion.velocity, memory);
        }
        state.motion = motion;
        (motion, force)
    }

    fn linear(
        &self,
        state: &mut SampledActuatorState,
        system: &StateSpace,
        held: &(Vec<f64>, Vec<f64>),
        input: Motion,
    ) -> Motion {
        let n = system.order();
        for i in 0..n {
            let row = &held.0[i * n..(i + 1) * n];
            state.scratch[i] =
                held.1[i] * state.input + row.iter().zip(&state.dynamics).map(|(a, w)| a * w).sum::<f64>();
        }
        state.dynamics.copy_from_slice(&state.scratch[..n]);
        state.input = input.displacement;
        let w = &state.dynamics;
        let mut motion = Motion {
            displacement: system.d * input.displacement,
            velocity: system.d * input.velocity,
            acceleration: 0.0,
        };
        for i in 0..n {
            let rate = system.b[i] * input.displacement + (0..n).map(|j| system.a[(i, j)] * w[j]).sum::<f64>();
            motion.displacement += system.c[i] * w[i];
            motion.velocity += system.c[i] * rate;
        }
        motion
    }

    fn servo(
        &self,
        state: &mut SampledActuatorState,
        servo: &ServoHydraulic,
        n_steps: usize,
        input: Motion,
    ) -> (Motion, f64) {
        let (actuator, h) = (&self.actuator, 1.0 / self.rate_hz / n_steps as f64);
        let n = state.dynamics.len();
        let held = std::mem::replace(&mut state.input, input.displacement);
        let (k, ahead) = state.scratch.split_at_mut(4 * n);
        let ahead = &mut ahead[..n];
        for _ in 0..n_steps {
            let w = &mut state.dynamics;
            for (stage, reach) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
                for i in 0..n {
                    ahead[i] = w[i] + if stage == 0 { 0.0 } else { reach * h * k[(stage - 1) * n + i] };
                }
                actuator.servo_rate(servo, ahead, held, &mut k[stage * n..(stage + 1) * n]);
            }
            for i in 0..n {
                w[i] += h / 6.0 * (k[i] + 2.0 * (k[n + i] + k[2 * n + i]) + k[3 * n + i]);
            }
            hold(&mut w[5..], &self.limits);
        }
        let w = &state.dynamics;
        let restoring = actuator.servo_rate(servo, w, held, &mut k[..n]);
        let acceleration = (w[2] - restoring) / actuator.specimen_mass;
        state.motion = Motion { displacement: w[3], velocity: w[4], acceleration };
        (state.motion, w[2])
    }

    /// Measured over command at omega, rad/s, as sampled; None where it is not linear.
    pub(crate) fn response(&self, omega: f64) -> Option<Complex<f64>> {
        let z = Complex::from_polar(1.0, omega / self.rate_hz);
        let rest = match &self.kind {
            Kind::Ideal => Complex::new(1.0, 0.0),
            Kind::FirstOrder(alpha) => z / (z * *alpha - (alpha - 1.0)),
            Kind::Linear { system, held } => {
                let n = system.order();
                solve_response(
                    &DMatrix::from_row_slice(n, n, &held.0),
                    &DVector::from_column_slice(&held.1),
                    &system.c,
                    system.d,
                    z,
                )
            }
            Kind::Servo { .. } => {
                let system = self.actuator.linear_dynamics(false)?;
                let (a, b) = system.held(1.0 / self.rate_hz);
                solve_response(&a, &b, &system.c, system.d, z)
            }
        };
        Some(rest)
    }
}

/// Keeps memories, two places a law, within their limits.
#[inline]
fn hold(memories: &mut [f64], limits: &[f64]) {
    for (memory, limit) in memories.chunks_exact_mut(2).zip(limits) {
        memory[0] = memory[0].clamp(-limit, *limit);
    }
}
