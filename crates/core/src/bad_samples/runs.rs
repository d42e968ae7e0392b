//! Stretches of equal values: dropouts, frozen stretches, clipped peaks.

use std::ops::Range;

use super::about::{About, Other, SHARED};
use super::bridge::GOOD;
use super::differences::BLOCK;
use super::found::BadKind;
use super::look::{LEVELS, Look, OF_CONVERTER, RUN};

/// Fewest equal values that are looked at, of a coarse converter.
const COARSE_RUN: usize = 8;
/// A stretch of the target that is shorter is no rest.
const SHORT: usize = 32;
/// Of a peak that is cut off, the excess in its first and last quarter is less than this share of that in the middle.
const PEAKED: f64 = 0.8;
/// An actuator that is too slow comes apart from a command with flat tops everywhere, not only there.
const APART_OF_TARGET: f64 = 2.5;
/// A plateau is no motion where it lies beyond all others by this share of their range, and they move half of the time.
const BEYOND: f64 = 0.25;
/// Most of the samples that may be cut off at one level; of a target, which is computed, fewer.
const MOST_CLIPPED: [f64; 2] = [0.08, 0.2];
/// More stretches than this without a jump are a specimen that sticks.
const MOST_PARTED: usize = 3;
/// The other channel moves by so many standard deviations of the noise while this one does not.
const MOVES: f64 = 9.0;
const MOVES_OF_TARGET: f64 = 5.0;
/// A jump is so many times the steps around it.
const JUMP: f64 = 2.0;
/// What comes apart so many times as far as it mostly does, and by this share of the motion, has come apart.
const APART: f64 = 4.0;
const APART_OF_MOTION: f64 = 0.5;

