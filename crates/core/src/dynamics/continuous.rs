//! The delay equation in continuous time: Runge-Kutta steps of fourth order within each sample, the delayed motion from the
//! Hermite interpolant of the steps before.
//!
//! The ground motion is linear between samples and every sample is the end of a step, so no step crosses a corner of it.
//! Steps begin no longer than the delay (down to 1/64 of a sample) and half the time scale of the fastest mode, pole or
//! relaxation; they are halved until target and measured change by less than the tolerance times their peaks. The error
//! falls with the fourth power of the step for linear systems, and with about the third where a law has corners (Bouc-Wen
//! at reversals).

use nalgebra::DMatrix;

use super::actuator::{Delay, Dynamics, StateSpace, servo_rate};
use super::history::{History, Motion, hermite};
use super::law::Law;
use super::structure::rows;
use super::virtual_test::{Noise, Run, VirtualTest, across_add, add_across, configuration};
use crate::error::{Error, Result};

/// omega h at which halving begins.
const PACE: f64 = 0.5;
/// Delays shorter than a sample over this are looked up within the step.
const SHORTEST: f64 = 64.0;
/// Most halvings, and most steps a sample to begin with.
const MAX_HALVINGS: usize = 6;
const MAX_STEPS: f64 = 4096.0;

pub(crate) fn run(test: &VirtualTest, ground: &[f64], noise: &Noise, bound: f64) -> Result<Run> {
    let mut steps = first_steps(test)?;
    let mut coarse = attempt(test, ground, bound, steps);
    for _ in 0..MAX_HALVINGS {
        steps *= 2;
        let mut fine = attempt(test, ground, bound, steps);
        if let (Ok(one), Ok(two)) = (&coarse, &mut fine) {
            two.error_estimate = difference(one, two);
        }
        // Both unstable: the loop is, not the steps.
        let settled = match (&coarse, &fine) {
            (Ok(_), Ok(fine)) => fine.error_estimate <= test.config.tolerance,
            (Err(_), Err(_)) => true,
            _ => false,
        };
        coarse = fine;
        if settled {
            break;
        }
    }
    let mut run = coarse?;
    for (i, actuator) in test.config.actuators.iter().enumerate() {
        let noise = noise.get(3 * i + 1).and_then(Option::as_ref);
        for (sample, measured) in run.measured[i].iter_mut().enumerate() {
            *measured = actuator.displacement_sensor.convert(*measured + noise.map_or(0.0, |n| n[sample]));
        }
    }
    Ok(run)
}

/// Steps a sample that the delay, the modes and the poles ask for.
fn first_steps(test: &VirtualTest) -> Result<usize> {
    let dt = 1.0 / test.config.rate_hz;
    let mut rate = test.natural_frequencies().last().copied().unwrap_or(0.0);
    let laws = test.config.actuators.iter().flat_map(|a| &a.specimen).chain(test.config.elements.iter().map(|e| &e.law));
    rate = laws.map(Law::relaxation_rate).fold(rate, f64::max);
    for actuator in &test.config.actuators {
        let poles = actuator.linear_dynamics(true).map(|s| s.poles()).unwrap_or_default();
        rate = poles.iter().map(|p| p.norm()).fold(rate, f64::max);
    }
    let mut steps = (rate * dt / PACE).ceil().max(1.0);
    for actuator in &test.config.actuators {
        let shortest = actuator.delay.range().0;
        if shortest * SHORTEST >= dt {
            steps = steps.max((dt / shortest).ceil());
        }
    }
    if steps > MAX_STEPS {
        let message = format!("expected at least {:.0} Hz for the fastest mode, pole or relaxation, found {}", rate / PACE / MAX_STEPS, test.config.rate_hz);
        return Err(configuration("test.rate_hz", &message));
    }
    Ok(steps as usize)
}

/// The largest change of target and measured over their peaks.
fn difference(one: &Run, two: &Run) -> f64 {
    let mut worst: f64 = 0.0;
    for (a, b) in one.target.iter().zip(&two.target).chain(one.measured.iter().zip(&two.measured)) {
        let peak = crate::pair::peak(b);
        let change = a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        if peak > 0.0 {
            worst = worst.max(change / peak);
        }
    }
    worst
}

/// What an actuator's specimen did at the start of a step.
#[derive(Clone, Copy, Default)]
struct Seen {
    target: f64,
    measured: f64,
    force: f64,
}

/// Where in its past a stage finds the target.
#[derive(Clone, Copy)]
enum Lookup {
    /// The motion itself, delayed.
    Past(Motion),
    /// Between the start of the step and the stage: the fraction of that span, its length, the motion at the start.
    Inside(f64, f64, Motion),
    /// No delay.
    Now,
}

struct Rig {
    history: History,
    lookup: Lookup,
    /// 1 - d tau / dt at the stage.
    pace: f64,
    system: Option<StateSpace>,
    /// Places in the state: dynamics, then each law's memory.
    dynamics: usize,
    memory: usize,
    seen: Seen,
}

