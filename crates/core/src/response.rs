//! Gain, phase, delay and coherence over frequency with their intervals, because a real actuator's delay is not one number.
//!
//! Segment s of measured is O_s = H I_s + N_s at every bin, with a given target and stationary noise N. Least squares over
//! the segments is Welch's H1,
//!
//! ```text
//! H = sum conj(I_s) O_s / sum |I_s|^2,     E_s = O_s - H I_s.
//! ```
//!
//! Noise of segments m hops apart shares samples: E[N_s conj N_(s-m)] = S r_m, r_m = sum w_t w_(t + m hop) / sum w_t^2, once
//! each segment's phase is counted from one origin. With R the matrix of the r_m, u = I / |I| and P = 1 - u u^H,
//!
//! ```text
//! var H = S u^H R u / sum |I_s|^2,     E[sum |E_s|^2] = S tr(P R) = S (n - u^H R u),
//! ```
//!
//! so that S is known from the residuals whichever segments hold the motion, with 2 tr(P R)^2 / tr(P R P R) degrees of
//! freedom (Satterthwaite). Half of var H is along H and half across it.
//!
//! A window sees frequencies around f, over which H(v) = H (1 + (H'/H) (v - f)). To first order that is H times the target under
//! a window moved by c = i H'/(2 pi H), complex where the gain changes: I_s + c D_s with D_s the target under the window's
//! derivative. `dispersion` puts that in the place of I_s, H'/H from neighbouring bins.

use std::collections::VecDeque;
use std::f64::consts::PI;
use std::fmt;
use std::ops::Range;

use num_complex::Complex;

use crate::error::{Error, Result};
use crate::evaluator::Evaluator;
use crate::pair::Pair;
use crate::quantile::{NORMAL, student_t_975};
use crate::reason::Reason;
use crate::settings::EvaluatorConfig;
use crate::spectrum::{Bins, Sink, Spectrum, SpectrumConfig, SpectrumState};
use crate::tracking::delay;
use crate::window::{Detrend, Window};

/// Shortest segment that is worth a spectrum.
const MIN_SEGMENT: usize = 16;
/// Fewest segments from which a coherence means anything.
const MIN_SEGMENTS: usize = 2;
/// Bins below this coherence do not lead the unwrapping of the phase.
const LEADING_COHERENCE: f64 = 0.5;
/// Segments that may share samples with one before it, where intervals are wanted: an overlap of 7/8 has seven.
const MAX_SHARING: usize = 7;
/// Fewest degrees of freedom of the noise from which an interval is stated.
const MIN_DEGREES: f64 = 4.0;
/// Half the width of an interval, as a share of the gain, up to which gain and phase are linear in the noise.
const LINEAR: f64 = 1.0 / 3.0;
/// Bins to either side from which a bin's H'/H is taken.
const NEIGHBOURS: usize = 4;
/// Turns of H from H'/H and H'/H from H; the first leaves a share of about the delay over the segment's length.
const MAX_TURNS: usize = 4;
/// Share of a segment by which a window may be moved to first order.
const SMALL_SHIFT: f64 = 0.1;
/// Share of a bin's noise that may be tied to its mirror image at negative frequency, or be taken away by detrending.
const MIRRORED: f64 = 0.1;

/// The user's numbers for a frequency response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseConfig {
    /// Length of a segment, in seconds; `None`: the largest power of two of samples in an eighth of the record.
    pub segment_s: Option<f64>,
    /// Share of a segment that the next one overlaps, 0 to below 1.
    pub overlap: f64,
    /// Window over each segment.
    pub window: Window,
    /// What is subtracted from each segment.
    pub detrend: Detrend,
    /// The delay, as far as it is known, in seconds: target's segments are taken that much earlier than measured's. `None`: the
    /// delay by least squares, mean removed.
    pub align_s: Option<f64>,
    /// Whether to correct what windows make of a gain and a delay that change from bin to bin, or differ from `align_s`.
    pub dispersion: bool,
}

impl Default for ResponseConfig {
    fn default() -> Self {
        Self {
            segment_s: None,
            overlap: 0.5,
            window: Window::Hann,
            detrend: Detrend::Mean,
            align_s: None,
            dispersion: false,
        }
    }
}

