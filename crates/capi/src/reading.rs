//! What comes out.

use rthstrack::Reading;

use crate::status::rthstrack_reason;

/// Gain and delay of one actuator over the latest window. NaN where there is no number.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct rthstrack_reading {
    /// Index of the incoming sample that completed the window.
    pub index: u64,
    /// From 0.
    pub actuator: u64,
    /// When that sample came, in seconds from sample 0: index / rate.
    pub time_s: f64,
    /// Centre of the window, in the same time; the decimator's delay is taken out.
    pub centre_s: f64,
    /// A: measured over target; 1 is perfect.
    pub amplitude: f64,
    /// d, in seconds; positive when measured lags target.
    pub delay_s: f64,
    /// phi, in radians; negative when measured lags.
    pub phase_rad: f64,
    /// f_eq, in hertz: d = -phi / (2 pi f_eq).
    pub equivalent_frequency_hz: f64,
    /// 95 % interval of A, lower and upper end; NaN where there is none.
    pub amplitude_interval: [f64; 2],
    /// 95 % interval of d, in seconds.
    pub delay_interval_s: [f64; 2],
    /// What the reason says in numbers; NaN where it says none.
    pub reason_values: [f64; 2],
    /// A rthstrack_reason: why there are no numbers, or no intervals.
    pub reason: i32,
    /// 1 where there are numbers, else 0.
    pub valid: i32,
}

impl rthstrack_reading {
    pub(crate) fn of(reading: &Reading) -> Self {
        let tracking = &reading.tracking;
        let (reason, reason_values) = rthstrack_reason::of(tracking.reason);
        let ends = |(low, high)| [low, high];
        Self {
            index: reading.index,
            actuator: reading.actuator as u64,
            time_s: reading.time_s,
            centre_s: reading.centre_s,
            amplitude: tracking.amplitude,
            delay_s: tracking.delay_s,
            phase_rad: tracking.phase_rad,
            equivalent_frequency_hz: tracking.equivalent_frequency_hz,
            amplitude_interval: ends(tracking.amplitude_interval),
            delay_interval_s: ends(tracking.delay_interval_s),
            reason_values,
            reason: reason as i32,
            valid: i32::from(reading.is_valid()),
        }
    }
}
