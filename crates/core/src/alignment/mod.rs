//! Gain and delay without the bias of windows, drift and averaged phases: the target is shifted before it is windowed.
//!
//! Model over the judged samples: O(t) = K I(t - tau) + noise. The raw target is interpolated ([`crate::lagrange`]), with
//! samples from outside the window where there are any, shifted, detrended and windowed like measured, and
//!
//! ```text
//! least squares:  min over K, tau of  sum |O - K I_tau|^2 / (lambda + K^2 g)      (lambda = 1, g = 0 for an exact target)
//! aligned:        arg sum O_k conj(I_tau,k) |I_tau,k|^(l-2) = 0                    (Eq 12 on the shifted target)
//! ```
//!
//! are solved for tau by Newton's steps. With noise on the target, lambda is the ratio of the noise variances and g what the
//! interpolation leaves of the target's noise. In time where all bins are kept, over the kept bins otherwise.

mod grid;
mod precision;
mod products;
mod weighting;

use std::ops::Range;

use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};

use crate::alignment::grid::Grid;
use crate::alignment::products::{Cross, Multiply, Products};
use crate::alignment::weighting::{Energies, Weighting};
use crate::bad_samples::{About, Examination};
use crate::causal::CausalDecimator;
use crate::error::Result;
use crate::floor;
use crate::lag::{MAX_PEAKS, MAX_STEP, Peak, Peaks, Search, SearchState, View};
use crate::lagrange::{AFTER, BEFORE, NODES, Taps};
use crate::noise::{MAX_ORDER, SpreadState, cell_width};
use crate::reason::Reason;
use crate::settings::{Estimator, EvaluatorConfig, Noise};
use crate::spectrum::{Scratch, SpectrumConfig};
use crate::sums;
use crate::tracking::Tracking;
use crate::weigh::weigh;
use crate::window::{Detrend, Window};

/// Newton's steps at most.
const MAX_STEPS: usize = 24;
/// A step this short, in samples, is the last: what it leaves is its square.
const LAST_STEP: f64 = 1e-4;
/// A step this short is the last, though its slope is known by its size alone.
const SETTLED: f64 = 1e-7;
/// The same where the slope has been measured, noise and all.
const LAST_SECANT_STEP: f64 = 2e-3;
/// Fewest samples that are judged.
const MIN_SUPPORT: usize = 16;
/// Two delays fit equally well if the likelihood of one is below exp(10) times that of the other.
const LOG_ODDS: f64 = 10.0;
/// Up to this frequency, and the next power of two of it in the rate, precision is looked at where that is enough;
const LOW_HZ: f64 = 32.0;
/// where it shortens the transforms by at least this;
const SHORTENING: usize = 8;
/// and where the target's velocity has at most this share of its energy above.
const HIGH_SHARE: f64 = 0.05;
/// How often another turn is taken for the likeliest, and by how much of log-likelihood it must be that.
const MAX_REFERENCES: usize = 3;
const LEAST_GAIN: f64 = 1.0;
/// Noise changes over time where it meets the difference of two fits with this many times the variance of steady noise.
const UNSTEADY: f64 = 1.5;
/// Parts of a window over which noise that goes on alike adds up, and by what factor steady noise does so but rarely.
const PARTS: usize = 16;
const UNLIKELY: f64 = 1.5;
/// Noise at two delays of the target differs from one turn to the next by chance: of many turns and windows the largest counts.
const TAILS: f64 = 1.6;
/// So much less likely, were the noise white, it is less likely in any noise.
const CLEAR_ODDS: f64 = 1e3 * LOG_ODDS;
/// Each later look at a peak may go one sample further.
const LOOKS: f64 = 3.0;
/// More bad samples than this share leave nothing to trust.
const MOST_BAD: f64 = 0.3;
/// A gap of target as short as this is bridged well; so many samples beside it are left out with it.
const SHORT_GAP: usize = 2;
const NEAREST: f64 = 2.0;
/// A turn out of reach is looked at where a fit leaves more of measured than this.
const LEFT_BY_A_TURN: f64 = 3e-4;
/// The bias of noise on the target may be this share of the standard deviation.
const NOISY_SHARE: f64 = 0.05;
/// Of noise alone that share of the target's energy, or of its velocity's, may be; what is left of more is no measure.
const MOSTLY_NOISE: f64 = 0.7;
/// A residual of so many times what white noise leaves is coloured, and this share of a target may then be noise.
const COLOURED: f64 = 2.0;
const UNKNOWN_NOISE: f64 = 0.2;
/// At a lower rate this share of the target's velocity may be lost, as energy.
const SLOW_SHARE: f64 = 0.01;
/// Octaves in which its velocity is looked at.
const MAX_SCALES: usize = 16;
/// Above a third of the rate, where samples are too far apart to be read between, this share of the target's energy may lie.
const FAST_SHARE: f64 = 1e-4;
/// How white noise correlates between samples.
const WHITE: [f64; NODES] = {
    let mut correlation = [0.0; NODES];
    correlation[0] = 1.0;
    correlation
};
/// Samples that a lower rate leaves, at least and at most.
const MIN_DECIMATED: usize = 256;
const MAX_DECIMATED: usize = 1 << 19;
/// A residual of this share of measured is as good as none: that of interpolation, of the last step and of round-off.
const EXACT: f64 = 1e-11;

/// The checked plan for windows of one length.
pub(crate) struct Alignment {
    estimator: Estimator,
    n_samples: usize,
    rate_hz: f64,
    max_delay: f64,
    noise: Noise,
    noise_ratio: f64,
    weight_power: u32,
    detrend: Detrend,
    window: Option<Vec<f64>>,
    /// sum w^2 and sum w^4 of it.
    moments: (f64, f64),
    search: Search,
    kept: Grid,
    /// Lower bins only, for the precision of what is estimated from all of them while the target moves slowly.
    low: Option<Low>,
    /// All bins are kept, so that sums over samples serve.
    in_time: bool,
    /// How white noise on the target correlates between the samples that are judged, and over the kept bins.
    correlation: [f64; NODES],
    correlation_in_bins: [f64; NODES],
    /// Plans for the same decimated by 2, 4, ..., for a target with noise of its own.
    levels: Vec<Level>,
    arch: Arch,
}

/// A plan for the samples of a lower rate.
struct Level {
    decimator: CausalDecimator,
    /// Variance of what the decimator leaves of white noise of variance 1.
    variance: f64,
    alignment: Alignment,
}

/// Bins of fewer samples, and the window at these.
struct Low {
    grid: Grid,
    window: Option<Vec<f64>>,
    /// Serves any target, not only one that moves slowly.
    always: bool,
}

impl Low {
    fn new(grid: Grid, window: Option<&[f64]>, always: bool) -> Self {
        let window = window.map(|w| {
            let mut fewer = vec![0.0; w.len().div_ceil(grid.step)];
            grid.shorten(w, &mut fewer);
            fewer
        });
        Self { grid, window, always }
    }
}

/// Buffers of the same: residual, displacement and velocity.
#[derive(Debug, Clone)]
struct LowState {
    scratch: Scratch,
    fewer: [Vec<f64>; 3],
}

/// Its buffers.
#[derive(Debug, Clone)]
pub(crate) struct AlignmentState {
    search: SearchState,
    signals: Signals,
    /// Transforms of displacement, velocity, and measured or residual.
    bins: [Vec<Complex<f64>>; 3],
    scratch: Scratch,
    low: Option<LowState>,
    spread: SpreadState,
    /// Target and measured, less what an autoregression predicts of the noise.
    whitened: [Vec<f64>; 2],
    /// The best fit's residual, likewise, to compare others with.
    whitened_residual: Vec<f64>,
    weighting: Weighting,
    /// Variance of the noise that is the target's own, a sample; 0 where it is taken for exact. And of measured's, by its highest
    /// frequencies, where the target's is not 0.
    target_noise: f64,
    measured_noise: f64,
    /// The same of the target where it is taken for exact, too.
    target_floor: f64,
    support: Support,
    /// Target and measured, decimated, and the buffers of each level.
    decimated: [Vec<f64>; 2],
    gaps: [Vec<Range<usize>>; 2],
    levels: Vec<AlignmentState>,
}

