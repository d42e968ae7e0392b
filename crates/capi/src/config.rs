//! What goes in.

use rthstrack::{Detrend, Estimator, EvaluatorConfig, MonitorConfig, Window};

use crate::boundary::{guarded, is_sound_out};
use crate::status::rthstrack_status::{self, *};

/// The interface that this header describes; see rthstrack_abi_version.
pub const RTHSTRACK_ABI_VERSION: u32 = 2;

/// Window over the samples.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum rthstrack_window {
    /// No window: every sample counts alike.
    RTHSTRACK_WINDOW_BOXCAR = 0,
    /// 0.5 - 0.5 cos.
    RTHSTRACK_WINDOW_HANN = 1,
    /// 0.54 - 0.46 cos.
    RTHSTRACK_WINDOW_HAMMING = 2,
    /// 0.42 - 0.5 cos + 0.08 cos 2.
    RTHSTRACK_WINDOW_BLACKMAN = 3,
    /// The five-term flat-top window.
    RTHSTRACK_WINDOW_FLATTOP = 4,
    /// Flat with cosine ends, a quarter of the window at either end.
    RTHSTRACK_WINDOW_TUKEY = 5,
}

/// What is subtracted before the window.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum rthstrack_detrend {
    /// The mean; with RTHSTRACK_ESTIMATOR_FEI nothing.
    RTHSTRACK_DETREND_USUAL = -1,
    /// Nothing.
    RTHSTRACK_DETREND_NONE = 0,
    /// The mean.
    RTHSTRACK_DETREND_MEAN = 1,
    /// The straight line of least squares.
    RTHSTRACK_DETREND_LINEAR = 2,
}

const DETREND_USUAL: i32 = rthstrack_detrend::RTHSTRACK_DETREND_USUAL as i32;

/// How gain and delay are estimated.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum rthstrack_estimator {
    /// The published weighted average; gives no intervals.
    RTHSTRACK_ESTIMATOR_FEI = 0,
    /// The same on the target shifted by the delay, until no phase is left.
    RTHSTRACK_ESTIMATOR_ALIGNED = 1,
    /// One gain and one delay by least squares on the shifted target.
    RTHSTRACK_ESTIMATOR_LEAST_SQUARES = 2,
}

/// The settings of a monitor. Fill it by rthstrack_monitor_config_default, then change what is to differ.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct rthstrack_monitor_config {
    /// sizeof(rthstrack_monitor_config); do not change it.
    pub size: u32,
    /// RTHSTRACK_ABI_VERSION; do not change it.
    pub abi_version: u32,
    /// Incoming samples a second. Default 1024.
    pub rate_hz: f64,
    /// Length of the window, in seconds. Default 4.
    pub window_s: f64,
    /// Readings a second; the rate kept may differ, see rthstrack_monitor_update_hz. Default 64.
    pub update_hz: f64,
    /// Lowest frequency kept, in hertz. Default NaN: both NaN keep all, with data_decimation above 1 up to rate / (4
    /// P).
    pub band_low_hz: f64,
    /// Highest frequency kept, in hertz. Default NaN.
    pub band_high_hz: f64,
    /// Largest delay or lead looked for by the estimators that shift the target, in seconds. Default 0.25.
    pub max_delay_s: f64,
    /// Of delays that fit equally well (the target is one tone), the one nearest to this is taken, in seconds.
    /// Default NaN: not known.
    pub expected_delay_s: f64,
    /// A window is judged where the target's amplitude in it, sqrt(2) times its standard deviation, is at least this.
    /// Default 0.
    pub minimum_amplitude: f64,
    /// A rthstrack_window. Default RTHSTRACK_WINDOW_BOXCAR.
    pub window: i32,
    /// A rthstrack_detrend. Default RTHSTRACK_DETREND_USUAL.
    pub detrend: i32,
    /// A rthstrack_estimator. Default RTHSTRACK_ESTIMATOR_LEAST_SQUARES.
    pub estimator: i32,
    /// Actuators that are stepped together. Default 1.
    pub n_actuators: u32,
    /// P, a power of two: samples are decimated as they come. Readings cost less, and speak of a window that ends
    /// rthstrack_monitor_latency_s earlier. Default 1.
    pub data_decimation: u32,
    /// Q, a power of two: keeps every Q-th frequency bin. Default 1.
    pub frequency_decimation: u32,
}

impl rthstrack_monitor_config {
    const SIZE: usize = std::mem::size_of::<Self>();

    fn of(config: &MonitorConfig) -> Self {
        let evaluator = &config.evaluator;
        let (band_low_hz, band_high_hz) = evaluator.band_hz.unwrap_or((f64::NAN, f64::NAN));
        Self {
            size: Self::SIZE as u32,
            abi_version: RTHSTRACK_ABI_VERSION,
            rate_hz: config.rate_hz,
            window_s: config.window_s,
            update_hz: config.update_hz,
            band_low_hz,
            band_high_hz,
            max_delay_s: evaluator.max_delay_s,
            expected_delay_s: evaluator.expected_delay_s.unwrap_or(f64::NAN),
            minimum_amplitude: config.minimum_amplitude,
            window: code(&Window::NAMES, evaluator.window),
            detrend: evaluator.detrend.map_or(DETREND_USUAL, |detrend| code(&Detrend::NAMES, detrend)),
            estimator: code(&Estimator::NAMES, evaluator.estimator),
            n_actuators: config.n_actuators as u32,
            data_decimation: evaluator.data_decimation as u32,
            frequency_decimation: evaluator.frequency_decimation as u32,
        }
    }

