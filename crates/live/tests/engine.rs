//! What becomes of a stream's faults, without sockets and clocks.

use std::sync::Arc;

use rthstrack::{EvaluatorConfig, Monitor, MonitorConfig, MonitorState, Reading, Reason};
use rthstrack_live::alarm::{Alarm, AlarmConfig, Change, Kind};
use rthstrack_live::engine::{Engine, EngineConfig, Outlet, Sample, Totals};
use rthstrack_live::event::{Event, Happening};
use rthstrack_live::names::Names;

const RATE_HZ: f64 = 256.0;

/// Index, counter, filled, target, measured.
type Taken = (u64, i64, bool, Vec<f64>, Vec<f64>);

/// Remembers everything.
#[derive(Default)]
struct Memory {
    readings: Vec<Reading>,
    samples: Vec<Taken>,
    changes: Vec<Change>,
    events: Vec<(f64, String)>,
    evaluated: Vec<f64>,
    raised: u32,
}

impl Outlet for Memory {
    fn reading(&mut self, reading: &Reading) {
        self.readings.push(*reading);
    }
    fn alarm(&mut self, change: &Change) {
        self.changes.push(*change);
    }
    fn standing(&mut self, _: usize, _: &Alarm) {}
    fn judged(&mut self, _: &Reading, _: &Totals, raised: u32) {
        self.raised = raised;
    }
    fn sample(&mut self, s: &Sample<'_>) {
        self.samples.push((s.index, s.counter, s.filled, s.target.to_vec(), s.measured.to_vec()));
    }
    fn evaluated(&mut self, time_s: f64, _: &Monitor, _: &MonitorState) {
        self.evaluated.push(time_s);
    }
    fn restarted(&mut self) {}
    fn event(&mut self, event: Event) {
        self.events.push((event.time_s, event.text(&Names::new(&[], 2))));
    }
}

fn monitor() -> Arc<Monitor> {
    let config = MonitorConfig { rate_hz: RATE_HZ, window_s: 1.0, update_hz: 32.0, ..MonitorConfig::default() };
    Arc::new(Monitor::new(config).unwrap())
}

/// What NaN does not keep from being equal.
fn lines(readings: &[Reading]) -> Vec<String> {
    let line = |reading: &Reading| {
        let mut out = String::new();
        rthstrack_live::json::reading(&mut out, reading, &Names::new(&[], 2));
        out
    };
    readings.iter().map(line).collect()
}

struct Bench {
    engine: Engine,
    out: Memory,
    /// Of the sender, in samples since its start.
    sent: u64,
    now_s: f64,
    delay_s: f64,
}

impl Bench {
    fn new(alarms: AlarmConfig) -> Self {
        Self::with(monitor(), alarms, true)
    }

    fn with(monitor: Arc<Monitor>, alarms: AlarmConfig, check_pace: bool) -> Self {
        let config = EngineConfig { counter_bits: 64, fill_samples: 8, check_pace, alarms };
        Self { engine: Engine::new(monitor, &config), out: Memory::default(), sent: 0, now_s: 100.0, delay_s: 0.010 }
    }

    fn target(&self, n: u64) -> f64 {
        let t = n as f64 / RATE_HZ;
        (std::f64::consts::TAU * 3.0 * t).sin()
    }

    fn send(&mut self, counter: u64) {
        let t = counter as f64 / RATE_HZ;
        let measured = 0.9 * (std::f64::consts::TAU * 3.0 * (t - self.delay_s)).sin();
        let target = self.target(counter);
        self.engine.sample(self.now_s, Some(counter as i64), &[target], &[measured], &mut self.out);
    }

    /// So many samples, each in its time.
    fn run(&mut self, n: u64) {
        for _ in 0..n {
            self.send(self.sent);
            self.pass(1);
        }
    }

    /// Time goes on at the sender, with ticks here; nothing comes.
    fn pass(&mut self, n: u64) {
        for _ in 0..n {
            self.sent += 1;
            self.now_s += 1.0 / RATE_HZ;
            self.engine.idle(self.now_s, &mut self.out);
        }
    }

    fn told(&self, part: &str) -> usize {
        self.out.events.iter().filter(|(_, text)| text.contains(part)).count()
    }
}

