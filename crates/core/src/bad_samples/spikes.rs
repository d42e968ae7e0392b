//! Spikes: samples, alone or a few close together, that leave and return.

use std::ops::Range;

use super::about::{About, Other, SHARED};
use super::bridge::{GOOD, bridge};
use super::differences::{BLOCK, MEDIAN, OF_G, OF_H, fourth, median, middle, second};
use super::found::BadKind;
use super::look::{LEVELS, LIKELY_BY_G, Look, leaves_ends, of_ends, stands_out};

/// A spike is so many standard deviations of the noise high, by g and by h (by g, where h is asked: [`LIKELY_BY_G`]).
const SPIKE_BY_G: f64 = 7.7;
const SPIKE_BY_H: f64 = 6.8;
/// Several spikes side by side are higher than what the signal does from the first to the last of them by this.
const STEPS: f64 = 0.8;
/// One is far off the median of seven by so many times what is typical, and farther than these medians move around it.
const FAR_OFF: f64 = 8.0;
/// Spikes side by side, at most.
const LONGEST_BURST: usize = 5;
/// What is left where they were is this share of what stands out.
const QUIET: f64 = 0.8;
/// Each look finds what the larger spikes hid.
const LOOKS: usize = 5;
/// An end is a spike where it leaves by so many standard deviations of the motion.
const OF_DEVIATION: f64 = 0.01;

/// Spikes, the highest first; each is bridged before the next look.
pub(super) fn mark_spikes(signal: &mut [f64], marks: &mut [u8], look: &Look) -> bool {
    let n = signal.len();
    let mut any = false;
    for i in ends_that_leave(signal, look).into_iter().flatten() {
        marks[i] = 1 + BadKind::Spike as u8;
        bridge(signal, marks, i..i + 1);
        any = true;
    }
    let blocks = n.div_ceil(BLOCK);
    for block in 0..blocks {
        let own = block * BLOCK..((block + 1) * BLOCK).min(n);
        if !stands_out(signal, &own) {
            continue;
        }
        let noise = median(signal, &own, fourth) / (MEDIAN * OF_G);
        let least = (LEVELS * look.level).max(1e-12 * look.peak).max(FAR_OFF * noise);
        for _ in 0..LOOKS {
            if !mark_far_off(signal, marks, &own, least) {
                break;
            }
            any = true;
            bridge(signal, marks, own.start.saturating_sub(8)..(own.end + 8).min(n));
        }
        for _ in 0..LOOKS {
            // Noise that changes: what it is around here, not before the last block or after the next.
            let around = [block.saturating_sub(1), block, block + 1];
            let level = |spread: fn(&[f64], usize) -> f64, of: f64| {
                let medians = around.iter().filter(|&&b| b < blocks).map(|b| {
                    let range = b * BLOCK..((b + 1) * BLOCK).min(n);
                    median(signal, &range, spread) / (MEDIAN * of)
                });
                medians.fold(0.0, f64::max)
            };
            let (by_g, by_h) = (level(fourth, OF_G), level(second, OF_H));
            let least = LEVELS * look.level + 1e-12 * look.peak;
            let mut new = false;
            for i in own.start.max(3)..own.end.min(n.saturating_sub(3)) {
                let (g, h) = (fourth(signal, i).abs(), second(signal, i).abs());
                let high = g > SPIKE_BY_G * by_g || (g > LIKELY_BY_G * by_g && h > SPIKE_BY_H * by_h);
                if high && g > least && is_spike(signal, i, by_g) {
                    marks[i] = 1 + BadKind::Spike as u8;
                    new = true;
                }
            }
            if !new {
                // What is left may be several close together.
                let least = least.max(SPIKE_BY_G * by_g);
                for i in own.start.max(6)..own.end {
                    if i + 6 < n && marks[i] == GOOD && fourth(signal, i).abs() > least {
                        new |= mark_burst(signal, marks, i, least);
                    }
                }
            }
            if !new {
                break;
            }
            any = true;
            let (from, to) = (own.start.saturating_sub(8), (own.end + 8).min(n));
            bridge(signal, marks, from..to);
        }
    }
    any
}

