//! Samples that are no motion: spikes, dropouts, frozen stretches, clipped peaks, and values that are held.
//!
//! A spike leaves and returns within one sample. With the fourth difference and the second about a sample,
//!
//! ```text
//! g_i = (x_(i-2) - 4 x_(i-1) + 6 x_i - 4 x_(i+1) + x_(i+2)) / 6,   h_i = x_i - (x_(i-1) + x_(i+1)) / 2,
//! ```
//!
//! both of a spike its height, it stands out of the median of |g| or |h| around it; a kink or a step has another shape. A stretch
//! of equal values is no motion where the other channel, shifted and scaled to lie upon this one, moves on: the value jumps to
//! it at the end (and away from it at the start of a dropout), or the two come apart far beyond what they do elsewhere. So a
//! command that rests, a square wave, a coarse converter and a specimen that sticks are left alone. A channel whose values change
//! at every k-th sample only is held: it is read between those.

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce};

use crate::alignment::Alignment;
use crate::lag::{Search, SearchState, View};
use crate::lagrange::{BEFORE, NODES, Taps};
use crate::pair::Pair;
use crate::sums;
use crate::tracking::EvaluatorConfig;

/// What is done with samples that are no motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BadSamples {
    /// They have no part in the estimate, nor in its interval.
    #[default]
    LeaveOut,
    /// They are not looked for.
    Keep,
}

/// A kind of bad samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum BadKind {
    /// One sample that leaves and returns.
    Spike,
    /// A stretch of one value, to which the signal jumps.
    Dropout,
    /// A stretch of the last value, from which the signal jumps.
    Frozen,
    /// Peaks cut off at one value.
    Clipped,
    /// A value that is repeated until the next one, regularly.
    Held,
}

/// All kinds, in the order in which they are told.
pub const BAD_KINDS: [BadKind; 5] =
    [BadKind::Spike, BadKind::Dropout, BadKind::Frozen, BadKind::Clipped, BadKind::Held];

impl BadSamples {
    /// All choices with their names.
    pub const NAMES: [(&'static str, BadSamples); 2] =
        [("leave_out", BadSamples::LeaveOut), ("keep", BadSamples::Keep)];
}

impl BadKind {
    /// The word that stands for it in files.
    pub fn code(self) -> &'static str {
        match self {
            BadKind::Spike => "spike",
            BadKind::Dropout => "dropout",
            BadKind::Frozen => "frozen",
            BadKind::Clipped => "clipped",
            BadKind::Held => "held",
        }
    }
}

/// How many samples of one kind a channel has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BadCount {
    /// Samples.
    pub count: u32,
    /// Index of the first of them.
    pub first: u32,
    /// Of `held`, samples from one fresh value to the next; else 0.
    pub every: u32,
}

/// What was found: of target, then of measured, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BadFound {
    counts: [[BadCount; BAD_KINDS.len()]; 2],
}

impl BadFound {
    /// Nothing.
    pub const NONE: Self = Self { counts: [[BadCount { count: 0, first: 0, every: 0 }; BAD_KINDS.len()]; 2] };

    /// The kinds that are there, of target (0) first.
    pub fn iter(&self) -> impl Iterator<Item = (usize, BadKind, BadCount)> + '_ {
        let of = |channel: usize| {
            BAD_KINDS.into_iter().map(move |kind| (channel, kind, self.counts[channel][kind as usize]))
        };
        of(0).chain(of(1)).filter(|(_, _, found)| found.count > 0)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    fn add(&mut self, channel: usize, kind: BadKind, at: usize) {
        let found = &mut self.counts[channel][kind as usize];
        let at = u32::try_from(at).unwrap_or(u32::MAX);
        found.first = if found.count == 0 { at } else { found.first.min(at) };
        found.count = found.count.saturating_add(1);
    }
}

/// Of target and measured, the stretches that are bridged.
pub type Gaps = [Vec<Range<usize>>; 2];

/// Both channels of a pair with their bad samples bridged, or read between fresh ones, and where they are bridged; None where
/// there are none, or where `config` keeps them.
pub fn bridged(pair: &Pair<'_>, config: &EvaluatorConfig) -> Option<([Vec<f64>; 2], Gaps)> {
    Alignment::examined(pair, config).map(|examination| (examination.signals, examination.gaps))
}

