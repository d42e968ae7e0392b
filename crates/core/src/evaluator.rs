//! The plan of an evaluation, and its buffers: from a pair, or its moving windows, to [`Tracking`].

use std::sync::OnceLock;

use num_complex::Complex;

use crate::alignment::{Alignment, AlignmentState, Judged};
use crate::bad_samples::{BadFound, BadSamples, Examination};
use crate::decimate::{Chebyshev, Decimator, Stream};
use crate::error::{Error, Result, Signal};
use crate::lag::View;
use crate::pair::{MIN_SAMPLES, Pair, check_rate, peak};
use crate::settings::{Estimator, EvaluatorConfig};
use crate::spectrum::{Bins, Layout, Sink, Spectrum, SpectrumConfig, SpectrumState};
use crate::tracking::{Spectra, Tracking};
use crate::weigh::{SUMS, Sums, weigh, weight};

/// Share of the energy that round-off alone leaves in any band: (100 eps)^2.
const ROUND_OFF_SHARE: f64 = 5e-28;

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
        if n_samples < MIN_SAMPLES {
            return Err(Error::TooShort { expected: MIN_SAMPLES, found: n_samples });
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
            detrend: config.detrending(),
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
        let judged = Judged::new(View::whole(pair), start, self.expected());
        let estimate = |()| match self.config.bad_samples {
            BadSamples::LeaveOut => alignment.estimate_examined(state, examination, &judged),
            BadSamples::Keep => alignment.estimate(state, &judged),
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

/// A cheap estimate of sum x^2 (n sum x^2 is the energy of all bins, by Parseval), from every 61st sample.
fn energy_at_least(samples: &[f64]) -> f64 {
    const STRIDE: usize = 61;
    samples.iter().step_by(STRIDE).map(|v| v * v).sum::<f64>() * STRIDE as f64
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
        let examination = self.alignment.as_ref().and_then(|_| Examination::of(pair, &self.config));
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
            let judged = Judged::new(view(pair, examination.as_ref()), start, *expected);
            return Ok(alignment.estimate(state, &judged));
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
    use crate::window::{Detrend, Window};

    #[test]
    fn the_published_evaluation_is_planned_and_kept_only_where_it_is_asked_for() {
        let target: Vec<f64> = (0..4096).map(|i| (f64::from(i) * 0.05).sin() + (f64::from(i) * 0.013).cos()).collect();
        let measured: Vec<f64> = target.iter().map(|v| 0.9 * v).collect();
        let pair = Pair::new(&target, &measured, 1000.0).unwrap();
        let plan = |estimator| {
            let detrend = Some(Detrend::None);
            let config = EvaluatorConfig { estimator, window: Window::Hann, detrend, ..Default::default() };
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
