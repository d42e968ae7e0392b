//! The estimators that shift the target, against motions whose gain and delay are known and against sums written out.

use std::f64::consts::PI;

use rthstrack::{
    Detrend, Error, Estimator, Evaluator, EvaluatorConfig, MovingConfig, Noise, Pair, Reason, Tracking, Window,
    evaluate_moving,
};

const RATE_HZ: f64 = 1024.0;
const GAIN: f64 = 1.1;
/// What interpolation between samples and the iteration's end leave, relative.
const INTERPOLATION: f64 = 1e-6;

/// A motion known at any time: cycles that grow and fade, a drift, a residual displacement, a little of a higher tone.
fn motion(t: f64) -> f64 {
    (2.0 * PI * 1.1 * t).sin() * (-(t - 6.0) * (t - 6.0) / 12.0).exp()
        + 0.8 / (1.0 + (-2.0 * (t - 6.5)).exp())
        + 0.05 * (2.0 * PI * 7.3 * t + 0.4).sin()
}

fn pair(n: usize, delay_s: f64) -> (Vec<f64>, Vec<f64>) {
    (0..n).map(|i| i as f64 / RATE_HZ).map(|t| (motion(t), GAIN * motion(t - delay_s))).unzip()
}

/// Normal numbers of variance 1 from sums of twelve uniform ones.
fn noise(n: usize, mut seed: u64) -> Vec<f64> {
    let mut uniform = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}

fn evaluate(target: &[f64], measured: &[f64], config: EvaluatorConfig) -> Tracking {
    evaluate_at(RATE_HZ, target, measured, config)
}

fn evaluate_at(rate_hz: f64, target: &[f64], measured: &[f64], config: EvaluatorConfig) -> Tracking {
    let evaluator = Evaluator::new(target.len(), rate_hz, config).expect("a possible plan");
    evaluator.evaluate(&mut evaluator.state(), &Pair::new(target, measured, rate_hz).unwrap()).expect("judged")
}

fn least_squares() -> EvaluatorConfig {
    EvaluatorConfig { estimator: Estimator::LeastSquares, ..Default::default() }
}

#[test]
fn a_lag_and_a_lead_are_found_with_their_signs_whatever_the_window() {
    for delay_s in [-0.1, -0.0123, 0.0, 0.0005, 0.02, 0.2] {
        let (target, measured) = pair(12_000, delay_s);
        for (_, estimator) in &Estimator::NAMES[1..] {
            for (_, window) in Window::NAMES {
                for (_, detrend) in Detrend::NAMES {
                    let config =
                        EvaluatorConfig { estimator: *estimator, window, detrend: Some(detrend), ..Default::default() };
                    let found = evaluate(&target, &measured, config);
                    let context = format!("{delay_s} {estimator:?} {window:?} {detrend:?}: {found:?}");
                    assert!((found.amplitude - GAIN).abs() < INTERPOLATION, "{context}");
                    assert!((found.delay_s - delay_s).abs() < INTERPOLATION * 1e-2, "{context}");
                    assert_eq!(found.reason, None, "{context}");
                }
            }
        }
    }
}

#[test]
fn bins_of_p_q_and_a_band_find_the_same() {
    let (target, measured) = pair(12_000, 0.0123);
    for (data_decimation, frequency_decimation, band_hz) in
        [(8, 1, None), (1, 4, None), (16, 2, None), (1, 1, Some((0.3, 12.0)))]
    {
        for (_, estimator) in &Estimator::NAMES[1..] {
            let config = EvaluatorConfig {
                estimator: *estimator,
                data_decimation,
                frequency_decimation,
                band_hz,
                ..Default::default()
            };
            let found = evaluate(&target, &measured, config);
            assert!((found.amplitude - GAIN).abs() < INTERPOLATION, "{config:?} {found:?}");
            assert!((found.delay_s - 0.0123).abs() < 1e-8, "{config:?} {found:?}");
        }
    }
}

