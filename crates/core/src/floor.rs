//! Noise that is the target's own, by what its highest frequencies hold and measured does not follow.
//!
//! ```text
//! d_i = sum_j (-1)^j C(8, j) x_(i + s j),   |D(w)|^2 = (2 sin(w s / 2))^16,   E d^2 = 12870 sigma^2 for white noise
//! ```
//!
//! At a tenth of the rate over s the differences of eighth order pass 1e-8 of the energy that white noise of the same energy
//! leaves, so a motion does not count, and nothing leaks from the ends of a window as it does from a transform.

use pulp::{Arch, NullaryFnOnce};

/// Order of the differences.
const ORDER: usize = 8;
/// (-1)^j C(8, j)
const BINOMIAL: [f64; ORDER + 1] = [1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0];
/// sum C(8, j)^2
const SQUARES: f64 = 12870.0;
/// Share of the differences that are independent.
const INDEPENDENT: f64 = 0.13;
/// Samples of a part.
const PART: usize = 128;
/// Samples that are compared with measured, at how many lags, and how many of them at once.
const LEAST_COMPARED: usize = 1 << 11;
const MOST_COMPARED: usize = 1 << 14;
const LAGS: usize = 4;
const STRIP: usize = 128;
/// Places between no lag and the lag at which they are compared at most.
const MOST_PLACES: usize = 16;
/// Two channels' differences are alike from this correlation on, and this many standard deviations of chance.
const ALIKE: f64 = 0.15;
const CLEAR: f64 = 5.0;
/// At each lag differences far above chance are found again at a neighbour: the shift between samples costs up to this.
const BETWEEN: f64 = 1.5;

/// Mean square of the differences of samples `stride` apart, over sum C^2: the variance of white noise.
pub(crate) fn variance(samples: &[f64], stride: usize) -> f64 {
    struct Differences<'a>(&'a [f64], usize);
    impl NullaryFnOnce for Differences<'_> {
        type Output = f64;

        #[inline(always)]
        fn call(self) -> f64 {
            const LANES: usize = 16;
            let Self(samples, stride) = self;
            let n = samples.len() - ORDER * stride;
            let terms: [&[f64]; ORDER + 1] = std::array::from_fn(|j| &samples[j * stride..j * stride + n]);
            let mut lanes = [0.0; LANES];
            let mut at = 0;
            while at + LANES <= n {
                let x: [&[f64; LANES]; ORDER + 1] =
                    std::array::from_fn(|j| terms[j][at..at + LANES].try_into().expect("LANES of them"));
                for i in 0..LANES {
                    let d = difference(|j| x[j][i]);
                    lanes[i] += d * d;
                }
                at += LANES;
            }
            let rest: f64 = (at..n).map(|i| difference(|j| terms[j][i]).powi(2)).sum();
            (lanes.iter().sum::<f64>() + rest) / (n as f64 * SQUARES)
        }
    }
    if samples.len() <= ORDER * stride { 0.0 } else { Arch::new().dispatch(Differences(samples, stride)) }
}

/// The same from a part of the differences, and how many independent ones there are.
pub(crate) fn sampled_variance(samples: &[f64], stride: usize) -> (f64, f64) {
    let length = PART.max(ORDER * stride + PART / 2);
    let every = (4 * (length - ORDER * stride)).max(length / 2);
    let (mut sum, mut n) = (0.0, 0.0);
    let mut at = 0;
    while at + length <= samples.len() {
        let count = (length - ORDER * stride) as f64;
        sum += count * variance(&samples[at..at + length], stride);
        n += count;
        at += every;
    }
    if n == 0.0 { (variance(samples, stride), INDEPENDENT * samples.len() as f64) } else { (sum / n, INDEPENDENT * n) }
}

/// d from the nine samples it is made of.
#[inline(always)]
fn difference(x: impl Fn(usize) -> f64) -> f64 {
    x(0) + x(8) - 8.0 * (x(1) + x(7)) + 28.0 * (x(2) + x(6)) - 56.0 * (x(3) + x(5)) + 70.0 * x(4)
}

/// What the variance is of noise that correlates so between samples, over that of white noise.
pub(crate) fn of_correlated(correlation: &[f64]) -> f64 {
    let product = |l: usize| (0..=ORDER.saturating_sub(l)).map(|j| BINOMIAL[j] * BINOMIAL[j + l]).sum::<f64>();
    let sum = (1..=ORDER).map(|l| product(l) * correlation.get(l).copied().unwrap_or(0.0)).sum::<f64>();
    1.0 + 2.0 * sum / SQUARES
}

/// The share of the target's differences that measured follows at about `lag` samples and a gain: motion, not noise.
/// `target` and `measured` are the same stretch. An actuator may answer the highest frequencies sooner than the rest, so lags
/// between none and that are looked at, too.
pub(crate) fn followed(target: &[f64], measured: &[f64], lag: f64, gain: f64) -> f64 {
    let between = (0..lag.abs() as usize).step_by(LAGS).take(MOST_PLACES).map(|l| (l as f64).copysign(lag));
    std::iter::once(lag).chain(between).map(|lag| followed_at(target, measured, lag, gain)).fold(0.0, f64::max)
}

/// Whether the highest frequencies are in both channels at the same instant and as large, though measured comes `lag` samples
/// later: noise of the wiring, not motion. An actuator that answers them at once answers them less.
pub(crate) fn is_common(target: &[f64], measured: &[f64], lag: f64, gain: f64) -> bool {
    lag.abs() >= LEAST_APART
        && alike_at(target, measured, 0.0).is_some_and(|(size, _)| size.abs() > COMMON)
        && followed_at(target, measured, lag, gain) < COMMON
}