/// One entry a frequency, from the first bin above zero to Nyquist.
///
/// Standard errors and intervals (95 %, low and high) are NaN where nothing supports them: fewer than 4 degrees of freedom;
/// an interval wider than a third of the gain to either side (coherence too low); bins that the window ties to their own mirror
/// image, next to zero and Nyquist; overlaps above 7/8.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// f, in hertz.
    pub frequency_hz: Vec<f64>,
    /// |S_IO| / S_II (H1).
    pub gain: Vec<f64>,
    /// arg S_IO, unwrapped from bin to bin along the delay of the last coherent bin, in radians.
    pub phase_rad: Vec<f64>,
    /// -phase / (2 pi f), in seconds; positive when measured lags.
    pub delay_s: Vec<f64>,
    /// |S_IO|^2 / (S_II S_OO), 0 to 1; NaN where either signal has no energy.
    pub coherence: Vec<f64>,
    /// S_II, one-sided, in unit^2 / Hz.
    pub target_psd: Vec<f64>,
    /// S_OO, one-sided, in unit^2 / Hz.
    pub measured_psd: Vec<f64>,
    /// sqrt(var H / 2).
    pub gain_std: Vec<f64>,
    /// gain -+ t gain_std, t the 0.975 quantile of Student's distribution.
    pub gain_interval: Vec<[f64; 2]>,
    /// gain_std / gain / (2 pi f), in seconds.
    pub delay_std_s: Vec<f64>,
    /// delay_s -+ t delay_std_s, in seconds.
    pub delay_interval_s: Vec<[f64; 2]>,
    /// Segments averaged.
    pub n_segments: usize,
    /// Length of a segment, in seconds.
    pub segment_s: f64,
    /// The delay at which segments are aligned, in seconds.
    pub align_s: f64,
    /// Why they are not, where nothing was said of it.
    pub unaligned: Option<Unaligned>,
}

/// Why segments are not aligned at a delay that was to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Unaligned {
    /// The delay could not be determined.
    Unknown(Reason),
    /// It leaves fewer than two segments of the record.
    NoRoom {
        /// The delay, in seconds.
        delay_s: f64,
    },
}

impl fmt::Display for Unaligned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unaligned::Unknown(reason) => reason.fmt(f),
            Unaligned::NoRoom { delay_s } => write!(
                f,
                "the record is too short for two segments {:.4} ms apart; take shorter ones",
                1e3 * delay_s.abs()
            ),
        }
    }
}

/// Averages cross-spectra over overlapping windowed segments (Welch 1967), zero-padded to a power of two.
///
/// S_IO = mean conj(I) O, so that its phase is negative on lag. A delay tau moves motion out of the window that it stood in, and
/// other motion into it. At the strongest bins that costs about tau over the segment's length of gain; where the target is weak
/// beside neighbouring frequencies, or stands in few segments, as many times more as these are stronger. `align_s` gives it back
/// (Bendat and Piersol 2010, section 9.1): whole samples by taking target's segments earlier, the rest by moving the window over
/// the target. `dispersion` does so at every bin, to first order.
///
/// # Errors
/// [`Error::TooShort`], [`Error::Setting`] for a segment, overlap or alignment that leaves fewer than two segments,
/// [`Error::NotFinite`], [`Error::Range`].
pub fn frequency_response(pair: &Pair<'_>, config: &ResponseConfig) -> Result<FrequencyResponse> {
    let (welch, align_s, unaligned) = aligned(pair, config)?;
    let averages = welch.averages(pair);
    let n_bins = averages.target.len();
    let frequency_hz = welch.frequency_hz();
    let gain = averages.gain();
    let coherence = averages.coherence();
    let phase_rad = welch.phase_rad(&frequency_hz, &averages, &coherence);
    let delay_s: Vec<f64> = phase_rad.iter().zip(&frequency_hz).map(|(p, f)| delay(*p, *f)).collect();
    let noise = welch.noise(&averages);
    let (mut gain_std, mut delay_std_s) = (vec![f64::NAN; n_bins], vec![f64::NAN; n_bins]);
    let (mut gain_interval, mut delay_interval_s) = (vec![[f64::NAN; 2]; n_bins], vec![[f64::NAN; 2]; n_bins]);
    for k in 0..n_bins {
        let Some(Supported { std, t }) = noise.supported(k, gain[k]) else { continue };
        gain_std[k] = std;
        gain_interval[k] = [gain[k] - t * std, gain[k] + t * std];
        delay_std_s[k] = std / gain[k] / (2.0 * PI * frequency_hz[k]);
        delay_interval_s[k] = [delay_s[k] - t * delay_std_s[k], delay_s[k] + t * delay_std_s[k]];
    }
    let density = 2.0 / (pair.rate_hz() * welch.window_power * welch.n_segments as f64);
    // Every bin but Nyquist stands for two of the two-sided spectrum.
    let one_sided = |powers: Vec<f64>| -> Vec<f64> {
        powers.iter().enumerate().map(|(k, p)| p * density * if k + 1 == n_bins { 0.5 } else { 1.0 }).collect()
    };
    Ok(FrequencyResponse {
        frequency_hz,
        gain,
        phase_rad,
        delay_s,
        coherence,
        target_psd: one_sided(averages.target),
        measured_psd: one_sided(averages.measured),
        gain_std,
        gain_interval,
        delay_std_s,
        delay_interval_s,
        n_segments: welch.n_segments,
        segment_s: welch.segment_s,
        align_s,
        unaligned,
    })
}

