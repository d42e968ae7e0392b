//! Actuators: from command to the motion that the specimen really makes, and the force that it answers with.

use nalgebra::{Complex, DMatrix, DVector};

use super::check::{Checks, LEAST, MOST, nonnegative, positive};
use super::compensator::Compensation;
use super::history::{History, Motion};
use super::law::{Law, Memory};

/// Highest order of a transfer function.
pub const MAX_ORDER: usize = 16;
/// Internal Runge-Kutta steps of a servo-hydraulic plant: no longer than this over its fastest pole.
const PACE: f64 = 0.25;
/// The fastest pole that is followed, in radians a sample.
const MAX_PACE: f64 = 250.0;

/// How long the actuator lags.
#[derive(Debug, Clone, PartialEq)]
pub enum Delay {
    /// tau, s.
    Constant(f64),
    /// tau(t), linear between the points and constant outside them.
    Varying {
        /// s, rising.
        time_s: Vec<f64>,
        /// s.
        delay_s: Vec<f64>,
    },
}

impl Delay {
    /// tau and its rate of change at time t.
    #[inline]
    pub fn at(&self, time: f64) -> (f64, f64) {
        match self {
            Delay::Constant(delay) => (*delay, 0.0),
            Delay::Varying { time_s, delay_s } => {
                let after = time_s.partition_point(|t| *t <= time);
                if after == 0 || after == time_s.len() {
                    return (delay_s[after.saturating_sub(1)], 0.0);
                }
                let slope = (delay_s[after] - delay_s[after - 1]) / (time_s[after] - time_s[after - 1]);
                (delay_s[after - 1] + slope * (time - time_s[after - 1]), slope)
            }
        }
    }

    /// A history that stands still is a constant.
    pub(crate) fn plain(self) -> Self {
        let (low, high) = self.range();
        if low == high { Delay::Constant(low) } else { self }
    }

    /// The shortest and the longest.
    pub fn range(&self) -> (f64, f64) {
        match self {
            Delay::Constant(delay) => (*delay, *delay),
            Delay::Varying { delay_s, .. } => {
                delay_s.iter().fold((f64::INFINITY, 0.0), |(low, high), d| (d.min(low), d.max(high)))
            }
        }
    }

    fn check(&self, checks: &mut Checks) {
        match self {
            Delay::Constant(delay) => nonnegative(checks, "delay_s", *delay),
            Delay::Varying { time_s, delay_s } => {
                let same = time_s.len() == delay_s.len() && !time_s.is_empty();
                let lengths = format!("{} and {}", time_s.len(), delay_s.len());
                checks.demand("delay_s", same, "as many delays as times, at least one", lengths);
                let rising = time_s.iter().all(|t| t.is_finite()) && time_s.windows(2).all(|t| t[0] < t[1]);
                checks.demand("delay_s.time_s", rising, "finite times that rise", format!("{time_s:?}"));
                for delay in delay_s {
                    nonnegative(checks, "delay_s.delay_s", *delay);
                }
                let repeats = time_s.windows(2).zip(delay_s.windows(2)).any(|(t, d)| d[1] - d[0] >= t[1] - t[0]);
                checks.demand(
                    "delay_s.delay_s",
                    !(rising && repeats),
                    "delays that grow by less than time does",
                    "a faster growth (the past would repeat)",
                );
            }
        }
    }
}

/// What follows gain and delay.
#[derive(Debug, Clone, PartialEq)]
pub enum Dynamics {
    /// Nothing.
    None,
    /// z / (alpha z - (alpha - 1)), once a sample.
    FirstOrder {
        /// Samples that the actuator takes.
        alpha: f64,
    },
    /// A proper rational function of s, coefficients of falling powers.
    TransferFunction {
        /// Numerator.
        numerator: Vec<f64>,
        /// Denominator.
        denominator: Vec<f64>,
    },
    /// Servo-valve and actuator of the RTHS benchmark problem, coupled with the specimen.
    ServoHydraulic(ServoHydraulic),
}

/// Valve q'' + b1 q' + b2 q = a1b0 (g u - y), force f' = q - a3 f - a2 y', specimen m y'' + r(y, y') = f.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoHydraulic {
    /// g.
    pub gain: f64,
    /// a1 b0.
    pub a1b0: f64,
    /// a2: natural velocity feedback.
    pub a2: f64,
    /// a3.
    pub a3: f64,
    /// b1.
    pub b1: f64,
    /// b2.
    pub b2: f64,
}

impl Default for ServoHydraulic {
    /// The benchmark's nominal values.
    fn default() -> Self {
        Self { gain: 1.0261, a1b0: 2.1283e13, a2: 4.2297e6, a3: 3.3, b1: 425.0, b2: 9.9976e4 }
    }
}

