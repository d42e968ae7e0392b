//! From samples to readings and alarms: everything but sockets, files and clocks.

use std::sync::Arc;

use rthstrack::{Monitor, MonitorState, Reading, Reason};

use crate::alarm::{Alarm, AlarmConfig, Alarms, Change, Observed};
use crate::event::{Actuator, Event, Happening, printable};
use crate::pace::{Pace, Verdict};
use crate::sequence::{Place, Sequence, Tally};

/// After so long without a sample a counter that is behind has started anew.
const PAUSE_S: f64 = 0.2;
/// A pace that contradicts the rate ends the run within this time of the stream's first sample; later it is an event.
const PACE_TRIAL_S: f64 = 10.0;
/// Events told in any second; the rest are counted.
const EVENTS_A_SECOND: u32 = 10;
/// Gaps remembered by the last window.
const MAX_GAPS: usize = 1024;
/// A jump ahead by more than so many times what the time that has passed, and a second, allows is no loss.
const PLAUSIBLE: f64 = 10.0;

/// A sample as the monitor took it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<'a> {
    /// From 0, without a break.
    pub index: u64,
    /// As it was sent.
    pub counter: i64,
    /// Put on a straight line over a gap.
    pub filled: bool,
    /// One number an actuator.
    pub target: &'a [f64],
    /// One number an actuator.
    pub measured: &'a [f64],
}

/// Everything counted since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// By the counter.
    pub tally: Tally,
    /// Datagrams, lines or samples that could not be read.
    pub malformed: u64,
    /// Datagrams of senders that are not accepted.
    pub refused: u64,
    /// Readings, of all actuators.
    pub readings: u64,
    /// Of these, with numbers.
    pub valid: u64,
    /// Alarms raised.
    pub alarms: u64,
}

/// Takes what the engine makes. Nothing here may wait.
pub trait Outlet {
    /// A reading, at once.
    fn reading(&mut self, reading: &Reading);
    /// An alarm was raised or has ended.
    fn alarm(&mut self, change: &Change);
    /// How the alarm of this number stands.
    fn standing(&mut self, number: usize, alarm: &Alarm);
    /// A reading whose like are all out, and which the alarms have judged: for the log. `raised` is the set of alarms of its
    /// actuator and of the stream.
    fn judged(&mut self, reading: &Reading, totals: &Totals, raised: u32);
    /// A sample went into the window.
    fn sample(&mut self, sample: &Sample<'_>);
    /// One more evaluated (decimated) sample of each actuator stands at the end of the window, at this time.
    fn evaluated(&mut self, time_s: f64, monitor: &Monitor, state: &MonitorState);
    /// The window starts anew: what was evaluated before does not go on.
    fn restarted(&mut self);
    /// Something the user should know.
    fn event(&mut self, event: Event);
}

/// What the engine needs to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EngineConfig {
    /// See [`Sequence::new`].
    pub counter_bits: u32,
    /// Longest gap filled, in samples.
    pub fill_samples: u64,
    /// Whether a pace of the counter other than the rate ends the run.
    pub check_pace: bool,
    /// The limits.
    pub alarms: AlarmConfig,
}

/// One stream.
pub struct Engine {
    monitor: Arc<Monitor>,
    state: MonitorState,
    sequence: Sequence,
    alarms: Alarms,
    /// What the outlet knows: active, latched.
    told: Vec<(bool, bool)>,
    pace: Pace,
    check_pace: bool,
    silence_s: f64,
    totals: Totals,
    /// Of the next sample.
    index: u64,
    /// Evaluated samples come every so many samples; the next after so many.
    until_evaluated: u64,
    previous: Option<(Vec<f64>, Vec<f64>)>,
    between: (Vec<f64>, Vec<f64>),
    missing: Missing,
    first_s: Option<f64>,
    arrived_s: f64,
    silent: bool,
    pace_told: bool,
    fatal: Option<String>,
    speech: Speech,
    /// Of each actuator: whether its latest reading was judged, and when it last was, or did not move.
    judged: Vec<(bool, f64)>,
}