fn followed_at(target: &[f64], measured: &[f64], lag: f64, gain: f64) -> f64 {
    alike_at(target, measured, lag).map_or(0.0, |(size, correlation)| {
        // By measured's gain at these frequencies, which may be lower than elsewhere; the squared correlation needs none.
        (BETWEEN * size / gain).max((BETWEEN * correlation).powi(2)).min(1.0)
    })
}

/// How much of the target's differences is in measured `lag` samples later, as a factor, and their correlation; None where it is
/// not clear of chance.
fn alike_at(target: &[f64], measured: &[f64], lag: f64) -> Option<(f64, f64)> {
    let n = target.len().min((target.len() / 2).clamp(LEAST_COMPARED, MOST_COMPARED));
    let base = lag.floor() as isize - 1;
    let margin = base.unsigned_abs() + LAGS;
    if n < 2 * margin + STRIP + ORDER {
        return None;
    }
    let from = (target.len() - n) / 2 + margin;
    let to = from + n - 2 * margin - ORDER;
    let Followed { own, other, products } = Arch::new().dispatch(Follow { target, measured, base, from, to });
    let most = products.iter().fold(0.0, |m: f64, p| m.max(p.abs()));
    let chance = CLEAR / (INDEPENDENT * (to - from) as f64).sqrt();
    let correlation = most / (own * other).sqrt();
    (correlation > ALIKE.max(chance)).then(|| (most / own, correlation))
}

/// Noise is in both where they share so much of it; and the delay is so many samples.
const COMMON: f64 = 0.4;
const LEAST_APART: f64 = 3.0;

/// Energies of the differences of both, and sums of products at each lag.
#[derive(Default)]
struct Followed {
    own: f64,
    other: f64,
    products: [f64; LAGS],
}

/// The differences from `from` to `to` of the target with those of measured `base` and more later, a strip at a time.
struct Follow<'a> {
    target: &'a [f64],
    measured: &'a [f64],
    base: isize,
    from: usize,
    to: usize,
}

impl NullaryFnOnce for Follow<'_> {
    type Output = Followed;

    #[inline(always)]
    fn call(self) -> Followed {
        let Self { target, measured, base, from, to } = self;
        let mut found = Followed::default();
        for at in (from..to.saturating_sub(STRIP - 1)).step_by(STRIP) {
            let x: &[f64; STRIP + ORDER] = target[at..at + STRIP + ORDER].try_into().expect("so many");
            let later = at.saturating_add_signed(base);
            let y: &[f64; STRIP + LAGS + ORDER] =
                measured[later..later + STRIP + LAGS + ORDER].try_into().expect("so many");
            let (mut dx, mut dy) = ([0.0; STRIP], [0.0; STRIP + LAGS]);
            for (i, d) in dx.iter_mut().enumerate() {
                *d = difference(|j| x[i + j]);
            }
            for (i, d) in dy.iter_mut().enumerate() {
                *d = difference(|j| y[i + j]);
            }
            found.own += dot(&dx, &dx);
            let part: &[f64; STRIP] = dy[..STRIP].try_into().expect("so many");
            found.other += dot(part, part);
            for (k, product) in found.products.iter_mut().enumerate() {
                *product += dot(&dx, dy[k..k + STRIP].try_into().expect("so many"));
            }
        }
        found
    }
}

/// sum a b, in lanes.
#[inline(always)]
fn dot(a: &[f64; STRIP], b: &[f64; STRIP]) -> f64 {
    const LANES: usize = 16;
    let mut lanes = [0.0; LANES];
    for part in 0..STRIP / LANES {
        for i in 0..LANES {
            lanes[i] += a[part * LANES + i] * b[part * LANES + i];
        }
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize, mut seed: u64) -> Vec<f64> {
        let mut uniform = move || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    #[test]
    fn white_noise_on_a_motion_is_found_and_the_motion_is_not() {
        let motion: Vec<f64> = (0..20_000).map(|i| 50.0 * (0.1 * f64::from(i)).sin()).collect();
        let noisy: Vec<f64> = motion.iter().zip(noise(20_000, 3)).map(|(x, e)| x + 0.5 * e).collect();
        for stride in [1, 2] {
            assert!((variance(&noisy, stride) / 0.25 - 1.0).abs() < 0.1, "{stride}");
        }
        assert!(variance(&motion, 1) < 1e-12);
        // The sums in lanes are those written out.
        let plain: f64 = (0..noisy.len() - 8).map(|i| difference(|j| noisy[i + j]).powi(2)).sum();
        assert!((variance(&noisy, 1) * SQUARES * (noisy.len() - 8) as f64 / plain - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_high_tone_that_measured_follows_is_motion_between_samples_too() {
        for shift in [0.0, 0.3, 0.5, 0.9] {
            let tone = |i: f64| (2.6 * i).sin() + 0.7 * (2.9 * i).cos();
            let target: Vec<f64> = (0..4096).map(|i| tone(f64::from(i))).collect();
            let measured: Vec<f64> = (0..4096).map(|i| 0.9 * tone(f64::from(i) - 7.0 - shift)).collect();
            assert!(followed(&target, &measured, 7.0 + shift, 0.9) > 0.5, "{shift}");
            assert_eq!(followed(&noise(4096, 1), &noise(4096, 2), 7.0 + shift, 0.9), 0.0);
        }
    }
}