impl ServoHydraulic {
    /// Rates of valve, valve speed, force, displacement and velocity under the command u.
    #[inline]
    pub(crate) fn rate(&self, w: &[f64], command: f64, restoring: f64, mass: f64, out: &mut [f64]) {
        out[0] = w[1];
        out[1] = self.a1b0 * (self.gain * command - w[3]) - self.b1 * w[1] - self.b2 * w[0];
        out[2] = w[0] - self.a3 * w[2] - self.a2 * w[4];
        out[3] = w[4];
        out[4] = (w[2] - restoring) / mass;
    }
}

/// Limit and quantum of a channel between computer and rig; its noise comes from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Largest magnitude; infinite for none.
    pub limit: f64,
    /// Step between neighbouring values; 0 for none.
    pub quantum: f64,
}

impl Default for Converter {
    fn default() -> Self {
        Self { limit: f64::INFINITY, quantum: 0.0 }
    }
}

impl Converter {
    /// The value that comes out.
    #[inline]
    pub fn convert(&self, value: f64) -> f64 {
        let held = value.clamp(-self.limit, self.limit);
        if self.quantum > 0.0 { (held / self.quantum).round() * self.quantum } else { held }
    }

    /// Whether it changes nothing.
    pub fn is_ideal(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self, checks: &mut Checks) {
        checks.demand("limit", self.limit >= LEAST, "a positive number", self.limit);
        nonnegative(checks, "quantum", self.quantum);
    }
}

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
            only(checks, "compensation", self.compensation == Compensation::None, "compensation");
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
        checks.under("dynamics", |checks| match &self.dynamics {
            Dynamics::None => {}
            Dynamics::FirstOrder { alpha } => {
                checks.demand("alpha", (1.0..=1e6).contains(alpha), "a number of samples from 1 to 1e6", alpha);
            }
            Dynamics::TransferFunction { numerator, denominator } => {
                let sound = |v: &f64| *v == 0.0 || (LEAST..=MOST).contains(&v.abs());
                let finite = numerator.iter().chain(denominator).all(sound);
                checks.demand("denominator", finite, "finite coefficients (0, or 1e-30 to 1e30 in size)", "others");
                let leads = denominator.first().is_some_and(|v| *v != 0.0);
                checks.demand("denominator", leads, "a first coefficient other than 0", format!("{denominator:?}"));
                checks.demand(
                    "denominator",
                    denominator.len() <= MAX_ORDER + 1,
                    "an order of at most 16",
                    denominator.len().saturating_sub(1),
                );
                let proper = !numerator.is_empty() && numerator.len() <= denominator.len();
                checks.demand(
                    "numerator",
                    proper,
                    "as many coefficients as the denominator's, or fewer",
                    numerator.len(),
                );
                if finite && leads && proper && denominator.len() <= MAX_ORDER + 1 {
                    match StateSpace::of(numerator, denominator).poles() {
                        None => checks.mistake("denominator", "expected a polynomial whose roots can be found"),
                        Some(poles) => {
                            if let Some(pole) = poles.iter().find(|p| p.re >= 0.0) {
                                let expected = "expected poles left of the imaginary axis";
                                checks.mistake("denominator", format!("{expected}, found {pole} rad/s"));
                            } else if let Some(pole) = poles.iter().find(|p| p.norm() > MAX_PACE * rate_hz) {
                                let expected =
                                    format!("poles of at most {:.6e} rad/s at this rate", MAX_PACE * rate_hz);
                                checks.demand("denominator", false, &expected, pole);
                            }
                        }
                    }
                }
            }
            Dynamics::ServoHydraulic(servo) => {
                for (key, value) in [("gain", servo.gain), ("a1b0", servo.a1b0), ("b1", servo.b1), ("b2", servo.b2)] {
                    positive(checks, key, value);
                }
                nonnegative(checks, "a2", servo.a2);
                nonnegative(checks, "a3", servo.a3);
            }
        });
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
}

/// x_dof - x_from of a vector over the degrees of freedom, numbered from 1; 0 is the ground.
#[inline]
pub(crate) fn across(dof: usize, from_dof: usize, x: &[f64]) -> f64 {
    x[dof - 1] - if from_dof == 0 { 0.0 } else { x[from_dof - 1] }
}

/// w' = A w + B u, y = C w + D u.
#[derive(Debug, Clone)]
pub(crate) struct StateSpace {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DVector<f64>,
    pub(crate) c: DVector<f64>,
    pub(crate) d: f64,
}

impl StateSpace {
    /// Controllable form, in time scaled so that the coefficients are of one size.
    pub(crate) fn of(numerator: &[f64], denominator: &[f64]) -> Self {
        let n = denominator.len() - 1;
        let lead = denominator[0];
        let scale = (1..=n).map(|i| (denominator[i] / lead).abs().powf(1.0 / i as f64)).fold(0.0, f64::max);
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let pad = denominator.len() - numerator.len();
        let top = |i: usize| if i < pad { 0.0 } else { numerator[i - pad] / lead };
        let d = top(0);
        let (mut a, mut b, mut c) = (DMatrix::zeros(n, n), DVector::zeros(n), DVector::zeros(n));
        for i in 1..=n {
            let power = scale.powi(-(i as i32));
            let bottom = denominator[i] / lead;
            if i < n {
                a[(n - 1 - i, n - i)] = scale;
            }
            a[(n - 1, n - i)] = -scale * bottom * power;
            c[n - i] = (top(i) - d * bottom) * power;
        }
        if n > 0 {
            b[n - 1] = scale;
        }
        Self { a, b, c, d }
    }

