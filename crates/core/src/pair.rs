//! One target with its measured, checked once and borrowed after.

use crate::error::{Error, Result, Signal};
use crate::sums;

/// Fewest samples that can be judged.
pub const MIN_SAMPLES: usize = 4;

/// Target and measured displacement on one sample clock.
///
/// Construction checks what costs nothing: equal lengths, at least [`MIN_SAMPLES`], a positive rate, a target that moves.
/// NaN and infinity are looked for by whoever reads all samples anyway (a transform carries them into every bin), or at
/// once by [`Pair::check_finite`].
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    target: &'a [f64],
    measured: &'a [f64],
    rate_hz: f64,
}

impl<'a> Pair<'a> {
    /// Checks and borrows both signals.
    ///
    /// # Errors
    /// [`Error::Rate`], [`Error::Length`], [`Error::TooShort`], [`Error::ConstantTarget`].
    pub fn new(target: &'a [f64], measured: &'a [f64], rate_hz: f64) -> Result<Self> {
        check_rate(rate_hz)?;
        if target.len() != measured.len() {
            return Err(Error::Length { signal: Signal::Measured, expected: target.len(), found: measured.len() });
        }
        if target.len() < MIN_SAMPLES {
            return Err(Error::TooShort { expected: MIN_SAMPLES, found: target.len() });
        }
        // Ends at the first sample that differs, so it costs nothing on a target that moves.
        if target.iter().all(|&v| v == target[0]) && target[0].is_finite() {
            return Err(Error::ConstantTarget { value: target[0] });
        }
        Ok(Self { target, measured, rate_hz })
    }

    /// The displacement that was asked for.
    pub fn target(&self) -> &'a [f64] {
        self.target
    }

    /// The displacement that the sensor reported.
    pub fn measured(&self) -> &'a [f64] {
        self.measured
    }

    /// Samples a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Number of samples of either signal.
    pub fn n_samples(&self) -> usize {
        self.target.len()
    }

    /// Looks at every sample of both signals.
    ///
    /// # Errors
    /// [`Error::NotFinite`] with the count and the first index.
    pub fn check_finite(&self) -> Result<()> {
        check_finite(self.target, Signal::Target)?;
        check_finite(self.measured, Signal::Measured)
    }

    /// Looks at every sample, and whether squares of them stay well within double precision.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::Range`].
    pub fn check_samples(&self) -> Result<()> {
        self.check_powers(2, SQUARABLE)
    }

    /// The same for products of four samples.
    pub(crate) fn check_fourth_powers(&self) -> Result<()> {
        self.check_powers(4, 1e-60..=LARGEST_FOURTH_POWER)
    }

    fn check_powers(&self, weight_power: u32, magnitudes: std::ops::RangeInclusive<f64>) -> Result<()> {
        for (signal, samples) in [(Signal::Target, self.target), (Signal::Measured, self.measured)] {
            let (peak, finite) = sums::peak(samples);
            if !finite {
                check_finite(samples, signal)?;
            }
            if peak != 0.0 && !magnitudes.contains(&peak) {
                return Err(Error::Range { signal, peak, weight_power });
            }
        }
        Ok(())
    }
}

/// Magnitudes whose squares, and sums and ratios of these, keep their precision.
const SQUARABLE: std::ops::RangeInclusive<f64> = 1e-120..=1e120;

/// Largest magnitude of which products of four keep their precision.
const LARGEST_FOURTH_POWER: f64 = 1e60;

/// Whether a sample is finite, and not too large for [`Pair::check_fourth_powers`].
pub(crate) fn is_fourth_power(sample: f64) -> bool {
    sample.abs() <= LARGEST_FOURTH_POWER
}

/// max |x|
pub(crate) fn peak(samples: &[f64]) -> f64 {
    sums::peak(samples).0
}

/// Refuses a rate that is not a positive finite number.
pub(crate) fn check_rate(rate_hz: f64) -> Result<()> {
    if rate_hz.is_finite() && rate_hz > 0.0 { Ok(()) } else { Err(Error::Rate { found: rate_hz }) }
}

/// Refuses NaN and infinity, naming how many and where the first is.
pub(crate) fn check_finite(samples: &[f64], signal: Signal) -> Result<()> {
    let Some(first) = samples.iter().position(|v| !v.is_finite()) else {
        return Ok(());
    };
    let count = samples[first..].iter().filter(|v| !v.is_finite()).count();
    Err(Error::NotFinite { signal, count, first })
}
