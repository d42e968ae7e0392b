//! Differences that a spike stands out by, and the median of them.

use std::ops::Range;

/// Samples that are looked at together.
pub(super) const BLOCK: usize = 128;
/// sqrt(70 / 36) and sqrt(3 / 2): of white noise, standard deviations of g and h; and the median of |x| of a normal x.
pub(super) const OF_G: f64 = 1.394_433_377_556_793;
pub(super) const OF_H: f64 = 1.224_744_871_391_589;
pub(super) const MEDIAN: f64 = 0.674_489_750_196_082;

/// g about sample i, which has two neighbours on either side.
#[inline(always)]
pub(super) fn fourth(x: &[f64], i: usize) -> f64 {
    (x[i - 2] + x[i + 2] - 4.0 * (x[i - 1] + x[i + 1]) + 6.0 * x[i]) / 6.0
}

/// h about sample i.
#[inline(always)]
pub(super) fn second(x: &[f64], i: usize) -> f64 {
    x[i] - 0.5 * (x[i - 1] + x[i + 1])
}

/// The largest |g| and the sum of all.
#[inline(always)]
pub(super) fn spread_of(around: &[f64]) -> (f64, f64) {
    const LANES: usize = 8;
    let n = around.len() - 4;
    let x: [&[f64]; 5] = std::array::from_fn(|j| &around[j..j + n]);
    let g = |i: usize| (x[0][i] + x[4][i] - 4.0 * (x[1][i] + x[3][i]) + 6.0 * x[2][i]).abs() / 6.0;
    let (mut most, mut sum) = ([0.0_f64; LANES], [0.0; LANES]);
    let whole = n / LANES * LANES;
    for at in (0..whole).step_by(LANES) {
        for k in 0..LANES {
            let g = g(at + k);
            most[k] = if g > most[k] { g } else { most[k] };
            sum[k] += g;
        }
    }
    let rest = (whole..n).map(g).fold((0.0_f64, 0.0), |(m, s), g| (m.max(g), s + g));
    (most.into_iter().fold(rest.0, f64::max), sum.iter().sum::<f64>() + rest.1)
}

/// The median of |spread| over a block.
#[inline]
pub(super) fn median(signal: &[f64], range: &Range<usize>, spread: fn(&[f64], usize) -> f64) -> f64 {
    let mut values = [0.0; BLOCK];
    let mut k = 0;
    for i in range.start.max(2)..range.end.min(signal.len().saturating_sub(2)) {
        values[k] = spread(signal, i).abs();
        k += 1;
    }
    middle(&mut values[..k])
}

/// The middle value; 0 of none.
#[inline]
pub(super) fn middle(values: &mut [f64]) -> f64 {
    let half = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(half, f64::total_cmp).1 }
}