/// The plan at the alignment that was given, or found.
fn aligned(pair: &Pair<'_>, config: &ResponseConfig) -> Result<(Welch, f64, Option<Unaligned>)> {
    if let Some(align_s) = config.align_s {
        return Ok((Welch::new(pair, config)?, align_s, None));
    }
    // Whatever else is wrong is said first.
    let plain = Welch::new(pair, config)?;
    let evaluator = Evaluator::new(pair.n_samples(), pair.rate_hz(), EvaluatorConfig::default())?;
    let found = evaluator.evaluate(&mut evaluator.state(), pair)?;
    if let Some(reason) = found.reason.filter(Reason::is_undetermined) {
        return Ok((plain, 0.0, Some(Unaligned::Unknown(reason))));
    }
    let delay_s = found.delay_s;
    match Welch::new(pair, &ResponseConfig { align_s: Some(delay_s), ..*config }) {
        Ok(welch) => Ok((welch, delay_s, None)),
        Err(Error::Setting { .. }) => Ok((plain, 0.0, Some(Unaligned::NoRoom { delay_s }))),
        Err(error) => Err(error),
    }
}

/// The checked plan: which samples are segments, and what is done to each.
pub(crate) struct Welch {
    pub(crate) spectrum: Spectrum,
    pub(crate) segment: usize,
    pub(crate) hop: usize,
    pub(crate) n_segments: usize,
    /// Samples by which measured's segments start later than target's.
    lag: isize,
    /// Windows over target and measured; they differ by the rest of the alignment.
    windows: [Option<Vec<f64>>; 2],
    detrend: Detrend,
    /// The derivative of target's window, a second, where dispersion is corrected.
    derivative: Option<Vec<f64>>,
    /// The rest of the alignment, in seconds.
    rest_s: f64,
    /// sum w^2.
    pub(crate) window_power: f64,
    pub(crate) segment_s: f64,
}