#[test]
fn every_window_of_a_drifting_record_is_right() {
    let (target, measured) = pair(14_000, 0.005);
    for (_, estimator) in &Estimator::NAMES[1..] {
        for window in [Window::Boxcar, Window::Hann] {
            let config = MovingConfig {
                evaluator: EvaluatorConfig { estimator: *estimator, window, ..Default::default() },
                ..Default::default()
            };
            let moving = evaluate_moving(&Pair::new(&target, &measured, RATE_HZ).unwrap(), &config).unwrap();
            assert!(moving.tracking.iter().filter(|t| t.is_valid()).count() > 30, "{:?}", moving.tracking);
            for (i, found) in moving.tracking.iter().enumerate() {
                assert_eq!(found.is_valid(), found.reason.is_none(), "{:?}", found.reason);
                if found.is_valid() {
                    assert!((found.delay_s - 0.005).abs() < 1e-7, "{i}: {}", found.delay_s);
                    assert!((found.amplitude - GAIN).abs() < 1e-5, "{i}: {}", found.amplitude);
                }
            }
        }
    }
}

/// The estimate minimises the sum of squares over the samples for which the shifted target is known: on either side of it, by
/// exact sines and the best gain, the sum is larger.
#[test]
fn the_sum_of_squares_is_least_at_the_estimate() {
    let n = 8192;
    let tone = |t: f64| (2.0 * PI * 1.3 * t).sin() + 0.6 * (2.0 * PI * 2.9 * t + 1.0).cos();
    let errors = noise(n, 7);
    let time = |i: usize| i as f64 / RATE_HZ;
    let target: Vec<f64> = (0..n).map(|i| tone(time(i))).collect();
    let measured: Vec<f64> = (0..n).map(|i| 0.9 * tone(time(i) - 0.015) + 0.05 * errors[i]).collect();
    let found = evaluate(&target, &measured, least_squares());
    // Any fixed range within the judged samples moves the least by far less than the noise does; so the whole inner range.
    let squares = |delay_s: f64| -> f64 {
        let range = 64..n - 64;
        let (mut oo, mut oy, mut yy) = (0.0, 0.0, 0.0);
        for i in range {
            let y = tone(time(i) - delay_s);
            oo += measured[i] * measured[i];
            oy += measured[i] * y;
            yy += y * y;
        }
        oo - oy * oy / yy
    };
    let step = 0.5 * found.delay_std_s;
    assert!(squares(found.delay_s) < squares(found.delay_s - step), "{found:?}");
    assert!(squares(found.delay_s) < squares(found.delay_s + step), "{found:?}");
    // 1 / curvature is the variance, in white noise.
    let h = 1e-5;
    let curvature = (squares(found.delay_s + h) + squares(found.delay_s - h) - 2.0 * squares(found.delay_s)) / (h * h);
    let expected = 0.05 / (0.5 * curvature).sqrt();
    assert!((found.delay_std_s / expected - 1.0).abs() < 0.15, "{} {expected}", found.delay_std_s);
    assert!(found.delay_interval_s.0 < 0.015 && 0.015 < found.delay_interval_s.1, "{found:?}");
    assert!(found.amplitude_interval.0 < 0.9 && 0.9 < found.amplitude_interval.1, "{found:?}");
}

#[test]
fn intervals_cover_in_white_and_in_coloured_noise() {
    let n = 4096;
    let draws = 200;
    let (target, clean) = pair(8192, 0.005);
    for (correlation, noise_model) in [(0.0, Noise::White), (0.9, Noise::White), (0.9, Noise::Coloured)] {
        let evaluator = EvaluatorConfig { noise: noise_model, ..least_squares() };
        let config = MovingConfig { window_s: 4.0, hop_s: 2.0, minimum_std_ratio: 0.0, evaluator };
        let (mut delays, mut gains, mut total) = (0, 0, 0);
        for draw in 0..draws {
            let white = noise(clean.len(), 1000 + draw);
            let mut state = 0.0;
            let measured: Vec<f64> = clean
                .iter()
                .zip(&white)
                .map(|(c, w)| {
                    state = correlation * state + w * (1.0f64 - correlation * correlation).sqrt();
                    c + 0.01 * state
                })
                .collect();
            let moving = evaluate_moving(&Pair::new(&target, &measured, RATE_HZ).unwrap(), &config).unwrap();
            assert_eq!(moving.tracking.len(), (8192 - n) / 2048 + 1);
            // The window in the middle has target on both sides.
            let (low, high) = moving.tracking[1].delay_interval_s;
            delays += usize::from(low <= 0.005 && 0.005 <= high);
            let (low, high) = moving.tracking[1].amplitude_interval;
            gains += usize::from(low <= GAIN && GAIN <= high);
            total += 1;
        }
        // 95 % of 200 is 190, standard deviation 3.
        for covered in [delays, gains] {
            assert!((179..=199).contains(&covered), "{correlation} {noise_model:?}: {covered} of {total}");
        }
    }
}

