//! Any bytes are a datagram, a line or settings that are refused in words; none is a panic. `RTHSTRACK_FUZZ` sets how many.

use std::sync::Arc;

use rthstrack::setting;
use rthstrack::{Monitor, MonitorConfig, MonitorState, Reading};
use rthstrack_live::LiveConfig;
use rthstrack_live::alarm::{Alarm, AlarmConfig, Change};
use rthstrack_live::engine::{Engine, EngineConfig, Outlet, Sample, Totals};
use rthstrack_live::event::Event;
use rthstrack_live::layout::{ByteOrder, Field, Layout, LayoutConfig, Number};
use rthstrack_live::line::{Column, Format, Line, LineParser, LinesConfig, Splitter};
use rthstrack_live::names::Names;
use serde_json::{Value, json};

fn cases() -> u64 {
    std::env::var("RTHSTRACK_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000)
}

/// A multiplicative congruential generator: the same cases on every machine.
struct Random(u64);

impl Random {
    fn new(case: u64) -> Self {
        Self(case.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1)
    }

    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        self.0 ^ (self.0 >> 29)
    }

    fn below(&mut self, n: usize) -> usize {
        ((self.word() >> 11) as f64 / (1u64 << 53) as f64 * n as f64) as usize
    }

    fn pick<T: Clone>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())].clone()
    }

    fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| (self.word() >> 40) as u8).collect()
    }
}

struct Nowhere(u64);

impl Outlet for Nowhere {
    fn reading(&mut self, _: &Reading) {}
    fn alarm(&mut self, _: &Change) {}
    fn standing(&mut self, _: usize, _: &Alarm) {}
    fn judged(&mut self, _: &Reading, _: &Totals, _: u32) {}
    fn sample(&mut self, _: &Sample<'_>) {
        self.0 += 1;
    }
    fn evaluated(&mut self, _: f64, _: &Monitor, _: &MonitorState) {}
    fn restarted(&mut self) {}
    fn event(&mut self, event: Event) {
        assert!(!event.text(&Names::new(&[], 256)).contains('\n'));
    }
}

fn engine(n_actuators: usize, bits: u32) -> Engine {
    let config = MonitorConfig { rate_hz: 64.0, window_s: 0.5, update_hz: 8.0, n_actuators, ..Default::default() };
    let alarms = AlarmConfig {
        limit_delay_s: Some(0.01),
        limit_amplitude: Some(0.1),
        critical_delay_s: Some(0.02),
        limit_lost: Some(3),
        ..AlarmConfig::default()
    };
    let config = (Arc::new(Monitor::new(config).unwrap()), alarms);
    Engine::new(config.0, &EngineConfig { counter_bits: bits, fill_samples: 5, check_pace: true, alarms: config.1 })
}

fn layout(random: &mut Random) -> LayoutConfig {
    let n = 1 + random.below(3);
    let field = |random: &mut Random| Field {
        offset: random.below(24),
        number: random.pick(&Number::NAMES).1,
        scale: random.pick(&[1.0, -2.0, 1e-300, 1e300, 0.0]),
        zero: random.pick(&[0.0, 5.0, f64::INFINITY]),
    };
    LayoutConfig {
        target: (0..n).map(|_| field(random)).collect(),
        measured: (0..n).map(|_| field(random)).collect(),
        byte_order: random.pick(&ByteOrder::NAMES).1,
        header_bytes: random.pick(&[0, 0, 4, 7, usize::MAX]),
        sample_bytes: random.pick(&[16, 24, 32, 0, usize::MAX]),
        counter: random.pick(&[None, Some((0, Number::F64)), Some((0, Number::U16)), Some((4, Number::I32))]),
    }
}

