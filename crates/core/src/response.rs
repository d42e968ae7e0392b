//! Gain, phase, delay and coherence over frequency, because a real actuator's delay is not one number.

use std::f64::consts::PI;

use num_complex::Complex;

use crate::error::{Error, Result};
use crate::pair::Pair;
use crate::spectrum::{Bins, Sink, Spectrum, SpectrumConfig};
use crate::tracking::delay;
use crate::window::{Detrend, Window};

/// Shortest segment that is worth a spectrum.
const MIN_SEGMENT: usize = 16;
/// Fewest segments from which a coherence means anything.
const MIN_SEGMENTS: usize = 2;
/// Bins below this coherence do not lead the unwrapping of the phase.
const LEADING_COHERENCE: f64 = 0.5;

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
}

impl Default for ResponseConfig {
    fn default() -> Self {
        Self { segment_s: None, overlap: 0.5, window: Window::Hann, detrend: Detrend::Mean }
    }
}

/// One entry a frequency, from the first bin above zero to Nyquist.
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
    /// Segments averaged.
    pub n_segments: usize,
    /// Length of a segment, in seconds.
    pub segment_s: f64,
}

/// Averages cross-spectra over overlapping windowed segments (Welch 1967), zero-padded to a power of two.
///
/// S_IO = mean conj(I) O, so that its phase is negative on lag.
///
/// # Errors
/// [`Error::TooShort`], [`Error::Setting`] for a segment or overlap that leaves fewer than two segments,
/// [`Error::NotFinite`], [`Error::Range`].
pub fn frequency_response(pair: &Pair<'_>, config: &ResponseConfig) -> Result<FrequencyResponse> {
    pair.check_samples()?;
    let (n, rate_hz) = (pair.n_samples(), pair.rate_hz());
    if n < MIN_SEGMENT * MIN_SEGMENTS {
        return Err(Error::TooShort { expected: MIN_SEGMENT * MIN_SEGMENTS, found: n });
    }
    let overlap = config.overlap;
    if !(0.0..1.0).contains(&overlap) {
        return Err(Error::Setting {
            name: "overlap",
            expected: "a share from 0 to below 1".to_owned(),
            found: overlap,
        });
    }
    let segment = match config.segment_s {
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
    let n_segments = (n - segment) / hop + 1;
    if n_segments < MIN_SEGMENTS {
        let expected = format!("short enough for {MIN_SEGMENTS} segments in the record's {} s", n as f64 / rate_hz);
        return Err(Error::Setting { name: "segment_s", expected, found: segment as f64 / rate_hz });
    }
    let spectrum = Spectrum::new(SpectrumConfig {
        n_samples: segment,
        rate_hz,
        data_decimation: 1,
        frequency_decimation: 1,
        window: config.window,
        detrend: config.detrend,
        band_hz: None,
    })?;
    let n_bins = spectrum.n_bins();
    let mut state = spectrum.state();
    let mut averages = Averages {
        target: vec![0.0; n_bins],
        measured: vec![0.0; n_bins],
        cross: vec![Complex::new(0.0, 0.0); n_bins],
    };
    for s in 0..n_segments {
        let range = s * hop..s * hop + segment;
        spectrum.transform(&mut state, &pair.target()[range.clone()], &pair.measured()[range]);
        spectrum.visit(&state, &mut averages);
    }
    let window_power: f64 =
        config.window.coefficients(segment).map_or(segment as f64, |w| w.iter().map(|v| v * v).sum());
    let density = 2.0 / (rate_hz * window_power * n_segments as f64);
    let Averages { target, measured, cross } = averages;
    let frequency_hz: Vec<f64> = (1..=n_bins).map(|k| k as f64 * spectrum.delta_f_hz()).collect();
    let gain = cross.iter().zip(&target).map(|(c, t)| c.norm() / t).collect();
    let coherence: Vec<f64> =
        cross.iter().zip(target.iter().zip(&measured)).map(|(c, (t, m))| c.norm() / t * (c.norm() / m)).collect();
    let phase_rad = unwrap(&frequency_hz, &cross, &coherence);
    let delay_s = phase_rad.iter().zip(&frequency_hz).map(|(p, f)| delay(*p, *f)).collect();
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
        target_psd: one_sided(target),
        measured_psd: one_sided(measured),
        n_segments,
        segment_s: segment as f64 / rate_hz,
    })
}

/// Chooses the turn of each phase nearest to what the delay of the last coherent bin predicts; the first is within half a turn.
fn unwrap(frequency_hz: &[f64], cross: &[Complex<f64>], coherence: &[f64]) -> Vec<f64> {
    let mut delay_so_far = 0.0;
    frequency_hz
        .iter()
        .zip(cross.iter().zip(coherence))
        .map(|(&f, (c, &coherence))| {
            let wrapped = c.arg();
            let predicted = -2.0 * PI * f * delay_so_far;
            let phase = wrapped + 2.0 * PI * ((predicted - wrapped) / (2.0 * PI)).round();
            if coherence >= LEADING_COHERENCE {
                delay_so_far = delay(phase, f);
            }
            phase
        })
        .collect()
}

/// Sums over the segments.
struct Averages {
    target: Vec<f64>,
    measured: Vec<f64>,
    cross: Vec<Complex<f64>>,
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
        }
    }
}
