//! P, Q and key frequencies against their definitions: evaluations at every pair of factors, sums written out term by term.

use std::f64::consts::PI;

use num_complex::Complex;
use rthstrack::factors::NEAR_ZERO_RAD;
use rthstrack::{
    Decimator, DelayMeasure, Detrend, Error, Evaluator, EvaluatorConfig, FactorsConfig, KeyFrequencies,
    KeyFrequenciesConfig, Pair, Tracking, Window, choose_factors, prior_bounds,
};

const RATE_HZ: f64 = 256.0;
/// Allowed beside a change that is known: round-off and what the cascade lets alias.
const ALLOWANCE: f64 = 1e-7;

/// A decaying response that measured follows `delay_s` late, with a fast ripple, a drift and some noise.
fn pair(n: usize, delay_s: f64) -> (Vec<f64>, Vec<f64>) {
    let mut seed = 7u64;
    let mut noise = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let signal = |t: f64| {
        let t = t.max(0.0);
        (-0.8 * t).exp() * (2.0 * PI * 2.1 * t).sin() + 0.02 * (2.0 * PI * 31.0 * t).sin() * (-t).exp() + 0.001 * t
    };
    (0..n)
        .map(|i| i as f64 / RATE_HZ)
        .map(|t| (signal(t) + 1e-3 * noise(), 1.1 * signal(t - delay_s) + 1e-3 * noise()))
        .unzip()
}

fn evaluate(pair: &Pair<'_>, config: EvaluatorConfig) -> Result<Tracking, Error> {
    let evaluator = Evaluator::new(pair.n_samples(), pair.rate_hz(), config)?;
    evaluator.evaluate(&mut evaluator.state(), pair)
}

fn choose(pair: &Pair<'_>, plan: EvaluatorConfig, config: FactorsConfig) -> Result<rthstrack::Factors, Error> {
    let evaluator = Evaluator::new(pair.n_samples(), pair.rate_hz(), plan)?;
    choose_factors(&evaluator, &mut evaluator.state(), pair, &config)
}

/// |A / A_1 - 1| and |d / d_1 - 1|, or |phi - phi_1| near zero, from two evaluations.
fn change(found: &Tracking, reference: &Tracking) -> (f64, f64) {
    let delay = if reference.phase_rad.abs() < NEAR_ZERO_RAD {
        (found.phase_rad - reference.phase_rad).abs()
    } else {
        (found.delay_s / reference.delay_s - 1.0).abs()
    };
    ((found.amplitude / reference.amplitude - 1.0).abs(), delay)
}

#[test]
fn every_change_is_that_of_an_evaluation_and_the_choice_is_the_largest_that_qualifies() {
    let plain = EvaluatorConfig::published();
    let mut chosen = Vec::new();
    for (n, delay_s, config) in [
        (5000, 0.012, plain),
        (4096, 0.0, plain),
        (1500, -0.02, EvaluatorConfig { window: Window::Hann, detrend: Some(Detrend::Linear), ..plain }),
        (3000, 0.012, EvaluatorConfig { weight_power: 3, ..plain }),
        (3000, 0.012, EvaluatorConfig { weight_power: 1, band_hz: Some((0.5, 40.0)), ..plain }),
    ] {
        let (target, measured) = pair(n, delay_s);
        let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
        let reference = evaluate(&pair, config).unwrap();
        for tolerance in [1e-4, 0.005, 0.05] {
            let found = choose(&pair, config, FactorsConfig { tolerance, ..Default::default() }).unwrap();
            let context = format!("{n} {delay_s} {config:?} {tolerance}");
            assert!((found.tracking.delay_s - reference.delay_s).abs() <= 1e-12 * reference.delay_s.abs(), "{context}");
            let near_zero = reference.phase_rad.abs() < NEAR_ZERO_RAD;
            assert_eq!(found.measure, if near_zero { DelayMeasure::Phase } else { DelayMeasure::Relative });
            let within = |p: usize, q: usize| {
                let at = EvaluatorConfig { data_decimation: p, frequency_decimation: q, ..config };
                evaluate(&pair, at).is_ok_and(|t| {
                    let (amplitude, delay) = change(&t, &reference);
                    amplitude <= tolerance && delay <= tolerance
                })
            };
            let mut best = (1, 1, 1);
            for entry in &found.table {
                let (p, q) = (entry.data_decimation, entry.frequency_decimation);
                let at = EvaluatorConfig { data_decimation: p, frequency_decimation: q, ..config };
                assert_eq!(entry.n_bins, Evaluator::new(n, RATE_HZ, at).unwrap().n_bins(), "{context} {p} {q}");
                match evaluate(&pair, at) {
                    Err(_) => assert!(entry.amplitude.is_infinite() && entry.delay.is_infinite()),
                    Ok(tracking) => {
                        let (amplitude, delay) = change(&tracking, &reference);
                        assert!(amplitude <= entry.amplitude && delay <= entry.delay, "{context} {p} {q}");
                        // Far from the response little energy is left, and the allowance is of all of it.
                        let close = |bound: f64, change: f64| bound - change <= ALLOWANCE * (1.0 + change);
                        let little = amplitude.max(delay) > 0.1 || p * q > 64;
                        assert!(little || close(entry.amplitude, amplitude), "{context} {p} {q}");
                        assert!(little || close(entry.delay, delay), "{context} {p} {q}");
                    }
                }
                let smaller = |factor: usize| (0..=factor.trailing_zeros()).map(|s| 1usize << s);
                if smaller(p).all(|p| smaller(q).all(|q| within(p, q))) {
                    best = best.max((p * q, q, p));
                }
            }
            assert_eq!((found.data_decimation, found.frequency_decimation), (best.2, best.1), "{context}");
            assert!(found.amplitude_bound <= tolerance && found.delay_bound <= tolerance, "{context}");
            chosen.push(best.0);
        }
    }
    assert!(chosen.contains(&1) || chosen.iter().min() < chosen.iter().max(), "the cases differ: {chosen:?}");
    assert!(chosen.iter().max() > Some(&16), "{chosen:?}");
}

