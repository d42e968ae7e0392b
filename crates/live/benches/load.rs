//! Eight actuators at 4096 Hz over loopback, garbage beside them if asked for: what is lost, what processor and memory it takes.
//! `cargo bench --bench load -- [SECONDS [GARBAGE_A_SECOND [P]]]`; prints JSON. Shares need Linux.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rthstrack::{EvaluatorConfig, MonitorConfig};
use rthstrack_live::{Live, LiveConfig};
use serde_json::json;

const RATE_HZ: f64 = 4096.0;
const N_ACTUATORS: usize = 8;

fn main() {
    let numbers: Vec<f64> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let argument = |i: usize, usual: f64| numbers.get(i).copied().unwrap_or(usual);
    let (seconds, garbage_hz, decimation) = (argument(0, 20.0).min(3600.0), argument(1, 0.0), argument(2, 1.0));
    let usual = MonitorConfig::default();
    let (band_hz, data_decimation) = (Some((0.0, 32.0)), decimation as usize);
    let evaluator = EvaluatorConfig { band_hz, data_decimation, ..usual.evaluator };
    let monitor = MonitorConfig { rate_hz: RATE_HZ, n_actuators: N_ACTUATORS, evaluator, ..usual };
    let source = json!({"kind": "udp", "address": "127.0.0.1:0"});
    let alarms = json!({"limit_delay_s": 0.05, "limit_amplitude": 0.5, "critical_delay_s": 0.1, "limit_lost": 1000});
    let sink = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let outputs = json!({"readings_udp": sink.local_addr().expect("bound").to_string(), "log": true, "page": true});
    let config = LiveConfig::read((monitor, Vec::new()), &source, &alarms, &outputs).expect("settings");
    let live = Live::new(config).expect("sockets");
    live.start().expect("threads");
    let (over, address) = (Arc::new(AtomicBool::new(false)), live.address().to_owned());
    let start = Instant::now();
    let mut senders = vec![{
        let (address, seconds) = (address.clone(), seconds);
        std::thread::spawn(move || send_samples(&address, (seconds * RATE_HZ) as u64))
    }];
    if garbage_hz > 0.0 {
        let over = over.clone();
        senders.push(std::thread::spawn(move || send_garbage(&address, garbage_hz, &over)));
    }

    // What Python does beside it: takes the log ten times a second, and shows a page.
    let (mut logged, mut cursor, mut early_kib) = (0, 0, 0);
    while start.elapsed().as_secs_f64() < seconds + 0.5 {
        std::thread::sleep(Duration::from_millis(100));
        logged += live.take_samples().index.len();
        live.take_readings();
        cursor = live.frame(cursor).1;
        // The log's queue is a minute long and has been gone through once by then, or never fills.
        if early_kib == 0 && start.elapsed().as_secs_f64() > 0.1 * seconds {
            early_kib = resident_kib();
        }
    }
    let elapsed = start.elapsed().as_secs_f64();
    let (threads_s, board_s) = (processor_s("rthstrack recei"), processor_s("rthstrack board"));
    let late_kib = resident_kib();
    over.store(true, Relaxed);
    for sender in senders {
        sender.join().expect("a sender");
    }
    live.stop();
    logged += live.take_samples().index.len();
    let summary = live.summary();
    let totals = summary.totals;
    println!(
        "{}",
        json!({
            "bench": "load", "seconds": seconds, "actuators": N_ACTUATORS, "rate_hz": RATE_HZ, "data_decimation": decimation,
            "received": totals.tally.received, "lost": totals.tally.lost, "malformed": totals.malformed,
            "readings": totals.readings, "logged": logged, "log_dropped": summary.log_dropped, "unsent": summary.unsent,
            "receiving_thread_share": share(threads_s, elapsed), "board_thread_share": share(board_s, elapsed),
            "log_and_page_share": share(processor_s(&main_name()), elapsed),
            "resident_kib_at_a_tenth": early_kib, "resident_kib_at_the_end": late_kib,
        })
    );
}

fn share(processor_s: f64, elapsed: f64) -> f64 {
    (1e4 * processor_s / elapsed).round() / 1e4
}

fn send_samples(address: &str, n: u64) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.connect(address).expect("an address");
    let start = Instant::now();
    let mut sample = Vec::new();
    for i in 0..n {
        let t = i as f64 / RATE_HZ;
        sample.clear();
        sample.extend((i as f64).to_le_bytes());
        for a in 0..N_ACTUATORS {
            let wave = |t: f64| (9.0 * t).sin() + 0.3 * (23.0 * t + a as f64).sin();
            sample.extend(wave(t).to_le_bytes());
            sample.extend((0.95 * wave(t - 0.012)).to_le_bytes());
        }
        if let Some(rest) = Duration::from_secs_f64(t).checked_sub(start.elapsed()) {
            std::thread::sleep(rest);
        }
        socket.send(&sample).expect("sent");
    }
}

/// Datagrams of all lengths but the right one.
fn send_garbage(address: &str, rate_hz: f64, over: &AtomicBool) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.connect(address).expect("an address");
    let (start, bytes) = (Instant::now(), [0x5a; 400]);
    let mut i = 0u64;
    while !over.load(Relaxed) {
        let due = (start.elapsed().as_secs_f64() * rate_hz) as u64;
        while i < due {
            let len = (i * 37 % 400) as usize;
            let len = if len.is_multiple_of(8 * (1 + 2 * N_ACTUATORS)) { len + 1 } else { len };
            let _ = socket.send(&bytes[..len]);
            i += 1;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
}

fn main_name() -> String {
    std::fs::read_to_string("/proc/self/comm").unwrap_or_default().trim().to_owned()
}

/// Time on a processor of the threads of this name.
fn processor_s(name: &str) -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of = |folder: std::path::PathBuf| {
        let comm = std::fs::read_to_string(folder.join("comm")).ok()?;
        if comm.trim() != name {
            return None;
        }
        let stat = std::fs::read_to_string(folder.join("schedstat")).ok()?;
        stat.split_whitespace().next()?.parse::<f64>().ok()
    };
    threads.flatten().filter_map(|thread| of(thread.path())).sum::<f64>() * 1e-9
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}
