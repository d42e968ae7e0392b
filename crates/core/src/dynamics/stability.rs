//! What delay a loop bears, and what a delay costs it in damping.
//!
//! With one actuator of gain K and delay tau the characteristic equation of the linear loop is 1 + L(s) e^(-s tau) = 0,
//! L(s) = K k_e(s) b^T (M_N s^2 + C_N s + K_N)^-1 b, k_e(s) the specimen's dynamic stiffness. Its roots can cross the
//! imaginary axis only where |L(j omega)| = 1. These frequencies are the imaginary eigenvalues of a Hamiltonian matrix (as
//! in the computation of H-infinity norms, Boyd and Balakrishnan 1990), so none is missed; the critical delay is the
//! least of ((arg L + pi) mod 2 pi) / omega over them.

use std::f64::consts::PI;

use nalgebra::{Cholesky, Complex, DMatrix, DVector};

use super::check::configuration;
use super::law::Law;
use super::plant::{StateSpace, eigenvalues};
use super::structure::modes;
use super::virtual_test::VirtualTest;
use crate::error::Result;

/// How near to the imaginary axis an eigenvalue is taken for a crossing, before it is proved by |L| = 1.
const NEAR: f64 = 1e-4;
/// ln |L| at a proved crossing.
const PROVED: f64 = 1e-9;
/// An angle this close below a full turn is no turn.
const ANGLE: f64 = 1e-9;
/// Steps in which a root is followed from no delay to the whole.
const CONTINUATION: usize = 16;

/// The delay at which the first pair of roots reaches the imaginary axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalDelay {
    /// s; 0 where the loop is unstable without any, infinite where none makes it unstable.
    pub delay_s: f64,
    /// The frequency at which it then rings, Hz; NaN where there is none.
    pub frequency_hz: f64,
    /// K.
    pub gain: f64,
    /// Whether the loop is linear; otherwise this is of its elastic stiffness.
    pub exact: bool,
}

/// What a delay does to the damping of each mode; one value a mode.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayDamping {
    /// Of the delayed loop, Hz.
    pub frequency_hz: Vec<f64>,
    /// -Re s / |s| of the delayed loop's root.
    pub damping_ratio: Vec<f64>,
    /// The same without delay.
    pub damping_ratio_without: Vec<f64>,
    /// -(K k_e / k) omega tau / 2, k = omega^2 of unit modal mass, k_e the real part of the specimen's dynamic stiffness
    /// at omega: its mass takes omega^2 m_e from it.
    pub first_order_change: Vec<f64>,
}

/// The loop of the only actuator, elastic.
pub(crate) struct Loop {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    b: DVector<f64>,
    gain: f64,
    specimen: [f64; 3],
    /// Stiffness and relaxation rate of the specimen's Maxwell elements.
    relaxing: Vec<(f64, f64)>,
    elements: Vec<(DVector<f64>, f64, f64)>,
    exact: bool,
}

impl Loop {
    pub(crate) fn new(test: &VirtualTest) -> Result<Self> {
        let config = &test.config;
        if test.is_alone() {
            return Err(configuration("structure", "expected one for a critical delay, found none: no loop is closed"));
        }
        let [actuator] = &config.actuators[..] else {
            let message = format!("expected one actuator for a critical delay, found {}", config.actuators.len());
            return Err(configuration("actuator", &message));
        };
        let n = config.structure.n_dof();
        let place = |dof: usize, from_dof: usize| {
            let mut b = DVector::zeros(n);
            b[dof - 1] = 1.0;
            if from_dof > 0 {
                b[from_dof - 1] = -1.0;
            }
            b
        };
        let maxwell = |law: &Law| match law {
            Law::Maxwell { stiffness, damping } => Some((*stiffness, stiffness / damping)),
            _ => None,
        };
        let elastic = test.elastic();
        let laws = || actuator.specimen.iter().chain(config.elements.iter().map(|e| &e.law));
        Ok(Self {
            mass: elastic.mass,
            damping: elastic.damping,
            stiffness: elastic.stiffness,
            b: place(actuator.dof, actuator.from_dof),
            gain: actuator.gain,
            specimen: [actuator.elastic_stiffness(), actuator.viscous_damping(), actuator.specimen_mass],
            relaxing: actuator.specimen.iter().filter_map(maxwell).collect(),
            elements: config
                .elements
                .iter()
                .filter_map(|e| maxwell(&e.law).map(|(k, rate)| (place(e.dof, e.from_dof), k, rate)))
                .collect(),
            exact: laws().all(Law::is_linear),
        })
    }

