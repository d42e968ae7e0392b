//! Which samples came, which did not, and which came twice, by the sender's counter.
//!
//! The counter goes up by one a sample. Integers wrap around at their width. What goes up in other steps, such as seconds or the
//! ticks of a faster clock, is no counter in this sense: with it every sample would follow a gap, or none would be a count.

/// How far back it is known which samples came.
const MEMORY: i64 = 16_384;
/// A counter that goes back by so much, and by so many of the longest blocks of samples, has started anew: a block may be copied
/// or overtaken whole.
const FAR_BACK: i64 = 1024;
const BLOCKS: i64 = 4;
/// A jump forward by more than this (48 days at 1024 Hz) is a counter that started anew, not a loss.
const FARTHEST: i64 = 1 << 32;
/// So many samples in a row that have all been seen are a counter that started anew, not copies.
const REPLAYED: i64 = 256;

/// Totals. `received` counts every sample once, so that received + lost is what the sender counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Samples that came, in their place or late.
    pub received: u64,
    /// Samples that did not come.
    pub lost: u64,
    /// Copies of samples that had come already.
    pub repeated: u64,
    /// Samples that came late: received, but their place had been filled or given up.
    pub reordered: u64,
    /// Samples put on a straight line over a gap.
    pub filled: u64,
    /// How often the window was started anew.
    pub restarts: u64,
}

/// What to do with a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// It follows the one before.
    Next,
    /// So many are missing before it: fill them.
    AfterGap(u64),
    /// So many are missing before it, too many to fill: start the window anew, but time has gone on.
    AfterLoss(u64),
    /// The counter started anew: start the window anew.
    Restarted,
    /// A copy, or too late to be used.
    Dropped,
}

/// Follows one counter.
#[derive(Debug, Clone)]
pub struct Sequence {
    bits: u32,
    /// Samples of the longest block that has come at once.
    block: i64,
    /// A negative counter has come.
    signed: bool,
    fill_samples: u64,
    tally: Tally,
    /// The newest counter as it was sent, and unwrapped.
    newest: Option<(i64, i64)>,
    /// Unwrapped counter of the first sample since the counter started.
    oldest: i64,
    seen: [u64; (MEMORY / 64) as usize],
    /// Unwrapped counter of the last arrival that was seen before, and how many came in a row.
    replay: (i64, u32),
}

impl Sequence {
    /// A counter of `bits` bits; gaps of up to `fill_samples` are filled.
    pub fn new(bits: u32, fill_samples: u64) -> Self {
        let (oldest, seen, replay) = (0, [0; (MEMORY / 64) as usize], (0, 0));
        Self {
            bits,
            block: 1,
            signed: false,
            fill_samples,
            tally: Tally::default(),
            newest: None,
            oldest,
            seen,
            replay,
        }
    }

    /// So many samples come at once.
    pub fn comes_in_blocks(&mut self, n_samples: usize) {
        self.block = self.block.max(n_samples as i64);
    }

    /// The totals so far.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// A sample without a counter, which always follows the one before.
    pub fn uncounted(&mut self) -> Place {
        self.tally.received += 1;
        Place::Next
    }

    /// The same after a silence: what came before does not go on.
    pub fn uncounted_anew(&mut self) -> Place {
        self.tally.received += 1;
        self.tally.restarts += 1;
        Place::Restarted
    }

    /// Where the sample `counter` belongs. After a pause (`paused`) a counter that is behind has started anew: nothing
    /// overtakes for that long.
    pub fn place(&mut self, counter: i64, paused: bool) -> Place {
        self.place_within(counter, paused, FARTHEST)
    }

    /// The same where a jump ahead by more than `farthest` is a counter that started anew: no sender has got that far.
    pub fn place_within(&mut self, counter: i64, paused: bool, farthest: i64) -> Place {
        self.signed |= counter < 0;
        let Some((sent, newest)) = self.newest else {
            self.begin(counter);
            return Place::Next;
        };
        let step = self.difference(counter, sent);
        if step > farthest.min(FARTHEST)
            || step <= -(BLOCKS * self.block).clamp(FAR_BACK, MEMORY)
            || (step < 0 && paused)
        {
            return self.restart(counter);
        }
        // Unwrapped counters start at zero and grow by at most FARTHEST a sample.
        let position = newest.saturating_add(step);
        if step <= 0 {
            return self.behind(counter, position);
        }
        self.advance(counter, position, step);
        let missing = (step - 1) as u64;
        self.tally.received += 1;
        self.tally.lost += missing;
        match missing {
            0 => Place::Next,
            n if n <= self.fill_samples => {
                self.tally.filled += n;
                Place::AfterGap(n)
            }
            n => {
                self.tally.restarts += 1;
                Place::AfterLoss(n)
            }
        }
    }