/// Stretches of equal values that the other channel contradicts.
pub(super) fn mark_runs(marks: &mut [u8], channel: usize, signals: [&[f64]; 2], about: &About, looks: &[Look; 2]) {
    let signal = signals[channel];
    let other = Other::of(channel, signals, about);
    let (own, beside) = (&looks[channel], &looks[1 - channel]);
    let noise = own.noise.max(other.scale.abs() * beside.noise);
    // Numbers of a computed target are as fine as any: chance makes no two equal.
    let moves = if channel == 0 && own.level == 0.0 && own.equal < 0.1 { MOVES_OF_TARGET } else { MOVES };
    let least = (moves * noise).max(LEVELS * own.level).max(LEVELS * other.scale.abs() * beside.level);
    let apart = (APART * other.apart).max(APART_OF_MOTION * own.deviation);
    // Of a coarse converter a few equal values mean nothing.
    let coarse = own.level > 0.05 * own.noise || own.chance > OF_CONVERTER;
    // Of noise, as many equal values as chance does not make: each is so with level / (2 sqrt(pi) noise).
    let chance = (own.level / (3.5 * own.noise).max(1e-300)).max(own.chance).clamp(1e-12, 0.9);
    let by_chance = 1 + ((1e-5 / signal.len() as f64).ln() / chance.ln()).ceil() as usize;
    let shortest = match own.level {
        0.0 => RUN,
        _ if coarse => COARSE_RUN,
        _ => by_chance.clamp(RUN, COARSE_RUN),
    };
    let mut sticks = 0;
    let mut parted = [const { None }; MOST_PARTED];
    let mut clipped = [false; 2];
    let (low, high) = (own.low, own.high);
    let n = signal.len();
    let mut a = 0;
    while a < n {
        let value = signal[a];
        let mut b = a + 1;
        // Rounding is no change.
        while b < n && (signal[b] - value).abs() <= 1e-13 * own.deviation {
            b += 1;
        }
        // Of a coarse converter's noise, equal values tell something only where the other one moves by more than noise.
        let may_be_chance = coarse && b - a < by_chance;
        // The first of a frozen stretch is still right, but where the record starts with it nobody knows.
        let second = if a == 0 { 0 } else { a + 1 };
        if b - a >= shortest && marks[a] == GOOD {
            let run = Run { signal, other: &other, range: a..b, noise, level: own.level };
            let by_noise = !coarse && own.is_noisy && own.noise > 1e-9 * own.deviation && own.equal < 0.1;
            let side = [low, high].iter().position(|extreme| *extreme == value);
            if let Some(side) = side
                && run.goes_beyond(if side == 0 { -1.0 } else { 1.0 }, own, channel == 0)
            {
                clipped[side] = true;
            } else if run.moved() > if may_be_chance { least } else { 0.5 * least } {
                let mut ends = run.ends();
                // A command that steps is followed in the end.
                let left_alone = channel == 1 || run.is_left_alone(ends.jumps);
                if !left_alone {
                    ends = Ends { enters: false, leaves: false, jumps: false };
                }
                // In numbers as fine as these nothing is equal by chance.
                let by_fineness = channel == 0 && left_alone && !coarse && own.equal < 0.1 && run.moved() > least;
                // Without a jump it may have come to rest before the other one did.
                let rests = channel == 0 && b - a >= SHORT && !run.goes_on(0.25 * least);
                match ends {
                    Ends { enters: true, leaves, .. }
                        if leaves || run.parts(least.max(2.0 * other.apart), channel == 0) =>
                    {
                        marks[a..b].fill(1 + BadKind::Dropout as u8);
                    }
                    Ends { enters: false, leaves: true, jumps } => {
                        let (from, kind) = if jumps { (a, BadKind::Dropout) } else { (second, BadKind::Frozen) };
                        marks[from..b].fill(1 + kind as u8);
                    }
                    Ends { enters: false, leaves: false, jumps: true }
                        if a > 0
                            && (by_fineness
                                || (by_noise && run.is_alone())
                                || run.parts(least.max(apart), channel == 0)) =>
                    {
                        marks[a..b].fill(1 + BadKind::Dropout as u8);
                    }
                    Ends { enters: false, leaves: false, .. }
                        if !rests && (a > 0 || (channel == 1 && run.moved() > 2.0 * own.deviation)) =>
                    {
                        if by_fineness || (by_noise && run.is_alone()) {
                            marks[second..b].fill(1 + BadKind::Frozen as u8);
                        } else if run.parts(least.max(apart), channel == 0) {
                            if let Some(slot) = parted.get_mut(sticks) {
                                *slot = Some(second..b);
                            }
                            sticks += 1;
                        } else {
                            sticks += usize::from(a > 0 && b < n && run.moved() > least);
                        }
                    }
                    _ => {}
                }
            } else if by_noise && b - a < BLOCK && run.is_alone() {
                let jumps = run.ends().jumps;
                let (from, kind) = if jumps { (a, BadKind::Dropout) } else { (second, BadKind::Frozen) };
                marks[from..b].fill(1 + kind as u8);
            }
        }
        a = b;
    }
    // One that sticks does so again and again.
    if sticks <= MOST_PARTED {
        for run in parted.into_iter().flatten() {
            marks[run].fill(1 + BadKind::Frozen as u8);
        }
    }
    for (extreme, _) in [low, high].into_iter().zip(clipped).filter(|(_, clipped)| *clipped) {
        // A shape with flat tops rests there for long.
        if signal.iter().filter(|v| **v == extreme).count() as f64 > MOST_CLIPPED[channel] * n as f64 {
            continue;
        }
        for i in (0..n).filter(|&i| signal[i] == extreme) {
            let repeated = (i > 0 && signal[i - 1] == extreme) || (i + 1 < n && signal[i + 1] == extreme);
            if marks[i] == GOOD && repeated {
                marks[i] = 1 + BadKind::Clipped as u8;
            }
        }
    }
}

/// A stretch of equal values.
struct Run<'a> {
    signal: &'a [f64],
    other: &'a Other<'a>,
    range: Range<usize>,
    noise: f64,
    level: f64,
}

