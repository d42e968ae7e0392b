//! Key frequencies: the fewest bins that together hold a share of the weight, evaluated alone.
//!
//! They are chosen from a target once, by its full transform; after that only they are computed, of this target or of other
//! windows of the same length. What lies above the highest of them is taken away first: the samples pass through the cascade
//! of [`crate::decimate`] with the largest P that keeps that bin, exactly as P does. Each bin is then a sum over the m samples
//! that are left. Beyond some 2 log2 m bins a transform of these m samples costs less than the sums: there it is done, and
//! the other bins are dropped.
//!
//! # The sums
//! Eight bins at a time. With B = 64 samples a block and w = exp(-2 pi j k / m) for m samples,
//!
//! ```text
//! X_k = sum_b w^(b B) s_b,   s_b = sum_(i < B) x_(b B + i) w^i
//! ```
//!
//! The w^i are a table, so nothing is carried from sample to sample; blocks are joined by Horner's rule, X <- X w^B + s_b,
//! from the last to the first. Rounding grows with the number of blocks only: a Goertzel recurrence would lose digits as
//! (m / k)^2 at the low bins that matter here.

use std::f64::consts::PI;

use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};

use crate::decimate::Decimator;
use crate::error::{Error, Result};
use crate::evaluator::{Evaluator, EvaluatorState};
use crate::pair::Pair;
use crate::settings::EvaluatorConfig;
use crate::tracking::Tracking;
use crate::weigh::{Sums, Term};

/// Bins that are summed side by side.
const GROUP: usize = 8;
/// Samples a block.
const BLOCK: usize = 64;
/// Bins over log2 m at which the transform of m samples costs as much as the sums (measured: 1.6 to 2.0).
const BINS_PER_OCTAVE: usize = 2;

/// The user's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyFrequenciesConfig {
    /// Share of the weight that the bins must hold, above 0 and at most 1.
    pub share: f64,
    /// How the pair is evaluated; the bins are chosen among those that P, Q and the band keep.
    pub evaluator: EvaluatorConfig,
}

impl Default for KeyFrequenciesConfig {
    fn default() -> Self {
        Self { share: 0.999, evaluator: EvaluatorConfig::published() }
    }
}

/// The choice, and the plan to evaluate pairs of one length at it.
pub struct KeyFrequencies {
    config: KeyFrequenciesConfig,
    share_held: f64,
    /// Indices of the bins in units of the spacing, ascending.
    bins: Vec<usize>,
    /// What makes good the droop of the cascade at each of them.
    corrections: Vec<f64>,
    evaluator: Evaluator,
    /// The sums; `None` where `evaluator` transforms and drops the other bins.
    direct: Option<Direct>,
    arch: Arch,
}

/// Buffers of an evaluation. Make one a thread.
#[derive(Debug, Clone)]
pub struct KeyFrequenciesState(EvaluatorState);