impl Engine {
    /// A stream of which nothing has come.
    pub fn new(monitor: Arc<Monitor>, config: &EngineConfig) -> Self {
        let (state, n) = (monitor.state(), monitor.config().n_actuators);
        let alarms = Alarms::new(config.alarms, n);
        let rate_hz = monitor.config().rate_hz;
        let span = monitor.first_reading_len();
        let mut engine = Self {
            state,
            sequence: Sequence::new(config.counter_bits, config.fill_samples),
            told: vec![(false, false); alarms.all().len()],
            alarms,
            pace: Pace::new(rate_hz),
            check_pace: config.check_pace,
            silence_s: config.alarms.silence_s.unwrap_or(1.0),
            totals: Totals::default(),
            index: 0,
            until_evaluated: 0,
            previous: None,
            between: (vec![0.0; n], vec![0.0; n]),
            missing: Missing::new(span),
            first_s: None,
            arrived_s: 0.0,
            silent: false,
            pace_told: false,
            fatal: None,
            speech: Speech::default(),
            judged: vec![(true, 0.0); n],
            monitor,
        };
        engine.begin_window();
        engine
    }

    /// Everything counted.
    pub fn totals(&self) -> Totals {
        Totals { tally: self.sequence.tally(), ..self.totals }
    }

    /// All alarms as they stand.
    pub fn alarms(&self) -> &[Alarm] {
        self.alarms.all()
    }

    /// Time of the newest sample in the stream; NaN before the first.
    pub fn time_s(&self) -> f64 {
        if self.index == 0 { f64::NAN } else { (self.index - 1) as f64 / self.monitor.config().rate_hz }
    }

    /// When the newest sample came, by the clock of the caller.
    pub fn arrived_s(&self) -> Option<f64> {
        self.first_s.map(|_| self.arrived_s)
    }

    /// Nothing has come for as long as is silence.
    pub fn is_silent(&self) -> bool {
        self.silent
    }

    /// Samples a second by the clock; NaN before it is known.
    pub fn pace_hz(&self) -> f64 {
        self.pace.measured_hz()
    }

    /// Why the run cannot go on.
    pub fn fatal(&self) -> Option<&str> {
        self.fatal.as_deref()
    }

    /// So many samples come at once: a datagram's.
    pub fn comes_in_blocks(&mut self, n_samples: usize) {
        self.sequence.comes_in_blocks(n_samples);
    }

    /// Something that was no sample came.
    pub fn malformed(&mut self) {
        self.totals.malformed += 1;
    }

    /// A datagram came from a sender that is not accepted.
    pub fn refused(&mut self) {
        self.totals.refused += 1;
    }

    /// The run cannot go on.
    pub fn fail(&mut self, why: String) {
        self.fatal.get_or_insert_with(|| printable(why));
    }

    /// Tells something, unless too much has been told this second.
    pub fn tell(&mut self, now_s: f64, what: Happening, out: &mut impl Outlet) {
        let time_s = self.time_at(now_s);
        self.speech.tell(now_s, time_s, what, out);
    }