struct Equations<'a> {
    test: &'a VirtualTest,
    n: usize,
    /// Inverse of the mass with the specimens that follow without delay.
    inverse: Vec<f64>,
    damping: Option<Vec<f64>>,
    stiffness: Option<Vec<f64>>,
    rigs: Vec<Rig>,
    elements: usize,
    force: Vec<f64>,
    len: usize,
}

impl<'a> Equations<'a> {
    fn new(test: &'a VirtualTest, step_s: f64) -> Result<Self> {
        let n = test.config.structure.n_dof();
        let mut mass = test.numerical.mass.clone();
        let mut len = 2 * n;
        let mut rigs = Vec::new();
        for actuator in &test.config.actuators {
            let system = match actuator.dynamics {
                Dynamics::TransferFunction { .. } => actuator.linear_dynamics(false),
                _ => None,
            };
            let servo = matches!(actuator.dynamics, Dynamics::ServoHydraulic(_));
            let through = if servo { 0.0 } else { system.as_ref().map_or(1.0, |s| s.d) };
            if actuator.delay == Delay::Constant(0.0) {
                add_across(&mut mass, actuator.dof, actuator.from_dof, actuator.gain * through * actuator.specimen_mass);
            }
            let dynamics = len;
            len += if servo { 5 + 2 * actuator.specimen.len() } else { system.as_ref().map_or(0, StateSpace::order) };
            let memory = len;
            if !servo {
                len += actuator.specimen.iter().map(Law::n_memory).sum::<usize>();
            }
            rigs.push(Rig {
                history: History::new(actuator.delay.range().1 / step_s, step_s),
                lookup: Lookup::Now,
                pace: 1.0,
                system,
                dynamics,
                memory,
                seen: Seen::default(),
            });
        }
        let elements = len;
        len += test.config.elements.iter().map(|e| e.law.n_memory()).sum::<usize>();
        let some = |matrix: &DMatrix<f64>| (matrix.amax() > 0.0).then(|| rows(matrix));
        let inverse = mass.try_inverse().filter(|m| m.iter().all(|v| v.is_finite()));
        let inverse = rows(&inverse.ok_or_else(|| configuration("structure.mass_kg", "expected a matrix that can be inverted"))?);
        let (damping, stiffness) = (some(&test.numerical.damping), some(&test.numerical.stiffness));
        Ok(Self { test, n, inverse, damping, stiffness, rigs, elements, force: vec![0.0; n], len })
    }

    /// Finds each actuator's delayed target for the stage at `reach` (0, 1/2, 1) of the step that begins at `time`.
    #[inline]
    fn look(&mut self, time: f64, reach: f64, h: f64) {
        for (rig, actuator) in self.rigs.iter_mut().zip(&self.test.config.actuators) {
            let (delay, slope) = actuator.delay.at(time + reach * h);
            rig.pace = 1.0 - slope;
            let steps = delay / h - reach;
            rig.lookup = if delay == 0.0 {
                Lookup::Now
            } else if steps >= 0.0 {
                Lookup::Past(rig.history.behind(steps, reach == 0.0))
            } else {
                Lookup::Inside(-steps / reach, reach * h, rig.history.newest())
            };
        }
    }

