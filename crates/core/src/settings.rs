//! The settings of an evaluation, and which of them go together. A new setting is a row of [`EvaluatorConfig`]: options, checks,
//! defaults, Python's settings, reports and documents are made from it (`make settings` writes what is kept in files).

use crate::bad_samples::found::BadSamples;
use crate::decimate::Decimator;
use crate::error::{Error, Result};
use crate::setting::concerns::{EVALUATION, MONITOR, STUDY};
use crate::setting::{Configuration, Kind, choices};
use crate::window::{Detrend, Window};

/// Whom most settings concern.
const ALL: u8 = EVALUATION | MONITOR | STUDY;

/// How gain and delay are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Estimator {
    /// The published weighted average, Eq 12.
    Fei,
    /// Eq 12 on the target shifted by the delay, until no phase is left: no bias of windows, of drift or of averaged phases.
    Aligned,
    /// One gain and one delay by least squares on the shifted target: as precise as the noise allows.
    #[default]
    LeastSquares,
}

impl Estimator {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Estimator); 3] =
        [("fei", Estimator::Fei), ("aligned", Estimator::Aligned), ("least_squares", Estimator::LeastSquares)];

    /// For what is made of the sums of Eq 12 themselves; others need `needed`.
    pub(crate) fn must_be_published(self, needed: &str) -> Result<()> {
        if self == Estimator::Fei {
            return Ok(());
        }
        Err(Error::Combination { name: "estimator", value: self.code().to_owned(), needed: needed.to_owned() })
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

choices!(Estimator);
choices!(Noise);
choices!(Decimator);
choices!(Window);
choices!(Detrend);
choices!(BadSamples);

crate::configuration! {
    /// The user's numbers.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct EvaluatorConfig for 0 => {
        /// How gain and delay are estimated.
        estimator: Estimator = Estimator::LeastSquares, Kind::Choice(Estimator::CODES), "", "Estimator", ALL;
        /// P, a power of two: keeps the frequencies up to rate / (2 P); of a monitor up to rate / (4 P).
        data_decimation: usize = 1, Kind::PowerOfTwo, "", "Data decimation P", EVALUATION | MONITOR;
        /// Q, a power of two: keeps every Q-th frequency bin.
        frequency_decimation: usize = 1, Kind::PowerOfTwo, "", "Frequency decimation Q", EVALUATION | MONITOR;
        /// How P is carried out, exactly on the bins of the undecimated transform or filtered as published.
        decimator: Decimator = Decimator::Spectral, Kind::Choice(Decimator::CODES), "", "Decimator", EVALUATION | STUDY;
        /// l of Eqs 7 and 12: bins weigh |target|^l.
        weight_power: u32 = 2, Kind::Whole(1, 16), "", "Weight power l", EVALUATION;
        /// Window over the record.
        window: Window = Window::Boxcar, Kind::Choice(Window::CODES), "", "Window", EVALUATION | MONITOR;
        /// What is subtracted before the window; where nothing is asked for the mean, of fei nothing.
        detrend: Option<Detrend> = None, Kind::Choice(Detrend::CODES), "", "Detrend", ALL;
        /// Lowest and highest frequency judged, both included.
        band_hz: Option<(f64, f64)> = None, Kind::Band, "Hz", "Band", ALL;
        /// Largest delay or lead looked for by all estimators but fei; where the record does not go on beyond what is judged, a
        /// quarter of that at most.
        max_delay_s: f64 = 0.25, Kind::Positive, "s", "Largest delay looked for", ALL;
        /// Of delays that fit equally well, the target being one tone, all estimators but fei take the one nearest to this;
        /// without it the answer is "ambiguous".
        expected_delay_s: Option<f64> = None, Kind::Number, "s", "Expected delay", ALL;
        /// What least_squares takes the noise on measured for.
        noise: Noise = Noise::White, Kind::Choice(Noise::CODES), "", "Noise on measured", EVALUATION | STUDY;
        /// Standard deviation of the noise on target over that on measured, for least_squares.
        noise_ratio: f64 = 0.0, Kind::NotNegative, "", "Noise on target over that on measured", EVALUATION | STUDY;
        /// What all estimators but fei do with spikes, dropouts, frozen and clipped samples, and held ones.
        bad_samples: BadSamples = BadSamples::LeaveOut, Kind::Choice(BadSamples::CODES), "", "Bad samples", EVALUATION | STUDY;
    }
}

impl EvaluatorConfig {
    /// The published average, all else as by default.
    pub fn published() -> Self {
        Self { estimator: Estimator::Fei, ..Self::default() }
    }

    /// What is subtracted before the window: what was asked for, else the published average takes the samples as they are, and
    /// the others, which fit one gain to both, do not take two sensors to share a zero.
    pub fn detrending(&self) -> Detrend {
        self.detrend.unwrap_or(if self.estimator == Estimator::Fei { Detrend::None } else { Detrend::Mean })
    }

    /// What can be said of the settings without a record.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_each()?;
        check_expected_delay(self.expected_delay_s, self.max_delay_s)?;
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
