//! What a fit leaves, and how precise that makes it.

use std::f64::consts::PI;

use num_complex::Complex;

use super::products::{Cross, Products};
use super::{Alignment, AlignmentState, Averaged, EXACT, Fit, HIGH_SHARE, Low, LowState, Signals};
use crate::noise::{
    Autoregression, Changes, Disturbance, Influence, KeptBins, NoisyTarget, Precision, Sampling, Spread,
};
use crate::reason::Reason;
use crate::sums;
use crate::tracking::Tracking;
use crate::weigh::centroid;

/// Least share of measured that must follow the target.
const MIN_GOODNESS: f64 = 0.1;

impl Alignment {
    /// The result of a fit whose signals stand in the state, with its precision; `averaged` where it is a weighted average.
    pub(super) fn finish(&self, state: &mut AlignmentState, fit: &Fit, averaged: Option<Averaged>) -> Tracking {
        let of_bins = (!self.in_time).then(|| self.goodness_in_bins(state, fit.gain));
        let left = self.leave_residual(state, fit);
        let goodness = fit.goodness.or(of_bins).unwrap_or(left);
        if goodness.is_nan() || goodness < MIN_GOODNESS {
            return Tracking::undetermined(Reason::LowCoherence { goodness });
        }
        let f_eq = match averaged {
            Some(averaged) => averaged.equivalent_frequency_hz,
            None => self.equivalent_frequency_hz(state),
        };
        let delay_s = fit.tau / self.rate_hz;
        let phase_rad = 0.0 - 2.0 * PI * f_eq * delay_s;
        let tracking = Tracking {
            fei: Complex::from_polar(fit.gain, phase_rad),
            amplitude: fit.gain,
            phase_rad,
            delay_s,
            equivalent_frequency_hz: f_eq,
            goodness,
            reason: None,
            ..Tracking::undetermined(Reason::Still)
        };
        let exact = 1.0 - left <= EXACT;
        match self.precision(state, fit, averaged, exact) {
            None => tracking.without_interval(Reason::FewBins),
            Some(precision) => self.with_precision(tracking, &precision, exact),
        }
    }

    /// How precise a fit is whose target and residual stand in the state.
    fn precision(
        &self,
        state: &mut AlignmentState,
        fit: &Fit,
        averaged: Option<Averaged>,
        exact: bool,
    ) -> Option<Precision> {
        let within = state.support.within.clone();
        let (window_power, fourths) = self.window_moments(&within);
        let AlignmentState {
            signals: Signals { measured, shifted, slope }, bins, scratch, low, spread, weighting, ..
        } = state;
        let slow = |low: &Low| {
            let share = 2.0 * (PI / (8 * low.grid.step) as f64).sin();
            let velocity = &slope[within.clone()];
            sums::step_energy(velocity) <= HIGH_SHARE * share * share * sums::energy(velocity)
        };
        let mut lowered = match (&self.low, low) {
            (Some(plan), Some(state)) if plan.always || slow(plan) => Some((plan, state)),
            _ => None,
        };
        let window = match &lowered {
            Some((plan, _)) => plan.window.as_deref(),
            None => self.window.as_deref(),
        };
        let (grid, scratch, judged, [e, y, v]) = match &mut lowered {
            Some((plan, LowState { scratch, fewer })) => {
                for (signal, fewer) in [&*measured, &*shifted, &*slope].into_iter().zip(&mut *fewer) {
                    plan.grid.shorten(signal, fewer);
                }
                (&plan.grid, scratch, plan.grid.shortened(&within), fewer.each_mut().map(|a| a.as_mut_slice()))
            }
            None => (&self.kept, scratch, within.clone(), [&mut measured[..], &mut shifted[..], &mut slope[..]]),
        };
        let folded = grid.folded_len();
        // Sums over samples are 2 / n times those over bins.
        let to_bins = if self.in_time { 0.5 * folded } else { 1.0 };
        let influence = match averaged {
            // The parts of the noise in phase with the target and a quarter turn from it are independent.
            Some(Averaged { power, slope, growth, .. }) => Influence {
                gain: [(1.0 + (growth / slope).powi(2)).sqrt() / power, 0.0],
                delay: [1.0 / (power * fit.gain * slope), 0.0],
                leverage: [2.0 / power, 0.0, 0.0],
            },
            None => {
                let Products { yy, yv, vv, .. } = fit.clean;
                let determinant = (yy * vv - yv * yv) * to_bins;
                Influence {
                    gain: [vv / determinant, -yv / determinant],
                    delay: [yv / determinant / fit.gain, -yy / determinant / fit.gain],
                    leverage: [vv / determinant, -yv / determinant, yy / determinant],
                }
            }
        };
        let noise = Autoregression::fit(&e[judged.clone()], window_power * window_power / fourths / grid.step as f64);
        let changes = if exact {
            Changes::NONE
        } else {
            let window = window.map(|w| &w[judged.clone()]);
            // Of sums over samples; the influence is that of sums over bins.
            let scale = if self.in_time { (to_bins * grid.step as f64).powi(2) } else { 0.0 };
            Changes::of(&noise, [&e[judged.clone()], &y[judged.clone()], &v[judged.clone()]], window, &influence, scale)
        };
        let spectrum = &grid.spectrum;
        let [yk, vk, ek] = bins.each_mut().map(|b| &mut b[..spectrum.packed_len()]);
        spectrum.transform_one(scratch, e, None, ek);
        // The estimate is a sum over w (w y), so the noise is seen through the window twice; where the record is folded upon
        // itself, what is summed is w y over noise of the mean of w^2.
        let folded_up = folded < within.len() as f64;
        // What the fit, or the equivalent frequency, has transformed already.
        let of_kept = std::ptr::eq(grid, &self.kept);
        let stand = [of_kept, of_kept && !self.in_time && averaged.is_none()];
        for ((signal, bins), stands) in [(&mut *y, &mut *yk), (&mut *v, &mut *vk)].into_iter().zip(stand) {
            let tapered = window.filter(|_| !folded_up);
            if let Some(window) = tapered {
                sums::multiply(signal, window);
                // The mean, or line, that is taken from measured before the window lets through what is far from the target.
                if let Some(line) = self.detrend.line(&signal[judged.clone()]) {
                    line.subtract_from(&mut signal[judged.clone()]);
                }
            }
            if !stands || tapered.is_some() {
                spectrum.transform_one(scratch, signal, None, bins);
            }
        }
        let sampling = Sampling {
            window_power,
            bins_per_piece: (folded * fourths / (window_power * window_power)).max(1.0),
            scale: 0.5 * if folded_up { window_power } else { folded },
        };
        let target = if self.noise_ratio > 0.0 {
            let share = fit.gain / (self.noise_ratio.powi(-2) + fit.gain * fit.gain);
            Some(NoisyTarget { weights: Some(&weighting.weights), share })
        } else {
            let share = fit.gain * (fit.noise / fit.residual).min(1.0 / (fit.gain * fit.gain));
            (fit.noise > 0.0).then_some(NoisyTarget { weights: None, share })
        };
        let kept = KeptBins { first: spectrum.first(), cosines: &grid.cosines, correction: grid.correction.as_deref() };
        let noise = Disturbance { autoregression: noise, changes, target };
        let mut spread = Spread::new(spread, kept, noise, influence, sampling);
        spectrum.visit_pair([yk, vk], &mut spread);
        spread.residual_next();
        spectrum.visit_pair([yk, ek], &mut spread);
        if self.in_time {
            // At zero frequency there is no bin, but there may be much of the target.
            let zero = |x: &[f64]| grid.step as f64 * sums::sum(x);
            spread.zero_frequency(zero(y), zero(v), zero(e));
        }
        spread.precision(within.len())
    }

