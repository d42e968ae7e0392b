//! The user's limits and rules for alarms: a row each, from which the struct, its checks, its reading, the command's options come.

/// What a setting may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// A number above 0.
    Positive,
    /// The same; the command's 0 is none.
    PositiveOrOff,
    /// 0 or more.
    NotNegative,
    /// From 0 to below 1.
    Share,
    /// A whole number.
    Count,
    /// True or false; the command's option says what is not usual.
    Flag,
}

impl Range {
    /// Its name for Python.
    pub fn name(self) -> &'static str {
        match self {
            Range::Positive => "positive",
            Range::PositiveOrOff => "positive_or_off",
            Range::NotNegative => "not_negative",
            Range::Share => "share",
            Range::Count => "count",
            Range::Flag => "flag",
        }
    }

    /// Whether a value lies in it.
    fn holds(self, value: f64) -> bool {
        match self {
            Range::Positive | Range::PositiveOrOff => value.is_finite() && value > 0.0,
            Range::NotNegative => value.is_finite() && value >= 0.0,
            Range::Share => (0.0..1.0).contains(&value),
            Range::Count | Range::Flag => true,
        }
    }
}

/// What is known of a setting, whatever its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Its key.
    pub name: &'static str,
    /// What it may be.
    pub range: Range,
    /// "s", or nothing.
    pub unit: &'static str,
    /// What it must be, in words.
    pub expected: &'static str,
    /// Whether it belongs to a limit, and not to how all alarms come and go.
    pub is_limit: bool,
    /// Of the command; empty where it has none.
    pub option: &'static str,
    /// One line for the command.
    pub help: &'static str,
}

/// A value as a number, for what treats all settings alike.
trait Held {
    fn get(&self) -> Option<f64>;
    /// `None` is none where that can be, and leaves the rest as it is.
    fn put(&mut self, value: Option<f64>);
}

impl Held for f64 {
    fn get(&self) -> Option<f64> {
        Some(*self)
    }
    fn put(&mut self, value: Option<f64>) {
        *self = value.unwrap_or(*self);
    }
}

impl Held for Option<f64> {
    fn get(&self) -> Option<f64> {
        *self
    }
    fn put(&mut self, value: Option<f64>) {
        *self = value;
    }
}

impl Held for Option<u64> {
    fn get(&self) -> Option<f64> {
        self.map(|n| n as f64)
    }
    fn put(&mut self, value: Option<f64>) {
        *self = value.map(|n| n as u64);
    }
}

impl Held for bool {
    fn get(&self) -> Option<f64> {
        Some(f64::from(u8::from(*self)))
    }
    fn put(&mut self, value: Option<f64>) {
        *self = value.map_or(*self, |v| v != 0.0);
    }
}

/// The settings, a row each: name, type and default; range, unit, what is expected; whether of a limit; option, help.
macro_rules! settings {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr, $range:ident $unit:literal $expected:literal, $limit:literal,
        $option:literal $help:literal;)+) => {
        /// The user's limits; `None` watches nothing.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct AlarmConfig {
            $($(#[$doc])* pub $name: $type),+
        }

        impl Default for AlarmConfig {
            fn default() -> Self {
                Self { $($name: $default),+ }
            }
        }

        impl AlarmConfig {
            /// All settings, in their order.
            pub const SETTINGS: &'static [Setting] = &[$(Setting {
                name: stringify!($name), range: Range::$range, unit: $unit, expected: $expected, is_limit: $limit,
                option: $option, help: $help,
            }),+];

            /// A setting's value as a number; `None` where it has none, or there is no such setting.
            pub fn get(&self, name: &str) -> Option<f64> {
                match name {
                    $(stringify!($name) => self.$name.get(),)+
                    _ => None,
                }
            }

            /// Puts a value into a setting; a name that is none changes nothing.
            pub fn put(&mut self, name: &str, value: Option<f64>) {
                match name {
                    $(stringify!($name) => self.$name.put(value),)+
                    _ => {}
                }
            }
        }
    };
}

settings! {
    /// Largest |d|, in seconds.
    limit_delay_s: Option<f64> = None, Positive "s" "a positive duration in seconds", true,
        "--limit-delay" "largest |delay|";
    /// Largest |A - 1|.
    limit_amplitude: Option<f64> = None, Positive "" "a positive number, the largest |A - 1|", true,
        "--limit-amplitude" "largest |amplitude - 1|";
    /// The delay at which the test becomes unstable, in seconds.
    critical_delay_s: Option<f64> = None, Positive "s" "a positive duration in seconds", true,
        "--critical-delay" "delay at which the test becomes unstable ('rthstrack simulate' tells it)";
    /// Largest share of it that a lag may reach.
    critical_fraction: f64 = 0.5, Positive "" "a positive share of the critical delay", true,
        "--critical-fraction" "share of --critical-delay that the delay may reach (0.5)";
    /// Most samples missing among those of the last window.
    limit_lost: Option<u64> = None, Count "" "a whole number, zero or more", true,
        "--limit-lost" "most samples lost within a window";
    /// Longest time without a sample.
    silence_s: Option<f64> = Some(1.0), PositiveOrOff "s" "a positive duration in seconds", true,
        "--silence" "longest time without a sample (1; counts for --exit-on-alarm only where it is given; 0: watch none)";
    /// Longest time in which samples came and an actuator that moves could not be judged.
    unjudged_s: Option<f64> = None, Positive "s" "a positive duration in seconds", true, "" "";
    /// By what share of the limit a value must fall below it.
    hysteresis: f64 = 0.1, Share "" "a share of the limit from 0 to below 1", false,
        "--hysteresis" "an alarm is over when this share of its limit below it (0.1)";
    /// How long a value must be over the limit. Silence has its own time.
    minimum_duration_s: f64 = 0.0, NotNegative "s" "zero or a positive duration in seconds", false,
        "--alarm-after" "raise it only when the limit was exceeded for so long (0)";
    /// Whether an alarm is held until it is reset.
    latch: bool = true, Flag "" "true or false", false,
        "--no-latch" "an alarm that is over is gone; else it waits for a reset";
}

impl AlarmConfig {
    /// Everything that is wrong with it, a line each.
    pub fn mistakes(&self) -> Vec<String> {
        let wrong = |setting: &Setting| {
            let value = self.get(setting.name).filter(|value| !setting.range.holds(*value))?;
            Some(format!("{} must be {}, not {value}", setting.name, setting.expected))
        };
        Self::SETTINGS.iter().filter_map(wrong).collect()
    }
}
