//! P and Q chosen by the program: the largest factors that change amplitude and delay by no more than a tolerance.
//!
//! The bins that P and Q keep are among those of P = Q = 1: every Q-th, up to p / P. So one transform holds the sums of
//! Eq 12 of every pair (P, Q), and the change of A and d at each of them is known, not estimated. It costs one evaluation
//! at P = Q = 1 and the sorting of its bins.
//!
//! # The rule
//! The amplitude's change is |A / A_1 - 1|. The delay's is |d / d_1 - 1|; where |phi_1| < [`NEAR_ZERO_RAD`] a delay has no
//! percentage worth the name, and it is |phi - phi_1|, in radians. Subscript 1 is P = Q = 1 (or the factor that is given,
//! with the other at 1). A pair (P, Q) qualifies when both changes are at most the tolerance there and at every pair of
//! smaller ones. Chosen is the one of largest P Q; among equals that of the larger Q, which saves more.
//!
//! # What is allowed for
//! An evaluation at P and Q folds and filters, so its bins differ from those of the one transform by errors e, whose norm over
//! all bins is known as a share of the whole spectrum's ([`error_share`]). By Minkowski's and Hoelder's inequalities, with
//! |x|_l = (sum |x_k|^l)^(1/l) over the bins that are kept, and |e|_l at most |e|_2 for l >= 2, sqrt(bins) |e|_2 for l = 1,
//!
//! ```text
//! sum |I|^l                  changes to within  (|I|_l -+ |e_I|_l)^l
//! sum O conj(I) |I|^(l-2)    by at most         |e_O|_l u^(l-1) + (l - 1) |O|_l |e_I|_l u^(l-2),   u = |I|_l + |e_I|_l
//! ```
//!
//! and for l = 1, where the latter is a sum of O over unit vectors, by |e_O|_1 + sum |O| min(2, 2 |e_I| / |I|): a bin that holds
//! nothing but errors has any direction. These are intervals of FEI and f_eq, for both evaluations; the stated change is the
//! largest between them. Where a phase's interval reaches half a turn the delay may have either sign, and no bound.

use std::f64::consts::PI;

use num_complex::Complex;
use rustfft::FftPlanner;

use crate::decimate::Decimator;
use crate::error::{Error, Result};
use crate::evaluator::{Evaluator, EvaluatorState};
use crate::pair::Pair;
use crate::settings::EvaluatorConfig;
use crate::spectrum::{Bins, Sink};
use crate::sums;
use crate::tracking::Tracking;
use crate::weigh::{Sums, Term, weight};

/// Below this phase (0.06 degrees, 0.16 ms at 1 Hz) the tolerance is on the phase, in radians.
pub const NEAR_ZERO_RAD: f64 = 1e-3;

/// Share of a bin that the cascade lets alias onto a kept one: [`crate::decimate::ALIAS_DB`] at the halving that folds it there,
/// and the droop of the halvings before, which is made good.
const ALIAS: f64 = 1.25e-10;
/// Rounding of a transform, or of the cascade, in units of eps log2 n.
const ROUNDINGS: f64 = 8.0;
/// With l = 1, bins below this share of the target's spectrum are taken to have any direction.
const ANY_DIRECTION: f64 = 1e-9;

/// The user's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorsConfig {
    /// Largest change of amplitude and of delay, relative (of the phase, in radians, where the delay is near zero).
    pub tolerance: f64,
    /// P where it is given, `None` where it is chosen.
    pub data_decimation: Option<usize>,
    /// Q where it is given, `None` where it is chosen.
    pub frequency_decimation: Option<usize>,
}

impl Default for FactorsConfig {
    fn default() -> Self {
        Self { tolerance: 0.005, data_decimation: None, frequency_decimation: None }
    }
}

/// What a change of the delay is measured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DelayMeasure {
    /// |d / d_1 - 1|
    Relative,
    /// |phi - phi_1|, in radians: the delay is near zero.
    Phase,
}

