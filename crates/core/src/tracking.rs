//! Eqs 6 to 12: one complex number for the whole record.

use std::f64::consts::PI;
use std::sync::OnceLock;

use num_complex::Complex;

use crate::alignment::{Alignment, AlignmentState};
use crate::bad_samples::{BadFound, BadSamples, Examination};
use crate::decimate::{Chebyshev, Decimator, Stream};
use crate::error::{Error, Result, Signal};
use crate::lag::View;
use crate::pair::{Pair, check_rate, peak};
use crate::reason::Reason;
use crate::spectrum::{Bins, LANES, Layout, Sink, Spectrum, SpectrumConfig, SpectrumState};
use crate::window::{Detrend, Window};

/// Highest weight power taken.
pub const MAX_WEIGHT_POWER: u32 = 16;

/// How gain and delay are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Estimator {
    /// The published weighted average, Eq 12.
    #[default]
    Fei,
    /// Eq 12 on the target shifted by the delay, until no phase is left: no bias of windows, of drift or of averaged phases.
    Aligned,
    /// One gain and one delay by least squares on the shifted target: as precise as the noise allows.
    LeastSquares,
}

impl Estimator {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Estimator); 3] =
        [("fei", Estimator::Fei), ("aligned", Estimator::Aligned), ("least_squares", Estimator::LeastSquares)];

    fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, e)| *e == self).map_or("", |(name, _)| name)
    }

    /// For what is made of the sums of Eq 12 themselves; others need `needed`.
    pub(crate) fn must_be_published(self, needed: &str) -> Result<()> {
        if self == Estimator::Fei {
            return Ok(());
        }
        Err(Error::Combination { name: "estimator", value: self.name().to_owned(), needed: needed.to_owned() })
    }
}

/// What least squares takes the noise on measured for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Noise {
    /// Every sample weighs alike; the standard errors are those of the noise that is found, white or not.
    #[default]
    White,
    /// Both signals are whitened by an autoregression of the first fit's residual, and fitted again.
    Coloured,
}

impl Noise {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Noise); 2] = [("white", Noise::White), ("coloured", Noise::Coloured)];
}

/// The user's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluatorConfig {
    /// How gain and delay are estimated.
    pub estimator: Estimator,
    /// P, a power of two: keeps the frequencies up to rate / (2 P).
    pub data_decimation: usize,
    /// Q, a power of two: keeps every Q-th bin.
    pub frequency_decimation: usize,
    /// How P is carried out.
    pub decimator: Decimator,
    /// l of Eqs 7 and 12, 1 to 16: bins are weighted by |I|^l.
    pub weight_power: u32,
    /// Window over the record.
    pub window: Window,
    /// What is subtracted before the window.
    pub detrend: Detrend,
    /// Lowest and highest frequency kept, both included, in hertz.
    pub band_hz: Option<(f64, f64)>,
    /// Largest delay or lead looked for by the estimators that shift the target, in seconds; where the record does not go on beyond
    /// what is judged, a quarter of that at most.
    pub max_delay_s: f64,
    /// Of delays that fit equally well (turns of a motion that is one tone, or nearly), the estimators that shift the target take
    /// the one nearest to this, in seconds; without it the answer is "ambiguous".
    pub expected_delay_s: Option<f64>,
    /// What least squares takes the noise on measured for.
    pub noise: Noise,
    /// Standard deviation of the noise on target over that on measured; above zero, least squares is total least squares.
    pub noise_ratio: f64,
    /// What the estimators that shift the target do with samples that are no motion.
    pub bad_samples: BadSamples,
}

impl Default for EvaluatorConfig {
    fn default() -> Self {
        Self {
            estimator: Estimator::Fei,
            data_decimation: 1,
            frequency_decimation: 1,
            decimator: Decimator::Spectral,
            weight_power: 2,
            window: Window::Boxcar,
            detrend: Detrend::None,
            band_hz: None,
            max_delay_s: 0.25,
            expected_delay_s: None,
            noise: Noise::White,
            noise_ratio: 0.0,
            bad_samples: BadSamples::LeaveOut,
        }
    }
}

