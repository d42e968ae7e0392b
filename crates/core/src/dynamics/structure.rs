//! Mass, damping and stiffness of a linear structure, and its natural frequencies.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use super::check::{Checks, LEAST, MOST, positive};
use crate::error::Mistake;

/// How far rounding may push an eigenvalue below zero, or a matrix from symmetry, relative to its largest entry.
const ROUNDING: f64 = 1e-9;

/// Damping of a whole structure.
#[derive(Debug, Clone, PartialEq)]
pub enum Damping {
    /// C, N s/m, row by row (n x n).
    Matrix(Vec<f64>),
    /// C = M Phi diag(2 zeta omega / m_n) Phi^T M with one ratio for all modes, or one a mode.
    Modal(Vec<f64>),
    /// C = a M + b K with these ratios in these two modes, numbered from 1.
    Rayleigh {
        /// Damping ratios.
        ratios: [f64; 2],
        /// The modes that have them.
        modes: [usize; 2],
    },
}

/// The whole structure, elastic, relative to the ground: M x'' + C x' + K x = -M i a_g. SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    pub(crate) mass: DMatrix<f64>,
    pub(crate) damping: DMatrix<f64>,
    pub(crate) stiffness: DMatrix<f64>,
    pub(crate) influence: DVector<f64>,
    natural_frequencies_hz: Vec<f64>,
}

impl Structure {
    /// No structure, of no degrees of freedom: its actuators follow a target that is given.
    pub fn none() -> Self {
        let empty = DMatrix::zeros(0, 0);
        Self {
            mass: empty.clone(),
            damping: empty.clone(),
            stiffness: empty,
            influence: DVector::zeros(0),
            natural_frequencies_hz: Vec::new(),
        }
    }

    /// One degree of freedom: k = m (2 pi f)^2, c = 2 zeta m (2 pi f).
    ///
    /// # Errors
    /// Every mistake: frequency, damping ratio, mass.
    pub fn sdof(frequency_hz: f64, damping_ratio: f64, mass_kg: f64) -> Result<Self, Vec<Mistake>> {
        let mut checks = Checks::default();
        positive(&mut checks, "structure.frequency_hz", frequency_hz);
        positive(&mut checks, "structure.mass_kg", mass_kg);
        checks.demand(
            "structure.damping_ratio",
            (0.0..1.0).contains(&damping_ratio),
            "a ratio from 0 to below 1",
            damping_ratio,
        );
        if !checks.mistakes.is_empty() {
            return Err(checks.mistakes);
        }
        let omega = 2.0 * PI * frequency_hz;
        let damping = Damping::Matrix(vec![2.0 * damping_ratio * mass_kg * omega]);
        Self::from_matrices(1, &[mass_kg], &[mass_kg * omega * omega], &damping, None)
    }

    /// Storeys from the ground up, each with the mass of its floor and the stiffness below it.
    ///
    /// # Errors
    /// Every mistake: counts, signs, damping.
    pub fn shear_building(masses_kg: &[f64], stiffnesses: &[f64], damping: &Damping) -> Result<Self, Vec<Mistake>> {
        let n = masses_kg.len();
        let mut checks = Checks::default();
        checks.demand("structure.storey_masses_kg", n > 0, "at least one storey", n);
        let key = "structure.storey_stiffnesses_n_per_m";
        checks.demand(key, stiffnesses.len() == n, &format!("one a storey ({n})"), stiffnesses.len());
        for (key, values) in [("structure.storey_masses_kg", masses_kg), (key, stiffnesses)] {
            values.iter().for_each(|v| positive(&mut checks, key, *v));
        }
        if !checks.mistakes.is_empty() {
            return Err(checks.mistakes);
        }
        let (mut mass, mut stiffness) = (vec![0.0; n * n], vec![0.0; n * n]);
        for i in 0..n {
            mass[i * n + i] = masses_kg[i];
            stiffness[i * n + i] += stiffnesses[i];
            if i > 0 {
                stiffness[(i - 1) * n + i - 1] += stiffnesses[i];
                stiffness[(i - 1) * n + i] -= stiffnesses[i];
                stiffness[i * n + i - 1] -= stiffnesses[i];
            }
        }
        Self::from_matrices(n, &mass, &stiffness, damping, None)
    }

