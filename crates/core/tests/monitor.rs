//! The monitor beside the batch evaluation of the same windows, and what it does with samples that are no numbers.

use rthstrack::{
    CausalDecimator, Detrend, Estimator, Evaluator, EvaluatorConfig, Monitor, MonitorConfig, MovingConfig, Pair,
    Reading, Reason, Window, evaluate_moving,
};

/// Splitmix64, uniform in -0.5 .. 0.5.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

const RATE_HZ: f64 = 256.0;

fn motion(t: f64) -> f64 {
    (2.0 * t).sin() + 0.4 * (9.7 * t).sin() + 0.3 * (17.3 * t + 1.0).cos() + 0.05 * (61.0 * t).sin()
}

/// Target and measured with a delay that creeps from 10 to 30 ms, an offset and noise.
fn signals(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Uniform(7);
    let time = |i: usize| i as f64 / RATE_HZ;
    let target = (0..n).map(|i| motion(time(i))).collect();
    let delay = |i: usize| 0.01 + 0.02 * i as f64 / n as f64;
    let measured = (0..n).map(|i| 0.2 + 1.05 * motion(time(i) - delay(i)) + 0.01 * noise.next()).collect();
    (target, measured)
}

fn readings(monitor: &Monitor, target: &[f64], measured: &[f64]) -> Vec<Reading> {
    let mut state = monitor.state();
    let steps = target.iter().zip(measured);
    steps.filter_map(|(x, y)| monitor.step(&mut state, &[*x], &[*y]).map(|r| r[0])).collect()
}

fn same(a: f64, b: f64) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-9 * a.abs().max(1.0)
}

/// What both evaluations must agree in.
fn assert_alike(
    reading: &Reading,
    [amplitude, delay_s, phase_rad, f_eq]: [f64; 4],
    intervals: [f64; 2],
    context: &str,
) {
    let t = &reading.tracking;
    assert!(same(t.amplitude, amplitude), "{context}: A {} {amplitude}", t.amplitude);
    assert!(same(t.delay_s, delay_s), "{context}: d {} {delay_s}", t.delay_s);
    assert!(same(t.phase_rad, phase_rad), "{context}: phi {} {phase_rad}", t.phase_rad);
    assert!(same(t.equivalent_frequency_hz, f_eq), "{context}: f_eq {} {f_eq}", t.equivalent_frequency_hz);
    assert!(same(t.amplitude_interval.0, intervals[0]), "{context}: {:?} {}", t.amplitude_interval, intervals[0]);
    assert!(same(t.delay_interval_s.0, intervals[1]), "{context}: {:?} {}", t.delay_interval_s, intervals[1]);
}

fn configs() -> Vec<MonitorConfig> {
    let mut configs = Vec::new();
    for estimator in [Estimator::Fei, Estimator::LeastSquares, Estimator::Aligned] {
        for (data_decimation, frequency_decimation) in [(1, 1), (4, 1), (2, 4)] {
            for (window, detrend) in [(Window::Boxcar, None), (Window::Hann, Some(Detrend::Linear))] {
                configs.push(MonitorConfig {
                    rate_hz: RATE_HZ,
                    window_s: 3.0,
                    update_hz: 4.0,
                    evaluator: EvaluatorConfig {
                        band_hz: Some((0.2, 16.0)),
                        window,
                        detrend,
                        estimator,
                        data_decimation,
                        frequency_decimation,
                        ..MonitorConfig::default().evaluator
                    },
                    ..Default::default()
                });
            }
        }
    }
    configs
}