/// What one pair of factors changes, the allowance for round-off and cascade included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorChange {
    /// P.
    pub data_decimation: usize,
    /// Q.
    pub frequency_decimation: usize,
    /// Bins that are left.
    pub n_bins: usize,
    /// Of A, relative; infinite where the bins that are left hold nothing to judge by.
    pub amplitude: f64,
    /// Of d, as [`DelayMeasure`] says.
    pub delay: f64,
}

/// The choice, with everything it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Factors {
    /// P.
    pub data_decimation: usize,
    /// Q.
    pub frequency_decimation: usize,
    /// Bound on the change of A, relative.
    pub amplitude_bound: f64,
    /// Bound on the change of d, as `measure` says.
    pub delay_bound: f64,
    /// What `delay_bound` and the table's changes of the delay are.
    pub measure: DelayMeasure,
    /// P and Q from which changes are counted: 1, or what was given.
    pub reference: (usize, usize),
    /// The evaluation there.
    pub tracking: Tracking,
    /// Every pair that was considered, P by P.
    pub table: Vec<FactorChange>,
}

/// Chooses P and Q for `pair` with a plan whose own P and Q are 1: one evaluation, and the sums of Eq 12 at every pair of
/// powers of two from its bins.
///
/// The bounds hold for [`Evaluator::evaluate`] of the same pair at these factors and otherwise the same settings, not for
/// other records nor for parts of this one.
///
/// # Errors
/// [`Error::Setting`] for a tolerance outside (0, 1) or a plan with factors of its own, [`Error::FactorsNeedSpectral`],
/// [`Error::NotPowerOfTwo`] and [`Error::NoBin`] for a given factor; those of [`Evaluator::evaluate`].
pub fn choose_factors(
    evaluator: &Evaluator,
    state: &mut EvaluatorState,
    pair: &Pair<'_>,
    config: &FactorsConfig,
) -> Result<Factors> {
    let tolerance = config.tolerance;
    if !(tolerance > 0.0 && tolerance < 1.0) {
        let expected = "a number between 0 and 1, both excluded".to_owned();
        return Err(Error::Setting { name: "tolerance", expected, found: tolerance });
    }
    let settings = *evaluator.config();
    check_plan(&settings)?;
    let at = |p: usize, q: usize| EvaluatorConfig { data_decimation: p, frequency_decimation: q, ..settings };
    let reference = (config.data_decimation.unwrap_or(1), config.frequency_decimation.unwrap_or(1));
    let base = (reference.0.trailing_zeros() as usize, reference.1.trailing_zeros() as usize);
    if reference != (1, 1) {
        // What is wrong with a given factor is said as for any evaluation.
        Evaluator::new(pair.n_samples(), pair.rate_hz(), at(reference.0, reference.1))?;
    }
    evaluator.transform(state, pair)?;
    let levels = Levels::sum(evaluator, state);
    let round_off = evaluator.round_off(pair);
    let tracking = evaluator.finish(levels.at(base.0, base.1).sums, pair)?;
    let measure = if tracking.phase_rad.abs() < NEAR_ZERO_RAD { DelayMeasure::Phase } else { DelayMeasure::Relative };
    let from = levels.around(base.0, base.1, &tracking);
    let change = |i: usize, j: usize| -> FactorChange {
        let sums = &levels.at(i, j).sums;
        let found = sums.tracking(evaluator.delta_f_hz(), round_off).filter(|found| sums.measured_fits(found));
        let (amplitude, delay) = match found {
            _ if (i, j) == base => (0.0, 0.0),
            Some(found) => largest_changes(&from, &levels.around(i, j, &found), measure),
            None => (f64::INFINITY, f64::INFINITY),
        };
        let n_bins = levels.n_bins(i, j);
        FactorChange { data_decimation: 1 << i, frequency_decimation: 1 << j, n_bins, amplitude, delay }
    };
    let range = |given: Option<usize>, from: usize| from..if given.is_some() { from + 1 } else { levels.count };
    let mut table = Vec::new();
    let (mut chosen, mut most_q) = (change(base.0, base.1), usize::MAX);
    for i in range(config.data_decimation, base.0) {
        // Every smaller pair must qualify: a row ends where it fails, and none below it goes further.
        let mut qualifies = true;
        for (n, j) in range(config.frequency_decimation, base.1).enumerate() {
            let found = change(i, j);
            if found.n_bins == 0 {
                break;
            }
            table.push(found);
            qualifies &= n < most_q && found.amplitude <= tolerance && found.delay <= tolerance;
            if !qualifies {
                most_q = most_q.min(n);
                continue;
            }
            let size = |c: &FactorChange| (c.data_decimation * c.frequency_decimation, c.frequency_decimation);
            if size(&found) > size(&chosen) {
                chosen = found;
            }
        }
    }
    Ok(Factors {
        data_decimation: chosen.data_decimation,
        frequency_decimation: chosen.frequency_decimation,
        amplitude_bound: chosen.amplitude,
        delay_bound: chosen.delay,
        measure,
        reference,
        tracking,
        table,
    })
}

