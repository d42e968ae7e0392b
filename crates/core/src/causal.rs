//! P, sample by sample: a linear-phase low-pass and every P-th of its outputs.
//!
//! ```text
//! y_m = sum_j h_j x_(m P + 16 P - j),   j = 0 .. 16 P,   h = Kaiser window x sinc(j / P - 8) / P,   sum h = 1
//! ```
//!
//! y_m speaks for sample m P + 8 P: the delay is 8 P samples, 8 outputs, at every frequency. Up to rate / (4 P) the gain is 1 within 2e-6 and what
//! aliases is below 1.2e-6 of what it was; rate / (4 P) to rate / (2 P) is half pass, half alias, so it is no place for a band. No output is given
//! before all its samples are there: nothing is made up before the first sample, and nothing stays behind of any sample once
//! it has left the filter.

use std::f64::consts::PI;

use pulp::{Arch, Simd, WithSimd};

use crate::error::{Error, Result};

/// Taps per P, and one: half of them on either side of the middle.
const REACH: usize = 16;
/// Shape of the Kaiser window, for a transition of rate / (2 P).
const BETA: f64 = 12.5;

/// The checked plan of one P.
#[derive(Debug, Clone)]
pub struct CausalDecimator {
    factor: usize,
    taps: Vec<f64>,
    arch: Arch,
}

/// The latest samples of one signal.
#[derive(Debug, Clone)]
pub struct CausalState {
    samples: Ring,
    /// Samples until the next output.
    wait: usize,
}

impl CausalDecimator {
    /// Plans the decimation by `factor`; 1 passes every sample on as it is.
    ///
    /// # Errors
    /// [`Error::NotPowerOfTwo`].
    pub fn new(factor: usize) -> Result<Self> {
        if !factor.is_power_of_two() {
            return Err(Error::NotPowerOfTwo { name: "data_decimation", found: factor });
        }
        let taps = if factor == 1 { vec![1.0] } else { taps(factor) };
        Ok(Self { factor, taps, arch: Arch::new() })
    }

    /// The same rate from the taps of twice the factor: what is above rate / (4 P) is gone, rate / (8 P) and below passes.
    pub(crate) fn oversampled(factor: usize) -> Self {
        Self { factor, taps: taps(2 * factor), arch: Arch::new() }
    }

    /// P.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// From the sample that an output speaks for to the one that brings it, in samples.
    pub fn delay(&self) -> usize {
        self.taps.len() / 2
    }

    /// Nothing seen yet.
    pub fn state(&self) -> CausalState {
        CausalState { samples: Ring::new(self.taps.len()), wait: self.taps.len() }
    }

    /// Takes one sample; an output with every P-th, from the first on for which the filter is full.
    #[inline]
    pub fn step(&self, state: &mut CausalState, sample: f64) -> Option<f64> {
        state.samples.push(sample);
        state.wait -= 1;
        if state.wait > 0 {
            return None;
        }
        state.wait = self.factor;
        if self.factor == 1 {
            return Some(sample);
        }
        Some(self.arch.dispatch(Dot { taps: &self.taps, samples: state.samples.last(self.taps.len()) }))
    }

    /// out[m] from the samples from m P on: it speaks for sample m P + [`CausalDecimator::delay`].
    pub(crate) fn block(&self, samples: &[f64], out: &mut [f64]) {
        for (m, y) in out.iter_mut().enumerate() {
            let at = m * self.factor;
            *y = self.arch.dispatch(Dot { taps: &self.taps, samples: &samples[at..at + self.taps.len()] });
        }
    }

    /// What it makes of white noise of variance 1: its variance, and how it correlates from one output to the next ones.
    pub(crate) fn of_white_noise<const N: usize>(&self) -> (f64, [f64; N]) {
        let product = |l: usize| -> f64 {
            let later = self.taps.iter().skip(l * self.factor);
            self.taps.iter().zip(later).map(|(a, b)| a * b).sum()
        };
        let variance = product(0);
        (variance, std::array::from_fn(|l| product(l) / variance))
    }

    /// All outputs of a record: output m speaks for sample m P + [`CausalDecimator::delay`].
    pub fn process(&self, samples: &[f64]) -> Vec<f64> {
        let mut state = self.state();
        samples.iter().filter_map(|x| self.step(&mut state, *x)).collect()
    }
}

impl CausalState {
    /// Samples until the next output, the one that brings it included.
    pub(crate) fn wait(&self) -> usize {
        self.wait
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.samples.clear();
        self.wait = self.samples.capacity();
    }
}

/// h_j, j = 0 .. 16 P, whose sum is one.
fn taps(factor: usize) -> Vec<f64> {
    let half = (REACH / 2 * factor) as f64;
    let tap = |j: usize| {
        let x = j as f64 - half;
        let angle = PI * x / factor as f64;
        let sinc = if x == 0.0 { 1.0 } else { angle.sin() / angle };
        sinc * bessel(BETA * (1.0 - (x / half) * (x / half)).max(0.0).sqrt())
    };
    let taps: Vec<f64> = (0..=REACH * factor).map(tap).collect();
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|h| h / sum).collect()
}

/// The modified Bessel function of the first kind of order zero, by its series.
fn bessel(x: f64) -> f64 {
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..64 {
        term *= (x / (2 * k) as f64).powi(2);
        sum += term;
    }
    sum
}