    /// Whether it was filled by this library for a program that knows the same layout.
    pub(crate) fn fits(size: u32, abi_version: u32) -> bool {
        size as usize == Self::SIZE && abi_version == RTHSTRACK_ABI_VERSION
    }

    pub(crate) fn misfit(size: u32, abi_version: u32) -> String {
        format!(
            "config.size and config.abi_version must be {} and {RTHSTRACK_ABI_VERSION}, not {size} and {abi_version}: \
             compile with this library's rthstrack.h and fill config by rthstrack_monitor_config_default",
            Self::SIZE
        )
    }

    /// The core's settings, or the one line that says what is wrong.
    pub(crate) fn read(&self) -> Result<MonitorConfig, String> {
        let band_hz = (self.band_low_hz, self.band_high_hz);
        let whole = !(band_hz.0.is_nan() && band_hz.1.is_nan());
        Ok(MonitorConfig {
            rate_hz: self.rate_hz,
            window_s: self.window_s,
            update_hz: self.update_hz,
            minimum_amplitude: self.minimum_amplitude,
            n_actuators: self.n_actuators as usize,
            evaluator: EvaluatorConfig {
                band_hz: whole.then_some(band_hz),
                window: choice("window", &Window::NAMES, self.window, "a RTHSTRACK_WINDOW_...")?,
                detrend: match self.detrend {
                    DETREND_USUAL => None,
                    asked => Some(choice("detrend", &Detrend::NAMES, asked, "a RTHSTRACK_DETREND_...")?),
                },
                estimator: choice("estimator", &Estimator::NAMES, self.estimator, "a RTHSTRACK_ESTIMATOR_...")?,
                data_decimation: self.data_decimation as usize,
                frequency_decimation: self.frequency_decimation as usize,
                max_delay_s: self.max_delay_s,
                expected_delay_s: (!self.expected_delay_s.is_nan()).then_some(self.expected_delay_s),
                ..MonitorConfig::default().evaluator
            },
        })
    }
}

/// Place of a choice in its list, which is its number in C.
fn code<T: PartialEq>(names: &[(&str, T)], chosen: T) -> i32 {
    names.iter().position(|(_, choice)| *choice == chosen).map_or(-1, |place| place as i32)
}

fn choice<T: Copy>(name: &str, names: &[(&str, T)], code: i32, expected: &str) -> Result<T, String> {
    let found = usize::try_from(code).ok().and_then(|place| names.get(place));
    found
        .map(|(_, choice)| *choice)
        .ok_or_else(|| format!("{name} must be {expected}, 0 to {}, not {code}", names.len() - 1))
}

/// Fills the settings with their defaults. `size` is sizeof *config, `abi_version` is RTHSTRACK_ABI_VERSION, both as
/// the program was compiled: if the library lays the settings out in another way, nothing is written.
///
/// Any thread; real-time safe.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_ABI_MISMATCH.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_config_default(
    config: *mut rthstrack_monitor_config,
    size: usize,
    abi_version: u32,
) -> rthstrack_status {
    guarded(|| {
        if !is_sound_out(config) {
            return RTHSTRACK_BAD_POINTER;
        }
        if size != rthstrack_monitor_config::SIZE || abi_version != RTHSTRACK_ABI_VERSION {
            return RTHSTRACK_ABI_MISMATCH;
        }
        // SAFETY: not null, aligned, and of the size that the caller states.
        unsafe { config.write(rthstrack_monitor_config::of(&MonitorConfig::default())) };
        RTHSTRACK_OK
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_those_of_the_core() {
        let default = MonitorConfig::default();
        assert_eq!(rthstrack_monitor_config::of(&default).read(), Ok(default));
    }

    #[test]
    fn every_choice_has_the_number_that_the_header_gives_it() {
        use rthstrack_detrend::*;
        use rthstrack_estimator::*;
        use rthstrack_window::*;
        let windows = [
            RTHSTRACK_WINDOW_BOXCAR,
            RTHSTRACK_WINDOW_HANN,
            RTHSTRACK_WINDOW_HAMMING,
            RTHSTRACK_WINDOW_BLACKMAN,
            RTHSTRACK_WINDOW_FLATTOP,
            RTHSTRACK_WINDOW_TUKEY,
        ];
        for ((name, window), number) in Window::NAMES.iter().zip(windows) {
            assert_eq!(code(&Window::NAMES, *window), number as i32);
            assert!(format!("{number:?}").to_lowercase().ends_with(name));
        }
        for ((name, detrend), number) in
            Detrend::NAMES.iter().zip([RTHSTRACK_DETREND_NONE, RTHSTRACK_DETREND_MEAN, RTHSTRACK_DETREND_LINEAR])
        {
            assert_eq!(code(&Detrend::NAMES, *detrend), number as i32);
            assert!(format!("{number:?}").to_lowercase().ends_with(name));
        }
        let estimators = [RTHSTRACK_ESTIMATOR_FEI, RTHSTRACK_ESTIMATOR_ALIGNED, RTHSTRACK_ESTIMATOR_LEAST_SQUARES];
        for ((name, estimator), number) in Estimator::NAMES.iter().zip(estimators) {
            assert_eq!(code(&Estimator::NAMES, *estimator), number as i32);
            assert!(format!("{number:?}").to_lowercase().ends_with(name));
        }
    }
}