    /// A sample with its counter (`None` where the sender counts nothing) came at this time of a monotonic clock.
    pub fn sample(
        &mut self,
        now_s: f64,
        counter: Option<i64>,
        target: &[f64],
        measured: &[f64],
        out: &mut impl Outlet,
    ) {
        let paused = self.first_s.is_some() && now_s - self.arrived_s > PAUSE_S;
        let elapsed_s = if self.first_s.is_some() { now_s - self.arrived_s } else { 0.0 };
        let rate_hz = self.monitor.config().rate_hz;
        let place = match counter {
            // Where the pace is not that of the rate, time tells nothing of the counter.
            Some(counter) if self.check_pace => {
                self.sequence.place_within(counter, paused, (PLAUSIBLE * (elapsed_s + 1.0) * rate_hz) as i64)
            }
            Some(counter) => self.sequence.place(counter, paused),
            // A second more, for what a slow reader of the log may hold up a file.
            None if elapsed_s > self.silence_s + 1.0 => self.sequence.uncounted_anew(),
            None => self.sequence.uncounted(),
        };
        if place == Place::Dropped {
            return;
        }
        if place == Place::Restarted {
            self.pace.interrupt();
        }
        self.arrived(now_s, out);
        let shown = counter.unwrap_or(self.index as i64);
        match place {
            Place::AfterGap(n) => {
                self.missing.add(self.index + n, n);
                self.fill(n, shown, target, measured, out);
            }
            Place::AfterLoss(n) => {
                self.index = self.index.saturating_add(n);
                self.missing.add(self.index, n);
                self.restart(out);
                self.tell(now_s, Happening::SamplesLost { samples: n }, out);
            }
            Place::Restarted => {
                // Time goes on while nothing comes.
                self.index = self.index.saturating_add(((elapsed_s * rate_hz) as u64).saturating_sub(1));
                self.restart(out);
                let what = match counter {
                    Some(counter) => Happening::CounterRestarted { counter },
                    None => Happening::Paused { pause_s: elapsed_s },
                };
                self.tell(now_s, what, out);
            }
            Place::Next | Place::Dropped => {}
        }
        self.take(Sample { index: self.index, counter: shown, filled: false, target, measured }, out);
        self.keep(target, measured);
        let lost = self.missing.at(self.index - 1);
        if let Some(lost) = lost {
            let time_s = self.time_s();
            let observed = Observed { lost: Some(lost), ..Observed::default() };
            self.alarmed(out, |alarms, tell| alarms.observe(None, time_s, &observed, tell));
        }
        if counter.is_some() {
            match self.pace.arrived(now_s, self.index) {
                Verdict::Fits => {}
                Verdict::Contradicts => self.contradicted(now_s, out),
                Verdict::IsOff => self.is_off(now_s, out),
            }
        }
    }

    /// Nothing may have come: call this every now and then, 20 times a second or more.
    pub fn idle(&mut self, now_s: f64, out: &mut impl Outlet) {
        if self.first_s.is_none() {
            return;
        }
        let silent_s = now_s - self.arrived_s;
        if silent_s <= self.silence_s {
            let time_s = self.time_s();
            let judged = std::mem::take(&mut self.judged);
            self.alarmed(out, |alarms, tell| {
                for (actuator, (_, judged_s)) in judged.iter().enumerate() {
                    let observed = Observed { unjudged_s: Some(time_s - judged_s), ..Observed::default() };
                    alarms.observe(Some(actuator), time_s, &observed, &mut *tell);
                }
            });
            self.judged = judged;
        } else {
            if !self.silent {
                self.silent = true;
                self.tell(now_s, Happening::Silent { limit_s: self.silence_s }, out);
            }
            let time_s = self.time_at(now_s);
            self.waited(time_s, silent_s, out);
        }
    }

    /// Ends alarms that are held.
    pub fn reset(&mut self, now_s: f64, out: &mut impl Outlet) {
        let time_s = self.time_at(now_s);
        self.alarmed(out, |alarms, tell| alarms.reset(time_s, tell));
        let still_active = self.alarms.all().iter().filter(|a| a.active).count();
        self.tell(now_s, Happening::AlarmsReset { still_active }, out);
    }

    /// Time of the stream now, when nothing has come since the newest sample.
    fn time_at(&self, now_s: f64) -> f64 {
        if self.index == 0 { 0.0 } else { self.time_s() + (now_s - self.arrived_s).max(0.0) }
    }

    fn arrived(&mut self, now_s: f64, out: &mut impl Outlet) {
        self.first_s.get_or_insert(now_s);
        if self.silent {
            self.silent = false;
            let silent_s = now_s - self.arrived_s;
            let time_s = self.time_at(now_s);
            self.waited(time_s, 0.0, out);
            self.tell(now_s, Happening::SamplesAgain { silent_s }, out);
        }
        self.arrived_s = now_s;
    }