/// What the other channel shows at the same time is motion.
pub(super) fn unmark_shared(marks: &mut [Vec<u8>; 2], bridged: &[Vec<f64>; 2], signals: [&[f64]; 2], about: &About) {
    for c in 0..2 {
        let other = Other::of(c, signals, about);
        let (mut shared, mut own) = (0, 0);
        for i in 0..marks[c].len() {
            if marks[c][i] != 1 + BadKind::Spike as u8 {
                continue;
            }
            let height = signals[c][i] - bridged[c][i];
            // Beside an end it may as well have been a step.
            let at_end = i == 0 || i + 1 == signals[c].len();
            if at_end && other.jumps(i, SHARED * height.abs()) {
                marks[c][i] = GOOD;
                continue;
            }
            // At the same instant in both it is in the wiring, or the earth; of that nothing is left out.
            let alike = |at: isize| {
                at >= 1
                    && at + 1 < other.signal.len() as isize
                    && other.scale * second(other.signal, at as usize) * height.signum() > SHARED * height.abs()
            };
            if (-3..=3).any(|d| alike(other.index(i as isize + d)) || alike(i as isize + d)) {
                marks[c][i] = GOOD;
                shared += 1;
            } else {
                own += 1;
            }
        }
        // Where most are, so is the rest, too small to be seen in the other.
        if shared > own {
            let spikes = marks[c].iter_mut().filter(|mark| **mark == 1 + BadKind::Spike as u8);
            spikes.for_each(|mark| *mark = GOOD);
        }
    }
}

/// The ends that are spikes.
fn ends_that_leave(x: &[f64], look: &Look) -> [Option<usize>; 2] {
    let least = (4.0 * LEVELS * look.level).max(OF_DEVIATION * look.deviation);
    let (ends, leave) = (of_ends(x), leaves_ends(x));
    std::array::from_fn(|side| (leave[side] && ends[side].0 > least).then_some(if side == 0 { 0 } else { x.len() - 1 }))
}

/// Whether sample i alone leaves a cubic through the three on either side, and two lines that part at it fit worse: no step and
/// no kink. `noise` is the standard deviation around here.
fn is_spike(x: &[f64], i: usize, noise: f64) -> bool {
    if i < 3 || i + 3 >= x.len() {
        return false;
    }
    let (even, odd) = (|k: usize| 0.5 * (x[i + k] + x[i - k]), |k: usize| 0.5 * (x[i + k] - x[i - k]));
    let (e, o) = ([even(1), even(2), even(3)], [odd(1), odd(2), odd(3)]);
    // What a + b k^2 and c k + d k^3 leave of the six.
    let left_even = 5.0 * e[0] - 8.0 * e[1] + 3.0 * e[2];
    let left_odd = 5.0 * o[0] - 4.0 * o[1] + o[2];
    let with_spike = 2.0 * (left_even * left_even / 98.0 + left_odd * left_odd / 42.0);
    // The same of fifth order through four on either side, where the motion is fast.
    let with_spike = if i >= 4 && i + 4 < x.len() {
        let left_even = -7.0 * e[0] + 14.0 * e[1] - 9.0 * e[2] + 2.0 * even(4);
        let left_odd = -7.0 * o[0] + 7.0 * o[1] - 3.0 * o[2] + 0.5 * odd(4);
        with_spike.min(2.0 * (left_even * left_even / 330.0 + left_odd * left_odd / 107.25))
    } else {
        with_spike
    };
    let bend = (-11.0 * e[0] - 2.0 * e[1] + 13.0 * e[2]) / 98.0;
    let height = x[i] - ((e[0] + e[1] + e[2]) / 3.0 - bend * 14.0 / 3.0);
    // What lines leave of three and of four.
    let three = |a: f64, b: f64, c: f64| (a - 2.0 * b + c).powi(2) / 6.0;
    let four =
        |a: f64, b: f64, c: f64, d: f64| (a - b - c + d).powi(2) / 4.0 + (a - 3.0 * b + 3.0 * c - d).powi(2) / 20.0;
    let before = four(x[i - 3], x[i - 2], x[i - 1], x[i]) + three(x[i + 1], x[i + 2], x[i + 3]);
    let after = three(x[i - 3], x[i - 2], x[i - 1]) + four(x[i], x[i + 1], x[i + 2], x[i + 3]);
    let (variance, square) = (noise * noise, height * height);
    let lines = before.min(after);
    let worse = lines - with_spike;
    with_spike < (16.0 * variance).max(0.003 * square) && worse > (12.0 * variance).max(0.1 * square) && square > lines
}