/// How one channel lies upon the other: measured_(i + lag) ~ gain target_i + offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct About {
    pub(crate) lag: isize,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    /// The least distance that one in ten exceeds, in units of measured.
    pub(crate) apart: f64,
}

impl About {
    /// From the highest peak of the correlation, over the window that starts at `start`.
    pub(crate) fn find(search: &Search, state: &mut SearchState, view: &View<'_>, start: usize) -> Option<Self> {
        let lag = search.peaks(state, view, start, None).ok()?.first().lag.round() as isize;
        let n = search.n_samples() as isize;
        let own = start as isize - view.origin as isize;
        let from = own.max(lag);
        let to = (own + n).min(view.target.len() as isize + lag).min(view.measured.len() as isize);
        if to - from < 16 {
            return None;
        }
        let (from, to) = (from as usize, to as usize);
        let measured = &view.measured[from..to];
        let target = &view.target[from.wrapping_add_signed(-lag)..to.wrapping_add_signed(-lag)];
        let mut fit = Self { lag, gain: 0.0, offset: 0.0, apart: f64::INFINITY };
        // What repeats the value before may be no motion; of a converter, or held, most of all may do so.
        let moves = |i: usize| i > 0 && target[i] != target[i - 1] && measured[i] != measured[i - 1];
        let moving = 3 * (0..target.len()).filter(|&i| moves(i)).count() > target.len();
        // Once more without what is far off.
        for _ in 0..2 {
            let near = || {
                let within = move |i: &usize| (measured[*i] - fit.gain * target[*i] - fit.offset).abs() <= fit.apart;
                let pairs = (0..target.len()).filter(move |&i| !moving || moves(i));
                pairs.filter(within).map(|i| (target[i], measured[i]))
            };
            let (k, x, y) = near().fold((0.0, 0.0, 0.0), |(k, a, b), (x, y)| (k + 1.0, a + x, b + y));
            let (mean_x, mean_y) = (x / k, y / k);
            let (xx, xy) = near().fold((0.0, 0.0), |(xx, xy), (x, y)| {
                (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y))
            });
            if !(xx > 0.0 && xy != 0.0) {
                return None;
            }
            let gain = xy / xx;
            let offset = mean_y - gain * mean_x;
            let mut apart = [0.0; 1024];
            let step = (target.len() / apart.len()).max(1);
            let mut m = 0;
            for i in (0..target.len()).step_by(step).filter(|&i| !moving || moves(i)).take(apart.len()) {
                apart[m] = (measured[i] - gain * target[i] - offset).abs();
                m += 1;
            }
            if m == 0 {
                return None;
            }
            let at = (9 * m / 10).min(m - 1);
            let tenth = *apart[..m].select_nth_unstable_by(at, f64::total_cmp).1;
            fit = Self { lag, gain, offset, apart: 2.0 * tenth };
        }
        Some(Self { apart: 0.5 * fit.apart, ..fit })
    }
}