impl AlignmentState {
    /// Room for the gaps of views of `n` samples.
    pub(crate) fn reserve(&mut self, n: usize) {
        self.support.lost.reserve(n + 1);
        self.gaps.iter_mut().for_each(|gaps| gaps.reserve(n / 2 + 1));
        self.levels.iter_mut().for_each(|level| level.reserve(n));
    }
}

/// A window to be judged, in the record around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Judged<'a> {
    view: View<'a>,
    /// Index in the record of its first sample.
    start: usize,
    /// Of delays that fit equally well the nearest to this is taken, in samples; without it the answer is "ambiguous".
    expected: Option<f64>,
    /// By sums over the kept bins, not over samples.
    in_bins: bool,
}

impl<'a> Judged<'a> {
    /// The window that starts at sample `start` of the record; the samples are finite.
    pub(crate) fn new(view: View<'a>, start: usize, expected: Option<f64>) -> Self {
        Self { view, start, expected, in_bins: false }
    }

    /// The same by sums over the kept bins.
    fn in_bins(&self) -> Self {
        Self { in_bins: true, ..*self }
    }
}

/// The samples of a window that are compared: those for which the target is known at all delays that are looked at, less the bad
/// ones.
#[derive(Debug, Clone, Default)]
struct Support {
    /// From the first to the last, by their index in the record.
    range: Range<usize>,
    /// Stretches of it that are left out, and how many samples they are.
    lost: Vec<Range<usize>>,
    n_lost: usize,
    /// Where the others stand in the signals, one after the other.
    within: Range<usize>,
}

impl Support {
    /// The samples of `range`, of the window that starts at `start`, at delays from `least` to `most`.
    fn settle(&mut self, range: Range<usize>, judged: &Judged<'_>, [least, most]: [f64; 2]) {
        self.range = range;
        self.lost.clear();
        self.n_lost = 0;
        if judged.view.has_gaps() {
            self.lose(judged.view.gaps, least, most);
            if 2 * self.n_lost > self.range.len() {
                // Between turns far apart the bridges of target's gaps must do.
                let middle = 0.5 * (least + most);
                self.lose(judged.view.gaps, middle, middle);
            }
        }
        self.within = self.range.start - judged.start..self.range.end - judged.start - self.n_lost;
    }

    /// Finds which samples are bad, or are compared at delays from `least` to `most` with bad ones of the target.
    fn lose(&mut self, gaps: [&[Range<usize>]; 2], least: f64, most: f64) {
        let support = self.range.clone();
        let (before, after) = (AFTER as f64 + 1.0 - least.floor(), BEFORE as f64 + 1.0 + most.ceil());
        let [mut target, mut measured] = gaps.map(|gaps| gaps.iter().peekable());
        let middle = (0.5 * (least + most)).round();
        let widened = |gap: &Range<usize>| {
            let at = |index: f64| (index.max(0.0) as usize).clamp(support.start, support.end) - support.start;
            if gap.len() <= SHORT_GAP {
                // Its bridge is good enough for all but the nearest taps.
                return at(gap.start as f64 + middle - NEAREST)..at(gap.end as f64 + middle + NEAREST);
            }
            at(gap.start as f64 - before)..at(gap.end as f64 + after)
        };
        let clipped = |gap: &Range<usize>| {
            let at = |index: usize| index.clamp(support.start, support.end) - support.start;
            at(gap.start)..at(gap.end)
        };
        self.lost.clear();
        self.n_lost = 0;
        loop {
            let next = match (target.peek().map(|g| widened(g)), measured.peek().map(|g| clipped(g))) {
                (Some(a), Some(b)) if a.start <= b.start => (a, target.next()).0,
                (Some(_), Some(b)) | (None, Some(b)) => (b, measured.next()).0,
                (Some(a), None) => (a, target.next()).0,
                (None, None) => break,
            };
            if next.is_empty() {
                continue;
            }
            match self.lost.last_mut() {
                Some(last) if next.start <= last.end => last.end = last.end.max(next.end),
                _ => self.lost.push(next),
            }
        }
        self.n_lost = self.lost.iter().map(Range::len).sum();
    }

    /// What is left without the lost ones, from the first on, and where it stands in the signals.
    fn kept(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> + '_ {
        let ends = self.lost.iter().map(|gap| gap.end);
        let starts = self.lost.iter().map(|gap| gap.start).chain([self.range.len()]);
        let mut at = self.within.start;
        std::iter::once(0).chain(ends).zip(starts).map(move |(from, to)| {
            let here = at;
            at += to - from;
            (from..to, here..at)
        })
    }
}

/// n samples each, zero outside the judged ones.
#[derive(Debug, Clone)]
struct Signals {
    /// Measured, detrended and windowed; later the residual.
    measured: Vec<f64>,
    /// The shifted target, and its slope a sample, alike.
    shifted: Vec<f64>,
    slope: Vec<f64>,
}

/// Which of the transforms is of measured, later of the residual.
const MEASURED: usize = 2;

/// What a fit found.
#[derive(Debug, Clone, Copy)]
struct Fit {
    /// Delay in samples, and how far it lies from where the signals stand.
    tau: f64,
    step: f64,
    gain: f64,
    products: Products,
    /// The same less what noise on the target adds, and that noise's energy.
    clean: Products,
    noise: f64,
    /// Its share of the energy of displacement or velocity, whichever is larger.
    noise_share: f64,
    residual: f64,
    /// The share of measured that is explained, where the signals in the state do not tell.
    goodness: Option<f64>,
}

/// Fits of a tone at one turn and another, and of others that come near each other.
struct Turns {
    fits: [Option<Fit>; MAX_PEAKS],
}

impl Default for Turns {
    fn default() -> Self {
        Self { fits: [None; MAX_PEAKS] }
    }
}

impl Turns {
    fn within(&self) -> impl Iterator<Item = &Fit> {
        self.fits.iter().flatten()
    }

    fn retain(&mut self, mut keep: impl FnMut(&Fit) -> bool) {
        for slot in &mut self.fits {
            *slot = slot.filter(&mut keep);
        }
    }

    /// Two neighbours of those that are left, the nearest to no delay first, where it is more than one.
    fn neighbours(&self) -> Option<[f64; 2]> {
        let first = self.within().map(|f| f.tau).min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let others = self.within().map(|f| f.tau).filter(|tau| *tau != first);
        let second = others.min_by(|a, b| (a - first).abs().total_cmp(&(b - first).abs()))?;
        Some([first, second])
    }
}

/// How one residual compares with the least one, both whitened.
struct Odds {
    /// sum e^2 - sum e_least^2
    excess: f64,
    /// sum e_least^2 (e - e_least)^2
    variance: f64,
    /// sum (e^2 - e_least^2)^2
    variance_of_terms: f64,
    /// Of sums over parts of the window, sum (sum e_least d)^2 with d = e - e_least, and the same a quarter of a period later,
    /// which no fit makes small: their mean, for sixteen, eight or four parts, whichever is largest.
    variance_of_parts: f64,
    /// sum (e - e_least)^2
    distance: f64,
}

impl Odds {
    fn of(residual: &[f64], least: &[f64]) -> Self {
        let (mut excess, mut variance, mut variance_of_terms) = (0.0, 0.0, 0.0);
        let (mut distance, mut of_slope) = (0.0, 0.0);
        let mut parts = [(0.0, 0.0); PARTS];
        let part = residual.len().div_ceil(PARTS).max(1);
        let d = |i: usize| residual[i] - least[i];
        let (mut before, mut here) = (0.0, d(0));
        for i in 0..residual.len() {
            let after = if i + 1 < residual.len() { d(i + 1) } else { 0.0 };
            let slope = after - before;
            let term = here * (residual[i] + least[i]);
            let product = least[i] * here;
            excess += term;
            variance += product * product;
            variance_of_terms += term * term;
            distance += here * here;
            of_slope += slope * slope;
            parts[i / part].0 += product;
            parts[i / part].1 += least[i] * slope;
            (before, here) = (here, after);
        }
        let scale = if of_slope > 0.0 { distance / of_slope } else { 0.0 };
        let of_parts = |width: usize| {
            let sum = |p: &[(f64, f64)]| p.iter().fold((0.0, 0.0), |(s, q), part| (s + part.0, q + part.1));
            parts.chunks(width).map(sum).map(|(s, q)| 0.5 * (s * s + scale * q * q)).sum::<f64>()
        };
        let variance_of_parts = of_parts(1).max(of_parts(2)).max(of_parts(4));
        Self { excess, variance, variance_of_terms, variance_of_parts, distance }
    }
}