#[test]
fn any_bytes_under_any_layout_are_samples_or_malformed() {
    let (mut accepted, mut taken, mut refused) = (0, 0, 0);
    let per_layout = 200;
    for case in 0..cases().div_ceil(per_layout) {
        let mut random = Random::new(case);
        let config =
            if random.below(2) == 0 { LayoutConfig::doubles(1 + random.below(3)) } else { layout(&mut random) };
        let (header, size) = (config.header_bytes, config.sample_bytes);
        let layout = match Layout::new(config) {
            Ok(layout) => layout,
            Err(mistakes) => {
                assert!(!mistakes.is_empty() && mistakes.iter().all(|m| !m.contains('\n')));
                refused += 1;
                continue;
            }
        };
        let n = layout.n_actuators();
        let (mut target, mut measured) = (vec![0.0; n], vec![0.0; n]);
        let (mut engine, mut out) = (engine(n, layout.counter_bits()), Nowhere(0));
        let mut count = 0u64;
        for i in 0..per_layout {
            let len = if random.below(3) == 0 { random.below(200) } else { header + size * (1 + random.below(3)) };
            let mut datagram = random.bytes(len);
            if random.below(2) == 0 && len >= header + 8 {
                count += random.pick(&[1, 1, 1, 1, 2, 4, 30]);
                datagram[header..header + 8].copy_from_slice(&(count as f64).to_le_bytes());
            }
            let now_s = i as f64 / random.pick(&[64.0, 64.0, 1.0]);
            match layout.n_samples(datagram.len()) {
                None => engine.malformed(),
                Some(k) => {
                    assert_eq!(len, header + k * size);
                    for s in 0..k {
                        match layout.decode(&datagram, s, &mut target, &mut measured) {
                            None => engine.malformed(),
                            Some(counter) => {
                                accepted += 1;
                                let counter = layout.is_counted().then_some(counter);
                                engine.sample(now_s, counter, &target, &measured, &mut out);
                            }
                        }
                    }
                }
            }
            engine.idle(now_s, &mut out);
        }
        taken += out.0;
    }
    assert!(accepted > cases() / 10 && taken > 0 && refused > 0, "{accepted} {taken} {refused}");
}

fn lines(random: &mut Random) -> LinesConfig {
    let n = 1 + random.below(2);
    let column = |random: &mut Random| match random.below(3) {
        0 => Column::Name(random.pick(&["x", "y", "t", ""]).to_owned()),
        _ => Column::Index(random.pick(&[0, 1, 2, 3, 4, usize::MAX])),
    };
    LinesConfig {
        target: (0..n).map(|_| column(random)).collect(),
        measured: (0..n).map(|_| column(random)).collect(),
        counter: Some(column(random)).filter(|_| random.below(2) == 0),
        format: random.pick(&Format::NAMES).1,
        delimiter: random.pick(&[None, None, Some(','), Some(' '), Some('e'), Some('\u{e9}')]),
        scale: random.pick(&[vec![], vec![(2.0, 3.0); n], vec![(f64::NAN, 1.0)]]),
    }
}

#[test]
fn any_text_under_any_layout_is_a_sample_or_malformed() {
    let pieces = [
        "0",
        "1",
        "2",
        "-1",
        "1.5",
        "1e400",
        "nan",
        "-inf",
        "",
        " ",
        ",",
        ";",
        "\t",
        "\"",
        "{",
        "}",
        "[",
        "]",
        ":",
        "x",
        "y",
        "counter",
        "\"counter\"",
        "\"target\"",
        "\"measured\"",
        "null",
        "true",
        "\\u0000",
        "#",
        "\u{feff}",
        "\u{e9}",
        "1,5",
        "9007199254740993",
        "[[[[[[[[",
        "{\"counter\":1,\"target\":[1],\"measured\":[2]}",
        "3,4,5",
        "6,7,8,9,10",
    ];
    let per_layout = 200;
    let (mut samples, mut malformed, mut unusable) = (0u64, 0u64, 0u64);
    for case in 0..cases().div_ceil(per_layout) {
        let mut random = Random::new(case ^ 0x5555);
        let config =
            if random.below(2) == 0 { LinesConfig::usual(1 + random.below(2), true) } else { lines(&mut random) };
        let Ok(mut parser) = LineParser::new(config.clone()) else { continue };
        let n = parser.n_actuators();
        let (mut target, mut measured) = (vec![0.0; n], vec![0.0; n]);
        for i in 0..per_layout {
            let line: Vec<u8> = match random.below(8) {
                0 => {
                    let len = random.below(40);
                    random.bytes(len)
                }
                1 => format!("{i},{},{},{},{}", random.below(9), random.below(9), random.below(9), random.below(9))
                    .into(),
                _ => (0..random.below(9)).map(|_| random.pick(&pieces)).collect::<String>().into(),
            };
            match parser.read(&line, &mut target, &mut measured) {
                Line::Sample(counter) => {
                    samples += 1;
                    assert!(counter.is_none_or(|c| (0..=1 << 53).contains(&c)));
                    assert_eq!(counter.is_some(), config.counter.is_some());
                }
                Line::Malformed => malformed += 1,
                Line::Nothing => {}
                Line::Unusable(message) => {
                    unusable += 1;
                    assert!(!message.contains('\n'), "{message:?}");
                    break;
                }
            }
        }
    }
    assert!(samples > cases() / 100 && malformed > samples && unusable > 0, "{samples} {malformed} {unusable}");
}