/// Between which values an evaluation gives its numbers.
struct Around {
    amplitude: [f64; 2],
    /// Outside of (-pi, pi) where a phase may jump by a turn.
    phase: [f64; 2],
    /// f_eq
    frequency: [f64; 2],
}

/// The largest changes of A and d between two evaluations; infinite where there is no largest.
fn largest_changes(from: &Around, to: &Around, measure: DelayMeasure) -> (f64, f64) {
    let farthest = |[low, high]: [f64; 2]| {
        // Where measured is zero throughout there is nothing to compare.
        if low.is_nan() || high.is_nan() { f64::INFINITY } else { (high - 1.0).max(1.0 - low) }
    };
    let amplitude = farthest(ratios(to.amplitude, from.amplitude));
    let one_turn = |[low, high]: [f64; 2]| -PI < low && high < PI;
    if !(one_turn(from.phase) && one_turn(to.phase)) {
        return (amplitude, f64::INFINITY);
    }
    let delay = match measure {
        DelayMeasure::Phase => (to.phase[1] - from.phase[0]).max(from.phase[1] - to.phase[0]),
        DelayMeasure::Relative => {
            let lag = from.phase[0] + from.phase[1] < 0.0;
            let [to_phase, from_phase] =
                [to.phase, from.phase].map(|[low, high]| if lag { [-high, -low] } else { [low, high] });
            let [low, high] = ratios(to_phase, from_phase);
            let slower = ratios(from.frequency, to.frequency);
            let times = |ratio: f64, ends: [f64; 2]| ratio * ends[usize::from(ratio > 0.0)];
            farthest([times(low, [slower[1], slower[0]]), times(high, slower)])
        }
    };
    (amplitude, delay)
}