impl Alignment {
    /// The plan of a configuration that [`crate::Evaluator::new`] has checked.
    pub(crate) fn new(n_samples: usize, rate_hz: f64, config: &EvaluatorConfig) -> Result<Self> {
        let mut plan = Self::of_samples(n_samples, rate_hz, config)?;
        if plan.in_time {
            let least = n_samples.div_ceil(MAX_DECIMATED).next_power_of_two().max(2);
            let factors = std::iter::successors(Some(least), |p| Some(2 * p));
            for factor in factors.take_while(|p| p * MIN_DECIMATED <= n_samples) {
                let decimator = CausalDecimator::oversampled(factor);
                let mut alignment = Self::of_samples(n_samples / factor, rate_hz / factor as f64, config)?;
                let halved = Grid::halved(spectrum_config(alignment.n_samples, alignment.rate_hz, config))?;
                alignment.low = Some(Low::new(halved, alignment.window.as_deref(), true));
                let (variance, correlation) = decimator.of_white_noise();
                alignment.correlation = correlation;
                plan.levels.push(Level { decimator, variance, alignment });
            }
        }
        Ok(plan)
    }

    /// The plan without that of lower rates.
    fn of_samples(n_samples: usize, rate_hz: f64, config: &EvaluatorConfig) -> Result<Self> {
        let EvaluatorConfig { data_decimation, frequency_decimation, band_hz, .. } = *config;
        let plan = spectrum_config(n_samples, rate_hz, config);
        let undecimated = data_decimation == 1 && frequency_decimation == 1 && band_hz.is_none();
        let exact_target = config.noise_ratio == 0.0;
        let window = config.window.coefficients(n_samples);
        let low = 1usize << (rate_hz / (2.0 * LOW_HZ)).clamp(1.0, 1e6).log2() as u32;
        let low = (undecimated && exact_target && low >= SHORTENING && n_samples >= 2 * low * low)
            .then(|| Grid::low(plan, low))
            .transpose()?
            .map(|grid| Low::new(grid, window.as_deref(), false));
        let kept = Grid::new(plan)?;
        let in_time = config.estimator == Estimator::LeastSquares && undecimated && exact_target;
        Ok(Self {
            estimator: config.estimator,
            n_samples,
            rate_hz,
            correlation: WHITE,
            correlation_in_bins: if in_time {
                WHITE
            } else {
                weighting::correlation(kept.cosines.iter().map(|c| (1.0, c)))
            },
            levels: Vec::new(),
            max_delay: config.max_delay_s * rate_hz,
            noise: config.noise,
            noise_ratio: config.noise_ratio,
            weight_power: config.weight_power,
            detrend: config.detrending(),
            moments: window.as_deref().map_or((0.0, 0.0), moments),
            window,
            search: Search::new(n_samples, rate_hz, config.max_delay_s),
            kept,
            low,
            in_time,
            arch: Arch::new(),
        })
    }

    pub(crate) fn state(&self) -> AlignmentState {
        let n = self.n_samples;
        let whitened = if self.noise == Noise::Coloured { self.longest_view() } else { 0 };
        let weighted = if self.noise_ratio > 0.0 { self.kept.spectrum.n_bins() } else { 0 };
        AlignmentState {
            search: self.search.state(),
            signals: Signals { measured: vec![0.0; n], shifted: vec![0.0; n], slope: vec![0.0; n] },
            bins: std::array::from_fn(|_| self.kept.spectrum.packed()),
            scratch: self.kept.spectrum.scratch(),
            low: self.low.as_ref().map(|low| LowState {
                scratch: low.grid.spectrum.scratch(),
                fewer: std::array::from_fn(|_| vec![0.0; n.div_ceil(low.grid.step)]),
            }),
            spread: SpreadState::new(self.kept.spectrum.n_bins()),
            whitened: std::array::from_fn(|_| vec![0.0; whitened]),
            whitened_residual: vec![0.0; n],
            weighting: Weighting {
                weights: vec![0.0; weighted],
                factors: vec![0.0; weighted],
                correlation: [0.0; NODES],
            },
            target_noise: 0.0,
            target_floor: 0.0,
            support: Support::default(),
            measured_noise: 0.0,
            decimated: std::array::from_fn(|_| {
                vec![0.0; self.levels.iter().map(|l| l.alignment.longest_view()).max().unwrap_or(0)]
            }),
            gaps: std::array::from_fn(|_| Vec::new()),
            levels: self.levels.iter().map(|l| l.alignment.state()).collect(),
        }
    }

    /// Gain and delay over a window.
    pub(crate) fn estimate(&self, state: &mut AlignmentState, judged: &Judged<'_>) -> Tracking {
        match self.determine(state, judged) {
            Ok(tracking) => tracking,
            Err(reason) => Tracking::undetermined(reason),
        }
    }

    /// The same without the samples around that are bad, which are looked for.
    pub(crate) fn estimate_examined(
        &self,
        state: &mut AlignmentState,
        examination: &mut Examination,
        judged: &Judged<'_>,
    ) -> Tracking {
        let about = |signals: [&[f64]; 2]| {
            let [target, measured] = signals;
            About::find(&self.search, &mut state.search, &View { target, measured, ..judged.view }, judged.start)
        };
        if !examination.examine([judged.view.target, judged.view.measured], about) {
            return self.estimate(state, judged);
        }
        let share = examination.share();
        let tracking = if share > MOST_BAD {
            Tracking::undetermined(Reason::BadSamples { share })
        } else {
            self.estimate(state, &Judged { view: examination.view(), ..*judged })
        };
        Tracking { bad_samples: examination.found(), ..tracking }
    }

    /// As the target is exact, or as its own noise demands.
    fn determine(&self, state: &mut AlignmentState, judged: &Judged<'_>) -> std::result::Result<Tracking, Reason> {
        state.target_noise = 0.0;
        let own = self.own(judged);
        let (target, measured) = (&judged.view.target[own.clone()], &judged.view.measured[own]);
        state.target_floor = floor::variance(target, 1) / floor::of_correlated(&self.correlation);
        if self.noise_ratio > 0.0 || self.noise == Noise::Coloured {
            return self.judge(state, judged);
        }
        let motion = Motion::of(target, state.target_floor);
        let high = motion.noise / motion.variance;
        if !(high > FAST_SHARE || motion.is_noisy()) {
            return self.judge(state, judged);
        }
        state.measured_noise = floor::variance(measured, 1) / floor::of_correlated(&self.correlation);
        let noisy = self.judge_noisy(state, judged, &motion);
        state.target_noise = 0.0;
        // Where noise leaves no number, what the target would give were it exact tells where to look.
        let Ok(about) = noisy.or_else(|_| self.judge(state, judged)) else { return noisy };
        let lag = about.delay_s * self.rate_hz;
        if floor::is_common(target, measured, lag, about.amplitude) {
            let found = noisy.unwrap_or(about);
            return Ok(found.without_interval(Reason::ColouredTargetNoise { share: high.min(1.0) }));
        }
        let followed = floor::followed(target, measured, lag, about.amplitude);
        if followed == 0.0 {
            return noisy;
        }
        // The highest frequencies are motion, as measured follows them; only what it does not follow is noise.
        let motion = Motion { noise: motion.noise * (1.0 - followed), ..motion };
        state.target_floor = motion.noise;
        let found =
            if motion.is_noisy() { self.judge_noisy(state, judged, &motion)? } else { self.judge(state, judged)? };
        let share = high * followed;
        // What is misread between samples follows the target as well; more than that has another cause.
        let without_cause = match found.reason {
            None => true,
            Some(Reason::ResidualFollowsTarget { .. }) => 1.0 - found.goodness < 2.0 * share,
            _ => false,
        };
        Ok(if share > FAST_SHARE && self.in_time && without_cause {
            found.without_interval(Reason::TooFast { share })
        } else {
            found
        })
    }

