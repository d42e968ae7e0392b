//! Values that are held until the next one.

use std::ops::Range;

use super::bridge::widen;
use super::differences::{MEDIAN, OF_G, fourth, middle};
use super::found::BadCount;
use crate::lagrange::{BEFORE, NODES, Taps};

/// Held: fewest changes; share of them at every k-th sample; samples of a value at most.
const CHANGES: usize = 16;
const REGULAR: f64 = 0.97;
const REGULAR_SPACING: f64 = 0.94;
const LONGEST_HOLD: usize = 64;
/// So many values, or fewer, are levels of a command; so many spacings alike are even times.
const FEW_LEVELS: usize = 8;
const EVEN_TIMES: f64 = 0.8;
/// A change by one step of the converter in so many of ten is a slow ramp.
const OF_ONE_LEVEL: f64 = 0.8;

/// Where a held channel has its fresh values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    every: usize,
    phase: usize,
}

impl Held {
    /// Reads a channel between its fresh values into `own`; what is not good enough goes to `gaps`. How much is held.
    pub(super) fn read_between(self, signal: &[f64], own: &mut [f64], gaps: &mut Vec<Range<usize>>) -> BadCount {
        let Self { every, phase } = self;
        let is_stale = |i: usize| !(i + every - phase % every).is_multiple_of(every);
        gaps.clear();
        let n = signal.len();
        let fresh = (n - phase).div_ceil(every);
        let mut held = BadCount { every: every as u32, ..BadCount::default() };
        for i in (0..n).filter(|i| is_stale(*i)) {
            if held.count == 0 {
                held.first = u32::try_from(i).unwrap_or(u32::MAX);
            }
            held.count += 1;
        }
        let value = |j: usize| signal[phase + j * every];
        let (from, to) = (BEFORE, fresh.saturating_sub(NODES - BEFORE));
        for step in 1..every {
            let taps = Taps::at(step as f64 / every as f64);
            for j in 0..fresh {
                let i = phase + j * every + step;
                if i >= n {
                    break;
                }
                own[i] = if (from..to).contains(&j) {
                    (0..NODES).map(|k| taps.value[k] * value(j + k - BEFORE)).sum()
                } else {
                    let next = value((j + 1).min(fresh - 1));
                    value(j) + (next - value(j)) * step as f64 / every as f64
                };
            }
        }
        // Near the ends a straight line is not good enough.
        for (first, last) in [(0, phase + from * every), ((phase + to * every + 1).min(n), n)] {
            (first..last).filter(|i| is_stale(*i)).for_each(|i| widen(gaps, i));
        }
        held
    }
}

/// Whether values change at every k-th sample only, at rest as in motion.
pub(super) fn held(signal: &[f64], level: f64) -> Option<Held> {
    let mut spacings = [0usize; LONGEST_HOLD + 1];
    let (mut changes, mut of_one, mut last) = (0usize, 0usize, None);
    let mut values = Few::default();
    for i in 1..signal.len() {
        let step = (signal[i] - signal[i - 1]).abs();
        if step == 0.0 {
            continue;
        }
        changes += 1;
        of_one += usize::from(step <= 1.5 * level);
        values.add(signal[i]);
        if let Some(last) = last.replace(i)
            && i - last <= LONGEST_HOLD
        {
            spacings[i - last] += 1;
            // Most are not held: seen soon.
            if spacings[1] > CHANGES && spacings[1] * 16 > changes {
                return None;
            }
        }
    }
    // A few levels by turns are a command that steps.
    if changes < CHANGES || !values.are_many() {
        return None;
    }
    // Even steps at even times are stairs, or a coarse converter on a ramp.
    let steps = || signal.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|step| *step > 0.0);
    let usual = steps().nth(changes / 2).unwrap_or(0.0);
    let alike = steps().filter(|step| (step - usual).abs() < 0.01 * usual).count();
    let even = spacings.iter().max().is_some_and(|most| *most as f64 > EVEN_TIMES * changes as f64);
    if even && (2 * alike > changes || of_one as f64 > OF_ONE_LEVEL * changes as f64) {
        return None;
    }
    let short: usize = spacings.iter().sum();
    for every in (2..=LONGEST_HOLD).rev() {
        let whole: usize = spacings.iter().step_by(every).sum();
        if short == 0 || (whole as f64) < REGULAR_SPACING * short as f64 {
            continue;
        }
        let mut phases = [0usize; LONGEST_HOLD];
        (1..signal.len()).filter(|&i| signal[i] != signal[i - 1]).for_each(|i| phases[i % every] += 1);
        let phase = (0..every).max_by_key(|&p| phases[p])?;
        if phases[phase] as f64 >= REGULAR * changes as f64 {
            return Some(Held { every, phase });
        }
    }
    None
}

/// Standard deviation of the noise of fresh values, by the median of |g| over them.
pub(super) fn noise_of_fresh(signal: &[f64], held: &Held) -> f64 {
    let Held { every, phase } = *held;
    let fresh = (signal.len() - phase) / every;
    let mut found = [0.0; 1024];
    let step = (fresh / found.len()).max(1);
    let mut k = 0;
    for j in (2..fresh.saturating_sub(2)).step_by(step).take(found.len()) {
        let around: [f64; 5] = std::array::from_fn(|m| signal[phase + (j + m - 2) * every]);
        found[k] = fourth(&around, 2).abs();
        k += 1;
    }
    // At rest on one step of a converter most are zero; then the larger half tells.
    let half = middle(&mut found[..k]);
    let typical = if half > 0.0 { half } else { middle_of_moving(&mut found[..k]) };
    typical / (MEDIAN * OF_G)
}

/// The middle of the values that are not zero.
fn middle_of_moving(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let first = values.partition_point(|v| *v == 0.0);
    middle(&mut values[first..])
}

/// Whether more than a few different values were seen.
#[derive(Default)]
struct Few {
    values: [f64; FEW_LEVELS],
    n: usize,
}

impl Few {
    fn add(&mut self, value: f64) {
        if self.n <= FEW_LEVELS && !self.values[..self.n.min(FEW_LEVELS)].contains(&value) {
            if let Some(slot) = self.values.get_mut(self.n) {
                *slot = value;
            }
            self.n += 1;
        }
    }

    fn are_many(&self) -> bool {
        self.n > FEW_LEVELS
    }
}
