//! The loop of a laboratory's computer: integrate, compensate, move, measure, once a sample; or, without a structure to
//! integrate, the same with a target that is given.

use nalgebra::DMatrix;

use super::actuator::Actuator;
use super::check::configuration;
use super::compensator::{Running, Seen};
use super::history::Motion;
use super::law::Memory;
use super::sampled_actuator::{SampledActuator, SampledActuatorState};
use super::structure::{across_add, multiply, rows};
use super::virtual_test::{Noise, Run, VirtualTest};
use crate::error::{Error, Result};

/// An explicit integrator: from the motion at one sample to displacement and velocity at the next, before any force there is known.
trait Explicit {
    /// x, v at t from x, v, a at t - dt.
    fn predict(&self, x: &mut [f64], v: &mut [f64], a: &[f64], scratch: &mut [f64]);
}

/// Chen and Ricles (2008): x += dt v + dt^2 alpha a, v += dt alpha a, alpha = 4 (4 M + 2 dt C + dt^2 K)^-1 M.
struct Cr {
    alpha: Vec<f64>,
    dt: f64,
}

impl Cr {
    fn new(test: &VirtualTest) -> Option<Self> {
        let (whole, dt) = (test.whole(), 1.0 / test.config.rate_hz);
        let inverse = (4.0 * &whole.mass + 2.0 * dt * whole.damping + dt * dt * whole.stiffness).try_inverse()?;
        Some(Self { alpha: rows(&(4.0 * inverse * whole.mass)), dt })
    }
}

impl Explicit for Cr {
    #[inline]
    fn predict(&self, x: &mut [f64], v: &mut [f64], a: &[f64], scratch: &mut [f64]) {
        multiply(&self.alpha, a, scratch);
        for i in 0..x.len() {
            let change = self.dt * scratch[i];
            x[i] += self.dt * (v[i] + change);
            v[i] += change;
        }
    }
}

struct Rig {
    plan: SampledActuator,
    state: SampledActuatorState,
    compensator: Option<Box<dyn Running>>,
    /// What was sent out last.
    sent: f64,
    velocity: f64,
    measured: f64,
    felt: f64,
    /// Where the specimen really is.
    moved: f64,
    /// Forces on their way to the computer, oldest next.
    late: Vec<f64>,
}

impl Rig {
    fn new(actuator: &Actuator, rate_hz: f64) -> Self {
        let plan = SampledActuator::planned(actuator, rate_hz);
        Self {
            state: plan.state(),
            plan,
            compensator: actuator.compensation.start(rate_hz),
            sent: 0.0,
            velocity: 0.0,
            measured: 0.0,
            felt: 0.0,
            moved: 0.0,
            late: vec![0.0; actuator.force_delay_samples],
        }
    }

    /// One sample: target in, moved and measured, with the noise of command, displacement and force; what was sent out.
    #[inline(always)]
    fn step(&mut self, actuator: &Actuator, target: Motion, noise: [f64; 3]) -> f64 {
        let mut command = match &mut self.compensator {
            Some(compensator) => compensator.step(Seen { target, command: self.sent, measured: self.measured }),
            None => target,
        };
        let sent = actuator.command_converter.convert(command.displacement + noise[0]);
        if sent.abs() >= actuator.command_converter.limit {
            command.velocity = 0.0;
        }
        command.displacement = sent;
        self.sent = sent;
        let (motion, answer) = self.plan.step(&mut self.state, command);
        self.measured = actuator.displacement_sensor.convert(motion.displacement + noise[1]);
        self.felt = actuator.force_sensor.convert(answer + noise[2]);
        self.moved = motion.displacement;
        sent
    }

    /// Writes a sample of actuator `i`.
    #[inline(always)]
    fn record(&self, run: &mut Run, i: usize, sample: usize, target: f64, sent: f64) {
        run.target[i][sample] = target;
        run.command[i][sample] = sent;
        run.measured[i][sample] = self.measured;
        run.force[i][sample] = self.felt;
    }

    #[inline(always)]
    fn is_within(&self, bound: f64) -> bool {
        self.moved.abs() <= bound && self.measured.is_finite() && self.felt.is_finite()
    }
}

/// The noise of one actuator's command, displacement and force.
#[inline(always)]
fn noise_of(noise: &Noise, actuator: usize, sample: usize) -> [f64; 3] {
    [0, 1, 2].map(|i| noise.get(3 * actuator + i).and_then(Option::as_ref).map_or(0.0, |n| n[sample]))
}

