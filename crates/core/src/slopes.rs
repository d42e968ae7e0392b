//! Gain and delay over frequency as two straight lines, so that one number is not quoted alone where it misleads.

use std::f64::consts::PI;

use num_complex::Complex;
use rustfft::FftPlanner;

use crate::error::{Error, Result};
use crate::pair::Pair;
use crate::quantile::student_t_975;
use crate::response::{Averages, Noise, ResponseConfig, Welch};
use crate::tracking::delay;

/// Share of the target's energy that the strongest bins hold together; the others are left out.
const ENERGY_SHARE: f64 = 0.99;
/// Fewest bins that make a line with something left to judge it by.
const MIN_BINS: usize = 3;
/// Bins to either side over which the noise is averaged, for more degrees of freedom.
const POOLED: usize = 4;
/// Times that the target is aligned anew; each leaves a share of about the delay over the segment's length, more where drift
/// rules.
const MAX_ALIGNMENTS: usize = 20;
/// Alignment stands still when it moves by less than this many samples.
const STILL_SAMPLES: f64 = 1e-3;
/// Changes over the band that count: this share of the gain,
const PRACTICAL_GAIN: f64 = 0.01;
/// this share of the delay,
const PRACTICAL_DELAY: f64 = 0.02;
/// and at least this share of a sample.
const PRACTICAL_SAMPLES: f64 = 0.05;
/// Departures from the line that noise does not explain: this many times what it does.
const BENT: f64 = 3.0;

/// The user's numbers for [`frequency_slopes`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SlopesConfig {
    /// Segments and windows; its `align_s`, 0 unless given, and `dispersion` are where the search starts.
    pub response: ResponseConfig,
    /// Lowest and highest frequency used, both included, in hertz.
    pub band_hz: Option<(f64, f64)>,
    /// Whether `align_s` is kept instead of sought.
    pub keep_alignment: bool,
}

/// value + slope (f - f_eq), with standard errors and 95 % intervals (low, high).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// At the equivalent frequency.
    pub value: f64,
    /// Its standard error.
    pub std: f64,
    /// Its interval.
    pub interval: [f64; 2],
    /// Change a hertz.
    pub slope: f64,
    /// Its standard error.
    pub slope_std: f64,
    /// Its interval.
    pub slope_interval: [f64; 2],
    /// Root of the weighted mean square of what the bins depart from the line.
    pub misfit: f64,
    /// Whether it changes over the band, by slope or bend, by more than noise explains and by enough to matter: 1 % of the gain;
    /// 2 % of the delay and a twentieth of a sample.
    pub varies: bool,
}

/// A(f) and d(f) as lines over the bins that carry the energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrequencySlopes {
    /// f_eq = sum f |I|^2 / sum |I|^2 over the bins used, in hertz.
    pub equivalent_frequency_hz: f64,
    /// A(f).
    pub gain: Slope,
    /// d(f), in seconds and seconds a hertz; positive when measured lags.
    pub delay: Slope,
    /// Lowest and highest bin used, in hertz.
    pub band_hz: (f64, f64),
    /// Bins used.
    pub n_bins: usize,
    /// The alignment at which the segments were taken, in seconds.
    pub align_s: f64,
    /// Whether what windows make of a varying gain and delay was corrected.
    pub dispersion: bool,
    /// Segments averaged.
    pub n_segments: usize,
    /// Length of a segment, in seconds.
    pub segment_s: f64,
}

