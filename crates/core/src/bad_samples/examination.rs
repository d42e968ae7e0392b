//! Both channels looked through: what is marked, bridged and counted.

use std::ops::Range;

use super::about::About;
use super::bridge::{GOOD, bridge, widen};
use super::found::{BAD_KINDS, BadFound, BadKind, BadSamples};
use super::held::{held, noise_of_fresh};
use super::look::{Look, Sight};
use super::runs::{mark_plateaus, mark_runs};
use super::spikes::{mark_spikes, unmark_shared};
use crate::lag::{Search, View};
use crate::pair::Pair;
use crate::settings::EvaluatorConfig;

/// Both channels without their bad samples, and where these are. Grows on the first record that has some.
#[derive(Debug, Clone, Default)]
pub(crate) struct Examination {
    /// Bridged, or read between fresh values: for what needs all samples.
    pub(super) signals: [Vec<f64>; 2],
    /// 0, or 1 + kind.
    marks: [Vec<u8>; 2],
    pub(super) gaps: [Vec<Range<usize>>; 2],
    found: BadFound,
}

impl Examination {
    /// The bad samples of a whole record; None where there are none, or they are kept.
    pub(crate) fn of(pair: &Pair<'_>, config: &EvaluatorConfig) -> Option<Self> {
        let search = Search::new(pair.n_samples(), pair.rate_hz(), config.max_delay_s);
        let view = View::whole(pair);
        let mut examination = Self::default();
        let about = |signals: [&[f64]; 2]| {
            let [target, measured] = signals;
            About::find(&search, &mut search.state(), &View { target, measured, ..view }, 0)
        };
        (config.bad_samples == BadSamples::LeaveOut && examination.examine([view.target, view.measured], about))
            .then_some(examination)
    }

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
                    mark_runs(&mut self.marks[c], c, signals, about, &looks);
                    bridge(&mut self.signals[c], &self.marks[c], 0..signals[c].len());
                }
            }
        }
        let mut spiked = false;
        for c in (0..2).filter(|&c| held[c].is_none() && (looks[c].sight.stands_out || looks[c].sight.at_ends)) {
            spiked |= mark_spikes(&mut self.signals[c], &mut self.marks[c], &looks[c]);
        }
        if spiked {
            found = found.or_else(|| about.take().and_then(|about| about([&self.signals[0], &self.signals[1]])));
            if let Some(about) = &found {
                unmark_shared(&mut self.marks, &self.signals, signals, about);
            }
        }
        for c in 0..2 {
            match held[c] {
                Some(held) => {
                    let found = held.read_between(signals[c], &mut self.signals[c], &mut self.gaps[c]);
                    self.found.set(c, BadKind::Held, found);
                }
                None => self.bridge(c, signals[c]),
            }
        }
        !self.found.is_empty()
    }

    /// Counts what is marked, and puts a straight line in its place.
    fn bridge(&mut self, channel: usize, signal: &[f64]) {
        let (own, marks, gaps) = (&mut self.signals[channel], &self.marks[channel], &mut self.gaps[channel]);
        own.copy_from_slice(signal);
        gaps.clear();
        for (i, mark) in marks.iter().enumerate().filter(|(_, mark)| **mark != GOOD) {
            self.found.add(channel, BAD_KINDS[usize::from(*mark) - 1], i);
            widen(gaps, i);
        }
        bridge(own, marks, 0..signal.len());
    }
}
