//! From sending the last sample of a window to having its reading, over loopback, as a controller sees it: both ways through the
//! system, the monitor between. Beside it, at the same time, a thread that sends back at once whatever it receives: what the
//! machine itself takes. `cargo bench --bench latency -- [SECONDS]`; prints JSON.

use std::net::{SocketAddr, UdpSocket};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rthstrack::{Estimator, EvaluatorConfig, MonitorConfig};
use rthstrack_live::{Live, LiveConfig};
use serde_json::{Value, json};

const RATE_HZ: f64 = 1024.0;
/// From one reading to the next, in samples.
const HOP: usize = 16;

fn main() {
    let seconds = std::env::args().skip(1).find_map(|a| a.parse::<f64>().ok()).unwrap_or(60.0);
    for estimator in [Estimator::Fei, Estimator::LeastSquares] {
        println!("{}", measured(estimator, seconds));
    }
}

fn measured(estimator: Estimator, seconds: f64) -> Value {
    let (controller, other) = (bound(), bound());
    let usual = MonitorConfig::default();
    let evaluator = EvaluatorConfig { estimator, band_hz: Some((0.0, 32.0)), ..usual.evaluator };
    let monitor = MonitorConfig { rate_hz: RATE_HZ, window_s: 4.0, update_hz: 64.0, evaluator, ..usual };
    let source = json!({"kind": "udp", "address": "127.0.0.1:0"});
    let outputs = json!({"readings_udp": at(&controller).to_string(), "log": true, "page": true});
    let config = LiveConfig::read((monitor, Vec::new()), &source, &json!({}), &outputs).expect("settings");
    let live = Live::new(config).expect("sockets");
    live.start().expect("threads");
    let (echo, start) = (bound(), Instant::now());
    let echo_at = at(&echo);
    let echoing = echoed(echo, at(&other));
    let readings = listened(controller, start, |bytes| {
        let reading: Value = serde_json::from_slice(bytes).expect("JSON");
        reading["index"].as_u64().expect("an index") as usize
    });
    let echoes = listened(other, start, |bytes| f64::from_le_bytes(bytes[..8].try_into().expect("a number")) as usize);
    let (sent, sent_to_echo) = send(live.address(), echo_at, (seconds * RATE_HZ) as usize, start);
    let (readings, echoes) = (readings.join().expect("listener"), echoes.join().expect("listener"));
    echoing.join().expect("echo");
    live.stop();
    let lost = live.summary().totals.tally.lost;
    json!({
        "bench": "latency", "estimator": estimator.code(), "seconds": seconds, "readings": readings.len(), "lost": lost,
        "round_trip_us": shares(&readings, &sent), "echo_round_trip_us": shares(&echoes, &sent_to_echo),
    })
}

fn bound() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    // The first reading comes when the window is full.
    socket.set_read_timeout(Some(Duration::from_secs(6))).expect("a timeout");
    socket
}

fn at(socket: &UdpSocket) -> SocketAddr {
    socket.local_addr().expect("bound")
}

/// What an empty loop takes.
fn echoed(socket: UdpSocket, to: SocketAddr) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(len) = socket.recv(&mut bytes) {
            socket.send_to(&bytes[..len], to).expect("sent");
        }
    })
}

/// Which sample each datagram tells of, and when it came.
fn listened(
    socket: UdpSocket,
    start: Instant,
    index: impl Fn(&[u8]) -> usize + Send + 'static,
) -> JoinHandle<Vec<(usize, f64)>> {
    std::thread::spawn(move || {
        let mut came = Vec::new();
        let mut bytes = [0; 4096];
        while let Ok(len) = socket.recv(&mut bytes) {
            let now = start.elapsed().as_secs_f64();
            came.push((index(&bytes[..len]), now));
        }
        came
    })
}

fn shares(came: &[(usize, f64)], sent: &[f64]) -> Value {
    let mut times_us: Vec<f64> = came.iter().map(|(index, at)| 1e6 * (at - sent[*index])).collect();
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| times_us[((times_us.len() - 1) as f64 * share).round() as usize].round();
    json!({"p50": at(0.5), "p90": at(0.9), "p99": at(0.99), "p999": at(0.999), "max": at(1.0)})
}

/// Sends at the rate, and between readings to the echo; when each sample went to either.
fn send(address: &str, echo: SocketAddr, n: usize, start: Instant) -> (Vec<f64>, Vec<f64>) {
    let socket = bound();
    let mut sent = (vec![f64::NAN; n], vec![f64::NAN; n]);
    for i in 0..n {
        let t = i as f64 / RATE_HZ;
        let wave = |t: f64| (9.0 * t).sin() + 0.3 * (23.0 * t).sin();
        let sample = [i as f64, wave(t), 0.95 * wave(t - 0.012)].map(f64::to_le_bytes).concat();
        if let Some(rest) = Duration::from_secs_f64(t).checked_sub(start.elapsed()) {
            std::thread::sleep(rest);
        }
        sent.0[i] = start.elapsed().as_secs_f64();
        socket.send_to(&sample, address).expect("sent");
        if i % HOP == HOP / 2 {
            sent.1[i] = start.elapsed().as_secs_f64();
            socket.send_to(&sample, echo).expect("sent");
        }
    }
    sent
}
