//! What alarms watch: a row a kind.

use rthstrack::Reading;

use super::config::AlarmConfig;
use crate::names::Names;

/// What is known of an actuator or of the stream besides its readings; `None` where nothing is known now.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Observed {
    /// Of an actuator: for how long it has moved and not been judged.
    pub unjudged_s: Option<f64>,
    /// Of the stream: samples missing from the last window.
    pub lost: Option<u64>,
    /// Of the stream: for how long no sample has come.
    pub silent_s: Option<f64>,
}

/// Where a kind's value comes from, with its sign.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// A reading with numbers, of each actuator.
    Reading(fn(&Reading, &AlarmConfig) -> f64),
    /// What is observed of each actuator.
    Actuator(fn(&Observed) -> Option<f64>),
    /// What is observed of the stream.
    Stream(fn(&Observed) -> Option<f64>),
}

impl Source {
    /// Whether each actuator has its own.
    pub fn is_of_actuators(self) -> bool {
        !matches!(self, Source::Stream(_))
    }
}

/// A kind of alarm.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Its name on the wire, which never changes.
    pub name: &'static str,
    /// What people call it.
    pub title: &'static str,
    /// Which of the numbers that are shown it is about: amplitude or delay of an actuator, a count of the stream.
    pub quantity: Option<&'static str>,
    /// The setting that watches it.
    pub setting: &'static str,
    /// What it must not exceed; `None` is not watched.
    pub limit: fn(&AlarmConfig) -> Option<f64>,
    /// Where its value comes from.
    pub source: Source,
    /// What of the value is compared with the limit.
    pub compared: fn(f64) -> f64,
    /// Its limit is a time of its own: it need not be over it for any more.
    pub is_time: bool,
    /// Of the value that goes farthest, with its sign, and the limit.
    pub words: fn(f64, f64) -> String,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $variant:ident = $row:expr;)+) => {
        /// What an alarm watches.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Kind {
            $($(#[$doc])* $variant),+
        }

        impl Kind {
            /// All kinds.
            pub const ALL: &'static [Kind] = &[$(Kind::$variant),+];

            /// All that is known of it.
            pub fn row(self) -> &'static Row {
                match self {
                    $(Kind::$variant => {
                        const ROW: &Row = &$row;
                        ROW
                    })+
                }
            }
        }
    };
}

// A new kind is a row here; a limit of its own is a row in `config`, what is not in a reading a field of `Observed`.
kinds! {
    /// |d|: a lead is as bad as a lag.
    Delay = Row {
        name: "delay",
        title: "Delay",
        quantity: Some("delay"),
        setting: "limit_delay_s",
        limit: |config| config.limit_delay_s,
        source: Source::Reading(|reading, _| reading.tracking.delay_s),
        compared: f64::abs,
        is_time: false,
        words: |value, limit| {
            let way = if value < 0.0 { "lead" } else { "lag" };
            format!("{way} of up to {:.3} ms, limit {:.3} ms", 1e3 * value.abs(), 1e3 * limit)
        },
    };
    /// |A - 1|.
    Amplitude = Row {
        name: "amplitude",
        title: "Amplitude",
        quantity: Some("amplitude"),
        setting: "limit_amplitude",
        limit: |config| config.limit_amplitude,
        source: Source::Reading(|reading, _| reading.tracking.amplitude - 1.0),
        compared: f64::abs,
        is_time: false,
        words: |value, limit| {
            let way = if value < 0.0 { "small" } else { "large" };
            format!("amplitude {:.3}, too {way} by up to {:.3}, limit {limit:.3}", 1.0 + value, value.abs())
        },
    };
    /// d over the critical delay: a lead brings no structure nearer to it.
    CriticalDelay = Row {
        name: "critical_delay",
        title: "Critical delay",
        quantity: Some("delay"),
        setting: "critical_delay_s",
        limit: |config| config.critical_delay_s.map(|_| config.critical_fraction),
        source: Source::Reading(|reading, config| {
            config.critical_delay_s.map_or(f64::NAN, |critical_s| reading.tracking.delay_s / critical_s)
        }),
        compared: |value| value,
        is_time: false,
        words: |value, limit| {
            format!("delay is up to {:.0} % of the critical delay, limit {:.0} %", 100.0 * value, 100.0 * limit)
        },
    };
    /// Samples missing from the last window.
    Lost = Row {
        name: "lost",
        title: "Lost samples",
        quantity: Some("lost"),
        setting: "limit_lost",
        limit: |config| config.limit_lost.map(|n| n as f64),
        source: Source::Stream(|observed| observed.lost.map(|n| n as f64)),
        compared: |value| value,
        is_time: false,
        words: |value, limit| format!("up to {value} samples are missing from the last window, limit {limit}"),
    };
    /// Seconds without a sample.
    Silence = Row {
        name: "silence",
        title: "Silence",
        quantity: None,
        setting: "silence_s",
        limit: |config| config.silence_s,
        source: Source::Stream(|observed| observed.silent_s),
        compared: |value| value,
        is_time: true,
        // Without the time, which would change all the while.
        words: |_, limit| format!("no sample for more than {limit:.1} s"),
    };
    /// Seconds in which an actuator that moves was not judged.
    Unjudged = Row {
        name: "unjudged",
        title: "Not judged",
        quantity: None,
        setting: "unjudged_s",
        limit: |config| config.unjudged_s,
        source: Source::Actuator(|observed| observed.unjudged_s),
        compared: |value| value,
        is_time: true,
        words: |_, limit| format!("moves but could not be judged for more than {limit:.1} s: no other alarm watches it now"),
    };
}

impl Kind {
    /// Its name on the wire.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Its place in a set of alarms.
    pub fn bit(self) -> u32 {
        1 << self as u32
    }

    /// What it says of a value that was over the limit, as advice.
    pub fn raised_text(self, actuator: Option<usize>, value: f64, limit: f64, names: &Names) -> String {
        advice(actuator, names, &(self.row().words)(value, limit))
    }

    /// What it says when it is over.
    pub fn over_text(self, actuator: Option<usize>, names: &Names) -> String {
        advice(actuator, names, &format!("alarm '{}' is over", self.name()))
    }
}

fn advice(actuator: Option<usize>, names: &Names, text: &str) -> String {
    format!("advisory: {}{text}", names.before(actuator))
}
