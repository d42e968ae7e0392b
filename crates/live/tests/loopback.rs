//! The whole over real sockets on this machine: what a sender sends, what a controller gets, what a page is told.

use std::net::UdpSocket;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use rthstrack::{EvaluatorConfig, MonitorConfig};
use rthstrack_live::names::Names;
use rthstrack_live::{Live, LiveConfig, LiveError, LoggedReading};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(20);

fn opened(monitor: MonitorConfig, source: Value, alarms: Value, outputs: Value) -> Result<Live, LiveError> {
    let config = LiveConfig::read((monitor, Vec::new()), &source, &alarms, &outputs).map_err(LiveError::Settings)?;
    Live::new(config)
}

fn usual_monitor() -> MonitorConfig {
    let evaluator = EvaluatorConfig::published();
    MonitorConfig { rate_hz: 256.0, window_s: 1.0, update_hz: 32.0, evaluator, ..MonitorConfig::default() }
}

fn usual_source() -> Value {
    json!({"kind": "udp", "address": "127.0.0.1:0", "check_pace": false})
}

fn receiver() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    socket
}

fn received(socket: &UdpSocket) -> Value {
    let mut bytes = [0; 4096];
    let len = socket.recv(&mut bytes).expect("a datagram in time");
    serde_json::from_slice(&bytes[..len]).unwrap()
}

/// Sends samples of a sine, measured `delay_s` later and 10 % too small, with pauses that let a small buffer empty.
struct Sender {
    socket: UdpSocket,
    next: u64,
}