impl EvaluatorConfig {
    /// What can be said of the settings without a record.
    fn check(&self) -> Result<()> {
        if !(1..=MAX_WEIGHT_POWER).contains(&self.weight_power) {
            return Err(Error::WeightPower { found: self.weight_power });
        }
        if !(self.max_delay_s.is_finite() && self.max_delay_s > 0.0) {
            let expected = "a positive duration in seconds".to_owned();
            return Err(Error::Setting { name: "max_delay_s", expected, found: self.max_delay_s });
        }
        check_expected_delay(self.expected_delay_s, self.max_delay_s)?;
        if !(self.noise_ratio.is_finite() && self.noise_ratio >= 0.0) {
            let expected = "zero or a positive number".to_owned();
            return Err(Error::Setting { name: "noise_ratio", expected, found: self.noise_ratio });
        }
        let least_squares = self.estimator == Estimator::LeastSquares;
        let needs = |name, value: &str, needed: &str| {
            Err(Error::Combination { name, value: value.to_owned(), needed: needed.to_owned() })
        };
        if let Some(expected) = self.expected_delay_s
            && self.estimator == Estimator::Fei
        {
            return needs("expected_delay_s", &expected.to_string(), "estimator aligned or least_squares");
        }
        if self.noise_ratio > 0.0 && !least_squares {
            return needs("noise_ratio", &self.noise_ratio.to_string(), "estimator least_squares");
        }
        if self.noise == Noise::Coloured && !least_squares {
            return needs("noise", "coloured", "estimator least_squares");
        }
        if self.noise == Noise::Coloured && self.noise_ratio > 0.0 {
            return needs("noise", "coloured", "noise_ratio 0");
        }
        if least_squares && self.weight_power != 2 {
            return needs("weight_power", &self.weight_power.to_string(), "estimator fei or aligned");
        }
        if self.estimator != Estimator::Fei && self.decimator == Decimator::Chebyshev && self.data_decimation != 1 {
            return needs("decimator", "chebyshev", "estimator fei");
        }
        Ok(())
    }
}

/// Refuses a delay that is not looked for.
pub(crate) fn check_expected_delay(expected_delay_s: Option<f64>, max_delay_s: f64) -> Result<()> {
    match expected_delay_s {
        Some(found) if found.is_nan() || found.abs() > max_delay_s => {
            let expected = format!("at most max_delay_s, {max_delay_s} s, either way");
            Err(Error::Setting { name: "expected_delay_s", expected, found })
        }
        _ => Ok(()),
    }
}

/// Amplitude and delay of measured over target.
///
/// `fei` gives neither standard deviations nor intervals: its error is mostly bias. What could not be determined is NaN, and
/// `reason` says why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// sum O conj(I) |I|^(l-2) / sum |I|^l (Eq 12 without its quotient); A exp(j phi) of the other estimators.
    pub fei: Complex<f64>,
    /// A = |FEI| (Eq 11a); 1 is perfect.
    pub amplitude: f64,
    /// phi = atan2(Im FEI, Re FEI), in radians (Eq 11b); negative on lag. NaN where measured is zero throughout. Of the other
    /// estimators -2 pi f_eq d, which may exceed half a turn.
    pub phase_rad: f64,
    /// d = -phi / (2 pi f_eq), in seconds (Eq 10); positive when measured lags.
    pub delay_s: f64,
    /// f_eq = sum f |I|^l / sum |I|^l, in hertz (Eq 7).
    pub equivalent_frequency_hz: f64,
    /// Standard deviation of A.
    pub amplitude_std: f64,
    /// 95 % interval of A.
    pub amplitude_interval: (f64, f64),
    /// Standard deviation of d, in seconds.
    pub delay_std_s: f64,
    /// 95 % interval of d, in seconds.
    pub delay_interval_s: (f64, f64),
    /// Coherence of the residual with the target, 0 to 1: what is left still follows the target, at other gains and delays.
    pub residual_coherence: f64,
    /// 1 - sum (O - A I_d)^2 / sum (O - mean O)^2: the share of measured that one gain and one delay explain.
    pub goodness: f64,
    /// Standard deviation of the noise that is the target's own, in its unit, where it was taken into account; else 0.
    pub target_noise: f64,
    /// Bad samples that were found, by kind, and left out.
    pub bad_samples: BadFound,
    /// Why there is no number, or no interval.
    pub reason: Option<Reason>,
}

impl Tracking {
    /// Nothing but the reason.
    pub(crate) const fn undetermined(reason: Reason) -> Self {
        Self {
            fei: Complex::new(f64::NAN, f64::NAN),
            amplitude: f64::NAN,
            phase_rad: f64::NAN,
            delay_s: f64::NAN,
            equivalent_frequency_hz: f64::NAN,
            amplitude_std: f64::NAN,
            amplitude_interval: (f64::NAN, f64::NAN),
            delay_std_s: f64::NAN,
            delay_interval_s: (f64::NAN, f64::NAN),
            residual_coherence: f64::NAN,
            goodness: f64::NAN,
            target_noise: 0.0,
            bad_samples: BadFound::NONE,
            reason: Some(reason),
        }
    }