    /// A, B, C, D of L: states x, v, the elements' and the specimen's relaxing forces; input the actuator's force.
    fn open(&self) -> Option<StateSpace> {
        let n = self.b.len();
        let (own, all) = (2 * n + self.elements.len(), 2 * n + self.elements.len() + self.relaxing.len());
        let inverse = self.mass.clone().try_inverse()?;
        let mut a = DMatrix::zeros(all, all);
        a.view_mut((0, n), (n, n)).fill_with_identity();
        a.view_mut((n, 0), (n, n)).copy_from(&(-&inverse * &self.stiffness));
        a.view_mut((n, n), (n, n)).copy_from(&(-&inverse * &self.damping));
        for (i, (place, k, rate)) in self.elements.iter().enumerate() {
            a.view_mut((n, 2 * n + i), (n, 1)).copy_from(&(-&inverse * place));
            a.view_mut((2 * n + i, n), (1, n)).copy_from(&(place.transpose() * *k));
            a[(2 * n + i, 2 * n + i)] = -rate;
        }
        for (i, (k, rate)) in self.relaxing.iter().enumerate() {
            a.view_mut((own + i, n), (1, n)).copy_from(&(self.b.transpose() * *k));
            a[(own + i, own + i)] = -rate;
        }
        let mut b = DVector::zeros(all);
        b.rows_mut(n, n).copy_from(&(&inverse * &self.b));
        let [k, c, m] = self.specimen;
        let mut out = DVector::zeros(all);
        out.rows_mut(0, n).copy_from(&(&self.b * k));
        out.rows_mut(n, n).copy_from(&(&self.b * c));
        for i in 0..self.relaxing.len() {
            out[own + i] = 1.0;
        }
        out += a.rows(n, n).transpose() * &self.b * m;
        let d = m * self.b.dot(&b.rows(n, n));
        // One scale for input and output, so that the Hamiltonian's blocks are of one size.
        let scale = (out.amax() / b.amax()).sqrt();
        let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        Some(StateSpace { a, b: b * (scale * self.gain), c: out / scale, d: d * self.gain })
    }

    pub(crate) fn critical_delay(&self) -> Result<CriticalDelay> {
        let found = |delay_s, frequency_hz| CriticalDelay { delay_s, frequency_hz, gain: self.gain, exact: self.exact };
        let Some(open) = self.open() else {
            return Err(configuration("structure.mass_kg", "expected a matrix that can be inverted"));
        };
        // A specimen heavier than what is left of the structure rings at every frequency, however short the delay.
        if open.d.abs() >= 1.0 {
            return Ok(found(0.0, f64::NAN));
        }
        let closed = &open.a - &open.b * open.c.transpose() / (1.0 + open.d);
        let slow = |p: &Complex<f64>| p.re > -1e-10 * p.norm().max(1e-12);
        let unsolved =
            || configuration("structure", "expected a loop whose roots can be found: are its numbers of one size?");
        if let Some(root) = eigenvalues(&closed).ok_or_else(unsolved)?.iter().find(|p| slow(p) && p.im >= 0.0) {
            return Ok(found(0.0, root.im / (2.0 * PI)));
        }
        let mut least = found(f64::INFINITY, f64::NAN);
        for omega in crossings(&open).ok_or_else(unsolved)? {
            let mut angle = (open.response(Complex::new(0.0, omega)).arg() + PI).rem_euclid(2.0 * PI);
            if angle > 2.0 * PI - ANGLE {
                angle = 0.0;
            }
            if angle / omega < least.delay_s {
                least = found(angle / omega, omega / (2.0 * PI));
            }
        }
        Ok(least)
    }

    /// T(s) = M s^2 + C s + K + elements + K_g k_e(s) e^(-s tau) b b^T, and dT/ds.
    fn dynamic(&self, s: Complex<f64>, delay: f64) -> (DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) {
        let [k, c, m] = self.specimen;
        let (mut stiff, mut slope) = (s * s * m + s * c + k, s * (2.0 * m) + c);
        for (k, rate) in &self.relaxing {
            stiff += s * *k / (s + *rate);
            slope += k * rate / ((s + *rate) * (s + *rate));
        }
        let back = (-s * delay).exp() * self.gain;
        let (force, force_slope) = (stiff * back, (slope - stiff * delay) * back);
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
        let outer = complex(&(&self.b * self.b.transpose()));
        let mut t = complex(&self.mass) * (s * s) + complex(&self.damping) * s + complex(&self.stiffness);
        let mut dt = complex(&self.mass) * (s * 2.0) + complex(&self.damping);
        t += &outer * force;
        dt += outer * force_slope;
        for (place, k, rate) in &self.elements {
            let outer = complex(&(place * place.transpose()));
            t += &outer * (s * *k / (s + *rate));
            dt += outer * (k * rate / ((s + *rate) * (s + *rate)));
        }
        (t, dt)
    }