/// sum_j h_j x_j (h is symmetric), compiled for the processor at hand.
struct Dot<'a> {
    taps: &'a [f64],
    samples: &'a [f64],
}

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (taps, taps_rest) = S::as_simd_f64s(self.taps);
        let (samples, samples_rest) = S::as_simd_f64s(self.samples);
        let mut lanes = [simd.splat_f64s(0.0); 4];
        for (taps, samples) in taps.chunks(4).zip(samples.chunks(4)) {
            for ((lane, h), x) in lanes.iter_mut().zip(taps).zip(samples) {
                *lane = simd.mul_add_e_f64s(*h, *x, *lane);
            }
        }
        let sum = simd.add_f64s(simd.add_f64s(lanes[0], lanes[1]), simd.add_f64s(lanes[2], lanes[3]));
        let rest: f64 = taps_rest.iter().zip(samples_rest).map(|(h, x)| h * x).sum();
        simd.reduce_sum_f64s(sum) + rest
    }
}

/// The latest samples, always in one piece: each is written twice.
#[derive(Debug, Clone)]
pub(crate) struct Ring {
    samples: Vec<f64>,
    /// Where the next sample goes, below the capacity.
    next: usize,
    filled: usize,
}

impl Ring {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { samples: vec![0.0; 2 * capacity], next: 0, filled: 0 }
    }

    pub(crate) fn capacity(&self) -> usize {
        self.samples.len() / 2
    }

    /// How many samples are held.
    pub(crate) fn len(&self) -> usize {
        self.filled
    }

    #[inline]
    pub(crate) fn push(&mut self, sample: f64) {
        let capacity = self.capacity();
        self.samples[self.next] = sample;
        self.samples[self.next + capacity] = sample;
        self.next = if self.next + 1 == capacity { 0 } else { self.next + 1 };
        self.filled = (self.filled + 1).min(capacity);
    }

    /// The latest `n` samples, oldest first; `n` is at most [`Ring::len`].
    #[inline]
    pub(crate) fn last(&self, n: usize) -> &[f64] {
        let end = self.next + self.capacity();
        &self.samples[end - n..end]
    }

    pub(crate) fn clear(&mut self) {
        self.next = 0;
        self.filled = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |sum_j h_j exp(-2 pi i f j)|, f in cycles a sample.
    fn gain(taps: &[f64], f: f64) -> f64 {
        let (re, im) = taps.iter().enumerate().fold((0.0, 0.0), |(re, im), (j, h)| {
            let angle = 2.0 * PI * f * j as f64;
            (re + h * angle.cos(), im - h * angle.sin())
        });
        re.hypot(im)
    }

    #[test]
    fn a_quarter_of_the_new_rate_passes_and_what_aliases_onto_it_does_not() {
        for factor in [2, 4, 8, 32, 128] {
            let plan = CausalDecimator::new(factor).unwrap();
            let of_new_rate = |x: f64| gain(&plan.taps, x / factor as f64);
            for i in 0..=50 {
                let f = 0.25 * f64::from(i) / 50.0;
                assert!((of_new_rate(f) - 1.0).abs() < 2e-6, "P {factor}, {f}: {}", of_new_rate(f));
                for m in 1..=factor / 2 {
                    for alias in [m as f64 - f, m as f64 + f] {
                        let passed = of_new_rate(alias);
                        assert!(alias * 2.0 > factor as f64 || passed < 1.2e-6, "P {factor}, {alias}: {passed}");
                    }
                }
            }
        }
    }

    #[test]
    fn outputs_are_the_convolution_at_every_pth_sample_from_the_first_full_one_on() {
        let x: Vec<f64> = (0..1000).map(|i| (f64::from(i) * 0.03).sin() + (f64::from(i) * 1.7).cos()).collect();
        for factor in [1, 2, 8] {
            let plan = CausalDecimator::new(factor).unwrap();
            let y = plan.process(&x);
            assert_eq!(y.len(), (x.len() - plan.taps.len()) / factor + 1);
            for (m, y) in y.iter().enumerate() {
                let expected: f64 = plan.taps.iter().enumerate().map(|(j, h)| h * x[m * factor + j]).sum();
                assert!((y - expected).abs() < 1e-14, "{y} {expected}");
            }
        }
    }

    #[test]
    fn a_slow_ramp_comes_out_late_by_the_stated_delay() {
        let x: Vec<f64> = (0..1000).map(f64::from).collect();
        let plan = CausalDecimator::new(4).unwrap();
        for (m, y) in plan.process(&x).iter().enumerate() {
            assert!((y - (m * 4 + plan.delay()) as f64).abs() < 1e-9);
        }
    }

    #[test]
    fn a_sample_that_is_no_number_leaves_no_trace_once_it_has_left_the_filter() {
        let x: Vec<f64> = (0..600).map(|i| (f64::from(i) * 0.1).sin()).collect();
        let mut broken = x.clone();
        broken[200] = f64::NAN;
        let plan = CausalDecimator::new(4).unwrap();
        let (clean, broken) = (plan.process(&x), plan.process(&broken));
        for (m, (a, b)) in clean.iter().zip(&broken).enumerate() {
            let touched = (4 * m..4 * m + plan.taps.len()).contains(&200);
            assert!(if touched { b.is_nan() } else { a == b }, "{m}");
        }
    }
}
