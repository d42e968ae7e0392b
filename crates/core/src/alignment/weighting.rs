//! What each bin counts where target and measured are both noisy.

use num_complex::Complex;

use crate::lagrange::NODES;
use crate::noise::Cosines;
use crate::spectrum::{Bins, Sink};

/// Energy of the target over its noise from which a few bins count: of noise alone it happens once in 10,000.
pub(super) const CLEAR: f64 = 3.0;

/// What a bin counts where both signals are noisy.
#[derive(Debug, Clone)]
pub(super) struct Weighting {
    /// W_k = 1 - noise / energy around bin k, zero where it does not stand clear of the noise.
    pub(super) weights: Vec<f64>,
    /// sqrt(W_k), times what makes good the droop of the cascade.
    pub(super) factors: Vec<f64>,
    /// sum W_k cos(l omega_k) / sum W_k: how white noise correlates between samples, seen through the weights.
    pub(super) correlation: [f64; NODES],
}

impl Weighting {
    /// From the energies in `weights` and |O_k - K Y_k|^2 in `factors` to the weights, over `width` bins at a time. `share` of
    /// the residual's energy is the target's noise, which is taken for white.
    pub(super) fn learn(&mut self, width: usize, share: f64) {
        let noise = share * self.factors.iter().sum::<f64>() / self.factors.len() as f64;
        for weights in self.weights.chunks_mut(width) {
            let energy = weights.iter().sum::<f64>() / weights.len() as f64;
            weights.fill(if energy > CLEAR * noise { 1.0 - noise / energy } else { 0.0 });
        }
        if self.weights.iter().all(|&w| w == 0.0) {
            self.weights.fill(1.0);
        }
    }

    /// What follows from the weights.
    pub(super) fn refresh(&mut self, correction: Option<&[f64]>, cosines: &Cosines) {
        for (k, (weight, factor)) in self.weights.iter().zip(&mut self.factors).enumerate() {
            *factor = weight.sqrt() * correction.map_or(1.0, |c| c[k]);
        }
        self.correlation = correlation(self.weights.iter().copied().zip(cosines.iter()));
    }
}

/// sum W_k cos(l omega_k) / sum W_k from weights and cosines.
pub(super) fn correlation(bins: impl Iterator<Item = (f64, f64)>) -> [f64; NODES] {
    let mut sums = [0.0; NODES];
    for (weight, cosine) in bins {
        let (mut now, mut next) = (weight, weight * cosine);
        for sum in &mut sums {
            *sum += now;
            (now, next) = (next, 2.0 * cosine * next - now);
        }
    }
    sums.map(|s| s / sums[0])
}

/// Keeps (|Y_k|^2 + r^2 |O_k|^2) / 2, r the noise ratio, and |O_k - K Y_k|^2. Noise that lifts the one lifts or lowers the
/// other as often as not; of |Y_k|^2 alone, weights would favour bins in which the target's noise adds to it.
pub(super) struct Energies<'a> {
    pub(super) gain: f64,
    pub(super) ratio: f64,
    pub(super) first: usize,
    pub(super) correction: Option<&'a [f64]>,
    pub(super) energy: &'a mut [f64],
    pub(super) residual: &'a mut [f64],
}

impl Sink for Energies<'_> {
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let k = bins.first - self.first + i;
            let factor = self.correction.map_or(1.0, |c| c[k]);
            let target = Complex::new(bins.target_re[i], bins.target_im[i]) * factor;
            let measured = Complex::new(bins.measured_re[i], bins.measured_im[i]) * factor;
            self.energy[k] = 0.5 * (target.norm_sqr() + self.ratio * self.ratio * measured.norm_sqr());
            self.residual[k] = (measured - target * self.gain).norm_sqr();
        }
    }
}