    /// Newton's method on T(s) phi = 0, p^T phi = 1.
    fn follow(&self, s: &mut Complex<f64>, phi: &mut DVector<Complex<f64>>, delay: f64) -> bool {
        let n = self.b.len();
        let pin = phi.map(|v| v.conj()) / Complex::new(phi.norm_squared(), 0.0);
        for _ in 0..30 {
            let (t, dt) = self.dynamic(*s, delay);
            let size = self.stiffness.amax().max(self.specimen[0]).max(f64::MIN_POSITIVE);
            let mut bordered = DMatrix::zeros(n + 1, n + 1);
            bordered.view_mut((0, 0), (n, n)).copy_from(&(&t / Complex::new(size, 0.0)));
            // s in units of its own size keeps the border in proportion.
            let unit = s.norm();
            bordered.view_mut((0, n), (n, 1)).copy_from(&(dt * &*phi * Complex::new(unit / size, 0.0)));
            bordered.view_mut((n, 0), (1, n)).copy_from(&pin.transpose());
            let mut right = DVector::zeros(n + 1);
            right.rows_mut(0, n).copy_from(&(-(t * &*phi) / Complex::new(size, 0.0)));
            right[n] = Complex::new(1.0, 0.0) - pin.transpose().dot(&phi.transpose());
            let Some(change) = bordered.lu().solve(&right) else { return false };
            *phi += change.rows(0, n);
            *s += change[n] * unit;
            if change[n].norm() < 1e-13 {
                return true;
            }
            if !change[n].norm().is_finite() {
                return false;
            }
        }
        true
    }

    pub(crate) fn delay_damping(&self, delay_s: f64) -> Result<DelayDamping> {
        let outer = &self.b * self.b.transpose();
        let mass = &self.mass + &outer * (self.gain * self.specimen[2]);
        let stiffness = &self.stiffness + outer * (self.gain * self.specimen[0]);
        let factor = Cholesky::new(mass)
            .ok_or_else(|| configuration("structure.mass_kg", "expected a positive definite matrix"))?;
        let (omega, shapes) = modes(&factor, &stiffness);
        let mut found = DelayDamping {
            frequency_hz: Vec::new(),
            damping_ratio: Vec::new(),
            damping_ratio_without: Vec::new(),
            first_order_change: Vec::new(),
        };
        for (i, omega) in omega.iter().enumerate() {
            let mut phi = shapes.column(i).map(|v| Complex::new(v, 0.0));
            let mut s = Complex::new(0.0, *omega);
            let mut sound = *omega > 0.0 && self.follow(&mut s, &mut phi, 0.0);
            let without = -s.re / s.norm();
            for step in 1..=CONTINUATION {
                sound = sound && self.follow(&mut s, &mut phi, delay_s * step as f64 / CONTINUATION as f64);
            }
            let moved = self.b.dot(&shapes.column(i));
            let [k, _, m] = self.specimen;
            let square = omega * omega;
            let relaxed: f64 = self.relaxing.iter().map(|(k, rate)| k * square / (square + rate * rate)).sum();
            let stiffness = k - square * m + relaxed;
            found.first_order_change.push(-self.gain * stiffness * moved * moved * delay_s / (2.0 * omega));
            found.frequency_hz.push(if sound { s.im.abs() / (2.0 * PI) } else { f64::NAN });
            found.damping_ratio.push(if sound { -s.re / s.norm() } else { f64::NAN });
            found.damping_ratio_without.push(if sound { without } else { f64::NAN });
        }
        Ok(found)
    }
}

/// Every omega > 0 with |C (j omega - A)^-1 B + D| = 1.
fn crossings(open: &StateSpace) -> Option<Vec<f64>> {
    let StateSpace { a, b, c, d } = open;
    let n = b.len();
    let r = 1.0 - d * d;
    let corner = a + b * c.transpose() * (*d / r);
    let mut hamiltonian = DMatrix::zeros(2 * n, 2 * n);
    hamiltonian.view_mut((0, 0), (n, n)).copy_from(&corner);
    hamiltonian.view_mut((0, n), (n, n)).copy_from(&(b * b.transpose() / r));
    hamiltonian.view_mut((n, 0), (n, n)).copy_from(&(c * c.transpose() * (-1.0 - d * d / r)));
    hamiltonian.view_mut((n, n), (n, n)).copy_from(&-corner.transpose());
    let excess = |omega: f64| open.response(Complex::new(0.0, omega)).norm().ln();
    let mut found: Vec<f64> = Vec::new();
    for root in eigenvalues(&hamiltonian)? {
        if root.im <= 0.0 || root.re.abs() > NEAR * root.norm() {
            continue;
        }
        // Newton with a difference for slope sharpens what the eigenvalue has lost to rounding.
        let mut omega = root.im;
        for _ in 0..20 {
            let step = 1e-6 * omega;
            let slope = (excess(omega + step) - excess(omega - step)) / (2.0 * step);
            let next = omega - excess(omega) / slope;
            if !(next.is_finite() && (next - root.im).abs() < 0.01 * root.im) {
                break;
            }
            omega = next;
        }
        if excess(omega).abs() < PROVED && !found.iter().any(|w| (w - omega).abs() < 1e-9 * omega) {
            found.push(omega);
        }
    }
    Some(found)
}