    /// Where the target has noise of its own: at the lowest rate that keeps its motion, so that noise above it is gone, and
    /// with what is left of the noise taken off the sums.
    fn judge_noisy(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        motion: &Motion,
    ) -> std::result::Result<Tracking, Reason> {
        let own = &judged.view.target[self.own(judged)];
        let most = self.levels.last().map_or(1, |l| l.decimator.factor());
        let slowest = motion.slowest(own, most);
        let level = self.levels.iter().rposition(|l| l.decimator.factor() <= slowest);
        let mut found = match level {
            Some(level) => self.judge_lower(state, judged, motion.noise, level),
            None => Err(Reason::TooShort { n_samples: 0 }),
        };
        // A lower rate's filter needs samples at both ends.
        if matches!(found, Err(Reason::TooShort { .. } | Reason::BadSamples { .. })) {
            state.target_noise = motion.noise;
            found = self.judge(state, judged);
        }
        found.map(|tracking| Tracking { target_noise_std: motion.noise.sqrt(), ..tracking })
    }

    /// The same at one of the lower rates; `noise` is the variance of the target's own.
    fn judge_lower(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        noise: f64,
        level: usize,
    ) -> std::result::Result<Tracking, Reason> {
        let Judged { view, start, expected, .. } = *judged;
        let Level { decimator, variance, alignment } = &self.levels[level];
        let (factor, delay) = (decimator.factor(), decimator.delay());
        // Of the samples at start + k factor, k from -margin on, those for which the filter is full.
        let margin = alignment.margin() as isize;
        let whole = |samples: isize, round: isize| (samples + round).div_euclid(factor as isize);
        let (origin, end) = (view.origin as isize - start as isize, view.end() as isize - start as isize);
        let first = whole(origin + delay as isize, factor as isize - 1).max(-margin);
        let last = whole(end - 1 - delay as isize, 0).min(alignment.n_samples as isize - 1 + margin);
        let n = (last - first + 1).max(0) as usize;
        let from = (first * factor as isize - origin - delay as isize) as usize;
        let [mut target, mut measured] = std::mem::take(&mut state.decimated);
        decimator.block(&view.target[from..], &mut target[..n]);
        decimator.block(&view.measured[from..], &mut measured[..n]);
        let mut gaps = std::mem::take(&mut state.gaps);
        for (gaps, of_samples) in gaps.iter_mut().zip(view.gaps) {
            gaps.clear();
            // All that the filter sees of a gap.
            let at = |index: usize, filter: isize, round: isize| {
                whole(index as isize - start as isize + filter, round) + margin
            };
            let seen = of_samples.iter().map(|gap| {
                at(gap.start, -(delay as isize), 0).max(0) as usize
                    ..(at(gap.end, delay as isize, factor as isize - 1) + 1).max(0) as usize
            });
            gaps.extend(seen.filter(|gap| !gap.is_empty()));
        }
        let view = View {
            target: &target[..n],
            measured: &measured[..n],
            origin: (first + margin) as usize,
            gaps: [&gaps[0], &gaps[1]],
        };
        let measured_noise = state.measured_noise * variance;
        let lower = &mut state.levels[level];
        lower.measured_noise = measured_noise;
        lower.target_noise = noise * variance;
        lower.target_floor = lower.target_noise;
        let judged = Judged::new(view, margin as usize, expected.map(|d| d / factor as f64));
        let found = alignment.judge(lower, &judged);
        state.decimated = [target, measured];
        state.gaps = gaps;
        found
    }

    /// Gain and delay with their precision; the state says how noisy the target is.
    fn judge(&self, state: &mut AlignmentState, judged: &Judged<'_>) -> std::result::Result<Tracking, Reason> {
        let Judged { view, start, expected, .. } = *judged;
        let peaks = self.search.peaks(&mut state.search, &view, start, expected)?;
        if self.noise_ratio > 0.0 {
            let judged = judged.in_bins();
            self.weigh_bins(state, &judged, peaks.first().lag);
            let first = self.best(state, &judged, &peaks)?;
            // Once more at a delay that leaves nothing but noise.
            self.weigh_bins(state, &judged, first.tau);
            let best = self.around(state, &judged, first.tau, peaks.step)?;
            return self.complete(state, &judged, &peaks, best);
        }
        let mut found = self.best(state, judged, &peaks);
        if found.is_err() && !self.in_time {
            // An offset that no bin holds may be all that the samples have in common.
            found = self.best(state, &judged.in_bins(), &peaks);
        }
        let limit = self.limit(&peaks);
        let at_the_end = peaks.first().lag.abs() + peaks.step as f64 > limit;
        let best = match found {
            Err(Reason::NoConvergence) if at_the_end => {
                return Err(Reason::BeyondMaxDelay { max_delay_s: limit / self.rate_hz });
            }
            found => found?,
        };
        if self.noise == Noise::Coloured {
            // Whitened by what the residual says of the noise, measured and target obey the same model.
            let goodness = Some(self.leave_residual(state, &best));
            let noise = self.autoregression(state);
            let p = noise.order;
            if p > 0 {
                let margin = self.margin();
                let from = start.saturating_sub(margin + p).max(view.origin);
                let to = (start + self.n_samples + margin).min(view.end());
                let part = from - view.origin..to - view.origin;
                let [mut first, mut second] = std::mem::take(&mut state.whitened);
                let n = part.len() - p;
                noise.whiten(&view.target[part.clone()], &mut first[..n]);
                noise.whiten(&view.measured[part], &mut second[..n]);
                let view = View { target: &first[..n], measured: &second[..n], origin: from + p, gaps: view.gaps };
                let judged = Judged { view, ..*judged };
                let found = self.around(state, &judged, best.tau, peaks.step).and_then(|best| {
                    // Whitening leaves less of the motion than of the noise; that says nothing of the tracking.
                    self.complete(state, &judged, &peaks, Fit { goodness, ..best })
                });
                state.whitened = [first, second];
                return found;
            }
            self.place_measured(state, judged);
        }
        self.complete(state, judged, &peaks, best)
    }

    /// From the least-squares delay over all frequencies to the estimator's own.
    fn complete(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        peaks: &Peaks,
        mut best: Fit,
    ) -> std::result::Result<Tracking, Reason> {
        if self.estimator == Estimator::Aligned {
            let tracking = self.align(state, judged, best)?;
            self.check_delay(tracking.delay_s * self.rate_hz, peaks)?;
            return Ok(tracking);
        }
        if !self.in_time && self.noise_ratio == 0.0 {
            // Other frequencies may have another delay: a part of a period away at most.
            let room = (0.2 * self.n_samples as f64 / peaks.cycles).min(self.search.reach() as f64).max(2.0);
            let (judged, goodness) = (judged.in_bins(), best.goodness);
            self.find_support(state, &judged, [best.tau - room, best.tau + room]);
            self.check_support(&state.support)?;
            self.place_answer(state, &judged);
            best = Fit { goodness, ..self.refine(state, &judged, best.tau, room)? };
        }
        if self.noise_ratio == 0.0 && best.noise_share > MOSTLY_NOISE {
            return Err(Reason::NoisyTarget { share: best.noise_share.min(1.0) });
        }
        self.check_delay(best.tau, peaks)?;
        let tracking = self.finish(state, &best, None);
        let share = self.most_target_noise(state, &best);
        Ok(if share > UNKNOWN_NOISE && tracking.reason.is_none() {
            tracking.without_interval(Reason::ColouredTargetNoise { share })
        } else {
            tracking
        })
    }

    /// The share of the target's energy, or of its velocity's, that is noise if all is that the residual shows: asked where it
    /// shows more than both channels' highest frequencies do, so that the noise is coloured. Else 0.
    fn most_target_noise(&self, state: &AlignmentState, fit: &Fit) -> f64 {
        if !(self.in_time && fit.noise > 0.0) {
            return 0.0;
        }
        let gain = fit.gain * fit.gain;
        let white = (state.measured_noise + gain * state.target_noise) * self.window_moments(&state.support.within).0;
        if fit.residual > COLOURED * white {
            (fit.noise_share * fit.residual / (gain * fit.noise)).min(1.0)
        } else {
            0.0
        }
    }

    /// The largest delay taken, in samples.
    fn limit(&self, peaks: &Peaks) -> f64 {
        self.max_delay.min(peaks.reach as f64)
    }

    fn check_delay(&self, tau: f64, peaks: &Peaks) -> std::result::Result<(), Reason> {
        let limit = self.limit(peaks);
        if tau.abs() > limit * (1.0 + 1e-9) {
            return Err(Reason::BeyondMaxDelay { max_delay_s: limit / self.rate_hz });
        }
        Ok(())
    }

