//! Eqs 6 to 12: one complex number for the whole record.

use std::f64::consts::PI;

use num_complex::Complex;

use crate::bad_samples::BadFound;
use crate::reason::Reason;

type Number = f64;
type Interval = (f64, f64);

/// Reads a number of a tracking, or both ends of an interval.
#[derive(Debug, Clone, Copy)]
pub enum Getter {
    /// One number.
    Number(fn(&Tracking) -> f64),
    /// Lower and upper end.
    Interval(fn(&Tracking) -> (f64, f64)),
}

/// What is known of a number of every [`Tracking`].
#[derive(Debug, Clone, Copy)]
pub struct NumberKind {
    /// Its name in programs and files.
    pub name: &'static str,
    /// Whether the readings of a running test are written with it.
    pub live: bool,
    /// Reads it.
    pub of: Getter,
}

/// The numbers, a row each: name, kind, what it is where nothing is determined, whether live readings are written with it.
macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident: $kind:ident = $nothing:expr, live: $live:literal;)+) => {
        /// Amplitude and delay of measured over target.
        ///
        /// `fei` gives neither standard deviations nor intervals: its error is mostly bias. What could not be determined is
        /// NaN, and `reason` says why.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Tracking {
            /// sum O conj(I) |I|^(l-2) / sum |I|^l (Eq 12 without its quotient); A exp(j phi) of the other estimators.
            pub fei: Complex<f64>,
            $($(#[$doc])* pub $name: $kind,)+
            /// Bad samples that were found, by kind, and left out.
            pub bad_samples: BadFound,
            /// Why there is no number, or no interval.
            pub reason: Option<Reason>,
        }

        impl Tracking {
            /// All numbers, in the order in which they are written.
            pub const NUMBERS: &'static [NumberKind] =
                &[$(NumberKind { name: stringify!($name), live: $live, of: Getter::$kind(|t| t.$name) }),+];

            /// Nothing but the reason.
            pub(crate) const fn undetermined(reason: Reason) -> Self {
                Self {
                    fei: Complex::new(f64::NAN, f64::NAN),
                    $($name: $nothing,)+
                    bad_samples: BadFound::NONE,
                    reason: Some(reason),
                }
            }
        }
    };
}

numbers! {
    /// A = |FEI| (Eq 11a); 1 is perfect.
    amplitude: Number = f64::NAN, live: true;
    /// d = -phi / (2 pi f_eq), in seconds (Eq 10); positive when measured lags.
    delay_s: Number = f64::NAN, live: true;
    /// phi = atan2(Im FEI, Re FEI), in radians (Eq 11b); negative on lag. NaN where measured is zero throughout. Of the other
    /// estimators -2 pi f_eq d, which may exceed half a turn.
    phase_rad: Number = f64::NAN, live: true;
    /// f_eq = sum f |I|^l / sum |I|^l, in hertz (Eq 7).
    equivalent_frequency_hz: Number = f64::NAN, live: true;
    /// Standard deviation of A.
    amplitude_std: Number = f64::NAN, live: false;
    /// 95 % interval of A.
    amplitude_interval: Interval = (f64::NAN, f64::NAN), live: true;
    /// Standard deviation of d, in seconds.
    delay_std_s: Number = f64::NAN, live: false;
    /// 95 % interval of d, in seconds.
    delay_interval_s: Interval = (f64::NAN, f64::NAN), live: true;
    /// Coherence of the residual with the target, 0 to 1: what is left still follows the target, at other gains and delays.
    residual_coherence: Number = f64::NAN, live: false;
    /// 1 - sum (O - A I_d)^2 / sum (O - mean O)^2: the share of measured that one gain and one delay explain.
    goodness: Number = f64::NAN, live: false;
    /// Standard deviation of the noise that is the target's own, in its unit, where it was taken into account; else 0.
    target_noise_std: Number = 0.0, live: false;
}

impl Tracking {
    /// Whether gain and delay are determined.
    pub fn is_valid(&self) -> bool {
        !self.reason.is_some_and(|r| r.is_undetermined())
    }

    /// The numbers without their precision.
    pub(crate) fn without_interval(self, reason: Reason) -> Self {
        let (amplitude_interval, delay_interval_s) = ((f64::NAN, f64::NAN), (f64::NAN, f64::NAN));
        let (amplitude_std, delay_std_s) = (f64::NAN, f64::NAN);
        Self { amplitude_std, amplitude_interval, delay_std_s, delay_interval_s, reason: Some(reason), ..self }
    }
}

/// The bins behind a [`Tracking`], one entry a kept bin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spectra {
    /// f_k, in hertz.
    pub frequency_hz: Vec<f64>,
    /// |I_k|^l / sum |I|^l; they sum to one.
    pub weights: Vec<f64>,
    /// I_k, the transform of the detrended, windowed, zero-padded target, in unit of the signal (Eq 1a).
    pub target: Vec<Complex<f64>>,
    /// O_k (Eq 1b).
    pub measured: Vec<Complex<f64>>,
}

/// d = -phi / (2 pi f), in seconds (Eq 10): a negative phase is a lag, a positive delay.
#[inline]
pub fn delay(phase_rad: f64, frequency_hz: f64) -> f64 {
    // Not -phase_rad, which would make a perfect 0 a -0.
    (0.0 - phase_rad) / (2.0 * PI * frequency_hz)
}
