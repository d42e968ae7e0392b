//! What a step of a virtual test costs: nanoseconds an internal step, signals stored, planning left out.
//!
//! Prints one JSON object; `benchmarks/bench.py` reports it. Medians of runs that take turns.

use std::hint::black_box;
use std::time::Instant;

use rthstrack::dynamics::{
    Actuator, BoucWen, Compensation, Converter, Damping, Delay, Dynamics, Law, Stepping, Structure, TestConfig,
    VirtualTest,
};

const RATE_HZ: f64 = 1024.0;
const N_SAMPLES: usize = 40 * 1024 + 1;

fn actuator(law: Law, gain: f64, delay_s: f64) -> Actuator {
    Actuator {
        dof: 1,
        from_dof: 0,
        specimen: vec![law],
        specimen_mass: 0.0,
        part_of_structure: true,
        gain,
        delay: Delay::Constant(delay_s),
        dynamics: Dynamics::None,
        compensation: Compensation::NONE,
        command_converter: Converter::default(),
        displacement_sensor: Converter::default(),
        force_sensor: Converter::default(),
        force_delay_samples: 0,
    }
}

fn test(structure: Structure, actuator: Actuator, stepping: Stepping) -> VirtualTest {
    // A tolerance that the second run meets: steps a sample are then known, 1 and 2.
    let config = TestConfig {
        structure,
        elements: Vec::new(),
        actuators: vec![actuator],
        stepping,
        rate_hz: RATE_HZ,
        tolerance: 0.1,
        bound_m: None,
    };
    VirtualTest::new(config).expect("a sound configuration")
}

fn bouc_wen(stiffness: f64) -> Law {
    Law::BoucWen(BoucWen {
        stiffness,
        yield_displacement: 0.01,
        post_yield_ratio: 0.01,
        beta: 0.55,
        gamma: 0.45,
        exponent: 2.0,
    })
}

fn main() {
    let k = 11.765e6;
    let sdof = |frequency: f64| {
        let omega = 2.0 * std::f64::consts::PI * frequency;
        Structure::sdof(frequency, 0.02, k / (omega * omega)).expect("a sound structure")
    };
    let storeys =
        Structure::shear_building(&[1e4; 10], &[2e7; 10], &Damping::Modal(vec![0.02])).expect("a sound building");
    let spring = Law::Spring { stiffness: k };
    let cases = [
        ("continuous_bouc_wen_sdof", test(sdof(1.0), actuator(bouc_wen(k), 1.1, 0.005), Stepping::Continuous)),
        ("continuous_linear_sdof", test(sdof(5.0), actuator(spring, 1.1, 0.001), Stepping::Continuous)),
        ("cr_linear_sdof", test(sdof(5.0), actuator(spring, 1.0, 0.0), Stepping::Cr)),
        ("cr_bouc_wen_sdof_delay", test(sdof(1.0), actuator(bouc_wen(k), 1.1, 0.005), Stepping::Cr)),
        ("cr_ten_storeys", test(storeys, actuator(Law::Spring { stiffness: 1e6 }, 1.0, 0.0), Stepping::Cr)),
    ];
    let ground: Vec<f64> = (0..N_SAMPLES)
        .map(|i| i as f64 / RATE_HZ)
        .map(|t| 2.0 * (7.0 * t).sin() * (-(t - 12.0) * (t - 12.0) / 50.0).exp())
        .collect();
    let mut times = vec![Vec::new(); cases.len()];
    let mut steps = vec![0; cases.len()];
    for _ in 0..15 {
        for (i, (_, test)) in cases.iter().enumerate() {
            let start = Instant::now();
            let run = black_box(test.run(black_box(&ground), &[]).expect("a stable loop"));
            times[i].push(start.elapsed().as_secs_f64());
            // `continuous` has run with half as many, too.
            let last = run.steps_per_sample;
            steps[i] = (N_SAMPLES - 1) * if last > 1 { last + last / 2 } else { 1 };
        }
    }
    let lines: Vec<String> = cases
        .iter()
        .zip(&mut times)
        .zip(&steps)
        .map(|(((name, _), times), steps)| {
            times.sort_by(f64::total_cmp);
            format!("\"{name}\": {:.2}", times[times.len() / 2] * 1e9 / *steps as f64)
        })
        .collect();
    println!("{{{}}}", lines.join(", "));
}