#[test]
fn noise_on_both_signals_does_not_bias_total_least_squares() {
    let (clean_target, clean) = pair(8192, 0.005);
    let config = EvaluatorConfig { noise_ratio: 1.0, band_hz: Some((0.1, 20.0)), ..least_squares() };
    let (mut gains, mut delays) = (Vec::new(), Vec::new());
    for draw in 0..60 {
        let (e, f) = (noise(8192, 2 * draw + 1), noise(8192, 2 * draw + 2));
        let target: Vec<f64> = clean_target.iter().zip(&e).map(|(x, e)| x + 0.05 * e).collect();
        let measured: Vec<f64> = clean.iter().zip(&f).map(|(x, e)| x + 0.05 * e).collect();
        let found = evaluate(&target, &measured, config);
        gains.push(found.amplitude - GAIN);
        delays.push(found.delay_s - 0.005);
    }
    for errors in [gains, delays] {
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let std = (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / n).sqrt();
        // Four standard deviations of the mean.
        assert!(mean.abs() < 4.0 * std / n.sqrt(), "{mean} {std}");
    }
}

#[test]
fn what_cannot_be_determined_says_why() {
    let n = 8192;
    let time = |i: usize| i as f64 / RATE_HZ;
    let reason = |target: &[f64], measured: &[f64]| evaluate(target, measured, least_squares()).reason;
    let sine: Vec<f64> = (0..n).map(|i| (2.0 * PI * 5.0 * time(i)).sin()).collect();
    let late: Vec<f64> = (0..n).map(|i| 0.9 * (2.0 * PI * 5.0 * (time(i) - 0.03)).sin()).collect();
    assert!(matches!(reason(&sine, &late), Some(Reason::Ambiguous { .. })), "{:?}", reason(&sine, &late));
    let near = EvaluatorConfig { max_delay_s: 0.09, ..least_squares() };
    let found = evaluate(&sine, &late, near);
    assert!((found.delay_s - 0.03).abs() < 1e-8 && found.reason.is_none(), "{found:?}");

    let (target, measured) = pair(n, 0.03);
    let near = EvaluatorConfig { max_delay_s: 0.01, ..least_squares() };
    assert!(matches!(evaluate(&target, &measured, near).reason, Some(Reason::BeyondMaxDelay { .. })));
    let negative: Vec<f64> = measured.iter().map(|v| -v).collect();
    assert!(matches!(reason(&target, &negative), Some(Reason::OppositeSign { .. })));
    assert!(matches!(reason(&target, &noise(n, 3)), Some(Reason::LowCoherence { .. } | Reason::OppositeSign { .. })));
    let still = vec![1.0; n];
    assert_eq!(reason(&target, &still), Some(Reason::Still));
    let slow: Vec<f64> = (0..n).map(|i| (2.0 * PI * 0.02 * time(i)).sin()).collect();
    assert!(matches!(reason(&slow, &slow), Some(Reason::FewCycles { .. })), "{:?}", reason(&slow, &slow));
    assert!(evaluate(&target[..16], &measured[..16], least_squares()).reason.is_some_and(|r| r.is_undetermined()));
}