    fn with_precision(&self, mut tracking: Tracking, precision: &Precision, exact: bool) -> Tracking {
        tracking.residual_coherence = precision.coherence;
        if precision.coherent && !exact {
            return tracking.without_interval(Reason::ResidualFollowsTarget { coherence: precision.coherence });
        }
        let Precision { gain_std, gain_reach, delay_std, delay_reach, .. } = *precision;
        let (delay_std, delay_reach) = (delay_std / self.rate_hz, delay_reach / self.rate_hz);
        if ![gain_std, gain_reach, delay_std, delay_reach].iter().all(|v| v.is_finite()) {
            return tracking.without_interval(Reason::FewBins);
        }
        // Wider than half a turn says nothing of the delay.
        if delay_reach * tracking.equivalent_frequency_hz >= 0.25 {
            return Tracking::undetermined(Reason::Uncertain { reach_s: delay_reach });
        }
        tracking.amplitude_std = gain_std;
        tracking.amplitude_interval = (tracking.amplitude - gain_reach, tracking.amplitude + gain_reach);
        tracking.delay_std_s = delay_std;
        tracking.delay_interval_s = (tracking.delay_s - delay_reach, tracking.delay_s + delay_reach);
        tracking
    }

    /// The share of measured's energy at the kept bins that the fit explains; its transform still stands in the state.
    fn goodness_in_bins(&self, state: &AlignmentState, gain: f64) -> f64 {
        let [y, _, o] = &state.bins;
        let correction = self.kept.correction.as_deref();
        let mut cross = Cross { correction, first: self.kept.spectrum.first(), ..Cross::default() };
        self.kept.spectrum.visit_pair([y, o], &mut cross);
        let (yy, oy, oo) = cross.totals();
        if oo > 0.0 { 1.0 - (oo - 2.0 * gain * oy + gain * gain * yy) / oo } else { f64::NAN }
    }

    /// Eq 7 of the shifted target that stands in the state.
    fn equivalent_frequency_hz(&self, state: &mut AlignmentState) -> f64 {
        let AlignmentState { signals, bins: [y, ..], scratch, weighting, .. } = state;
        if self.in_time {
            self.kept.spectrum.transform_one(scratch, &signals.shifted, None, y);
        }
        let (power, moment) = centroid(&self.kept.spectrum, self.factors(weighting), y);
        moment / power * self.kept.spectrum.delta_f_hz()
    }

    /// The autoregression of the residual that stands in measured's place.
    pub(super) fn autoregression(&self, state: &AlignmentState) -> Autoregression {
        let within = state.support.within.clone();
        let (squares, fourths) = self.window_moments(&within);
        Autoregression::fit(&state.signals.measured[within], squares * squares / fourths)
    }

    /// measured becomes measured less the fit; returns which share of it the fit explains, 1 - sum e^2 / sum (o - mean)^2.
    pub(super) fn leave_residual(&self, state: &mut AlignmentState, fit: &Fit) -> f64 {
        let within = state.support.within.clone();
        let Signals { measured, shifted, slope } = &mut state.signals;
        let measured = &mut measured[within.clone()];
        let total = sums::sum(measured);
        let spread = sums::energy(measured) - total * total / measured.len() as f64;
        let (gain, step) = (fit.gain, fit.step);
        sums::subtract(measured, (gain, &shifted[within.clone()]), (-gain * step, &slope[within]));
        if spread > 0.0 { 1.0 - sums::energy(measured) / spread } else { f64::NAN }
    }
}