impl Welch {
    pub(crate) fn new(pair: &Pair<'_>, config: &ResponseConfig) -> Result<Self> {
        pair.check_samples()?;
        let (n, rate_hz) = (pair.n_samples(), pair.rate_hz());
        let ResponseConfig { segment_s, overlap, window, detrend, align_s, dispersion } = *config;
        let align_s = align_s.unwrap_or(0.0);
        if n < MIN_SEGMENT * MIN_SEGMENTS {
            return Err(Error::TooShort { expected: MIN_SEGMENT * MIN_SEGMENTS, found: n });
        }
        if !(0.0..1.0).contains(&overlap) {
            return Err(Error::Setting {
                name: "overlap",
                expected: "a share from 0 to below 1".to_owned(),
                found: overlap,
            });
        }
        let segment = match segment_s {
            None => (1usize << (n / 8).max(1).ilog2()).max(MIN_SEGMENT),
            Some(s) => {
                let samples = (s * rate_hz).round();
                if !(samples >= MIN_SEGMENT as f64 && samples <= n as f64) {
                    let expected = format!(
                        "from {} s ({MIN_SEGMENT} samples) to less than the record's {} s",
                        MIN_SEGMENT as f64 / rate_hz,
                        n as f64 / rate_hz
                    );
                    return Err(Error::Setting { name: "segment_s", expected, found: s });
                }
                samples as usize
            }
        };
        let hop = segment - (overlap * segment as f64) as usize;
        let shortest = segment + (MIN_SEGMENTS - 1) * hop;
        if n < shortest {
            let expected = format!("short enough for {MIN_SEGMENTS} segments in the record's {} s", n as f64 / rate_hz);
            return Err(Error::Setting { name: "segment_s", expected, found: segment as f64 / rate_hz });
        }
        let lag = (align_s * rate_hz).round();
        let longest = n - shortest;
        // NaN is outside too.
        if !(-(longest as f64)..=longest as f64).contains(&lag) {
            let expected =
                format!("within +-{} s, which leaves {MIN_SEGMENTS} segments of the record", longest as f64 / rate_hz);
            return Err(Error::Setting { name: "align_s", expected, found: align_s });
        }
        let spectrum = Spectrum::new(SpectrumConfig {
            n_samples: segment,
            rate_hz,
            data_decimation: 1,
            frequency_decimation: 1,
            // Target and measured have windows of their own here.
            window: Window::Boxcar,
            detrend: Detrend::None,
            band_hz: None,
        })?;
        let rest = align_s * rate_hz - lag;
        let windows = [window.shifted(segment, rest), window.coefficients(segment)];
        let half_later = window.shifted(segment, rest + 0.5).filter(|_| dispersion);
        let derivative = half_later.zip(window.shifted(segment, rest - 0.5)).map(|(later, earlier)| {
            later.iter().zip(&earlier).map(|(later, earlier)| (later - earlier) * rate_hz).collect()
        });
        let window_power = windows[1].as_ref().map_or(segment as f64, |w| w.iter().map(|v| v * v).sum());
        let lag = lag as isize;
        let n_segments = (n - lag.unsigned_abs() - segment) / hop + 1;
        Ok(Self {
            spectrum,
            segment,
            hop,
            n_segments,
            lag,
            windows,
            detrend,
            derivative,
            rest_s: rest / rate_hz,
            window_power,
            segment_s: segment as f64 / rate_hz,
        })
    }

    pub(crate) fn frequency_hz(&self) -> Vec<f64> {
        (1..=self.spectrum.n_bins()).map(|k| k as f64 * self.spectrum.delta_f_hz()).collect()
    }

    /// Samples of target and measured in segment s.
    fn ranges(&self, s: usize) -> [Range<usize>; 2] {
        [(-self.lag).max(0), self.lag.max(0)].map(|first| {
            let start = s * self.hop + first as usize;
            start..start + self.segment
        })
    }

    /// Calls `each` with every segment's number and its transforms, still packed.
    pub(crate) fn segments(&self, pair: &Pair<'_>, mut each: impl FnMut(usize, &SpectrumState)) {
        let windows = [self.windows[0].as_deref(), self.windows[1].as_deref()];
        self.segments_under(&[windows], pair, |s, _, state| each(s, state));
    }

