//! The settings of an evaluation, and which of them go together.

use crate::bad_samples::found::BadSamples;
use crate::decimate::Decimator;
use crate::error::{Error, Result};
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
    pub(crate) fn check(&self) -> Result<()> {
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
