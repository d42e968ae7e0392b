//! What the page and the terminal view show: the latest of everything, bounded. The receiving thread never comes here.

use std::collections::VecDeque;

use rthstrack::{Monitor, Reading};
use rtrb::Consumer;

use crate::alarm::Alarm;
use crate::event::{Event, Happening};
use crate::outlets::Item;

/// Readings kept of each actuator, all of the latest and some of those before.
const MAX_READINGS: usize = 2048;
/// And of all together.
const MAX_READINGS_OF_ALL: usize = 16_384;
/// How far back the page looks.
const HISTORY_S: f64 = 1800.0;
/// Of the scope.
const SCOPE_S: f64 = 10.0;
const MAX_EVENTS: usize = 256;

/// Each thing kept bears the version at which it came, so that any number of readers each find what is new to them.
#[derive(Debug)]
pub(crate) struct Board {
    pub(crate) version: u64,
    n_actuators: usize,
    /// Readings of all actuators to one index follow each other.
    recent: VecDeque<(u64, Reading)>,
    older: VecDeque<(u64, Reading)>,
    max_readings: usize,
    /// Of readings that grow old, every so many-th is kept.
    every: u64,
    grown_old: u64,
    pub(crate) latest: Vec<Option<Reading>>,
    pub(crate) alarms: Vec<Alarm>,
    events: VecDeque<(u64, Event)>,
    pub(crate) scope: Scope,
}

impl Board {
    pub(crate) fn new(monitor: &Monitor, alarms: &[Alarm]) -> Self {
        let n = monitor.config().n_actuators;
        let kept = MAX_READINGS.min(MAX_READINGS_OF_ALL / n).max(1);
        let every = (HISTORY_S * monitor.update_hz() / kept as f64).ceil().max(1.0) as u64;
        let most = monitor.window_len().max((SCOPE_S * monitor.evaluated_rate_hz()) as usize);
        Self {
            version: 1,
            n_actuators: n,
            recent: VecDeque::new(),
            older: VecDeque::new(),
            max_readings: n * kept,
            every,
            grown_old: 0,
            latest: vec![None; n],
            alarms: alarms.to_vec(),
            events: VecDeque::new(),
            scope: Scope::new(n, 1.0 / monitor.evaluated_rate_hz(), most),
        }
    }

    /// Takes what has come.
    pub(crate) fn drain(
        &mut self,
        items: &mut Consumer<Item>,
        rows: Option<&mut Consumer<f64>>,
        remarks: Vec<Happening>,
    ) {
        self.version += 1;
        while let Ok(item) = items.pop() {
            match item {
                Item::Reading(reading) => self.add(reading),
                Item::Alarm(number, alarm) => self.alarms[number] = alarm,
                Item::Event(event) => self.remember(event),
            }
        }
        let time_s = self.latest.iter().flatten().map(|r| r.time_s).fold(0.0, f64::max);
        remarks.into_iter().for_each(|what| self.remember(Event { time_s, what, kept_back: 0 }));
        if let Some(rows) = rows {
            self.scope.drain(rows, self.version);
        }
    }

    fn add(&mut self, reading: Reading) {
        self.latest[reading.actuator] = Some(reading);
        self.recent.push_back((self.version, reading));
        if self.recent.len() <= self.max_readings {
            return;
        }
        let Some(old) = self.recent.pop_front() else { return };
        if old.1.actuator == 0 {
            self.grown_old += 1;
        }
        if self.grown_old.is_multiple_of(self.every) {
            self.older.push_back(old);
            if self.older.len() > self.max_readings {
                self.older.drain(..self.n_actuators);
            }
        }
    }

    fn remember(&mut self, event: Event) {
        self.events.push_back((self.version, event));
        if self.events.len() > MAX_EVENTS {
            self.events.pop_front();
        }
    }

    /// Readings that came after a version, oldest first.
    pub(crate) fn readings_since(&self, version: u64) -> impl Iterator<Item = &Reading> {
        let all = self.older.iter().chain(&self.recent);
        // A version is seldom far from the newest.
        let old = if version < self.recent.front().map_or(0, |(v, _)| *v) {
            0
        } else {
            self.older.len() + self.recent.partition_point(|(v, _)| *v <= version)
        };
        all.skip(old).filter(move |(v, _)| *v > version).map(|(_, reading)| reading)
    }