    /// Any M and K (row by row, n x n), symmetric, M positive definite, K without a negative eigenvalue; `influence` of the
    /// ground motion on each degree of freedom, 1 if not given.
    ///
    /// # Errors
    /// Every mistake: sizes, symmetry, definiteness, damping.
    pub fn from_matrices(
        n: usize,
        mass: &[f64],
        stiffness: &[f64],
        damping: &Damping,
        influence: Option<&[f64]>,
    ) -> Result<Self, Vec<Mistake>> {
        let mut checks = Checks::default();
        let mut take = |key: &str, values: &[f64]| -> Option<DMatrix<f64>> {
            if n == 0 || values.len() != n * n {
                checks.mistake(key, format!("expected {n} x {n} numbers, found {}", values.len()));
                return None;
            }
            if let Some(bad) = values.iter().find(|v| **v != 0.0 && !(LEAST..=MOST).contains(&v.abs())) {
                checks.mistake(key, format!("expected numbers of 0, or 1e-30 to 1e30 in size, found {bad}"));
                return None;
            }
            let matrix = DMatrix::from_row_slice(n, n, values);
            let skew = (&matrix - matrix.transpose()).amax();
            if skew > ROUNDING * matrix.amax() {
                checks.mistake(key, format!("expected a symmetric matrix, found entries that differ by {skew}"));
                return None;
            }
            Some(matrix)
        };
        let (m, k) = (take("structure.mass_kg", mass), take("structure.stiffness_n_per_m", stiffness));
        let given =
            if let Damping::Matrix(values) = damping { take("structure.damping_n_s_per_m", values) } else { None };
        let influence = influence.map_or_else(|| vec![1.0; n], <[f64]>::to_vec);
        let sound = influence.len() == n && influence.iter().all(|v| v.abs() <= MOST);
        checks.demand("structure.influence", sound, &format!("{n} finite numbers"), format!("{influence:?}"));
        let factor = m.as_ref().and_then(|m| {
            let factor = Cholesky::new(m.clone());
            if factor.is_none() {
                let least = lowest(m);
                checks.mistake(
                    "structure.mass_kg",
                    format!("expected a positive definite matrix, found the eigenvalue {least}"),
                );
            }
            factor
        });
        if let Some(k) = &k
            && lowest(k) < -ROUNDING * k.amax()
        {
            let message = format!("expected no negative eigenvalue, found {} (indefinite stiffness)", lowest(k));
            checks.mistake("structure.stiffness_n_per_m", message);
        }
        let (Some(mass), Some(stiffness), Some(factor)) = (m, k, factor) else { return Err(checks.mistakes) };
        if !checks.mistakes.is_empty() {
            return Err(checks.mistakes);
        }
        let (omega, shapes) = modes(&factor, &stiffness);
        let damping = match damping {
            Damping::Matrix(_) => given,
            Damping::Modal(ratios) => modal(&mut checks, &mass, &omega, &shapes, ratios),
            Damping::Rayleigh { ratios, modes } => rayleigh(&mut checks, &mass, &stiffness, &omega, *ratios, *modes),
        };
        if let Some(c) = &damping
            && lowest(c) < -ROUNDING * c.amax()
        {
            let message =
                format!("expected no negative eigenvalue, found {} (damping that feeds energy in)", lowest(c));
            checks.mistake("structure.damping_n_s_per_m", message);
        }
        match damping {
            Some(damping) if checks.mistakes.is_empty() => Ok(Self {
                mass,
                damping,
                stiffness,
                influence: DVector::from_vec(influence),
                natural_frequencies_hz: omega.iter().map(|w| w / (2.0 * PI)).collect(),
            }),
            _ => Err(checks.mistakes),
        }
    }

    /// Number of degrees of freedom.
    pub fn n_dof(&self) -> usize {
        self.mass.nrows()
    }

    /// Undamped natural frequencies, rising.
    pub fn natural_frequencies_hz(&self) -> &[f64] {
        &self.natural_frequencies_hz
    }

    /// M, C and K, row by row.
    pub fn matrices(&self) -> [Vec<f64>; 3] {
        [&self.mass, &self.damping, &self.stiffness].map(rows)
    }

    /// The part that the ground motion plays at each degree of freedom.
    pub fn influence(&self) -> &[f64] {
        self.influence.as_slice()
    }

