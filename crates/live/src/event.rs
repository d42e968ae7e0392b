//! What happened: a code that never changes, its values, and words, which are made here alone.

use std::fmt::{self, Write};
use std::net::{IpAddr, SocketAddr};

use rthstrack::Reason;

use crate::alarm::{Change, Kind};
use crate::json;
use crate::names::Names;

/// A time of the stream and what happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// In seconds of the stream.
    pub time_s: f64,
    /// What happened.
    pub what: Happening,
    /// How many before it were too many to be told.
    pub kept_back: u64,
}

impl Event {
    /// In one line. What a sender or a file has put into it does not reach a terminal as commands.
    pub fn text(&self, names: &Names) -> String {
        let mut text = printable(self.what.text(names));
        if self.kept_back > 0 {
            text.push_str(&format!(" (before it {} more events, not shown)", self.kept_back));
        }
        text
    }

    /// As an object.
    pub(crate) fn write(&self, out: &mut String, names: &Names) {
        out.push('{');
        json::key(out, "time_s");
        json::number(out, self.time_s);
        json::key(out, "code");
        json::text(out, self.what.code());
        json::key(out, "values");
        self.what.write_values(out, names);
        json::key(out, "kept_back");
        json::whole(out, self.kept_back);
        json::key(out, "text");
        json::text(out, &self.text(names));
        out.push('}');
    }
}

/// The text with what is no letter of it replaced.
pub(crate) fn printable(text: String) -> String {
    if text.contains(char::is_control) { text.replace(char::is_control, "\u{fffd}") } else { text }
}

/// Where the log's writer stands.
#[derive(Debug, Clone, PartialEq)]
pub enum LogState {
    /// It writes.
    Writing,
    /// It has stopped, for this reason.
    Stopped(String),
}

impl LogState {
    /// Its name, which never changes.
    pub fn code(&self) -> &'static str {
        match self {
            LogState::Writing => "writing",
            LogState::Stopped(_) => "stopped",
        }
    }
}

impl fmt::Display for LogState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LogState::Writing => f.write_str("writing"),
            LogState::Stopped(why) => write!(f, "stopped: {why}"),
        }
    }
}

/// Which actuator, by its index from 0; `None` for the stream itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Actuator(pub Option<usize>);

/// A value of an event, as a part of a JSON object.
trait Held {
    fn write(&self, out: &mut String);
    fn put(&self, name: &str, _names: &Names, out: &mut String) {
        json::key(out, name);
        self.write(out);
    }
}

impl Held for f64 {
    fn write(&self, out: &mut String) {
        json::number(out, *self);
    }
}

impl Held for u64 {
    fn write(&self, out: &mut String) {
        json::whole(out, *self);
    }
}

impl Held for usize {
    fn write(&self, out: &mut String) {
        json::whole(out, *self as u64);
    }
}

impl Held for i64 {
    fn write(&self, out: &mut String) {
        let _ = write!(out, "{self}");
    }
}

impl Held for Actuator {
    fn write(&self, out: &mut String) {
        json::optional_whole(out, self.0);
    }
    fn put(&self, _: &str, names: &Names, out: &mut String) {
        json::whose(out, self.0, names);
    }
}

impl Held for String {
    fn write(&self, out: &mut String) {
        json::text(out, self);
    }
}

impl Held for IpAddr {
    fn write(&self, out: &mut String) {
        json::displayed(out, Some(self));
    }
}

impl Held for SocketAddr {
    fn write(&self, out: &mut String) {
        json::displayed(out, Some(self));
    }
}

impl Held for Kind {
    fn write(&self, out: &mut String) {
        json::text(out, self.name());
    }
}

impl Held for LogState {
    fn write(&self, out: &mut String) {
        json::text(out, self.code());
    }
}

impl Held for Reason {
    fn write(&self, out: &mut String) {
        json::text(out, self.kind().code);
    }
    fn put(&self, _: &str, _names: &Names, out: &mut String) {
        json::reason(out, Some(self));
    }
}