#[test]
fn each_reading_is_the_batch_evaluation_of_its_window_of_causally_decimated_samples() {
    let (target, measured) = signals(4096);
    for config in configs() {
        let monitor = Monitor::new(config).unwrap();
        let readings = readings(&monitor, &target, &measured);
        let p = config.evaluator.data_decimation;
        let decimator = CausalDecimator::new(p).unwrap();
        let (x, y) = (decimator.process(&target), decimator.process(&measured));
        let rate_hz = RATE_HZ / p as f64;
        let n = (config.window_s * rate_hz).round() as usize;
        let hop = (rate_hz / config.update_hz).round() as usize;
        assert_eq!(readings.len(), (x.len() - n) / hop + 1, "{config:?}");
        let evaluator = EvaluatorConfig {
            estimator: config.evaluator.estimator,
            frequency_decimation: config.evaluator.frequency_decimation,
            window: config.evaluator.window,
            detrend: config.evaluator.detrend,
            band_hz: config.evaluator.band_hz,
            ..Default::default()
        };
        for (k, reading) in readings.iter().enumerate() {
            let (start, context) = (k * hop, format!("{config:?}, reading {k}"));
            let last = (start + n - 1) * p + 2 * decimator.delay();
            assert_eq!(reading.index, last as u64, "{context}");
            assert!(same(reading.time_s, last as f64 / RATE_HZ), "{context}");
            let centre = (start as f64 + 0.5 * (n - 1) as f64) * p as f64 + decimator.delay() as f64;
            assert!(same(reading.centre_s, centre / RATE_HZ), "{context}: {} {}", reading.centre_s, centre / RATE_HZ);
            // As the last window of a record that ends with it.
            let (record_x, record_y) = (&x[..start + n], &y[..start + n]);
            if config.evaluator.estimator == Estimator::Fei {
                let plan = Evaluator::new(n, rate_hz, evaluator).unwrap();
                let pair = Pair::new(&record_x[start..], &record_y[start..], rate_hz).unwrap();
                let t = plan.evaluate(&mut plan.state(), &pair).unwrap();
                let numbers = [t.amplitude, t.delay_s, t.phase_rad, t.equivalent_frequency_hz];
                assert_alike(reading, numbers, [f64::NAN; 2], &context);
            } else if start > 0 {
                let moving = MovingConfig {
                    window_s: n as f64 / rate_hz,
                    hop_s: start as f64 / rate_hz,
                    minimum_std_ratio: 0.0,
                    evaluator,
                };
                let pair = Pair::new(record_x, record_y, rate_hz).unwrap();
                let moving = evaluate_moving(&pair, &moving).unwrap();
                let i = moving.tracking.len() - 1;
                let found = &moving.tracking[i];
                assert!(same(moving.time_s[i] * rate_hz, start as f64 + 0.5 * (n - 1) as f64));
                let numbers = [found.amplitude, found.delay_s, found.phase_rad, found.equivalent_frequency_hz];
                let intervals = [found.amplitude_interval.0, found.delay_interval_s.0];
                assert_alike(reading, numbers, intervals, &context);
            }
        }
        let valid = readings.iter().filter(|r| r.is_valid()).count();
        assert!(valid * 10 > readings.len() * 9, "{valid} of {} valid: {config:?}", readings.len());
    }
}

/// The same window, first with little before it and then after `n` samples: the readings have the same bits.
fn drift_after(n: usize, estimator: Estimator) {
    let config = MonitorConfig {
        rate_hz: 1024.0,
        window_s: 0.25,
        update_hz: 64.0,
        evaluator: EvaluatorConfig {
            band_hz: Some((0.0, 32.0)),
            max_delay_s: 0.03,
            estimator,
            data_decimation: 8,
            ..MonitorConfig::default().evaluator
        },
        ..Default::default()
    };
    let monitor = Monitor::new(config).unwrap();
    // A period of 1024 samples, exactly: the last windows of two streams of different length hold the same numbers.
    let table: Vec<(f64, f64)> = (0..1024)
        .map(|i| std::f64::consts::TAU * f64::from(i) / 1024.0)
        .map(|a| {
            ((5.0 * a).sin() + 0.2 * (13.0 * a).cos(), 0.9 * (5.0 * (a - 0.1)).sin() + 0.17 * (13.0 * (a - 0.1)).cos())
        })
        .collect();
    let run = |n: usize| {
        let mut state = monitor.state();
        let mut last = None;
        for i in 0..n {
            let (x, y) = table[i % 1024];
            if let Some(readings) = monitor.step(&mut state, &[x], &[y]) {
                last = Some(readings[0]);
            }
        }
        last.unwrap()
    };
    let (short, long) = (run(4096), run(n));
    assert_eq!(long.index - short.index, (n - 4096) as u64);
    assert!(short.is_valid() && short.tracking.amplitude > 0.5);
    assert_eq!(short.tracking.amplitude.to_bits(), long.tracking.amplitude.to_bits());
    assert_eq!(short.tracking.delay_s.to_bits(), long.tracking.delay_s.to_bits());
    assert_eq!(short.tracking.equivalent_frequency_hz.to_bits(), long.tracking.equivalent_frequency_hz.to_bits());
}

