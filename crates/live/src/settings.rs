//! The user's settings as they come from Python or JSON: every key checked, all mistakes told at once.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

use rthstrack::setting::{self, Configuration};
use rthstrack::{Error, Monitor, MonitorConfig};
use serde_json::{Map, Value};

use crate::alarm::{AlarmConfig, Kind, Source};
use crate::layout::{ByteOrder, Field, LayoutConfig, Number};
use crate::line::{Column, Format, LinesConfig};

/// Where samples come from.
#[derive(Debug, Clone, PartialEq)]
pub enum SourceConfig {
    /// Datagrams.
    Udp {
        /// Where to listen; port 0 for any.
        address: SocketAddr,
        /// Who may send; `None` for everyone who reaches the address.
        senders: Option<Vec<IpAddr>>,
        /// What a datagram holds.
        layout: LayoutConfig,
    },
    /// Lines of text.
    Lines {
        /// A file; `None` for standard input.
        path: Option<PathBuf>,
        /// What a line holds.
        layout: LinesConfig,
    },
}

/// Where everything goes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutputsConfig {
    /// Readings, a datagram each.
    pub readings_udp: Option<SocketAddr>,
    /// Readings, a line each, after what the file holds already.
    pub readings_file: Option<PathBuf>,
    /// Alarms, a datagram each.
    pub alarm_udp: Option<SocketAddr>,
    /// Where a reset may be asked for.
    pub control: Option<SocketAddr>,
    /// Keep samples and readings for the log, which somebody drains.
    pub log: bool,
    /// Keep what the page shows.
    pub page: bool,
    /// What people call the actuators; empty for "actuator 1" and so on.
    pub names: Vec<String>,
    /// In which units their displacements are, where that is known; empty for none.
    pub units: Vec<Option<String>>,
}

/// Everything that is needed for a run.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveConfig {
    /// What is evaluated.
    pub monitor: MonitorConfig,
    /// Where samples come from.
    pub source: SourceConfig,
    /// Longest gap filled by a straight line, in samples; longer ones restart the window.
    pub fill_samples: u64,
    /// Whether a counter whose pace is not the rate ends the run.
    pub check_pace: bool,
    /// The limits.
    pub alarms: AlarmConfig,
    /// Where everything goes.
    pub outputs: OutputsConfig,
}

impl LiveConfig {
    /// From the monitor's settings as [`rthstrack::setting::read`] has them, and three objects of the keys that the binding's
    /// documentation lists. What is left out has its default.
    ///
    /// # Errors
    /// All mistakes, a line each.
    pub fn read(
        (monitor, errors): (MonitorConfig, Vec<Error>),
        source: &Value,
        alarms: &Value,
        outputs: &Value,
    ) -> Result<Self, Vec<String>> {
        let mut mistakes: Vec<String> = errors.iter().map(|error| format!("monitor: {error}")).collect();
        let alarms = read_alarms(&mut Keys::new(&mut mistakes, "alarms", alarms), monitor.window_s);
        let outputs = read_outputs(&mut Keys::new(&mut mistakes, "outputs", outputs));
        let mut keys = Keys::new(&mut mistakes, "source", source);
        let fill_samples = keys.whole("fill_samples").unwrap_or(5);
        let check_pace = keys.flag("check_pace").unwrap_or(true);
        let source = read_source(&mut keys, monitor.n_actuators);
        drop(keys);
        let config = source.map(|source| Self { monitor, source, fill_samples, check_pace, alarms, outputs });
        // What cannot be read can hardly be checked further.
        match config {
            Some(config) => {
                mistakes.extend(config.mistakes());
                if mistakes.is_empty() { Ok(config) } else { Err(mistakes) }
            }
            None => {
                mistakes.extend(alarms.mistakes());
                mistakes.extend(Monitor::new(monitor).err().map(|error| error.to_string()));
                Err(mistakes)
            }
        }
    }