/// Whether what stands out is gone when some of so many samples from `from` on are read from the good ones around; `bad` has a
/// bit for each, the first and the last among them. All of them leave the place where they should be by `least` and more, and
/// the level and the slope are the same before and after.
fn is_burst(x: &mut [f64], from: usize, length: usize, bad: u32, least: f64) -> bool {
    let to = from + length;
    if from < 6 || to + 6 > x.len() {
        return false;
    }
    let [left, right] = [0.5 * (x[from - 1] - x[from - 3]), 0.5 * (x[to + 2] - x[to])];
    let step = x[to] - x[from - 1] - 0.5 * (left + right) * (length + 1) as f64;
    let least_height = least.max(STEPS * step.abs()).max(length as f64 * (left - right).abs());
    let mut kept = [0.0; LONGEST_BURST];
    kept[..length].copy_from_slice(&x[from..to]);
    let is_bad = |i: usize| (from..to).contains(&i) && bad >> (i - from) & 1 == 1;
    // The cubic through the two nearest good ones on either side.
    for i in (from..to).filter(|&i| is_bad(i)) {
        let mut good = [0.0; 4];
        let (mut before, mut after) = ((0..i).rev().filter(|&k| !is_bad(k)), (i + 1..x.len()).filter(|&k| !is_bad(k)));
        let places = [before.next(), before.next(), after.next(), after.next()].map(|k| k.unwrap_or(i));
        for (k, good) in good.iter_mut().enumerate() {
            let others = (0..4).filter(|&m| m != k);
            let weight = others.map(|m| (i as f64 - places[m] as f64) / (places[k] as f64 - places[m] as f64));
            *good = x[places[k]] * weight.product::<f64>();
        }
        x[i] = good.iter().sum();
    }
    let leaves = (0..length).filter(|&k| is_bad(from + k)).all(|k| (kept[k] - x[from + k]).abs() > least_height);
    let gone = leaves && (from - 4..to + 4).all(|i| fourth(x, i).abs() < QUIET * least);
    x[from..to].copy_from_slice(&kept[..length]);
    gone
}

/// Marks the fewest samples about i that make a burst.
fn mark_burst(x: &mut [f64], marks: &mut [u8], i: usize, least: f64) -> bool {
    for length in 2..=LONGEST_BURST {
        let inner = 0..1u32 << (length - 2);
        for bad in inner.map(|inner| 1 | inner << 1 | 1 << (length - 1)) {
            for from in i + 1 - length..=i {
                if is_burst(x, from, length, bad, least) {
                    (0..length).filter(|k| bad >> k & 1 == 1).for_each(|k| marks[from + k] = 1 + BadKind::Spike as u8);
                    return true;
                }
            }
        }
    }
    false
}

/// Marks what is far off the median of the seven samples around it, of which three may be bad.
fn mark_far_off(x: &[f64], marks: &mut [u8], own: &Range<usize>, least: f64) -> bool {
    const AROUND: usize = 4;
    let n = x.len();
    let range = own.start.max(3)..own.end.min(n.saturating_sub(3));
    let wide = range.start.saturating_sub(AROUND).max(3)..(range.end + AROUND).min(n.saturating_sub(3));
    let mut medians = [0.0; BLOCK + 2 * AROUND];
    for (median, i) in medians.iter_mut().zip(wide.clone()) {
        let mut seven = [0.0; 7];
        seven.copy_from_slice(&x[i - 3..i + 4]);
        *median = middle(&mut seven);
    }
    let of = |i: usize| medians[i - wide.start];
    let mut distances = [0.0; BLOCK];
    let mut k = 0;
    for i in range.clone() {
        distances[k] = (x[i] - of(i)).abs();
        k += 1;
    }
    let typical = middle(&mut distances[..k]) / MEDIAN;
    let mut any = false;
    for i in range {
        let distance = (x[i] - of(i)).abs();
        if distance <= least.max(FAR_OFF * typical) {
            continue;
        }
        let around = i.saturating_sub(AROUND).max(wide.start)..(i + AROUND + 1).min(wide.end);
        let (low, high) = around.map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if distance > 1.5 * (high - low) && marks[i] == GOOD {
            marks[i] = 1 + BadKind::Spike as u8;
            any = true;
        }
    }
    any
}