    /// The counter that lies `n` before `counter`, which has just been placed, and at most as far as the one placed before.
    ///
    /// A wrapping counter's type is not known to be signed: below zero lie the largest unsigned counters, unless there are
    /// negative ones about.
    pub fn before(&self, counter: i64, n: u64) -> i64 {
        let earlier = counter.wrapping_sub(n as i64);
        let lowest = if self.signed { -(1i64 << (self.bits.min(63) - 1)) } else { 0 };
        if self.bits < 64 && earlier < lowest { earlier + (1 << self.bits) } else { earlier }
    }

    /// From `from` to `to` the shorter way round.
    fn difference(&self, to: i64, from: i64) -> i64 {
        let shift = 64 - self.bits;
        (to.wrapping_sub(from) << shift) >> shift
    }

    fn begin(&mut self, counter: i64) {
        self.tally.received += 1;
        self.newest = Some((counter, 0));
        self.oldest = 0;
        self.seen.fill(0);
        self.replay = (0, 0);
        self.mark(0);
    }

    fn restart(&mut self, counter: i64) -> Place {
        self.begin(counter);
        self.tally.restarts += 1;
        Place::Restarted
    }

    fn advance(&mut self, counter: i64, position: i64, step: i64) {
        if step >= MEMORY {
            self.seen.fill(0);
        } else {
            (position - step + 1..position).for_each(|p| self.clear(p));
        }
        self.mark(position);
        self.newest = Some((counter, position));
        self.replay = (0, 0);
    }

    /// A sample no newer than the newest, within memory.
    fn behind(&mut self, counter: i64, position: i64) -> Place {
        if position >= self.oldest && self.is_marked(position) {
            let (last, run) = self.replay;
            self.replay = (position, if run > 0 && position == last + 1 { run + 1 } else { 1 });
            if i64::from(self.replay.1) > REPLAYED.max(2 * self.block) {
                return self.restart(counter);
            }
            self.tally.repeated += 1;
            return Place::Dropped;
        }
        self.tally.received += 1;
        self.tally.reordered += 1;
        if position >= self.oldest {
            self.tally.lost -= 1;
        } else {
            // Older than the first that came: what lies between is missing too.
            self.tally.lost += (self.oldest - position - 1) as u64;
            (position..self.oldest).for_each(|p| self.clear(p));
            self.oldest = position;
        }
        self.mark(position);
        Place::Dropped
    }

    fn slot(position: i64) -> (usize, u64) {
        let bit = position.rem_euclid(MEMORY) as usize;
        (bit / 64, 1 << (bit % 64))
    }

    fn mark(&mut self, position: i64) {
        let (word, bit) = Self::slot(position);
        self.seen[word] |= bit;
    }

    fn clear(&mut self, position: i64) {
        let (word, bit) = Self::slot(position);
        self.seen[word] &= !bit;
    }