    /// The numbers without their precision.
    pub(crate) fn without_interval(self, reason: Reason) -> Self {
        let (amplitude_interval, delay_interval_s) = ((f64::NAN, f64::NAN), (f64::NAN, f64::NAN));
        let (amplitude_std, delay_std_s) = (f64::NAN, f64::NAN);
        Self { amplitude_std, amplitude_interval, delay_std_s, delay_interval_s, reason: Some(reason), ..self }
    }
}

/// The bins behind a [`Tracking`], one entry a kept bin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spectra {
    /// f_k, in hertz.
    pub frequency_hz: Vec<f64>,
    /// |I_k|^l / sum |I|^l; they sum to one.
    pub weights: Vec<f64>,
    /// I_k, the transform of the detrended, windowed, zero-padded target, in unit of the signal (Eq 1a).
    pub target: Vec<Complex<f64>>,
    /// O_k (Eq 1b).
    pub measured: Vec<Complex<f64>>,
}

/// The checked plan for records of one length and rate: everything that does not depend on the samples.
///
/// ```
/// use rthstrack::{Evaluator, EvaluatorConfig, Pair};
/// let rate_hz = 1000.0;
/// // A burst that has died down at both ends; measured comes 5 ms later and 10 % too large.
/// let burst = |t: f64| (-(t - 1.0) * (t - 1.0) / 0.02).exp() * (12.0 * t).sin();
/// let target: Vec<f64> = (0..2000).map(|i| burst(f64::from(i) / rate_hz)).collect();
/// let measured: Vec<f64> = (0..2000).map(|i| 1.1 * burst(f64::from(i) / rate_hz - 0.005)).collect();
/// let evaluator = Evaluator::new(target.len(), rate_hz, EvaluatorConfig::default())?;
/// let mut state = evaluator.state();
/// let tracking = evaluator.evaluate(&mut state, &Pair::new(&target, &measured, rate_hz)?)?;
/// assert!((tracking.amplitude - 1.1).abs() < 1e-3);
/// assert!((tracking.delay_s - 0.005).abs() < 1e-5);
/// # Ok::<(), rthstrack::Error>(())
/// ```
pub struct Evaluator {
    config: EvaluatorConfig,
    n_samples: usize,
    rate_hz: f64,
    chebyshev: Option<Chebyshev>,
    layout: Layout,
    /// The published evaluation: planned with the rest for `fei`, when its spectra are asked for otherwise.
    published: OnceLock<Published>,
    alignment: Option<Alignment>,
}

/// From samples to bins, and what makes good their droop.
struct Published {
    spectrum: Spectrum,
    correction: Option<Vec<f64>>,
}

impl Published {
    fn new(layout: Layout) -> Self {
        let spectrum = Spectrum::of(layout);
        Self { correction: spectrum.correction(), spectrum }
    }

    fn sums(&self, weight_power: u32, state: &SpectrumState) -> Sums {
        weigh(&self.spectrum, self.correction.as_deref(), weight_power, state.pair())
    }
}

/// What changes during an evaluation: its buffers. Make one a thread.
#[derive(Debug, Clone)]
pub struct EvaluatorState {
    pub(crate) spectrum: SpectrumState,
    decimated: [Vec<f64>; 2],
    filter: Vec<f64>,
    alignment: Option<AlignmentState>,
    examination: Examination,
}

impl EvaluatorState {
    /// Makes room for the bad samples of views of `n`, so that finding some allocates nothing.
    pub(crate) fn reserve(&mut self, n: usize) {
        if let Some(alignment) = &mut self.alignment {
            alignment.reserve(n);
            self.examination.reserve(n);
        }
    }
}