    pub(crate) fn events_since(&self, version: u64) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(move |(v, _)| *v > version).map(|(_, event)| event)
    }

    pub(crate) fn last_events(&self, n: usize) -> impl Iterator<Item = &Event> {
        self.events.iter().skip(self.events.len().saturating_sub(n)).map(|(_, event)| event)
    }
}

/// The latest evaluated samples, without a gap.
#[derive(Debug)]
pub(crate) struct Scope {
    n_actuators: usize,
    step_s: f64,
    most: usize,
    /// Rows of target and measured of all actuators.
    rows: VecDeque<f64>,
    /// Rows ever taken, and up to which at the latest versions.
    total: u64,
    marks: VecDeque<(u64, u64)>,
    end_s: f64,
    row: Vec<f64>,
}

impl Scope {
    fn new(n_actuators: usize, step_s: f64, most: usize) -> Self {
        let row = vec![0.0; 1 + 2 * n_actuators];
        let (rows, marks) = (VecDeque::new(), VecDeque::new());
        Self { n_actuators, step_s, most, rows, total: 0, marks, end_s: f64::NAN, row }
    }

    fn width(&self) -> usize {
        2 * self.n_actuators
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len() / self.width()
    }

    fn drain(&mut self, rows: &mut Consumer<f64>, version: u64) {
        let before = self.total;
        while rows.pop_entire_slice(&mut self.row).is_ok() {
            // Not the next one: what was before belongs to another stretch of time.
            if self.row[0].is_nan() || (self.row[0] - self.end_s - self.step_s).abs() > 0.5 * self.step_s {
                self.rows.clear();
            }
            self.end_s = self.row[0];
            if self.end_s.is_nan() {
                continue;
            }
            if self.len() == self.most {
                self.rows.drain(..self.width());
            }
            self.rows.extend(&self.row[1..]);
            self.total += 1;
        }
        if self.total > before {
            self.marks.push_back((version, self.total));
            // Rows older than all marks are new to whoever asks from before them.
            if self.marks.len() > 1024 {
                self.marks.pop_front();
            }
        }
    }

    /// One actuator's latest `n` samples, target and measured.
    pub(crate) fn last(&self, n: usize, actuator: usize) -> Option<(Vec<f64>, Vec<f64>)> {
        let first = self.len().checked_sub(n)?;
        let column = |c: usize| (first..self.len()).map(|r| self.rows[r * self.width() + c]).collect();
        Some((column(actuator), column(self.n_actuators + actuator)))
    }

    /// Every `stride`-th row that came after a version, at most of the last `most_s` seconds: their numbers, and the time of
    /// the last.
    pub(crate) fn since(&self, version: u64, stride: u64, most_s: f64) -> (Vec<usize>, f64) {
        let seen = self.marks.iter().rev().find(|(v, _)| *v <= version).map_or(0, |(_, total)| *total);
        let oldest = self.total - self.len() as u64;
        let most = (most_s / self.step_s) as u64;
        let from = seen.max(oldest).max(self.total.saturating_sub(most));
        let chosen: Vec<usize> =
            (from..self.total).filter(|t| t.is_multiple_of(stride)).map(|t| (t - oldest) as usize).collect();
        let behind = chosen.last().map_or(0, |last| self.len() - 1 - last);
        (chosen, self.end_s - behind as f64 * self.step_s)
    }