/// Fits A(f) = A_eq + A' (f - f_eq) and d(f) = d_eq + d' (f - f_eq) to the frequency response.
///
/// Used are the strongest bins with an interval that hold 99 % of the energy of all such bins in the band, each weighted by the
/// inverse variance that even noise would give it (where gain or delay vary, residuals are larger where the motion is strong, and
/// must not take weight from there). The lines are linear in the noise of measured, so their standard errors follow from adding up what every
/// sample contributes, overlap of segments and kinship of neighbouring bins included. They speak of noise, not of departures from
/// a straight line; those are `misfit`.
///
/// Unless the alignment is kept, the target is aligned at the delay found (where delay varies, at the group delay
/// d + f_eq d', with which the motion's envelope travels) until that stands still. Where gain or delay vary, dispersion is
/// corrected; where they do not, that would only add noise.
///
/// # Errors
/// Those of [`crate::frequency_response`], [`Error::Band`], and [`Error::FewBins`] where fewer than three bins are left.
pub fn frequency_slopes(pair: &Pair<'_>, config: &SlopesConfig) -> Result<FrequencySlopes> {
    if let Some((low_hz, high_hz)) = config.band_hz
        && !(low_hz.is_finite() && high_hz.is_finite() && 0.0 <= low_hz && low_hz <= high_hz)
    {
        return Err(Error::Band { low_hz, high_hz });
    }
    let mut response = config.response;
    let mut found = fit(pair, &response, config.band_hz)?;
    for _ in 0..MAX_ALIGNMENTS {
        let FrequencySlopes { equivalent_frequency_hz, gain, delay, .. } = found;
        let envelope = if delay.varies { equivalent_frequency_hz * delay.slope } else { 0.0 };
        let before = response.align_s.unwrap_or(0.0);
        let align_s = if config.keep_alignment { before } else { delay.value + envelope };
        let dispersion = gain.varies || delay.varies;
        let still = (align_s - before).abs() * pair.rate_hz() < STILL_SAMPLES;
        if still && dispersion == response.dispersion {
            break;
        }
        response = ResponseConfig { align_s: Some(align_s), dispersion, ..response };
        found = match fit(pair, &response, config.band_hz) {
            // The record has no room for that.
            Err(Error::Setting { .. }) => break,
            other => other?,
        };
    }
    Ok(found)
}

