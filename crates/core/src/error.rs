//! Every way in which an evaluation can be refused. Each message is one line: what was wrong, what was expected, what was
//! found, and what to do.

use std::fmt;

/// Which signal of a pair an error speaks of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// The displacement that was asked for.
    Target,
    /// The displacement that the sensor reported.
    Measured,
    /// The measured restoring force.
    Force,
    /// The ground acceleration of a virtual test.
    GroundMotion,
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Signal::Target => "target",
            Signal::Measured => "measured",
            Signal::Force => "force",
            Signal::GroundMotion => "ground motion",
        })
    }
}

/// One thing wrong with a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Mistake {
    /// Where: `actuator[1].delay_s`, numbered from 1.
    pub key: String,
    /// What was expected and found.
    pub message: String,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.message)
    }
}

/// What was wrong with the samples or the settings.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A signal has another length than the target.
    Length {
        /// The signal that differs.
        signal: Signal,
        /// Samples of the target.
        expected: usize,
        /// Samples of the signal.
        found: usize,
    },
    /// Fewer samples than can be judged.
    TooShort {
        /// The least number of samples.
        expected: usize,
        /// Samples given.
        found: usize,
    },
    /// NaN or infinite samples.
    NotFinite {
        /// The signal that holds them.
        signal: Signal,
        /// How many of its samples are NaN or infinite.
        count: usize,
        /// Index of the first.
        first: usize,
    },
    /// The target never moves.
    ConstantTarget {
        /// Its value.
        value: f64,
    },
    /// Finite samples so large or so small that their powers leave the range of double precision.
    Range {
        /// The signal.
        signal: Signal,
        /// Its largest magnitude.
        peak: f64,
        /// Weight power in force.
        weight_power: u32,
    },
    /// The target has no energy at the bins that are kept.
    NoEnergy,
    /// Too few frequency bins carry energy and have an interval for a line through them.
    FewBins {
        /// The least number of bins.
        expected: usize,
        /// Bins left.
        found: usize,
    },
    /// The sampling rate is not a positive number.
    Rate {
        /// The rate given.
        found: f64,
    },
    /// A decimation factor is not a power of two.
    NotPowerOfTwo {
        /// Name of the setting.
        name: &'static str,
        /// The factor given.
        found: usize,
    },
    /// P, Q and the band together leave no frequency bin.
    NoBin {
        /// Length of the zero-padded record.
        fft_len: usize,
        /// P.
        data_decimation: usize,
        /// Q.
        frequency_decimation: usize,
        /// Lowest and highest frequency that P and Q leave, in hertz; NaN where they leave none.
        available_hz: (f64, f64),
        /// The band asked for.
        band_hz: Option<(f64, f64)>,
    },
    /// The band's ends are not finite, negative, or exchanged.
    Band {
        /// Lower end, in hertz.
        low_hz: f64,
        /// Upper end, in hertz.
        high_hz: f64,
    },
    /// A duration or ratio is out of range.
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// What it must be.
        expected: String,
        /// What it was.
        found: f64,
    },
    /// A setting is of another kind than it must be.
    Value {
        /// Name of the setting.
        name: &'static str,
        /// What it must be.
        expected: String,
        /// What it was, as it is written.
        found: String,
    },
    /// There is no setting of this name.
    UnknownSetting {
        /// The name given.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A setting that another one excludes.
    Combination {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it needs.
        needed: String,
    },
    /// The record is shorter than the filter of the Chebyshev decimator needs.
    TooShortForChebyshev {
        /// Least number of samples.
        expected: usize,
        /// Samples given.
        found: usize,
    },
    /// P and Q are to be chosen for the Chebyshev decimator.
    FactorsNeedSpectral,
    /// Single bins are asked of the Chebyshev decimator.
    KeyFrequenciesNeedSpectral,
    /// A plan was used on a pair of another length or rate.
    Plan {
        /// Length and rate of the plan.
        expected: (usize, f64),
        /// Length and rate of the pair.
        found: (usize, f64),
    },
    /// A virtual test's configuration, with everything that is wrong in it.
    Configuration(Vec<Mistake>),
    /// A virtual test left its bounds.
    Unstable {
        /// When, in seconds from its start.
        time_s: f64,
        /// The displacement that it may not exceed, m.
        bound_m: f64,
    },
}