    pub(crate) fn at(&self, row: usize, actuator: usize, measured: bool) -> f64 {
        self.rows[row * self.width() + actuator + if measured { self.n_actuators } else { 0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alarm::tests::reading;
    use rthstrack::MonitorConfig;
    use rtrb::RingBuffer;

    fn monitor() -> Monitor {
        Monitor::new(MonitorConfig {
            rate_hz: 100.0,
            window_s: 1.0,
            update_hz: 50.0,
            n_actuators: 2,
            ..Default::default()
        })
        .unwrap()
    }

    #[test]
    fn each_reader_finds_what_is_new_to_it() {
        let mut board = Board::new(&monitor(), &[]);
        let (mut producer, mut consumer) = RingBuffer::new(10);
        let mut send = |board: &mut Board, time_s: f64| {
            producer.push(Item::Reading(reading(0, time_s, 1.0, 0.0))).unwrap();
            producer.push(Item::Reading(reading(1, time_s, 1.0, 0.0))).unwrap();
            let what = Happening::Silent { limit_s: time_s };
            producer.push(Item::Event(Event { time_s, what, kept_back: 0 })).unwrap();
            board.drain(&mut consumer, None, Vec::new());
            board.version
        };
        let first = send(&mut board, 1.0);
        let second = send(&mut board, 2.0);
        let times = |version| board.readings_since(version).map(|r| (r.actuator, r.time_s)).collect::<Vec<_>>();
        assert_eq!(times(0), [(0, 1.0), (1, 1.0), (0, 2.0), (1, 2.0)]);
        assert_eq!(times(first), [(0, 2.0), (1, 2.0)]);
        assert_eq!(times(second), []);
        assert_eq!(board.events_since(first).count(), 1);
        assert_eq!(board.latest[1].unwrap().time_s, 2.0);
    }

    #[test]
    fn memory_is_bounded_and_half_an_hour_is_kept_thinly() {
        let mut board = Board::new(&monitor(), &[]);
        let (mut producer, mut consumer) = RingBuffer::new(10);
        let example = reading(0, 0.0, 1.0, 0.0);
        for i in 0..200_000u32 {
            for actuator in 0..2 {
                let made = Reading { time_s: f64::from(i) / 50.0, actuator, ..example };
                producer.push(Item::Reading(made)).unwrap();
            }
            board.drain(&mut consumer, None, Vec::new());
        }
        let kept: Vec<&Reading> = board.readings_since(0).collect();
        assert!(kept.len() <= 4 * MAX_READINGS, "{}", kept.len());
        assert!(kept.is_sorted_by(|a, b| a.time_s <= b.time_s));
        assert!(kept.chunks(2).all(|pair| pair[0].time_s == pair[1].time_s && pair[1].actuator == 1));
        let span_s = kept.last().unwrap().time_s - kept[0].time_s;
        assert!((HISTORY_S..HISTORY_S + 120.0).contains(&span_s), "{span_s}");
    }

    #[test]
    fn the_scope_gives_each_sample_once_and_starts_anew_after_a_gap() {
        let mut board = Board::new(&monitor(), &[]);
        let (_, mut items) = RingBuffer::new(1);
        let (mut producer, mut rows) = RingBuffer::new(1000);
        let mut send = |board: &mut Board, times: std::ops::Range<u32>| {
            for t in times {
                let t = f64::from(t) / 100.0;
                producer.push_entire_slice(&[t, t, 10.0 + t, 20.0 + t, 30.0 + t]).unwrap();
            }
            board.drain(&mut items, Some(&mut rows), Vec::new());
            board.version
        };
        let first = send(&mut board, 0..40);
        let second = send(&mut board, 40..50);
        let (chosen, end_s) = board.scope.since(first, 1, 10.0);
        assert_eq!((chosen.len(), end_s), (10, 0.49));
        assert_eq!(board.scope.at(chosen[0], 1, true), 30.4);
        assert_eq!(board.scope.since(second, 1, 10.0).0.len(), 0);
        let (chosen, end_s) = board.scope.since(0, 4, 10.0);
        assert_eq!((chosen.len(), (100.0 * end_s).round()), (13, 48.0));
        assert_eq!(board.scope.last(50, 0).unwrap().0[49], 0.49);
        assert_eq!(board.scope.last(51, 0), None);
        send(&mut board, 80..90);
        assert_eq!(board.scope.len(), 10);
        assert_eq!(board.scope.since(0, 1, 10.0).0.len(), 10);
        assert_eq!(board.scope.last(10, 1).unwrap().1[0], 30.8);
        producer.push_entire_slice(&[f64::NAN; 5]).unwrap();
        board.drain(&mut items, Some(&mut rows), Vec::new());
        assert_eq!(board.scope.len(), 0);
    }
}