#[test]
fn a_phase_at_half_a_turn_has_no_bound_and_nothing_larger_is_chosen() {
    let (target, _) = pair(3000, 0.0);
    let measured: Vec<f64> = target.iter().map(|x| -1.3 * x).collect();
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    for weight_power in [1, 2, 5] {
        let plan = EvaluatorConfig { weight_power, ..EvaluatorConfig::published() };
        let found = choose(&pair, plan, FactorsConfig { tolerance: 0.9, ..Default::default() }).unwrap();
        assert_eq!((found.data_decimation, found.frequency_decimation, found.delay_bound), (1, 1, 0.0));
        assert!(found.table[1..].iter().all(|entry| entry.delay.is_infinite()));
        assert!(found.table[1].amplitude < ALLOWANCE, "the amplitude is known: {:?}", found.table[1]);
    }
}

#[test]
fn a_given_factor_stays_and_the_other_is_counted_from_it() {
    let (target, measured) = pair(5000, 0.012);
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    let plain = EvaluatorConfig::published();
    for (p, q) in [(Some(8), None), (None, Some(4)), (Some(2), Some(2))] {
        let config = FactorsConfig { data_decimation: p, frequency_decimation: q, ..Default::default() };
        let found = choose(&pair, plain, config).unwrap();
        assert_eq!(found.reference, (p.unwrap_or(1), q.unwrap_or(1)));
        assert!(found.table.iter().all(|c| p.is_none_or(|p| p == c.data_decimation)));
        assert!(found.table.iter().all(|c| q.is_none_or(|q| q == c.frequency_decimation)));
        let at = |(p, q): (usize, usize)| {
            evaluate(&pair, EvaluatorConfig { data_decimation: p, frequency_decimation: q, ..plain }).unwrap()
        };
        let chosen = at((found.data_decimation, found.frequency_decimation));
        let (amplitude, delay) = change(&chosen, &at(found.reference));
        assert!(amplitude <= found.amplitude_bound && delay <= found.delay_bound);
        assert_eq!(found.table[0].amplitude, 0.0);
    }
}

#[test]
fn prior_bounds_are_safe() {
    let (target, measured) = pair(2000, 0.012);
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    for weight_power in [1, 2, 4] {
        let config = EvaluatorConfig { weight_power, ..EvaluatorConfig::published() };
        let evaluator = Evaluator::new(2000, RATE_HZ, config).unwrap();
        let mut state = evaluator.state();
        let bounds = prior_bounds(&evaluator, &mut state, &pair).unwrap();
        let table = choose_factors(&evaluator, &mut state, &pair, &FactorsConfig::default()).unwrap().table;
        let mut finite = 0;
        for bound in bounds.data.iter().chain(&bounds.frequency) {
            let same = |c: &&rthstrack::FactorChange| {
                (c.data_decimation, c.frequency_decimation) == (bound.data_decimation, bound.frequency_decimation)
            };
            let truth = table.iter().find(same).unwrap();
            assert_eq!(bound.n_bins, truth.n_bins);
            assert!(truth.amplitude <= bound.amplitude + ALLOWANCE && truth.delay <= bound.delay + ALLOWANCE);
            finite += usize::from(bound.delay.is_finite());
        }
        assert!(finite > 4, "some bounds say something");
        assert_eq!(bounds.data[0].amplitude, 0.0);
        assert_eq!(bounds.frequency[0].amplitude, 0.0);
    }
}

