//! What the residual says of the noise: its autoregression, and from its spectrum the variance of what was estimated.
//!
//! An estimate is linear in the noise e where it is small, theta - theta_0 = sum u_i e_i, so that its variance is the mean
//! over frequency of |U_k|^2 S_k, S the noise's spectrum. S is taken from the residual: whitened by an autoregression, its
//! periodogram is flat enough to be averaged over wide blocks of bins, each corrected for what the fit has taken out of it.
//!
//! That is the variance were the noise as strong throughout. Where it changes over time, with white noise eps behind e = eps / A
//! and h = u / A (backwards in time), the variance is sum h_i^2 E eps_i^2 (White 1980, here of what an autoregression leaves):
//! [`Changes`] holds its quotient by the steady one, by which the above is multiplied.

use crate::quantile::student_t_975;
use crate::spectrum::{Bins, LANES, Sink};
use crate::sums;
use num_complex::Complex;
use pulp::{Arch, NullaryFnOnce};

/// Cells at most; in longer records they hold more bins.
const MAX_CELLS: usize = 1 << 16;
/// Bins that are taken together, where noise changes over time, at most.
const MOST_ALIKE: f64 = 8.0;
/// Highest order of the autoregression.
pub(crate) const MAX_ORDER: usize = 4;
/// Least of |A|^2 over its mean: no noise spectrum rises higher above the rest.
const FLATTEST: f64 = 1e-8;
/// Independent bins in which the residual is compared with the target: within them gain and delay are one number.
const FINE: f64 = 8.0;
/// Independent bins from which a spectrum can be estimated at all.
const FEWEST: f64 = 16.0;

/// x_i = -a_1 x_(i-1) - ... - a_p x_(i-p) + white noise; coefficients start with 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Autoregression {
    pub(crate) coefficients: [f64; MAX_ORDER + 1],
    pub(crate) order: usize,
}

impl Autoregression {
    pub(crate) const WHITE: Self = Self { coefficients: [1.0, 0.0, 0.0, 0.0, 0.0], order: 0 };

    /// Fits `samples` by their autocorrelation (Yule 1927, Levinson 1947), the order by the Bayesian information criterion
    /// where `n_effective` of them count as independent (tapers leave fewer).
    pub(crate) fn fit(samples: &[f64], n_effective: f64) -> Self {
        let r = sums::lag_products::<{ MAX_ORDER + 1 }>(samples);
        let (mut now, mut best) = (Self::WHITE, Self::WHITE);
        let mut variance = r[0];
        // n log(variance) + order log n, relative to order 0.
        let (mut criterion, mut least) = (0.0, 0.0);
        for order in 1..=MAX_ORDER.min(samples.len() / 8) {
            let cross: f64 = (0..order).map(|i| now.coefficients[i] * r[order - i]).sum();
            let reflection = -cross / variance;
            if reflection.is_nan() || reflection.abs() >= 1.0 {
                break;
            }
            let previous = now.coefficients;
            for i in 1..=order {
                now.coefficients[i] += reflection * previous[order - i];
            }
            now.order = order;
            variance *= 1.0 - reflection * reflection;
            criterion += n_effective * (1.0 - reflection * reflection).ln() + n_effective.ln();
            if criterion < least {
                (best, least) = (now, criterion);
            }
        }
        best
    }

    /// Autocorrelation of the coefficients: |A(omega)|^2 = r_0 + 2 sum r_l cos(l omega).
    fn response(&self) -> [f64; MAX_ORDER + 1] {
        let a = &self.coefficients;
        std::array::from_fn(|l| (0..=MAX_ORDER - l).map(|i| a[i] * a[i + l]).sum())
    }

    /// out[i] = x_i + a_1 x_(i-1) + ...: what is unpredictable in `samples`, which has `order` samples more in front.
    pub(crate) fn whiten(&self, samples: &[f64], out: &mut [f64]) {
        let p = self.order;
        let n = samples.len() - p;
        for i in 0..n {
            let mut sum = samples[i + p];
            for k in 1..=p {
                sum += self.coefficients[k] * samples[i + p - k];
            }
            out[i] = sum;
        }
    }
}