/// Least and largest of x / y, x and y within their intervals; without end where y may be zero.
fn ratios(x: [f64; 2], y: [f64; 2]) -> [f64; 2] {
    if y[0] <= 0.0 {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    [x[0] / y[usize::from(x[0] > 0.0)], x[1] / y[usize::from(x[1] <= 0.0)]]
}

fn check_plan(settings: &EvaluatorConfig) -> Result<()> {
    settings.estimator.must_be_published("P and Q that are given, not chosen")?;
    if settings.decimator != Decimator::Spectral {
        return Err(Error::FactorsNeedSpectral);
    }
    for (name, found) in
        [("data_decimation", settings.data_decimation), ("frequency_decimation", settings.frequency_decimation)]
    {
        if found != 1 {
            let expected = "1 in the plan that factors are chosen with".to_owned();
            return Err(Error::Setting { name, expected, found: found as f64 });
        }
    }
    Ok(())
}

/// What the bins of one P and Q add up to.
#[derive(Debug, Clone, Copy, Default)]
struct Level {
    /// Eqs 7 and 12.
    sums: Sums,
    /// sum |O|^l, O over its spectrum's norm; for l = 1 sum (|O| / |I|)^2 over the bins that have a direction.
    measured: f64,
    /// For l = 1, sum |O| over the other bins.
    astray: f64,
}

impl Level {
    fn add(&mut self, other: &Level) {
        self.sums.add(&other.sums);
        self.measured += other.measured;
        self.astray += other.astray;
    }
}

/// The sums of every P = 2^i and Q = 2^j.
struct Levels {
    /// log2 p + 1, the number of powers of two up to p.
    count: usize,
    /// First and last bin kept at P = Q = 1.
    first: usize,
    last: usize,
    weight_power: u32,
    /// Norms of the spectra of target and measured, zero frequency and what the band drops included.
    norms: [f64; 2],
    levels: Vec<Level>,
}

impl Levels {
    fn sum(evaluator: &Evaluator, state: &EvaluatorState) -> Self {
        let spectrum = evaluator.spectrum();
        let count = spectrum.fft_len().trailing_zeros() as usize;
        let (first, last) = (spectrum.first(), spectrum.first() + spectrum.n_bins() - 1);
        let weight_power = evaluator.config().weight_power;
        // The packed transform has half of the energy of all n bins, as have the bins up to n / 2.
        let norms = state.spectrum.pair().map(|bins| sums::energy(bytemuck::cast_slice(bins)).sqrt());
        let per_norm = norms.map(|norm| 1.0 / norm);
        let levels = vec![Level::default(); count * count];
        let levels = if weight_power == 2 {
            let mut sort = Sort::<2> { weight_power, count, per_norm, levels };
            spectrum.visit(&state.spectrum, &mut sort);
            sort.levels
        } else {
            let mut sort = Sort::<0> { weight_power, count, per_norm, levels };
            spectrum.visit(&state.spectrum, &mut sort);
            sort.levels
        };
        let mut levels = Self { count, first, last, weight_power, norms, levels };
        levels.accumulate();
        levels
    }

    /// From the bins that (i, j) keeps and no larger pair does to all that it keeps.
    fn accumulate(&mut self) {
        let count = self.count;
        for i in 0..count {
            for j in (0..count - 1).rev() {
                let next = self.levels[i * count + j + 1];
                self.levels[i * count + j].add(&next);
            }
        }
        for i in (0..count - 1).rev() {
            for j in 0..count {
                let next = self.levels[(i + 1) * count + j];
                self.levels[i * count + j].add(&next);
            }
        }
    }

    fn at(&self, i: usize, j: usize) -> &Level {
        &self.levels[i * self.count + j]
    }

    /// The highest bin that (i, j) may keep.
    fn up_to(&self, i: usize) -> usize {
        self.last.min((1 << (self.count - 1)) >> i)
    }

    /// Multiples of 2^j in first ..= min(last, p / 2^i).
    fn n_bins(&self, i: usize, j: usize) -> usize {
        (self.up_to(i) >> j).saturating_sub((self.first - 1) >> j)
    }

    /// `found` at (i, j), with what is allowed for.
    fn around(&self, i: usize, j: usize, found: &Tracking) -> Around {
        let Level { sums, measured, astray } = *self.at(i, j);
        let [target_norm, measured_norm] = self.norms;
        let (l, n_bins) = (f64::from(self.weight_power), self.n_bins(i, j) as f64);
        let share = error_share(self.count, i, j);
        let spread = if self.weight_power == 1 { n_bins.sqrt() } else { 1.0 };
        // All in units of |I|_l.
        let size = sums.power.powf(1.0 / l);
        let (target_error, measured_error) =
            (spread * share * target_norm / size, spread * share * measured_norm / size);
        let adding = n_bins * f64::EPSILON;
        let (measured_size, turned) = if self.weight_power == 1 {
            let over_target = measured_norm / target_norm * measured.sqrt();
            (spread * measured_norm / size, 2.0 * (share * target_norm * over_target + astray * measured_norm) / size)
        } else {
            let measured_size = measured_norm * measured.powf(1.0 / l) / size;
            (measured_size, (l - 1.0) * measured_size * target_error * (1.0 + target_error).powf(l - 2.0))
        };
        let cross = measured_error * (1.0 + target_error).powf(l - 1.0) + turned + adding * measured_size;
        // Of a sum of positive terms: the errors in units of its own l-th root.
        let within = |error: f64| [(1.0 - error).max(0.0).powf(l) - adding, (1.0 + error).powf(l) + adding];
        let power = within(target_error);
        let highest = self.up_to(i) as f64;
        let moment = within(target_error * (highest * sums.power / sums.moment).powf(1.0 / l));
        let Tracking { amplitude, phase_rad, equivalent_frequency_hz, .. } = *found;
        let turn = if cross < amplitude { (cross / amplitude).asin() } else { PI } + f64::EPSILON * PI;
        let [low, high] = ratios(moment, power);
        Around {
            amplitude: ratios([amplitude - cross, amplitude + cross], power),
            phase: [phase_rad - turn, phase_rad + turn],
            frequency: [low * equivalent_frequency_hz, high * equivalent_frequency_hz],
        }
    }
}

/// Norm of the errors of the bins at P = 2^i and Q = 2^j, as a share of the whole spectrum's norm, for n = 2^count: rounding
/// of the transform and the cascade, of Q - 1 additions of blocks, and what aliases, up to P / 2 bins onto each.
fn error_share(count: usize, i: usize, j: usize) -> f64 {
    let cascade = if i > 1 { ALIAS * ((1u64 << (i - 1)) as f64).sqrt() } else { 0.0 };
    f64::EPSILON * (ROUNDINGS * (1 + count) as f64 + (1u64 << j) as f64) + cascade
}

/// Adds each bin to the sums of the largest P and the largest Q that keep it.
struct Sort<const L: u32> {
    weight_power: u32,
    count: usize,
    /// One over the norms of the spectra.
    per_norm: [f64; 2],
    levels: Vec<Level>,
}

impl<const L: u32> Sink for Sort<L> {
    #[inline(always)]
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        let [per_target, per_measured] = self.per_norm;
        for n in 0..W {
            let k = bins.first + n;
            let (or, oi) = (bins.measured_re[n], bins.measured_im[n]);
            let term = Term::new::<L>(self.weight_power, (bins.target_re[n], bins.target_im[n]), (or, oi));
            // k <= p / 2^i up to i = log2 p - ceil(log2 k); 2^j divides k up to its trailing zeros.
            let i = self.count - 1 - (usize::BITS - (k - 1).leading_zeros()) as usize;
            let j = k.trailing_zeros() as usize;
            let level = &mut self.levels[i * self.count + j];
            level.sums.add_term(&term, k);
            let (or, oi) = (or * per_measured, oi * per_measured);
            let squared = or * or + oi * oi;
            if L == 2 {
                level.measured += squared;
            } else if self.weight_power > 1 {
                level.measured += weight(squared, self.weight_power);
            } else {
                let direction = term.squared * (per_target * per_target);
                if direction < ANY_DIRECTION * ANY_DIRECTION {
                    level.astray += squared.sqrt();
                } else {
                    level.measured += squared / direction;
                }
            }
        }
    }
}

