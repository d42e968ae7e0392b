//! What a sample of a running test costs: mean and worst step of [`Monitor::step`], and the bytes of a state.
//!
//! Prints one JSON object. A machine that is shared interrupts any loop: the time of a step is the least of five runs over the same
//! stream, sample by sample, and an empty loop is measured beside it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rthstrack::{Estimator, EvaluatorConfig, Monitor, MonitorConfig};

/// Counts the bytes in use, to state what a state takes.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code)]
// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const RATE_HZ: f64 = 1024.0;
const REPEATS: usize = 5;

/// What is measured of one set-up.
struct Case {
    estimator: (&'static str, Estimator),
    window_s: f64,
    n_actuators: usize,
    data_decimation: usize,
    n_samples: usize,
}

/// A narrow-band motion with noise, and its delayed, amplified copy with other noise; rows of all actuators.
fn stream(n_samples: usize, n_actuators: usize) -> (Vec<f64>, Vec<f64>) {
    let motion = |t: f64| (6.3 * t).sin() * (0.2 * t).cos() + 0.3 * (31.0 * t).sin() + 0.05 * (97.0 * t).sin();
    let mut seed = 1u64;
    let mut noise = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 0.01
    };
    let (mut target, mut measured) = (Vec::new(), Vec::new());
    for i in 0..n_samples {
        for a in 0..n_actuators {
            let t = i as f64 / RATE_HZ + a as f64;
            target.push(motion(t));
            measured.push(1.1 * motion(t - 0.012) + noise());
        }
    }
    (target, measured)
}

/// Nanoseconds of each step, the least of the repeats.
fn least_times(n_samples: usize, mut make: impl FnMut() -> Box<dyn FnMut(usize)>) -> Vec<u32> {
    let mut least = vec![u32::MAX; n_samples];
    for _ in 0..REPEATS {
        let mut step = make();
        for (i, least) in least.iter_mut().enumerate() {
            let start = Instant::now();
            step(i);
            *least = (*least).min(start.elapsed().as_nanos() as u32);
        }
    }
    least
}

/// p50, p99, p99.99 and the largest, in nanoseconds.
fn percentiles(mut times: Vec<u32>) -> [u32; 4] {
    times.sort_unstable();
    let at = |p: f64| times[((times.len() - 1) as f64 * p) as usize];
    [at(0.5), at(0.99), at(0.9999), at(1.0)]
}

fn measure(case: &Case) -> String {
    let Case { estimator: (name, estimator), window_s, n_actuators, data_decimation, n_samples } = *case;
    let config = MonitorConfig {
        rate_hz: RATE_HZ,
        window_s,
        update_hz: 64.0,
        n_actuators,
        evaluator: EvaluatorConfig {
            band_hz: Some((0.0, 32.0)),
            estimator,
            data_decimation,
            ..MonitorConfig::default().evaluator
        },
        ..Default::default()
    };
    let monitor: &'static Monitor = Box::leak(Box::new(Monitor::new(config).unwrap()));
    let before = IN_USE.load(Ordering::Relaxed);
    let mut state = monitor.state();
    let bytes = IN_USE.load(Ordering::Relaxed) - before;
    let (target, measured) = stream(n_samples, n_actuators);
    let (target, measured): (&'static [f64], &'static [f64]) = (target.leak(), measured.leak());
    // The mean: whole runs, without a clock between the steps.
    let mut means: Vec<f64> = (0..REPEATS)
        .map(|_| {
            let start = Instant::now();
            for (x, y) in target.chunks_exact(n_actuators).zip(measured.chunks_exact(n_actuators)) {
                black_box(monitor.step(&mut state, black_box(x), black_box(y)));
            }
            start.elapsed().as_nanos() as f64 / (n_samples * n_actuators) as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    let times = least_times(n_samples, || {
        let mut state = monitor.state();
        Box::new(move |i| {
            let of = i * n_actuators..(i + 1) * n_actuators;
            black_box(monitor.step(&mut state, &target[of.clone()], &measured[of]));
        })
    });
    let [p50, p99, p9999, max] = percentiles(times);
    format!(
        "{{\"estimator\": \"{name}\", \"window_s\": {window_s}, \"n_actuators\": {n_actuators}, \"P\": {data_decimation}, \
         \"mean_ns\": {:.1}, \"p50_ns\": {p50}, \"p99_ns\": {p99}, \"p9999_ns\": {p9999}, \"max_ns\": {max}, \"state_bytes\": {bytes}}}",
        means[REPEATS / 2]
    )
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let n = if quick { 100_000 } else { 1_000_000 };
    let mut cases = Vec::new();
    for estimator in [("fei", Estimator::Fei), ("least_squares", Estimator::LeastSquares)] {
        for window_s in [1.0, 2.0, 4.0, 8.0] {
            cases.push(Case { estimator, window_s, n_actuators: 1, data_decimation: 8, n_samples: n });
        }
        for n_actuators in [4, 64] {
            cases.push(Case { estimator, window_s: 4.0, n_actuators, data_decimation: 8, n_samples: n / n_actuators });
        }
        cases.push(Case { estimator, window_s: 4.0, n_actuators: 1, data_decimation: 1, n_samples: n / 4 });
    }
    let of_five = percentiles(least_times(n, || {
        Box::new(|i| {
            black_box(i);
        })
    }));
    // One run as it comes, interruptions and all.
    let mut alone = vec![0; n];
    for time in &mut alone {
        let start = Instant::now();
        black_box(());
        *time = start.elapsed().as_nanos() as u32;
    }
    let cases: Vec<String> = cases.iter().map(measure).collect();
    println!(
        "{{\"empty_loop_ns\": {{\"least_of_five\": {of_five:?}, \"one_run\": {:?}}}, \"cases\": [{}]}}",
        percentiles(alone),
        cases.join(", ")
    );
}
