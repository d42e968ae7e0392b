//! Numbers and readings as JSON, into a buffer that is used again: nothing is allocated once it is large enough.

use std::fmt::Write;

use rthstrack::{Getter, Reading, Reason, Tracking};

use crate::alarm::{Alarm, Change};
use crate::names::{self, Names};

/// The shortest decimal number that reads back to the same bits; null where it is no finite number.
pub(crate) fn number(out: &mut String, value: f64) {
    if value.is_finite() {
        let _ = write!(out, "{value:?}");
    } else {
        out.push_str("null");
    }
}

/// A sample of the scope, which is only looked at: single precision.
pub(crate) fn coarse(out: &mut String, value: f64) {
    let value = value as f32;
    if value.is_finite() {
        let _ = write!(out, "{value:?}");
    } else {
        out.push_str("null");
    }
}

pub(crate) fn whole(out: &mut String, value: u64) {
    let _ = write!(out, "{value}");
}

/// A number, or null.
pub(crate) fn optional(out: &mut String, value: Option<f64>) {
    number(out, value.unwrap_or(f64::NAN));
}

pub(crate) fn boolean(out: &mut String, value: bool) {
    out.push_str(if value { "true" } else { "false" });
}

/// Text in quotes.
pub(crate) fn text(out: &mut String, value: &str) {
    out.push('"');
    for c in value.chars() {
        match c {
            '"' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            c if (c as u32) < 0x20 => {
                let _ = write!(out, "\\u{:04x}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('"');
}

/// What can be displayed, in quotes, or null.
pub(crate) fn displayed(out: &mut String, value: Option<&impl std::fmt::Display>) {
    match value {
        None => out.push_str("null"),
        Some(value) => {
            out.push('"');
            let start = out.len();
            let _ = write!(out, "{value}");
            // Our own words need no escape; should they ever, they go the long way.
            if out[start..].contains(|c: char| matches!(c, '"' | '\\') || (c as u32) < 0x20) {
                let words = out.split_off(start);
                out.pop();
                text(out, &words);
            } else {
                out.push('"');
            }
        }
    }
}

/// A reason by its code, null where there is none, and what it says in numbers.
pub(crate) fn reason(out: &mut String, reason: Option<&Reason>) {
    key(out, "reason_code");
    displayed(out, reason.map(|r| r.kind().code).as_ref());
    key(out, "reason_values");
    list(out, reason.into_iter().flat_map(Reason::told), number);
}

/// Items between brackets, with commas.
pub(crate) fn list<T>(out: &mut String, items: impl IntoIterator<Item = T>, mut item: impl FnMut(&mut String, T)) {
    out.push('[');
    for (i, each) in items.into_iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        item(out, each);
    }
    out.push(']');
}

/// `"name":`, after a comma unless it is the first of its object.
pub(crate) fn key(out: &mut String, name: &str) {
    if !out.ends_with('{') {
        out.push(',');
    }
    out.push('"');
    out.push_str(name);
    out.push_str("\":");
}

fn interval(out: &mut String, (low, high): (f64, f64)) {
    if low.is_finite() && high.is_finite() {
        list(out, [low, high], number);
    } else {
        out.push_str("null");
    }
}

/// A reading as an object, without an end of line.
pub fn reading(out: &mut String, reading: &Reading, names: &Names) {
    let t = &reading.tracking;
    out.push('{');
    key(out, "index");
    whole(out, reading.index);
    key(out, "time_s");
    number(out, reading.time_s);
    key(out, "centre_s");
    number(out, reading.centre_s);
    whose(out, Some(reading.actuator), names);
    for kind in Tracking::NUMBERS.iter().filter(|kind| kind.live) {
        key(out, kind.name);
        match kind.of {
            Getter::Number(of) => number(out, of(t)),
            Getter::Interval(of) => interval(out, of(t)),
        }
    }
    key(out, "valid");
    boolean(out, reading.is_valid());
    key(out, "reason");
    displayed(out, t.reason.as_ref());
    self::reason(out, t.reason.as_ref());
    out.push('}');
}

/// The same as a row: index, time_s, centre_s, actuator, A, d, phase, f_eq, A_low, A_high, d_low, d_high, valid, reason.
pub(crate) fn reading_row(out: &mut String, reading: &Reading) {
    let t = &reading.tracking;
    let _ = write!(out, "[{},", reading.index);
    number(out, reading.time_s);
    out.push(',');
    number(out, reading.centre_s);
    let _ = write!(out, ",{},", reading.actuator);
    let numbers = [
        t.amplitude,
        t.delay_s,
        t.phase_rad,
        t.equivalent_frequency_hz,
        t.amplitude_interval.0,
        t.amplitude_interval.1,
        t.delay_interval_s.0,
        t.delay_interval_s.1,
    ];
    for value in numbers {
        number(out, value);
        out.push(',');
    }
    boolean(out, reading.is_valid());
    out.push(',');
    displayed(out, t.reason.as_ref());
    out.push(']');
}

/// A whole number, or null.
pub(crate) fn optional_whole(out: &mut String, value: Option<usize>) {
    match value {
        Some(value) => whole(out, value as u64),
        None => out.push_str("null"),
    }
}

/// An actuator by its index from 0, and by its number from 1 and its name as people read them; nulls for the stream itself.
pub(crate) fn whose(out: &mut String, actuator: Option<usize>, names: &Names) {
    key(out, "actuator");
    optional_whole(out, actuator);
    key(out, "actuator_number");
    optional_whole(out, actuator.map(names::number));
    key(out, "actuator_name");
    match actuator {
        Some(actuator) => text(out, names.of(actuator)),
        None => out.push_str("null"),
    }
}

/// The datagram of an alarm.
pub fn change(out: &mut String, change: &Change, names: &Names) {
    let alarm = &change.alarm;
    out.push_str("{\"alarm\":{");
    key(out, "name");
    text(out, alarm.kind.name());
    whose(out, alarm.actuator, names);
    key(out, "raised");
    boolean(out, change.raised);
    key(out, "value");
    number(out, alarm.value);
    key(out, "limit");
    number(out, alarm.limit);
    key(out, "time_s");
    number(out, change.time_s);
    key(out, "text");
    text(out, &if change.raised { alarm.text(names) } else { alarm.kind.over_text(alarm.actuator, names) });
    out.push_str("}}");
}

/// An alarm as it stands.
pub(crate) fn alarm(out: &mut String, alarm: &Alarm, names: &Names) {
    out.push('{');
    key(out, "name");
    text(out, alarm.kind.name());
    whose(out, alarm.actuator, names);
    key(out, "active");
    boolean(out, alarm.active);
    key(out, "latched");
    boolean(out, alarm.latched);
    key(out, "since_s");
    number(out, alarm.since_s);
    key(out, "value");
    number(out, alarm.value);
    key(out, "limit");
    number(out, alarm.limit);
    key(out, "text");
    text(out, &alarm.text(names));
    out.push('}');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alarm::{AlarmConfig, Alarms};
    use serde_json::Value;

    fn made(write: impl FnOnce(&mut String)) -> String {
        let mut out = String::new();
        write(&mut out);
        out
    }

    /// The first actuator has a name.
    fn north() -> Names {
        Names::new(&["north \"1\"".to_owned()], 4)
    }

    #[test]
    fn numbers_read_back_to_the_same_bits_and_what_is_none_is_null() {
        for value in [0.1, -0.0, 1.0, 1e-300, 1.7976931348623157e308, 5e-324, 1.0 / 3.0, 1e16, -123456.789] {
            let read: f64 = serde_json::from_str(&made(|o| number(o, value))).unwrap();
            assert_eq!(read.to_bits(), value.to_bits(), "{value:e}");
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(made(|o| number(o, value)), "null");
        }
    }

    #[test]
    fn a_reading_has_exactly_the_promised_keys() {
        let mut one = crate::alarm::tests::reading(3, 7.5, 0.98, 0.012);
        one.tracking.delay_interval_s = (0.011, 0.013);
        let value: Value = serde_json::from_str(&made(|o| reading(o, &one, &north()))).unwrap();
        let keys: Vec<&String> = value.as_object().unwrap().keys().collect();
        let mut expected = [
            "index",
            "time_s",
            "centre_s",
            "actuator",
            "actuator_number",
            "actuator_name",
            "amplitude",
            "delay_s",
            "phase_rad",
            "equivalent_frequency_hz",
            "amplitude_interval",
            "delay_interval_s",
            "valid",
            "reason",
            "reason_code",
            "reason_values",
        ];
        expected.sort_unstable();
        assert_eq!(keys, expected);
        assert_eq!(
            (&value["actuator"], &value["actuator_number"], &value["actuator_name"]),
            (&3.into(), &4.into(), &"actuator 4".into())
        );
        assert_eq!(value["amplitude"], 0.98);
        assert_eq!(value["amplitude_interval"], Value::Null);
        assert_eq!(value["delay_interval_s"][1], 0.013);
        assert_eq!(value["valid"], true);
        assert_eq!(value["reason"], Value::Null);
        assert_eq!(value["reason_code"], Value::Null);
        assert_eq!(value["reason_values"], serde_json::json!([]));
        one.tracking.reason = Some(Reason::Ambiguous { delay_s: 0.25, other_s: -0.125 });
        let missing: Value = serde_json::from_str(&made(|o| reading(o, &one, &north()))).unwrap();
        assert_eq!(missing["reason_code"], "ambiguous");
        assert_eq!(missing["reason_values"], serde_json::json!([0.25, -0.125]));
        one.tracking.reason = None;
        let row: Value = serde_json::from_str(&made(|o| reading_row(o, &one))).unwrap();
        assert_eq!(row.as_array().unwrap().len(), 14);
        assert_eq!(
            (&row[3], &row[4], &row[5], &row[12]),
            (&value["actuator"], &value["amplitude"], &value["delay_s"], &value["valid"])
        );
    }

    #[test]
    fn text_is_escaped() {
        let odd = "a \"quoted\" \\ line\nand\u{1} é";
        assert_eq!(serde_json::from_str::<String>(&made(|o| text(o, odd))).unwrap(), odd);
        assert_eq!(serde_json::from_str::<String>(&made(|o| displayed(o, Some(&odd)))).unwrap(), odd);
    }

    #[test]
    fn the_datagram_of_an_alarm_has_the_promised_keys() {
        let mut alarms = Alarms::new(AlarmConfig { limit_delay_s: Some(0.01), ..AlarmConfig::default() }, 1);
        let mut sent = String::new();
        alarms.read(&crate::alarm::tests::reading(0, 2.0, 1.0, 0.02), |c| change(&mut sent, &c, &north()));
        let value: Value = serde_json::from_str(&sent).unwrap();
        assert_eq!(value["alarm"]["name"], "delay");
        assert_eq!(value["alarm"]["actuator"], 0);
        assert_eq!(
            (&value["alarm"]["actuator_number"], &value["alarm"]["actuator_name"]),
            (&1.into(), &"north \"1\"".into())
        );
        assert_eq!(value["alarm"]["raised"], true);
        assert_eq!(value["alarm"]["value"], 0.02);
        assert_eq!(value["alarm"]["limit"], 0.01);
        assert_eq!(value["alarm"]["time_s"], 2.0);
        assert!(value["alarm"]["text"].as_str().unwrap().starts_with("advisory"));
        let standing: Value = serde_json::from_str(&made(|o| alarm(o, &alarms.all()[0], &north()))).unwrap();
        assert_eq!((&standing["active"], &standing["latched"]), (&Value::Bool(true), &Value::Bool(false)));
    }
    #[test]
    fn no_key_that_0_1_0_wrote_is_gone() {
        let old = |name: &str| -> Value {
            let path = format!("{}/../../tests/data/0.1.0/{name}", env!("CARGO_MANIFEST_DIR"));
            serde_json::from_str(std::fs::read_to_string(path).unwrap().lines().next().unwrap()).unwrap()
        };
        let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<String>>();
        let one = crate::alarm::tests::reading(0, 2.0, 1.0, 0.02);
        let new: Value = serde_json::from_str(&made(|o| reading(o, &one, &north()))).unwrap();
        assert!(keys(&old("readings.jsonl")).iter().all(|key| new.get(key).is_some()));
        let mut alarms = Alarms::new(AlarmConfig { limit_delay_s: Some(0.01), ..AlarmConfig::default() }, 1);
        let mut sent = String::new();
        alarms.read(&one, |c| change(&mut sent, &c, &north()));
        let new: Value = serde_json::from_str(&sent).unwrap();
        assert!(keys(&old("alarms.jsonl")["alarm"]).iter().all(|key| new["alarm"].get(key).is_some()));
    }
}