/// Samples that are looked at together.
const BLOCK: usize = 128;
/// A block is looked at closely where its largest |g| is so many times their mean.
const STANDS_OUT: f64 = 5.2;
/// A spike is so many standard deviations of the noise high, by g and by h.
const SPIKE_BY_G: f64 = 7.7;
const SPIKE_BY_H: f64 = 6.8;
/// And by g where h is asked.
const LIKELY_BY_G: f64 = 5.8;
/// sqrt(70 / 36) and sqrt(3 / 2): of white noise, standard deviations of g and h; and the median of |x| of a normal x.
const OF_G: f64 = 1.394_433_377_556_793;
const OF_H: f64 = 1.224_744_871_391_589;
const MEDIAN: f64 = 0.674_489_750_196_082;
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
/// Fewest equal values that are looked at; of a coarse converter.
const RUN: usize = 3;
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
/// Where the other channel jumps as well, by this share, it is motion.
const SHARED: f64 = 0.3;
/// What comes apart so many times as far as it mostly does, and by this share of the motion, has come apart.
const APART: f64 = 4.0;
const APART_OF_MOTION: f64 = 0.5;
/// Steps of a converter.
const LEVELS: f64 = 4.0;
/// Held: fewest changes; share of them at every k-th sample; samples of a value at most.
const CHANGES: usize = 16;
const REGULAR: f64 = 0.97;
const REGULAR_SPACING: f64 = 0.94;
/// So many values, or fewer, are levels of a command; so many spacings alike are even times.
const FEW_LEVELS: usize = 8;
const EVEN_TIMES: f64 = 0.8;
/// An end is a spike where it leaves by so many times what the sample beside it does, and by so many standard deviations.
const OF_END: f64 = 4.0;
const SPIKE_BY_END: f64 = 25.0;
const OF_DEVIATION: f64 = 0.01;
const LONGEST_HOLD: usize = 64;
/// More pairs of equal values than this share are a converter's.
const OF_CONVERTER: f64 = 0.002;
/// A change by one step of the converter in so many of ten is a slow ramp.
const OF_ONE_LEVEL: f64 = 0.8;
const GOOD: u8 = 0;

/// Both channels without their bad samples, and where these are. Grows on the first record that has some.
#[derive(Debug, Clone, Default)]
pub(crate) struct Examination {
    /// Bridged, or read between fresh values: for what needs all samples.
    signals: [Vec<f64>; 2],
    /// 0, or 1 + kind.
    marks: [Vec<u8>; 2],
    gaps: [Vec<Range<usize>>; 2],
    found: BadFound,
}

impl Examination {
    /// Makes room for records of `n` samples, so that nothing is allocated later.
    pub(crate) fn reserve(&mut self, n: usize) {
        self.signals.iter_mut().for_each(|s| s.reserve(n));
        self.marks.iter_mut().for_each(|m| m.reserve(n));
        self.gaps.iter_mut().for_each(|g| g.reserve(n / 2 + 1));
    }

    pub(crate) fn found(&self) -> BadFound {
        self.found
    }

    /// Share of the samples that are left out, of the channel that has more.
    pub(crate) fn share(&self) -> f64 {
        let lost = |gaps: &Vec<Range<usize>>| gaps.iter().map(Range::len).sum::<usize>();
        self.gaps.iter().map(lost).max().unwrap_or(0) as f64 / self.signals[0].len().max(1) as f64
    }