#[test]
fn nothing_drifts() {
    let n: usize = std::env::var("RTHSTRACK_SOAK").map_or(1 << 20, |n| n.parse().unwrap());
    // Whole periods of the signals.
    drift_after(n.next_multiple_of(4096), Estimator::Fei);
    drift_after((n / 4).next_multiple_of(4096), Estimator::LeastSquares);
}

#[test]
fn any_split_into_blocks_gives_the_same_bits() {
    let (target, measured) = signals(3000);
    let config = MonitorConfig {
        n_actuators: 2,
        evaluator: EvaluatorConfig { estimator: Estimator::LeastSquares, ..configs()[4].evaluator },
        ..configs()[4]
    };
    let monitor = Monitor::new(config).unwrap();
    // Two actuators side by side, the second 100 samples behind.
    let rows = |s: &[f64]| (100..s.len()).flat_map(|i| [s[i], s[i - 100]]).collect::<Vec<f64>>();
    let (target, measured) = (rows(&target), rows(&measured));
    let mut state = monitor.state();
    let expected: Vec<Reading> = target
        .chunks(2)
        .zip(measured.chunks(2))
        .filter_map(|(x, y)| monitor.step(&mut state, x, y).map(<[Reading]>::to_vec))
        .flatten()
        .collect();
    assert!(expected.len() > 20 && expected[1].actuator == 1);
    for block in [1, 2, 7, 64, 1000, 2900] {
        let mut state = monitor.state();
        let mut found = Vec::new();
        for (x, y) in target.chunks(2 * block).zip(measured.chunks(2 * block)) {
            let n = monitor.readings_in(&state, x.len() / 2);
            let mut out = vec![expected[0]; n];
            let done = monitor.process(&mut state, x, y, &mut out);
            assert_eq!((done.samples, done.readings), (x.len() / 2, n));
            found.extend(out);
        }
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "blocks of {block}");
    }
    // A block whose readings do not fit stops before the first of them.
    let mut state = monitor.state();
    let done = monitor.process(&mut state, &target, &measured, &mut [expected[0]]);
    assert_eq!((done.samples as u64 + 1, done.readings), (monitor.first_reading_len(), 0));
    assert_eq!(monitor.samples_until_reading(&state), 1);
}

#[test]
fn a_sample_that_is_no_number_spoils_the_windows_that_hold_it_and_no_other() {
    let (target, measured) = signals(4096);
    for config in configs() {
        let monitor = Monitor::new(config).unwrap();
        let clean = readings(&monitor, &target, &measured);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
            let (mut x, mut y) = (target.clone(), measured.clone());
            x[1500] = bad;
            y[1501] = bad;
            let spoilt = readings(&monitor, &x, &y);
            let p = config.evaluator.data_decimation as u64;
            let delay = CausalDecimator::new(config.evaluator.data_decimation).unwrap().delay() as u64;
            let span = (config.window_s * RATE_HZ / p as f64).round() as u64 * p + 2 * delay;
            for (a, b) in clean.iter().zip(&spoilt) {
                assert_eq!(a.index, b.index);
                if (1500..1501 + span).contains(&a.index) {
                    // The filter's last tap may be so small that a sample of the largest magnitude does not show.
                    assert!(!b.is_valid() || bad == f64::MAX, "{bad} {config:?} {a:?} {b:?}");
                    assert!(!matches!(b.tracking.reason, Some(Reason::Still)), "{bad} {config:?} {b:?}");
                    continue;
                }
                // Estimators that shift the target look at what comes before the window, as far as it is there.
                let before = if config.evaluator.estimator == Estimator::Fei { 0 } else { 2 * RATE_HZ as u64 };
                if (1500..1501 + span + before).contains(&a.index) {
                    let (a, b) = (&a.tracking, &b.tracking);
                    assert_eq!(a.amplitude.is_nan(), b.amplitude.is_nan(), "{bad} {config:?} {a:?} {b:?}");
                    assert!(a.amplitude.is_nan() || (a.amplitude / b.amplitude - 1.0).abs() < 0.01, "{a:?} {b:?}");
                } else {
                    assert_eq!(format!("{a:?}"), format!("{b:?}"), "{bad} {config:?}");
                }
            }
            assert!(spoilt.last().unwrap().is_valid());
        }
    }
}