    /// Learns, with the target shifted by `lag`, where its energy stands above its noise; what is below only adds noise.
    fn weigh_bins(&self, state: &mut AlignmentState, judged: &Judged<'_>, lag: f64) {
        self.find_support(state, judged, [lag - 1.0, lag + 1.0]);
        state.weighting.weights.fill(1.0);
        state.weighting.refresh(self.kept.correction.as_deref(), &self.kept.cosines);
        if state.support.range.len() < MIN_SUPPORT {
            return;
        }
        self.place_answer(state, judged);
        self.place_target(state, judged, lag);
        let products = self.products_in_bins(state);
        let ratio = TargetNoise::Ratio(&state.weighting.correlation, self.noise_ratio);
        let Some(score) = score(&products, lag, &ratio) else {
            return;
        };
        let (window_power, fourths) = self.window_moments(&state.support.within);
        let bins_per_piece = self.bins_per_piece(window_power, fourths);
        let AlignmentState { bins: [y, _, o], weighting, .. } = state;
        let mut energies = Energies {
            gain: score.gain,
            ratio: self.noise_ratio,
            first: self.kept.spectrum.first(),
            correction: self.kept.correction.as_deref(),
            energy: &mut weighting.weights,
            residual: &mut weighting.factors,
        };
        self.kept.spectrum.visit_pair([y, o], &mut energies);
        weighting.learn(cell_width(bins_per_piece), 1.0 / (self.noise_ratio.powi(-2) + score.gain * score.gain));
        weighting.refresh(self.kept.correction.as_deref(), &self.kept.cosines);
    }

    /// Kept bins for each that is independent.
    fn bins_per_piece(&self, window_power: f64, fourths: f64) -> f64 {
        (self.kept.spectrum.folded_len() as f64 * fourths / (window_power * window_power)).max(1.0)
    }

    /// Longest stretch of record that a window needs.
    fn longest_view(&self) -> usize {
        self.n_samples + 2 * self.margin() + MAX_ORDER
    }

    /// Samples on either side of a window that any look at the target may need.
    pub(crate) fn margin(&self) -> usize {
        2 * self.search.reach() + MAX_STEP + 2 * NODES
    }

    /// The best of the peaks, whose signals stand in the state afterwards; none where a turn out of reach fits far better.
    fn best(&self, state: &mut AlignmentState, judged: &Judged<'_>, found: &Peaks) -> std::result::Result<Fit, Reason> {
        let (fit, limit) = (self.best_within(state, judged, found)?, self.limit(found));
        let spacing = |p: &Peak| (p.lag - fit.tau).abs();
        let others = found.peaks().iter().map(spacing).filter(|distance| *distance > room(found.step));
        let period = match others.min_by(f64::total_cmp) {
            Some(period) => period,
            None if found.is_narrow() && fit.residual > LEFT_BY_A_TURN * fit.products.oo => {
                self.n_samples as f64 / found.cycles
            }
            None => return Ok(fit),
        };
        let turns = [fit.tau - period, fit.tau + period];
        let mut moved = false;
        for turn in turns.into_iter().filter(|turn| turn.abs() > limit) {
            moved = true;
            let room = room(found.step).max(0.2 * period);
            let (least, most) = (fit.tau.min(turn) - room - LOOKS, fit.tau.max(turn) + room + LOOKS);
            self.find_support(state, judged, [least, most]);
            if self.check_support(&state.support).is_err() {
                continue;
            }
            self.place_answer(state, judged);
            let Ok(here) = self.refine(state, judged, fit.tau, room) else { continue };
            let Ok(there) = self.refine(state, judged, turn, room) else { continue };
            self.place_residual(state, judged, &there);
            let freedom = independent(&state.signals.measured[state.support.within.clone()]);
            let floor = EXACT * here.products.oo;
            if 0.5 * freedom * (here.residual.max(floor) / there.residual.max(floor)).ln() > LOG_ODDS {
                return Err(Reason::BeyondMaxDelay { max_delay_s: limit / self.rate_hz });
            }
        }
        if moved { self.around(state, judged, fit.tau, found.step) } else { Ok(fit) }
    }

    /// Refines the peaks and takes the best, whose signals stand in the state afterwards.
    fn best_within(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        found: &Peaks,
    ) -> std::result::Result<Fit, Reason> {
        let (peaks, step, limit, expected) = (found.peaks(), found.step, self.limit(found), judged.expected);
        let distance = |lag: f64| expected.map_or(0.0, |expected| (lag - expected).abs());
        // One peak, or the highest is nearest to the expected delay: nothing to choose between.
        let is_nearest = expected.is_some() && peaks.iter().all(|p| distance(p.lag) >= distance(found.first().lag));
        if peaks.len() == 1 || is_nearest {
            return self.around(state, judged, found.first().lag, step);
        }
        let room = room(step);
        let lags = || peaks.iter().map(|p| p.lag);
        let (least, most) = (lags().fold(f64::INFINITY, f64::min), lags().fold(f64::NEG_INFINITY, f64::max));
        // All are judged on the same samples.
        self.place_around(state, judged, [least, most], step)?;
        let mut turns = Turns::default();
        for (i, peak) in peaks.iter().enumerate() {
            let fit = self.refine(state, judged, peak.lag, room);
            let fit = fit.ok().filter(|f| f.tau.abs() <= limit * (1.0 + 1e-9));
            // Two peaks may lead to one place.
            turns.fits[i] = fit.filter(|f| !turns.within().any(|other| (other.tau - f.tau).abs() <= 1.0));
        }
        let Some(best) = turns.within().copied().min_by(|a, b| a.residual.total_cmp(&b.residual)) else {
            return Err(Reason::NoConvergence);
        };
        let mut chosen = self.keep_equal(state, judged, &mut turns, best);
        if expected.is_some() {
            let nearer = |c: Fit, f: &Fit| if distance(f.tau) < distance(c.tau) { *f } else { c };
            chosen = turns.within().fold(chosen, nearer);
        } else if let Some(neighbours) = turns.neighbours() {
            let [delay_s, other_s] = neighbours.map(|tau| tau / self.rate_hz);
            return Err(Reason::Ambiguous { delay_s, other_s });
        }
        self.around(state, judged, chosen.tau, step)
    }

    /// The fit nearest to `lag`, whose signals stand in the state afterwards.
    fn around(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        lag: f64,
        step: usize,
    ) -> std::result::Result<Fit, Reason> {
        let found = self.around_once(state, judged, lag, step)?;
        if !judged.view.has_gaps() {
            return Ok(found);
        }
        // Near the delay fewer samples are compared with gaps of target.
        self.around_once(state, judged, found.tau, 0)
    }

    fn around_once(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        lag: f64,
        step: usize,
    ) -> std::result::Result<Fit, Reason> {
        self.place_around(state, judged, [lag, lag], step)?;
        self.refine(state, judged, lag, room(step))
    }

    /// Places measured on the support of a search from `least` to `most`.
    fn place_around(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        [least, most]: [f64; 2],
        step: usize,
    ) -> std::result::Result<(), Reason> {
        let room = room(step) + LOOKS;
        self.find_support(state, judged, [least - room, most + room]);
        self.check_support(&state.support)?;
        self.place_answer(state, judged);
        Ok(())
    }