    /// Puts `n` samples on the straight line to the one that has come.
    fn fill(&mut self, n: u64, counter: i64, target: &[f64], measured: &[f64], out: &mut impl Outlet) {
        let Some(previous) = self.previous.take() else { return };
        let mut between = std::mem::take(&mut self.between);
        for j in 1..=n {
            let share = j as f64 / (n + 1) as f64;
            let line = |values: &mut [f64], from: &[f64], to: &[f64]| {
                for ((value, from), to) in values.iter_mut().zip(from).zip(to) {
                    *value = from + (to - from) * share;
                }
            };
            line(&mut between.0, &previous.0, target);
            line(&mut between.1, &previous.1, measured);
            let counter = self.sequence.before(counter, n + 1 - j);
            let (target, measured) = (&between.0[..], &between.1[..]);
            self.take(Sample { index: self.index, counter, filled: true, target, measured }, out);
        }
        self.between = between;
        self.previous = Some(previous);
    }

    fn keep(&mut self, target: &[f64], measured: &[f64]) {
        let n = self.between.0.len();
        let (of_target, of_measured) = self.previous.get_or_insert_with(|| (vec![0.0; n], vec![0.0; n]));
        of_target.copy_from_slice(target);
        of_measured.copy_from_slice(measured);
    }

    fn restart(&mut self, out: &mut impl Outlet) {
        out.restarted();
        self.alarms.break_off(None);
        self.monitor.restart(&mut self.state, self.index);
        self.begin_window();
    }

    /// How many samples a window of nothing takes until the decimator gives its first.
    fn begin_window(&mut self) {
        let rest = (self.monitor.window_len() as u64 - 1) * self.monitor.config().evaluator.data_decimation as u64;
        self.until_evaluated = self.monitor.first_reading_len() - rest;
    }

    /// One sample into the window; its readings first, for whoever waits for them.
    fn take(&mut self, sample: Sample<'_>, out: &mut impl Outlet) {
        self.index += 1;
        let readings = self.monitor.step(&mut self.state, sample.target, sample.measured);
        if let Some(readings) = readings {
            self.totals.readings += readings.len() as u64;
            self.totals.valid += readings.iter().filter(|r| r.is_valid()).count() as u64;
            readings.iter().for_each(|reading| out.reading(reading));
            self.totals.tally = self.sequence.tally();
            for reading in readings {
                self.alarms.read(reading, |change| {
                    self.totals.alarms += u64::from(change.raised);
                    out.alarm(&change);
                    self.speech.alarm(&change, out);
                });
                out.judged(reading, &self.totals, self.alarms.raised(reading.actuator));
                let still = reading.tracking.reason == Some(Reason::Still);
                let (was, since_s) = &mut self.judged[reading.actuator];
                let is = reading.is_valid() || still;
                if is {
                    *since_s = reading.time_s;
                }
                if is != *was {
                    *was = is;
                    let reason = reading.tracking.reason.filter(Reason::is_undetermined);
                    let actuator = Actuator(Some(reading.actuator));
                    let what = match reason {
                        Some(reason) if !still => Happening::Undetermined { actuator, reason },
                        _ => Happening::Determined { actuator },
                    };
                    self.speech.tell(self.arrived_s, reading.time_s, what, out);
                }
            }
            for (number, alarm) in self.alarms.all().iter().enumerate().filter(|(_, a)| a.actuator.is_some()) {
                tell_standing(&mut self.told, number, alarm, out);
            }
        }
        self.until_evaluated -= 1;
        if self.until_evaluated == 0 {
            self.until_evaluated = self.monitor.config().evaluator.data_decimation as u64;
            let time_s = sample.index as f64 / self.monitor.config().rate_hz - self.monitor.latency_s();
            out.evaluated(time_s, &self.monitor, &self.state);
        }
        out.sample(&sample);
    }

    /// Nothing has come for so long.
    fn waited(&mut self, time_s: f64, silent_s: f64, out: &mut impl Outlet) {
        let observed = Observed { silent_s: Some(silent_s), ..Observed::default() };
        self.alarmed(out, |alarms, tell| alarms.observe(None, time_s, &observed, tell));
    }

