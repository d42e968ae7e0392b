//! Eqs 6 to 12: one complex number for the whole record.

use std::f64::consts::PI;

use num_complex::Complex;

use crate::decimate::{Chebyshev, Decimator, Stream};
use crate::error::{Error, Result, Signal};
use crate::pair::{Pair, check_rate, peak};
use crate::spectrum::{Bins, LANES, Sink, Spectrum, SpectrumConfig, SpectrumState};
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
}

impl Estimator {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Estimator); 1] = [("fei", Estimator::Fei)];
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
        }
    }
}

/// Amplitude and delay of measured over target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// sum O conj(I) |I|^(l-2) / sum |I|^l (Eq 12 without its quotient).
    pub fei: Complex<f64>,
    /// A = |FEI| (Eq 11a); 1 is perfect.
    pub amplitude: f64,
    /// phi = atan2(Im FEI, Re FEI), in radians (Eq 11b); negative on lag. NaN where measured is zero throughout.
    pub phase_rad: f64,
    /// d = -phi / (2 pi f_eq), in seconds (Eq 10); positive when measured lags.
    pub delay_s: f64,
    /// f_eq = sum f |I|^l / sum |I|^l, in hertz (Eq 7).
    pub equivalent_frequency_hz: f64,
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
    spectrum: Spectrum,
    correction: Option<Vec<f64>>,
}

