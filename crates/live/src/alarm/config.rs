//! The user's limits for alarms, and the rules by which all of them come and go: rows of the table of settings.

use rthstrack::setting::concerns::ALARMS;
use rthstrack::setting::{Configuration, Kind};

/// Highest whole number without another bound.
const MOST: u64 = u32::MAX as u64;

rthstrack::configuration! {
    /// The user's limits; `None` watches nothing.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct AlarmConfig for ALARMS => {
        /// Largest |delay|.
        limit_delay_s: Option<f64> = None, Kind::Positive, "s", "Limit of the delay", ALARMS;
        /// Largest |amplitude - 1|.
        limit_amplitude: Option<f64> = None, Kind::Positive, "", "Limit of the amplitude", ALARMS;
        /// Delay at which the test becomes unstable ('rthstrack simulate' tells it).
        critical_delay_s: Option<f64> = None, Kind::Positive, "s", "Critical delay", ALARMS;
        /// Share of the critical delay that a lag may reach.
        critical_fraction: f64 = 0.5, Kind::Positive, "", "Share of the critical delay", ALARMS;
        /// Most samples lost within a window.
        limit_lost: Option<u64> = None, Kind::Whole(0, MOST), "", "Limit of lost samples", ALARMS;
        /// Longest time without a sample.
        silence_s: Option<f64> = Some(1.0), Kind::Positive, "s", "Silence", ALARMS;
        /// Longest time in which samples came and an actuator that moves could not be judged.
        unjudged_s: Option<f64> = None, Kind::Positive, "s", "Not judged", ALARMS;
        /// An alarm is over when this share of its limit below it.
        hysteresis: f64 = 0.1, Kind::Share, "", "Hysteresis", ALARMS;
        /// Raise it only when the limit was exceeded for so long. Silence has its own time.
        minimum_duration_s: f64 = 0.0, Kind::NotNegative, "s", "Least duration", ALARMS;
        /// Whether an alarm that is over waits for a reset.
        latch: bool = true, Kind::Flag, "", "Latched", ALARMS;
    }
}

impl AlarmConfig {
    /// What is no limit but a rule for all alarms.
    pub const RULES: [&str; 3] = ["hysteresis", "minimum_duration_s", "latch"];

    /// Everything that is wrong with it, a line each.
    pub fn mistakes(&self) -> Vec<String> {
        let wrong = Self::TABLE.iter().filter_map(|setting| setting.refuse(&(setting.get)(self)).err());
        wrong.map(|error| error.to_string()).collect()
    }
}