/// Of the turns 30, 230 and -170 ms of a sine of 5 Hz.
#[test]
fn of_delays_that_fit_equally_well_the_one_nearest_to_the_expected_is_taken() {
    let sine = |delay: f64| -> Vec<f64> {
        (0..8192).map(|i| (2.0 * PI * 5.0 * (f64::from(i) / RATE_HZ - delay)).sin()).collect()
    };
    let (target, measured) = (sine(0.0), sine(0.03));
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    for estimator in [Estimator::LeastSquares, Estimator::Aligned] {
        for (expected, delay) in [(0.0, 0.03), (0.03, 0.03), (0.14, 0.23), (0.25, 0.23), (-0.08, -0.17), (-0.25, -0.17)]
        {
            let config = EvaluatorConfig { estimator, expected_delay_s: Some(expected), ..least_squares() };
            let found = evaluate(&target, &measured, config);
            assert!((found.delay_s - delay).abs() < 1e-6 && found.reason.is_none(), "{expected}: {found:?}");
            let config = MovingConfig { window_s: 2.0, evaluator: config, ..Default::default() };
            let moving = evaluate_moving(&pair, &config).unwrap();
            // The delay's sign decides at which end a window has nothing of the record beside it.
            let found = &moving.tracking;
            assert!(found.iter().all(|t| (t.delay_s - delay).abs() < 1e-6), "{expected}: {found:?}");
        }
    }
}

/// An actuator that answers high frequencies later and weaker: one gain and one delay leave what still follows the target.
#[test]
fn no_interval_is_given_where_the_residual_follows_the_target() {
    let n = 16384;
    let (mut smooth, mut lagged) = (0.0, 0.0);
    let (mut target, mut measured) = (Vec::new(), Vec::new());
    for w in noise(n, 11) {
        smooth += (w - smooth) / 8.0;
        target.push(smooth);
        lagged += (smooth - lagged) / 29.0;
        measured.push(lagged);
    }
    let found = evaluate(&target, &measured, least_squares());
    assert!(matches!(found.reason, Some(Reason::ResidualFollowsTarget { .. })), "{found:?}");
    assert!(found.delay_s > 0.0 && found.delay_interval_s.0.is_nan() && found.delay_std_s.is_nan(), "{found:?}");
}

#[test]
fn settings_that_exclude_each_other_are_refused() {
    let refused = |config: EvaluatorConfig| Evaluator::new(8192, RATE_HZ, config).err();
    let combined = |error: Option<Error>| matches!(error, Some(Error::Combination { .. }));
    assert!(combined(refused(EvaluatorConfig { noise_ratio: 1.0, ..EvaluatorConfig::published() })));
    assert!(combined(refused(EvaluatorConfig { noise: Noise::Coloured, ..EvaluatorConfig::published() })));
    assert!(combined(refused(EvaluatorConfig { weight_power: 3, ..least_squares() })));
    assert!(combined(refused(EvaluatorConfig { noise: Noise::Coloured, noise_ratio: 1.0, ..least_squares() })));
    for max_delay_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(EvaluatorConfig { max_delay_s, ..least_squares() });
        assert!(matches!(error, Some(Error::Setting { name: "max_delay_s", .. })), "{error:?}");
    }
    for estimator in [Estimator::LeastSquares, Estimator::Aligned] {
        let told = |expected| EvaluatorConfig { estimator, expected_delay_s: Some(expected), ..Default::default() };
        for expected in [0.26, -0.26] {
            let error = refused(told(expected)).unwrap().to_string();
            assert_eq!(
                error,
                format!("expected_delay_s must be at most max_delay_s, 0.25 s, either way, not {expected}")
            );
        }
        for no_number in [f64::NAN, f64::INFINITY] {
            let error = refused(told(no_number)).unwrap().to_string();
            assert_eq!(error, format!("expected_delay_s must be a finite number in seconds, not {no_number}"));
        }
        assert!(refused(told(-0.25)).is_none() && refused(told(0.25)).is_none());
    }
    let published = EvaluatorConfig { expected_delay_s: Some(0.01), ..EvaluatorConfig::published() };
    let error = refused(published).unwrap().to_string();
    assert_eq!(error, "expected_delay_s = 0.01 goes only with estimator aligned or least_squares; change one of them");
    for noise_ratio in [-1.0, f64::NAN, f64::INFINITY] {
        let error = refused(EvaluatorConfig { noise_ratio, ..least_squares() });
        assert!(matches!(error, Some(Error::Setting { name: "noise_ratio", .. })), "{error:?}");
    }
}

