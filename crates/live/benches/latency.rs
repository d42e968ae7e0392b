//! From sending the last sample of a window to having its reading, over loopback, as a controller sees it: both ways through the
//! system, the monitor between. `cargo bench --bench latency -- [SECONDS]`; prints JSON.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use rthstrack_live::{Live, LiveConfig};
use serde_json::{Value, json};

const RATE_HZ: f64 = 1024.0;

fn main() {
    let seconds = std::env::args().skip(1).find_map(|a| a.parse::<f64>().ok()).unwrap_or(60.0);
    for estimator in ["fei", "least_squares"] {
        println!("{}", measured(estimator, seconds));
    }
}

fn measured(estimator: &str, seconds: f64) -> Value {
    let controller = UdpSocket::bind("127.0.0.1:0").expect("a port");
    // The first reading comes when the window is full.
    controller.set_read_timeout(Some(Duration::from_secs(6))).expect("a timeout");
    let monitor = json!({
        "rate_hz": RATE_HZ, "window_s": 4.0, "update_hz": 64, "band_hz": [0, 32], "estimator": estimator,
    });
    let source = json!({"kind": "udp", "address": "127.0.0.1:0"});
    let outputs =
        json!({"readings_udp": controller.local_addr().expect("bound").to_string(), "log": true, "page": true});
    let config = LiveConfig::read(&monitor, &source, &json!({}), &outputs).expect("settings");
    let live = Live::new(config).expect("sockets");
    live.start().expect("threads");
    let n = (seconds * RATE_HZ) as usize;
    let start = Instant::now();
    let listener = std::thread::spawn(move || {
        let mut came = Vec::new();
        let mut bytes = [0; 4096];
        while let Ok(len) = controller.recv(&mut bytes) {
            let now = start.elapsed().as_secs_f64();
            let reading: Value = serde_json::from_slice(&bytes[..len]).expect("JSON");
            came.push((reading["index"].as_u64().expect("an index") as usize, now));
        }
        came
    });
    let sent = send(live.address(), n, start);
    let came = listener.join().expect("listener");
    live.stop();
    let mut times_us: Vec<f64> = came.iter().map(|(index, at)| 1e6 * (at - sent[*index])).collect();
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| times_us[((times_us.len() - 1) as f64 * share).round() as usize].round();
    let lost = live.summary().totals.tally.lost;
    json!({
        "bench": "latency", "estimator": estimator, "seconds": seconds, "readings": came.len(), "lost": lost,
        "p50_us": at(0.5), "p90_us": at(0.9), "p99_us": at(0.99), "p999_us": at(0.999), "max_us": at(1.0),
    })
}

/// Sends at the rate; when each sample went.
fn send(address: &str, n: usize, start: Instant) -> Vec<f64> {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.connect(address).expect("an address");
    let mut sent = Vec::with_capacity(n);
    for i in 0..n {
        let t = i as f64 / RATE_HZ;
        let wave = |t: f64| (9.0 * t).sin() + 0.3 * (23.0 * t).sin();
        let sample = [i as f64, wave(t), 0.95 * wave(t - 0.012)].map(f64::to_le_bytes).concat();
        if let Some(rest) = Duration::from_secs_f64(t).checked_sub(start.elapsed()) {
            std::thread::sleep(rest);
        }
        sent.push(start.elapsed().as_secs_f64());
        socket.send(&sample).expect("sent");
    }
    sent
}