    /// All the stiffness between two degrees of freedom (numbered from 1; 0 is the ground): -K_ij, or the sum of row i.
    pub fn stiffness_between(&self, dof: usize, from_dof: usize) -> f64 {
        let (one, other) = (dof.max(from_dof), dof.min(from_dof));
        if other == 0 { self.stiffness.row(one - 1).sum() } else { -self.stiffness[(one - 1, other - 1)] }
    }
}

/// Row by row; nalgebra keeps columns.
pub(crate) fn rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// out = matrix * x, row by row.
#[inline]
pub(crate) fn multiply(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    let n = x.len();
    for (row, out) in matrix.chunks_exact(n).zip(out.iter_mut()) {
        *out = row.iter().zip(x).map(|(a, b)| a * b).sum();
    }
}

/// x_dof - x_from of a vector over the degrees of freedom, numbered from 1; 0 is the ground.
#[inline]
pub(crate) fn across(dof: usize, from_dof: usize, x: &[f64]) -> f64 {
    x[dof - 1] - if from_dof == 0 { 0.0 } else { x[from_dof - 1] }
}

/// A force between two degrees of freedom added to a vector over all of them.
#[inline]
pub(crate) fn across_add(x: &mut [f64], dof: usize, from_dof: usize, value: f64) {
    x[dof - 1] += value;
    if from_dof > 0 {
        x[from_dof - 1] -= value;
    }
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

/// The lowest eigenvalue of a symmetric matrix.
pub(crate) fn lowest(matrix: &DMatrix<f64>) -> f64 {
    matrix.clone().symmetric_eigenvalues().min()
}

/// Undamped circular frequencies, rising, and shapes with unit modal mass, column by column.
pub(crate) fn modes(factor: &Cholesky<f64, nalgebra::Dyn>, stiffness: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let inverse = factor.l().try_inverse().expect("a Cholesky factor has a positive diagonal");
    let eigen = SymmetricEigen::new(&inverse * stiffness * inverse.transpose());
    let mut order: Vec<usize> = (0..stiffness.nrows()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let omega = order.iter().map(|i| eigen.eigenvalues[*i].max(0.0).sqrt()).collect();
    (omega, inverse.transpose() * eigen.eigenvectors.select_columns(&order))
}

fn modal(
    checks: &mut Checks,
    mass: &DMatrix<f64>,
    omega: &[f64],
    shapes: &DMatrix<f64>,
    ratios: &[f64],
) -> Option<DMatrix<f64>> {
    let n = omega.len();
    let key = if ratios.len() == 1 { "structure.damping_ratio" } else { "structure.damping_ratios" };
    let known = checks.mistakes.len();
    checks.demand(
        key,
        ratios.len() == 1 || ratios.len() == n,
        &format!("one ratio, or one a mode ({n})"),
        ratios.len(),
    );
    for ratio in ratios {
        checks.demand(key, (0.0..1.0).contains(ratio), "a ratio from 0 to below 1", ratio);
    }
    if checks.mistakes.len() > known {
        return None;
    }
    let of_mode = |i: usize| 2.0 * ratios[if ratios.len() == 1 { 0 } else { i }] * omega[i];
    let image = mass * shapes;
    Some(&image * DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| of_mode(i))) * image.transpose())
}

fn rayleigh(
    checks: &mut Checks,
    mass: &DMatrix<f64>,
    stiffness: &DMatrix<f64>,
    omega: &[f64],
    ratios: [f64; 2],
    modes: [usize; 2],
) -> Option<DMatrix<f64>> {
    let n = omega.len();
    let key = "structure.rayleigh";
    for ratio in ratios {
        checks.demand(key, (0.0..1.0).contains(&ratio), "damping ratios from 0 to below 1", ratio);
    }
    let sound = modes[0] != modes[1] && modes.iter().all(|m| (1..=n).contains(m));
    checks.demand(key, sound, &format!("two different modes from 1 to {n}"), format!("{modes:?}"));
    if !sound {
        return None;
    }
    let [one, two] = modes.map(|m| omega[m - 1]);
    let spread = two * two - one * one;
    if spread == 0.0 || one == 0.0 || two == 0.0 {
        checks.mistake(
            key,
            format!("expected two modes of different frequencies above zero, found {one} and {two} rad/s"),
        );
        return None;
    }
    // zeta = a / (2 omega) + b omega / 2 at both.
    let b = 2.0 * (ratios[1] * two - ratios[0] * one) / spread;
    let a = 2.0 * ratios[0] * one - b * one * one;
    Some(a * mass + b * stiffness)
}