    /// Runs the alarms, and tells what has changed.
    fn alarmed(&mut self, out: &mut impl Outlet, compare: impl FnOnce(&mut Alarms, &mut dyn FnMut(Change))) {
        compare(&mut self.alarms, &mut |change| {
            self.totals.alarms += u64::from(change.raised);
            out.alarm(&change);
            self.speech.alarm(&change, out);
        });
        for (number, alarm) in self.alarms.all().iter().enumerate() {
            tell_standing(&mut self.told, number, alarm, out);
        }
    }

    fn contradicted(&mut self, now_s: f64, out: &mut impl Outlet) {
        let (pace_hz, rate_hz) = (self.pace.measured_hz(), self.monitor.config().rate_hz);
        if !self.check_pace || self.pace_told {
            return;
        }
        self.pace_told = true;
        if now_s - self.first_s.unwrap_or(now_s) <= PACE_TRIAL_S {
            self.fail(format!(
                "the counter advances by {pace_hz:.0} a second but --rate says {rate_hz}: give the sender's true rate, or \
                 --any-pace for a replay at another speed"
            ));
        } else {
            self.tell(now_s, Happening::PaceContradicts { pace_hz, rate_hz }, out);
        }
    }

    /// Not by so much that the run has to end.
    fn is_off(&mut self, now_s: f64, out: &mut impl Outlet) {
        if !self.check_pace || self.pace_told {
            return;
        }
        self.pace_told = true;
        let (pace_hz, rate_hz) = (self.pace.long_hz(), self.monitor.config().rate_hz);
        self.tell(now_s, Happening::PaceOff { pace_hz, rate_hz }, out);
    }
}

/// An alarm that is raised is told each time, for its value; another one when it changes.
fn tell_standing(told: &mut [(bool, bool)], number: usize, alarm: &Alarm, out: &mut impl Outlet) {
    let now = (alarm.active, alarm.latched);
    if alarm.active || told[number] != now {
        told[number] = now;
        out.standing(number, alarm);
    }
}

/// Events, at most so many a second.
#[derive(Debug, Default)]
struct Speech {
    second: f64,
    told: u32,
    kept_back: u64,
}

impl Speech {
    fn tell(&mut self, now_s: f64, time_s: f64, what: Happening, out: &mut impl Outlet) {
        if now_s - self.second >= 1.0 {
            (self.second, self.told) = (now_s, 0);
        }
        if self.told >= EVENTS_A_SECOND {
            self.kept_back += 1;
            return;
        }
        self.told += 1;
        out.event(Event { time_s, what, kept_back: std::mem::take(&mut self.kept_back) });
    }

    /// An alarm comes by the stream's time.
    fn alarm(&mut self, change: &Change, out: &mut impl Outlet) {
        out.event(Event { time_s: change.time_s, what: change.into(), kept_back: 0 });
    }
}

/// Samples missing from the last window.
#[derive(Debug)]
struct Missing {
    span: u64,
    /// Index of the first sample after each gap, and its length.
    gaps: std::collections::VecDeque<(u64, u64)>,
    sum: u64,
    was: u64,
}

impl Missing {
    fn new(span: u64) -> Self {
        Self { span, gaps: std::collections::VecDeque::with_capacity(MAX_GAPS), sum: 0, was: 0 }
    }

    fn add(&mut self, index: u64, n: u64) {
        self.sum = self.sum.saturating_add(n);
        if self.gaps.len() == MAX_GAPS
            && let Some(last) = self.gaps.back_mut()
        {
            *last = (index, last.1.saturating_add(n));
            return;
        }
        self.gaps.push_back((index, n));
    }

    /// How many, where there are any or the number has changed.
    fn at(&mut self, index: u64) -> Option<u64> {
        while let Some((after, n)) = self.gaps.front().copied()
            && after.saturating_add(self.span) <= index
        {
            self.gaps.pop_front();
            self.sum = self.sum.saturating_sub(n);
        }
        let changed = self.sum != self.was;
        self.was = self.sum;
        (changed || self.sum > 0).then_some(self.sum)
    }
}