    /// Keeps of `turns` those that fit as well as the likeliest, which is returned: whose likelihood is not below its by
    /// exp([`LOG_ODDS`]). `least` has the least residual.
    ///
    /// With the noise whitened by an autoregression of the likeliest one's residual, D = sum e^2 - sum e_best^2, the odds are
    /// exp(n/2 log(sum e^2 / sum e_best^2)), or the least of exp(D^2 / 2 V) with
    ///
    /// ```text
    /// V = sum e_best^2 (e - e_best)^2             where noise that changes makes it larger than steady noise does
    /// V = sum over parts (sum e_best (e - e_best))^2    likewise where noise goes on alike, as a line beside a tone does
    /// V = sum (e^2 - e_best^2)^2                  where the target has noise: e - e_best holds it at both delays (Vuong, 1989;
    ///                                             times TAILS)
    /// ```
    ///
    /// Over bins, their number and the residual's correlation tell how many samples n are independent, and a noisy target gives
    /// V = 8 (sum e_best^2)^2 / n.
    fn keep_equal(&self, state: &mut AlignmentState, judged: &Judged<'_>, turns: &mut Turns, least: Fit) -> Fit {
        let within = state.support.within.clone();
        let floor = EXACT * least.products.oo;
        let white = |freedom: f64, f: &Fit| 0.5 * freedom * (f.residual.max(floor) / least.residual.max(floor)).ln();
        let (weight, fourths) = self.window_moments(&within);
        let n = within.len();
        let of_target = least.gain * least.gain * state.target_floor * weight;
        let below = |excess: f64, variance: f64| 0.5 * excess * excess / variance < LOG_ODDS;
        if judged.in_bins && self.noise_ratio == 0.0 {
            self.place_residual(state, judged, &least);
            let residual = &state.signals.measured[within];
            let noisy_target = of_target * n as f64 > sums::energy(residual);
            let of_bins = 2.0 * self.kept.spectrum.n_bins() as f64 / self.bins_per_piece(weight, fourths);
            let freedom = independent(residual).min(of_bins);
            let all = least.residual.max(floor);
            let variance = TAILS * 8.0 * all * all / freedom;
            turns.retain(|f| {
                white(freedom, f) < LOG_ODDS || (noisy_target && below(f.residual.max(floor) - all, variance))
            });
            return least;
        }
        let noisy_target = self.noise_ratio > 0.0 || of_target * n as f64 > least.residual;
        turns.retain(|f| white(weight, f) < CLEAR_ODDS);
        let mut whitened = std::mem::take(&mut state.whitened_residual);
        let mut best = least;
        // What is least when every sample weighs alike need not be the likeliest in coloured noise.
        for _ in 0..MAX_REFERENCES {
            self.place_residual(state, judged, &best);
            let noise = self.autoregression(state);
            whitened[..n].copy_from_slice(&state.signals.measured[within.clone()]);
            noise.whiten_in_place(&mut whitened[..n]);
            let all = sums::energy(&whitened[..n]).max(floor);
            let (mut likelier, mut most) = (None, -LEAST_GAIN * all / weight);
            let mut equal = Turns { fits: turns.fits };
            equal.retain(|f| {
                if f.tau == best.tau {
                    return true;
                }
                self.place_residual(state, judged, f);
                let other = &mut state.signals.measured[within.clone()];
                noise.whiten_in_place(other);
                let odds = Odds::of(other, &whitened[..n]);
                if odds.excess < most {
                    (likelier, most) = (Some(*f), odds.excess);
                }
                let excess = odds.excess.max(0.0);
                let steady = 0.5 * weight * ((all + excess) / all).ln();
                let of_steady = all / weight * odds.distance;
                let varying = odds.variance > UNSTEADY * of_steady;
                let alike = odds.variance_of_parts > UNLIKELY * of_steady;
                steady < LOG_ODDS
                    || (varying && below(excess, odds.variance))
                    || (alike && below(excess, odds.variance_of_parts))
                    || (noisy_target && below(excess, TAILS * odds.variance_of_terms))
            });
            match likelier {
                Some(fit) => best = fit,
                None => {
                    *turns = equal;
                    break;
                }
            }
        }
        state.whitened_residual = whitened;
        best
    }

    /// What a fit leaves of measured, in measured's place.
    fn place_residual(&self, state: &mut AlignmentState, judged: &Judged<'_>, fit: &Fit) {
        self.place_measured(state, judged);
        self.place_target(state, judged, fit.tau);
        self.leave_residual(state, &Fit { step: 0.0, ..*fit });
    }

    /// The window's own samples in the view.
    fn own(&self, judged: &Judged<'_>) -> Range<usize> {
        let from = judged.start - judged.view.origin;
        from..from + self.n_samples
    }

    /// The samples of the window for which the target is known at all delays from `least` to `most`, in samples.
    fn known(&self, judged: &Judged<'_>, [least, most]: [f64; 2]) -> Range<usize> {
        let before = (most.ceil() + (BEFORE + 1) as f64).max(0.0) as usize;
        let after = ((-least).ceil() + (AFTER + 1) as f64).max(0.0) as usize;
        let from = judged.start.max(judged.view.origin + before);
        let to = (judged.start + self.n_samples).min(judged.view.end().saturating_sub(after));
        from..to.max(from)
    }

    /// The same less the bad ones become the support, until it is asked for other delays.
    fn find_support(&self, state: &mut AlignmentState, judged: &Judged<'_>, delays: [f64; 2]) {
        state.support.settle(self.known(judged, delays), judged, delays);
    }

    fn check_support(&self, support: &Support) -> std::result::Result<(), Reason> {
        let n = support.range.len();
        if n < MIN_SUPPORT || 2 * n < self.n_samples {
            return Err(Reason::TooShort { n_samples: n });
        }
        let left = n - support.n_lost;
        if left < MIN_SUPPORT || 2 * left < n {
            return Err(Reason::BadSamples { share: support.n_lost as f64 / n as f64 });
        }
        Ok(())
    }

    /// Places measured, and transforms it where sums over bins are asked for.
    fn place_answer(&self, state: &mut AlignmentState, judged: &Judged<'_>) {
        self.place_measured(state, judged);
        if judged.in_bins {
            let AlignmentState { signals, bins, scratch, .. } = state;
            self.kept.spectrum.transform_one(scratch, &signals.measured, None, &mut bins[MEASURED]);
        }
    }

    /// Newton's steps from `tau`, at most `room` samples away from it, on sums over samples or over the kept bins; measured
    /// stands in the state.
    fn refine(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        tau: f64,
        room: f64,
    ) -> std::result::Result<Fit, Reason> {
        let (low, high) = (tau - room, tau + room);
        let known = if state.target_noise > 0.0 {
            state.target_noise * self.window_moments(&state.support.within).0
        } else {
            0.0
        };
        // Where the score is known to be positive (the delay is larger) and negative.
        let (mut below, mut above) = (low, high);
        let mut now = tau;
        let mut last: Option<(f64, f64)> = None;
        for _ in 0..MAX_STEPS {
            self.place_target(state, judged, now);
            let products = if judged.in_bins { self.products_in_bins(state) } else { self.products_in_time(state) };
            let noise = match (judged.in_bins, known > 0.0) {
                _ if self.noise_ratio > 0.0 => TargetNoise::Ratio(&state.weighting.correlation, self.noise_ratio),
                (_, false) => TargetNoise::None,
                (false, true) => TargetNoise::Known(&self.correlation, known),
                (true, true) => {
                    TargetNoise::Known(&self.correlation_in_bins, known * self.kept.spectrum.n_bins() as f64)
                }
            };
            let Some(score) = score(&products, now, &noise) else {
                return Err(Reason::NoConvergence);
            };
            if score.value > 0.0 {
                below = now
            } else {
                above = now
            }
            // The secant through the last two places, where it is of the size that the model predicts.
            let (mut slope, mut last_step) = (score.slope, LAST_STEP);
            if let Some((tau, value)) = last
                && (now - tau).abs() > 1e-3
            {
                let secant = (value - score.value) / (now - tau);
                if secant > 0.02 * slope && secant < 4.0 * slope {
                    (slope, last_step) = (secant, LAST_SECANT_STEP);
                }
            }
            let step = score.value / slope;
            if step.abs() >= last_step && above - below < LAST_STEP && (now - low).min(high - now) < 2.0 * LAST_STEP {
                // Driven against the end of where it may look: what it seeks lies beyond.
                return Err(Reason::NoConvergence);
            }
            if step.abs() < last_step || above - below < LAST_STEP {
                let step = step.clamp(-last_step, last_step);
                let Products { yy, yv, vv, oy, ov, oo } = products;
                // The target is y - step y' at the delay found, and the best gain moves with it.
                let (along, energy) = (oy - step * ov, yy - 2.0 * step * yv + step * step * vv);
                let gain = score.gain * along / oy * (yy - score.own) / (energy - score.own);
                return Ok(Fit {
                    tau: now + step,
                    step,
                    gain,
                    products,
                    clean: score.clean,
                    noise: score.own,
                    noise_share: score.share,
                    residual: (oo - 2.0 * gain * along + gain * gain * energy).max(0.0),
                    goodness: None,
                });
            }
            last = Some((now, score.value));
            let next = now + step;
            now = if next > below && next < above { next } else { 0.5 * (below + above) };
        }
        Err(Reason::NoConvergence)
    }