impl Error {
    /// Its name in programs, which never changes.
    pub fn code(&self) -> &'static str {
        self.told().0
    }

    /// What it says in numbers, in SI units.
    pub fn values(&self) -> Vec<f64> {
        self.told().1
    }

    fn told(&self) -> (&'static str, Vec<f64>) {
        let counts = |counts: &[usize]| counts.iter().map(|n| *n as f64).collect();
        match *self {
            Error::Length { expected, found, .. } => ("length", counts(&[expected, found])),
            Error::TooShort { expected, found } => ("too_short", counts(&[expected, found])),
            Error::NotFinite { count, first, .. } => ("not_finite", counts(&[count, first])),
            Error::ConstantTarget { value } => ("constant_target", vec![value]),
            Error::Range { peak, weight_power, .. } => ("range", vec![peak, f64::from(weight_power)]),
            Error::NoEnergy => ("no_energy", vec![]),
            Error::FewBins { expected, found } => ("few_bins", counts(&[expected, found])),
            Error::Rate { found } => ("rate", vec![found]),
            Error::NotPowerOfTwo { found, .. } => ("not_power_of_two", counts(&[found])),
            Error::NoBin { fft_len, data_decimation, frequency_decimation, .. } => {
                ("no_bin", counts(&[fft_len, data_decimation, frequency_decimation]))
            }
            Error::Band { low_hz, high_hz } => ("band", vec![low_hz, high_hz]),
            Error::Setting { found, .. } => ("setting", vec![found]),
            Error::Value { .. } => ("value", vec![]),
            Error::UnknownSetting { .. } => ("unknown_setting", vec![]),
            Error::Combination { .. } => ("combination", vec![]),
            Error::TooShortForChebyshev { expected, found } => ("too_short_for_chebyshev", counts(&[expected, found])),
            Error::FactorsNeedSpectral => ("factors_need_spectral", vec![]),
            Error::KeyFrequenciesNeedSpectral => ("key_frequencies_need_spectral", vec![]),
            Error::Plan { expected, found } => ("plan", vec![expected.0 as f64, expected.1, found.0 as f64, found.1]),
            Error::Configuration(_) => ("configuration", vec![]),
            Error::Unstable { time_s, bound_m } => ("unstable", vec![time_s, bound_m]),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Length { signal, expected, found } => {
                write!(f, "{signal} has {found} samples but target has {expected}: both must cover the same samples")
            }
            Error::TooShort { expected, found } => {
                write!(f, "{found} samples are too few: at least {expected} are needed")
            }
            Error::NotFinite { signal, count, first } => write!(
                f,
                "{signal} has {count} NaN or infinite {} (first at index {first}): every sample must be a finite number; \
                 fill the gaps or cut them away",
                if *count == 1 { "sample" } else { "samples" }
            ),
            Error::ConstantTarget { value } => write!(
                f,
                "target is constant ({value}): it must move for its tracking to be judged; is this the right channel?"
            ),
            Error::Range { signal, peak, weight_power } => write!(
                f,
                "{signal}'s magnitudes (peak {peak:e}), raised to the weight power {weight_power}, leave the range of double \
                 precision: scale the channel to a usual unit or lower the weight power"
            ),
            Error::NoEnergy => {
                write!(f, "target has no energy at the bins that are kept: widen the band or lower P and Q")
            }
            Error::FewBins { expected, found } => write!(
                f,
                "{found} frequency {} energy and coherence enough for a line over frequency: at least {expected} are needed; \
                 take longer segments or a wider band",
                if *found == 1 { "bin has" } else { "bins have" }
            ),
            Error::Rate { found } => {
                write!(f, "rate_hz must be a positive finite number, not {found}")
            }
            Error::NotPowerOfTwo { name, found } => {
                write!(f, "{name} must be a power of two (1, 2, 4, ...), not {found}")
            }
            Error::NoBin { fft_len, data_decimation, frequency_decimation, available_hz, band_hz } => {
                write!(
                    f,
                    "no frequency bin is left: P = {data_decimation} and Q = {frequency_decimation} on {fft_len} points "
                )?;
                if available_hz.0.is_finite() {
                    write!(f, "keep {} to {} Hz", available_hz.0, available_hz.1)?;
                    if let Some((low, high)) = band_hz {
                        write!(f, " and the band asks for a bin in {low} to {high} Hz")?;
                    }
                    write!(f, "; widen the band or lower P or Q")
                } else {
                    write!(f, "keep nothing; lower P or Q")
                }
            }
            Error::Band { low_hz, high_hz } => {
                write!(f, "band_hz must be two finite frequencies 0 <= low <= high, not ({low_hz}, {high_hz})")
            }
            Error::Setting { name, expected, found } => write!(f, "{name} must be {expected}, not {found}"),
            Error::Value { name, expected, found } => write!(f, "{name} must be {expected}, not {found}"),
            Error::UnknownSetting { name, known } => {
                write!(f, "unknown setting {}: expected {known}", name.escape_debug())
            }
            Error::Combination { name, value, needed } => {
                write!(f, "{name} = {value} goes only with {needed}; change one of them")
            }
            Error::TooShortForChebyshev { expected, found } => write!(
                f,
                "{found} samples are too few for the chebyshev decimator: at least {expected} are needed; use the spectral one"
            ),
            Error::FactorsNeedSpectral => write!(
                f,
                "P and Q are chosen for the spectral decimator only, whose bins are those of the full transform: choose that \
                 decimator, or give P and Q"
            ),
            Error::KeyFrequenciesNeedSpectral => {
                write!(f, "key frequencies are bins of the full transform: choose the spectral decimator")
            }
            Error::Plan { expected, found } => write!(
                f,
                "this evaluator is planned for {} samples at {} Hz, not for {} at {} Hz",
                expected.0, expected.1, found.0, found.1
            ),
            Error::Configuration(mistakes) => {
                for (i, mistake) in mistakes.iter().enumerate() {
                    write!(f, "{}{mistake}", if i == 0 { "" } else { "; " })?;
                }
                Ok(())
            }
            Error::Unstable { time_s, bound_m } => {
                write!(f, "unstable: a displacement exceeded {bound_m:.4} m at {time_s:.3} s")
            }
        }
    }
}

impl std::error::Error for Error {}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
