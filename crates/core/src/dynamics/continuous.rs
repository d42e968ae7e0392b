//! The delay equation in continuous time: Runge-Kutta steps of fourth order within each sample, the delayed motion from the
//! Hermite interpolant of the steps before.
//!
//! The ground motion is linear between samples and every sample is the end of a step, so no step crosses a corner of it.
//! Steps begin no longer than the delay (down to 1/64 of a sample) and half the time scale of the fastest mode, pole or
//! relaxation; they are halved until target and measured change by less than the tolerance times their peaks. The error
//! falls with the fourth power of the step for linear systems, and with about the third where a law has corners (Bouc-Wen
//! at reversals). A specimen's mass behind a delay makes the equation neutral: corners of the ground motion return within
//! later steps, and the order falls to between one and two.
//!
//! Where the target is given there is no equation to solve but the actuators': what they follow is looked up in it.

use nalgebra::DMatrix;

use super::actuator::Actuator;
use super::check::configuration;
use super::delay::Delay;
use super::history::{Course, History, Motion, Tap};
use super::law::Law;
use super::plant::{Dynamics, StateSpace};
use super::structure::{across, across_add, add_across, multiply, rows};
use super::virtual_test::{Drive, Noise, Run, VirtualTest};
use crate::error::{Error, Result};
use crate::pair::peak;

/// omega h at which halving begins.
const PACE: f64 = 0.5;
/// Delays shorter than a sample over this are looked up within the step, by a Taylor series whose remainder is of the
/// order (omega tau)^3 / 6.
const SHORTEST: f64 = 64.0;
/// Most halvings, most steps a sample to begin with, and most steps in all after which halving ends.
const MAX_HALVINGS: usize = 6;
const MAX_STEPS: f64 = 1024.0;
const ENOUGH: usize = 1 << 27;

