//! Frequency bins, of all samples or of averages of a few.

use std::ops::Range;

use crate::error::Result;
use crate::spectrum::{Spectrum, SpectrumConfig};

/// Bins and how to come to them.
pub(super) struct Grid {
    pub(super) spectrum: Spectrum,
    /// Samples that are averaged before the transform.
    pub(super) step: usize,
    /// What makes good the droop of the cascade, or of the averages.
    pub(super) correction: Option<Vec<f64>>,
    /// cos of the bins' frequencies, in radians a sample (after averaging).
    pub(super) cosines: Vec<f64>,
}

impl Grid {
    pub(super) fn new(config: SpectrumConfig) -> Result<Self> {
        let spectrum = Spectrum::new(config)?;
        let cosines = radians(&spectrum, config.rate_hz).map(f64::cos).collect();
        Ok(Self { step: 1, correction: spectrum.correction(), spectrum, cosines })
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
        let cosines = radians(&spectrum, rate_hz).map(f64::cos).collect();
        Ok(Self { spectrum, step, correction, cosines })
    }

    /// Length of the zero-padded samples over Q.
    pub(super) fn folded_len(&self) -> f64 {
        (self.step * self.spectrum.folded_len()) as f64
    }

    /// Where the averages of samples in `within` stand, those that are of such samples only.
    pub(super) fn averaged(&self, within: &Range<usize>) -> Range<usize> {
        within.start.div_ceil(self.step)..within.end / self.step
    }
}

/// Frequencies of the kept bins, in radians a sample of `rate_hz`.
pub(super) fn radians(spectrum: &Spectrum, rate_hz: f64) -> impl Iterator<Item = f64> + use<> {
    let bin = 2.0 * std::f64::consts::PI * spectrum.delta_f_hz() / rate_hz;
    let first = spectrum.first();
    (first..first + spectrum.n_bins()).map(move |k| k as f64 * bin)
}