/// Any finite samples give a number or a reason, and never a panic.
#[test]
fn odd_samples_are_answered() {
    let n = 600;
    let spikes: Vec<f64> = (0..n).map(|i| if i % 97 == 0 { 1e6 } else { 0.0 }).collect();
    let step: Vec<f64> = (0..n).map(|i| if i < n / 2 { 0.0 } else { 1.0 }).collect();
    let ramp: Vec<f64> = (0..n).map(|i| i as f64).collect();
    let white = noise(n, 5);
    let quantised: Vec<f64> = white.iter().map(|v| v.round()).collect();
    let large: Vec<f64> = white.iter().map(|v| v + 1e9).collect();
    let walk: Vec<f64> = noise(n, 8)
        .iter()
        .scan(0.0, |sum, v| {
            *sum += v;
            Some(*sum)
        })
        .collect();
    let all = [spikes, step, ramp, white, quantised, large, walk];
    let aligned = |weight_power| EvaluatorConfig { estimator: Estimator::Aligned, weight_power, ..Default::default() };
    let noisy = |noise, noise_ratio| EvaluatorConfig { noise, noise_ratio, ..least_squares() };
    let kinds = [
        aligned(2),
        aligned(3),
        noisy(Noise::White, 0.0),
        noisy(Noise::Coloured, 0.0),
        noisy(Noise::White, 0.5),
        EvaluatorConfig { data_decimation: 2, frequency_decimation: 2, ..least_squares() },
    ];
    for target in &all {
        for measured in &all {
            for len in [4, 5, 16, 63, 64, 300, n] {
                for kind in kinds {
                    for (window, detrend) in [(Window::Boxcar, Detrend::None), (Window::Hann, Detrend::Mean)] {
                        let config = EvaluatorConfig { window, detrend: Some(detrend), ..kind };
                        let Ok(pair) = Pair::new(&target[..len], &measured[..len], RATE_HZ) else { continue };
                        let Ok(evaluator) = Evaluator::new(len, RATE_HZ, config) else { continue };
                        let found = evaluator.evaluate(&mut evaluator.state(), &pair).unwrap();
                        let undetermined = found.reason.is_some_and(|r| r.is_undetermined());
                        assert_eq!(found.delay_s.is_nan(), undetermined, "{found:?}");
                        assert_eq!(found.amplitude.is_nan(), undetermined, "{found:?}");
                        assert_eq!(found.delay_interval_s.0.is_nan(), found.reason.is_some(), "{found:?}");
                    }
                }
            }
        }
    }
}

/// A tone that begins and ends slowly tells its turn by its ends alone: every one of the turns within reach is compared.
#[test]
fn no_turn_of_a_tone_is_taken_for_another() {
    let n = 20_480;
    let ramp = |t: f64| (t / 2.0).min((20.0 - t) / 2.0).clamp(0.0, 1.0);
    for frequency_hz in [12.0, 13.0, 15.0, 17.0, 20.0, 30.0] {
        let tone = |t: f64| ramp(t) * (2.0 * PI * frequency_hz * t).sin();
        for (draw, delay_s) in [-0.02, 0.0, 0.012, 0.04].into_iter().enumerate() {
            let errors = noise(n, 11 + draw as u64);
            let target: Vec<f64> = (0..n).map(|i| tone(i as f64 / RATE_HZ)).collect();
            let measured: Vec<f64> =
                (0..n).map(|i| 0.95 * tone(i as f64 / RATE_HZ - delay_s) + 0.02 * errors[i]).collect();
            let found = evaluate(&target, &measured, least_squares());
            assert!((found.delay_s - delay_s).abs() < 1e-4, "{frequency_hz} {delay_s}: {found:?}");
            // Less than half a period away, the delay that is expected tells the turn of any stretch of it.
            for off in [-0.4, 0.4] {
                let config =
                    EvaluatorConfig { expected_delay_s: Some(delay_s + off / frequency_hz), ..least_squares() };
                let middle = 8192..12_288;
                let found = evaluate(&target[middle.clone()], &measured[middle], config);
                assert!((found.delay_s - delay_s).abs() < 1e-3, "{frequency_hz} {delay_s} {off}: {found:?}");
            }
        }
    }
}

