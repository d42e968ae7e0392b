//! Sums over samples, in lanes and compiled for the processor at hand: a plain sum waits for each addition.

use pulp::{Arch, NullaryFnOnce, Simd, WithSimd};

/// Lanes of one sum; fixes the order of the additions.
const LANES: usize = 16;

/// sum of f(x_i)
struct Fold<'a, F> {
    samples: &'a [f64],
    f: F,
}

impl<F: Fn(usize, f64) -> f64> NullaryFnOnce for Fold<'_, F> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let Self { samples, f } = self;
        let mut lanes = [0.0; LANES];
        let parts = samples.chunks_exact(LANES);
        let rest = parts.remainder();
        for (p, part) in parts.enumerate() {
            for i in 0..LANES {
                lanes[i] += f(p * LANES + i, part[i]);
            }
        }
        let at = samples.len() - rest.len();
        for (i, x) in rest.iter().enumerate() {
            lanes[i] += f(at + i, *x);
        }
        lanes.iter().sum()
    }
}

/// sum x
pub(crate) fn sum(samples: &[f64]) -> f64 {
    Arch::new().dispatch(Fold { samples, f: |_, x| x })
}

/// sum x^2
pub(crate) fn energy(samples: &[f64]) -> f64 {
    Arch::new().dispatch(Fold { samples, f: |_, x| x * x })
}

/// sum (x - level)^2
pub(crate) fn spread(samples: &[f64], level: f64) -> f64 {
    Arch::new().dispatch(Fold { samples, f: |_, x| (x - level) * (x - level) })
}

/// sum x^4
pub(crate) fn fourths(samples: &[f64]) -> f64 {
    Arch::new().dispatch(Fold { samples, f: |_, x| x * x * x * x })
}

/// sum (x_(i+1) - x_i)^2
pub(crate) fn step_energy(samples: &[f64]) -> f64 {
    let (before, after) = (&samples[..samples.len() - 1], &samples[1..]);
    Arch::new().dispatch(Fold { samples: before, f: |i, x| (after[i] - x) * (after[i] - x) })
}

/// sum (i - centre) (x - level)
pub(crate) fn moment(samples: &[f64], centre: f64, level: f64) -> f64 {
    Arch::new().dispatch(Fold { samples, f: |i, x| (i as u32 as f64 - centre) * (x - level) })
}

/// x_i <- x_i w_i
pub(crate) fn multiply(samples: &mut [f64], factors: &[f64]) {
    struct Multiply<'a>(&'a mut [f64], &'a [f64]);
    impl NullaryFnOnce for Multiply<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            self.0.iter_mut().zip(self.1).for_each(|(x, w)| *x *= w);
        }
    }
    Arch::new().dispatch(Multiply(samples, factors));
}

/// x_i <- x_i - a y_i - b z_i
pub(crate) fn subtract(samples: &mut [f64], (a, first): (f64, &[f64]), (b, second): (f64, &[f64])) {
    struct Subtract<'a>(&'a mut [f64], f64, &'a [f64], f64, &'a [f64]);
    impl NullaryFnOnce for Subtract<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            let Self(samples, a, first, b, second) = self;
            samples.iter_mut().zip(first).zip(second).for_each(|((x, y), z)| *x -= a * y + b * z);
        }
    }
    Arch::new().dispatch(Subtract(samples, a, first, b, second));
}

/// r_l = sum x_i x_(i+l), l = 0 .. N - 1.
pub(crate) fn lag_products<const N: usize>(samples: &[f64]) -> [f64; N] {
    struct LagProducts<'a, const N: usize>(&'a [f64]);
    impl<const N: usize> WithSimd for LagProducts<'_, N> {
        type Output = [f64; N];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> [f64; N] {
            let x = self.0;
            let mut lanes = [simd.splat_f64s(0.0); N];
            // Blocks all of whose products stay within the samples.
            let blocks = x.len().saturating_sub(N - 1) / S::F64_LANES;
            for b in 0..blocks {
                let at = b * S::F64_LANES;
                let here = S::as_simd_f64s(&x[at..at + S::F64_LANES]).0[0];
                for l in 0..N {
                    let later = S::as_simd_f64s(&x[at + l..at + l + S::F64_LANES]).0[0];
                    lanes[l] = simd.mul_add_e_f64s(here, later, lanes[l]);
                }
            }
            let mut products = lanes.map(|lane| simd.reduce_sum_f64s(lane));
            for i in blocks * S::F64_LANES..x.len() {
                for (product, later) in products.iter_mut().zip(&x[i..]) {
                    *product += x[i] * later;
                }
            }
            products
        }
    }
    Arch::new().dispatch(LagProducts(samples))
}

/// max |x|, and whether all x are finite.
pub(crate) fn peak(samples: &[f64]) -> (f64, bool) {
    struct Peak<'a>(&'a [f64]);
    impl NullaryFnOnce for Peak<'_> {
        type Output = (f64, bool);

        #[inline(always)]
        fn call(self) -> (f64, bool) {
            let (mut peaks, mut zeros) = ([0.0; LANES], [0.0; LANES]);
            let parts = self.0.chunks_exact(LANES);
            let mut take = |i: usize, x: f64| {
                let size = x.abs();
                peaks[i] = if size > peaks[i] { size } else { peaks[i] };
                // NaN for anything that is not finite.
                zeros[i] += x * 0.0;
            };
            for (i, x) in parts.remainder().iter().enumerate() {
                take(i, *x);
            }
            for part in parts {
                for i in 0..LANES {
                    take(i, part[i]);
                }
            }
            (peaks.iter().fold(0.0, |p: f64, v| p.max(*v)), zeros.iter().sum::<f64>() == 0.0)
        }
    }
    Arch::new().dispatch(Peak(samples))
}

/// out_i = mean of the i-th `step` samples, a power of two.
pub(crate) fn block_means(samples: &[f64], step: usize, out: &mut [f64]) {
    struct Means<'a>(&'a [f64], usize, &'a mut [f64]);
    impl NullaryFnOnce for Means<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            let Self(samples, step, out) = self;
            match step {
                1 => out.copy_from_slice(&samples[..out.len()]),
                2 => means::<2>(samples, step, out),
                4 => means::<4>(samples, step, out),
                _ => means::<8>(samples, step, out),
            }
        }
    }
    /// By parts of `WIDE` samples, which divides `step`.
    #[inline(always)]
    fn means<const WIDE: usize>(samples: &[f64], step: usize, out: &mut [f64]) {
        let scale = 1.0 / step as f64;
        for (y, block) in out.iter_mut().zip(samples.chunks_exact(step)) {
            let mut lanes = [0.0; WIDE];
            for part in block.chunks_exact(WIDE) {
                for i in 0..WIDE {
                    lanes[i] += part[i];
                }
            }
            *y = scale * lanes.iter().sum::<f64>();
        }
    }
    Arch::new().dispatch(Means(samples, step, out));
}