    /// The same under each of several pairs of windows in turn, with their index.
    fn segments_under(
        &self,
        pairs_of_windows: &[[Option<&[f64]>; 2]],
        pair: &Pair<'_>,
        mut each: impl FnMut(usize, usize, &SpectrumState),
    ) {
        let mut state = self.spectrum.state();
        let mut windowed = [vec![0.0; self.segment], vec![0.0; self.segment]];
        for s in 0..self.n_segments {
            let [target, measured] = self.ranges(s);
            let signals = [&pair.target()[target], &pair.measured()[measured]];
            for (which, windows) in pairs_of_windows.iter().enumerate() {
                for ((samples, window), out) in signals.into_iter().zip(windows).zip(&mut windowed) {
                    out.copy_from_slice(samples);
                    if let Some(line) = self.detrend.line(samples) {
                        out.iter_mut().enumerate().for_each(|(i, x)| *x -= line.at(i));
                    }
                    if let Some(window) = window {
                        out.iter_mut().zip(*window).for_each(|(x, w)| *x *= w);
                    }
                }
                self.spectrum.transform(&mut state, &windowed[0], &windowed[1]);
                each(s, which, &state);
            }
        }
    }

    /// w_i of measured.
    pub(crate) fn measured_window(&self, i: usize) -> f64 {
        self.windows[1].as_ref().map_or(1.0, |w| w[i])
    }

    /// r_0, r_1, ... up to the last hop at which segments share samples.
    fn sharing(&self) -> Vec<f64> {
        let n_shared = (self.segment - 1) / self.hop;
        let at = |lag: usize| match &self.windows[1] {
            None => (self.segment - lag) as f64,
            Some(w) => w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum(),
        };
        (0..=n_shared.min(MAX_SHARING)).map(|m| at(m * self.hop) / self.window_power).collect()
    }

    pub(crate) fn averages(&self, pair: &Pair<'_>) -> Averages {
        let n_bins = self.spectrum.n_bins();
        let mut averages = Averages::new(n_bins);
        let mut sharing = Sharing::new(self.sharing(), n_bins);
        let mut moved = Moved::new(n_bins);
        let turns = turns(self.spectrum.fft_len());
        let [target, measured] = [0, 1].map(|i| self.windows[i].as_deref());
        let mut windows = vec![[target, measured]];
        windows.extend(self.derivative.as_deref().map(|derivative| [Some(derivative), measured]));
        self.segments_under(&windows, pair, |s, which, state| {
            if which == 1 {
                self.spectrum.visit(state, &mut MoveBeside { sums: &mut moved, target: &averages.latest });
                return;
            }
            self.spectrum.visit(state, &mut averages);
            // Phases counted from the record's start.
            let start = s * self.hop % turns.len();
            let turned = averages.latest.iter().enumerate().map(|(k, x)| x * turns[(k + 1) * start % turns.len()]);
            sharing.push(turned);
        });
        (averages.shared, averages.shared_squared) = sharing.finish();
        if self.derivative.is_some() {
            self.correct(&moved, &mut averages);
        }
        averages
    }

    /// Replaces sum |I|^2 and sum conj(I) O by those of I + c D, of which c follows in turn.
    fn correct(&self, moved: &Moved, averages: &mut Averages) {
        let (target, cross) = (averages.target.clone(), averages.cross.clone());
        for _ in 0..MAX_TURNS {
            let shifts = self.shifts(averages);
            for (k, c) in shifts.into_iter().enumerate() {
                averages.target[k] = target[k] + 2.0 * (c * moved.beside[k]).re + c.norm_sqr() * moved.target[k];
                averages.cross[k] = cross[k] + c.conj() * moved.cross[k];
            }
        }
    }

    /// c = i H'/(2 pi H) less the alignment that the window already has, in seconds; the slope of ln H over neighbouring bins,
    /// each weighted by its energy.
    fn shifts(&self, averages: &Averages) -> Vec<Complex<f64>> {
        let Averages { target, measured, cross, .. } = averages;
        let n_bins = target.len();
        let delta_f = self.spectrum.delta_f_hz();
        let coherent = |k: usize| cross[k].norm() / target[k] * (cross[k].norm() / measured[k]) >= LEADING_COHERENCE;
        let at = |k: usize| {
            if !coherent(k) {
                return None;
            }
            let around = k.saturating_sub(NEIGHBOURS)..(k + NEIGHBOURS + 1).min(n_bins);
            let points = around.filter(|&j| coherent(j)).map(|j| {
                let ratio = cross[j] / target[j] / (cross[k] / target[k]);
                (target[j] / target[k], j as f64 - k as f64, ratio.ln())
            });
            let (mut sum, mut first, mut log) = (0.0, 0.0, Complex::default());
            for (weight, x, y) in points.clone() {
                sum += weight;
                first += weight * x;
                log += y * weight;
            }
            let (mean, mean_log) = (first / sum, log / sum);
            let (mut spread, mut slope) = (0.0, Complex::default());
            for (weight, x, y) in points {
                spread += weight * (x - mean).powi(2);
                slope += (y - mean_log) * (weight * (x - mean));
            }
            let shift = Complex::<f64>::i() * (slope / spread / delta_f) / (2.0 * PI) - self.rest_s;
            let largest = SMALL_SHIFT * self.segment_s;
            (spread > 0.0 && shift.norm() < largest).then_some(shift)
        };
        (0..n_bins).map(|k| at(k).unwrap_or_default()).collect()
    }