impl Autoregression {
    /// The same in place; what comes before the first sample is taken for zero.
    pub(crate) fn whiten_in_place(&self, samples: &mut [f64]) {
        for i in (0..samples.len()).rev() {
            for k in 1..=self.order.min(i) {
                samples[i] += self.coefficients[k] * samples[i - k];
            }
        }
    }
}

/// Noise whose changes alter a variance by more than this share is not steady.
const UNSTEADY: f64 = 0.3;
/// Samples that are whitened at once.
const STRIP: usize = 64;
/// Lanes of the sums over them.
const WIDE: usize = 8;

/// What the noise's changes over time do to a variance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Changes {
    /// sum h^2 eps^2 over what it is on average, were eps steady: of gain and delay.
    pub(crate) gain: f64,
    pub(crate) delay: f64,
    /// Relative variances of these quotients.
    gain_uncertainty: f64,
    delay_uncertainty: f64,
    /// sum h^2 eps^2 itself, times a factor, of gain and delay: what the variances are at least where eps is not steady.
    least: [f64; 2],
    /// n sum s^4 / (sum s^2)^2 of its strength s: 1 where it is steady, n over the number of samples that hold it all.
    pub(crate) concentration: f64,
}

impl Changes {
    /// No changes.
    pub(crate) const NONE: Self = Self {
        gain: 1.0,
        delay: 1.0,
        gain_uncertainty: 0.0,
        delay_uncertainty: 0.0,
        least: [0.0; 2],
        concentration: 1.0,
    };

    /// How many pieces of noise that is strong for a while are alike.
    fn alike(&self) -> f64 {
        self.concentration.min(MOST_ALIKE)
    }

    /// From the residual e, displacement y and velocity y' (all windowed alike, by `window` where there is one). `scale` makes a
    /// variance of sum h^2 eps^2; zero where it is none.
    pub(crate) fn of(
        noise: &Autoregression,
        [residual, y, velocity]: [&[f64]; 3],
        window: Option<&[f64]>,
        influence: &Influence,
        scale: f64,
    ) -> Self {
        let sums = Arch::new().dispatch(Weigh { noise, residual, y, velocity, window, influence });
        let Moments { eps, weight, fourth, of } = sums;
        let n = residual.len() as f64;
        let ratio = |m: &Moment| m.noisy / m.steady * weight / eps;
        // Normal numbers: the variance of eps^2 is 2/3 of E eps^4.
        let uncertainty = |m: &Moment| {
            let (own, all, both) = (m.fourth / (m.noisy * m.noisy), fourth / (eps * eps), m.cross / (m.noisy * eps));
            2.0 / 3.0 * (own + all - 2.0 * both).max(0.0)
        };
        let [gain, delay] = &of;
        let found = Self {
            gain: ratio(gain),
            delay: ratio(delay),
            gain_uncertainty: uncertainty(gain),
            delay_uncertainty: uncertainty(delay),
            least: [gain, delay].map(|m| if (ratio(m) - 1.0).abs() > UNSTEADY { scale * m.noisy } else { 0.0 }),
            concentration: (n * fourth / (3.0 * eps * eps)).max(1.0),
        };
        let known = [found.gain, found.delay, found.gain_uncertainty, found.delay_uncertainty, found.concentration];
        if known.iter().all(|v| v.is_finite()) { found } else { Self::NONE }
    }
}

/// Sums over the samples: eps^2, w^2, eps^4, and those of gain and delay.
struct Moments {
    eps: f64,
    weight: f64,
    fourth: f64,
    of: [Moment; 2],
}

/// sum h^2 eps^2, sum h^2 w^2, sum h^4 eps^4, sum h^2 eps^4
#[derive(Clone, Copy, Default)]
struct Moment {
    noisy: f64,
    steady: f64,
    fourth: f64,
    cross: f64,
}