    /// Everything that is wrong with it, a line each.
    pub fn mistakes(&self) -> Vec<String> {
        let mut found: Vec<String> = Monitor::new(self.monitor).err().iter().map(ToString::to_string).collect();
        found.extend(self.alarms.mistakes());
        let (layout, n) = match &self.source {
            SourceConfig::Udp { layout, .. } => (layout.mistakes(), layout.target.len()),
            SourceConfig::Lines { layout, .. } => (layout.mistakes(), layout.target.len()),
        };
        if layout.is_empty() && n != self.monitor.n_actuators {
            found.push(format!("the layout has {n} actuators but n_actuators is {}", self.monitor.n_actuators));
        }
        found.extend(layout);
        let names = &self.outputs.names;
        if !names.is_empty() && names.len() != self.monitor.n_actuators {
            found.push(format!(
                "outputs.names must be {} names, one an actuator, not {}",
                self.monitor.n_actuators,
                names.len()
            ));
        }
        let units = &self.outputs.units;
        if !units.is_empty() && units.len() != self.monitor.n_actuators {
            found.push(format!(
                "outputs.units must be {} units, one an actuator, not {}",
                self.monitor.n_actuators,
                units.len()
            ));
        }
        let window = (self.monitor.window_s * self.monitor.rate_hz).round();
        if window.is_finite() && self.fill_samples as f64 > window {
            found.push(format!(
                "fill_samples must be at most the window's {window} samples, not {}: a longer gap leaves nothing to fill between",
                self.fill_samples
            ));
        }
        found
    }
}

/// One object of settings, whose keys are used up. Not serde's derive, which stops at the first mistake.
struct Keys<'a> {
    mistakes: &'a mut Vec<String>,
    whose: String,
    map: Map<String, Value>,
}

impl Drop for Keys<'_> {
    fn drop(&mut self) {
        for key in self.map.keys() {
            self.mistakes.push(format!("{}: unknown key '{}'", self.whose, key.escape_debug()));
        }
    }
}

impl<'a> Keys<'a> {
    fn new(mistakes: &'a mut Vec<String>, whose: &str, value: &Value) -> Self {
        let map = match value {
            Value::Object(map) => map.clone(),
            Value::Null => Map::new(),
            other => {
                mistakes.push(format!("{whose} must be a table of settings, not {other}"));
                Map::new()
            }
        };
        Self { mistakes, whose: whose.to_owned(), map }
    }

    /// The value, where there is one.
    fn take(&mut self, key: &str) -> Option<Value> {
        self.map.remove(key).filter(|value| !value.is_null())
    }

    fn wrong(&mut self, key: &str, expected: &str, found: &Value) {
        self.mistakes.push(format!("{}.{key} must be {expected}, not {found}", self.whose));
    }

    /// A value that `read` understands.
    fn some<T>(&mut self, key: &str, expected: &str, read: impl FnOnce(&Value) -> Option<T>) -> Option<T> {
        let value = self.take(key)?;
        let found = read(&value);
        if found.is_none() {
            self.wrong(key, expected, &value);
        }
        found
    }

    fn number(&mut self, key: &str) -> Option<f64> {
        self.some(key, "a number", Value::as_f64)
    }

    fn whole(&mut self, key: &str) -> Option<u64> {
        self.some(key, "a whole number, zero or more", whole)
    }

    fn size(&mut self, key: &str) -> Option<usize> {
        self.whole(key).and_then(|n| usize::try_from(n).ok())
    }

    fn flag(&mut self, key: &str) -> Option<bool> {
        self.some(key, "true or false", Value::as_bool)
    }

    fn choice<T: Copy>(&mut self, key: &str, names: &[(&str, T)]) -> Option<T> {
        let known = names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        self.some(key, &format!("one of {known}"), |value| one_of(value, names))
    }

    fn path(&mut self, key: &str) -> Option<PathBuf> {
        self.some(key, "a path", |value| value.as_str().filter(|s| !s.is_empty()).map(PathBuf::from))
    }

    fn address(&mut self, key: &str) -> Option<SocketAddr> {
        self.some(key, "HOST:PORT of a host that is known, such as 127.0.0.1:5005", |value| {
            let all: Vec<SocketAddr> = value.as_str()?.to_socket_addrs().ok()?.collect();
            all.iter().find(|a| a.is_ipv4()).or(all.first()).copied()
        })
    }
}

fn whole(value: &Value) -> Option<u64> {
    value.as_u64().or_else(|| value.as_f64().filter(|v| *v >= 0.0 && *v < 1e15 && v.fract() == 0.0).map(|v| v as u64))
}

fn one_of<T: Copy>(value: &Value, names: &[(&str, T)]) -> Option<T> {
    names.iter().find(|(name, _)| value.as_str() == Some(*name)).map(|(_, choice)| *choice)
}

/// An actuator may be without numbers for a window, and for so long.
const UNJUDGED_S: f64 = 2.0;