#[test]
fn readings_are_the_cores_own() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(1024);
    let monitor = monitor();
    let mut state = monitor.state();
    let mut expected = Vec::new();
    for (_, _, _, target, measured) in &bench.out.samples {
        expected.extend_from_slice(monitor.step(&mut state, target, measured).unwrap_or_default());
    }
    assert!(lines(&bench.out.readings) == lines(&expected));
    assert_eq!(bench.out.readings.len(), (1024 - 256) / 8 + 1);
    assert!((bench.out.readings[0].tracking.delay_s - 0.010).abs() < 1e-4);
    assert_eq!(bench.engine.totals().readings as usize, expected.len());
    assert_eq!(bench.out.evaluated.len(), 1024);
    assert_eq!(bench.out.evaluated[1023], 1023.0 / RATE_HZ);
}

#[test]
fn evaluated_samples_are_told_as_the_decimator_gives_them() {
    let config = MonitorConfig {
        rate_hz: RATE_HZ,
        window_s: 1.0,
        update_hz: 8.0,
        evaluator: EvaluatorConfig { data_decimation: 4, ..MonitorConfig::default().evaluator },
        ..Default::default()
    };
    let monitor = Arc::new(Monitor::new(config).unwrap());
    let mut bench = Bench::with(monitor.clone(), AlarmConfig::default(), true);
    bench.run(1024);
    let first = bench.out.readings[0];
    let window = monitor.window_len();
    // The window of a reading ends with an evaluated sample: its time less the decimator's delay.
    let end = bench.out.evaluated[window - 1];
    assert!((end - (first.time_s - monitor.latency_s())).abs() < 1e-12, "{end} {}", first.time_s);
    assert!((0.5 * (bench.out.evaluated[0] + end) - first.centre_s).abs() < 1e-12);
}

#[test]
fn a_short_gap_is_filled_by_a_straight_line_and_counted() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(300);
    bench.pass(3);
    bench.run(300);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.lost, tally.filled, tally.restarts), (600, 3, 3, 0));
    let samples = &bench.out.samples;
    assert_eq!(samples.len(), 603);
    assert!(samples.iter().enumerate().all(|(i, s)| s.0 == i as u64 && s.1 == i as i64));
    let (before, after) = (samples[299].3[0], samples[303].3[0]);
    for j in 1..=3 {
        let (_, _, filled, target, _) = &samples[299 + j];
        assert!(filled);
        assert!((target[0] - (before + (after - before) * j as f64 / 4.0)).abs() < 1e-15);
    }
    assert_eq!(samples.iter().filter(|s| s.2).count(), 3);
}

#[test]
fn a_long_gap_restarts_the_window_and_time_goes_on() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(300);
    bench.pass(40);
    let readings = bench.out.readings.len();
    bench.run(255);
    assert_eq!(bench.out.readings.len(), readings, "the window must fill again");
    bench.run(1);
    let last = bench.out.readings.last().unwrap();
    assert_eq!((bench.out.readings.len(), last.index), (readings + 1, 595));
    assert_eq!(last.time_s, 595.0 / RATE_HZ);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.lost, tally.filled, tally.restarts), (40, 0, 1));
    assert_eq!(bench.told("40 samples lost: the window starts anew"), 1);
}

#[test]
fn a_sender_that_dies_is_silent_and_its_return_is_told() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.engine.idle(500.0, &mut bench.out);
    assert!(bench.out.changes.is_empty(), "there is no silence before the first sample");
    bench.run(300);
    bench.pass(256 - 2);
    assert!(!bench.engine.is_silent());
    bench.pass(4);
    assert!(bench.engine.is_silent());
    let raised = bench.out.changes[0];
    assert_eq!((raised.alarm.kind, raised.alarm.actuator, raised.raised), (Kind::Silence, None, true));
    assert!((raised.time_s - (299.0 / RATE_HZ + 1.0)).abs() < 2.0 / RATE_HZ, "{}", raised.time_s);
    bench.pass(1000);
    assert_eq!(bench.out.changes.len(), 1);
    // It starts again with its counter at zero.
    bench.sent = 0;
    bench.run(300);
    assert!(!bench.engine.is_silent());
    assert_eq!(bench.told("the counter started anew at 0"), 1);
    assert_eq!(bench.told("samples again"), 1);
    let silence = bench.engine.alarms().iter().find(|a| a.kind == Kind::Silence).unwrap();
    assert!(!silence.active && silence.latched);
    bench.engine.reset(bench.now_s, &mut bench.out);
    assert_eq!(bench.out.changes.last().map(|c| (c.alarm.kind, c.raised)), Some((Kind::Silence, false)));
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.lost, tally.restarts), (600, 0, 1));
    let last = bench.out.samples.last().unwrap().0;
    assert!((599 + 1256..=599 + 1258).contains(&last), "time has gone on while nothing came: {last}");
}