/// [`Moments`], compiled for the processor at hand.
struct Weigh<'a> {
    noise: &'a Autoregression,
    residual: &'a [f64],
    y: &'a [f64],
    velocity: &'a [f64],
    window: Option<&'a [f64]>,
    influence: &'a Influence,
}

impl NullaryFnOnce for Weigh<'_> {
    type Output = Moments;

    #[inline(always)]
    fn call(self) -> Moments {
        let Self { noise: Autoregression { coefficients: a, order }, residual, y, velocity, window, influence } = self;
        let factors = [influence.gain, influence.delay];
        let n = residual.len();
        let zero = [0.0; WIDE];
        let (mut eps, mut weight, mut fourth) = (zero, zero, zero);
        let mut of = [[zero; 4]; 2];
        // h of y and of y' that come later.
        let mut later = [[0.0; 2]; MAX_ORDER];
        let mut end = n;
        while end > 0 {
            let begin = end.saturating_sub(STRIP);
            let len = end - begin;
            let (mut e, mut hy, mut hv, mut w) = ([0.0; STRIP], [0.0; STRIP], [0.0; STRIP], [0.0; STRIP]);
            e[..len].copy_from_slice(&residual[begin..end]);
            hy[..len].copy_from_slice(&y[begin..end]);
            hv[..len].copy_from_slice(&velocity[begin..end]);
            match window {
                Some(window) => w[..len].copy_from_slice(&window[begin..end]),
                None => w[..len].fill(1.0),
            }
            if *order > 0 {
                for i in 0..len {
                    for k in 1..=(*order).min(begin + i) {
                        e[i] += a[k] * residual[begin + i - k];
                    }
                }
                for i in (0..len).rev() {
                    for k in 0..*order {
                        hy[i] -= a[k + 1] * later[k][0];
                        hv[i] -= a[k + 1] * later[k][1];
                    }
                    later.rotate_right(1);
                    later[0] = [hy[i], hv[i]];
                }
            }
            for part in 0..STRIP / WIDE {
                let at = part * WIDE;
                for i in 0..WIDE {
                    let (square, share) = (e[at + i] * e[at + i], w[at + i] * w[at + i]);
                    eps[i] += square;
                    weight[i] += share;
                    fourth[i] += square * square;
                    for (sums, f) in of.iter_mut().zip(&factors) {
                        let h = f[0] * hy[at + i] + f[1] * hv[at + i];
                        let both = h * h * square;
                        sums[0][i] += both;
                        sums[1][i] += h * h * share;
                        sums[2][i] += both * both;
                        sums[3][i] += both * square;
                    }
                }
            }
            end = begin;
        }
        let total = |lanes: &[f64; WIDE]| lanes.iter().sum::<f64>();
        let of = of.map(|[noisy, steady, fourth, cross]| Moment {
            noisy: total(&noisy),
            steady: total(&steady),
            fourth: total(&fourth),
            cross: total(&cross),
        });
        Moments { eps: total(&eps), weight: total(&weight), fourth: total(&fourth), of }
    }
}

/// Bins whose cosines are made from one coarse and one fine angle.
const FINE_ANGLES: usize = 64;

/// cos of the frequencies of bins that follow each other, cos(a + b) = cos a cos b - sin a sin b: a table of them all would
/// be as large as the samples.
#[derive(Debug, Clone)]
pub(crate) struct Cosines {
    n_bins: usize,
    /// cos and sin at every 64th bin, and of the angles from there on.
    coarse: Vec<[f64; 2]>,
    fine: [[f64; 2]; FINE_ANGLES],
}

impl Cosines {
    /// Of `n_bins` bins from `first` on, `radians` apart.
    pub(crate) fn new(radians: f64, first: usize, n_bins: usize) -> Self {
        let at = |bin: usize| [(bin as f64 * radians).cos(), (bin as f64 * radians).sin()];
        let coarse = (0..n_bins.div_ceil(FINE_ANGLES)).map(|k| at(first + k * FINE_ANGLES)).collect();
        Self { n_bins, coarse, fine: std::array::from_fn(at) }
    }

    pub(crate) fn len(&self) -> usize {
        self.n_bins
    }