fn read_alarms(keys: &mut Keys<'_>, window_s: f64) -> AlarmConfig {
    let mut config = AlarmConfig::default();
    let is_unjudged_given = keys.map.contains_key("unjudged_s");
    for setting in AlarmConfig::TABLE {
        // Without a limit is not the same as the default.
        let Some(given) = keys.map.remove(setting.name).filter(|given| setting.optional || !given.is_null()) else {
            continue;
        };
        if let Err(error) = setting.read(&mut config, &plain(&given)) {
            keys.mistakes.push(format!("{}: {error}", keys.whose));
        }
    }
    // Who has set a limit is told when nothing watches it.
    let mut of_readings =
        Kind::ALL.iter().map(|kind| kind.row()).filter(|row| matches!(row.source, Source::Reading(_)));
    let is_watched = of_readings.any(|row| (row.limit)(&config).is_some());
    if !is_unjudged_given && is_watched && window_s > 0.0 {
        config.unjudged_s = Some(window_s + UNJUDGED_S);
    }
    config
}

/// A value of JSON as the table of settings takes it.
fn plain(value: &Value) -> setting::Value {
    match value {
        Value::Null => setting::Value::Nothing,
        Value::Bool(flag) => setting::Value::Flag(*flag),
        Value::String(text) => setting::Value::Text(text.clone()),
        Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => setting::Value::Whole(whole),
            (None, Some(number)) => setting::Value::Number(number),
            (None, None) => setting::Value::Other(number.to_string()),
        },
        other => setting::Value::Other(other.to_string()),
    }
}

fn read_outputs(keys: &mut Keys<'_>) -> OutputsConfig {
    OutputsConfig {
        readings_udp: keys.address("readings_udp"),
        readings_file: keys.path("readings_file"),
        alarm_udp: keys.address("alarm_udp"),
        control: keys.address("control"),
        log: keys.flag("log").unwrap_or(false),
        page: keys.flag("page").unwrap_or(false),
        names: keys
            .some("names", "a list of names, one an actuator", |value| {
                value.as_array()?.iter().map(|name| name.as_str().map(str::to_owned)).collect()
            })
            .unwrap_or_default(),
        units: keys
            .some("units", "a list of units, one an actuator, null where it is not known", |value| {
                let unit = |value: &Value| match value {
                    Value::Null => Some(None),
                    _ => value.as_str().map(|unit| Some(unit.to_owned())),
                };
                value.as_array()?.iter().map(unit).collect()
            })
            .unwrap_or_default(),
    }
}

fn read_source(keys: &mut Keys<'_>, n_actuators: usize) -> Option<SourceConfig> {
    let kind = keys.take("kind").unwrap_or(Value::Null);
    let layout = keys.take("layout").unwrap_or(Value::Null);
    // Each kind leaves the other's keys alone: both may be there, empty.
    let (address, path) = (keys.address("address"), keys.path("path"));
    let senders = keys.take("senders");
    match kind.as_str() {
        Some("udp") => {
            let senders = senders.map(|value| read_senders(keys, &value));
            let layout = read_layout(&mut Keys::new(keys.mistakes, "layout", &layout), n_actuators);
            let Some(address) = address else {
                keys.mistakes.push("source.address must say where to listen, such as 127.0.0.1:5005".to_owned());
                return None;
            };
            Some(SourceConfig::Udp { address, senders, layout })
        }
        Some("lines") => {
            let layout = read_lines(&mut Keys::new(keys.mistakes, "layout", &layout), n_actuators);
            Some(SourceConfig::Lines { path, layout })
        }
        _ => {
            keys.wrong("kind", "udp or lines", &kind);
            None
        }
    }
}

fn read_senders(keys: &mut Keys<'_>, value: &Value) -> Vec<IpAddr> {
    let Some(all) = value.as_array() else {
        keys.wrong("senders", "a list of addresses", value);
        return Vec::new();
    };
    let mut found = Vec::new();
    for sender in all {
        match sender.as_str().and_then(|s| s.parse::<IpAddr>().ok()) {
            Some(address) => found.push(address.to_canonical()),
            None => keys.wrong("senders", "a list of addresses such as 192.168.0.7", sender),
        }
    }
    found
}

fn pair(value: &Value) -> Option<(f64, f64)> {
    match value.as_array()?.as_slice() {
        [first, second] => Some((first.as_f64()?, second.as_f64()?)),
        _ => None,
    }
}

