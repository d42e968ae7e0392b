//! Evaluating and stepping allocate nothing: they run here under an allocator that counts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use rthstrack::dynamics::{
    Actuator, BoucWen, Compensation, Converter, Delay, Dynamics, Law, Motion, SampledActuator, ServoHydraulic,
};
use rthstrack::{
    Decimator, Detrend, Estimator, Evaluator, EvaluatorConfig, KeyFrequencies, KeyFrequenciesConfig, Monitor,
    MonitorConfig, Noise, Pair, Window,
};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

#[allow(unsafe_code)]
// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn evaluating_allocates_nothing() {
    let target: Vec<f64> = (0..20_000).map(|i| (f64::from(i) * 0.01).sin()).collect();
    let measured: Vec<f64> = (0..20_000).map(|i| (f64::from(i) * 0.01 - 0.05).sin()).collect();
    let pair = Pair::new(&target, &measured, 1000.0).unwrap();
    for config in [
        EvaluatorConfig::published(),
        EvaluatorConfig { data_decimation: 512, frequency_decimation: 2, ..EvaluatorConfig::published() },
        EvaluatorConfig {
            window: Window::Hann,
            detrend: Some(Detrend::Linear),
            weight_power: 3,
            ..EvaluatorConfig::published()
        },
        EvaluatorConfig { decimator: Decimator::Chebyshev, data_decimation: 8, ..EvaluatorConfig::published() },
        EvaluatorConfig { estimator: Estimator::Aligned, ..Default::default() },
        EvaluatorConfig { estimator: Estimator::LeastSquares, ..Default::default() },
        EvaluatorConfig {
            estimator: Estimator::LeastSquares,
            window: Window::Hann,
            band_hz: Some((0.1, 20.0)),
            ..Default::default()
        },
        EvaluatorConfig { estimator: Estimator::LeastSquares, noise: Noise::Coloured, ..Default::default() },
        EvaluatorConfig { estimator: Estimator::LeastSquares, noise_ratio: 1.0, ..Default::default() },
    ] {
        let evaluator = Evaluator::new(target.len(), 1000.0, config).unwrap();
        let mut state = evaluator.state();
        let before = COUNT.with(Cell::get);
        evaluator.evaluate(&mut state, &pair).unwrap();
        assert_eq!(COUNT.with(Cell::get), before, "{config:?}");
    }
    // A tone with many turns within reach, and a target with noise of its own.
    // The finaliser of SplitMix64, for numbers that are as good as white.
    let rough = |i: u64, k: u64| {
        let mut z = (i + k).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let tone = |t: f64| t.min(1.0) * (125.0 * t).sin();
    let (high, late): (Vec<f64>, Vec<f64>) =
        (0..20_000).map(|i| f64::from(i) / 1000.0).map(|t| (tone(t), tone(t - 0.012))).unzip();
    let noisy = |signal: &[f64], k| -> Vec<f64> { (0..).zip(signal).map(|(i, x)| x + 0.03 * rough(i, k)).collect() };
    let evaluator = Evaluator::new(
        target.len(),
        1000.0,
        EvaluatorConfig { estimator: Estimator::LeastSquares, detrend: Some(Detrend::Mean), ..Default::default() },
    )
    .unwrap();
    let mut state = evaluator.state();
    for (target, measured, own) in
        [(high.clone(), noisy(&late, 7919), false), (noisy(&target, 7907), noisy(&measured, 6007), true)]
    {
        let pair = Pair::new(&target, &measured, 1000.0).unwrap();
        let before = COUNT.with(Cell::get);
        let found = evaluator.evaluate(&mut state, &pair).unwrap();
        assert_eq!(COUNT.with(Cell::get), before, "{found:?}");
        assert_eq!(found.target_noise_std > 0.0, own, "{found:?}");
    }
    for (share, direct) in [(0.9, true), (0.99999, false)] {
        let evaluator = EvaluatorConfig::published();
        let key = KeyFrequencies::new(&target, 1000.0, KeyFrequenciesConfig { share, evaluator }).unwrap();
        assert_eq!(key.is_direct(), direct);
        let mut state = key.state();
        let before = COUNT.with(Cell::get);
        key.evaluate(&mut state, &pair).unwrap();
        assert_eq!(COUNT.with(Cell::get), before, "key frequencies");
    }
    let before = COUNT.with(Cell::get);
    drop(std::hint::black_box(vec![1.0f64]));
    assert_eq!(COUNT.with(Cell::get), before + 1, "the allocator does count");
}