    pub(crate) fn order(&self) -> usize {
        self.b.len()
    }

    /// None where they cannot be found.
    pub(crate) fn poles(&self) -> Option<Vec<Complex<f64>>> {
        if self.order() == 0 { Some(Vec::new()) } else { eigenvalues(&self.a) }
    }

    /// y / u at s.
    pub(crate) fn response(&self, s: Complex<f64>) -> Complex<f64> {
        solve_response(&self.a, &self.b, &self.c, self.d, s)
    }

    /// A held input's step: exp(A dt) and the integral of exp(A t) B, balanced before the exponential is taken.
    pub(crate) fn held(&self, dt: f64) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.order();
        let mut a = self.a.clone();
        let scale = nalgebra::linalg::balancing::balance_parlett_reinsch(&mut a);
        let b = self.b.component_div(&scale);
        let size = b.amax().max(f64::MIN_POSITIVE);
        let mut both = DMatrix::zeros(n + 1, n + 1);
        both.view_mut((0, 0), (n, n)).copy_from(&(a * dt));
        both.view_mut((0, n), (n, 1)).copy_from(&(b * (dt / size)));
        let both = both.exp();
        let a = DMatrix::from_fn(n, n, |i, j| both[(i, j)] * scale[i] / scale[j]);
        (a, DVector::from_fn(n, |i, _| both[(i, n)] * scale[i] * size))
    }
}

/// C (z I - A)^-1 B + D.
pub(crate) fn solve_response(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    c: &DVector<f64>,
    d: f64,
    z: Complex<f64>,
) -> Complex<f64> {
    let n = b.len();
    if n == 0 {
        return Complex::new(d, 0.0);
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| if i == j { z } else { Complex::new(0.0, 0.0) } - a[(i, j)]);
    let solved = matrix.lu().solve(&b.map(|v| Complex::new(v, 0.0)));
    let solved = solved.unwrap_or_else(|| DVector::from_element(n, Complex::new(f64::NAN, f64::NAN)));
    solved.iter().zip(c.iter()).map(|(x, c)| x * *c).sum::<Complex<f64>>() + d
}

/// Eigenvalues of a general real matrix, balanced first; None where the iteration does not end.
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    // Squares that leave double precision would keep the balancing from ending.
    if !matrix.iter().all(|v| v.abs() < 1e140) {
        return None;
    }
    let mut balanced = matrix.clone();
    nalgebra::linalg::balancing::balance_parlett_reinsch(&mut balanced);
    let schur = nalgebra::Schur::try_new(balanced, f64::EPSILON, 10_000)?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

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
                Kind::Linear { held: (super::structure::rows(&a), b.as_slice().to_vec()), system }
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
    /// [`crate::Error::Configuration`] with every mistake; [`crate::Error::Rate`].
    pub fn new(actuator: &Actuator, rate_hz: f64) -> crate::Result<Self> {
        crate::pair::check_rate(rate_hz)?;
        let mut checks = Checks::default();
        checks.under("actuator[1]", |c| {
            actuator.check_specimen(c);
            actuator.check(c, true, rate_hz);
        });
        if checks.mistakes.is_empty() {
            Ok(Self::planned(actuator, rate_hz))
        } else {
            Err(crate::Error::Configuration(checks.mistakes))
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
                servo_rate(actuator, servo, ahead, held, &mut k[stage * n..(stage + 1) * n]);
            }
            for i in 0..n {
                w[i] += h / 6.0 * (k[i] + 2.0 * (k[n + i] + k[2 * n + i]) + k[3 * n + i]);
            }
            hold(&mut w[5..], &self.limits);
        }
        let w = &state.dynamics;
        let restoring = servo_rate(actuator, servo, w, held, &mut k[..n]);
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

/// Rates of the plant and of its specimen's memory; returns the specimen's restoring force without inertia.
#[inline]
pub(crate) fn servo_rate(actuator: &Actuator, servo: &ServoHydraulic, w: &[f64], command: f64, out: &mut [f64]) -> f64 {
    let mut restoring = 0.0;
    for (i, law) in actuator.specimen.iter().enumerate() {
        let memory = [w[5 + 2 * i], w[6 + 2 * i]];
        restoring += law.force(w[3], w[4], &memory);
        let rate = law.rate(w[4], &memory);
        (out[5 + 2 * i], out[6 + 2 * i]) = (rate[0], rate[1]);
    }
    servo.rate(w, command, restoring, actuator.specimen_mass, &mut out[..5]);
    restoring
}