/// What changes during an evaluation: its buffers. Make one a thread.
#[derive(Debug, Clone)]
pub struct EvaluatorState {
    pub(crate) spectrum: SpectrumState,
    decimated: [Vec<f64>; 2],
    filter: Vec<f64>,
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
        if !(1..=MAX_WEIGHT_POWER).contains(&config.weight_power) {
            return Err(Error::WeightPower { found: config.weight_power });
        }
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
        let spectrum = Spectrum::new(SpectrumConfig {
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
        let correction = spectrum.correction();
        Ok(Self { config, n_samples, rate_hz, chebyshev, spectrum, correction })
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
        self.spectrum.n_bins()
    }

    /// Spacing of the kept bins, Q rate / n, in hertz (Eq 9).
    pub fn delta_f_hz(&self) -> f64 {
        self.spectrum.delta_f_hz()
    }

    /// Buffers for [`Evaluator::evaluate`].
    pub fn state(&self) -> EvaluatorState {
        let (decimated, filter) = match &self.chebyshev {
            Some(c) => (c.out_len(self.n_samples), c.scratch_len(self.n_samples)),
            None => (0, 0),
        };
        EvaluatorState {
            spectrum: self.spectrum.state(),
            decimated: [vec![0.0; decimated], vec![0.0; decimated]],
            filter: vec![0.0; filter],
        }
    }

    /// Evaluates one pair (Eqs 1 to 12). Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Plan`] for a pair of another length or rate, [`Error::NotFinite`], [`Error::NoEnergy`], [`Error::Range`].
    pub fn evaluate(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<Tracking> {
        self.transform(state, pair)?;
        self.finish(self.sum(&state.spectrum), pair)
    }

    /// The same with the bins behind it.
    ///
    /// # Errors
    /// Those of [`Evaluator::evaluate`].
    pub fn evaluate_with_spectra(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<(Tracking, Spectra)> {
        let tracking = self.evaluate(state, pair)?;
        let n = self.n_bins();
        let mut collected = Collect {
            first: self.spectrum.first(),
            target: vec![Complex::default(); n],
            measured: vec![Complex::default(); n],
        };
        self.spectrum.visit(&state.spectrum, &mut collected);
        let Collect { first, mut target, mut measured } = collected;
        if let Some(correction) = &self.correction {
            for (k, factor) in correction.iter().enumerate() {
                target[k] *= factor;
                measured[k] *= factor;
            }
        }
        let magnitudes: Vec<f64> = target.iter().map(|x| weight(x.norm_sqr(), self.config.weight_power)).collect();
        let total: f64 = magnitudes.iter().sum();
        let spectra = Spectra {
            frequency_hz: (0..n).map(|k| (first + k) as f64 * self.delta_f_hz()).collect(),
            weights: magnitudes.iter().map(|m| m / total).collect(),
            target,
            measured,
        };
        Ok((tracking, spectra))
    }

    /// From now on only `bins` count; returns what makes good the droop of the cascade at each of them.
    pub(crate) fn keep_only(&mut self, bins: &[usize]) -> Vec<f64> {
        let first = self.spectrum.first();
        let factors: Vec<f64> = bins.iter().map(|b| self.correction.as_ref().map_or(1.0, |c| c[b - first])).collect();
        let mut kept = vec![0.0; self.n_bins()];
        for (b, factor) in bins.iter().zip(&factors) {
            kept[b - first] = *factor;
        }
        self.correction = Some(kept);
        factors
    }

    /// Refuses a pair of another length or rate.
    pub(crate) fn check(&self, pair: &Pair<'_>) -> Result<()> {
        let found = (pair.n_samples(), pair.rate_hz());
        if found != (self.n_samples, self.rate_hz) {
            return Err(Error::Plan { expected: (self.n_samples, self.rate_hz), found });
        }
        Ok(())
    }

    pub(crate) fn transform(&self, state: &mut EvaluatorState, pair: &Pair<'_>) -> Result<()> {
        self.check(pair)?;
        let EvaluatorState { spectrum, decimated: [target, measured], filter } = state;
        let (target, measured) = match &self.chebyshev {
            Some(chebyshev) => {
                chebyshev.run(pair.target(), filter, target)?;
                chebyshev.run(pair.measured(), filter, measured)?;
                (target.as_slice(), measured.as_slice())
            }
            None => (pair.target(), pair.measured()),
        };
        self.spectrum.transform(spectrum, target, measured);
        Ok(())
    }

    fn sum(&self, state: &SpectrumState) -> Sums {
        let (first, power) = (self.spectrum.first(), self.config.weight_power);
        match (power, &self.correction) {
            (2, None) => self.sum_with(state, Weigh::<2, false>::new(&[], 0, 2)),
            (2, Some(correction)) => self.sum_with(state, Weigh::<2, true>::new(correction, first, 2)),
            (_, None) => self.sum_with(state, Weigh::<0, false>::new(&[], 0, power)),
            (_, Some(correction)) => self.sum_with(state, Weigh::<0, true>::new(correction, first, power)),
        }
    }

    fn sum_with<const L: u32, const CORRECT: bool>(
        &self,
        state: &SpectrumState,
        mut weigh: Weigh<'_, L, CORRECT>,
    ) -> Sums {
        self.spectrum.visit(state, &mut weigh);
        weigh.sums()
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
        if !(SUMS.contains(&cross_size) && SUMS.contains(&tracking.amplitude)) {
            let peak = peak(pair.measured());
            if peak > 0.0 {
                return Err(Error::Range { signal: Signal::Measured, peak, weight_power: self.config.weight_power });
            }
        }
        Ok(tracking)
    }

    /// Energy below which bins hold only the round-off of the others.
    pub(crate) fn round_off(&self, pair: &Pair<'_>) -> f64 {
        self.spectrum.fft_len() as f64 * energy_at_least(pair.target()) * ROUND_OFF_SHARE
    }

    /// The plan of the bins.
    pub(crate) fn spectrum(&self) -> &Spectrum {
        &self.spectrum
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
fn weight(squared: f64, power: u32) -> f64 {
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
        let phase_rad = if self.cross_size() == 0.0 { f64::NAN } else { fei.im.atan2(fei.re) };
        Some(Tracking {
            fei,
            amplitude: fei.norm(),
            phase_rad,
            delay_s: delay(phase_rad, equivalent_frequency_hz),
            equivalent_frequency_hz,
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
}

impl Evaluator {
    /// Prepares to evaluate windows of `pair` that start at multiples of `hop`.
    pub(crate) fn moving<'a>(&'a self, pair: &'a Pair<'a>, hop: usize) -> Moving<'a> {
        let streams = match self.chebyshev {
            Some(_) => None,
            None => {
                let stream = |samples| self.spectrum.stream(samples, hop);
                stream(pair.target()).zip(stream(pair.measured())).map(|(target, measured)| [target, measured])
            }
        };
        Moving { evaluator: self, state: self.state(), pair, streams }
    }
}

impl Moving<'_> {
    /// The reading of the window that starts at sample `start`: that of [`Evaluator::evaluate`], bit for bit.
    pub(crate) fn at(&mut self, start: usize) -> Result<Tracking> {
        let Self { evaluator, state, pair, streams } = self;
        let range = start..start + evaluator.n_samples;
        let window = Pair::new(&pair.target()[range.clone()], &pair.measured()[range], pair.rate_hz())?;
        let Some([target, measured]) = streams else { return evaluator.evaluate(state, &window) };
        let signals = [(window.target(), Some(target.from(start))), (window.measured(), Some(measured.from(start)))];
        evaluator.spectrum.transform_with(&mut state.spectrum, signals);
        evaluator.finish(evaluator.sum(&state.spectrum), &window)
    }
}