    /// arg H, with the phase of the whole samples put back after unwrapping.
    pub(crate) fn phase_rad(&self, frequency_hz: &[f64], averages: &Averages, coherence: &[f64]) -> Vec<f64> {
        let lag_turns = self.lag as f64 / self.spectrum.fft_len() as f64;
        let aligned = self.lag != 0 || self.rest_s != 0.0;
        let mut phase_rad = unwrap(frequency_hz, &averages.cross, coherence, aligned);
        for (k, phase) in phase_rad.iter_mut().enumerate() {
            *phase -= 2.0 * PI * (k + 1) as f64 * lag_turns;
        }
        phase_rad
    }

    /// What the residuals say of the noise.
    pub(crate) fn noise(&self, averages: &Averages) -> Noise {
        let Averages { target, measured, cross, shared, shared_squared, .. } = averages;
        let n = self.n_segments as f64;
        let sharing = self.sharing();
        // tr(R^2)
        let all_squared =
            n + sharing[1..].iter().enumerate().map(|(i, r)| 2.0 * (n - (i + 1) as f64).max(0.0) * r * r).sum::<f64>();
        let (window, squared) = self.window_spectrum();
        let fft_len = self.spectrum.fft_len();
        let at = |spectrum: &[f64], k: usize| spectrum[k.min(fft_len - k)] / spectrum[0];
        let neighbours = 1.0 + 2.0 * (1..fft_len / 2).map(|k| at(&squared, k).powi(2)).sum::<f64>();
        let overlaps_too_much = (self.segment - 1) / self.hop > MAX_SHARING;
        let n_bins = target.len();
        let mut noise = Noise {
            power: vec![f64::NAN; n_bins],
            leverage: vec![f64::NAN; n_bins],
            target: target.clone(),
            degrees: vec![f64::NAN; n_bins],
            neighbours,
        };
        for k in 0..n_bins {
            let mirrored = at(&squared, 2 * (k + 1)).max(at(&window, k + 1)) > MIRRORED;
            if target[k] == 0.0 || mirrored || overlaps_too_much {
                continue;
            }
            let leverage = shared[k] / target[k];
            let trace = n - leverage;
            let trace_squared = all_squared - 2.0 * shared_squared[k] / target[k] + leverage * leverage;
            // The difference keeps no more than round-off of what it is taken from.
            let round_off = n * f64::EPSILON * measured[k];
            let residual = (measured[k] - cross[k].norm_sqr() / target[k]).max(round_off);
            noise.power[k] = residual / trace;
            noise.leverage[k] = leverage;
            noise.degrees[k] = 2.0 * trace * trace / trace_squared;
        }
        noise
    }

    /// Magnitudes of the transforms of w and w^2, from zero to Nyquist.
    fn window_spectrum(&self) -> (Vec<f64>, Vec<f64>) {
        let ones = vec![1.0; self.segment];
        let window = self.windows[1].as_deref().unwrap_or(&ones);
        let squared: Vec<f64> = window.iter().map(|w| w * w).collect();
        let mut state = self.spectrum.state();
        let mut sums = Averages::new(self.spectrum.n_bins());
        self.spectrum.transform(&mut state, window, &squared);
        self.spectrum.visit(&state, &mut sums);
        let with_zero = |samples: &[f64], powers: Vec<f64>| {
            std::iter::once(samples.iter().sum()).chain(powers.into_iter().map(f64::sqrt)).collect()
        };
        (with_zero(window, sums.target), with_zero(&squared, sums.measured))
    }
}

