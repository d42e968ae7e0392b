//! What an evaluation costs beside the transforms it stands on and beside reading the samples once. Planning is left out.
//!
//! Prints one JSON object; `benchmarks/bench.py` puts it beside SciPy in the same run. Every median is over rounds that
//! visit all measured calls in turn, so that a busy neighbour slows all of them alike.

use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use realfft::RealFftPlanner;
use rthstrack::{Estimator, Evaluator, EvaluatorConfig, MovingConfig, Pair, Window, evaluate_moving};

/// Counts the bytes in use, to state the peak beside the times.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code)]
// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = IN_USE.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const LENGTHS: [usize; 3] = [24577, 51160, 92161];
const RATE_HZ: f64 = 1024.0;
const P: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
const Q: [usize; 6] = [1, 2, 4, 8, 16, 32];

/// A narrow-band response and its delayed, amplified copy.
fn pair(n: usize) -> (Vec<f64>, Vec<f64>) {
    let signal = |t: f64| (6.3 * t).sin() * (-(t - 20.0) * (t - 20.0) / 200.0).exp() + 0.3 * (31.0 * t).sin();
    (0..n).map(|i| i as f64 / RATE_HZ).map(|t| (signal(t), 1.1 * signal(t - 0.005))).unzip()
}

/// Medians, in microseconds, of calls that take turns; each turn is one call to warm the caches and two that count.
fn medians(rounds: usize, calls: &mut [Box<dyn FnMut() + '_>]) -> Vec<f64> {
    let mut times = vec![Vec::with_capacity(rounds); calls.len()];
    for _ in 0..rounds {
        for (call, times) in calls.iter_mut().zip(&mut times) {
            call();
            for _ in 0..2 {
                let start = Instant::now();
                call();
                times.push(start.elapsed().as_secs_f64() * 1e6);
            }
        }
    }
    times
        .into_iter()
        .map(|mut t| {
            t.sort_by(f64::total_cmp);
            t[t.len() / 2]
        })
        .collect()
}

/// A fused sum of products over both arrays, eight accumulators of four lanes, with the same instruction sets as the core.
fn read_both(target: &[f64], measured: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let mut lanes = [0.0; 32];
            for (x, y) in target.chunks_exact(32).zip(measured.chunks_exact(32)) {
                for i in 0..32 {
                    lanes[i] += x[i] * y[i];
                }
            }
            lanes.iter().sum()
        },
    )
}

