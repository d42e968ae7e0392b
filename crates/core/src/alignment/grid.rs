//! Frequency bins, of all samples, of averages of a few, or of every second.

use std::ops::Range;

use crate::error::Result;
use crate::noise::Cosines;
use crate::spectrum::{Spectrum, SpectrumConfig};
use crate::sums;

/// Bins and how to come to them.
pub(super) struct Grid {
    pub(super) spectrum: Spectrum,
    /// Samples that become one before the transform, and whether by their average or by the first of them.
    pub(super) step: usize,
    average: bool,
    /// What makes good the droop of the cascade, or of the averages.
    pub(super) correction: Option<Vec<f64>>,
    /// cos of the bins' frequencies, in radians a sample (after averaging).
    pub(super) cosines: Cosines,
}

impl Grid {
    pub(super) fn new(config: SpectrumConfig) -> Result<Self> {
        let spectrum = Spectrum::new(config)?;
        let cosines = cosines(&spectrum, config.rate_hz);
        Ok(Self { step: 1, average: false, correction: spectrum.correction(), spectrum, cosines })
    }

    /// The bins up to the rate over 2 `factor`, from averages of a quarter as many samples: what aliases onto the highest of
    /// them is held to 2 % of its energy, which serves for a variance.
    pub(super) fn low(config: SpectrumConfig, factor: usize) -> Result<Self> {
        let step = factor / 4;
        let rate_hz = config.rate_hz / step as f64;
        let band_hz = Some((0.0, config.rate_hz / (2 * factor) as f64));
        let spectrum =
            Spectrum::new(SpectrumConfig { n_samples: config.n_samples.div_ceil(step), rate_hz, band_hz, ..config })?;
        let gain = |w: f64| (0.5 * w * step as f64).sin() / (0.5 * w).sin();
        let correction = Some(radians(&spectrum, config.rate_hz).map(|w| (step * step) as f64 / gain(w)).collect());
        let cosines = cosines(&spectrum, rate_hz);
        Ok(Self { spectrum, step, average: true, correction, cosines })
    }

    /// All bins of every second sample, of samples that hold nothing above a quarter of their rate.
    pub(super) fn halved(config: SpectrumConfig) -> Result<Self> {
        let (n_samples, rate_hz) = (config.n_samples.div_ceil(2), config.rate_hz / 2.0);
        let half = Self::new(SpectrumConfig { n_samples, rate_hz, ..config })?;
        let correction = Some(vec![2.0; half.spectrum.n_bins()]);
        Ok(Self { step: 2, correction, ..half })
    }

    /// The samples that are transformed, one for each `step`.
    pub(super) fn shorten(&self, samples: &[f64], out: &mut [f64]) {
        if self.average {
            sums::block_means(samples, self.step, out);
        } else {
            out.iter_mut().zip(samples.iter().step_by(self.step)).for_each(|(y, x)| *y = *x);
        }
    }

    /// Length of the zero-padded samples over Q.
    pub(super) fn folded_len(&self) -> f64 {
        (self.step * self.spectrum.folded_len()) as f64
    }

    /// Where those of them stand that come of samples in `within` only.
    pub(super) fn shortened(&self, within: &Range<usize>) -> Range<usize> {
        within.start.div_ceil(self.step)..within.end / self.step
    }
}

fn cosines(spectrum: &Spectrum, rate_hz: f64) -> Cosines {
    let radians = 2.0 * std::f64::consts::PI * spectrum.delta_f_hz() / rate_hz;
    Cosines::new(radians, spectrum.first(), spectrum.n_bins())
}

/// Frequencies of the kept bins, in radians a sample of `rate_hz`.
pub(super) fn radians(spectrum: &Spectrum, rate_hz: f64) -> impl Iterator<Item = f64> + use<> {
    let bin = 2.0 * std::f64::consts::PI * spectrum.delta_f_hz() / rate_hz;
    let first = spectrum.first();
    (first..first + spectrum.n_bins()).map(move |k| k as f64 * bin)
}
