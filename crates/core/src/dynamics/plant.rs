//! What follows an actuator's gain and delay: transfer functions and the servo-hydraulic plant, as linear systems.

use nalgebra::{Complex, DMatrix, DVector};

use super::check::{Checks, LEAST, MOST, nonnegative, positive};

/// Highest order of a transfer function.
pub const MAX_ORDER: usize = 16;
/// The fastest pole that is followed, in radians a sample.
pub(super) const MAX_PACE: f64 = 250.0;

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

impl Dynamics {
    pub(super) fn check(&self, checks: &mut Checks, rate_hz: f64) {
        match self {
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
        }
    }
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