fn fit(pair: &Pair<'_>, config: &ResponseConfig, band_hz: Option<(f64, f64)>) -> Result<FrequencySlopes> {
    let welch = Welch::new(pair, config)?;
    let averages = welch.averages(pair);
    let frequency_hz = welch.frequency_hz();
    let gain = averages.gain();
    let phase_rad = welch.phase_rad(&frequency_hz, &averages, &averages.coherence());
    let noise = welch.noise(&averages);
    let (low_hz, high_hz) = band_hz.unwrap_or((0.0, f64::INFINITY));
    let mut used: Vec<usize> = (0..gain.len())
        .filter(|&k| (low_hz..=high_hz).contains(&frequency_hz[k]) && noise.supported(k, gain[k]).is_some())
        .collect();
    strongest(&mut used, &averages.target);
    if used.len() < MIN_BINS {
        return Err(Error::FewBins { expected: MIN_BINS, found: used.len() });
    }
    let pooled: Vec<Pooled> = used.iter().map(|&k| Pooled::new(&noise, k)).collect();
    let degrees = pooled.iter().map(|p| p.degrees).fold(f64::INFINITY, f64::min);
    let f: Vec<f64> = used.iter().map(|&k| frequency_hz[k]).collect();
    let energy = used.iter().map(|&k| averages.target[k]);
    let equivalent_frequency_hz = f.iter().zip(energy.clone()).map(|(f, e)| f * e).sum::<f64>() / energy.sum::<f64>();
    // Half of var H is along H, half across it.
    let gain_variance: Vec<f64> = used.iter().zip(&pooled).map(|(&k, p)| noise.variance(k, p.power) / 2.0).collect();
    // dd = -Im(dH / H) / (2 pi f), dA = Re(|H| dH / H)
    let per_phase: Vec<f64> = f.iter().map(|f| 1.0 / (2.0 * PI * f)).collect();
    let delay_variance: Vec<f64> =
        (0..f.len()).map(|i| gain_variance[i] * (per_phase[i] / gain[used[i]]).powi(2)).collect();
    let gains: Vec<f64> = used.iter().map(|&k| gain[k]).collect();
    let delays: Vec<f64> = used.iter().zip(&f).map(|(&k, f)| delay(phase_rad[k], *f)).collect();
    let energies: Vec<f64> = used.iter().map(|&k| averages.target[k] / averages.target[used[0]]).collect();
    let phase_energies: Vec<f64> = (0..f.len()).map(|i| energies[i] * (gains[i] * f[i] / f[0]).powi(2)).collect();
    let gain_line = Line::new(&f, &gains, &energies, &gain_variance, equivalent_frequency_hz);
    let delay_line = Line::new(&f, &delays, &phase_energies, &delay_variance, equivalent_frequency_hz);

    // What one unit of dH at each bin does to each of the four numbers, as conj(g) in Re sum conj(g) N.
    let contribution = |weights: &[f64], factor: &dyn Fn(usize) -> Complex<f64>| -> Vec<Complex<f64>> {
        used.iter()
            .enumerate()
            .map(|(i, &k)| {
                let density = (pooled[i].power / welch.window_power).sqrt();
                factor(i) * weights[i] * density / averages.cross[k]
            })
            .collect()
    };
    let to_gain = |i: usize| Complex::new(gains[i], 0.0);
    let to_delay = |i: usize| Complex::new(0.0, per_phase[i]);
    let functionals = [
        contribution(&gain_line.to_value, &to_gain),
        contribution(&gain_line.to_slope, &to_gain),
        contribution(&delay_line.to_value, &to_delay),
        contribution(&delay_line.to_slope, &to_delay),
    ];
    let std = standard_errors(&welch, pair, &used, &functionals);
    let t = student_t_975(degrees);
    let band = (f[0], f[f.len() - 1]);
    let finish = |line: &Line, std: [f64; 2], practical: f64| {
        let change = line.slope.abs() * (band.1 - band.0);
        let sloped = line.slope.abs() > t * std[1] && change > practical;
        let bent = line.misfit > BENT * line.expected_misfit && 2.0 * line.misfit > practical;
        Slope {
            value: line.value,
            std: std[0],
            interval: [line.value - t * std[0], line.value + t * std[0]],
            slope: line.slope,
            slope_std: std[1],
            slope_interval: [line.slope - t * std[1], line.slope + t * std[1]],
            misfit: line.misfit,
            varies: sloped || bent,
        }
    };
    let practical_delay_s = (PRACTICAL_DELAY * delay_line.value.abs()).max(PRACTICAL_SAMPLES / pair.rate_hz());
    Ok(FrequencySlopes {
        equivalent_frequency_hz,
        gain: finish(&gain_line, [std[0], std[1]], PRACTICAL_GAIN * gain_line.value),
        delay: finish(&delay_line, [std[2], std[3]], practical_delay_s),
        band_hz: band,
        n_bins: used.len(),
        align_s: config.align_s.unwrap_or(0.0),
        dispersion: config.dispersion,
        n_segments: welch.n_segments,
        segment_s: welch.segment_s,
    })
}

/// Keeps the fewest bins that hold [`ENERGY_SHARE`] of all of them, in ascending order.
fn strongest(bins: &mut Vec<usize>, energy: &[f64]) {
    let enough = ENERGY_SHARE * bins.iter().map(|&k| energy[k]).sum::<f64>();
    bins.sort_by(|&a, &b| energy[b].total_cmp(&energy[a]));
    let mut sum = 0.0;
    let kept = bins.iter().take_while(|&&k| {
        let more = sum < enough;
        sum += energy[k];
        more
    });
    let kept = kept.count();
    bins.truncate(kept);
    bins.sort_unstable();
}

/// Noise around one bin.
struct Pooled {
    power: f64,
    degrees: f64,
}

