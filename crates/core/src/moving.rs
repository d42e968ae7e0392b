//! The evaluation over moving windows: A(t), d(t), f_eq(t).

use crate::bad_samples::BadFound;
use crate::error::{Error, Result};
use crate::evaluator::Evaluator;
use crate::pair::{MIN_SAMPLES, Pair};
use crate::reason::Reason;
use crate::setting::concerns::{EVALUATION, MOVING};
use crate::setting::{Configuration, Kind};
use crate::settings::{Estimator, EvaluatorConfig};
use crate::tracking::Tracking;

crate::configuration! {
    /// The user's numbers for a moving evaluation.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct MovingConfig for EVALUATION => {
        /// Length of the window.
        window_s: f64 = 4.0, Kind::Positive, "s", "Moving windows", MOVING;
        /// From one window to the next.
        hop_s: f64 = 0.25, Kind::Positive, "s", "One moving window every", MOVING;
        /// A window is judged where the target's standard deviation in it is at least this share of the whole record's.
        minimum_std_ratio: f64 = 0.05, Kind::Share, "", "Least motion in a window", MOVING;
        with
        /// How each window is evaluated.
        evaluator: EvaluatorConfig = EvaluatorConfig::default();
    }
}

/// One entry a window. Where `valid` is false the target has too little energy to judge by, and the numbers are NaN.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MovingTracking {
    /// Centre of the window, in seconds from the first sample: (start + (W - 1) / 2) / rate.
    pub time_s: Vec<f64>,
    /// A (Eq 11a).
    pub amplitude: Vec<f64>,
    /// phi, in radians (Eq 11b).
    pub phase_rad: Vec<f64>,
    /// d, in seconds (Eq 10); positive when measured lags.
    pub delay_s: Vec<f64>,
    /// f_eq, in hertz (Eq 7).
    pub equivalent_frequency_hz: Vec<f64>,
    /// Standard deviation of A; NaN of `fei`.
    pub amplitude_std: Vec<f64>,
    /// 95 % interval of A.
    pub amplitude_interval: Vec<(f64, f64)>,
    /// Standard deviation of d, in seconds.
    pub delay_std_s: Vec<f64>,
    /// 95 % interval of d, in seconds.
    pub delay_interval_s: Vec<(f64, f64)>,
    /// Coherence of the residual with the target.
    pub residual_coherence: Vec<f64>,
    /// Share of measured that one gain and one delay explain.
    pub goodness: Vec<f64>,
    /// Standard deviation of the noise that is the target's own, where it was taken into account.
    pub target_noise: Vec<f64>,
    /// Bad samples of the whole record, which are left out.
    pub bad_samples: BadFound,
    /// Whether the window could be judged.
    pub valid: Vec<bool>,
    /// Why it could not, or why there is no interval.
    pub reason: Vec<Option<Reason>>,
}

/// Evaluates windows of round(window_s rate) samples that start at 0, H, 2 H, ... with H = round(hop_s rate), at least one.
///
/// Each reading of `fei` is that of [`Evaluator::evaluate`] on the window's samples alone; the estimators that shift the target
/// take what is outside the window from the record.
///
/// # Errors
/// [`Error::Setting`] for a window longer than the record or a hop or ratio out of range; [`Error::NotFinite`], [`Error::Range`]; whatever
/// [`Evaluator::new`] refuses for one window.
pub fn evaluate_moving(pair: &Pair<'_>, config: &MovingConfig) -> Result<MovingTracking> {
    if config.evaluator.estimator == Estimator::Fei {
        pair.check_samples()?
    } else {
        pair.check_fourth_powers()?
    };
    let (n, rate_hz) = (pair.n_samples(), pair.rate_hz());
    let window = samples_of("window_s", config.window_s, rate_hz, MIN_SAMPLES, n)?;
    let hop = samples_of("hop_s", config.hop_s, rate_hz, 1, usize::MAX)?;
    config.check_each()?;
    let ratio = config.minimum_std_ratio;
    let evaluator = Evaluator::new(window, rate_hz, config.evaluator)?;
    let mut moving = evaluator.moving(pair, hop);
    let variance = RunningVariance::new(pair.target());
    let least = ratio * ratio * variance.of(0, n);
    let starts = (0..n - window + 1).step_by(hop);
    let mut out = MovingTracking { bad_samples: moving.bad_samples(), ..MovingTracking::with_capacity(starts.len()) };
    for start in starts {
        let tracking = if variance.of(start, start + window) < least {
            Tracking::undetermined(Reason::Still)
        } else {
            match moving.at(start) {
                Ok(tracking) => tracking,
                Err(Error::NoEnergy | Error::ConstantTarget { .. }) => Tracking::undetermined(Reason::Still),
                Err(error) => return Err(error),
            }
        };
        out.push((start as f64 + (window - 1) as f64 / 2.0) / rate_hz, &tracking);
    }
    Ok(out)
}

