//! The time-domain indices in use beside the frequency-domain evaluation.

use num_complex::Complex;
use rustfft::FftPlanner;

use crate::error::{Error, Result, Signal};
use crate::pair::{Pair, check_finite, peak};

/// The indices, a row each: name and type, which is optional where an index is not always there.
macro_rules! indices {
    ($($(#[$doc:meta])* $name:ident: $type:ty;)+) => {
        /// One number each for the whole record. I is the target, O the measured displacement.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Indices {
            $($(#[$doc])* pub $name: $type),+
        }

        impl Indices {
            /// Each with its name.
            pub fn named(&self) -> impl Iterator<Item = (&'static str, Option<f64>)> {
                [$((stringify!($name), self.$name.into())),+].into_iter()
            }
        }
    };
}

indices! {
    /// MTE = max |O - I|, in the signals' unit.
    max_tracking_error: f64;
    /// 100 max |O - I| / max |I|.
    max_tracking_error_percent: f64;
    /// RMS = sqrt(mean (O - I)^2), in the signals' unit.
    rms_error: f64;
    /// 100 RMS / sqrt(mean I^2).
    rms_error_percent: f64;
    /// TI at the end of the record, in unit^2 (Mercan 2007, sign so that it rises on lag); see [`index_histories`].
    tracking_indicator: f64;
    /// J1 of the RTHS benchmark: lag of the correlation peak in whole samples, in seconds; positive when measured lags.
    j1_s: f64;
    /// J2 = 100 std(O - I) / std(I).
    j2_percent: f64;
    /// J3 = 100 max |O - I| / max |I|.
    j3_percent: f64;
    /// Work of the measured force over measured minus over target displacement; `None` without the force.
    energy_error: Option<f64>;
}

/// The indices that are histories, at every sample.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexHistories {
    /// max |O - I| so far.
    pub max_tracking_error: Vec<f64>,
    /// sqrt(mean (O - I)^2) so far.
    pub rms_error: Vec<f64>,
    /// TI so far.
    pub tracking_indicator: Vec<f64>,
    /// Energy error so far; `None` without the force.
    pub energy_error: Option<Vec<f64>>,
}

/// Running indices.
///
/// ```text
/// TI = (A - TA) / 2,  A_(i+1) = A_i + (I_(i+1) + I_i)(O_(i+1) - O_i) / 2,  TA the same with I and O exchanged
/// EE = E_O - E_I,     E_O,(i+1) = E_O,i + (F_(i+1) + F_i)(O_(i+1) - O_i) / 2,  E_I the same over I
/// ```
///
/// Lag makes TI positive.
///
/// # Errors
/// [`Error::NotFinite`], [`Error::Range`]; [`Error::Length`] for a force of another length.
pub fn index_histories(pair: &Pair<'_>, force: Option<&[f64]>) -> Result<IndexHistories> {
    pair.check_samples()?;
    let (target, measured) = (pair.target(), pair.measured());
    let n = target.len();
    if let Some(force) = force {
        if force.len() != n {
            return Err(Error::Length { signal: Signal::Force, expected: n, found: force.len() });
        }
        check_finite(force, Signal::Force)?;
    }
    let mut histories = IndexHistories {
        max_tracking_error: Vec::with_capacity(n),
        rms_error: Vec::with_capacity(n),
        tracking_indicator: Vec::with_capacity(n),
        energy_error: force.map(|_| Vec::with_capacity(n)),
    };
    let (mut largest, mut squares, mut indicator, mut energy) = (0.0f64, 0.0, 0.0, 0.0);
    for i in 0..n {
        let error = measured[i] - target[i];
        largest = largest.max(error.abs());
        squares += error * error;
        if i > 0 {
            let (dt, dm) = (target[i] - target[i - 1], measured[i] - measured[i - 1]);
            indicator += ((target[i] + target[i - 1]) * dm - (measured[i] + measured[i - 1]) * dt) / 4.0;
            if let Some(force) = force {
                energy += (force[i] + force[i - 1]) / 2.0 * (dm - dt);
            }
        }
        histories.max_tracking_error.push(largest);
        histories.rms_error.push((squares / (i + 1) as f64).sqrt());
        histories.tracking_indicator.push(indicator);
        if let Some(history) = &mut histories.energy_error {
            history.push(energy);
        }
    }
    Ok(histories)
}

/// The indices of the whole record; J1 is searched within +-`max_lag_s` (and half the record).
///
/// J1 = dt argmax_k corr(O_k.., I_..N-k) with Pearson's correlation over the overlap; the RTHS benchmark searches k = 0 .. 49
/// only, here leads are found too.
///
/// # Errors
/// Those of [`index_histories`]; [`Error::Setting`] for a `max_lag_s` that is not a positive duration.
pub fn indices(pair: &Pair<'_>, force: Option<&[f64]>, max_lag_s: f64) -> Result<Indices> {
    if !(max_lag_s.is_finite() && max_lag_s > 0.0) {
        let expected = "a positive duration in seconds".to_owned();
        return Err(Error::Setting { name: "max_lag_s", expected, found: max_lag_s });
    }
    let histories = index_histories(pair, force)?;
    let (target, measured) = (pair.target(), pair.measured());
    let last = |history: &[f64]| history[history.len() - 1];
    let errors: Vec<f64> = measured.iter().zip(target).map(|(m, t)| m - t).collect();
    let peak = peak(target);
    let max_tracking_error = last(&histories.max_tracking_error);
    let rms_error = last(&histories.rms_error);
    let relative_peak = 100.0 * max_tracking_error / peak;
    Ok(Indices {
        max_tracking_error,
        max_tracking_error_percent: relative_peak,
        rms_error,
        rms_error_percent: 100.0 * rms_error / mean(target.iter().map(|v| v * v)).sqrt(),
        tracking_indicator: last(&histories.tracking_indicator),
        j1_s: correlation_lag(target, measured, max_lag_s * pair.rate_hz()) as f64 / pair.rate_hz(),
        j2_percent: 100.0 * (variance(&errors) / variance(target)).sqrt(),
        j3_percent: relative_peak,
        energy_error: histories.energy_error.as_deref().map(last),
    })
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

fn variance(values: &[f64]) -> f64 {
    let centre = mean(values.iter().copied());
    mean(values.iter().map(|v| (v - centre) * (v - centre)))
}

/// Share of the whole record's energy below which running sums cannot tell a stretch from a constant one.
const ROUND_OFF_SHARE: f64 = 1e-12;

/// Lag, in samples, of the highest Pearson correlation between measured[k:] and target[:N-k]; the smaller lag of equals.
fn correlation_lag(target: &[f64], measured: &[f64], max_lag: f64) -> isize {
    let n = target.len();
    let most = (max_lag.round() as usize).min(n / 2);
    let centred = |x: &[f64]| -> Vec<f64> {
        let centre = mean(x.iter().copied());
        x.iter().map(|v| v - centre).collect()
    };
    let (x, y) = (centred(target), centred(measured));
    // Circular correlation of both at once: z = x + j y, padded so that no lag of interest wraps.
    let len = (n + most + 1).next_power_of_two();
    let mut planner = FftPlanner::new();
    let mut z: Vec<Complex<f64>> = x.iter().zip(&y).map(|(&re, &im)| Complex::new(re, im)).collect();
    z.resize(len, Complex::new(0.0, 0.0));
    planner.plan_fft_forward(len).process(&mut z);
    let mut cross: Vec<Complex<f64>> = (0..len)
        .map(|k| {
            let (a, b) = (z[k], z[(len - k) % len].conj());
            let (target, measured) = ((a + b) * 0.5, (a - b) * Complex::new(0.0, -0.5));
            target.conj() * measured
        })
        .collect();
    planner.plan_fft_inverse(len).process(&mut cross);
    let running = |x: &[f64]| -> Vec<(f64, f64)> {
        let mut sums = vec![(0.0, 0.0)];
        sums.extend(x.iter().scan((0.0, 0.0), |total, v| {
            *total = (total.0 + v, total.1 + v * v);
            Some(*total)
        }));
        sums
    };
    let (sums_x, sums_y) = (running(&x), running(&y));
    let stretch = |sums: &[(f64, f64)], from: usize, to: usize| (sums[to].0 - sums[from].0, sums[to].1 - sums[from].1);
    let (round_off_x, round_off_y) = (ROUND_OFF_SHARE * sums_x[n].1, ROUND_OFF_SHARE * sums_y[n].1);
    let correlation = |lag: isize| -> f64 {
        let shift = lag.unsigned_abs();
        let overlap = (n - shift) as f64;
        let (from_x, from_y) = if lag >= 0 { (0, shift) } else { (shift, 0) };
        let (sx, sxx) = stretch(&sums_x, from_x, from_x + n - shift);
        let (sy, syy) = stretch(&sums_y, from_y, from_y + n - shift);
        let sxy = cross[lag.rem_euclid(len as isize) as usize].re / len as f64;
        let (spread_x, spread_y) = (sxx - sx * sx / overlap, syy - sy * sy / overlap);
        // What is constant over the overlap correlates with nothing; the running sums leave only their round-off of it.
        if spread_x <= round_off_x || spread_y <= round_off_y {
            return f64::NEG_INFINITY;
        }
        (sxy - sx * sy / overlap) / (spread_x.sqrt() * spread_y.sqrt())
    };
    let mut best = (correlation(0), 0);
    for lag in (1..=most as isize).flat_map(|k| [k, -k]) {
        let c = correlation(lag);
        if c > best.0 {
            best = (c, lag);
        }
    }
    best.1
}