/// What may happen, a row each: its values, its code, its words.
macro_rules! happenings {
    ($names:ident; $($(#[$doc:meta])* $variant:ident { $($field:ident: $type:ty),* } = $code:literal, $words:tt;)+) => {
        /// What may happen.
        #[derive(Debug, Clone, PartialEq)]
        // What each value is, its name and the words say.
        #[allow(missing_docs)]
        pub enum Happening {
            $($(#[$doc])* $variant { $($field: $type),* }),+
        }

        impl Happening {
            /// Its name in programs and files, which never changes.
            pub fn code(&self) -> &'static str {
                match self {
                    $(Happening::$variant { .. } => $code),+
                }
            }

            fn write_values(&self, out: &mut String, names: &Names) {
                out.push('{');
                match self {
                    $(Happening::$variant { $($field),* } => {
                        $($field.put(stringify!($field), names, out);)*
                    })+
                }
                out.push('}');
            }

            /// In words, with the actuators called by these names.
            #[allow(unused_variables, reason = "not every value stands in the words")]
            pub fn text(&self, $names: &Names) -> String {
                match self {
                    $(Happening::$variant { $($field),* } => happenings!(@write $words)),+
                }
            }
        }
    };
    (@write ($($words:tt)*)) => { format!($($words)*) };
}

happenings! {
    names;
    /// An alarm was raised, or goes over its limit once more.
    AlarmRaised { alarm: Kind, actuator: Actuator, value: f64, limit: f64 } = "alarm_raised",
        ("{}", alarm.raised_text(actuator.0, *value, *limit, names));
    /// An alarm is over.
    AlarmOver { alarm: Kind, actuator: Actuator, value: f64, limit: f64 } = "alarm_over",
        ("{}", alarm.over_text(actuator.0, names));
    /// Somebody has reset the alarms.
    AlarmsReset { still_active: usize } = "alarms_reset", ("alarms reset{}", match still_active {
        0 => String::new(),
        n => format!("; {n} still over the limit"),
    });
    /// Too many samples were lost to fill the gap.
    SamplesLost { samples: u64 } = "samples_lost", ("{samples} samples lost: the window starts anew");
    /// The sender counts from somewhere else.
    CounterRestarted { counter: i64 } = "counter_restarted",
        ("the counter started anew at {counter}: the window starts anew");
    /// A stream without a counter had a break.
    Paused { pause_s: f64 } = "paused", ("nothing came for {pause_s:.1} s: the window starts anew");
    /// Nothing comes any more.
    Silent { limit_s: f64 } = "silent", ("silent: no sample for {limit_s:.1} s");
    /// Something comes again.
    SamplesAgain { silent_s: f64 } = "samples_again", ("samples again, after {silent_s:.1} s");
    /// An actuator's readings have no numbers any more.
    Undetermined { actuator: Actuator, reason: Reason } = "undetermined",
        ("{}{reason}", names.before(actuator.0));
    /// They have them again.
    Determined { actuator: Actuator } = "determined", ("{}determined again", names.before(actuator.0));
    /// The counter's pace contradicts the rate.
    PaceContradicts { pace_hz: f64, rate_hz: f64 } = "pace_contradicts",
        ("the counter advances by {pace_hz:.0} a second but --rate says {rate_hz}: time and delay are wrong by that factor");
    /// The pace is not quite the rate.
    PaceOff { pace_hz: f64, rate_hz: f64 } = "pace_off",
        ("the counter advances by {pace_hz:.1} a second but --rate says {rate_hz}: time and delay are wrong by that factor");
    /// Two programs send at once.
    TwoSenders { sender: SocketAddr, other: SocketAddr } = "two_senders",
        ("datagrams come from {sender} and from {other}: with two senders the counter has no meaning; end one of them \
          (--allow takes one machine only)");
    /// A sender is not one of those that may send.
    SenderRefused { sender: IpAddr } = "sender_refused",
        ("datagrams from {sender} are refused: not an accepted sender");
    /// A datagram of another size.
    MalformedSize { bytes: usize, expected: String } = "malformed_size",
        ("malformed: a datagram of {bytes} bytes, expected {expected}");
    /// A counter that counts nothing.
    MalformedCounter {} = "malformed_counter",
        ("malformed: a counter that is no whole number, negative, or beyond what its type counts exactly (2^24 for f32, \
          2^53 for f64)");
    /// A counter that counts only in the other byte order.
    OtherByteOrder {} = "other_byte_order",
        ("malformed: a counter that counts only with its bytes in the other order: is byte_order of the layout right?");
    /// A line that holds no sample, by its beginning.
    MalformedLine { line: String, expected: String } = "malformed_line", ("malformed: {line}: expected {expected}");
    /// The system grants less memory for datagrams that wait than is good.
    SmallBuffer { kib: usize } = "small_buffer",
        ("the system grants only {kib} KiB for datagrams that wait; its administrator can allow more (Linux: \
          net.core.rmem_max)");
    /// A datagram could not be sent, the first of them.
    Unsent { to: SocketAddr, error: String } = "unsent",
        ("nothing can be sent to {to}: {error}; what is not sent is counted");
    /// The file of readings cannot be written any further.
    ReadingsStopped { path: String, error: String } = "readings_stopped",
        ("readings are no longer written to {path}: {error}");
    /// The log begins or stops.
    Log { state: LogState } = "log", ("log: {state}");
}

impl From<&Change> for Happening {
    fn from(change: &Change) -> Self {
        let (alarm, actuator, value, limit) =
            (change.alarm.kind, Actuator(change.alarm.actuator), change.alarm.value, change.alarm.limit);
        if change.raised {
            Happening::AlarmRaised { alarm, actuator, value, limit }
        } else {
            Happening::AlarmOver { alarm, actuator, value, limit }
        }
    }
}