pub(crate) fn run(test: &VirtualTest, drive: Drive<'_>, noise: &Noise, bound: f64) -> Result<Run> {
    let mut steps = first_steps(test)?;
    // The first is only compared with, and keeps no more than that needs.
    let mut coarse = attempt(test, drive, bound, steps, test.is_alone());
    for _ in 0..MAX_HALVINGS {
        steps *= 2;
        let mut fine = attempt(test, drive, bound, steps, true);
        if let (Ok(one), Ok(two)) = (&coarse, &mut fine) {
            two.error_estimate = difference(one, two, test.is_alone());
        }
        // Both unstable: the loop is, not the steps.
        let settled = match (&coarse, &fine) {
            (Ok(_), Ok(fine)) => fine.error_estimate <= test.config.tolerance,
            (Err(_), Err(_)) => true,
            _ => false,
        };
        coarse = fine;
        if settled || steps * drive.len() > ENOUGH {
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
    let laws =
        test.config.actuators.iter().flat_map(|a| &a.specimen).chain(test.config.elements.iter().map(|e| &e.law));
    rate = laws.map(Law::relaxation_rate).fold(rate, f64::max);
    for actuator in &test.config.actuators {
        rate = rate.max(actuator.fastest_pole().unwrap_or(0.0));
    }
    let mut steps = (rate * dt / PACE).ceil().max(1.0);
    // A given target is looked up wherever the delay lies.
    for actuator in test.config.actuators.iter().filter(|_| !test.is_alone()) {
        let shortest = actuator.delay.range().0;
        if shortest * SHORTEST >= dt {
            steps = steps.max((dt / shortest).ceil());
        }
    }
    if steps > MAX_STEPS || steps.is_nan() {
        let message = format!(
            "expected at least {:.0} Hz for the fastest mode, pole or relaxation, found {}",
            rate / PACE / MAX_STEPS,
            test.config.rate_hz
        );
        return Err(configuration("test.rate_hz", &message));
    }
    Ok(steps as usize)
}

/// The largest change of target and measured over their peaks; of the force too where nothing that it moves would show it.
fn difference(one: &Run, two: &Run, alone: bool) -> f64 {
    let mut worst: f64 = 0.0;
    let moved = one.target.iter().zip(&two.target).chain(one.measured.iter().zip(&two.measured));
    for (a, b) in moved.chain(one.force.iter().zip(&two.force).filter(|_| alone)) {
        let peak = peak(b);
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
    /// Within the step, so short before the stage that its own motion tells: the delay, and the acceleration over it.
    Inside(f64, f64),
    /// No delay, ever.
    Now,
}

struct Rig {
    history: History,
    /// A constant delay of a step or more: where it lies at the middle and at the end of a step.
    taps: Option<[Tap; 2]>,
    /// Whether anything behind the delay feels its acceleration.
    heavy: bool,
    /// Whether there is no delay, so that the specimen's mass moves with the structure's, and how much of it.
    instant: bool,
    inertia: f64,
    /// What it finds at the end of a step, and so at the start of the next.
    ahead: Motion,
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
    /// The target, where it is given and there is no structure (n = 0), and what it is at the stage.
    course: Option<(Course<'a>, Motion)>,
    /// Inverse of the mass with the specimens that follow without delay.
    inverse: Vec<f64>,
    damping: Option<Vec<f64>>,
    stiffness: Option<Vec<f64>>,
    rigs: Vec<Rig>,
    elements: usize,
    force: Vec<f64>,
    len: usize,
    /// Where each law's memory lies, and its limit.
    places: Vec<usize>,
    limits: Vec<f64>,
}

impl<'a> Equations<'a> {
    fn new(test: &'a VirtualTest, drive: Drive<'a>, step_s: f64) -> Result<Self> {
        let n = test.config.structure.n_dof();
        let course = match drive {
            Drive::Target(samples) => Some((Course::new(samples, test.config.rate_hz), Motion::default())),
            Drive::Ground(_) => None,
        };
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
            let instant = actuator.delay == Delay::Constant(0.0);
            let mut inertia = 0.0;
            if instant && n > 0 {
                inertia = actuator.gain * through * actuator.specimen_mass;
                add_across(&mut mass, actuator.dof, actuator.from_dof, inertia);
            }
            let dynamics = len;
            len += if servo { 5 + 2 * actuator.specimen.len() } else { system.as_ref().map_or(0, StateSpace::order) };
            let memory = len;
            if !servo {
                len += 2 * actuator.specimen.len();
            }
            let taps = match actuator.delay {
                Delay::Constant(delay) if delay >= step_s && n > 0 => {
                    Some([0.5, 1.0].map(|reach| Tap::new((delay / step_s - reach).max(0.0), step_s)))
                }
                _ => None,
            };
            rigs.push(Rig {
                history: History::new(actuator.delay.range().1 / step_s, step_s),
                taps,
                heavy: actuator.specimen_mass > 0.0 || system.is_some(),
                instant,
                inertia,
                ahead: Motion::default(),
                lookup: Lookup::Now,
                pace: 1.0,
                system,
                dynamics,
                memory,
                seen: Seen::default(),
            });
        }
        let elements = len;
        len += 2 * test.config.elements.len();
        let (mut places, mut limits) = (Vec::new(), Vec::new());
        for (actuator, rig) in test.config.actuators.iter().zip(&rigs) {
            let servo = matches!(actuator.dynamics, Dynamics::ServoHydraulic(_));
            let start = if servo { rig.dynamics + 5 } else { rig.memory };
            places.extend((0..actuator.specimen.len()).map(|i| start + 2 * i));
            limits.extend(actuator.specimen.iter().map(Law::limit));
        }
        places.extend((0..test.config.elements.len()).map(|i| elements + 2 * i));
        limits.extend(test.config.elements.iter().map(|e| e.law.limit()));
        let some = |matrix: &DMatrix<f64>| (n > 0 && matrix.amax() > 0.0).then(|| rows(matrix));
        let inverse = if n > 0 { mass.try_inverse().filter(|m| m.iter().all(|v| v.is_finite())) } else { Some(mass) };
        let inverse =
            rows(&inverse.ok_or_else(|| configuration("structure.mass_kg", "expected a matrix that can be inverted"))?);
        let (damping, stiffness) = (some(&test.numerical.damping), some(&test.numerical.stiffness));
        Ok(Self {
            test,
            n,
            course,
            inverse,
            damping,
            stiffness,
            rigs,
            elements,
            force: vec![0.0; n],
            len,
            places,
            limits,
        })
    }

    /// Finds each actuator's delayed target for the stage at `reach` (0, 1/2, 1) of the step that begins at `time`.
    #[inline(always)]
    fn look<const ONE: bool>(&mut self, time: f64, reach: f64, h: f64) {
        if let (false, Some((course, now))) = (ONE, &mut self.course) {
            // What was found at the end of a step stands at the start of the next.
            if reach == 0.0 && time > 0.0 {
                return;
            }
            let (time, rate) = (time + reach * h, self.test.config.rate_hz);
            *now = course.at(time * rate);
            for (rig, actuator) in self.rigs.iter_mut().zip(&self.test.config.actuators) {
                let (delay, slope) = actuator.delay.at(time);
                rig.pace = 1.0 - slope;
                rig.lookup = Lookup::Past(if rig.instant { *now } else { course.at((time - delay) * rate) });
            }
            return;
        }
        for (rig, actuator) in self.rigs.iter_mut().zip(&self.test.config.actuators) {
            if let Some([middle, end]) = &rig.taps {
                if reach > 0.0 {
                    rig.ahead = rig.history.at(if reach < 1.0 { middle } else { end }, rig.heavy);
                }
                rig.lookup = Lookup::Past(rig.ahead);
                continue;
            }
            let (delay, slope) = actuator.delay.at(time + reach * h);
            rig.pace = 1.0 - slope;
            let steps = delay / h - reach;
            rig.lookup = if rig.instant {
                Lookup::Now
            } else if steps >= 0.0 {
                Lookup::Past(rig.history.behind(steps, reach == 0.0))
            } else {
                let (now, before) = (rig.history.back(0).acceleration, rig.history.back(1).acceleration);
                Lookup::Inside(delay, now + (reach - 0.5 * delay / h) * (now - before))
            };
        }
    }

    /// Writes a sample of every signal, of forces with the mass that moves at once; whether all are within the bound.
    fn record(&self, run: &mut Run, sample: usize, x: &[f64], acceleration: &[f64], bound: f64) -> bool {
        let mut within = x.iter().all(|x| x.abs() <= bound);
        for (i, (rig, actuator)) in self.rigs.iter().zip(&self.test.config.actuators).enumerate() {
            let mut answered = rig.seen.force;
            if !acceleration.is_empty() {
                answered += rig.inertia * actuator.across(acceleration);
            }
            run.target[i][sample] = rig.seen.target;
            run.measured[i][sample] = rig.seen.measured;
            within &= rig.seen.measured.abs() <= bound && answered.is_finite();
            if let Some(force) = run.force[i].get_mut(sample) {
                *force = answered;
            }
        }
        for (signal, x) in run.displacement.iter_mut().zip(x) {
            if let Some(place) = signal.get_mut(sample) {
                *place = *x;
            }
        }
        within
    }

    /// y' at a stage; leaves what the actuators did in `seen`. ONE says that there is one degree of freedom and
    /// one law and nothing else, so that the whole state can stay in registers.
    #[inline(always)]
    fn rate<const ONE: bool>(&mut self, ground: f64, y: &[f64], out: &mut [f64]) {
        let n = if ONE { 1 } else { self.n };
        let (x, rest) = y.split_at(n);
        let v = &rest[..n];
        let (mut single, mut several) = ([0.0; 1], std::mem::take(&mut self.force));
        let force: &mut [f64] = if ONE { &mut single } else { &mut several };
        let across = |dof: usize, from_dof: usize, x: &[f64]| if ONE { x[0] } else { across(dof, from_dof, x) };
        let push = |force: &mut [f64], dof: usize, from_dof: usize, value: f64| {
            if ONE { force[0] -= value } else { across_add(force, dof, from_dof, -value) }
        };
        for i in 0..n {
            force[i] = -self.test.load[i] * ground;
        }
        for (matrix, motion) in [(&self.damping, v), (&self.stiffness, x)] {
            if let Some(matrix) = matrix {
                for i in 0..n {
                    let row = &matrix[i * n..(i + 1) * n];
                    force[i] -= row.iter().zip(motion).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
        let mut memory = if ONE { 2 } else { self.elements };
        for element in &self.test.config.elements {
            let (dof, from_dof) = (element.dof, element.from_dof);
            let (at, velocity) = (across(dof, from_dof, x), across(dof, from_dof, v));
            push(force, dof, from_dof, answer(&element.law, at, velocity, y, memory, out));
            memory += 2;
        }
        for (rig, actuator) in self.rigs.iter_mut().zip(&self.test.config.actuators) {
            let (dof, from_dof) = (actuator.dof, actuator.from_dof);
            let (target, velocity) = match &self.course {
                Some((_, now)) if !ONE => (now.displacement, now.velocity),
                _ => (across(dof, from_dof, x), across(dof, from_dof, v)),
            };
            let mut input = match rig.lookup {
                Lookup::Past(motion) => motion,
                Lookup::Now => Motion { displacement: target, velocity, acceleration: 0.0 },
                Lookup::Inside(delay, acceleration) => Motion {
                    displacement: target - delay * (velocity - 0.5 * delay * acceleration),
                    velocity: velocity - delay * acceleration,
                    acceleration,
                },
            } * actuator.gain;
            input.velocity *= rig.pace;
            input.acceleration *= rig.pace * rig.pace;
            let (motion, answered) = if let Dynamics::ServoHydraulic(servo) = &actuator.dynamics {
                let w = &y[rig.dynamics..rig.memory];
                actuator.servo_rate(servo, w, input.displacement, &mut out[rig.dynamics..rig.memory]);
                (w[3], w[2])
            } else {
                let motion = match &rig.system {
                    None => input,
                    Some(system) => follow(system, input, &y[rig.dynamics..], &mut out[rig.dynamics..]),
                };
                let mut answered = actuator.specimen_mass * motion.acceleration;
                let mut memory = if ONE { 2 } else { rig.memory };
                for law in &actuator.specimen {
                    answered += answer(law, motion.displacement, motion.velocity, y, memory, out);
                    memory += 2;
                }
                (motion.displacement, answered)
            };
            rig.seen = Seen { target, measured: motion, force: answered };
            if ONE || n > 0 {
                push(force, dof, from_dof, answered);
            }
        }
        if ONE {
            (out[0], out[1]) = (v[0], self.inverse[0] * force[0]);
        } else if n > 0 {
            out[..n].copy_from_slice(v);
            multiply(&self.inverse, force, &mut out[n..2 * n]);
        }
        self.force = several;
    }

    /// Keeps each law's memory within its limit after a step.
    #[inline(always)]
    fn hold<const ONE: bool>(&self, y: &mut [f64]) {
        if ONE {
            y[2] = y[2].max(-self.limits[0]).min(self.limits[0]);
            return;
        }
        for (place, limit) in self.places.iter().zip(&self.limits) {
            y[*place] = y[*place].clamp(-limit, *limit);
        }
    }
}

/// A law's force, and the rates of its memory into their two places.
#[inline(always)]
fn answer(law: &Law, displacement: f64, velocity: f64, y: &[f64], at: usize, out: &mut [f64]) -> f64 {
    let (Some([one, two]), Some(rates)) = (y.get(at..at + 2), out.get_mut(at..at + 2)) else { return 0.0 };
    let memory = [*one, *two];
    rates.copy_from_slice(&law.rate(velocity, &memory));
    law.force(displacement, velocity, &memory)
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

/// What an actuator spans of a vector over the degrees of freedom.
#[inline(always)]
fn place<const ONE: bool>(actuator: &Actuator, x: &[f64]) -> f64 {
    if ONE { x[0] } else { actuator.across(x) }
}

/// The whole record with a fixed number of steps a sample, of the ideal sensors.
fn attempt(test: &VirtualTest, drive: Drive<'_>, bound: f64, steps: usize, whole: bool) -> Result<Run> {
    let equations = Equations::new(test, drive, 1.0 / test.config.rate_hz / steps as f64)?;
    let n_blocks = equations.len.div_ceil(4);
    match (equations.n, n_blocks) {
        (1, 1) => stepped::<true, _>([[0.0; 4]; 1], equations, drive, bound, steps, whole),
        _ => stepped::<false, _>(vec![[0.0; 4]; n_blocks], equations, drive, bound, steps, whole),
    }
}

/// `f` of every number of two states into a third. States come in blocks that fill a vector register, whatever their length.
#[inline(always)]
fn combine(out: &mut [[f64; 4]], y: &[[f64; 4]], k: &[[f64; 4]], f: impl Fn(f64, f64) -> f64) {
    for ((out, y), k) in out.iter_mut().zip(y).zip(k) {
        for i in 0..4 {
            out[i] = f(y[i], k[i]);
        }
    }
}

/// ONE and the type of the state tell the compiler the sizes of the commonest test.
fn stepped<const ONE: bool, S: Clone + AsRef<[[f64; 4]]> + AsMut<[[f64; 4]]>>(
    rest: S,
    mut equations: Equations<'_>,
    drive: Drive<'_>,
    bound: f64,
    steps: usize,
    whole: bool,
) -> Result<Run> {
    let test = equations.test;
    let dt = 1.0 / test.config.rate_hz;
    let (h, n) = (dt / steps as f64, if ONE { 1 } else { equations.n });
    let (ground, n_samples): (&[f64], usize) = match drive {
        Drive::Ground(ground) => (ground, ground.len()),
        Drive::Target(target) => (&[], target.len()),
    };
    let moves = ONE || n > 0;
    let (mut y, mut ahead, mut total, mut k) = (rest.clone(), rest.clone(), rest.clone(), rest);
    let mut run = Run::sized(equations.rigs.len(), n, if whole { n_samples } else { 0 }, steps);
    for signal in run.target.iter_mut().chain(&mut run.measured) {
        signal.resize(n_samples, 0.0);
    }
    for sample in 0..n_samples {
        let from = ground.get(sample).copied().unwrap_or(0.0);
        let slope = ground.get(sample + 1).map_or(0.0, |to| (to - from) / steps as f64);
        for step in 0..steps {
            let time = (sample * steps + step) as f64 * h;
            let at = from + slope * step as f64;
            let now = y.as_ref().as_flattened();
            for (rig, actuator) in equations.rigs.iter_mut().zip(&test.config.actuators).filter(|_| moves) {
                let (displacement, velocity) =
                    (place::<ONE>(actuator, &now[..n]), place::<ONE>(actuator, &now[n..2 * n]));
                rig.history.open(displacement, velocity);
            }
            equations.look::<ONE>(time, 0.0, h);
            equations.rate::<ONE>(at, now, k.as_mut().as_flattened_mut());
            for (rig, actuator) in equations.rigs.iter_mut().zip(&test.config.actuators).filter(|_| moves) {
                rig.history.accelerate(place::<ONE>(actuator, &k.as_ref().as_flattened()[n..2 * n]));
            }
            if step == 0 {
                if !equations.record(&mut run, sample, &now[..n], &k.as_ref().as_flattened()[n..2 * n], bound) {
                    return Err(Error::Unstable { time_s: sample as f64 * dt, bound_m: bound });
                }
                if sample + 1 == n_samples {
                    run.command.clone_from(&run.target);
                    return Ok(run);
                }
            }
            combine(total.as_mut(), y.as_ref(), k.as_ref(), |y, k| y + h / 6.0 * k);
            combine(ahead.as_mut(), y.as_ref(), k.as_ref(), |y, k| y + 0.5 * h * k);
            equations.look::<ONE>(time, 0.5, h);
            for reach in [0.5 * h, h] {
                equations.rate::<ONE>(at + 0.5 * slope, ahead.as_ref().as_flattened(), k.as_mut().as_flattened_mut());
                for (total, k) in total.as_mut().iter_mut().zip(k.as_ref()) {
                    for i in 0..4 {
                        total[i] += h / 3.0 * k[i];
                    }
                }
                combine(ahead.as_mut(), y.as_ref(), k.as_ref(), |y, k| y + reach * k);
            }
            equations.look::<ONE>(time, 1.0, h);
            equations.rate::<ONE>(at + slope, ahead.as_ref().as_flattened(), k.as_mut().as_flattened_mut());
            combine(y.as_mut(), total.as_ref(), k.as_ref(), |total, k| total + h / 6.0 * k);
            equations.hold::<ONE>(y.as_mut().as_flattened_mut());
        }
    }
    Ok(run)
}

#[cfg(test)]
mod tests {
    use super::{Drive, attempt};
    use crate::dynamics::{
        Actuator, BoucWen, Compensation, Converter, Delay, Dynamics, Law, Stepping, Structure, TestConfig, VirtualTest,
    };

    fn test(law: Law, frequency: f64, delay: f64, mass: f64) -> VirtualTest {
        let stiffness = 11.765e6;
        let omega = 2.0 * std::f64::consts::PI * frequency;
        let actuator = Actuator {
            dof: 1,
            from_dof: 0,
            specimen: vec![law],
            specimen_mass: mass * stiffness / (omega * omega),
            part_of_structure: true,
            gain: 1.1,
            delay: Delay::Constant(delay),
            dynamics: Dynamics::None,
            compensation: Compensation::NONE,
            command_converter: Converter::default(),
            displacement_sensor: Converter::default(),
            force_sensor: Converter::default(),
            force_delay_samples: 0,
        };
        let config = TestConfig {
            structure: Structure::sdof(frequency, 0.02, stiffness / (omega * omega)).unwrap(),
            elements: Vec::new(),
            actuators: vec![actuator],
            stepping: Stepping::Continuous,
            rate_hz: 64.0,
            tolerance: 1e-6,
            bound_m: None,
        };
        VirtualTest::new(config).unwrap()
    }

    /// Errors of the target over its peak with 4, 8, 16, 32 steps a sample, against 256.
    fn errors(test: &VirtualTest) -> Vec<f64> {
        let push = |t: f64| 3.0 * (5.0 * t).sin() * t * (-t).exp();
        let ground: Vec<f64> = (0..640).map(|i| push(f64::from(i) / 64.0)).collect();
        let run = |steps| attempt(test, Drive::Ground(&ground), 1e3, steps, true).unwrap().target.remove(0);
        let fine = run(256);
        let largest = |x: &[f64], y: &[f64]| x.iter().zip(y).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let peak = largest(&fine, &vec![0.0; fine.len()]);
        [4, 8, 16, 32].into_iter().map(|steps| largest(&run(steps), &fine) / peak).collect()
    }

    /// How often the error halves when the step is halved.
    fn orders(test: &VirtualTest) -> Vec<f64> {
        errors(test).windows(2).map(|e| (e[0] / e[1]).log2()).collect()
    }

    const SPRING: Law = Law::Spring { stiffness: 11.765e6 };

    #[test]
    fn a_linear_loop_converges_with_the_fourth_power_of_the_step() {
        // A delay of no whole number of steps; none; none with a specimen's mass.
        for (delay, mass) in [(0.0051, 0.0), (0.0, 0.0), (0.0, 0.1)] {
            for order in orders(&test(SPRING, 1.0, delay, mass)) {
                assert!(order > 3.6, "delay {delay}, mass {mass}: order {order}");
            }
        }
    }

    #[test]
    fn corners_that_a_delayed_mass_sends_round_the_loop_cost_two_orders() {
        // A neutral equation: corners of the ground motion return with the delayed acceleration, within steps.
        let seen = errors(&test(SPRING, 1.0, 0.0051, 0.1));
        assert!(seen[3] < seen[0] / 8.0 && seen[3] < 1e-6, "errors {seen:?}");
    }

    #[test]
    fn a_delay_within_the_step_errs_by_no_more_than_its_cube() {
        for error in errors(&test(SPRING, 1.0, 1e-4, 0.0)) {
            assert!(error < 1e-7, "error {error}");
        }
    }

    #[test]
    fn a_yielding_specimen_converges_at_least_with_the_square() {
        let law = Law::BoucWen(BoucWen {
            stiffness: 11.765e6,
            yield_displacement: 0.01,
            post_yield_ratio: 0.01,
            beta: 0.55,
            gamma: 0.45,
            exponent: 2.0,
        });
        let seen = orders(&test(law, 1.0, 0.005, 0.0));
        let mean = seen.iter().sum::<f64>() / seen.len() as f64;
        assert!(mean > 2.5, "orders {seen:?}");
    }
}
