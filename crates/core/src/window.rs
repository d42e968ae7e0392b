//! Windows and detrending, applied over the L samples of the record before zero-padding.

use std::f64::consts::PI;

use pulp::{Arch, NullaryFnOnce};

use crate::sums;

/// Window over the record, symmetric (first and last sample alike).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Window {
    /// No window: every sample counts alike.
    #[default]
    Boxcar,
    /// 0.5 - 0.5 cos.
    Hann,
    /// 0.54 - 0.46 cos.
    Hamming,
    /// 0.42 - 0.5 cos + 0.08 cos 2.
    Blackman,
    /// The five-term flat-top window of scipy and MATLAB.
    Flattop,
    /// Flat with cosine ends, alpha = 0.5: a quarter of the record at either end.
    Tukey,
}

impl Window {
    /// All windows with their names.
    pub const NAMES: [(&'static str, Window); 6] = [
        ("boxcar", Window::Boxcar),
        ("hann", Window::Hann),
        ("hamming", Window::Hamming),
        ("blackman", Window::Blackman),
        ("flattop", Window::Flattop),
        ("tukey", Window::Tukey),
    ];

    /// The window's `n` coefficients; `None` for boxcar, which multiplies by nothing.
    ///
    /// w_i = sum_m (-1)^m a_m cos(2 pi m i / (n - 1)), i = 0 .. n-1; tukey with alpha = 0.5 (Harris 1978).
    pub fn coefficients(self, n: usize) -> Option<Vec<f64>> {
        self.shifted(n, 0.0)
    }

    /// The same at i + `shift` instead of i, zero outside the window's ends; a boxcar has nothing between its steps to shift.
    pub(crate) fn shifted(self, n: usize, shift: f64) -> Option<Vec<f64>> {
        if self == Window::Boxcar {
            return None;
        }
        if n == 1 {
            return Some(vec![1.0]);
        }
        let last = (n - 1) as f64;
        let at = |i: usize| {
            let x = i as f64 + shift;
            // The nearer end is the origin, so that both halves are mirror images to the last bit.
            let x = x.min(last - x);
            if x < 0.0 { 0.0 } else { self.at_distance(x, last) }
        };
        Some((0..n).map(at).collect())
    }

    /// The coefficient `x` samples from the nearer end of a window whose ends are `last` samples apart.
    fn at_distance(self, x: f64, last: f64) -> f64 {
        let terms: &[f64] = match self {
            Window::Boxcar => &[1.0],
            Window::Hann => &[0.5, 0.5],
            Window::Hamming => &[0.54, 0.46],
            Window::Blackman => &[0.42, 0.5, 0.08],
            Window::Flattop => &[0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368],
            Window::Tukey => return tukey(x, last),
        };
        let angle = 2.0 * PI / last * x;
        terms.iter().enumerate().rev().fold(0.0, |sum, (m, a)| {
            let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
            sum + sign * a * (m as f64 * angle).cos()
        })
    }
}

fn tukey(x: f64, last: f64) -> f64 {
    const ALPHA: f64 = 0.5;
    if x <= ALPHA * last / 2.0 { 0.5 * (1.0 + (PI * (2.0 * x / ALPHA / last - 1.0)).cos()) } else { 1.0 }
}

/// What is subtracted from the record before the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Detrend {
    /// Nothing.
    #[default]
    None,
    /// The mean.
    Mean,
    /// The least-squares line.
    Linear,
}

impl Detrend {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Detrend); 3] =
        [("none", Detrend::None), ("mean", Detrend::Mean), ("linear", Detrend::Linear)];

    /// The line `level + slope * (i - (n - 1) / 2)` to subtract from sample i; `None` where there is nothing to subtract.
    pub fn line(self, samples: &[f64]) -> Option<Line> {
        let n = samples.len() as f64;
        let centre = (n - 1.0) / 2.0;
        let level = match self {
            Detrend::None => return None,
            Detrend::Mean | Detrend::Linear => sums::sum(samples) / n,
        };
        let slope = match self {
            Detrend::Linear => {
                let moment = sums::moment(samples, centre, level);
                // sum (i - centre)^2 over 0 .. n-1
                moment / (n * (n * n - 1.0) / 12.0)
            }
            _ => 0.0,
        };
        Some(Line { level, slope, centre })
    }
}

/// A straight line over the sample index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    level: f64,
    slope: f64,
    centre: f64,
}

impl Line {
    /// Value of the line at sample `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> f64 {
        self.at_f64(i as f64)
    }

    /// Whether it is a mean alone.
    #[inline(always)]
    pub(crate) fn is_level(&self) -> bool {
        self.slope == 0.0
    }

    /// Subtracts it from `samples`, its first place at the first of them.
    pub(crate) fn subtract_from(&self, samples: &mut [f64]) {
        struct Subtract<'a>(Line, &'a mut [f64]);
        impl NullaryFnOnce for Subtract<'_> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                let Self(line, samples) = self;
                if line.is_level() {
                    samples.iter_mut().for_each(|v| *v -= line.level);
                } else {
                    samples.iter_mut().enumerate().for_each(|(i, v)| *v -= line.at_f64(i as u32 as f64));
                }
            }
        }
        Arch::new().dispatch(Subtract(*self, samples));
    }

    /// Sum of its squares over `n` places, `step` apart, about the centre.
    pub(crate) fn energy(&self, n: usize, step: f64) -> f64 {
        let n = n as f64;
        n * self.level * self.level + (self.slope * step).powi(2) * n * (n * n - 1.0) / 12.0
    }

    /// The same at any place, before the first sample and after the last too.
    #[inline(always)]
    pub(crate) fn at_f64(&self, i: f64) -> f64 {
        self.level + self.slope * (i - self.centre)
    }
}