    fn is_marked(&self, position: i64) -> bool {
        let (word, bit) = Self::slot(position);
        self.seen[word] & bit != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fed(bits: u32, fill: u64, counters: &[i64]) -> (Vec<Place>, Tally) {
        let mut sequence = Sequence::new(bits, fill);
        let places = counters.iter().map(|c| sequence.place(*c, false)).collect();
        (places, sequence.tally())
    }

    #[test]
    fn short_gaps_are_filled_and_long_ones_restart_the_window() {
        let (places, tally) = fed(64, 3, &[10, 11, 15, 16, 21]);
        assert_eq!(places, [Place::Next, Place::Next, Place::AfterGap(3), Place::Next, Place::AfterLoss(4)]);
        assert_eq!(tally, Tally { received: 5, lost: 7, filled: 3, restarts: 1, ..Tally::default() });
    }

    #[test]
    fn a_late_sample_was_not_lost_and_its_second_copy_is_repeated() {
        let (places, tally) = fed(64, 3, &[1, 2, 4, 3, 3, 4, 5]);
        let dropped = Place::Dropped;
        assert_eq!(places[2..], [Place::AfterGap(1), dropped, dropped, dropped, Place::Next]);
        assert_eq!(tally, Tally { received: 5, repeated: 2, reordered: 1, filled: 1, ..Tally::default() });
    }

    #[test]
    fn a_sample_from_before_the_first_is_late_too() {
        let (_, tally) = fed(64, 3, &[10, 9, 11, 6]);
        assert_eq!(tally, Tally { received: 4, lost: 2, reordered: 2, ..Tally::default() });
    }

    #[test]
    fn a_counter_that_goes_back_far_has_started_anew() {
        let (places, tally) = fed(64, 3, &[5000, 5001, 0, 1, 2]);
        assert_eq!(places[2..], [Place::Restarted, Place::Next, Place::Next]);
        assert_eq!(tally, Tally { received: 5, restarts: 1, ..Tally::default() });
    }

    #[test]
    fn the_longest_datagram_may_come_twice_or_be_overtaken() {
        let mut sequence = Sequence::new(64, 3);
        sequence.comes_in_blocks(2729);
        // The second comes twice, and the fourth after the fifth.
        for from in [0, 2729, 2729, 2 * 2729, 4 * 2729, 3 * 2729, 5 * 2729] {
            (from..from + 2729).for_each(|c| {
                sequence.place(c, false);
            });
        }
        let tally = sequence.tally();
        assert_eq!((tally.received, tally.repeated, tally.reordered, tally.lost), (6 * 2729, 2729, 2729, 0));
        // The fourth's absence was a gap too long to be filled.
        assert_eq!(tally.restarts, 1);
    }

    #[test]
    fn a_jump_ahead_beyond_what_time_allows_is_a_new_start() {
        let mut sequence = Sequence::new(64, 3);
        assert_eq!(sequence.place(0, false), Place::Next);
        assert_eq!(sequence.place_within(5000, false, 4000), Place::Restarted);
        assert_eq!(sequence.place_within(8000, false, 4000), Place::AfterLoss(2999));
        assert_eq!(sequence.tally().lost, 2999);
    }

    #[test]
    fn a_counter_that_goes_back_after_a_pause_has_started_anew_however_near() {
        let mut sequence = Sequence::new(64, 3);
        (0..100).for_each(|c| assert_eq!(sequence.place(c, false), Place::Next));
        assert_eq!(sequence.place(0, true), Place::Restarted);
        assert_eq!(sequence.place(1, false), Place::Next);
    }

    #[test]
    fn a_repeated_sample_after_a_pause_is_still_repeated() {
        let mut sequence = Sequence::new(64, 3);
        sequence.place(7, false);
        assert_eq!(sequence.place(7, true), Place::Dropped);
        assert_eq!(sequence.tally().repeated, 1);
    }

    #[test]
    fn a_short_record_played_again_without_a_pause_is_found_out() {
        let mut sequence = Sequence::new(64, 3);
        let places: Vec<Place> = (0..800).chain(0..800).map(|c| sequence.place(c, false)).collect();
        assert_eq!(places.iter().filter(|p| **p == Place::Restarted).count(), 1);
        assert_eq!(*places.last().unwrap(), Place::Next);
        assert_eq!(sequence.tally().repeated, REPLAYED as u64);
    }

    #[test]
    fn integers_wrap_around_at_their_width_and_go_on() {
        for (bits, last) in [(16, 65535), (32, 4_294_967_295), (16, 32767), (32, 2_147_483_647), (64, i64::MAX)] {
            let after = |n: i64| match bits {
                16 if last == 32767 => -32769 + n,
                32 if last == 2_147_483_647 => -2_147_483_649 + n,
                64 => i64::MIN + n - 1,
                _ => n - 1,
            };
            let (places, tally) = fed(bits, 3, &[last - 1, last, after(1), after(3)]);
            assert_eq!(places[1..], [Place::Next, Place::Next, Place::AfterGap(1)], "{bits} {last}");
            assert_eq!(tally.restarts, 0);
        }
    }

    #[test]
    fn counters_of_filled_samples_wrap_around_too() {
        let mut sequence = Sequence::new(16, 3);
        assert_eq!((sequence.before(1, 2), sequence.before(10, 2)), (65535, 8));
        sequence.place(-2, false);
        assert_eq!((sequence.before(1, 2), sequence.before(-32768, 1)), (-1, 32767));
        assert_eq!(Sequence::new(64, 3).before(10, 2), 8);
    }

    #[test]
    fn an_absurd_jump_forward_is_a_new_start_and_not_a_loss() {
        let (places, tally) = fed(64, 3, &[1, 2, 1 << 52, 3]);
        assert_eq!(places[2..], [Place::Restarted, Place::Restarted]);
        assert_eq!(tally.lost, 0);
    }
}
