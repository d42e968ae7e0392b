//! The evaluation against its definition: sums over a discrete Fourier transform written out term by term.

use std::f64::consts::PI;

use num_complex::Complex;
use rthstrack::{Decimator, Detrend, Error, Evaluator, EvaluatorConfig, MovingConfig, Pair, Window, evaluate_moving};

const RATE_HZ: f64 = 200.0;
/// Round-off of a sum of some hundred terms, relative.
const ROUND_OFF: f64 = 1e-11;

/// Two tones, a drift and a little of everything else, so that no bin is empty.
fn pair(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut noise = 1u64;
    let mut random = move || {
        noise = noise.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (noise >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let signal = |i: f64| (0.031 * i).sin() + 0.4 * (0.17 * i).cos() + 1e-4 * i;
    let target: Vec<f64> = (0..n).map(|i| signal(i as f64) + 0.2 * random()).collect();
    let measured = (0..n).map(|i| 1.1 * signal(i as f64 - 1.7) + 0.2 * random()).collect();
    (target, measured)
}

/// amplitude, phase, f_eq and the number of bins, from the definition.
fn by_definition(target: &[f64], measured: &[f64], config: &EvaluatorConfig) -> (f64, f64, f64, usize) {
    let n = target.len().next_power_of_two();
    let window = config.window.coefficients(target.len()).unwrap_or_else(|| vec![1.0; target.len()]);
    let prepare = |x: &[f64]| -> Vec<f64> {
        let (len, centre) = (x.len() as f64, (x.len() as f64 - 1.0) / 2.0);
        let mean = x.iter().sum::<f64>() / len;
        let slope = x.iter().enumerate().map(|(i, v)| (i as f64 - centre) * v).sum::<f64>()
            / (0..x.len()).map(|i| (i as f64 - centre).powi(2)).sum::<f64>();
        x.iter()
            .enumerate()
            .map(|(i, v)| match config.detrending() {
                Detrend::None => *v,
                Detrend::Mean => v - mean,
                Detrend::Linear => v - mean - slope * (i as f64 - centre),
            })
            .zip(&window)
            .map(|(v, w)| v * w)
            .collect()
    };
    let (target, measured) = (prepare(target), prepare(measured));
    let bin = |x: &[f64], k: usize| -> Complex<f64> {
        x.iter()
            .enumerate()
            .map(|(i, v)| v * Complex::from_polar(1.0, -2.0 * PI * ((k * i) % n) as f64 / n as f64))
            .sum()
    };
    let (mut cross, mut power, mut moment, mut n_bins) = (Complex::new(0.0, 0.0), 0.0, 0.0, 0);
    let mut k = config.frequency_decimation;
    while k <= n / 2 / config.data_decimation {
        let f = k as f64 * RATE_HZ / n as f64;
        if config.band_hz.is_none_or(|(low, high)| low <= f && f <= high) {
            let (i, o) = (bin(&target, k), bin(&measured, k));
            let weight = i.norm().powi(config.weight_power as i32);
            cross += o / i * weight;
            power += weight;
            moment += f * weight;
            n_bins += 1;
        }
        k += config.frequency_decimation;
    }
    let fei = cross / power;
    (fei.norm(), fei.arg(), moment / power, n_bins)
}

fn check(n: usize, config: EvaluatorConfig) {
    let (target, measured) = pair(n);
    let evaluator = Evaluator::new(n, RATE_HZ, config).expect("a possible plan");
    let found =
        evaluator.evaluate(&mut evaluator.state(), &Pair::new(&target, &measured, RATE_HZ).unwrap()).expect("judged");
    let (amplitude, phase, frequency, n_bins) = by_definition(&target, &measured, &config);
    let context = format!("n = {n}, {config:?}");
    assert_eq!(evaluator.n_bins(), n_bins, "{context}");
    assert!((found.amplitude - amplitude).abs() <= ROUND_OFF * amplitude, "{context}: {} {amplitude}", found.amplitude);
    // Half a turn, of a bin at the Nyquist frequency say, has the sign of round-off.
    let apart = (found.phase_rad - phase + PI).rem_euclid(2.0 * PI) - PI;
    assert!(apart.abs() <= ROUND_OFF, "{context}: {} {phase}", found.phase_rad);
    assert!((found.equivalent_frequency_hz - frequency).abs() <= ROUND_OFF * frequency, "{context}");
    assert_eq!(found.delay_s, -found.phase_rad / (2.0 * PI * found.equivalent_frequency_hz), "{context}");
}

#[test]
fn every_length_from_four_samples_on_follows_the_definition() {
    for n in (4..40).chain([63, 64, 65, 100, 127, 128, 129, 255, 257, 500]) {
        check(n, EvaluatorConfig::published());
    }
}

#[test]
fn every_setting_follows_the_definition() {
    for (_, window) in Window::NAMES {
        for (_, detrend) in Detrend::NAMES {
            for weight_power in [1, 2, 3, 4, 7] {
                check(
                    300,
                    EvaluatorConfig { window, detrend: Some(detrend), weight_power, ..EvaluatorConfig::published() },
                );
            }
        }
    }
}

#[test]
fn folding_gives_the_bins_that_frequency_decimation_keeps() {
    for n in [300, 512, 700] {
        for frequency_decimation in [2, 4, 16, 64, 128] {
            check(n, EvaluatorConfig { frequency_decimation, ..EvaluatorConfig::published() });
            check(n, EvaluatorConfig { frequency_decimation, window: Window::Hann, ..EvaluatorConfig::published() });
            check(
                n,
                EvaluatorConfig {
                    frequency_decimation,
                    detrend: Some(Detrend::Linear),
                    ..EvaluatorConfig::published()
                },
            );
        }
    }
}

#[test]
fn the_cascade_gives_the_bins_that_data_decimation_keeps() {
    for n in [2100, 4096, 5000] {
        for data_decimation in [2, 4, 8, 16, 32, 64, 256] {
            for frequency_decimation in [1, 2, 4] {
                check(n, EvaluatorConfig { data_decimation, frequency_decimation, ..EvaluatorConfig::published() });
            }
        }
    }
}

#[test]
fn a_band_includes_both_its_ends() {
    let delta_f = RATE_HZ / 512.0;
    for (first, last) in [(1, 256), (3, 3), (10, 40), (256, 256)] {
        let band_hz = Some((first as f64 * delta_f, last as f64 * delta_f));
        let config = EvaluatorConfig { band_hz, ..EvaluatorConfig::published() };
        assert_eq!(Evaluator::new(300, RATE_HZ, config).unwrap().n_bins(), last - first + 1);
        check(300, config);
    }
    check(300, EvaluatorConfig { band_hz: Some((0.0, 1e9)), ..EvaluatorConfig::published() });
    check(300, EvaluatorConfig { band_hz: Some((0.0, f64::MAX)), ..EvaluatorConfig::published() });
    check(300, EvaluatorConfig { band_hz: Some((1.0, 7.7)), frequency_decimation: 4, ..EvaluatorConfig::published() });
}

#[test]
fn the_bins_behind_a_result_reproduce_it() {
    let (target, measured) = pair(5000);
    for data_decimation in [1, 16] {
        let config = EvaluatorConfig { data_decimation, weight_power: 3, ..EvaluatorConfig::published() };
        let evaluator = Evaluator::new(5000, RATE_HZ, config).unwrap();
        let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
        let (tracking, spectra) = evaluator.evaluate_with_spectra(&mut evaluator.state(), &pair).unwrap();
        assert!((spectra.weights.iter().sum::<f64>() - 1.0).abs() < ROUND_OFF);
        let fei: Complex<f64> =
            spectra.measured.iter().zip(&spectra.target).zip(&spectra.weights).map(|((o, i), w)| o / i * *w).sum();
        assert!((fei - tracking.fei).norm() < ROUND_OFF);
        let n = 5000usize.next_power_of_two();
        let k = 7;
        let direct: Complex<f64> = target
            .iter()
            .enumerate()
            .map(|(i, v)| v * Complex::from_polar(1.0, -2.0 * PI * ((k * i) % n) as f64 / n as f64))
            .sum();
        assert!((spectra.target[k - 1] - direct).norm() < 1e-10 * direct.norm());
    }
}

#[test]
fn without_decimation_the_real_part_is_that_of_the_time_domain() {
    // Re FEI = (sum OI - sum O sum I / n + N_O N_I / n) / (sum I^2 - (sum I)^2 / n + N_I^2 / n), by Parseval.
    for len in [5, 128, 999] {
        let (target, measured) = pair(len);
        let n = len.next_power_of_two() as f64;
        let alternating = |x: &[f64]| x.iter().enumerate().map(|(i, v)| if i % 2 == 0 { *v } else { -v }).sum::<f64>();
        let product = |x: &[f64], y: &[f64]| {
            x.iter().zip(y).map(|(a, b)| a * b).sum::<f64>() - x.iter().sum::<f64>() * y.iter().sum::<f64>() / n
                + alternating(x) * alternating(y) / n
        };
        let expected = product(&measured, &target) / product(&target, &target);
        let evaluator = Evaluator::new(len, RATE_HZ, EvaluatorConfig::published()).unwrap();
        let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
        let found = evaluator.evaluate(&mut evaluator.state(), &pair).unwrap();
        assert!((found.fei.re - expected).abs() < ROUND_OFF * expected.abs(), "{len}: {} {expected}", found.fei.re);
    }
}

#[test]
fn moving_readings_are_those_of_their_windows_bit_for_bit() {
    let (target, measured) = pair(9000);
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    for (window, hop, data_decimation, shape) in [
        (4096, 16, 16, Window::Boxcar),
        (4100, 8, 64, Window::Boxcar),
        (2049, 7, 16, Window::Boxcar),
        (3000, 64, 8, Window::Hann),
        (500, 250, 1, Window::Boxcar),
    ] {
        let evaluator = EvaluatorConfig { data_decimation, window: shape, ..EvaluatorConfig::published() };
        let config = MovingConfig {
            window_s: window as f64 / RATE_HZ,
            hop_s: hop as f64 / RATE_HZ,
            evaluator,
            ..Default::default()
        };
        let moving = evaluate_moving(&pair, &config).unwrap();
        assert_eq!(moving.time_s.len(), (9000 - window) / hop + 1);
        let plan = Evaluator::new(window, RATE_HZ, evaluator).unwrap();
        let mut state = plan.state();
        for (i, start) in (0..=9000 - window).step_by(hop).enumerate() {
            let range = start..start + window;
            let alone = Pair::new(&target[range.clone()], &measured[range], RATE_HZ).unwrap();
            let expected = plan.evaluate(&mut state, &alone).unwrap();
            assert_eq!(moving.tracking[i].delay_s.to_bits(), expected.delay_s.to_bits(), "{window} {hop} reading {i}");
            assert_eq!(
                moving.tracking[i].amplitude.to_bits(),
                expected.amplitude.to_bits(),
                "{window} {hop} reading {i}"
            );
        }
    }
}

#[test]
fn what_cannot_be_judged_is_an_error_that_names_it() {
    let (target, measured) = pair(300);
    let config = EvaluatorConfig::published();
    let evaluate = |t: &[f64], m: &[f64], config| -> Result<_, Error> {
        let evaluator = Evaluator::new(t.len(), RATE_HZ, config)?;
        evaluator.evaluate(&mut evaluator.state(), &Pair::new(t, m, RATE_HZ)?)
    };
    let mut broken = measured.clone();
    (broken[17], broken[44]) = (f64::NAN, f64::INFINITY);
    for (t, m, part) in [
        (&target[..], &broken[..], "measured has 2 NaN or infinite samples (first at index 17)"),
        (&broken[..], &target[..], "target has 2 NaN or infinite samples (first at index 17)"),
        (&target[..3], &measured[..3], "3 samples are too few"),
        (&[2.5; 40][..], &measured[..40], "target is constant (2.5)"),
        (&target[..], &measured[..299], "measured has 299 samples but target has 300"),
    ] {
        let message = evaluate(t, m, config).unwrap_err().to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
    let sine: Vec<f64> = (0..256).map(|i| (2.0 * PI * 8.0 * f64::from(i) / 256.0).sin()).collect();
    for config in [
        EvaluatorConfig { band_hz: Some((20.0, 40.0)), ..config },
        EvaluatorConfig { frequency_decimation: 16, ..config },
    ] {
        assert_eq!(evaluate(&sine, &sine, config), Err(Error::NoEnergy), "only round-off is left in the kept bins");
    }
    for (config, part) in [
        (EvaluatorConfig { data_decimation: 3, ..config }, "data_decimation must be a power of two"),
        (EvaluatorConfig { frequency_decimation: 0, ..config }, "frequency_decimation must be a power of two"),
        (EvaluatorConfig { data_decimation: 64, frequency_decimation: 64, ..config }, "no frequency bin is left"),
        (EvaluatorConfig { band_hz: Some((3.0, 1.0)), ..config }, "band_hz must be"),
        (EvaluatorConfig { band_hz: Some((0.01, 0.02)), ..config }, "no frequency bin is left"),
        (EvaluatorConfig { band_hz: Some((1e300, f64::MAX)), ..config }, "no frequency bin is left"),
        (
            EvaluatorConfig { decimator: Decimator::Chebyshev, data_decimation: 512, ..config },
            "no frequency bin is left: P = 512",
        ),
        (EvaluatorConfig { weight_power: 0, ..config }, "weight_power must be"),
        (
            EvaluatorConfig { decimator: Decimator::Chebyshev, data_decimation: 3, ..config },
            "data_decimation must be a power of two",
        ),
    ] {
        let message = Evaluator::new(300, RATE_HZ, config).err().expect("impossible").to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn signals_of_any_scale_are_judged_alike_or_refused() {
    let (target, measured) = pair(300);
    let config = EvaluatorConfig::published();
    let evaluator = Evaluator::new(300, RATE_HZ, config).unwrap();
    let judge = |scale: f64| {
        let scaled = |x: &[f64]| -> Vec<f64> { x.iter().map(|v| v * scale).collect() };
        let (t, m) = (scaled(&target), scaled(&measured));
        evaluator.evaluate(&mut evaluator.state(), &Pair::new(&t, &m, RATE_HZ).unwrap())
    };
    let expected = judge(1.0).unwrap();
    for exponent in [-400, -100, -60, -3, 3, 60, 100, 400] {
        let found = judge(2f64.powi(exponent)).unwrap();
        assert_eq!(found.fei, expected.fei, "scaling by 2^{exponent} is exact");
    }
    for scale in [1e200, 1e-200, 1e-310] {
        assert!(matches!(judge(scale), Err(Error::Range { .. })), "{scale:e}");
    }
}