    /// Of the `k`-th of the bins.
    #[inline(always)]
    pub(crate) fn at(&self, k: usize) -> f64 {
        let ([c, s], [fine_c, fine_s]) = (self.coarse[k / FINE_ANGLES], self.fine[k % FINE_ANGLES]);
        c * fine_c - s * fine_s
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.n_bins).map(|k| self.at(k))
    }
}

/// Which combinations of displacement and velocity give the estimates: U = sum_j weights_j G_j, G = (y, y') at the bins.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Influence {
    /// Of the gain, of y and y'.
    pub(crate) gain: [f64; 2],
    /// Of the delay in samples.
    pub(crate) delay: [f64; 2],
    /// h_k = y^2 leverage[0] + 2 y y' leverage[1] + y'^2 leverage[2]: what the fit takes out of a bin; sums to 2.
    pub(crate) leverage: [f64; 3],
}

impl Influence {
    fn forms(&self) -> Forms {
        let square = |[a, b]: [f64; 2]| [a * a, 2.0 * a * b, b * b];
        let [a, b, c] = self.leverage;
        Forms { gain: square(self.gain), delay: square(self.delay), leverage: [a, 2.0 * b, c] }
    }
}

/// The same as factors of y^2, y y' and y'^2.
#[derive(Debug, Clone, Copy)]
struct Forms {
    gain: [f64; 3],
    delay: [f64; 3],
    leverage: [f64; 3],
}

/// What the bins are to the samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampling {
    /// sum w^2 over the judged samples: the energy of unit white noise in a bin.
    pub(crate) window_power: f64,
    /// Neighbouring bins that share one independent piece of noise: from zero-padding and tapering.
    pub(crate) bins_per_piece: f64,
    /// From sum |U_k|^2 S_k over the bins to the variance.
    pub(crate) scale: f64,
}

/// Sums over a few neighbouring bins, in lanes.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    n: f64,
    /// |U|^2 / |A|^2 of gain and delay, and |U|^2 where |A| is not 1.
    gain: [f64; LANES],
    delay: [f64; LANES],
    gain_as_is: [f64; LANES],
    delay_as_is: [f64; LANES],
    leverage: [f64; LANES],
    target: [f64; LANES],
    /// |E|^2 |A|^2
    whitened: [f64; LANES],
    residual: [f64; LANES],
    cross_re: [f64; LANES],
    cross_im: [f64; LANES],
}

fn total(lanes: &[f64; LANES]) -> f64 {
    lanes.iter().sum()
}

/// Standard deviations, and how far to go to either side of an estimate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Precision {
    pub(crate) gain_std: f64,
    pub(crate) gain_reach: f64,
    /// In samples.
    pub(crate) delay_std: f64,
    pub(crate) delay_reach: f64,
    /// Share of the residual, where the target has its energy, that follows the target at a gain of its own per frequency.
    pub(crate) coherence: f64,
    /// Whether that is more than noise can do.
    pub(crate) coherent: bool,
}

/// The bins that are kept.
#[derive(Clone, Copy)]
pub(crate) struct KeptBins<'a> {
    /// Index of the first.
    pub(crate) first: usize,
    /// Of their frequencies, in radians a sample.
    pub(crate) cosines: &'a Cosines,
    /// What makes good their droop.
    pub(crate) correction: Option<&'a [f64]>,
}

/// What is known of the noise: of measured's, and of the target's where it has some.
#[derive(Clone, Copy)]
pub(crate) struct Disturbance<'a> {
    pub(crate) autoregression: Autoregression,
    pub(crate) changes: Changes,
    pub(crate) target: Option<NoisyTarget<'a>>,
}

/// Adds up, cell by cell, what is needed of the bins.
pub(crate) struct Spread<'a> {
    cells: &'a mut [Cell],
    width: usize,
    first: usize,
    cosines: &'a Cosines,
    correction: Option<&'a [f64]>,
    whitening: [f64; MAX_ORDER + 1],
    /// The noise is not white.
    coloured: bool,
    influence: Influence,
    forms: Forms,
    sampling: Sampling,
    noisy_target: Option<NoisyTarget<'a>>,
    changes: Changes,
    /// Whether the pair is (y, y') or (y, residual).
    residual: bool,
}