    /// Measured over the judged samples, detrended and windowed.
    fn place_measured(&self, state: &mut AlignmentState, judged: &Judged<'_>) {
        let AlignmentState { signals: Signals { measured, .. }, support, .. } = state;
        clear_around(measured, &support.within);
        let from = support.range.start - judged.view.origin;
        for (kept, to) in support.kept() {
            measured[to].copy_from_slice(&judged.view.measured[from + kept.start..from + kept.end]);
        }
        self.condition(measured, &support.within);
    }

    /// The target shifted by `tau` samples and its slope, treated as measured was.
    fn place_target(&self, state: &mut AlignmentState, judged: &Judged<'_>, tau: f64) {
        let (whole, fraction) = fraction(tau);
        let AlignmentState { signals: Signals { shifted, slope, .. }, support, .. } = state;
        let from = (support.range.start - judged.view.origin + NODES).saturating_add_signed(whole) - NODES - BEFORE;
        for signal in [&mut *shifted, &mut *slope] {
            clear_around(signal, &support.within);
        }
        let taps = Taps::at(fraction);
        for (kept, to) in support.kept() {
            self.arch.dispatch(Shift {
                taps: &taps,
                samples: &judged.view.target[from + kept.start..from + kept.end + NODES - 1],
                value: &mut shifted[to.clone()],
                slope: &mut slope[to],
            });
        }
        self.condition(shifted, &support.within);
        self.condition(slope, &support.within);
    }

    fn products_in_time(&self, state: &AlignmentState) -> Products {
        let within = state.support.within.clone();
        let Signals { measured, shifted, slope } = &state.signals;
        self.arch.dispatch(Multiply {
            shifted: &shifted[within.clone()],
            slope: &slope[within.clone()],
            measured: &measured[within],
        })
    }

    fn products_in_bins(&self, state: &mut AlignmentState) -> Products {
        let AlignmentState { signals, bins: [y, v, o], scratch, weighting, .. } = state;
        let correction = self.factors(weighting);
        self.kept.spectrum.transform_one(scratch, &signals.shifted, None, y);
        self.kept.spectrum.transform_one(scratch, &signals.slope, None, v);
        let pair = |a: &[Complex<f64>], b: &[Complex<f64>]| {
            let mut cross = Cross { correction, first: self.kept.spectrum.first(), ..Cross::default() };
            self.kept.spectrum.visit_pair([a, b], &mut cross);
            cross.totals()
        };
        let ((yy, yv, vv), (_, oy, oo), (_, ov, _)) = (pair(y, v), pair(y, o), pair(v, o));
        Products { yy, yv, vv, oy, ov, oo }
    }

    /// What the bins are multiplied with before they are summed.
    fn factors<'a>(&'a self, weighting: &'a Weighting) -> Option<&'a [f64]> {
        if self.noise_ratio > 0.0 { Some(&weighting.factors) } else { self.kept.correction.as_deref() }
    }

    /// Detrends and windows `signal` over `within`.
    fn condition(&self, signal: &mut [f64], within: &Range<usize>) {
        let samples = &mut signal[within.clone()];
        if let Some(line) = self.detrend.line(samples) {
            line.subtract_from(samples);
        }
        if let Some(window) = &self.window {
            sums::multiply(samples, &window[within.clone()]);
        }
    }

    /// sum w^2 and sum w^4 over the judged samples.
    fn window_moments(&self, within: &Range<usize>) -> (f64, f64) {
        match &self.window {
            None => (within.len() as f64, within.len() as f64),
            Some(_) if within.len() == self.n_samples => self.moments,
            Some(window) => moments(&window[within.clone()]),
        }
    }

    /// Iterates Eq 12 on the shifted target until its phase vanishes, from the least-squares delay.
    fn align(
        &self,
        state: &mut AlignmentState,
        judged: &Judged<'_>,
        mut fit: Fit,
    ) -> std::result::Result<Tracking, Reason> {
        let from = fit.tau;
        let mut slope = f64::NAN;
        let mut last: Option<(f64, f64)> = None;
        // Re sum Y' conj Y / sum |Y|^2, by Parseval: how the amplitude changes with the delay.
        let growth = fit.clean.yv / fit.clean.yy;
        // Noise on the target adds to sum |Y|^2 alone.
        let all = 2 * self.kept.spectrum.n_bins() == self.kept.spectrum.folded_len() && self.weight_power == 2;
        let clean = if all { fit.clean.yy / fit.products.yy } else { 1.0 };
        self.kept.spectrum.transform_one(&mut state.scratch, &state.signals.measured, None, &mut state.bins[MEASURED]);
        for _ in 0..MAX_STEPS {
            let tau = fit.tau;
            let known = self.known(judged, [tau, tau]);
            if state.support.range.start < known.start || known.end < state.support.range.end {
                self.find_support(state, judged, [tau - 1.0, tau + 1.0]);
                self.check_support(&state.support)?;
                self.place_answer(state, &judged.in_bins());
            }
            self.place_target(state, judged, tau);
            let AlignmentState { signals, bins: [y, v, o], scratch, .. } = &mut *state;
            self.kept.spectrum.transform_one(scratch, &signals.shifted, None, y);
            let sums = |a: &[Complex<f64>], b: &[Complex<f64>]| {
                weigh(&self.kept.spectrum, self.kept.correction.as_deref(), self.weight_power, [a, b])
            };
            let found = sums(y, o);
            let fei = found.cross / found.power;
            let equivalent_frequency_hz = found.moment / found.power * self.kept.spectrum.delta_f_hz();
            let per_sample = equivalent_frequency_hz / self.rate_hz;
            let phase = fei.arg();
            // A slope that is known to the second order makes a longer step the last.
            let mut last_step = LAST_STEP;
            match last {
                Some((before, value)) => {
                    let secant = (phase - value) / (tau - before);
                    if secant > 0.2 * slope && secant < 5.0 * slope {
                        slope = secant;
                    }
                }
                None => {
                    slope = 2.0 * std::f64::consts::PI * per_sample;
                    let settled = phase.abs() < SETTLED * slope;
                    if self.weight_power == 2 && !settled {
                        // y moves by -y' a sample: d arg(sum O conj Y) = -Im(sum O conj Y' / sum O conj Y). Where the window
                        // cuts much off the motion it is far from 2 pi f_eq.
                        self.kept.spectrum.transform_one(scratch, &signals.slope, None, v);
                        let exact = -(sums(v, o).cross / found.cross).im;
                        if exact <= 0.0 {
                            return Err(Reason::NoConvergence);
                        }
                        slope = exact;
                        last_step = LAST_SECANT_STEP;
                    }
                }
            }
            let step = -phase / slope;
            if !step.is_finite() || (tau + step - from).abs() * per_sample > 0.25 {
                return Err(Reason::NoConvergence);
            }
            if step.abs() < last_step {
                fit = Fit { tau: tau + step, step, gain: fei.norm() / clean * (1.0 + growth * step), ..fit };
                let averaged = Averaged { equivalent_frequency_hz, power: found.power, slope, growth };
                let mut tracking = self.finish(state, &fit, Some(averaged));
                if self.weight_power != 2 && tracking.reason.is_none() {
                    tracking = tracking.without_interval(Reason::WeightPower);
                }
                return Ok(tracking);
            }
            last = Some((tau, phase));
            fit.tau = tau + step;
        }
        Err(Reason::NoConvergence)
    }

    /// The delay of the whole record, in samples, as far as it can be told: of the only peak of the correlation, or of the one
    /// that fits better than all others.
    pub(crate) fn expected(view: &View<'_>, config: &EvaluatorConfig, rate_hz: f64) -> Option<f64> {
        let n = view.target.len();
        let search = Search::new(n, rate_hz, config.max_delay_s);
        let peaks = search.peaks(&mut search.state(), view, 0, None).ok()?;
        if let [only] = peaks.peaks() {
            return Some(only.lag);
        }
        let config = EvaluatorConfig { max_delay_s: config.max_delay_s, ..EvaluatorConfig::default() };
        let whole = Self::new(n, rate_hz, &config).ok()?;
        let mut state = whole.state();
        let best = whole.best(&mut state, &Judged::new(*view, 0, None), &peaks);
        best.ok().map(|fit| fit.tau)
    }
}