impl Evaluator {
    /// Plans the evaluation of records of `n_samples` samples at `rate_hz`.
    ///
    /// # Errors
    /// Whatever makes the settings impossible for this length and rate; see [`Error`].
    pub fn new(n_samples: usize, rate_hz: f64, config: EvaluatorConfig) -> Result<Self> {
        check_rate(rate_hz)?;
        if n_samples < crate::pair::MIN_SAMPLES {
            return Err(Error::TooShort { expected: crate::pair::MIN_SAMPLES, found: n_samples });
        }
        config.check()?;
        let chebyshev = match config.decimator {
            Decimator::Chebyshev if config.data_decimation != 1 => {
                if n_samples < Chebyshev::MIN_SAMPLES {
                    return Err(Error::TooShortForChebyshev { expected: Chebyshev::MIN_SAMPLES, found: n_samples });
                }
                Some(Chebyshev::new(config.data_decimation)?)
            }
            _ => None,
        };
        let (len, rate, data_decimation) = match &chebyshev {
            Some(c) => (c.out_len(n_samples), rate_hz / config.data_decimation as f64, 1),
            None => (n_samples, rate_hz, config.data_decimation),
        };
        let layout = Layout::new(SpectrumConfig {
            n_samples: len,
            rate_hz: rate,
            data_decimation,
            frequency_decimation: config.frequency_decimation,
            window: config.window,
            detrend: config.detrend,
            band_hz: config.band_hz,
        })
        .map_err(|error| match error {
            // The filtered record has lost P by now; its message must not.
            Error::NoBin { fft_len, frequency_decimation, available_hz, band_hz, .. } => {
                let data_decimation = config.data_decimation;
                Error::NoBin { fft_len, data_decimation, frequency_decimation, available_hz, band_hz }
            }
            other => other,
        })?;
        let (alignment, published) = match config.estimator {
            Estimator::Fei => (None, OnceLock::from(Published::new(layout))),
            _ => (Some(Alignment::new(n_samples, rate_hz, &config)?), OnceLock::new()),
        };
        Ok(Self { config, n_samples, rate_hz, chebyshev, layout, published, alignment })
    }

    /// The settings.
    pub fn config(&self) -> &EvaluatorConfig {
        &self.config
    }

    /// Length of the records this is planned for.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Their rate.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Number of frequency bins kept.
    pub fn n_bins(&self) -> usize {
        self.layout.n_bins()
    }

    /// Spacing of the kept bins, Q rate / n, in hertz (Eq 9).
    pub fn delta_f_hz(&self) -> f64 {
        self.layout.delta_f_hz()
    }

    /// Buffers for [`Evaluator::evaluate`].
    pub fn state(&self) -> EvaluatorState {
        match &self.alignment {
            None => self.published_state(),
            Some(alignment) => EvaluatorState {
                spectrum: SpectrumState::default(),
                decimated: Default::default(),
                filter: Vec::new(),
                alignment: Some(alignment.state()),
                examination: Examination::default(),
            },
        }
    }

    /// Buffers for the published evaluation.
    fn published_state(&self) -> EvaluatorState {
        let (decimated, filter) = match &self.chebyshev {
            Some(c) => (c.out_len(self.n_samples), c.scratch_len(self.n_samples)),
            None => (0, 0),
        };
        EvaluatorState {
            spectrum: self.spectrum().state(),
            decimated: [vec![0.0; decimated], vec![0.0; decimated]],
            filter: vec![0.0; filter],
            alignment: None,
            examination: Examination::default(),
        }
    }