/// What noise on the target adds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NoisyTarget<'a> {
    /// Of the kept bins in the fit, where they are not all alike.
    pub(crate) weights: Option<&'a [f64]>,
    /// The residual holds -K times the target's noise: sum E conj Y is minus this share of sum |E|^2 by that alone.
    pub(crate) share: f64,
}

/// Bins to a cell, where so many share one independent piece of noise.
pub(crate) fn cell_width(bins_per_piece: f64) -> usize {
    ((FINE * bins_per_piece).ceil() as usize).max(1)
}

/// Cells of one estimate.
#[derive(Debug, Clone)]
pub(crate) struct SpreadState(Vec<Cell>);

impl SpreadState {
    /// For `n_bins` bins; a cell holds at least [`FINE`] of them.
    pub(crate) fn new(n_bins: usize) -> Self {
        Self(vec![Cell::default(); (n_bins / FINE as usize + 2).min(MAX_CELLS)])
    }
}

impl<'a> Spread<'a> {
    pub(crate) fn new(
        state: &'a mut SpreadState,
        kept: KeptBins<'a>,
        noise: Disturbance<'a>,
        influence: Influence,
        sampling: Sampling,
    ) -> Self {
        let KeptBins { first, cosines, correction } = kept;
        let Disturbance { autoregression, changes, target: noisy_target } = noise;
        let width = cell_width(sampling.bins_per_piece * changes.alike()).max(cosines.len().div_ceil(MAX_CELLS));
        let cells = &mut state.0[..cosines.len().div_ceil(width)];
        cells.fill(Cell::default());
        Self {
            cells,
            width,
            first,
            cosines,
            correction,
            whitening: autoregression.response(),
            coloured: autoregression.order > 0,
            influence,
            forms: influence.forms(),
            sampling,
            noisy_target,
            changes,
            residual: false,
        }
    }

    /// What comes now is pairs of y and residual.
    pub(crate) fn residual_next(&mut self) {
        self.residual = true;
    }

    /// The bin at zero frequency, which stands for half a pair of bins.
    pub(crate) fn zero_frequency(&mut self, y: f64, velocity: f64, residual: f64) {
        let whitening = self.whitening[0] + 2.0 * self.whitening[1..].iter().sum::<f64>();
        let whitening = whitening.max(FLATTEST * self.whitening[0]);
        let Influence { gain, delay, leverage } = self.influence;
        let cell = &mut self.cells[0];
        cell.n += 0.5;
        let (g, d) = (gain[0] * y + gain[1] * velocity, delay[0] * y + delay[1] * velocity);
        cell.gain[0] += 0.5 * g * g / whitening;
        cell.delay[0] += 0.5 * d * d / whitening;
        cell.gain_as_is[0] += 0.5 * g * g;
        cell.delay_as_is[0] += 0.5 * d * d;
        cell.leverage[0] +=
            0.5 * (leverage[0] * y * y + 2.0 * leverage[1] * y * velocity + leverage[2] * velocity * velocity);
        cell.target[0] += 0.5 * y * y;
        cell.whitened[0] += 0.5 * residual * residual * whitening;
        cell.residual[0] += 0.5 * residual * residual;
        cell.cross_re[0] += 0.5 * residual * y;
    }