#[test]
fn a_sender_that_goes_on_after_a_pause_has_lost_what_it_counted() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(300);
    bench.pass(512);
    bench.run(300);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.lost, tally.restarts), (600, 512, 1));
    assert_eq!(bench.out.samples.last().unwrap().0, 1111);
}

#[test]
fn a_sender_that_pauses_its_counter_has_lost_nothing() {
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(300);
    let sent = bench.sent;
    bench.pass(512);
    bench.sent = sent;
    bench.run(300);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.lost, tally.restarts), (600, 0, 0));
}

#[test]
fn late_and_repeated_samples_do_not_disturb_the_window() {
    let mut plain = Bench::new(AlarmConfig::default());
    plain.run(600);
    let mut bench = Bench::new(AlarmConfig::default());
    bench.run(400);
    for counter in [399, 398, 100, 399] {
        bench.send(counter);
    }
    bench.run(200);
    assert!(lines(&bench.out.readings) == lines(&plain.out.readings));
    assert_eq!(bench.engine.totals().tally.repeated, 4);
    // 601 comes after 602.
    bench.send(600);
    bench.send(602);
    bench.send(601);
    bench.send(603);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.lost, tally.reordered, tally.filled), (604, 0, 1, 1));
    assert_eq!(bench.out.samples.len(), 604);
}

#[test]
fn samples_that_are_no_numbers_make_readings_invalid_until_they_have_left_the_window() {
    let mut bench = Bench::new(AlarmConfig { limit_delay_s: Some(0.005), latch: false, ..AlarmConfig::default() });
    bench.run(400);
    assert_eq!(bench.out.changes.len(), 1);
    for value in [f64::NAN, f64::INFINITY] {
        bench.engine.sample(bench.now_s, Some(bench.sent as i64), &[value], &[0.0], &mut bench.out);
        bench.pass(1);
    }
    let before = bench.out.readings.len();
    bench.run(254);
    let affected = &bench.out.readings[before..];
    assert!(affected.iter().all(|r| !r.is_valid() && r.tracking.reason == Some(Reason::NotFinite)), "{affected:?}");
    assert_eq!(bench.out.changes.len(), 1, "they neither raise nor clear");
    bench.run(9);
    assert!(bench.out.readings.last().unwrap().is_valid());
    assert_eq!(bench.engine.totals().malformed, 0);
}

#[test]
fn a_limit_on_lost_samples_counts_those_of_the_last_window() {
    let mut bench = Bench::new(AlarmConfig { limit_lost: Some(5), latch: false, ..AlarmConfig::default() });
    bench.run(300);
    bench.pass(3);
    bench.run(100);
    bench.pass(3);
    assert!(bench.out.changes.is_empty());
    bench.run(1);
    assert_eq!(bench.out.changes.iter().map(|c| (c.raised, c.alarm.value)).collect::<Vec<_>>(), [(true, 6.0)]);
    assert_eq!(bench.out.changes[0].alarm.kind, Kind::Lost);
    bench.run(8);
    assert_eq!(bench.out.raised, Kind::Lost.bit());
    // The first gap leaves the window of 256 samples.
    bench.run(256 - 103 - 9);
    assert_eq!(bench.out.changes.len(), 1);
    bench.run(3);
    assert_eq!(bench.out.changes.last().map(|c| (c.raised, c.alarm.value)), Some((false, 3.0)));
}

#[test]
fn a_stream_without_a_counter_is_taken_as_it_comes() {
    let mut bench = Bench::new(AlarmConfig::default());
    for i in 0..600u32 {
        let t = f64::from(i) / RATE_HZ;
        bench.engine.sample(t, None, &[t.sin()], &[t.sin()], &mut bench.out);
    }
    assert_eq!(bench.engine.totals().tally.received, 600);
    assert_eq!(bench.out.samples.last().map(|s| (s.0, s.1)), Some((599, 599)));
}

#[test]
fn a_stream_without_a_counter_starts_anew_after_a_silence() {
    let mut bench = Bench::new(AlarmConfig::default());
    let mut send = |from_s: f64, n: u32| {
        for i in 0..n {
            let t = from_s + f64::from(i) / RATE_HZ;
            bench.engine.sample(t, None, &[t.sin()], &[t.sin()], &mut bench.out);
        }
    };
    send(0.0, 256);
    send(4.0, 256);
    let tally = bench.engine.totals().tally;
    assert_eq!((tally.received, tally.restarts), (512, 1));
    let last = bench.out.samples.last().unwrap().0;
    assert!((5 * 256 - 3..=5 * 256).contains(&last), "{last}");
    assert_eq!(bench.told("nothing came for 3.0 s"), 1);
}