    /// Evaluates one pair (Eqs 1 to 12, or by alignment). Allocates nothing, but for the first pair that has bad samples.
    ///
    /// # Errors
    /// [`Error::Plan`] for a pair of another length or rate, [`Error::NotFinite`], [`Error::NoEnergy`], [`Error::Range`].
    pub fn evaluate(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<Tracking> {
        if self.alignment.is_some() {
            self.check(pair)?;
        }
        self.shifted(state, pair, 0).unwrap_or_else(|| self.published(state, pair))
    }

    /// By alignment, over the window that starts at `start`; None of the published estimator.
    fn shifted(&self, state: &mut EvaluatorState, pair: &Pair<'_>, start: usize) -> Option<Result<Tracking>> {
        let EvaluatorState { alignment: state, examination, .. } = state;
        let (alignment, state) = self.alignment.as_ref().zip(state.as_mut())?;
        let view = View::whole(pair);
        let estimate = |()| match self.config.bad_samples {
            BadSamples::LeaveOut => alignment.estimate_examined(state, examination, &view, start, self.expected()),
            BadSamples::Keep => alignment.estimate(state, &view, start, self.expected()),
        };
        Some(pair.check_fourth_powers().map(estimate))
    }

    /// The delay that is expected, in samples.
    fn expected(&self) -> Option<f64> {
        self.config.expected_delay_s.map(|d| d * self.rate_hz)
    }

    /// Samples before a window that [`Evaluator::evaluate_last`] may look at.
    pub(crate) fn samples_before(&self) -> usize {
        self.alignment.as_ref().map_or(0, Alignment::margin)
    }

    /// Evaluates the last `n_samples` of a pair; the estimators that shift the target also see what comes before them.
    pub(crate) fn evaluate_last(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<Tracking> {
        let start = pair.n_samples() - self.n_samples;
        if let Some(found) = self.shifted(state, pair, start) {
            return found;
        }
        self.published(state, &Pair::new(&pair.target()[start..], &pair.measured()[start..], pair.rate_hz())?)
    }

    /// Eqs 1 to 12, whatever the estimator.
    fn published(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<Tracking> {
        self.transform(state, pair)?;
        self.finish(self.plan().sums(self.config.weight_power, &state.spectrum), pair)
    }

    /// The same with the bins behind it, for which it allocates.
    ///
    /// # Errors
    /// Those of [`Evaluator::evaluate`].
    pub fn evaluate_with_spectra(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<(Tracking, Spectra)> {
        if self.alignment.is_none() {
            let tracking = self.published(state, pair)?;
            return Ok((tracking, self.spectra(&state.spectrum)));
        }
        let spectra = {
            let mut state = self.published_state();
            self.published(&mut state, pair)?;
            self.spectra(&state.spectrum)
        };
        Ok((self.evaluate(state, pair)?, spectra))
    }

    /// The bins that stand in the state.
    fn spectra(&self, state: &SpectrumState) -> Spectra {
        let Published { spectrum, correction } = self.plan();
        let n = self.n_bins();
        let mut collected = Collect {
            first: spectrum.first(),
            target: vec![Complex::default(); n],
            measured: vec![Complex::default(); n],
        };
        spectrum.visit(state, &mut collected);
        let Collect { first, mut target, mut measured } = collected;
        if let Some(correction) = correction {
            for (k, factor) in correction.iter().enumerate() {
                target[k] *= factor;
                measured[k] *= factor;
            }
        }
        let magnitudes: Vec<f64> = target.iter().map(|x| weight(x.norm_sqr(), self.config.weight_power)).collect();
        let total: f64 = magnitudes.iter().sum();
        Spectra {
            frequency_hz: (0..n).map(|k| (first + k) as f64 * self.delta_f_hz()).collect(),
            weights: magnitudes.iter().map(|m| m / total).collect(),
            target,
            measured,
        }
    }

    /// From now on only `bins` count; returns what makes good the droop of the cascade at each of them.
    pub(crate) fn keep_only(&mut self, bins: &[usize]) -> Vec<f64> {
        let Published { spectrum, correction } = self.published.take().unwrap_or_else(|| Published::new(self.layout));
        let first = spectrum.first();
        let factors: Vec<f64> = bins.iter().map(|b| correction.as_ref().map_or(1.0, |c| c[b - first])).collect();
        let mut kept = vec![0.0; self.n_bins()];
        for (b, factor) in bins.iter().zip(&factors) {
            kept[b - first] = *factor;
        }
        self.published = OnceLock::from(Published { spectrum, correction: Some(kept) });
        factors
    }

    /// Refuses a pair of another length or rate.
    pub(crate) fn check(&self, pair: &Pair<'_>) -> Result<()> {
        let found = (pair.n_samples(), pair.rate_hz());
        if found == (self.n_samples, self.rate_hz) {
            return Ok(());
        }
        Err(Error::Plan { expected: (self.n_samples, self.rate_hz), found })
    }

    pub(crate) fn transform(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<()> {
        self.check(pair)?;
        let EvaluatorState { spectrum, decimated: [target, measured], filter, .. } = state;
        let (target, measured) = match &self.chebyshev {
            Some(chebyshev) => {
                chebyshev.run(pair.target(), filter, target)?;
                chebyshev.run(pair.measured(), filter, measured)?;
                (target.as_slice(), measured.as_slice())
            }
            None => (pair.target(), pair.measured()),
        };
        self.spectrum().transform(spectrum, target, measured);
        Ok(())
    }

    /// Eqs 10 and 11 from the sums.
    pub(crate) fn finish(&self, sums: Sums, pair: &Pair<'_>) -> Result<Tracking> {
        let cross_size = sums.cross_size();
        if ![cross_size, sums.power, sums.moment, sums.energy].iter().all(|v| v.is_finite()) {
            // A transform carries one NaN into every bin; only then is it looked for.
            pair.check_finite()?;
        }
        let Some(tracking) = sums.tracking(self.delta_f_hz(), self.round_off(pair)) else {
            let peak = peak(pair.target());
            // The energy is summed beside the weights, so both must fit.
            let fits = |power| SUMS.contains(&weight(peak * peak, power));
            return Err(if fits(2) && fits(self.config.weight_power) && sums.power.is_finite() {
                Error::NoEnergy
            } else {
                Error::Range { signal: Signal::Target, peak, weight_power: self.config.weight_power }
            });
        };
        if !sums.measured_fits(&tracking) {
            let peak = peak(pair.measured());
            if peak > 0.0 {
                return Err(Error::Range { signal: Signal::Measured, peak, weight_power: self.config.weight_power });
            }
        }
        Ok(tracking)
    }

    /// Energy below which bins hold only the round-off of the others.
    pub(crate) fn round_off(&self, pair: &Pair<'_>) -> f64 {
        self.layout.fft_len() as f64 * energy_at_least(pair.target()) * ROUND_OFF_SHARE
    }

    /// The plan of the bins.
    pub(crate) fn spectrum(&self) -> &Spectrum {
        &self.plan().spectrum
    }

    fn plan(&self) -> &Published {
        self.published.get_or_init(|| Published::new(self.layout))
    }
}

/// Sums that lie well within double precision, with room for their smallest terms.
const SUMS: std::ops::RangeInclusive<f64> = 1e-250..=1e280;

/// Share of the energy that round-off alone leaves in any band: (100 eps)^2.
const ROUND_OFF_SHARE: f64 = 5e-28;

/// A cheap estimate of sum x^2 (n sum x^2 is the energy of all bins, by Parseval), from every 61st sample.
fn energy_at_least(samples: &[f64]) -> f64 {
    const STRIDE: usize = 61;
    samples.iter().step_by(STRIDE).map(|v| v * v).sum::<f64>() * STRIDE as f64
}

/// d = -phi / (2 pi f), in seconds (Eq 10): a negative phase is a lag, a positive delay.
#[inline]
pub fn delay(phase_rad: f64, frequency_hz: f64) -> f64 {
    // Not -phase_rad, which would make a perfect 0 a -0.
    (0.0 - phase_rad) / (2.0 * PI * frequency_hz)
}

/// |I|^l from |I|^2.
#[inline(always)]
pub(crate) fn weight(squared: f64, power: u32) -> f64 {
    let even = squared.powi((power / 2) as i32);
    if power.is_multiple_of(2) { even } else { even * squared.sqrt() }
}

/// The sums of Eqs 7 and 12, frequency in bins.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub(crate) cross: Complex<f64>,
    pub(crate) power: f64,
    pub(crate) moment: f64,
    /// sum |I|^2, which is `power` for l = 2.
    pub(crate) energy: f64,
}

impl Sums {
    /// Adds what bin `k` holds.
    #[inline(always)]
    pub(crate) fn add_term(&mut self, term: &Term, k: usize) {
        self.cross.re += term.re;
        self.cross.im += term.im;
        self.power += term.power;
        self.moment += k as f64 * term.power;
        self.energy += term.squared;
    }

    /// Adds the sums over other bins.
    pub(crate) fn add(&mut self, other: &Sums) {
        self.cross += other.cross;
        self.power += other.power;
        self.moment += other.moment;
        self.energy += other.energy;
    }

    fn cross_size(&self) -> f64 {
        self.cross.re.abs().max(self.cross.im.abs())
    }

    /// Whether what measured adds lies well within double precision.
    pub(crate) fn measured_fits(&self, found: &Tracking) -> bool {
        SUMS.contains(&self.cross_size()) && SUMS.contains(&found.amplitude)
    }

    /// Eqs 10 and 11; `None` where the sums leave double precision or hold no more than `round_off`.
    pub(crate) fn tracking(&self, delta_f_hz: f64, round_off: f64) -> Option<Tracking> {
        let Self { cross, power, moment, energy } = *self;
        let in_range = SUMS.contains(&power) && SUMS.contains(&energy) && moment.is_finite();
        if !in_range || energy <= round_off {
            return None;
        }
        let fei = cross / power;
        let equivalent_frequency_hz = moment / power * delta_f_hz;
        // A sensor that reports nothing is not in time: it has no phase.
        // And -0 of an antiphase is pi, not -pi.
        let phase_rad = if self.cross_size() == 0.0 { f64::NAN } else { (fei.im + 0.0).atan2(fei.re) };
        Some(Tracking {
            fei,
            amplitude: fei.norm(),
            phase_rad,
            delay_s: delay(phase_rad, equivalent_frequency_hz),
            equivalent_frequency_hz,
            reason: None,
            ..Tracking::undetermined(Reason::Still)
        })
    }
}

/// What one bin adds to the sums.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Term {
    /// O conj(I) |I|^(l-2)
    pub(crate) re: f64,
    pub(crate) im: f64,
    /// |I|^l
    pub(crate) power: f64,
    /// |I|^2
    pub(crate) squared: f64,
}

impl Term {
    /// Of target (ir, ii) and measured (or, oi). `L` = 2 is compiled apart; 0 stands for any power.
    #[inline(always)]
    pub(crate) fn new<const L: u32>(weight_power: u32, (ir, ii): (f64, f64), (or, oi): (f64, f64)) -> Self {
        let squared = ir * ir + ii * ii;
        let (mut re, mut im) = (or * ir + oi * ii, oi * ir - or * ii);
        let mut power = squared;
        if L != 2 {
            power = weight(squared, weight_power);
            // l = 1: O conj(I) / |I| goes to zero with I.
            let factor = if squared > 0.0 { power / squared } else { 0.0 };
            re *= factor;
            im *= factor;
        }
        Self { re, im, power, squared }
    }
}

/// Sums over the kept bins of a pair of packed transforms, target first.
pub(crate) fn weigh(
    spectrum: &Spectrum,
    correction: Option<&[f64]>,
    weight_power: u32,
    pair: [&[Complex<f64>]; 2],
) -> Sums {
    fn sum<const L: u32, const CORRECT: bool>(
        spectrum: &Spectrum,
        pair: [&[Complex<f64>]; 2],
        mut weigh: Weigh<'_, L, CORRECT>,
    ) -> Sums {
        spectrum.visit_pair(pair, &mut weigh);
        weigh.sums()
    }
    let first = spectrum.first();
    match (weight_power, correction) {
        (2, None) => sum(spectrum, pair, Weigh::<2, false>::new(&[], 0, 2)),
        (2, Some(correction)) => sum(spectrum, pair, Weigh::<2, true>::new(correction, first, 2)),
        (power, None) => sum(spectrum, pair, Weigh::<0, false>::new(&[], 0, power)),
        (power, Some(correction)) => sum(spectrum, pair, Weigh::<0, true>::new(correction, first, power)),
    }
}

/// sum |I|^2 and sum k |I|^2 over the kept bins of one packed transform.
pub(crate) fn centroid(spectrum: &Spectrum, correction: Option<&[f64]>, bins: &[Complex<f64>]) -> (f64, f64) {
    fn sums<const CORRECT: bool>(
        spectrum: &Spectrum,
        bins: &[Complex<f64>],
        mut weigh: Weigh<'_, 2, CORRECT>,
    ) -> (f64, f64) {
        spectrum.visit_one(bins, &mut weigh);
        let Sums { power, moment, .. } = weigh.sums();
        (power, moment)
    }
    match correction {
        None => sums(spectrum, bins, Weigh::<2, false>::new(&[], 0, 2)),
        Some(correction) => sums(spectrum, bins, Weigh::<2, true>::new(correction, spectrum.first(), 2)),
    }
}

/// Adds up O conj(I) |I|^(l-2), |I|^l and k |I|^l. `L` = 2 is compiled apart; 0 stands for any power.
struct Weigh<'a, const L: u32, const CORRECT: bool> {
    correction: &'a [f64],
    first: usize,
    weight_power: u32,
    re: [f64; LANES],
    im: [f64; LANES],
    power: [f64; LANES],
    moment: [f64; LANES],
    energy: [f64; LANES],
}

impl<'a, const L: u32, const CORRECT: bool> Weigh<'a, L, CORRECT> {
    fn new(correction: &'a [f64], first: usize, weight_power: u32) -> Self {
        let zero = [0.0; LANES];
        Self { correction, first, weight_power, re: zero, im: zero, power: zero, moment: zero, energy: zero }
    }

    fn sums(&self) -> Sums {
        let total = |lanes: &[f64; LANES]| lanes.iter().sum::<f64>();
        Sums {
            cross: Complex::new(total(&self.re), total(&self.im)),
            power: total(&self.power),
            moment: total(&self.moment),
            energy: if L == 2 { total(&self.power) } else { total(&self.energy) },
        }
    }
}

impl<const L: u32, const CORRECT: bool> Sink for Weigh<'_, L, CORRECT> {
    #[inline(always)]
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let (mut ir, mut ii) = (bins.target_re[i], bins.target_im[i]);
            let (mut or, mut oi) = (bins.measured_re[i], bins.measured_im[i]);
            if CORRECT {
                let factor = self.correction[bins.first - self.first + i];
                (ir, ii, or, oi) = (ir * factor, ii * factor, or * factor, oi * factor);
            }
            let term = Term::new::<L>(self.weight_power, (ir, ii), (or, oi));
            if L != 2 {
                self.energy[i] += term.squared;
            }
            self.re[i] += term.re;
            self.im[i] += term.im;
            self.power[i] += term.power;
            self.moment[i] += (bins.first + i) as f64 * term.power;
        }
    }
}