/// The same loop where the target is given.
pub(crate) fn follow(test: &VirtualTest, target: &[Motion], noise: &Noise, bound: f64) -> Result<Run> {
    let (actuators, rate) = (&test.config.actuators, test.config.rate_hz);
    let mut rigs: Vec<Rig> = actuators.iter().map(|actuator| Rig::new(actuator, rate)).collect();
    let mut run = Run::sized(rigs.len(), 0, target.len(), 1);
    for (sample, target) in target.iter().enumerate() {
        for (i, (rig, actuator)) in rigs.iter_mut().zip(actuators).enumerate() {
            let sent = rig.step(actuator, *target, noise_of(noise, i, sample));
            rig.record(&mut run, i, sample, target.displacement, sent);
        }
        if !rigs.iter().all(|rig| rig.is_within(bound)) {
            return Err(Error::Unstable { time_s: sample as f64 / rate, bound_m: bound });
        }
    }
    Ok(run)
}

pub(crate) fn run(test: &VirtualTest, ground: &[f64], noise: &Noise, bound: f64) -> Result<Run> {
    let config = &test.config;
    let (n, rate) = (config.structure.n_dof(), config.rate_hz);
    let dt = 1.0 / rate;
    let singular = || configuration("structure.mass_kg", "expected matrices that can be inverted");
    let integrator = Cr::new(test).ok_or_else(singular)?;
    let inverse = rows(&test.numerical.mass.clone().try_inverse().ok_or_else(singular)?);
    let (damping, stiffness) = (rows(&test.numerical.damping), rows(&test.numerical.stiffness));
    let viscous = test.numerical.damping != DMatrix::zeros(n, n);
    let elastic = test.numerical.stiffness != DMatrix::zeros(n, n);
    let mut rigs: Vec<Rig> = config.actuators.iter().map(|actuator| Rig::new(actuator, rate)).collect();
    let mut memories: Vec<Memory> = vec![[0.0; 2]; config.elements.len()];
    let mut places = vec![0.0; config.elements.len()];
    let limits: Vec<f64> = config.elements.iter().map(|e| e.law.limit()).collect();
    let (mut x, mut v, mut a) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let (mut force, mut scratch) = (vec![0.0; n], vec![0.0; n]);
    let mut run = Run::sized(rigs.len(), n, ground.len(), 1);

    for sample in 0..ground.len() {
        if sample > 0 {
            integrator.predict(&mut x, &mut v, &a, &mut scratch);
        }
        for i in 0..n {
            force[i] = -test.load[i] * ground[sample];
        }
        if viscous {
            multiply(&damping, &v, &mut scratch);
            force.iter_mut().zip(&scratch).for_each(|(f, s)| *f -= s);
        }
        if elastic {
            multiply(&stiffness, &x, &mut scratch);
            force.iter_mut().zip(&scratch).for_each(|(f, s)| *f -= s);
        }
        for (((element, memory), place), limit) in
            config.elements.iter().zip(&mut memories).zip(&mut places).zip(&limits)
        {
            let to = element.across(&x);
            element.law.advance(*place, to, dt, memory, *limit);
            *place = to;
            across_add(&mut force, element.dof, element.from_dof, -element.law.force(to, element.across(&v), memory));
        }
        for (i, (rig, actuator)) in rigs.iter_mut().zip(&config.actuators).enumerate() {
            let velocity = actuator.across(&v);
            let target =
                Motion { displacement: actuator.across(&x), velocity, acceleration: (velocity - rig.velocity) * rate };
            rig.velocity = velocity;
            let sent = rig.step(actuator, target, noise_of(noise, i, sample));
            rig.record(&mut run, i, sample, target.displacement, sent);
            let arrived = if rig.late.is_empty() {
                rig.felt
            } else {
                std::mem::replace(&mut rig.late[sample % actuator.force_delay_samples], rig.felt)
            };
            across_add(&mut force, actuator.dof, actuator.from_dof, -arrived);
        }
        multiply(&inverse, &force, &mut a);
        let mut within = true;
        for i in 0..n {
            run.displacement[i][sample] = x[i];
            within &= x[i].abs() <= bound && a[i].is_finite();
        }
        if !within || !rigs.iter().all(|rig| rig.is_within(bound)) {
            return Err(Error::Unstable { time_s: sample as f64 * dt, bound_m: bound });
        }
    }
    Ok(run)
}