/// A monitor's setting, of its kind or of another.
fn entry(random: &mut Random) -> (String, setting::Value) {
    let name = random.pick(&[
        "rate_hz",
        "window_s",
        "update_hz",
        "n_actuators",
        "band_hz",
        "estimator",
        "data_decimation",
        "x",
    ]);
    let value = match random.below(7) {
        0 => setting::Value::Nothing,
        1 => setting::Value::Flag(true),
        2 => setting::Value::Whole(random.pick(&[-1, 0, 1, 8, 1 << 40, i64::MAX])),
        3 => setting::Value::Number(random.pick(&[0.0, -1.0, 0.5, 1e300, 1024.0, f64::NAN, f64::INFINITY])),
        4 => setting::Value::Pair(random.pick(&[0.0, 8.0, -1.0]), random.pick(&[f64::NAN, 1.0, 20.0])),
        5 => setting::Value::Text(random.pick(&["fei", "aligned", "", "\n"]).to_owned()),
        _ => setting::Value::Other("[1]".to_owned()),
    };
    (name.to_owned(), value)
}

fn setting(random: &mut Random, depth: usize) -> Value {
    let keys = [
        "rate_hz",
        "window_s",
        "update_hz",
        "n_actuators",
        "band_hz",
        "estimator",
        "data_decimation",
        "kind",
        "address",
        "layout",
        "senders",
        "fill_samples",
        "counter",
        "target",
        "measured",
        "offset",
        "type",
        "scale",
        "zero",
        "path",
        "sample_bytes",
        "header_bytes",
        "limit_delay_s",
        "silence_s",
        "latch",
        "log",
        "names",
        "format",
        "delimiter",
        "x",
    ];
    match random.below(if depth == 0 { 6 } else { 9 }) {
        0 => Value::Null,
        1 => json!(random.pick(&[0.0, 1.0, -1.0, 0.5, 1e300, 1e-300, 1024.0])),
        2 => json!(random.pick(&[0u64, 1, 2, 8, 64, 1 << 40, u64::MAX])),
        3 => json!(random.below(2) == 0),
        4 | 5 => json!(random.pick(&["udp", "lines", "fei", "f64", "127.0.0.1:0", "", "nan", "i16", ",", "::1"])),
        6 => (0..random.below(4)).map(|_| setting(random, depth - 1)).collect(),
        _ => (0..random.below(8)).map(|_| (random.pick(&keys).to_owned(), setting(random, depth - 1))).collect(),
    }
}

#[test]
fn any_settings_are_taken_or_refused_in_words() {
    let mut refused = 0;
    for case in 0..cases() / 10 {
        let mut random = Random::new(case ^ 0x3333);
        let mut made = || setting(&mut random, 4);
        let [mut source, alarms, outputs] = [made(), made(), made()];
        let n_entries = random.below(4);
        let monitor = setting::read((0..n_entries).map(|_| entry(&mut random)));
        if let (Value::Object(map), 0) = (&mut source, case % 2) {
            map.insert("kind".to_owned(), json!(if case % 4 == 0 { "udp" } else { "lines" }));
            map.insert("address".to_owned(), json!("127.0.0.1:0"));
        }
        if let Err(mistakes) = LiveConfig::read(monitor, &source, &alarms, &outputs) {
            refused += 1;
            assert!(
                !mistakes.is_empty() && mistakes.iter().all(|m| !m.contains('\n') && !m.is_empty()),
                "{mistakes:?}"
            );
        }
    }
    assert!(refused > 0);
}

#[test]
fn any_bytes_in_any_pieces_are_the_same_lines() {
    for case in 0..cases() / 20 {
        let mut random = Random::new(case ^ 0xaaaa);
        let len = random.below(300);
        let bytes: Vec<u8> = (0..len).map(|_| random.pick(b"ab\n\r\0\xff")).collect();
        let mut splitter = Splitter::default();
        let mut found: Vec<Vec<u8>> = Vec::new();
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let (piece, after) = rest.split_at(1 + random.below(rest.len()));
            splitter.push(piece, |line| found.push(line.unwrap().to_vec()));
            rest = after;
        }
        found.extend(splitter.finish());
        let mut expected: Vec<&[u8]> = bytes.split(|b| *b == b'\n').collect();
        expected.pop_if(|last| last.is_empty());
        assert_eq!(found, expected);
    }
}