impl KeyFrequencies {
    /// Chooses the bins of `target`, a whole record or a first window: the heaviest, until they hold the share.
    ///
    /// # Errors
    /// [`Error::Setting`] for a share outside (0, 1], [`Error::KeyFrequenciesNeedSpectral`]; those of [`Evaluator::new`]
    /// and [`Evaluator::evaluate`].
    pub fn new(target: &[f64], rate_hz: f64, config: KeyFrequenciesConfig) -> Result<Self> {
        let KeyFrequenciesConfig { share, evaluator: settings } = config;
        if !(share > 0.0 && share <= 1.0) {
            return Err(Error::Setting { name: "share", expected: "above 0 and at most 1".to_owned(), found: share });
        }
        settings.estimator.must_be_published("all frequencies, not key frequencies")?;
        if settings.decimator != Decimator::Spectral {
            return Err(Error::KeyFrequenciesNeedSpectral);
        }
        let whole = Evaluator::new(target.len(), rate_hz, settings)?;
        let (_, spectra) = whole.evaluate_with_spectra(&mut whole.state(), &Pair::new(target, target, rate_hz)?)?;
        let weights = &spectra.weights;
        let mut order: Vec<usize> = (0..weights.len()).collect();
        order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
        let total: f64 = order.iter().map(|&b| weights[b]).sum();
        let mut held = 0.0;
        let count = order
            .iter()
            .position(|&b| {
                held += weights[b];
                held >= share * total
            })
            .map_or(order.len(), |last| last + 1);
        let first = whole.spectrum().first();
        let mut bins: Vec<usize> = order[..count].iter().map(|b| first + b).collect();
        bins.sort_unstable();

        let highest = bins[bins.len() - 1] * settings.frequency_decimation;
        let most = (whole.spectrum().fft_len() / 2 / highest.next_power_of_two()).max(settings.data_decimation);
        let mut evaluator =
            Evaluator::new(target.len(), rate_hz, EvaluatorConfig { data_decimation: most, ..settings })?;
        let corrections = evaluator.keep_only(&bins);
        let (period, filled) = evaluator.spectrum().sequence_len();
        let few = bins.len() <= BINS_PER_OCTAVE * period.ilog2() as usize;
        let direct = few.then(|| Direct::new(&bins, period, filled));
        Ok(Self { config, share_held: held / total, bins, corrections, evaluator, direct, arch: Arch::new() })
    }

    /// The settings.
    pub fn config(&self) -> &KeyFrequenciesConfig {
        &self.config
    }

    /// Length of the records or windows this is planned for.
    pub fn n_samples(&self) -> usize {
        self.evaluator.n_samples()
    }

    /// Their rate.
    pub fn rate_hz(&self) -> f64 {
        self.evaluator.rate_hz()
    }

    /// Share of the weight that the bins hold in the target they were chosen from.
    pub fn share_held(&self) -> f64 {
        self.share_held
    }

    /// Spacing of the bins they were chosen among, in hertz.
    pub fn delta_f_hz(&self) -> f64 {
        self.evaluator.delta_f_hz()
    }

    /// The frequencies, ascending, in hertz.
    pub fn frequency_hz(&self) -> Vec<f64> {
        self.bins.iter().map(|&b| b as f64 * self.delta_f_hz()).collect()
    }

    /// Whether each bin is summed by itself: they are few enough for that to be the cheaper way.
    pub fn is_direct(&self) -> bool {
        self.direct.is_some()
    }

    /// Buffers for [`KeyFrequencies::evaluate`].
    pub fn state(&self) -> KeyFrequenciesState {
        KeyFrequenciesState(self.evaluator.state())
    }

    /// Evaluates one pair (Eqs 1 to 12) over these bins alone. Allocates nothing.
    ///
    /// # Errors
    /// Those of [`Evaluator::evaluate`].
    pub fn evaluate(&self, state: &mut KeyFrequenciesState, pair: &Pair<'_>) -> Result<Tracking> {
        let Some(direct) = &self.direct else { return self.evaluator.evaluate(&mut state.0, pair) };
        self.evaluator.check(pair)?;
        let spectrum = self.evaluator.spectrum();
        let state = &mut state.0.spectrum;
        spectrum.shorten_both(state, pair.target(), pair.measured());
        let signals = [bytemuck::cast_slice(&state.target), bytemuck::cast_slice(&state.measured)];
        let power = self.config.evaluator.weight_power;
        let mut sums = Sums::default();
        for (g, bins) in self.bins.chunks(GROUP).enumerate() {
            let group = self.arch.dispatch(SumGroup { direct, group: g, signals });
            for (n, &k) in bins.iter().enumerate() {
                let factor = self.corrections[g * GROUP + n];
                let [ir, ii, or, oi] = [0, 1, 2, 3].map(|part| group[part][n] * factor);
                sums.add_term(&Term::new::<0>(power, (ir, ii), (or, oi)), k);
            }
        }
        self.evaluator.finish(sums, pair)
    }
}