/// The target's own noise, at one delay and at another, is no evidence for either.
#[test]
fn no_turn_of_a_tone_is_taken_for_another_where_both_channels_have_noise() {
    let n = 2048;
    for (draw, (on_target, on_measured)) in
        [(0.001, 0.001), (0.02, 0.02), (0.002, 0.007)].into_iter().cycle().take(24).enumerate()
    {
        let tone = |i: usize, delay_s: f64| (2.0 * PI * 25.0 * (i as f64 / RATE_HZ - delay_s) + 1.0).sin();
        let (first, second) = (noise(n, 50 + draw as u64), noise(n, 800 + draw as u64));
        let target: Vec<f64> = (0..n).map(|i| tone(i, 0.0) + on_target * first[i]).collect();
        let measured: Vec<f64> = (0..n).map(|i| 0.95 * tone(i, 0.013) + on_measured * second[i]).collect();
        for band_hz in [None, Some((0.0, 60.0))] {
            let config = EvaluatorConfig { band_hz, ..least_squares() };
            let found = evaluate(&target, &measured, config);
            assert!(matches!(found.reason, Some(Reason::Ambiguous { .. })), "{draw} {band_hz:?}: {found:?}");
            for off in [-0.4, 0.0, 0.4] {
                let found = evaluate(
                    &target,
                    &measured,
                    EvaluatorConfig { expected_delay_s: Some(0.013 + off / 25.0), ..config },
                );
                assert!((found.delay_s - 0.013).abs() < 1e-3, "{draw} {band_hz:?} {off}: {found:?}");
            }
        }
    }
}

/// A line a little beside the tone, on measured alone, is as strong in every cycle: what it makes of two turns is no evidence.
#[test]
fn a_line_beside_the_tone_does_not_choose_its_turn() {
    let n = 10_240;
    let ramp = |t: f64| (t / 2.0).min((20.0 - t) / 2.0).clamp(0.0, 1.0);
    let tone = |t: f64| ramp(t) * (20.0 * PI * t).sin();
    let at = |i: usize| i as f64 / 512.0;
    let target: Vec<f64> = (0..n).map(|i| tone(at(i))).collect();
    let errors = noise(n, 77);
    for phase in 0..16 {
        let line = |t: f64| 0.1 * (20.2 * PI * t + 0.4 * f64::from(phase)).sin();
        let measured: Vec<f64> = (0..n).map(|i| 0.95 * tone(at(i) - 0.017) + line(at(i)) + 0.01 * errors[i]).collect();
        let found = evaluate_at(512.0, &target, &measured, least_squares());
        assert!(found.delay_s.is_nan() || (found.delay_s - 0.017).abs() < 0.01, "{phase}: {found:?}");
    }
}

/// Most of the energy is slow, and what tells the delay is a peak narrower than the averages that serve the slow part.
#[test]
fn a_narrow_peak_is_not_stepped_over() {
    let n = 8192;
    let uniform = noise(300, 35);
    let parts: Vec<(f64, f64, f64)> = (0..100)
        .map(|k| {
            let f = 0.2 * 1024.0_f64.powf((k as f64 + 0.5) / 100.0);
            (2.0 * PI * f, (1.0 + 0.3 * uniform[k]) / f.sqrt(), 2.0 * PI * uniform[100 + k])
        })
        .collect();
    let motion = |t: f64| parts.iter().map(|(w, a, p)| a * (w * t + p).sin()).sum::<f64>();
    let target: Vec<f64> = (0..n).map(|i| motion(i as f64 / RATE_HZ)).collect();
    for delay_s in [0.004607, 0.0153, -0.0312] {
        let measured: Vec<f64> = (0..n).map(|i| 0.97 * motion(i as f64 / RATE_HZ - delay_s)).collect();
        let found = evaluate(&target, &measured, least_squares());
        assert!((found.delay_s - delay_s).abs() < 2e-6, "{delay_s}: {found:?}");
    }
}