fn read_layout(keys: &mut Keys<'_>, n_actuators: usize) -> LayoutConfig {
    let usual = LayoutConfig::doubles(n_actuators.min(crate::layout::MAX_ACTUATORS + 1));
    // Fields of one's own have a counter of one's own, or none.
    let own = keys.map.contains_key("target") || keys.map.contains_key("measured");
    let byte_order = keys.choice("byte_order", &ByteOrder::NAMES).unwrap_or(usual.byte_order);
    let header_bytes = keys.size("header_bytes").unwrap_or(0);
    let sample_bytes = keys.size("sample_bytes");
    let is_given = keys.map.contains_key("counter");
    let counter = match keys.take("counter") {
        Some(value) => {
            let mut counter = Keys::new(keys.mistakes, "layout.counter", &value);
            let offset = counter.size("offset").unwrap_or(0);
            Some((offset, counter.choice("type", &Number::NAMES).unwrap_or(Number::F64)))
        }
        None if is_given || own => None,
        None => usual.counter,
    };
    let target = read_fields(keys, "target").unwrap_or(usual.target);
    let measured = read_fields(keys, "measured").unwrap_or(usual.measured);
    // As long as what it holds, where it is not said.
    let ends = target.iter().chain(&measured).map(|f| f.offset.saturating_add(f.number.size()));
    let end = ends.chain(counter.map(|(offset, n)| offset.saturating_add(n.size()))).max().unwrap_or(0);
    LayoutConfig { byte_order, header_bytes, sample_bytes: sample_bytes.unwrap_or(end), counter, target, measured }
}

fn read_fields(keys: &mut Keys<'_>, name: &str) -> Option<Vec<Field>> {
    let value = keys.take(name)?;
    let Some(all) = value.as_array() else {
        keys.wrong(name, "a list of fields, one an actuator", &value);
        return None;
    };
    let mut fields = Vec::new();
    for (i, value) in all.iter().enumerate() {
        let whose = format!("layout.{name}[{i}]");
        let mut field = Keys::new(keys.mistakes, &whose, value);
        let offset = field.size("offset");
        if offset.is_none() {
            field.mistakes.push(format!("{whose}.offset must say where the number stands in the sample, in bytes"));
        }
        fields.push(Field {
            offset: offset.unwrap_or(0),
            number: field.choice("type", &Number::NAMES).unwrap_or(Number::F64),
            scale: field.number("scale").unwrap_or(1.0),
            zero: field.number("zero").unwrap_or(0.0),
        });
    }
    Some(fields)
}

fn read_lines(keys: &mut Keys<'_>, n_actuators: usize) -> LinesConfig {
    let n = n_actuators.min(crate::layout::MAX_ACTUATORS + 1);
    let uncounted = keys.map.get("counter").is_some_and(Value::is_null);
    let own = keys.map.contains_key("target") || keys.map.contains_key("measured");
    let usual = LinesConfig::usual(n, !uncounted);
    let counter = keys.some("counter", "a name or a column's number from 0", column);
    let columns = |keys: &mut Keys<'_>, name: &str| {
        keys.some(name, "a list of names or columns' numbers, one an actuator", |value| {
            value.as_array()?.iter().map(column).collect::<Option<Vec<_>>>()
        })
    };
    LinesConfig {
        format: keys.choice("format", &Format::NAMES).unwrap_or(Format::Auto),
        delimiter: keys.some("delimiter", "one character", |value| {
            let mut characters = value.as_str()?.chars();
            characters.next().filter(|_| characters.next().is_none())
        }),
        counter: if counter.is_none() && !own { usual.counter } else { counter },
        target: columns(keys, "target").unwrap_or(usual.target),
        measured: columns(keys, "measured").unwrap_or(usual.measured),
        scale: keys
            .some("scale", "a list of [target, measured], one an actuator", |value| {
                value.as_array()?.iter().map(pair).collect::<Option<Vec<_>>>()
            })
            .unwrap_or_default(),
    }
}