/// What the precision of a weighted average depends on.
#[derive(Debug, Clone, Copy)]
struct Averaged {
    equivalent_frequency_hz: f64,
    /// sum |Y|^2 over the bins.
    power: f64,
    /// Of the phase over the delay, in radians a sample.
    slope: f64,
    /// Of log A over the delay, a sample.
    growth: f64,
}

/// What is known of the noise on the target.
enum TargetNoise<'a> {
    None,
    /// How it correlates between samples, and its energy in the products.
    Known(&'a [f64; NODES], f64),
    /// The same, and its standard deviation over that of the noise on measured.
    Ratio(&'a [f64; NODES], f64),
}

/// A score and what goes with it.
struct Score {
    value: f64,
    slope: f64,
    gain: f64,
    clean: Products,
    /// The energy of the target's own noise in yy.
    own: f64,
    /// Its share of yy or vv, whichever is larger.
    share: f64,
}

/// The derivative of the objective with respect to the delay, up to a positive factor, at `tau` and the best gain.
fn score(p: &Products, tau: f64, target_noise: &TargetNoise<'_>) -> Option<Score> {
    let at = fraction(tau).1;
    let correlate = |correlation: &[f64; NODES], a: &[f64; NODES], b: &[f64; NODES]| -> f64 {
        let terms = (0..NODES).flat_map(|i| (0..NODES).map(move |j| (i, j)));
        terms.map(|(i, j)| a[i] * b[j] * correlation[i.abs_diff(j)]).sum()
    };
    let mut clean = *p;
    let (gain, noise, known) = match *target_noise {
        TargetNoise::None => (p.oy / p.yy, 0.0, None),
        TargetNoise::Known(correlation, noise) => {
            let taps = Taps::at(at);
            let own = noise * correlate(correlation, &taps.value, &taps.value);
            (p.oy / (p.yy - own), noise, Some((correlation, taps)))
        }
        TargetNoise::Ratio(correlation, ratio) => {
            let taps = Taps::at(at);
            // Noise variances of measured over target; what interpolation leaves of the latter.
            let lambda = 1.0 / (ratio * ratio);
            let g = correlate(correlation, &taps.value, &taps.value);
            let difference = p.yy * lambda - g * p.oo;
            // The positive root of g oy K^2 + (lambda yy - g oo) K - lambda oy = 0.
            let root = (difference * difference + 4.0 * g * lambda * p.oy * p.oy).sqrt();
            let gain = if difference > 0.0 {
                2.0 * lambda * p.oy / (difference + root)
            } else {
                (root - difference) / (2.0 * g * p.oy)
            };
            let residual = p.oo - 2.0 * gain * p.oy + gain * gain * p.yy;
            (gain, residual.max(0.0) / (lambda + gain * gain * g), Some((correlation, taps)))
        }
    };
    let (mut own, mut share) = (0.0, 0.0);
    if let Some((correlation, taps)) = known
        && noise > 0.0
    {
        own = noise * correlate(correlation, &taps.value, &taps.value);
        clean.yy -= own;
        // Interpolated noise is smaller between samples than on them; the objective does not reward that.
        clean.yv -= noise * correlate(correlation, &taps.value, &taps.slope);
        clean.vv -= noise * correlate(correlation, &taps.slope, &taps.slope);
        share = 1.0 - (clean.yy / p.yy).min(clean.vv / p.vv);
        if clean.vv * clean.yy <= clean.yv * clean.yv {
            clean.vv = p.vv;
        }
    }
    // d/dtau of -|o - K y|^2 / 2 is -K <o - K y, y'>: with y' the slope in time, a delay larger than tau makes it positive.
    let value = gain * clean.yv - p.ov;
    let slope = gain * (clean.vv - clean.yv * clean.yv / clean.yy);
    let usable = gain > 0.0 && slope > 0.0 && slope.is_finite() && value.is_finite();
    usable.then_some(Score { value, slope, gain, clean, own, share })
}

/// The bins that a configuration keeps. What it does to the samples is done here, over those that are judged.
fn spectrum_config(n_samples: usize, rate_hz: f64, config: &EvaluatorConfig) -> SpectrumConfig {
    let EvaluatorConfig { data_decimation, frequency_decimation, band_hz, .. } = *config;
    let (window, detrend) = (Window::Boxcar, Detrend::None);
    SpectrumConfig { n_samples, rate_hz, data_decimation, frequency_decimation, window, detrend, band_hz }
}

/// How a target moves in a window, and the noise that is its own.
#[derive(Debug, Clone, Copy)]
struct Motion {
    n: f64,
    /// Of the noise, a sample.
    noise: f64,
    /// Of the samples about their mean, and of the steps from one to the next, less what noise adds.
    variance: f64,
    steps: f64,
}

impl Motion {
    fn of(target: &[f64], noise: f64) -> Self {
        let n = target.len() as f64;
        let variance = sums::spread(target, sums::sum(target) / n) / n - noise;
        Self { n, noise, variance: variance.max(0.0), steps: (sums::step_energy(target) / n - 2.0 * noise).max(0.0) }
    }

    /// Whether the noise's bias counts beside the standard deviation that as much noise on measured gives. Of the delay:
    /// sigma^2 max(sum h h') / V over sqrt(2) sigma / sqrt(n V), V the mean square of a step; of the gain alike.
    fn is_noisy(&self) -> bool {
        const PULL: f64 = 0.25;
        let per_std = (self.noise * self.n).sqrt();
        per_std * PULL > NOISY_SHARE * self.steps.sqrt() || per_std * 0.7 > NOISY_SHARE * self.variance.sqrt()
    }

    /// The largest power of two, up to `most`, of which the rate over eight times it lies above all that counts: what holds a
    /// hundredth of the energy of velocity, and stands out of the noise.
    fn slowest(&self, target: &[f64], most: usize) -> usize {
        // The differences of samples s apart are largest at the rate over 2 s, five times what white noise of that energy gives.
        let (mut speeds, mut total, mut n) = ([0.0; MAX_SCALES], 0.0, 0);
        for (k, speed) in speeds.iter_mut().enumerate() {
            let scale = 2 << k;
            if 16 * scale > target.len() {
                break;
            }
            let (found, samples) = floor::sampled_variance(target, scale);
            let chance = 3.0 * self.noise * (2.0 / samples).sqrt();
            let excess = if found - self.noise > chance { found - self.noise } else { 0.0 };
            *speed = (std::f64::consts::PI / scale as f64).powi(2) * excess / 5.0;
            total += *speed;
            n = k + 1;
        }
        // A factor P needs the scales up to 4 P to hold nothing.
        let mut factor = 1;
        let mut above = speeds[0];
        for k in 1..n {
            above += speeds[k];
            if above > SLOW_SHARE * total || 2 * factor > most {
                break;
            }
            if k >= 2 {
                factor *= 2;
            }
        }
        factor
    }
}

/// How far from a peak of a search by steps of so many samples its place is looked for.
fn room(step: usize) -> f64 {
    step as f64 + 2.0
}

/// The sample that precedes t - tau, relative to t, and the way to the next.
fn fraction(tau: f64) -> (isize, f64) {
    let whole = (-tau).floor();
    (whole as isize, -tau - whole)
}

/// sum w^2 and sum w^4
fn moments(window: &[f64]) -> (f64, f64) {
    (sums::energy(window), sums::fourths(window))
}

/// Zeroes what lies outside `within`.
fn clear_around(signal: &mut [f64], within: &Range<usize>) {
    signal[..within.start].fill(0.0);
    signal[within.end..].fill(0.0);
}

/// Independent samples among coloured ones, by the correlation of neighbours.
fn independent(samples: &[f64]) -> f64 {
    let squares: f64 = samples.iter().map(|v| v * v).sum();
    let products: f64 = samples.windows(2).map(|w| w[0] * w[1]).sum();
    let r = if squares > 0.0 { (products / squares).clamp(-0.9999, 0.9999) } else { 0.0 };
    samples.len() as f64 * (1.0 - r * r) / (1.0 + r * r)
}

/// [`Taps::apply`] compiled for the processor at hand.
struct Shift<'a> {
    taps: &'a Taps,
    samples: &'a [f64],
    value: &'a mut [f64],
    slope: &'a mut [f64],
}

impl WithSimd for Shift<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.taps.apply(simd, self.samples, self.value, self.slope);
    }
}
