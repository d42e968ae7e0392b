//! Any samples under any settings give a number, a reason or an error, and never a panic (overflow checks are on). `RTHSTRACK_FUZZ` sets how many.

use rthstrack::{
    BadSamples, Decimator, Detrend, Estimator, Evaluator, EvaluatorConfig, Monitor, MonitorConfig, MovingConfig, Noise,
    Pair, Window, evaluate_moving,
};

/// A multiplicative congruential generator: the same cases on every machine.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// Samples of one of many kinds.
    fn signal(&mut self, n: usize) -> Vec<f64> {
        let kind = self.below(8);
        let (frequency, scale, level) =
            (self.uniform(), self.pick(&[1.0, 1e-9, 1e12]), self.pick(&[0.0, 0.0, 1e6, -3.0]));
        let mut state = 0.0;
        (0..n)
            .map(|i| {
                let x = 2.0 * self.uniform() - 1.0;
                let t = i as f64;
                let v = match kind {
                    0 => x,
                    1 => {
                        state += x;
                        state
                    }
                    2 => (frequency * t).sin(),
                    3 => (frequency * t).sin() + 0.01 * x,
                    4 => f64::from(u8::from(i > n / 3)),
                    5 => t * frequency,
                    6 => (4.0 * x).round(),
                    _ => {
                        state = 0.99 * state + x;
                        state * (-t / (1.0 + n as f64 * frequency)).exp()
                    }
                };
                level + scale * v
            })
            .collect()
    }
}