#[test]
fn a_target_that_moves_less_than_asked_is_not_judged() {
    let config = MonitorConfig { rate_hz: RATE_HZ, minimum_amplitude: 0.5, update_hz: 4.0, ..Default::default() };
    let monitor = Monitor::new(config).unwrap();
    let sine = |amplitude: f64| -> Vec<f64> {
        (0..2048).map(|i| amplitude * (std::f64::consts::TAU * 2.0 * f64::from(i) / RATE_HZ).sin()).collect()
    };
    let (small, large) = (sine(0.499), sine(0.501));
    assert!(readings(&monitor, &large, &large).iter().all(Reading::is_valid));
    assert!(readings(&monitor, &small, &small).iter().all(|r| r.tracking.reason == Some(Reason::Still)));
    let still = vec![0.1; 2048];
    assert!(readings(&monitor, &still, &large).iter().all(|r| r.tracking.reason == Some(Reason::Still)));
}

#[test]
fn one_tone_is_ambiguous_until_the_delay_to_expect_is_told() {
    let tone = |delay: f64| -> Vec<f64> {
        (0..4096).map(|i| (std::f64::consts::TAU * 6.0 * (f64::from(i) / 1024.0 - delay)).sin()).collect()
    };
    let (target, measured) = (tone(0.0), tone(0.020));
    let config = MonitorConfig {
        window_s: 2.0,
        evaluator: EvaluatorConfig { estimator: Estimator::LeastSquares, ..MonitorConfig::default().evaluator },
        ..Default::default()
    };
    let last = |config| *readings(&Monitor::new(config).unwrap(), &target, &measured).last().unwrap();
    assert!(matches!(last(config).tracking.reason, Some(Reason::Ambiguous { .. })));
    let told = last(MonitorConfig {
        evaluator: EvaluatorConfig { expected_delay_s: Some(0.0), ..config.evaluator },
        ..config
    });
    assert!((told.tracking.delay_s - 0.020).abs() < 1e-9, "{told:?}");
    let a_period_later = last(MonitorConfig {
        evaluator: EvaluatorConfig { expected_delay_s: Some(0.18), ..config.evaluator },
        ..config
    });
    assert!((a_period_later.tracking.delay_s - 0.020 - 1.0 / 6.0).abs() < 1e-9, "{a_period_later:?}");
    // What judges a window knows it, too; `fei` looks for none.
    for (estimator, expected) in [(Estimator::Aligned, Some(0.01)), (Estimator::Fei, None)] {
        let monitor = Monitor::new(MonitorConfig {
            evaluator: EvaluatorConfig { estimator, expected_delay_s: Some(0.01), ..config.evaluator },
            ..config
        })
        .unwrap();
        assert_eq!(monitor.evaluator().config().expected_delay_s, expected);
    }
}