#[test]
fn stepping_an_actuator_allocates_nothing() {
    let hysteresis = BoucWen {
        stiffness: 1e6,
        yield_displacement: 1e-3,
        post_yield_ratio: 0.01,
        beta: 0.55,
        gamma: 0.45,
        exponent: 2.0,
    };
    let actuator = |dynamics: Dynamics| Actuator {
        dof: 1,
        from_dof: 0,
        specimen: vec![Law::BoucWen(hysteresis), Law::Maxwell { stiffness: 1e6, damping: 1e4 }],
        specimen_mass: 29.13,
        part_of_structure: false,
        gain: 1.1,
        delay: Delay::Varying { time_s: vec![0.0, 1.0], delay_s: vec![0.001, 0.0034] },
        dynamics,
        compensation: Compensation::NONE,
        command_converter: Converter::default(),
        displacement_sensor: Converter::default(),
        force_sensor: Converter::default(),
        force_delay_samples: 0,
    };
    let lag = Dynamics::TransferFunction { numerator: vec![400.0], denominator: vec![1.0, 30.0, 400.0] };
    let plants = [
        Dynamics::None,
        Dynamics::FirstOrder { alpha: 29.0 },
        lag,
        Dynamics::ServoHydraulic(ServoHydraulic::default()),
    ];
    for dynamics in plants {
        let plan = SampledActuator::new(&actuator(dynamics.clone()), 1024.0).unwrap();
        let mut state = plan.state();
        let before = COUNT.with(Cell::get);
        for i in 0..2048 {
            let displacement = 0.01 * (f64::from(i) * 0.01).sin();
            let (motion, force) = plan.step(&mut state, Motion { displacement, ..Motion::default() });
            assert!(motion.displacement.is_finite() && force.is_finite(), "{dynamics:?}");
        }
        assert_eq!(COUNT.with(Cell::get), before, "{dynamics:?}");
    }
}

#[test]
fn monitoring_allocates_nothing() {
    for estimator in [Estimator::Fei, Estimator::LeastSquares, Estimator::Aligned] {
        for (data_decimation, window, band_hz) in
            [(1, Window::Boxcar, None), (8, Window::Boxcar, Some((0.0, 32.0))), (4, Window::Hann, Some((0.5, 30.0)))]
        {
            let config = MonitorConfig {
                window_s: 1.0,
                minimum_amplitude: 1e-3,
                n_actuators: 2,
                evaluator: EvaluatorConfig {
                    estimator,
                    data_decimation,
                    window,
                    band_hz,
                    ..MonitorConfig::default().evaluator
                },
                ..Default::default()
            };
            let monitor = Monitor::new(config).unwrap();
            let mut state = monitor.state();
            let (mut readings, mut valid) = (0, 0);
            let before = COUNT.with(Cell::get);
            for i in 0..8192 {
                let t = f64::from(i) / 1024.0;
                let motion = |t: f64| (17.0 * t).sin() + 0.3 * (51.0 * t).cos();
                // What goes wrong must not allocate either: gaps, infinities, a target that stands still, magnitudes.
                let (x, y) = match i {
                    2000 => (f64::NAN, f64::INFINITY),
                    3500..4800 => (1.0, 2.0),
                    5000 => (f64::MAX, -f64::MAX),
                    _ => (motion(t), 0.9 * motion(t - 0.01)),
                };
                if let Some(found) = monitor.step(&mut state, &[x, 2.0 * x], &[y, 1e200 * y]) {
                    readings += found.len();
                    valid += found.iter().filter(|r| r.is_valid()).count();
                }
                if i == 6000 {
                    monitor.restart(&mut state, 0);
                }
            }
            assert_eq!(COUNT.with(Cell::get), before, "{config:?}");
            assert!(valid > 0 && valid < readings, "{valid} of {readings}: {config:?}");
        }
    }
}