impl Run<'_> {
    /// The stretch without its first and last samples: the lag is known to a sample or two.
    fn inner(&self) -> Range<usize> {
        let cut = if self.range.len() > 8 { 2 } else { 0 };
        self.range.start + cut..self.range.end - cut
    }

    fn others(&self, range: Range<usize>) -> impl Iterator<Item = f64> {
        range.filter_map(|i| self.other.at(i))
    }

    /// How far the other channel moves.
    fn moved(&self) -> f64 {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = self.others(self.inner()).fold(ends, |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    }

    /// Whether the other channel moves by more than `least`, and than noise does, in the second half too, and where the record
    /// ends with this stretch by more than half of the first: what rests lets the other one come to rest.
    fn goes_on(&self, least: f64) -> bool {
        let Range { start: a, end: b } = self.range;
        let cut = (self.other.shift.unsigned_abs() + 2).min((b - a) / 4);
        let half = a + (b - a) / 2;
        let extent = |range: Range<usize>| {
            let ends = (f64::INFINITY, f64::NEG_INFINITY);
            let (low, high) = self.others(range).fold(ends, |(l, h), v| (l.min(v), h.max(v)));
            (high - low).max(0.0)
        };
        let (first, second) = (extent(a..half), extent(half..b - cut));
        // What noise does in so many samples.
        let at_rest = self.noise * (1.0 + 2.0 * (2.0 * ((b - half) as f64 + 1.0).ln()).sqrt());
        second > least.max(at_rest) && (b < self.signal.len() || second > 0.5 * first)
    }

    /// Of an excess beyond the extreme: that it is highest in the middle, as of a peak that is cut off; one that comes late and
    /// overshoots is highest at an end.
    fn is_peak(&self, side: f64) -> bool {
        let Range { start: a, end: b } = self.range;
        let quarter = (b - a) / 4;
        if quarter < 2 {
            return true;
        }
        let value = self.signal[a];
        let mean = |range: Range<usize>| {
            let (n, sum) = self.others(range).fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + side * (v - value)));
            sum / f64::max(n, 1.0)
        };
        let middle = mean(a + quarter..b - quarter);
        mean(a..a + quarter) < PEAKED * middle && mean(b - quarter..b) < PEAKED * middle
    }

    /// At a channel's extreme: whether the other one goes on beyond it and comes back, as peaks do that are cut off.
    fn goes_beyond(&self, side: f64, own: &Look, of_target: bool) -> bool {
        let Range { start: a, end: b } = self.range;
        if a < 4 || b + 4 > self.signal.len() {
            return false;
        }
        let value = self.signal[a];
        let (n, sum) = self.others(self.inner()).fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + side * (v - value)));
        let apart = if of_target { APART_OF_TARGET * self.other.apart } else { self.other.apart };
        let least = (1.5 * self.noise).max(0.005 * own.deviation).max(apart).max(2.0 * self.level);
        // It comes to its end as fast as it leaves it; one that sticks comes to rest.
        let (comes, leaves) = (self.signal[a - 1] - self.signal[a - 4], self.signal[b + 3] - self.signal[b]);
        let alike = side * comes > 0.0 && side * leaves < 0.0 && comes.abs() > 0.25 * leaves.abs();
        alike && sum > n * least && self.moved() > least && self.is_peak(side)
    }

    /// In its second half the other channel is nearer to what is before and after: it has not followed there.
    fn is_left_alone(&self, jumps: bool) -> bool {
        let Range { start: a, end: b } = self.range;
        let value = self.signal[a];
        let (before, after) = (self.signal[a.saturating_sub(1)], self.signal[b.min(self.signal.len() - 1)]);
        let cut = (self.other.shift.unsigned_abs() + 2).min((b - a) / 4);
        let (n, inside, outside) =
            self.others(a + (b - a) / 2..b - cut).fold((0.0, 0.0, 0.0), |(n, inside, outside), there| {
                let outside_here = (there - before).abs().min((there - after).abs());
                (n + 1.0, inside + (there - value).abs(), outside + outside_here)
            });
        let comes_apart = inside > n * 4.0 * self.other.apart || (!jumps && inside > 0.2 * n * (after - value).abs());
        n > 0.0 && (inside > outside || comes_apart)
    }

    /// The other channel does not rest as well.
    fn is_alone(&self) -> bool {
        let mut others = self.others(self.range.clone());
        let Some(first) = others.next() else { return false };
        others.any(|v| v != first)
    }

    /// How far the other channel comes away.
    fn parts(&self, least: f64, of_target: bool) -> bool {
        let value = self.signal[self.range.start];
        // A command that has stepped is followed after a while.
        let Range { start: a, end: b } = self.range;
        let half = a + (b - a) / 2;
        // A lag that is not one number for all makes the ends uncertain.
        let cut = (self.other.shift.unsigned_abs() + 2).min((b - a) / 4);
        let judged = if of_target { half..b - cut } else { a + cut..b - cut };
        self.others(judged).map(|v| (v - value).abs()).fold(0.0, f64::max) > least
    }

    /// Whether the ends are jumps that the other channel contradicts.
    fn ends(&self) -> Ends {
        let Range { start: a, end: b } = self.range;
        let (value, n) = (self.signal[a], self.signal.len());
        let step = |i: usize| if i > 0 && i < n { (self.signal[i] - self.signal[i - 1]).abs() } else { 0.0 };
        let steps = |range: Range<usize>| range.map(step).fold(0.0, f64::max);
        let around = steps(a.saturating_sub(4)..a).max(steps(b + 1..(b + 5).min(n)));
        let least = (6.0 * self.noise).max(3.0 * self.level);
        let cut = if self.range.len() > 8 { 2 } else { 0 };
        // The other channel tells on which side of the jump the signal should be.
        let is_wrong = |inside: usize, outside: usize| {
            let beyond = self.signal[outside];
            let jump = (beyond - value).abs();
            jump > least.max(JUMP * around)
                && !self.other.jumps(inside.min(outside), (SHARED * jump).max(least))
                && self.other.at(inside).is_some_and(|there| (there - value).abs() > (there - beyond).abs())
        };
        Ends {
            enters: a > 0 && is_wrong(a + cut, a - 1),
            leaves: b < n && is_wrong(b - 1 - cut, b),
            jumps: a > 0 && step(a) > least.max(1.2 * around),
        }
    }
}