/// What could be said of each factor alone before its bins are known: safe, but shy.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorBounds {
    /// Of P = 1, 2, 4, ... with Q = 1, from the energy of target and measured above rate / (2 P).
    pub data: Vec<FactorChange>,
    /// Of Q = 1, 2, 4, ... with P = 1, from the magnitude of the correlations at the lags T_pad m / Q, m = 1 .. Q - 1.
    pub frequency: Vec<FactorChange>,
    /// What the changes of the delay are.
    pub measure: DelayMeasure,
}

/// Bounds on the changes of A and d from energies and correlations alone, to set beside [`choose_factors`].
///
/// With C = sum O conj(I) |I|^(l-2), S = sum |I|^l and M = sum f |I|^l, each of which P or Q changes by no more than a share
/// c, s or m of itself, FEI = C / S changes by (c + s) / (1 - s) and f_eq = M / S by (m + s) / (1 - s). P drops from C at
/// most sqrt(sum |I|^l sum |O|^2 |I|^(l-2)) over the bins above rate / (2 P) (Cauchy-Schwarz); Q adds to each sum its
/// correlation at the lags T_pad m / Q.
///
/// # Errors
/// [`Error::Setting`] and [`Error::FactorsNeedSpectral`] as in [`choose_factors`]; those of [`Evaluator::evaluate`].
pub fn prior_bounds(evaluator: &Evaluator, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<PriorBounds> {
    let settings = *evaluator.config();
    check_plan(&settings)?;
    let (tracking, spectra) = evaluator.evaluate_with_spectra(state, pair)?;
    let measure = if tracking.phase_rad.abs() < NEAR_ZERO_RAD { DelayMeasure::Phase } else { DelayMeasure::Relative };
    let n = evaluator.spectrum().fft_len();
    let first = evaluator.spectrum().first();
    let (mut cross, mut power, mut moment) =
        (vec![Complex::default(); n], vec![Complex::default(); n], vec![Complex::default(); n]);
    let mut response = vec![0.0; n / 2 + 1];
    for (b, (o, i)) in spectra.measured.iter().zip(&spectra.target).enumerate() {
        let k = first + b;
        let term = Term::new::<0>(settings.weight_power, (i.re, i.im), (o.re, o.im));
        cross[k] = Complex::new(term.re, term.im);
        power[k] = Complex::new(term.power, 0.0);
        moment[k] = Complex::new(k as f64 * term.power, 0.0);
        response[k] = if term.squared > 0.0 { o.norm_sqr() * term.power / term.squared } else { 0.0 };
    }
    let above = |p: usize, of: &dyn Fn(usize) -> f64| (n / 2 / p + 1..=n / 2).map(of).sum::<f64>();
    let total = (above(n, &|k| power[k].re), above(n, &|k| moment[k].re));
    let size = cross.iter().sum::<Complex<f64>>().norm();
    let count = n.trailing_zeros() as usize;
    let entry = |p: usize, q: usize, (c, s, m): (f64, f64, f64)| {
        let (amplitude, delay) = worst(&tracking, measure, c, s, m);
        let n_bins = (n / 2 / p).min(first + spectra.target.len() - 1) / q - (first - 1) / q;
        FactorChange { data_decimation: p, frequency_decimation: q, n_bins, amplitude, delay }
    };
    let data = (0..count)
        .map(|i| {
            let (target, measured) = (above(1 << i, &|k| power[k].re), above(1 << i, &|k| response[k]));
            let highest = (n / 2) as f64 * target;
            entry(1 << i, 1, ((target * measured).sqrt() / size, target / total.0, highest.min(total.1) / total.1))
        })
        .collect();
    let inverse = FftPlanner::new().plan_fft_inverse(n);
    for sequence in [&mut cross, &mut power, &mut moment] {
        inverse.process(sequence);
    }
    let frequency = (0..count)
        .map(|j| {
            let share = |z: &[Complex<f64>]| (1..1 << j).map(|m| z[m * (n >> j)].norm()).sum::<f64>() / z[0].norm();
            entry(1, 1 << j, (share(&cross), share(&power), share(&moment)))
        })
        .collect();
    Ok(PriorBounds { data, frequency, measure })
}

/// Largest changes of A and d where the sums C, S and M change by shares of themselves.
fn worst(tracking: &Tracking, measure: DelayMeasure, c: f64, s: f64, m: f64) -> (f64, f64) {
    if s >= 1.0 {
        return (f64::INFINITY, f64::INFINITY);
    }
    let (fei, frequency) = ((c + s) / (1.0 - s), (m + s) / (1.0 - s));
    let phase = if fei < 1.0 { fei.asin() } else { PI };
    let delay = match measure {
        DelayMeasure::Phase => phase,
        DelayMeasure::Relative if frequency < 1.0 => (1.0 + phase / tracking.phase_rad.abs()) / (1.0 - frequency) - 1.0,
        DelayMeasure::Relative => f64::INFINITY,
    };
    (fei, delay)
}
