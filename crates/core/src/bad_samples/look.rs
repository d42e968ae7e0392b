//! What a channel looks like: in one pass over all samples, and closer where that asks for it.

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce};

use super::differences::{BLOCK, MEDIAN, OF_G, OF_H, fourth, median, middle, second, spread_of};
use crate::sums;

/// A block is looked at closely where its largest |g| is so many times their mean.
const STANDS_OUT: f64 = 5.2;
/// By g, where h is asked as well, a spike is so many standard deviations of the noise high.
pub(super) const LIKELY_BY_G: f64 = 5.8;
/// Fewest equal values that are looked at.
pub(super) const RUN: usize = 3;
/// Steps of a converter.
pub(super) const LEVELS: f64 = 4.0;
/// An end is a spike where it leaves by so many times what the sample beside it does, and by so many standard deviations of the noise.
const OF_END: f64 = 4.0;
const SPIKE_BY_END: f64 = 25.0;
/// More pairs of equal values than this share are a converter's.
pub(super) const OF_CONVERTER: f64 = 0.002;

/// What is seen of a channel in one pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    pub(super) stands_out: bool,
    /// The first or the last sample may stand out.
    pub(super) at_ends: bool,
    pub(super) repeats: bool,
}

impl Sight {
    pub(super) fn of(signal: &[f64]) -> Self {
        let (stands_out, threes, equals) = Arch::new().dispatch(FirstSight(signal));
        // A value held for two samples has no three alike.
        let repeats = threes > 0 || 3 * equals > signal.len();
        Self { stands_out, at_ends: leaves_ends(signal) != [false; 2], repeats }
    }

    pub(super) fn asks_for_more(&self) -> bool {
        self.stands_out || self.at_ends || self.repeats
    }
}

/// What one channel looks like, by a closer look.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) sight: Sight,
    /// Standard deviation of the noise, by the median of |g|.
    pub(super) noise: f64,
    /// It is noise indeed, and not the motion's.
    pub(super) is_noisy: bool,
    /// Smallest change, one step of a converter.
    pub(super) level: f64,
    /// How often a value is that of the sample before, by chance; and the share of all that are.
    pub(super) chance: f64,
    pub(super) equal: f64,
    pub(super) deviation: f64,
    pub(super) peak: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Look {
    pub(super) fn at(signal: &[f64], sight: Sight) -> Self {
        let n = signal.len();
        let (low, high) = signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mean = sums::sum(signal) / n as f64;
        let deviation = (sums::spread(signal, mean) / n as f64).sqrt();
        let changes = signal.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 1e-13 * (high - low));
        let level = changes.fold(f64::INFINITY, f64::min);
        // Just two equal values one after the other: of a converter, not of a sensor that stands.
        let twos = signal.windows(4).filter(|w| w[1] == w[2] && w[0] != w[1] && w[3] != w[2]).count();
        let equals = signal.windows(2).filter(|w| w[0] == w[1]).count();
        let (equal, chance) = (equals as f64 / n as f64, twos as f64 / n as f64);
        let of_converter = chance > OF_CONVERTER;
        let level = if of_converter || is_converter(signal, level) { level } else { 0.0 };
        let noise = typical(signal, fourth) / OF_G;
        Self {
            sight,
            noise,
            is_noisy: noise > 0.5 * typical(signal, second) / OF_H,
            level,
            chance: if of_converter { equal } else { chance },
            equal,
            deviation,
            peak: low.abs().max(high.abs()),
            low,
            high,
        }
    }
}

/// The standard deviation of what is normal of a block, by medians; one block in so many is enough.
fn typical(signal: &[f64], spread: fn(&[f64], usize) -> f64) -> f64 {
    let n = signal.len();
    let every = (n / BLOCK / 64).max(1) * BLOCK;
    let mut blocks = [0.0; 128];
    let mut k = 0;
    for start in (0..n.saturating_sub(BLOCK - 1)).step_by(every).take(blocks.len()) {
        blocks[k] = median(signal, &(start..start + BLOCK), spread) / MEDIAN;
        k += 1;
    }
    middle(&mut blocks[..k])
}

/// Whether changes are whole multiples of `level`.
fn is_converter(signal: &[f64], level: f64) -> bool {
    let step = (signal.len() / 256).max(1);
    let (mut whole, mut all) = (0, 0);
    for w in signal.windows(2).step_by(step) {
        let multiple = (w[1] - w[0]).abs() / level;
        if multiple > 0.5 {
            all += 1;
            whole += usize::from(multiple < 1e6 && (multiple - multiple.round()).abs() < 0.02);
        }
    }
    all > 0 && whole as f64 >= 0.95 * all as f64
}

/// Whether a block's largest |g| stands out of all.
pub(super) fn stands_out(signal: &[f64], own: &Range<usize>) -> bool {
    let range = own.start.max(2)..own.end.min(signal.len().saturating_sub(2));
    if range.len() < 8 {
        return false;
    }
    let (most, sum) = spread_of(&signal[range.start - 2..range.end + 2]);
    most * range.len() as f64 > STANDS_OUT * sum && most > LIKELY_BY_G * OF_G * median(signal, own, fourth) / MEDIAN
}

/// Whether a block stands out; how many samples equal the two before, and the one before.
struct FirstSight<'a>(&'a [f64]);

impl NullaryFnOnce for FirstSight<'_> {
    type Output = (bool, usize, usize);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let signal = self.0;
        let n = signal.len();
        let (mut stands, mut threes, mut equals) = (false, 0, 0);
        for start in (0..n).step_by(BLOCK) {
            let own = start..(start + BLOCK).min(n);
            stands |= stands_out(signal, &own);
            if own.start >= 2 {
                let [two, one, here] = [2, 1, 0].map(|d| &signal[own.start - d..own.end - d]);
                let (mut three, mut two_alike) = (0u32, 0u32);
                for i in 0..here.len() {
                    let equal = u32::from(here[i] == one[i]);
                    two_alike += equal;
                    three += equal & u32::from(one[i] == two[i]);
                }
                threes += three as usize;
                equals += two_alike as usize;
            } else {
                threes += signal[..own.end].windows(RUN).filter(|w| w[0] == w[1] && w[1] == w[2]).count();
                equals += signal[..own.end].windows(2).filter(|w| w[0] == w[1]).count();
            }
        }
        (stands, threes, equals)
    }
}

/// The first and the last sample less the parabola through the three beside it, and how far the same leaves the next one: for
/// each end.
pub(super) fn of_ends(x: &[f64]) -> [(f64, f64); 2] {
    let n = x.len();
    let leaves = |x: [f64; 5]| {
        let third = |k: usize| (x[k] - 3.0 * x[k + 1] + 3.0 * x[k + 2] - x[k + 3]).abs();
        (third(0), third(1))
    };
    if n < 16 {
        return [(0.0, 0.0); 2];
    }
    [leaves(std::array::from_fn(|k| x[k])), leaves(std::array::from_fn(|k| x[n - 1 - k]))]
}

/// Whether an end leaves by far more than the sample beside it, and than the noise there.
pub(super) fn leaves_ends(x: &[f64]) -> [bool; 2] {
    let n = x.len();
    let ends = of_ends(x);
    let blocks = [0..BLOCK.min(n), n.saturating_sub(BLOCK)..n];
    std::array::from_fn(|side| {
        let (own, next) = ends[side];
        own > OF_END * next && own > SPIKE_BY_END * median(x, &blocks[side], fourth) / (MEDIAN * OF_G)
    })
}