    /// The precision, with the noise's spectrum taken from blocks of n^0.3 independent bins to either side; `None` where
    /// there are too few bins for one.
    pub(crate) fn precision(&self, n_samples: usize) -> Option<Precision> {
        let Sampling { window_power, bins_per_piece, scale } = self.sampling;
        let pieces = self.cells.iter().map(|c| c.n).sum::<f64>() / bins_per_piece;
        if pieces < FEWEST {
            return None;
        }
        let half = (n_samples as f64).powf(0.3).max(FEWEST);
        let pieces_per_cell = self.width as f64 / (bins_per_piece * self.changes.alike());
        let cells_per_block = ((2.0 * half / pieces_per_cell).round() as usize).clamp(1, self.cells.len());
        // A last block that is not full joins the one before it.
        let n_blocks = (self.cells.len() / cells_per_block).max(1);
        let [mut gain, mut delay, mut gain_as_is, mut delay_as_is] = [Variance::default(); 4];
        for b in 0..n_blocks {
            let to = if b + 1 == n_blocks { self.cells.len() } else { (b + 1) * cells_per_block };
            let cells = &self.cells[b * cells_per_block..to];
            let sum = |of: fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>();
            let n = sum(|c| c.n);
            let expected = n * window_power - scale * sum(|c| total(&c.leverage));
            // A block of which the fit leaves less than a tenth of a bin says nothing of the noise.
            let per_bin = 1.0 / expected.max(0.1 * window_power);
            let pieces = (expected / window_power / bins_per_piece).max(0.1);
            let density = per_bin * sum(|c| total(&c.whitened));
            gain.add(scale * sum(|c| total(&c.gain)), density, pieces);
            delay.add(scale * sum(|c| total(&c.delay)), density, pieces);
            let density = per_bin * sum(|c| total(&c.residual));
            gain_as_is.add(scale * sum(|c| total(&c.gain_as_is)), density, pieces);
            delay_as_is.add(scale * sum(|c| total(&c.delay_as_is)), density, pieces);
        }
        // An autoregression that has a tone to describe tilts what lies far from it.
        let larger = |a: Variance, b: Variance| if b.value > a.value { b } else { a };
        let (gain, delay) = (larger(gain, gain_as_is), larger(delay, delay_as_is));
        let Changes { concentration, least: [least_gain, least_delay], .. } = self.changes;
        let gain = gain.changed(self.changes.gain, self.changes.gain_uncertainty, concentration).at_least(least_gain);
        let delay =
            delay.changed(self.changes.delay, self.changes.delay_uncertainty, concentration).at_least(least_delay);
        let (coherence, coherent) = self.coherence();
        Some(Precision {
            gain_std: gain.value.sqrt(),
            gain_reach: gain.reach(),
            delay_std: delay.value.sqrt(),
            delay_reach: delay.reach(),
            coherence,
            coherent,
        })
    }

    /// Coherence of residual and target over the cells that together hold all but a thousandth of the target's energy.
    fn coherence(&self) -> (f64, bool) {
        let all_of_target: f64 = self.cells.iter().map(|c| total(&c.target)).sum();
        let least = 1e-3 * all_of_target / self.cells.len() as f64;
        let (mut explained, mut all, mut shares, mut n) = (0.0, 0.0, 0.0, 0.0_f64);
        for c in self.cells.iter() {
            let (target, residual) = (total(&c.target), total(&c.residual));
            if target <= least || residual <= 0.0 {
                continue;
            }
            let own = self.noisy_target.map_or(0.0, |n| n.share * residual);
            let cross = Complex::new(total(&c.cross_re) + own, total(&c.cross_im)).norm_sqr() / target;
            explained += cross;
            all += residual;
            shares += cross / residual;
            n += 1.0;
        }
        if n == 0.0 || all <= 0.0 {
            return (0.0, false);
        }
        // Of noise alone a cell's share is Beta(1, FINE - 1): mean 1 / FINE.
        let mean = 1.0 / FINE;
        let std = ((FINE - 1.0) / (FINE * FINE * (FINE + 1.0))).sqrt();
        let likely = (mean + 5.0 * std / n.sqrt()).min(0.7);
        (explained / all, shares / n > likely && explained / all > likely)
    }
}

/// sum of variances from blocks of bins, with its degrees of freedom (Satterthwaite 1946).
#[derive(Debug, Clone, Copy, Default)]
struct Variance {
    value: f64,
    /// sum (share)^2 / pieces
    uncertainty: f64,
}

impl Variance {
    fn add(&mut self, weight: f64, density: f64, pieces: f64) {
        self.value += weight * density;
        self.uncertainty += (weight * density) * (weight * density) / pieces;
    }