    /// y' at a stage; leaves what the actuators did in `seen`.
    #[inline]
    fn rate(&mut self, ground: f64, y: &[f64], out: &mut [f64]) {
        let n = self.n;
        let (x, rest) = y.split_at(n);
        let v = &rest[..n];
        for i in 0..n {
            self.force[i] = -self.test.load[i] * ground;
        }
        for (matrix, motion) in [(&self.damping, v), (&self.stiffness, x)] {
            if let Some(matrix) = matrix {
                for i in 0..n {
                    let row = &matrix[i * n..(i + 1) * n];
                    self.force[i] -= row.iter().zip(motion).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
        let mut memory = self.elements;
        for element in &self.test.config.elements {
            let velocity = element.across(v);
            let force = element.law.force(element.across(x), velocity, &load(&element.law, y, memory));
            across_add(&mut self.force, element.dof, element.from_dof, -force);
            memory += remember(&element.law, velocity, y, memory, out);
        }
        for (rig, actuator) in self.rigs.iter_mut().zip(&self.test.config.actuators) {
            let (target, velocity) = (actuator.across(x), actuator.across(v));
            let mut input = match rig.lookup {
                Lookup::Past(motion) => motion,
                Lookup::Now => Motion { displacement: target, velocity, acceleration: 0.0 },
                Lookup::Inside(s, span, start) => {
                    let (displacement, slope) =
                        hermite(s, span, start.displacement, start.velocity, target, velocity);
                    Motion { displacement, velocity: slope, acceleration: start.acceleration }
                }
            } * actuator.gain;
            input.velocity *= rig.pace;
            input.acceleration *= rig.pace * rig.pace;
            let (motion, force) = if let Dynamics::ServoHydraulic(servo) = &actuator.dynamics {
                let w = &y[rig.dynamics..rig.memory];
                servo_rate(actuator, servo, w, input.displacement, &mut out[rig.dynamics..rig.memory]);
                (w[3], w[2])
            } else {
                let motion = match &rig.system {
                    None => input,
                    Some(system) => follow(system, input, &y[rig.dynamics..], &mut out[rig.dynamics..]),
                };
                let mut force = actuator.specimen_mass * motion.acceleration;
                let mut memory = rig.memory;
                for law in &actuator.specimen {
                    force += law.force(motion.displacement, motion.velocity, &load(law, y, memory));
                    memory += remember(law, motion.velocity, y, memory, out);
                }
                (motion.displacement, force)
            };
            rig.seen = Seen { target, measured: motion, force };
            across_add(&mut self.force, actuator.dof, actuator.from_dof, -force);
        }
        out[..n].copy_from_slice(v);
        super::sampled::multiply(&self.inverse, &self.force, &mut out[n..2 * n]);
    }
}

/// A law's memory at its place in the state.
#[inline]
fn load(law: &Law, y: &[f64], at: usize) -> [f64; 2] {
    match law.n_memory() {
        0 => [0.0; 2],
        1 => [y[at], 0.0],
        _ => [y[at], y[at + 1]],
    }
}

/// The rates of a law's memory into their places; how many there are.
#[inline]
fn remember(law: &Law, velocity: f64, y: &[f64], at: usize, out: &mut [f64]) -> usize {
    let n = law.n_memory();
    if n > 0 {
        let rate = law.rate(velocity, &load(law, y, at));
        out[at..at + n].copy_from_slice(&rate[..n]);
    }
    n
}

/// A transfer function's motion and its states' rates under an input.
fn follow(system: &StateSpace, input: Motion, w: &[f64], out: &mut [f64]) -> Motion {
    let n = system.order();
    let mut motion = input * system.d;
    for i in 0..n {
        out[i] = system.b[i] * input.displacement + (0..n).map(|j| system.a[(i, j)] * w[j]).sum::<f64>();
    }
    for i in 0..n {
        let second = system.b[i] * input.velocity + (0..n).map(|j| system.a[(i, j)] * out[j]).sum::<f64>();
        motion.displacement += system.c[i] * w[i];
        motion.velocity += system.c[i] * out[i];
        motion.acceleration += system.c[i] * second;
    }
    motion
}

/// The whole record with a fixed number of steps a sample, of the ideal sensors.
fn attempt(test: &VirtualTest, ground: &[f64], bound: f64, steps: usize) -> Result<Run> {
    let dt = 1.0 / test.config.rate_hz;
    let h = dt / steps as f64;
    let mut equations = Equations::new(test, h)?;
    let (n, len) = (equations.n, equations.len);
    let mut y = vec![0.0; len];
    let (mut ahead, mut total, mut k) = (vec![0.0; len], vec![0.0; len], vec![0.0; len]);
    let mut run = Run::sized(equations.rigs.len(), n, ground.len(), steps);
    for sample in 0..ground.len() {
        let from = ground[sample];
        let slope = ground.get(sample + 1).map_or(0.0, |to| (to - from) / steps as f64);
        for step in 0..steps {
            let time = (sample * steps + step) as f64 * h;
            let at = from + slope * step as f64;
            for (rig, actuator) in equations.rigs.iter_mut().zip(&test.config.actuators) {
                let (displacement, velocity) = (actuator.across(&y[..n]), actuator.across(&y[n..2 * n]));
                rig.history.push(Motion { displacement, velocity, acceleration: 0.0 });
            }
            equations.look(time, 0.0, h);
            equations.rate(at, &y, &mut k);
            for (rig, actuator) in equations.rigs.iter_mut().zip(&test.config.actuators) {
                rig.history.accelerate(actuator.across(&k[n..2 * n]));
            }
            if step == 0 {
                let mut within = true;
                for i in 0..n {
                    run.displacement[i][sample] = y[i];
                    within &= y[i].abs() <= bound;
                }
                for (i, rig) in equations.rigs.iter().enumerate() {
                    run.target[i][sample] = rig.seen.target;
                    run.command[i][sample] = rig.seen.target;
                    run.measured[i][sample] = rig.seen.measured;
                    run.force[i][sample] = rig.seen.force;
                    within &= rig.seen.measured.abs() <= bound && rig.seen.force.is_finite();
                }
                if !within {
                    return Err(Error::Unstable { time_s: sample as f64 * dt, bound_m: bound });
                }
                if sample + 1 == ground.len() {
                    return Ok(run);
                }
            }
            for i in 0..len {
                total[i] = y[i] + h / 6.0 * k[i];
                ahead[i] = y[i] + 0.5 * h * k[i];
            }
            equations.look(time, 0.5, h);
            for last in [false, true] {
                equations.rate(at + 0.5 * slope, &ahead, &mut k);
                let reach = if last { h } else { 0.5 * h };
                for i in 0..len {
                    total[i] += h / 3.0 * k[i];
                    ahead[i] = y[i] + reach * k[i];
                }
            }
            equations.look(time, 1.0, h);
            equations.rate(at + slope, &ahead, &mut k);
            for i in 0..len {
                y[i] = total[i] + h / 6.0 * k[i];
            }
        }
    }
    Ok(run)
}