/// Keeps the bins.
struct Collect {
    first: usize,
    target: Vec<Complex<f64>>,
    measured: Vec<Complex<f64>>,
}

impl Sink for Collect {
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let k = bins.first - self.first + i;
            self.target[k] = Complex::new(bins.target_re[i], bins.target_im[i]);
            self.measured[k] = Complex::new(bins.measured_re[i], bins.measured_im[i]);
        }
    }
}

/// Windows of one longer pair, evaluated one after the other.
pub(crate) struct Moving<'a> {
    evaluator: &'a Evaluator,
    state: EvaluatorState,
    pair: &'a Pair<'a>,
    streams: Option<[Stream; 2]>,
    /// The whole record's bad samples; None where there are none.
    examination: Option<Examination>,
    /// The delay that is expected, or else that of the whole record, in samples: it tells a window whose target is one tone
    /// which turn it is.
    expected: Option<f64>,
}

impl Evaluator {
    /// Prepares to evaluate windows of `pair` that start at multiples of `hop`.
    pub(crate) fn moving<'a>(&'a self, pair: &'a Pair<'a>, hop: usize) -> Moving<'a> {
        let streams = match (&self.chebyshev, &self.alignment) {
            (Some(_), _) | (_, Some(_)) => None,
            _ => {
                let stream = |samples| self.spectrum().stream(samples, hop);
                stream(pair.target()).zip(stream(pair.measured())).map(|(target, measured)| [target, measured])
            }
        };
        let examination = self.alignment.as_ref().and_then(|_| Alignment::examined(pair, &self.config));
        let view = view(pair, examination.as_ref());
        let expected = self
            .alignment
            .as_ref()
            .and_then(|_| self.expected().or_else(|| Alignment::expected(&view, &self.config, pair.rate_hz())));
        Moving { evaluator: self, state: self.state(), pair, streams, examination, expected }
    }
}