    /// Both channels from the first sample of the record on, with bad samples bridged, and known as gaps.
    pub(crate) fn view(&self) -> View<'_> {
        let [target, measured] = &self.signals;
        View { target, measured, origin: 0, gaps: [&self.gaps[0], &self.gaps[1]] }
    }

    /// Looks at both channels; whether there are bad samples. `about` is asked at most once, of the signals without what is
    /// far off, and only where it matters.
    pub(crate) fn examine(&mut self, signals: [&[f64]; 2], about: impl FnOnce([&[f64]; 2]) -> Option<About>) -> bool {
        self.found = BadFound::NONE;
        let first = signals.map(Sight::of);
        if first.iter().all(|sight| !sight.asks_for_more()) {
            return false;
        }
        let mut looks = [0, 1].map(|c| Look::at(signals[c], first[c]));
        for (own, signal) in self.signals.iter_mut().zip(signals) {
            own.clear();
            own.extend_from_slice(signal);
        }
        for (marks, signal) in self.marks.iter_mut().zip(signals) {
            marks.clear();
            marks.resize(signal.len(), GOOD);
        }
        let held = [0, 1].map(|c| if looks[c].sight.repeats { held(signals[c], looks[c].level) } else { None });
        for (look, (held, signal)) in looks.iter_mut().zip(held.iter().zip(signals)) {
            if let Some(held) = held {
                look.noise = look.noise.max(noise_of_fresh(signal, held));
            }
        }
        let repeats = [0, 1].map(|c| looks[c].sight.repeats && held[c].is_none());
        for c in (0..2).filter(|&c| repeats[c]) {
            if mark_plateaus(signals[c], &mut self.marks[c], &looks[c]) {
                bridge(&mut self.signals[c], &self.marks[c], 0..signals[c].len());
                let sight = Sight { repeats: true, ..Sight::of(&self.signals[c]) };
                looks[c] = Look::at(&self.signals[c], sight);
            }
        }
        let mut about = Some(about);
        let mut found = None;
        if repeats != [false; 2] {
            found = about.take().and_then(|about| about([&self.signals[0], &self.signals[1]]));
            if let Some(about) = &found {
                for c in (0..2).filter(|&c| repeats[c]) {
                    self.mark_runs(c, signals, about, &looks);
                    bridge(&mut self.signals[c], &self.marks[c], 0..signals[c].len());
                }
            }
        }
        let mut spiked = false;
        for c in (0..2).filter(|&c| held[c].is_none() && (looks[c].sight.stands_out || looks[c].sight.at_ends)) {
            spiked |= self.mark_spikes(c, &looks[c]);
        }
        if spiked {
            found = found.or_else(|| about.take().and_then(|about| about([&self.signals[0], &self.signals[1]])));
            if let Some(about) = &found {
                self.unmark_shared_spikes(signals, about);
            }
        }
        for c in 0..2 {
            match held[c] {
                Some(held) => self.read_between(c, signals[c], held),
                None => self.bridge(c, signals[c]),
            }
        }
        !self.found.is_empty()
    }

    /// Spikes, the highest first; each is bridged before the next look.
    fn mark_spikes(&mut self, channel: usize, look: &Look) -> bool {
        let (signal, marks) = (&mut self.signals[channel], &mut self.marks[channel]);
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
    fn unmark_shared_spikes(&mut self, signals: [&[f64]; 2], about: &About) {
        for c in 0..2 {
            let other = Other::of(c, signals, about);
            let (mut shared, mut own) = (0, 0);
            for i in 0..self.marks[c].len() {
                if self.marks[c][i] != 1 + BadKind::Spike as u8 {
                    continue;
                }
                let height = signals[c][i] - self.signals[c][i];
                // Beside an end it may as well have been a step.
                let at_end = i == 0 || i + 1 == signals[c].len();
                if at_end && other.jumps(i, SHARED * height.abs()) {
                    self.marks[c][i] = GOOD;
                    continue;
                }
                // At the same instant in both it is in the wiring, or the earth; of that nothing is left out.
                let alike = |at: isize| {
                    at >= 1
                        && at + 1 < other.signal.len() as isize
                        && other.scale * second(other.signal, at as usize) * height.signum() > SHARED * height.abs()
                };
                if (-3..=3).any(|d| alike(other.index(i as isize + d)) || alike(i as isize + d)) {
                    self.marks[c][i] = GOOD;
                    shared += 1;
                } else {
                    own += 1;
                }
            }
            // Where most are, so is the rest, too small to be seen in the other.
            if shared > own {
                let spikes = self.marks[c].iter_mut().filter(|mark| **mark == 1 + BadKind::Spike as u8);
                spikes.for_each(|mark| *mark = GOOD);
            }
        }
    }

    /// Stretches of equal values that the other channel contradicts.
    fn mark_runs(&mut self, channel: usize, signals: [&[f64]; 2], about: &About, looks: &[Look; 2]) {
        let (signal, marks) = (signals[channel], &mut self.marks[channel]);
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

    /// Counts what is marked, and puts a straight line in its place.
    fn bridge(&mut self, channel: usize, signal: &[f64]) {
        let (own, marks, gaps) = (&mut self.signals[channel], &self.marks[channel], &mut self.gaps[channel]);
        own.copy_from_slice(signal);
        gaps.clear();
        for (i, mark) in marks.iter().enumerate().filter(|(_, mark)| **mark != GOOD) {
            self.found.add(channel, BAD_KINDS[usize::from(*mark) - 1], i);
            match gaps.last_mut() {
                Some(gap) if gap.end == i => gap.end = i + 1,
                _ => gaps.push(i..i + 1),
            }
        }
        bridge(own, marks, 0..signal.len());
    }

    /// Reads a held channel between its fresh values.
    fn read_between(&mut self, channel: usize, signal: &[f64], held: Held) {
        let Held { every, phase } = held;
        let (own, gaps) = (&mut self.signals[channel], &mut self.gaps[channel]);
        gaps.clear();
        let n = signal.len();
        let fresh = (n - phase).div_ceil(every);
        let mut stale = 0u32;
        for i in (0..n).filter(|i| (i + every - phase % every) % every != 0) {
            if stale == 0 {
                self.found.add(channel, BadKind::Held, i);
            }
            stale += 1;
        }
        let found = &mut self.found.counts[channel][BadKind::Held as usize];
        (found.count, found.every) = (stale, every as u32);
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
            for i in (first..last).filter(|i| (i + every - phase % every) % every != 0) {
                match gaps.last_mut() {
                    Some(gap) if gap.end == i => gap.end = i + 1,
                    _ => gaps.push(i..i + 1),
                }
            }
        }
    }
}