#[test]
fn after_a_restart_nothing_is_left_of_what_came_before() {
    let (target, measured) = signals(3000);
    for config in configs() {
        let monitor = Monitor::new(config).unwrap();
        let fresh = readings(&monitor, &target, &measured);
        let mut state = monitor.state();
        for i in 0..1777 {
            monitor.step(&mut state, &[f64::NAN], &[i as f64]);
        }
        monitor.restart(&mut state, 10_000);
        assert_eq!(monitor.window(&state, 0), (&[][..], &[][..]));
        let again: Vec<Reading> = target
            .iter()
            .zip(&measured)
            .filter_map(|(x, y)| monitor.step(&mut state, &[*x], &[*y]).map(|r| r[0]))
            .collect();
        assert_eq!(fresh.len(), again.len());
        for (a, b) in fresh.iter().zip(&again) {
            assert_eq!(a.index + 10_000, b.index);
            assert_eq!(format!("{:?}", a.tracking), format!("{:?}", b.tracking));
        }
    }
}

#[test]
fn settings_that_cannot_be_are_refused_with_what_they_must_be() {
    let config = MonitorConfig::default();
    for (config, expected) in [
        (MonitorConfig { rate_hz: 0.0, ..config }, "rate_hz must be a positive finite number, not 0"),
        (
            MonitorConfig { window_s: 0.001, ..config },
            "window_s must be from 0.00390625 to 4096 s (4 to 4194304 samples at 1024 Hz), not 0.001",
        ),
        (MonitorConfig { window_s: 0.0, ..config }, "window_s must be a positive duration in seconds, not 0"),
        (MonitorConfig { window_s: 1e9, ..config }, "window_s must be from"),
        (MonitorConfig { window_s: f64::NAN, ..config }, "window_s must be a positive duration in seconds, not NaN"),
        (MonitorConfig { update_hz: 0.0, ..config }, "update_hz must be a positive frequency in hertz, not 0"),
        (
            MonitorConfig {
                update_hz: 200.0,
                evaluator: EvaluatorConfig { data_decimation: 8, ..config.evaluator },
                ..config
            },
            "update_hz must be above 0 and at most 128 Hz",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { data_decimation: 3, ..config.evaluator }, ..config },
            "data_decimation must be a power of two",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { frequency_decimation: 0, ..config.evaluator }, ..config },
            "frequency_decimation must be a power of two",
        ),
        (
            MonitorConfig {
                evaluator: EvaluatorConfig { band_hz: Some((0.0, 33.0)), data_decimation: 8, ..config.evaluator },
                ..config
            },
            "band_hz must be at most 32 Hz at its upper end",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { band_hz: Some((9.0, 3.0)), ..config.evaluator }, ..config },
            "band_hz must be two finite frequencies",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { band_hz: Some((0.01, 0.02)), ..config.evaluator }, ..config },
            "no frequency bin is left",
        ),
        (
            MonitorConfig { minimum_amplitude: -1.0, ..config },
            "minimum_amplitude must be zero or a positive number, not -1",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { max_delay_s: 0.0, ..config.evaluator }, ..config },
            "max_delay_s must be a positive duration",
        ),
        (
            MonitorConfig {
                evaluator: EvaluatorConfig { expected_delay_s: Some(f64::NAN), ..config.evaluator },
                ..config
            },
            "expected_delay_s must be a finite number in seconds, not NaN",
        ),
        (
            MonitorConfig { evaluator: EvaluatorConfig { expected_delay_s: Some(-0.3), ..config.evaluator }, ..config },
            "expected_delay_s must be at most max_delay_s, 0.25 s, either way, not -0.3",
        ),
        (
            MonitorConfig {
                evaluator: EvaluatorConfig {
                    estimator: Estimator::Aligned,
                    expected_delay_s: Some(0.3),
                    ..config.evaluator
                },
                ..config
            },
            "expected_delay_s must be at most max_delay_s, 0.25 s, either way, not 0.3",
        ),
        (MonitorConfig { n_actuators: 0, ..config }, "n_actuators must be a whole number from 1 on, not 0"),
    ] {
        let message = Monitor::new(config).map(|_| ()).unwrap_err().to_string();
        assert!(message.starts_with(expected), "{message}");
    }
}