#[test]
fn what_cannot_be_chosen_is_an_error_that_names_it() {
    let (target, measured) = pair(600, 0.012);
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    let plain = EvaluatorConfig::published();
    for tolerance in [0.0, 1.0, -0.1, f64::NAN, f64::INFINITY] {
        let message = choose(&pair, plain, FactorsConfig { tolerance, ..Default::default() }).unwrap_err().to_string();
        assert!(message.starts_with("tolerance must be a number between 0 and 1"), "{message}");
    }
    let chebyshev = EvaluatorConfig { decimator: Decimator::Chebyshev, ..plain };
    assert_eq!(choose(&pair, chebyshev, FactorsConfig::default()), Err(Error::FactorsNeedSpectral));
    let given = |p, q| FactorsConfig { data_decimation: p, frequency_decimation: q, ..Default::default() };
    assert!(matches!(choose(&pair, plain, given(Some(3), None)), Err(Error::NotPowerOfTwo { found: 3, .. })));
    assert!(matches!(choose(&pair, plain, given(None, Some(2048))), Err(Error::NoBin { .. })));
    let own = EvaluatorConfig { data_decimation: 2, ..plain };
    assert!(matches!(
        choose(&pair, own, FactorsConfig::default()),
        Err(Error::Setting { name: "data_decimation", .. })
    ));
    let mut broken = measured.clone();
    broken[5] = f64::NAN;
    let broken = Pair::new(&target, &broken, RATE_HZ).unwrap();
    assert!(matches!(choose(&broken, plain, FactorsConfig::default()), Err(Error::NotFinite { .. })));
    // A sensor that reports nothing: nothing to compare, nothing is saved.
    let nothing = vec![0.0; 600];
    let found = choose(&Pair::new(&target, &nothing, RATE_HZ).unwrap(), plain, FactorsConfig::default()).unwrap();
    assert_eq!((found.data_decimation, found.frequency_decimation), (1, 1));
    assert_eq!((found.amplitude_bound, found.delay_bound), (0.0, 0.0));
}

/// Bin `k` of the zero-padded record, term by term.
fn bin(x: &[f64], k: usize) -> Complex<f64> {
    let n = x.len().next_power_of_two();
    let turn = |i: usize| Complex::from_polar(1.0, -2.0 * PI * ((k * i) % n) as f64 / n as f64);
    x.iter().enumerate().map(|(i, v)| v * turn(i)).sum()
}

#[test]
fn key_frequencies_are_the_fewest_that_hold_the_share_and_only_they_are_summed() {
    let plain = EvaluatorConfig::published();
    let mut directly = Vec::new();
    for (n, share, config) in [
        (700, 0.99, plain),
        (5000, 0.9, plain),
        (2500, 0.999, EvaluatorConfig { weight_power: 3, ..plain }),
        (2500, 0.95, EvaluatorConfig { weight_power: 1, band_hz: Some((1.0, 60.0)), ..plain }),
        (2500, 0.9, EvaluatorConfig { data_decimation: 4, frequency_decimation: 2, ..plain }),
        (5, 0.5, plain),
    ] {
        let context = format!("{n} {share} {config:?}");
        let (target, measured) = pair(n, 0.012);
        let evaluator = Evaluator::new(n, RATE_HZ, config).unwrap();
        let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
        let (_, spectra) = evaluator.evaluate_with_spectra(&mut evaluator.state(), &pair).unwrap();
        let key = KeyFrequencies::new(&target, RATE_HZ, KeyFrequenciesConfig { share, evaluator: config }).unwrap();
        let mut heaviest = spectra.weights.clone();
        heaviest.sort_by(|a, b| b.total_cmp(a));
        let frequencies = key.frequency_hz();
        let count = frequencies.len();
        assert!(heaviest[..count].iter().sum::<f64>() >= share, "{context}");
        assert!(heaviest[..count - 1].iter().sum::<f64>() < share, "{context}: one less would do");
        let held: f64 = frequencies
            .iter()
            .map(|f| spectra.weights[spectra.frequency_hz.iter().position(|g| g == f).expect("a kept bin")])
            .sum();
        assert!((held - key.share_held()).abs() < 1e-12, "{context}");

        let (mut cross, mut power, mut moment) = (Complex::new(0.0, 0.0), 0.0, 0.0);
        let delta_f = RATE_HZ / n.next_power_of_two() as f64;
        for f in &frequencies {
            let k = (f / delta_f).round() as usize;
            let (i, o) = (bin(&target, k), bin(&measured, k));
            let weight = i.norm().powi(config.weight_power as i32);
            cross += o / i * weight;
            power += weight;
            moment += f * weight;
        }
        let found = key.evaluate(&mut key.state(), &pair).unwrap();
        let fei = cross / power;
        assert!((found.fei - fei).norm() <= 1e-8 * fei.norm(), "{context}: {} {fei}", found.fei);
        assert!((found.equivalent_frequency_hz - moment / power).abs() <= 1e-8 * moment / power, "{context}");
        directly.push(key.is_direct());
    }
    assert!(directly.contains(&true) && directly.contains(&false), "both ways: {directly:?}");
}