    /// Times `factor`, itself known to a relative variance; fewer samples than all hold the noise by `concentration`.
    fn changed(&self, factor: f64, relative_variance: f64, concentration: f64) -> Self {
        let value = self.value * factor;
        let relative =
            2.0 * self.uncertainty / (self.value * self.value) * 0.5 * concentration + 0.5 * relative_variance;
        Self { value, uncertainty: relative * value * value }
    }

    /// The same, as well known, where it is not below `least`.
    fn at_least(&self, least: f64) -> Self {
        let factor = (least / self.value).max(1.0);
        if factor.is_finite() {
            Self { value: self.value * factor, uncertainty: self.uncertainty * factor * factor }
        } else {
            *self
        }
    }

    fn reach(&self) -> f64 {
        let freedom = 2.0 * self.value * self.value / self.uncertainty;
        if freedom.is_finite() { student_t_975(freedom.max(1.0)) * self.value.sqrt() } else { self.value.sqrt() }
    }
}

impl Sink for Spread<'_> {
    #[inline(always)]
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        let at = bins.first - self.first;
        let mut whitening = [self.whitening[0]; W];
        if self.coloured {
            let cosines: [f64; W] = std::array::from_fn(|i| self.cosines.at(at + i));
            // cos(l omega) by the recurrence of Chebyshev's polynomials.
            let (mut before, mut now) = ([1.0; W], cosines);
            for l in 1..=MAX_ORDER {
                for i in 0..W {
                    whitening[i] += 2.0 * self.whitening[l] * now[i];
                    (before[i], now[i]) = (now[i], 2.0 * cosines[i] * now[i] - before[i]);
                }
            }
            // A tone in the residual would make this zero.
            whitening = whitening.map(|w| w.max(FLATTEST * self.whitening[0]));
        }
        let mut squared = [1.0; W];
        if let Some(correction) = self.correction {
            squared = std::array::from_fn(|i| correction[at + i] * correction[at + i]);
        }
        let (yr, yi) = (&bins.target_re, &bins.target_im);
        let (er, ei) = (&bins.measured_re, &bins.measured_im);
        let cell = &mut self.cells[at / self.width];
        if self.residual {
            for i in 0..W {
                let energy = (er[i] * er[i] + ei[i] * ei[i]) * squared[i];
                cell.residual[i] += energy;
                cell.whitened[i] += energy * whitening[i];
                cell.cross_re[i] += (er[i] * yr[i] + ei[i] * yi[i]) * squared[i];
                cell.cross_im[i] += (ei[i] * yr[i] - er[i] * yi[i]) * squared[i];
            }
            return;
        }
        let mut weight = [1.0; W];
        if let Some(NoisyTarget { weights: Some(weights), .. }) = self.noisy_target {
            weight = std::array::from_fn(|i| weights[at + i]);
        }
        let Forms { gain, delay, leverage } = self.forms;
        let (vr, vi) = (er, ei);
        cell.n += W as f64;
        for i in 0..W {
            let yy = (yr[i] * yr[i] + yi[i] * yi[i]) * squared[i];
            let yv = (yr[i] * vr[i] + yi[i] * vi[i]) * squared[i];
            let vv = (vr[i] * vr[i] + vi[i] * vi[i]) * squared[i];
            let form = |[a, b, c]: [f64; 3]| a * yy + b * yv + c * vv;
            let noise = weight[i] * weight[i] / whitening[i];
            let (gain, delay) = (form(gain), form(delay));
            cell.gain[i] += noise * gain;
            cell.delay[i] += noise * delay;
            if self.coloured {
                cell.gain_as_is[i] += weight[i] * weight[i] * gain;
                cell.delay_as_is[i] += weight[i] * weight[i] * delay;
            }
            cell.leverage[i] += weight[i] * form(leverage);
            // What is not in the fit, for it is mostly noise, is not asked whether the residual follows it.
            cell.target[i] += if weight[i] > 0.0 { yy } else { 0.0 };
        }
    }
}