fn column(value: &Value) -> Option<Column> {
    match value.as_str() {
        Some(name) => Some(Column::Name(name.to_owned())),
        None => whole(value).and_then(|i| usize::try_from(i).ok()).map(Column::Index),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(n_actuators: usize, source: Value, alarms: Value, outputs: Value) -> Result<LiveConfig, Vec<String>> {
        LiveConfig::read((of_actuators(n_actuators), Vec::new()), &source, &alarms, &outputs)
    }

    fn of_actuators(n_actuators: usize) -> MonitorConfig {
        MonitorConfig { n_actuators, ..MonitorConfig::default() }
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let config = read(1, json!({"kind": "udp", "address": "127.0.0.1:0"}), json!({}), json!({})).unwrap();
        assert_eq!(config.monitor, MonitorConfig::default());
        assert_eq!(config.alarms, AlarmConfig::default());
        let SourceConfig::Udp { layout, senders, .. } = config.source else { panic!() };
        assert_eq!((layout, senders), (LayoutConfig::doubles(1), None));
        let config = read(2, json!({"kind": "lines", "layout": null}), json!(null), json!({}));
        let SourceConfig::Lines { layout, .. } = config.unwrap().source else { panic!() };
        assert_eq!(layout, LinesConfig::usual(2, true));
    }

    #[test]
    fn everything_can_be_set() {
        let source = json!({
            "kind": "udp", "address": "127.0.0.1:5005", "senders": ["127.0.0.1", "::1"], "fill_samples": 3,
            "check_pace": false, "path": null,
            "layout": {"byte_order": "big", "header_bytes": 4, "sample_bytes": 16, "counter": {"offset": 0, "type": "u32"},
                "target": [{"offset": 4, "type": "f32", "scale": 0.001, "zero": 1.0}],
                "measured": [{"offset": 8, "type": "i16", "scale": 2, "zero": 0}]},
        });
        let alarms = json!({"limit_delay_s": 0.01, "limit_lost": 5, "silence_s": null, "latch": false});
        let outputs = json!({"readings_udp": "127.0.0.1:1", "control": "127.0.0.1:0", "log": true, "page": true});
        let config = read(1, source, alarms, outputs).unwrap();
        assert_eq!((config.fill_samples, config.check_pace), (3, false));
        assert_eq!((config.alarms.limit_lost, config.alarms.silence_s, config.alarms.latch), (Some(5), None, false));
        let SourceConfig::Udp { layout, senders, .. } = config.source else { panic!() };
        assert_eq!((layout.counter, layout.sample_bytes, senders.unwrap().len()), (Some((0, Number::U32)), 16, 2));
        assert_eq!(layout.measured, [Field { offset: 8, number: Number::I16, scale: 2.0, zero: 0.0 }]);
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let source = json!({
            "kind": "udp", "address": "nowhere", "senders": ["me"], "colour": 1,
            "layout": {"byte_order": "middle", "target": [{"type": "f16"}], "measured": [{"offset": 0, "size": 4}]},
        });
        let entries = [("rate_hz", "fast"), ("window", "round"), ("colour", "red")];
        let entries = entries.map(|(name, text)| (name.to_owned(), setting::Value::Text(text.to_owned())));
        let (alarms, outputs) = (json!({"latch": 2, "hysteresis": 7}), json!({"log": "yes"}));
        let mistakes = LiveConfig::read(setting::read(entries), &source, &alarms, &outputs).unwrap_err();
        for part in [
            "monitor: rate_hz must be a positive frequency in hertz, not 'fast'",
            "monitor: window must be one of boxcar",
            "monitor: unknown setting colour: expected rate_hz",
            "source.address must be HOST:PORT",
            "source.senders",
            "source: unknown key 'colour'",
            "layout.byte_order must be one of little, big",
            "layout.target[0].type must be one of f32",
            "layout.target[0].offset",
            "layout.measured[0]: unknown key 'size'",
            "alarms: latch must be true or false",
            "alarms: hysteresis must be a share from 0 to below 1",
            "outputs.log must be true or false",
        ] {
            assert!(mistakes.iter().any(|m| m.contains(part)), "{part}: {mistakes:#?}");
        }
        assert!(mistakes.iter().all(|m| !m.contains('\n')));
    }

    #[test]
    fn a_layout_of_other_actuators_than_the_monitor_is_refused() {
        let layout = json!({"counter": null, "target": [{"offset": 0}], "measured": [{"offset": 8}]});
        let source = json!({"kind": "udp", "address": "127.0.0.1:0", "layout": layout, "fill_samples": 5000});
        let mistakes = read(2, source, json!({}), json!({})).unwrap_err();
        assert_eq!(mistakes.len(), 2, "{mistakes:?}");
        assert!(
            mistakes[0].contains("1 actuators but n_actuators is 2")
                && mistakes[1].contains("at most the window's 4096")
        );
    }
}