impl MovingTracking {
    fn with_capacity(n: usize) -> Self {
        Self {
            time_s: Vec::with_capacity(n),
            amplitude: Vec::with_capacity(n),
            phase_rad: Vec::with_capacity(n),
            delay_s: Vec::with_capacity(n),
            equivalent_frequency_hz: Vec::with_capacity(n),
            amplitude_std: Vec::with_capacity(n),
            amplitude_interval: Vec::with_capacity(n),
            delay_std_s: Vec::with_capacity(n),
            delay_interval_s: Vec::with_capacity(n),
            residual_coherence: Vec::with_capacity(n),
            goodness: Vec::with_capacity(n),
            target_noise: Vec::with_capacity(n),
            bad_samples: BadFound::NONE,
            valid: Vec::with_capacity(n),
            reason: Vec::with_capacity(n),
        }
    }

    fn push(&mut self, time_s: f64, t: &Tracking) {
        self.time_s.push(time_s);
        self.amplitude.push(t.amplitude);
        self.phase_rad.push(t.phase_rad);
        self.delay_s.push(t.delay_s);
        self.equivalent_frequency_hz.push(t.equivalent_frequency_hz);
        self.amplitude_std.push(t.amplitude_std);
        self.amplitude_interval.push(t.amplitude_interval);
        self.delay_std_s.push(t.delay_std_s);
        self.delay_interval_s.push(t.delay_interval_s);
        self.residual_coherence.push(t.residual_coherence);
        self.goodness.push(t.goodness);
        self.target_noise.push(t.target_noise);
        self.valid.push(!t.reason.is_some_and(|r| r.is_undetermined()));
        self.reason.push(t.reason);
    }
}

/// A duration in whole samples within `least..=most`.
fn samples_of(name: &'static str, duration_s: f64, rate_hz: f64, least: usize, most: usize) -> Result<usize> {
    let samples = (duration_s * rate_hz).round();
    if !samples.is_finite() || samples < least as f64 || samples > most as f64 {
        let low = least as f64 / rate_hz;
        let expected = if most == usize::MAX {
            format!("at least {low} s ({least} sample)")
        } else {
            format!("from {low} s ({least} samples) to the record's {} s", most as f64 / rate_hz)
        };
        return Err(Error::Setting { name, expected, found: duration_s });
    }
    Ok(samples as usize)
}

/// Variance of any stretch from running sums, about the record's own mean so that an offset does not cancel digits.
struct RunningVariance {
    sums: Vec<(f64, f64)>,
}

impl RunningVariance {
    fn new(samples: &[f64]) -> Self {
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let mut total = (0.0, 0.0);
        let mut sums = Vec::with_capacity(samples.len() + 1);
        sums.push(total);
        for v in samples {
            let v = v - mean;
            total = (total.0 + v, total.1 + v * v);
            sums.push(total);
        }
        Self { sums }
    }

    fn of(&self, from: usize, to: usize) -> f64 {
        let n = (to - from) as f64;
        let (sum, squares) = (self.sums[to].0 - self.sums[from].0, self.sums[to].1 - self.sums[from].1);
        (squares / n - (sum / n) * (sum / n)).max(0.0)
    }
}