/// exp(-2 pi i j / n), j = 0 .. n-1.
fn turns(n: usize) -> Vec<Complex<f64>> {
    (0..n).map(|j| Complex::cis(-2.0 * PI * j as f64 / n as f64)).collect()
}

/// The noise of measured at every bin; NaN where the segments cannot tell.
pub(crate) struct Noise {
    /// S = E |N_s|^2.
    pub(crate) power: Vec<f64>,
    /// u^H R u.
    pub(crate) leverage: Vec<f64>,
    /// sum |I_s|^2.
    target: Vec<f64>,
    /// Degrees of freedom of `power`.
    pub(crate) degrees: Vec<f64>,
    /// Bins that the window makes one of.
    pub(crate) neighbours: f64,
}

/// An interval that holds: the standard error of gain, and its half width in standard errors.
pub(crate) struct Supported {
    pub(crate) std: f64,
    pub(crate) t: f64,
}

impl Noise {
    /// var H, for noise of the power given.
    pub(crate) fn variance(&self, k: usize, power: f64) -> f64 {
        power * self.leverage[k] / self.target[k]
    }

    /// Whether bin k has an interval, see [`FrequencyResponse`].
    pub(crate) fn supported(&self, k: usize, gain: f64) -> Option<Supported> {
        let std = (self.variance(k, self.power[k]) / 2.0).sqrt();
        // NaN is refused too. Most bins hold nothing, and t, which is dear, is never below the normal quantile.
        if !(self.degrees[k] >= MIN_DEGREES && NORMAL * std < LINEAR * gain) {
            return None;
        }
        let t = student_t_975(self.degrees[k]);
        (t * std < LINEAR * gain).then_some(Supported { std, t })
    }
}

/// Chooses the turn of each phase nearest to what the delay of the last coherent bin predicts, going up from the first, which is
/// within half a turn; of `aligned` segments going up and down from the strongest: bins that hold next to nothing would lead
/// the others astray.
fn unwrap(frequency_hz: &[f64], cross: &[Complex<f64>], coherence: &[f64], aligned: bool) -> Vec<f64> {
    let n = cross.len();
    let mut phase_rad = vec![0.0; n];
    let mut lead = |bins: &mut dyn Iterator<Item = usize>, mut delay_so_far: f64| {
        for k in bins {
            let (f, wrapped) = (frequency_hz[k], cross[k].arg());
            let predicted = -2.0 * PI * f * delay_so_far;
            phase_rad[k] = wrapped + 2.0 * PI * ((predicted - wrapped) / (2.0 * PI)).round();
            if coherence[k] >= LEADING_COHERENCE {
                delay_so_far = delay(phase_rad[k], f);
            }
        }
    };
    let strongest = (0..n).filter(|k| aligned && coherence[*k] >= LEADING_COHERENCE);
    let from = strongest.max_by(|a, b| cross[*a].norm_sqr().total_cmp(&cross[*b].norm_sqr())).unwrap_or(0);
    lead(&mut (from..n), 0.0);
    if from > 0 {
        lead(&mut (0..from).rev(), delay(cross[from].arg(), frequency_hz[from]));
    }
    phase_rad
}

/// Sums over the segments, an entry a bin.
pub(crate) struct Averages {
    /// sum |I_s|^2
    pub(crate) target: Vec<f64>,
    /// sum |O_s|^2
    pub(crate) measured: Vec<f64>,
    /// sum conj(I_s) O_s
    pub(crate) cross: Vec<Complex<f64>>,
    /// I_s of the last segment.
    pub(crate) latest: Vec<Complex<f64>>,
    /// I^H R I
    shared: Vec<f64>,
    /// I^H R^2 I
    shared_squared: Vec<f64>,
}