impl Pooled {
    fn new(noise: &Noise, k: usize) -> Self {
        let around = k.saturating_sub(POOLED)..(k + POOLED + 1).min(noise.power.len());
        let (mut power, mut weight, mut degrees) = (0.0, 0.0, 0.0);
        for j in around.filter(|&j| noise.degrees[j].is_finite()) {
            power += noise.power[j] * noise.degrees[j];
            weight += noise.degrees[j];
            degrees += noise.degrees[j] / noise.neighbours;
        }
        // Alone, a bin is worth its own.
        Self { power: power / weight, degrees: degrees.max(noise.degrees[k]) }
    }
}

/// Weighted least squares, with what each bin contributes to it.
struct Line {
    value: f64,
    slope: f64,
    misfit: f64,
    /// What the variances alone make of the misfit.
    expected_misfit: f64,
    to_value: Vec<f64>,
    to_slope: Vec<f64>,
}

impl Line {
    fn new(f: &[f64], y: &[f64], weights: &[f64], variance: &[f64], f_eq: f64) -> Self {
        let sum: f64 = weights.iter().sum();
        let dot = |x: &[f64]| weights.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
        let centre = dot(f) / sum;
        let spread: f64 = weights.iter().zip(f).map(|(w, f)| w * (f - centre) * (f - centre)).sum();
        let to_slope: Vec<f64> = weights.iter().zip(f).map(|(w, f)| w * (f - centre) / spread).collect();
        let to_value: Vec<f64> = weights.iter().zip(&to_slope).map(|(w, s)| w / sum + (f_eq - centre) * s).collect();
        // About the mean, which costs no digits where y hardly changes.
        let mean = dot(y) / sum;
        let slope: f64 = to_slope.iter().zip(y).map(|(s, y)| s * (y - mean)).sum();
        let value = mean + slope * (f_eq - centre);
        let departures: f64 = (0..f.len()).map(|i| weights[i] * (y[i] - value - slope * (f[i] - f_eq)).powi(2)).sum();
        Self {
            value,
            slope,
            misfit: (departures / sum).sqrt(),
            expected_misfit: (dot(variance) / sum).sqrt(),
            to_value,
            to_slope,
        }
    }
}

/// Standard errors of the numbers Re sum over s, k of c_k conj(I_sk) N_sk, for noise of unit density.
///
/// Each is a sum over the samples of the noise, sum n_u y_u with y_u = sum over s of w_(u - t_s) Re sum_k c_k conj(I_sk)
/// exp(-2 pi i k (u - t_s) / n): its variance is sum y_u^2. The colour of the noise is in c.
fn standard_errors(welch: &Welch, pair: &Pair<'_>, used: &[usize], functionals: &[Vec<Complex<f64>>; 4]) -> [f64; 4] {
    let fft_len = welch.spectrum.fft_len();
    let fft = FftPlanner::new().plan_fft_forward(fft_len);
    let mut scratch = vec![Complex::default(); fft.get_inplace_scratch_len()];
    let mut bins = vec![Complex::default(); fft_len];
    let mut latest = Averages::new(welch.spectrum.n_bins());
    let n_covered = (welch.n_segments - 1) * welch.hop + welch.segment;
    let mut samples: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; n_covered]);
    welch.segments(pair, |s, state| {
        welch.spectrum.visit(state, &mut latest);
        for (functional, samples) in functionals.iter().zip(&mut samples) {
            bins.fill(Complex::default());
            for (&k, c) in used.iter().zip(functional) {
                bins[k + 1] = c * latest.latest[k].conj();
            }
            fft.process_with_scratch(&mut bins, &mut scratch);
            let start = s * welch.hop;
            for (i, y) in samples[start..start + welch.segment].iter_mut().enumerate() {
                *y += bins[i].re * welch.measured_window(i);
            }
        }
    });
    samples.map(|y| y.iter().map(|y| y * y).sum::<f64>().sqrt())
}