fn main() {
    let rounds: usize = std::env::var("RTHSTRACK_ROUNDS").ok().and_then(|r| r.parse().ok()).unwrap_or(101);
    let mut lengths = Vec::new();
    for n in LENGTHS {
        let (target, measured) = pair(n);
        let pair = Pair::new(&target, &measured, RATE_HZ).expect("a valid pair");
        let before = IN_USE.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let evaluator = Evaluator::new(n, RATE_HZ, EvaluatorConfig::published()).expect("a valid plan");
        let mut state = evaluator.state();
        black_box(evaluator.evaluate(&mut state, &pair).expect("a valid pair"));
        let peak = (PEAK.load(Ordering::Relaxed) - before) as f64 / (16 * n) as f64;
        let planned = IN_USE.load(Ordering::Relaxed);
        drop(state);
        let state_share = (planned - IN_USE.load(Ordering::Relaxed)) as f64 / (16 * n) as f64;
        drop(evaluator);

        let fft_len = n.next_power_of_two();
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(fft_len);
        let mut inputs = [fft.make_input_vec(), fft.make_input_vec()];
        let mut outputs = [fft.make_output_vec(), fft.make_output_vec()];
        let mut scratch = fft.make_scratch_vec();
        inputs[0][..n].copy_from_slice(&target);
        inputs[1][..n].copy_from_slice(&measured);

        let mut calls: Vec<Box<dyn FnMut() + '_>> = vec![
            Box::new(move || {
                for (input, output) in inputs.iter_mut().zip(&mut outputs) {
                    // The transform overwrites its input with garbage of the same size: its time does not depend on it,
                    // but infinities would; so it is kept small.
                    fft.process_with_scratch(input, output, &mut scratch).expect("lengths agree");
                    input[0] = 1.0;
                    input[1..].fill(0.5);
                }
            }),
            Box::new(|| {
                black_box(read_both(&target, &measured));
            }),
            Box::new({
                let mut inputs = [vec![0.0; fft_len], vec![0.0; fft_len]];
                move || {
                    for input in &mut inputs {
                        black_box(&mut *input)[0] = 1.0;
                        input[1..].fill(0.5);
                    }
                }
            }),
        ];
        for p in P {
            for q in Q {
                let config =
                    EvaluatorConfig { data_decimation: p, frequency_decimation: q, ..EvaluatorConfig::published() };
                let evaluator = Evaluator::new(n, RATE_HZ, config).expect("a valid plan");
                let mut state = evaluator.state();
                let pair = &pair;
                calls.push(Box::new(move || {
                    black_box(evaluator.evaluate(&mut state, pair).expect("a valid pair"));
                }));
            }
        }
        let times = medians(rounds, &mut calls);
        let table: Vec<String> = times[3..].chunks(Q.len()).map(|row| format!("{row:?}")).collect();
        lengths.push(format!(
            "{{\"n_samples\": {n}, \"two_real_transforms_us\": {}, \"read_both_us\": {}, \"table_us\": [{}], \
             \"peak_memory_over_input\": {peak}, \"state_memory_over_input\": {state_share}}}",
            times[0] - times[2],
            times[1],
            table.join(", ")
        ));
    }
    let n = LENGTHS[2];
    let (target, measured) = pair(n);
    let pair = Pair::new(&target, &measured, RATE_HZ).expect("a valid pair");
    let mut windows = Vec::new();
    for window in [Window::Boxcar, Window::Hann] {
        let config = MovingConfig {
            window_s: 4.0,
            hop_s: 1.0 / 64.0,
            evaluator: EvaluatorConfig { data_decimation: 16, window, ..EvaluatorConfig::published() },
            ..Default::default()
        };
        let pair = &pair;
        let time = medians(
            rounds.div_ceil(10),
            &mut [Box::new(move || {
                black_box(evaluate_moving(pair, &config).expect("a valid pair"));
            })],
        );
        windows.push(time[0] / 1e3);
    }
    let estimators = estimators(rounds);
    println!(
        "{{\"p\": {P:?}, \"q\": {Q:?}, \"lengths\": [{}], \"moving_boxcar_ms\": {}, \"moving_hann_ms\": {}, \
         \"estimators_us\": {estimators}}}",
        lengths.join(", "),
        windows[0],
        windows[1]
    );
}

/// Times of all estimators at P = Q = 1, whole records and one 4 s window within them, as a JSON object by window function
/// and estimator: [L = 24577, 51160, 92161, one 4 s window].
fn estimators(rounds: usize) -> String {
    const HOP_S: f64 = 1.0;
    let pairs: Vec<_> = LENGTHS.iter().map(|&n| pair(n)).collect();
    let mut calls: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    let mut names = Vec::new();
    for (window_name, window) in [("boxcar", Window::Boxcar), ("hann", Window::Hann)] {
        for (name, estimator) in Estimator::NAMES {
            names.push(format!("{window_name} {name}"));
            let config = EvaluatorConfig { estimator, window, ..Default::default() };
            for (target, measured) in &pairs {
                let pair = Pair::new(target, measured, RATE_HZ).expect("a valid pair");
                let evaluator = Evaluator::new(target.len(), RATE_HZ, config).expect("a valid plan");
                let mut state = evaluator.state();
                calls.push(Box::new(move || {
                    black_box(evaluator.evaluate(&mut state, &pair).expect("a valid pair"));
                }));
            }
            let (target, measured) = &pairs[2];
            let pair = Pair::new(target, measured, RATE_HZ).expect("a valid pair");
            let config = MovingConfig { window_s: 4.0, hop_s: HOP_S, minimum_std_ratio: 0.0, evaluator: config };
            calls.push(Box::new(move || {
                black_box(evaluate_moving(&pair, &config).expect("a valid pair"));
            }));
        }
    }
    let times = medians(rounds.div_ceil(3), &mut calls);
    let n_windows = ((LENGTHS[2] as f64 / RATE_HZ - 4.0) / HOP_S).floor() + 1.0;
    let rows: Vec<String> = names
        .iter()
        .zip(times.chunks(4))
        .map(|(name, t)| format!("\"{name}\": [{}, {}, {}, {}]", t[0], t[1], t[2], t[3] / n_windows))
        .collect();
    format!("{{{}}}", rows.join(", "))
}
