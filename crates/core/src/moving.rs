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

/// One entry a window, in order of time. What has too little energy to judge by says so.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MovingTracking {
    /// Centre of the window, in seconds from the first sample: (start + (W - 1) / 2) / rate.
    pub time_s: Vec<f64>,
    /// The window's gain and delay.
    pub tracking: Vec<Tracking>,
    /// Bad samples of the whole record, which are left out.
    pub bad_samples: BadFound,
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
    let n_windows = starts.len();
    let mut out = MovingTracking {
        time_s: Vec::with_capacity(n_windows),
        tracking: Vec::with_capacity(n_windows),
        bad_samples: moving.bad_samples(),
    };
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
        out.time_s.push((start as f64 + (window - 1) as f64 / 2.0) / rate_hz);
        out.tracking.push(tracking);
    }
    Ok(out)
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