impl Sender {
    fn to(live: &Live) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(live.address()).unwrap();
        Self { socket, next: 0 }
    }

    fn send(&mut self, n: u64, delay_s: f64) {
        for _ in 0..n {
            let t = self.next as f64 / 256.0;
            let wave = |t: f64| (std::f64::consts::TAU * 3.0 * t).sin();
            let sample = [self.next as f64, wave(t), 0.9 * wave(t - delay_s)].map(f64::to_le_bytes).concat();
            // A run that has ended listens no more.
            if let Err(error) = self.socket.send(&sample) {
                assert_eq!(error.kind(), std::io::ErrorKind::ConnectionRefused, "{error}");
            }
            self.next += 1;
            if self.next.is_multiple_of(64) {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }
}

fn until(what: &str, holds: impl Fn() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < PATIENCE, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_controller_gets_each_reading_and_each_alarm_as_a_datagram() {
    let (readings, alarms) = (receiver(), receiver());
    let outputs = json!({
        "readings_udp": readings.local_addr().unwrap().to_string(), "alarm_udp": alarms.local_addr().unwrap().to_string(),
        "control": "127.0.0.1:0", "log": true, "page": true, "names": ["north"],
    });
    let live =
        opened(usual_monitor(), usual_source(), json!({"limit_delay_s": 0.02, "silence_s": null}), outputs).unwrap();
    live.start().unwrap();
    live.start().unwrap();
    let mut sender = Sender::to(&live);
    sender.send(512, 0.010);
    let first = received(&readings);
    assert_eq!((&first["index"], &first["valid"]), (&json!(255), &json!(true)));
    let whose = |told: &Value| ["actuator", "actuator_number", "actuator_name"].map(|key| told[key].clone());
    let north = [json!(0), json!(1), json!("north")];
    assert_eq!(whose(&first), north);
    assert!((first["delay_s"].as_f64().unwrap() - 0.010).abs() < 1e-4 && first["amplitude_interval"].is_null());
    assert!((first["amplitude"].as_f64().unwrap() - 0.9).abs() < 1e-3);
    (1..33).for_each(|i| assert_eq!(received(&readings)["index"], json!(255 + 8 * i)));

    // The page is told the same.
    until("a frame with all", || {
        let frame: Value = serde_json::from_str(&live.frame(0).0).unwrap();
        frame["readings"].as_array().unwrap().len() == 33
            && frame["scope"]["target"][0].as_array().unwrap().len() == 512
    });
    let (text, cursor) = live.frame(0);
    let frame: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(frame["state"], "running");
    assert_eq!(frame["readings"][0][0], first["index"]);
    assert_eq!(frame["readings"][0][5], first["delay_s"]);
    assert_eq!(frame["scope"]["end_s"], json!(511.0 / 256.0));
    assert!(frame["spectrum"]["frequency_hz"].as_array().is_some_and(|bins| bins.len() == 128));
    assert_eq!(frame["alarms"][0]["active"], json!(false));
    let frame: Value = serde_json::from_str(&live.frame(cursor).0).unwrap();
    assert_eq!(frame["readings"], json!([]));
    let hello: Value = serde_json::from_str(&live.hello()).unwrap();
    assert_eq!(hello["names"], json!(["north"]));
    assert_eq!((&hello["rate_hz"], &hello["limits"]["delay_s"]), (&json!(256.0), &json!(0.02)));
    assert_eq!(hello["limits"]["amplitude"], Value::Null);
    let kinds = hello["alarm_kinds"].as_array().unwrap();
    assert!(kinds.iter().all(|kind| hello["limits"].get(kind["limit"].as_str().unwrap()).is_some()), "{kinds:?}");

    // An alarm, and its reset from this machine.
    sender.send(512, 0.040);
    let raised = received(&alarms);
    assert_eq!((&raised["alarm"]["name"], &raised["alarm"]["raised"]), (&json!("delay"), &json!(true)));
    assert_eq!(whose(&raised["alarm"]), north);
    assert!(raised["alarm"]["text"].as_str().unwrap().starts_with("advisory: north: lag of up to"), "{raised}");
    sender.send(512, 0.010);
    until("all received", || live.summary().totals.tally.received == 1536);
    until("a latched alarm", || live.status().contains("\"active\":false,\"latched\":true"));
    UdpSocket::bind("127.0.0.1:0").unwrap().send_to(b"reset\n", live.control_address()).unwrap();
    assert_eq!(received(&alarms)["alarm"]["raised"], json!(false));
    until("no alarm, and that it was reset", || {
        !live.status().contains("\"latched\":true") && live.status().contains("alarms reset")
    });
    let status: Value = serde_json::from_str(&live.status()).unwrap();
    assert_eq!(status["readings"][0]["index"], json!(1535));
    let events = status["events"].as_array().unwrap();
    let event = |code: &str| events.iter().find(|e| e["code"] == code).unwrap_or_else(|| panic!("{code}: {events:?}"));
    assert_eq!(
        (&event("alarms_reset")["text"], &event("alarms_reset")["values"]["still_active"]),
        (&json!("alarms reset"), &json!(0))
    );
    let values = &event("alarm_raised")["values"];
    assert_eq!((&values["alarm"], &values["limit"]), (&json!("delay"), &json!(0.02)));
    assert_eq!(whose(values), north);
    assert_eq!(event("alarm_raised")["text"], raised["alarm"]["text"]);
    assert_eq!([whose(&status["readings"][0]), whose(&status["alarms"][0])], [north.clone(), north.clone()]);
    assert_eq!(event("alarm_over")["values"]["alarm"], json!("delay"));
    assert!(live.alarmed());

    live.stop();
    live.stop();
    assert!(live.wait(Duration::ZERO) && live.fatal().is_none());
    let samples = live.take_samples();
    assert_eq!(samples.index, (0..1536).collect::<Vec<i64>>());
    assert_eq!((samples.counter[1535], samples.target.len()), (1535, 1536));
    let logged = live.take_readings();
    assert_eq!(logged.len(), 161);
    assert_eq!(logged[0].alarms, "");
    assert!(logged.iter().any(|r| r.alarms == "delay"));
    assert_eq!(live.take_samples().index.len(), 0);
    let summary = live.summary();
    assert_eq!((summary.totals.readings, summary.totals.alarms, summary.log_dropped), (161, 1, 0));
}

#[test]
fn garbage_beside_good_samples_changes_nothing_and_is_counted() {
    let run = |garbage: bool| {
        let live = opened(usual_monitor(), usual_source(), json!({}), json!({"log": true})).unwrap();
        live.start().unwrap();
        let mut sender = Sender::to(&live);
        let other = UdpSocket::bind("127.0.0.1:0").unwrap();
        for i in 0..600u32 {
            sender.send(1, 0.01);
            if garbage {
                let mut bytes = vec![i as u8; (i as usize * 7) % 100];
                if bytes.len().is_multiple_of(24) {
                    bytes.push(0);
                }
                other.send_to(&bytes, live.address()).unwrap();
                let negative = [-1.0, 5.0, 5.0].map(f64::to_le_bytes).concat();
                other.send_to(&negative, live.address()).unwrap();
                if i % 16 == 0 {
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        }
        until("all received", || live.summary().totals.tally.received == 600);
        live.stop();
        let line = |logged: &LoggedReading| {
            let mut out = String::new();
            rthstrack_live::json::reading(&mut out, &logged.reading, &Names::new(&[], 1));
            out
        };
        let readings: Vec<String> = live.take_readings().iter().map(line).collect();
        (readings, live.take_samples(), live.summary().totals)
    };
    let (clean, disturbed) = (run(false), run(true));
    assert_eq!(clean.1, disturbed.1);
    assert_eq!(clean.0.len(), 44);
    assert_eq!(clean.0, disturbed.0);
    assert_eq!(clean.2.malformed, 0);
    assert_eq!(disturbed.2.malformed, 1200);
    assert_eq!(disturbed.2.tally, clean.2.tally);
}

#[test]
fn a_stream_in_the_other_byte_order_ends_the_run_and_says_so() {
    let live = opened(usual_monitor(), usual_source(), json!({}), json!({})).unwrap();
    live.start().unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for counter in 0..200 {
        let sample = [f64::from(counter), 5.0, 5.0].map(f64::to_be_bytes).concat();
        // A run that has ended listens no more.
        let _ = socket.send_to(&sample, live.address());
    }
    assert!(live.wait(PATIENCE));
    live.stop();
    assert!(live.fatal().unwrap().contains("bytes are in the other order"), "{:?}", live.fatal());
}

#[test]
fn only_accepted_senders_are_heard() {
    let source = json!({"kind": "udp", "address": "127.0.0.1:0", "senders": ["192.0.2.1"], "check_pace": false});
    let live = opened(usual_monitor(), source, json!({}), json!({})).unwrap();
    live.start().unwrap();
    Sender::to(&live).send(50, 0.0);
    until("refused", || live.summary().totals.refused == 50);
    assert_eq!(live.summary().totals.tally.received, 0);
    let status: Value = serde_json::from_str(&live.status()).unwrap();
    let refused = &status["events"][0];
    assert_eq!((&refused["code"], &refused["values"]["sender"]), (&json!("sender_refused"), &json!("127.0.0.1")));
    assert_eq!(refused["text"], "datagrams from 127.0.0.1 are refused: not an accepted sender");
    let frame: Value = serde_json::from_str(&live.frame(0).0).unwrap();
    assert_eq!((&frame["state"], &frame["spectrum"]), (&json!("waiting"), &Value::Null));
}

#[test]
fn a_port_in_use_is_refused_in_one_line_that_names_it() {
    let taken = receiver().local_addr().unwrap();
    let holder = UdpSocket::bind(taken).unwrap();
    let source = json!({"kind": "udp", "address": taken.to_string()});
    let error = opened(usual_monitor(), source, json!({}), json!({})).err().unwrap();
    let text = error.to_string();
    assert!(matches!(error, LiveError::System(_)), "{text}");
    assert!(text.contains(&format!("cannot listen on {taken}")) && !text.contains('\n'), "{text}");
    drop(holder);
}

#[test]
fn a_pace_that_contradicts_the_rate_ends_the_run() {
    let source = json!({"kind": "udp", "address": "127.0.0.1:0"});
    let live = opened(usual_monitor(), source, json!({}), json!({})).unwrap();
    live.start().unwrap();
    let mut sender = Sender::to(&live);
    let start = Instant::now();
    while !live.wait(Duration::ZERO) {
        assert!(start.elapsed() < PATIENCE);
        sender.send(8, 0.0);
        std::thread::sleep(Duration::from_millis(8));
    }
    let fatal = live.fatal().unwrap();
    assert!(fatal.contains("a second but --rate says 256"), "{fatal}");
}

fn file(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(format!("{}-{name}", std::process::id()))
}

#[test]
fn lines_of_a_file_become_lines_of_readings() {
    let (input, output) = (file("lines.csv"), file("readings.jsonl"));
    let mut text = String::from("time,x,y,n\n");
    for i in 0..4096 {
        let t = f64::from(i) / 256.0;
        text.push_str(&format!("{t},{},{},{i}\n", (20.0 * t).sin(), 0.5 * (20.0 * t).sin()));
    }
    text.push_str("broken\n4096,1,1,");
    std::fs::write(&input, text).unwrap();
    let source = json!({
        "kind": "lines", "path": input.to_str(), "check_pace": false,
        "layout": {"counter": "n", "target": ["x"], "measured": ["y"]},
    });
    let live =
        opened(usual_monitor(), source, json!({}), json!({"readings_file": output.to_str(), "log": true})).unwrap();
    live.start().unwrap();
    assert!(live.wait(PATIENCE));
    live.stop();
    let totals = live.summary().totals;
    assert_eq!((totals.tally.received, totals.tally.lost, totals.malformed, totals.readings), (4096, 0, 2, 481));
    let written = std::fs::read_to_string(&output).unwrap();
    assert_eq!(written.lines().count(), 481);
    let last: Value = serde_json::from_str(written.lines().last().unwrap()).unwrap();
    assert_eq!(last["index"], json!(4095));
    assert!((last["amplitude"].as_f64().unwrap() - 0.5).abs() < 1e-12);
    [input, output].iter().for_each(|path| std::fs::remove_file(path).unwrap());
}

#[test]
fn a_long_file_comes_as_fast_as_its_reader_writes() {
    let input = file("long.csv");
    let text: String = (0..200_000).map(|i| format!("{i},{},{}\n", i % 100, i % 90)).collect();
    std::fs::write(&input, text).unwrap();
    let source = json!({"kind": "lines", "path": input.to_str(), "check_pace": false});
    let live = opened(usual_monitor(), source, json!({}), json!({"log": true})).unwrap();
    live.start().unwrap();
    let mut taken = 0;
    while !live.wait(Duration::from_millis(20)) {
        taken += live.take_samples().index.len();
        live.take_readings();
    }
    taken += live.take_samples().index.len();
    assert_eq!((taken, live.summary().log_dropped), (200_000, 0));
    std::fs::remove_file(input).unwrap();
}

#[test]
fn an_unknown_channel_ends_the_run_in_one_line() {
    let input = file("unknown.csv");
    std::fs::write(&input, "n,x,y\n1,2,3\n").unwrap();
    let layout = json!({"target": ["command"], "measured": ["y"]});
    let source = json!({"kind": "lines", "path": input.to_str(), "layout": layout});
    let live = opened(usual_monitor(), source, json!({}), json!({})).unwrap();
    live.start().unwrap();
    assert!(live.wait(PATIENCE));
    assert_eq!(live.fatal().unwrap(), "there is no channel 'command': the header has n, x, y");
    std::fs::remove_file(input).unwrap();
}

#[test]
fn a_file_that_cannot_be_written_is_told_at_the_start() {
    let outputs = json!({"readings_file": "/no/such/folder/readings.jsonl"});
    let error = opened(usual_monitor(), usual_source(), json!({}), outputs).err().unwrap();
    assert!(error.to_string().starts_with("cannot write readings to /no/such/folder/readings.jsonl: "), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_the_monitor_goes_on() {
    let readings = receiver();
    let outputs = json!({"readings_file": "/dev/full", "readings_udp": readings.local_addr().unwrap().to_string()});
    let live = opened(usual_monitor(), usual_source(), json!({}), outputs).unwrap();
    live.start().unwrap();
    let mut sender = Sender::to(&live);
    sender.send(300, 0.01);
    until("told", || live.status().contains("readings are no longer written to /dev/full: "));
    sender.send(300, 0.01);
    (0..44).for_each(|_| assert_eq!(received(&readings)["valid"], json!(true)));
}

#[test]
fn a_run_that_was_never_started_stops() {
    let live = opened(usual_monitor(), usual_source(), json!({}), json!({})).unwrap();
    assert!(!live.wait(Duration::from_millis(1)));
    live.stop();
    assert!(live.wait(Duration::ZERO));
    live.start().unwrap();
    let address = live.address().to_owned();
    drop(live);
    UdpSocket::bind(address).expect("the port is free again");
}