/// What is seen of a channel in one pass.
#[derive(Debug, Clone, Copy)]
struct Sight {
    stands_out: bool,
    /// The first or the last sample may stand out.
    at_ends: bool,
    repeats: bool,
}

impl Sight {
    fn of(signal: &[f64]) -> Self {
        let (stands_out, threes, equals) = Arch::new().dispatch(FirstSight(signal));
        // A value held for two samples has no three alike.
        let repeats = threes > 0 || 3 * equals > signal.len();
        Self { stands_out, at_ends: leaves_ends(signal) != [false; 2], repeats }
    }

    fn asks_for_more(&self) -> bool {
        self.stands_out || self.at_ends || self.repeats
    }
}

/// What one channel looks like, by a closer look.
#[derive(Debug, Clone, Copy)]
struct Look {
    sight: Sight,
    /// Standard deviation of the noise, by the median of |g|.
    noise: f64,
    /// It is noise indeed, and not the motion's.
    is_noisy: bool,
    /// Smallest change, one step of a converter.
    level: f64,
    /// How often a value is that of the sample before, by chance; and the share of all that are.
    chance: f64,
    equal: f64,
    deviation: f64,
    peak: f64,
    low: f64,
    high: f64,
}

impl Look {
    fn at(signal: &[f64], sight: Sight) -> Self {
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

/// The other channel, shifted and scaled to lie upon this one.
struct Other<'a> {
    signal: &'a [f64],
    shift: isize,
    scale: f64,
    offset: f64,
    apart: f64,
}

impl<'a> Other<'a> {
    fn of(channel: usize, signals: [&'a [f64]; 2], about: &About) -> Self {
        let About { lag, gain, offset, apart } = *about;
        if channel == 0 {
            let scale = 1.0 / gain;
            Self { signal: signals[1], shift: lag, scale, offset: -offset / gain, apart: apart / gain.abs() }
        } else {
            Self { signal: signals[0], shift: -lag, scale: gain, offset, apart }
        }
    }

    fn index(&self, i: isize) -> isize {
        i + self.shift
    }

    /// Whether it jumps by more than `least` from one sample to the next, where this channel is at sample i, or about there.
    fn jumps(&self, i: usize, least: f64) -> bool {
        let reach = 32 + 2 * self.shift.abs();
        let from = (self.index(i as isize) - reach).max(0) as usize;
        let to = ((self.index(i as isize) + reach).max(0) as usize).min(self.signal.len());
        from < to && self.signal[from..to].windows(2).any(|w| (self.scale * (w[1] - w[0])).abs() > least)
    }

    fn at(&self, i: usize) -> Option<f64> {
        let at = usize::try_from(self.index(i as isize)).ok()?;
        Some(self.scale * self.signal.get(at)? + self.offset)
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

/// Where a held channel has its fresh values.
#[derive(Debug, Clone, Copy)]
struct Held {
    every: usize,
    phase: usize,
}

/// Whether values change at every k-th sample only, at rest as in motion.
fn held(signal: &[f64], level: f64) -> Option<Held> {
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
fn noise_of_fresh(signal: &[f64], held: &Held) -> f64 {
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

/// Stretches of one value far beyond all others, of a channel that moves: no other channel need be asked.
fn mark_plateaus(signal: &[f64], marks: &mut [u8], look: &Look) -> bool {
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

/// The first and the last sample less the parabola through the three beside it, and how far the same leaves the next one: for
/// each end.
fn of_ends(x: &[f64]) -> [(f64, f64); 2] {
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
fn leaves_ends(x: &[f64]) -> [bool; 2] {
    let n = x.len();
    let ends = of_ends(x);
    let blocks = [0..BLOCK.min(n), n.saturating_sub(BLOCK)..n];
    std::array::from_fn(|side| {
        let (own, next) = ends[side];
        own > OF_END * next && own > SPIKE_BY_END * median(x, &blocks[side], fourth) / (MEDIAN * OF_G)
    })
}

/// The ends that are spikes.
fn ends_that_leave(x: &[f64], look: &Look) -> [Option<usize>; 2] {
    let least = (4.0 * LEVELS * look.level).max(OF_DEVIATION * look.deviation);
    let (ends, leave) = (of_ends(x), leaves_ends(x));
    std::array::from_fn(|side| (leave[side] && ends[side].0 > least).then_some(if side == 0 { 0 } else { x.len() - 1 }))
}

/// g about sample i, which has two neighbours on either side.
#[inline(always)]
fn fourth(x: &[f64], i: usize) -> f64 {
    (x[i - 2] + x[i + 2] - 4.0 * (x[i - 1] + x[i + 1]) + 6.0 * x[i]) / 6.0
}

/// h about sample i.
#[inline(always)]
fn second(x: &[f64], i: usize) -> f64 {
    x[i] - 0.5 * (x[i - 1] + x[i + 1])
}

/// Whether a block's largest |g| stands out of all.
fn stands_out(signal: &[f64], own: &Range<usize>) -> bool {
    let range = own.start.max(2)..own.end.min(signal.len().saturating_sub(2));
    if range.len() < 8 {
        return false;
    }
    let (most, sum) = spread_of(&signal[range.start - 2..range.end + 2]);
    most * range.len() as f64 > STANDS_OUT * sum && most > LIKELY_BY_G * OF_G * median(signal, own, fourth) / MEDIAN
}

/// The largest |g| and the sum of all.
#[inline(always)]
fn spread_of(around: &[f64]) -> (f64, f64) {
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

/// The median of |spread| over a block.
fn median(signal: &[f64], range: &Range<usize>, spread: fn(&[f64], usize) -> f64) -> f64 {
    let mut values = [0.0; BLOCK];
    let mut k = 0;
    for i in range.start.max(2)..range.end.min(signal.len().saturating_sub(2)) {
        values[k] = spread(signal, i).abs();
        k += 1;
    }
    middle(&mut values[..k])
}

/// The middle value; 0 of none.
fn middle(values: &mut [f64]) -> f64 {
    let half = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(half, f64::total_cmp).1 }
}

/// A straight line from good to good sample in place of what is marked in `range`, of one sample a cubic; of ends, the nearest
/// good one.
fn bridge(signal: &mut [f64], marks: &[u8], range: Range<usize>) {
    let n = signal.len();
    let mut a = range.start;
    while a < range.end {
        if marks[a] == GOOD {
            a += 1;
            continue;
        }
        let mut first = a;
        while first > 0 && marks[first - 1] != GOOD {
            first -= 1;
        }
        let mut b = a;
        while b < n && marks[b] != GOOD {
            b += 1;
        }
        match (first.checked_sub(1).map(|i| signal[i]), signal.get(b).copied()) {
            // Of one sample the cubic through its neighbours, so that those do not stand out.
            (Some(_), Some(_)) if b - first == 1 && first >= 2 && marks.get(b + 1) == Some(&GOOD) => {
                signal[first] -= fourth(signal, first);
            }
            (Some(from), Some(to)) => {
                let step = (to - from) / (b - first + 1) as f64;
                (first..b).for_each(|i| signal[i] = from + step * (i - first + 1) as f64);
            }
            (Some(end), None) | (None, Some(end)) => signal[first..b].fill(end),
            (None, None) => {}
        }
        a = b;
    }
}