#[test]
fn any_finite_samples_are_answered() {
    let cases: u64 = std::env::var("RTHSTRACK_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(1500);
    let (mut determined, mut answered) = (0, 0);
    for case in 0..cases {
        let mut random = Random(case.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1);
        let n = random.pick(&[4, 5, 17, 40, 64, 100, 257, 600, 1025]);
        let rate_hz = random.pick(&[50.0, 200.0, 1024.0, 4096.0]);
        let mut target = random.signal(n);
        let mut measured = random.signal(n);
        if random.below(3) > 0 {
            // Late or early by whole samples, and noisy.
            let lag = random.below(n.min(40)) as isize - 10;
            for i in 0..n {
                let from = (i as isize - lag).clamp(0, n as isize - 1) as usize;
                measured[i] = 0.9 * target[from] + 1e-3 * measured[i];
            }
        }
        // Spikes, dropouts, freezes and holds anywhere, in either channel.
        for _ in 0..random.pick(&[0, 0, 1, 3, 40]) {
            let signal = if random.uniform() < 0.5 { &mut target } else { &mut measured };
            let from = (random.uniform() * n as f64) as usize;
            let to = (from + random.pick(&[1, 1, 2, 3, 8, 50, 1000])).min(n);
            let value = random.pick(&[0.0, signal[from], 1e3, -3.0, signal[0]]);
            signal[from..to].fill(value);
        }
        let every = random.pick(&[1, 1, 1, 1, 2, 3, 7, 40]);
        let signal = if random.uniform() < 0.5 { &mut target } else { &mut measured };
        (0..n).for_each(|i| signal[i] = signal[i / every * every]);
        let low = random.uniform() * rate_hz / 4.0;
        let config = EvaluatorConfig {
            estimator: random.pick(&Estimator::NAMES).1,
            data_decimation: random.pick(&[1, 1, 1, 2, 16]),
            frequency_decimation: random.pick(&[1, 1, 1, 2, 8]),
            decimator: random.pick(&[Decimator::Spectral, Decimator::Spectral, Decimator::Chebyshev]),
            weight_power: random.pick(&[2, 2, 2, 1, 5]),
            window: random.pick(&Window::NAMES).1,
            detrend: random.pick(&[None, Some(Detrend::None), Some(Detrend::Mean), Some(Detrend::Linear)]),
            band_hz: random.pick(&[None, None, Some((low, low + rate_hz / 8.0))]),
            max_delay_s: random.pick(&[0.25, 1e-3, 10.0]),
            expected_delay_s: random.pick(&[None, None, Some(0.0), Some(-1e-3)]),
            noise: random.pick(&[Noise::White, Noise::White, Noise::Coloured]),
            noise_ratio: random.pick(&[0.0, 0.0, 0.0, 0.3]),
            bad_samples: random.pick(&[BadSamples::LeaveOut, BadSamples::LeaveOut, BadSamples::Keep]),
        };
        let Ok(pair) = Pair::new(&target, &measured, rate_hz) else { continue };
        let Ok(evaluator) = Evaluator::new(n, rate_hz, config) else { continue };
        if let Ok(found) = evaluator.evaluate(&mut evaluator.state(), &pair) {
            answered += 1;
            if config.estimator != Estimator::Fei {
                let undetermined = found.reason.is_some_and(|r| r.is_undetermined());
                assert_eq!(found.delay_s.is_nan(), undetermined, "case {case}: {config:?} {found:?}");
                assert_eq!(found.amplitude.is_nan(), undetermined, "case {case}: {config:?} {found:?}");
                assert_eq!(found.delay_interval_s.0.is_nan(), found.reason.is_some(), "case {case}: {found:?}");
                if !undetermined {
                    determined += 1;
                    assert!(found.delay_s.abs() <= config.max_delay_s * (1.0 + 1e-6), "case {case}: {found:?}");
                }
            }
        }
        let moving = MovingConfig {
            window_s: (n / 3) as f64 / rate_hz,
            hop_s: (n / 7).max(1) as f64 / rate_hz,
            minimum_std_ratio: 0.0,
            evaluator: config,
        };
        let _ = evaluate_moving(&pair, &moving);
    }
    assert!(determined * 20 > answered, "{determined} of {answered} were determined");
}

#[test]
fn a_monitor_takes_any_bits() {
    let cases: u64 = std::env::var("RTHSTRACK_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(1500);
    let (mut valid, mut all) = (0u64, 0u64);
    for case in 0..cases {
        let mut random = Random(case.wrapping_mul(0xd134_2543_de82_ef95) + 1);
        let rate_hz = random.pick(&[50.0, 1024.0, 1e-300, 1e300]);
        let n_actuators = random.pick(&[1, 1, 3]);
        let low = random.uniform() * rate_hz / 40.0;
        let config = MonitorConfig {
            rate_hz,
            window_s: random.pick(&[4.0, 37.0, 64.0, 200.0]) / rate_hz,
            update_hz: rate_hz / random.pick(&[8.0, 8.0, 50.0]),
            minimum_amplitude: random.pick(&[0.0, 0.0, 0.5]),
            n_actuators,
            evaluator: EvaluatorConfig {
                band_hz: random.pick(&[None, None, Some((0.0, rate_hz / 32.0)), Some((low, low + rate_hz / 64.0))]),
                window: random.pick(&Window::NAMES).1,
                detrend: random.pick(&[None, Some(Detrend::None), Some(Detrend::Mean), Some(Detrend::Linear)]),
                estimator: random.pick(&Estimator::NAMES).1,
                data_decimation: random.pick(&[1, 1, 2, 8]),
                frequency_decimation: random.pick(&[1, 1, 2]),
                max_delay_s: random.pick(&[20.0, 3.0, 1000.0]) / rate_hz,
                expected_delay_s: random.pick(&[None, Some(0.0), Some(-3.0 / rate_hz)]),
                ..MonitorConfig::default().evaluator
            },
        };
        let Ok(monitor) = Monitor::new(config) else { continue };
        let mut state = monitor.state();
        let n = 400 * n_actuators;
        let (mut target, mut measured) = (random.signal(n), random.signal(n));
        if random.below(2) == 0 {
            measured = (0..n).map(|i| 0.9 * target[i.saturating_sub(3 * n_actuators)] + 1e-3 * measured[i]).collect();
        }
        // Bits as they come (NaN with any payload, infinities, denormals, the largest numbers), more and more often.
        let often = random.pick(&[0.0, 0.002, 0.05, 1.0]);
        for v in target.iter_mut().chain(&mut measured) {
            if random.uniform() < often {
                let bits = (random.uniform() * 2f64.powi(53)) as u64;
                *v = f64::from_bits(bits << 11 | bits >> 42);
            }
        }
        for (x, y) in target.chunks(n_actuators).zip(measured.chunks(n_actuators)) {
            // A slice that is too short is a gap, not a panic.
            let short = random.below(200) == 0;
            let Some(readings) = monitor.step(&mut state, if short { &x[1..] } else { x }, y) else { continue };
            for reading in readings {
                all += 1;
                valid += u64::from(reading.is_valid());
                let t = &reading.tracking;
                if reading.is_valid() {
                    assert!(
                        t.amplitude.is_finite() && t.equivalent_frequency_hz.is_finite(),
                        "case {case}: {reading:?}"
                    );
                } else {
                    assert!(t.amplitude.is_nan() && t.delay_s.is_nan(), "case {case}: {reading:?}");
                }
            }
            if random.below(500) == 0 {
                monitor.restart(&mut state, u64::MAX - random.below(1000) as u64);
            }
        }
    }
    assert!(valid * 20 > all && valid < all, "{valid} of {all} were valid");
}