/// A turn of it lies within reach, and fits but for the envelope.
#[test]
fn a_turn_within_reach_is_not_taken_for_a_delay_beyond_it() {
    let n = 10_240;
    let at = |i: usize| i as f64 / 512.0;
    let ramped = |t: f64| (t / 8.0).min((20.0 - t) / 8.0).clamp(0.0, 1.0) * (4.0 * PI * t).sin();
    let pulse = |t: f64| (-((t - 10.0) / 2.0).powi(2)).exp() * (50.0 * PI * t).sin();
    for (motion, delays_s) in [(&ramped as &dyn Fn(f64) -> f64, [0.4, -0.3, 0.28]), (&pulse, [0.28, -0.29, 0.3])] {
        let target: Vec<f64> = (0..n).map(|i| motion(at(i))).collect();
        let errors = noise(n, 9);
        for delay_s in delays_s {
            let measured: Vec<f64> = (0..n).map(|i| motion(at(i) - delay_s) + 0.005 * errors[i]).collect();
            let reason = evaluate_at(512.0, &target, &measured, least_squares()).reason;
            assert!(matches!(reason, Some(Reason::BeyondMaxDelay { .. })), "{delay_s}: {reason:?}");
        }
    }
}

#[test]
fn the_two_turns_that_are_told_are_neighbours_and_the_nearest_to_no_delay() {
    let tone = |t: f64| (2.0 * PI * 20.0 * t).sin();
    let target: Vec<f64> = (0..8192).map(|i| tone(i as f64 / RATE_HZ)).collect();
    let measured: Vec<f64> = (0..8192).map(|i| tone(i as f64 / RATE_HZ - 0.012)).collect();
    match evaluate(&target, &measured, least_squares()).reason {
        Some(Reason::Ambiguous { delay_s, other_s }) => {
            assert!((delay_s - 0.012).abs() < 1e-6, "{delay_s}");
            assert!(((other_s - delay_s).abs() - 0.05).abs() < 1e-6, "{other_s}");
        }
        other => panic!("{other:?}"),
    }
}

/// With noise of its own on the target, plain least squares is drawn to half samples by hundreds of microseconds.
#[test]
fn noise_on_the_target_draws_the_delay_to_no_fraction_of_a_sample() {
    let n = 30_720;
    let motion = |t: f64| (2.0 * PI * 0.3 * t).sin() + 0.4 * (2.0 * PI * 1.1 * t + 1.0).sin();
    for share in [0.003, 0.03] {
        for fraction in [0.0, 0.25, 0.5, 0.75] {
            let delay_s = (7.0 + fraction) / RATE_HZ;
            let (mut error, mut square, mut held) = (0.0, 0.0, 0);
            const DRAWS: u64 = 24;
            for draw in 0..DRAWS {
                let (first, second) = (noise(n, 100 + draw), noise(n, 900 + draw));
                let noisy = |late: f64, gain: f64, errors: &[f64]| -> Vec<f64> {
                    (0..n).map(|i| gain * (motion(i as f64 / RATE_HZ - late) + share * errors[i])).collect()
                };
                let found = evaluate(
                    &noisy(0.0, 1.0, &first),
                    &noisy(delay_s, 0.95, &second),
                    EvaluatorConfig { detrend: Some(Detrend::Mean), ..least_squares() },
                );
                assert!((found.target_noise_std / share - 1.0).abs() < 0.1, "{found:?}");
                error += (found.delay_s - delay_s) / DRAWS as f64;
                square += (found.delay_s - delay_s).powi(2) / DRAWS as f64;
                let (low, high) = found.delay_interval_s;
                held += usize::from(low <= delay_s && delay_s <= high);
            }
            // Four standard errors of a mean; of 24 draws 19 hold but once in 500 times.
            assert!(error.abs() < 4.0 * (square / DRAWS as f64).sqrt(), "{share} {fraction}: {error} {square}");
            assert!(held >= 19, "{share} {fraction}: {held}");
        }
    }
}