#[test]
fn an_actuator_that_moves_and_is_not_judged_is_an_alarm() {
    let config = AlarmConfig { limit_delay_s: Some(0.020), unjudged_s: Some(3.0), ..AlarmConfig::default() };
    let mut bench = Bench::new(config);
    bench.run(900);
    assert!(bench.out.changes.is_empty() && bench.engine.totals().valid > 0);
    // One sample in a hundred is no number: no window is without.
    for i in 0..1500u64 {
        let (x, y) = (bench.target(bench.sent), if i % 100 == 0 { f64::NAN } else { 0.0 });
        bench.engine.sample(bench.now_s, Some(bench.sent as i64), &[x], &[y], &mut bench.out);
        bench.engine.idle(bench.now_s, &mut bench.out);
        bench.sent += 1;
        bench.now_s += 1.0 / RATE_HZ;
    }
    let raised: Vec<_> = bench.out.changes.iter().map(|c| (c.alarm.kind, c.alarm.actuator, c.raised)).collect();
    assert_eq!(raised, [(Kind::Unjudged, Some(0), true)]);
    let at_s = bench.out.changes[0].time_s;
    assert!((at_s - (899.0 / RATE_HZ + 3.0)).abs() < 0.1, "{at_s}");
    assert_eq!(bench.told("actuator 1: not determined: the window holds samples that are NaN"), 1);
    bench.run(900);
    let unjudged = bench.engine.alarms().iter().find(|a| a.kind == Kind::Unjudged).unwrap();
    assert!(!unjudged.active && unjudged.latched);
    assert_eq!(bench.told("actuator 1: determined again"), 1);
}

#[test]
fn no_text_of_a_sender_reaches_a_terminal_as_a_command() {
    let mut bench = Bench::new(AlarmConfig::default());
    let (line, expected) = ("x\u{1b}]0;owned\u{7}".to_owned(), "a sample".to_owned());
    bench.engine.tell(0.0, Happening::MalformedLine { line, expected }, &mut bench.out);
    bench.engine.fail("y\u{1b}[2J".to_owned());
    assert_eq!(bench.told("x\u{fffd}]0;owned\u{fffd}"), 1);
    assert_eq!(bench.engine.fatal(), Some("y\u{fffd}[2J"));
}

#[test]
fn a_rate_that_the_counter_contradicts_is_told_within_five_seconds() {
    let mut bench = Bench::new(AlarmConfig::default());
    let start_s = bench.now_s;
    while bench.engine.fatal().is_none() {
        bench.send(bench.sent);
        bench.sent += 1;
        bench.now_s += 0.5 / RATE_HZ;
        assert!(bench.now_s - start_s < 5.0);
    }
    let fatal = bench.engine.fatal().unwrap();
    assert_eq!(
        fatal,
        "the counter advances by 512 a second but --rate says 256: give the sender's true rate, or --any-pace for a replay \
         at another speed"
    );
    let mut bench = Bench::with(monitor(), AlarmConfig::default(), false);
    for _ in 0..10 * 512 {
        bench.send(bench.sent);
        bench.sent += 1;
        bench.now_s += 0.5 / RATE_HZ;
    }
    assert_eq!(bench.engine.fatal(), None);
    assert!((bench.engine.pace_hz() - 512.0).abs() < 1.0);
}

#[test]
fn alarms_follow_the_readings_and_are_counted_once() {
    let config = AlarmConfig { limit_delay_s: Some(0.020), limit_amplitude: Some(0.2), ..AlarmConfig::default() };
    let mut bench = Bench::new(config);
    bench.run(600);
    assert!(bench.out.changes.is_empty());
    bench.delay_s = 0.030;
    bench.run(600);
    assert_eq!(bench.engine.totals().alarms, 1);
    assert_eq!(bench.told("advisory: actuator 1: lag of up to"), 1);
    bench.delay_s = 0.010;
    bench.run(600);
    bench.engine.reset(bench.now_s, &mut bench.out);
    assert_eq!(bench.out.changes.iter().map(|c| c.raised).collect::<Vec<_>>(), [true, false]);
}

#[test]
fn a_storm_of_events_is_cut_short() {
    let mut bench = Bench::new(AlarmConfig::default());
    for i in 0..1000u64 {
        // Each counter lies far from the last.
        bench.send(if i % 2 == 0 { i } else { 1_000_000 + i });
        bench.now_s += 1.0 / RATE_HZ;
    }
    assert!(bench.out.events.len() <= 60, "{}", bench.out.events.len());
    assert!(bench.told("more events, not shown") >= 3);
}
