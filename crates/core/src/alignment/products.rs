//! Inner products of shifted target, its slope and measured, over samples or over bins.

use pulp::{Simd, WithSimd};

use crate::spectrum::{Bins, LANES, Sink};

/// Inner products of the shifted target y, its slope y' and measured o.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Products {
    pub(super) yy: f64,
    pub(super) yv: f64,
    pub(super) vv: f64,
    pub(super) oy: f64,
    pub(super) ov: f64,
    pub(super) oo: f64,
}

/// All inner products in one pass, compiled for the processor at hand.
pub(super) struct Multiply<'a> {
    pub(super) shifted: &'a [f64],
    pub(super) slope: &'a [f64],
    pub(super) measured: &'a [f64],
}

impl WithSimd for Multiply<'_> {
    type Output = Products;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Products {
        let (ys, y_rest) = S::as_simd_f64s(self.shifted);
        let (vs, v_rest) = S::as_simd_f64s(self.slope);
        let (os, o_rest) = S::as_simd_f64s(self.measured);
        let mut lanes = [simd.splat_f64s(0.0); 6];
        for ((y, v), o) in ys.iter().zip(vs).zip(os) {
            for (lane, (a, b)) in lanes.iter_mut().zip([(y, y), (y, v), (v, v), (o, y), (o, v), (o, o)]) {
                *lane = simd.mul_add_e_f64s(*a, *b, *lane);
            }
        }
        let mut total = lanes.map(|lane| simd.reduce_sum_f64s(lane));
        for ((y, v), o) in y_rest.iter().zip(v_rest).zip(o_rest) {
            for (sum, term) in total.iter_mut().zip([y * y, y * v, v * v, o * y, o * v, o * o]) {
                *sum += term;
            }
        }
        let [yy, yv, vv, oy, ov, oo] = total;
        Products { yy, yv, vv, oy, ov, oo }
    }
}

/// sum |a|^2, sum Re(a conj b) and sum |b|^2 over the kept bins.
#[derive(Default)]
pub(super) struct Cross<'a> {
    pub(super) correction: Option<&'a [f64]>,
    pub(super) first: usize,
    pub(super) first_squared: [f64; LANES],
    pub(super) product: [f64; LANES],
    pub(super) second_squared: [f64; LANES],
}

impl Cross<'_> {
    pub(super) fn totals(&self) -> (f64, f64, f64) {
        let total = |lanes: &[f64; LANES]| lanes.iter().sum::<f64>();
        (total(&self.first_squared), total(&self.product), total(&self.second_squared))
    }
}

impl Sink for Cross<'_> {
    #[inline(always)]
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        let (ar, ai, br, bi) = (&bins.target_re, &bins.target_im, &bins.measured_re, &bins.measured_im);
        let mut squared = [1.0; W];
        if let Some(correction) = self.correction {
            let at = bins.first - self.first;
            squared = std::array::from_fn(|i| correction[at + i] * correction[at + i]);
        }
        for i in 0..W {
            self.first_squared[i] += squared[i] * (ar[i] * ar[i] + ai[i] * ai[i]);
            self.product[i] += squared[i] * (ar[i] * br[i] + ai[i] * bi[i]);
            self.second_squared[i] += squared[i] * (br[i] * br[i] + bi[i] * bi[i]);
        }
    }
}