/// Single bins of a real sequence that repeats after `period` samples.
struct Direct {
    block: usize,
    /// Blocks that may hold anything but zeros.
    n_blocks: usize,
    /// w^i of each group: for i = 0 .. block, GROUP real and GROUP imaginary parts.
    twiddles: Vec<f64>,
    /// w^block of each group.
    turns: Vec<[[f64; GROUP]; 2]>,
}

impl Direct {
    fn new(bins: &[usize], period: usize, filled: usize) -> Self {
        let block = BLOCK.min(period);
        // The angle is reduced before it is rounded.
        let twiddle =
            |k: usize, i: usize| Complex::from_polar(1.0, -2.0 * PI * ((k * i) % period) as f64 / period as f64);
        let mut twiddles = Vec::with_capacity(bins.len().div_ceil(GROUP) * block * 2 * GROUP);
        let mut turns = Vec::with_capacity(bins.len().div_ceil(GROUP));
        for group in bins.chunks(GROUP) {
            let at = |i: usize| -> [[f64; GROUP]; 2] {
                let values: [Complex<f64>; GROUP] =
                    std::array::from_fn(|n| group.get(n).map_or(Complex::default(), |&k| twiddle(k, i)));
                [values.map(|v| v.re), values.map(|v| v.im)]
            };
            for i in 0..block {
                twiddles.extend(at(i).as_flattened());
            }
            turns.push(at(block));
        }
        Self { block, n_blocks: filled.div_ceil(block), twiddles, turns }
    }

    /// Real and imaginary parts of target and measured at one group of bins.
    #[inline(always)]
    fn sum<S: Simd>(&self, simd: S, group: usize, [target, measured]: [&[f64]; 2]) -> [[f64; GROUP]; 4] {
        let table = &self.twiddles[group * self.block * 2 * GROUP..][..self.block * 2 * GROUP];
        let [turn_re, turn_im] = &self.turns[group];
        let width = GROUP / S::F64_LANES.min(GROUP);
        let mut total = [[0.0; GROUP]; 4];
        for b in (0..self.n_blocks).rev() {
            let range = b * self.block..(b + 1) * self.block;
            let mut sums = [[simd.splat_f64s(0.0); GROUP]; 4];
            for ((&t, &m), w) in target[range.clone()].iter().zip(&measured[range]).zip(table.chunks_exact(2 * GROUP)) {
                let (t, m) = (simd.splat_f64s(t), simd.splat_f64s(m));
                let (w, _) = S::as_simd_f64s(w);
                for v in 0..width {
                    sums[0][v] = simd.mul_add_e_f64s(t, w[v], sums[0][v]);
                    sums[1][v] = simd.mul_add_e_f64s(t, w[width + v], sums[1][v]);
                    sums[2][v] = simd.mul_add_e_f64s(m, w[v], sums[2][v]);
                    sums[3][v] = simd.mul_add_e_f64s(m, w[width + v], sums[3][v]);
                }
            }
            let mut block = [[0.0; GROUP]; 4];
            for (lanes, sums) in block.iter_mut().zip(&sums) {
                S::as_mut_simd_f64s(lanes).0.copy_from_slice(&sums[..width]);
            }
            for signal in [0, 2] {
                for n in 0..GROUP {
                    let (x, y) = (total[signal][n], total[signal + 1][n]);
                    total[signal][n] = x * turn_re[n] - y * turn_im[n] + block[signal][n];
                    total[signal + 1][n] = x * turn_im[n] + y * turn_re[n] + block[signal + 1][n];
                }
            }
        }
        total
    }
}

/// [`Direct::sum`] compiled for the processor at hand.
struct SumGroup<'a> {
    direct: &'a Direct,
    group: usize,
    signals: [&'a [f64]; 2],
}

impl WithSimd for SumGroup<'_> {
    type Output = [[f64; GROUP]; 4];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        self.direct.sum(simd, self.group, self.signals)
    }
}