/// How a stretch of equal values begins and ends.
#[derive(Debug, Clone, Copy)]
struct Ends {
    /// It is jumped to, or away from, where the other channel does not jump.
    enters: bool,
    leaves: bool,
    /// It is jumped to, if less clearly.
    jumps: bool,
}

/// Stretches of one value far beyond all others, of a channel that moves: no other channel need be asked.
pub(super) fn mark_plateaus(signal: &[f64], marks: &mut [u8], look: &Look) -> bool {
    let (mut low, mut high, mut n, mut moves) = (f64::INFINITY, f64::NEG_INFINITY, 0usize, 0usize);
    let is_inner = |v: f64| v != look.low && v != look.high;
    for (i, &v) in signal.iter().enumerate().filter(|(_, v)| is_inner(**v)) {
        (low, high, n) = (low.min(v), high.max(v), n + 1);
        moves += usize::from(i > 0 && v != signal[i - 1]);
    }
    if 2 * n < signal.len() || 2 * moves < n || high <= low {
        return false;
    }
    let least = BEYOND * (high - low);
    let beyond = [look.low < low - least, look.high > high + least];
    let mut any = false;
    let mut a = 0;
    while beyond != [false; 2] && a < signal.len() {
        let value = signal[a];
        let b = a + signal[a..].iter().take_while(|v| **v == value).count();
        if b - a >= RUN && ((beyond[0] && value == look.low) || (beyond[1] && value == look.high)) {
            marks[a..b].fill(1 + BadKind::Dropout as u8);
            any = true;
        }
        a = b;
    }
    any
}