#[test]
fn with_all_bins_key_frequencies_give_the_evaluation() {
    for window in [Window::Boxcar, Window::Hann] {
        for detrend in [Detrend::None, Detrend::Mean, Detrend::Linear] {
            let config = EvaluatorConfig { window, detrend: Some(detrend), ..EvaluatorConfig::published() };
            let (target, measured) = pair(900, 0.012);
            let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
            let key =
                KeyFrequencies::new(&target, RATE_HZ, KeyFrequenciesConfig { share: 1.0, evaluator: config }).unwrap();
            let (found, expected) = (key.evaluate(&mut key.state(), &pair).unwrap(), evaluate(&pair, config).unwrap());
            assert!((found.fei - expected.fei).norm() <= 1e-12 * expected.fei.norm(), "{config:?}");
        }
    }
}

#[test]
fn the_droop_of_the_cascade_is_made_good_at_single_bins() {
    let n = 16384;
    let tone = |k: usize, i: usize| (2.0 * PI * ((k * i) % n) as f64 / n as f64).sin();
    let target: Vec<f64> = (0..n).map(|i| tone(40, i) + tone(500, i)).collect();
    let measured: Vec<f64> = (0..n).map(|i| tone(40, i) + 2.0 * tone(500, i)).collect();
    let key = KeyFrequencies::new(&target, RATE_HZ, KeyFrequenciesConfig::default()).unwrap();
    assert!(key.is_direct() && key.frequency_hz().len() == 2);
    let pair = Pair::new(&target, &measured, RATE_HZ).unwrap();
    let found = key.evaluate(&mut key.state(), &pair).unwrap();
    assert!((found.fei - Complex::new(1.5, 0.0)).norm() < 1e-9, "{}", found.fei);
    assert!((found.equivalent_frequency_hz - 270.0 * RATE_HZ / n as f64).abs() < 1e-9);
}

#[test]
fn key_frequencies_of_a_first_window_serve_the_next() {
    let (target, measured) = pair(4096, 0.012);
    let config = KeyFrequenciesConfig { share: 0.99, evaluator: EvaluatorConfig::published() };
    let key = KeyFrequencies::new(&target[..1024], RATE_HZ, config).unwrap();
    let mut state = key.state();
    let next = Pair::new(&target[500..1524], &measured[500..1524], RATE_HZ).unwrap();
    let found = key.evaluate(&mut state, &next).unwrap();
    let anew = key.evaluate(&mut key.state(), &next).unwrap();
    let numbers = |t: &Tracking| (t.fei, t.equivalent_frequency_hz, t.delay_s);
    assert_eq!(numbers(&found), numbers(&anew), "a used state leaves nothing behind");
    assert!((found.delay_s - 0.012).abs() < 0.002);
    let whole = Pair::new(&target, &measured, RATE_HZ).unwrap();
    assert!(matches!(key.evaluate(&mut state, &whole), Err(Error::Plan { .. })));
}

#[test]
fn key_frequencies_that_cannot_be_are_errors() {
    let (target, _) = pair(600, 0.012);
    let plain = KeyFrequenciesConfig::default();
    for share in [0.0, -1.0, 1.001, f64::NAN] {
        let error = KeyFrequencies::new(&target, RATE_HZ, KeyFrequenciesConfig { share, ..plain }).err().unwrap();
        assert!(error.to_string().starts_with("share must be above 0 and at most 1, not "), "{error}");
    }
    let evaluator = EvaluatorConfig { decimator: Decimator::Chebyshev, ..plain.evaluator };
    let error = KeyFrequencies::new(&target, RATE_HZ, KeyFrequenciesConfig { evaluator, ..plain }).err();
    assert_eq!(error, Some(Error::KeyFrequenciesNeedSpectral));
    assert!(matches!(KeyFrequencies::new(&[1.0; 50], RATE_HZ, plain).err(), Some(Error::ConstantTarget { .. })));
    assert!(matches!(KeyFrequencies::new(&[1.0; 2], RATE_HZ, plain).err(), Some(Error::TooShort { .. })));
}