/// A pair without its bad samples.
fn view<'a>(pair: &Pair<'a>, examination: Option<&'a Examination>) -> View<'a> {
    examination.map_or_else(|| View::whole(pair), Examination::view)
}

impl Moving<'_> {
    /// What was found in the whole record.
    pub(crate) fn bad_samples(&self) -> BadFound {
        self.examination.as_ref().map_or(BadFound::NONE, Examination::found)
    }

    /// The reading of the window that starts at sample `start`: of `fei` that of [`Evaluator::evaluate`], bit for bit; the other
    /// estimators also see the target outside the window. The samples are finite.
    pub(crate) fn at(&mut self, start: usize) -> Result<Tracking> {
        let Self { evaluator, state, pair, streams, examination, expected } = self;
        if let (Some(alignment), Some(state)) = (&evaluator.alignment, &mut state.alignment) {
            return Ok(alignment.estimate(state, &view(pair, examination.as_ref()), start, *expected));
        }
        let range = start..start + evaluator.n_samples;
        let window = Pair::new(&pair.target()[range.clone()], &pair.measured()[range], pair.rate_hz())?;
        let Some([target, measured]) = streams else { return evaluator.evaluate(state, &window) };
        let signals = [(window.target(), Some(target.from(start))), (window.measured(), Some(measured.from(start)))];
        let plan = evaluator.plan();
        plan.spectrum.transform_with(&mut state.spectrum, signals);
        evaluator.finish(plan.sums(evaluator.config.weight_power, &state.spectrum), &window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_evaluation_is_planned_and_kept_only_where_it_is_asked_for() {
        let target: Vec<f64> = (0..4096).map(|i| (f64::from(i) * 0.05).sin() + (f64::from(i) * 0.013).cos()).collect();
        let measured: Vec<f64> = target.iter().map(|v| 0.9 * v).collect();
        let pair = Pair::new(&target, &measured, 1000.0).unwrap();
        let plan = |estimator| {
            let config = EvaluatorConfig { estimator, window: Window::Hann, ..Default::default() };
            let evaluator = Evaluator::new(target.len(), 1000.0, config).unwrap();
            let state = evaluator.state();
            (evaluator, state)
        };
        let (fei, mut of_fei) = plan(Estimator::Fei);
        let (_, published) = fei.evaluate_with_spectra(&mut of_fei, &pair).unwrap();
        for estimator in [Estimator::Aligned, Estimator::LeastSquares] {
            let (evaluator, mut state) = plan(estimator);
            let alone = evaluator.evaluate(&mut state, &pair).unwrap();
            assert!(evaluator.published.get().is_none() && state.spectrum.pair().iter().all(|bins| bins.is_empty()));
            let (beside, spectra) = evaluator.evaluate_with_spectra(&mut state, &pair).unwrap();
            assert_eq!((format!("{beside:?}"), &spectra), (format!("{alone:?}"), &published));
            assert!(state.spectrum.pair().iter().all(|bins| bins.is_empty()));
        }
    }
}