impl Averages {
    pub(crate) fn new(n_bins: usize) -> Self {
        let (zero, complex_zero) = (vec![0.0; n_bins], vec![Complex::default(); n_bins]);
        Self {
            target: zero.clone(),
            measured: zero,
            cross: complex_zero.clone(),
            latest: complex_zero,
            shared: Vec::new(),
            shared_squared: Vec::new(),
        }
    }

    pub(crate) fn gain(&self) -> Vec<f64> {
        self.cross.iter().zip(&self.target).map(|(c, t)| c.norm() / t).collect()
    }

    pub(crate) fn coherence(&self) -> Vec<f64> {
        let powers = self.target.iter().zip(&self.measured);
        self.cross.iter().zip(powers).map(|(c, (t, m))| c.norm() / t * (c.norm() / m)).collect()
    }
}

impl Sink for Averages {
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let k = bins.first - 1 + i;
            let target = Complex::new(bins.target_re[i], bins.target_im[i]);
            let measured = Complex::new(bins.measured_re[i], bins.measured_im[i]);
            self.target[k] += target.norm_sqr();
            self.measured[k] += measured.norm_sqr();
            self.cross[k] += target.conj() * measured;
            self.latest[k] = target;
        }
    }
}

/// Sums over the segments with D, target's transform under the derivative of its window.
struct Moved {
    /// sum |D|^2
    target: Vec<f64>,
    /// sum conj(D) O
    cross: Vec<Complex<f64>>,
    /// sum conj(I) D
    beside: Vec<Complex<f64>>,
}

impl Moved {
    fn new(n_bins: usize) -> Self {
        let zero = vec![Complex::default(); n_bins];
        Self { target: vec![0.0; n_bins], cross: zero.clone(), beside: zero }
    }
}

/// Adds a segment's D to the sums, given its I.
struct MoveBeside<'a> {
    sums: &'a mut Moved,
    target: &'a [Complex<f64>],
}

impl Sink for MoveBeside<'_> {
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let k = bins.first - 1 + i;
            let moved = Complex::new(bins.target_re[i], bins.target_im[i]);
            let measured = Complex::new(bins.measured_re[i], bins.measured_im[i]);
            self.sums.target[k] += moved.norm_sqr();
            self.sums.cross[k] += moved.conj() * measured;
            self.sums.beside[k] += self.target[k].conj() * moved;
        }
    }
}

/// Sums I^H R I and |R I|^2 while the segments pass by; only those that share samples are kept.
struct Sharing {
    r: Vec<f64>,
    /// The last 2 M + 1 segments, M the lags of R; zero before the first and after the last.
    rows: VecDeque<Vec<Complex<f64>>>,
    /// Segments until the first stands in the middle.
    waiting: usize,
    shared: Vec<f64>,
    shared_squared: Vec<f64>,
}

impl Sharing {
    fn new(r: Vec<f64>, n_bins: usize) -> Self {
        let rows = vec![vec![Complex::default(); n_bins]; 2 * r.len() - 1].into();
        Self { waiting: r.len(), r, rows, shared: vec![0.0; n_bins], shared_squared: vec![0.0; n_bins] }
    }

    fn push(&mut self, segment: impl Iterator<Item = Complex<f64>>) {
        if let Some(mut row) = self.rows.pop_front() {
            row.iter_mut().zip(segment).for_each(|(x, new)| *x = new);
            self.rows.push_back(row);
        }
        self.waiting = self.waiting.saturating_sub(1);
        if self.waiting > 0 {
            return;
        }
        let centre = self.r.len() - 1;
        for k in 0..self.shared.len() {
            let middle = self.rows[centre][k];
            let mut product = middle;
            for (m, r) in self.r.iter().enumerate().skip(1) {
                product += (self.rows[centre - m][k] + self.rows[centre + m][k]) * r;
            }
            self.shared[k] += (middle.conj() * product).re;
            self.shared_squared[k] += product.norm_sqr();
        }
    }

    fn finish(mut self) -> (Vec<f64>, Vec<f64>) {
        // Until the last segment has stood in the middle.
        for _ in 1..self.r.len() {
            self.push(std::iter::repeat(Complex::default()));
        }
        (self.shared, self.shared_squared)
    }
}