#[test]
fn a_clean_target_is_taken_for_exact_and_so_is_a_high_motion_that_measured_follows() {
    let n = 8192;
    for high_hz in [40.0, 90.0, 120.0] {
        let motion = |t: f64| (2.0 * PI * 2.0 * t).sin() + 0.3 * (2.0 * PI * high_hz * t + 0.3).sin();
        let errors = noise(n, 5);
        let target: Vec<f64> = (0..n).map(|i| motion(i as f64 / RATE_HZ)).collect();
        let measured: Vec<f64> = (0..n).map(|i| 0.9 * motion(i as f64 / RATE_HZ - 0.0123) + 0.01 * errors[i]).collect();
        let found = evaluate(&target, &measured, least_squares());
        assert_eq!(found.target_noise_std, 0.0, "{high_hz}");
        assert!((found.delay_s - 0.0123).abs() < 5.0 * found.delay_std_s, "{high_hz}: {found:?}");
    }
}

/// Noise as strong as the velocity: the interval of steady noise would hold two of three.
#[test]
fn intervals_hold_where_the_noise_follows_the_velocity() {
    let n = 12_288;
    let motion = |t: f64| (2.0 * PI * 1.3 * t).sin() + 0.6 * (2.0 * PI * 2.9 * t + 1.0).cos();
    let target: Vec<f64> = (0..n).map(|i| motion(i as f64 / RATE_HZ)).collect();
    const DRAWS: u64 = 200;
    let (mut held, mut steady) = (0, 0);
    for draw in 0..DRAWS {
        let errors = noise(n, 3000 + draw);
        let measured: Vec<f64> = (0..n)
            .map(|i| {
                let t = i as f64 / RATE_HZ - 0.0123;
                let velocity = (motion(t + 1e-4) - motion(t - 1e-4)) / 2e-4;
                0.95 * motion(t) + 0.001 * velocity * errors[i]
            })
            .collect();
        let found = evaluate(&target, &measured, EvaluatorConfig { detrend: Some(Detrend::Mean), ..least_squares() });
        let (low, high) = found.delay_interval_s;
        held += usize::from(low <= 0.0123 && 0.0123 <= high);
        steady += usize::from((found.delay_s - 0.0123).abs() < 1.96 * found.delay_std_s / 1.5);
    }
    assert!((181..=200).contains(&held), "{held} of {DRAWS}");
    assert!(steady < held, "the noise is not steady");
}

#[test]
fn a_delay_out_of_reach_is_not_an_opposite_sign() {
    let n = 20_480;
    let motion =
        |t: f64| (-(t - 9.0) * (t - 9.0) / 8.0).exp() * ((2.0 * PI * 1.2 * t).sin() + 0.5 * (2.0 * PI * 3.1 * t).cos());
    let target: Vec<f64> = (0..n).map(|i| motion(i as f64 / RATE_HZ)).collect();
    for delay_s in [0.4, -0.4] {
        let measured: Vec<f64> = (0..n).map(|i| motion(i as f64 / RATE_HZ - delay_s)).collect();
        let reason = evaluate(&target, &measured, least_squares()).reason;
        assert!(matches!(reason, Some(Reason::BeyondMaxDelay { .. })), "{delay_s}: {reason:?}");
    }
    let measured: Vec<f64> = target.iter().map(|x| -x).collect();
    match evaluate(&target, &measured, least_squares()).reason {
        Some(Reason::OppositeSign { delay_s }) => assert!(delay_s.abs() < 0.02, "{delay_s}"),
        other => panic!("{other:?}"),
    }
}
