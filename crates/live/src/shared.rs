//! What the receiving thread and everybody else both see: numbers that are read one by one, and a few words.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::engine::{Engine, Totals};
use crate::event::{Happening, LogState};
use crate::names::Names;
use crate::sequence::Tally;

/// The lock, whoever panicked with it.
pub(crate) fn locked<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Everything counted, and what became of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Counted by the engine.
    pub totals: Totals,
    /// Samples and readings for which the log's queue had no room.
    pub log_dropped: u64,
    /// Datagrams of readings and alarms that the system did not take.
    pub unsent: u64,
    /// Readings for which the queue of the file or of the page had no room.
    pub not_written: u64,
}

impl Summary {
    /// All of it, by the names that the page, the terminal and Python know.
    pub fn named(&self) -> [(&'static str, u64); 14] {
        let Summary { totals, log_dropped, unsent, not_written } = *self;
        let Totals { tally, malformed, refused, readings, valid, alarms } = totals;
        let Tally { received, lost, repeated, reordered, filled, restarts } = tally;
        [
            ("received", received),
            ("lost", lost),
            ("repeated", repeated),
            ("reordered", reordered),
            ("malformed", malformed),
            ("readings", readings),
            ("valid", valid),
            ("alarms", alarms),
            ("filled", filled),
            ("restarts", restarts),
            ("refused", refused),
            ("log_dropped", log_dropped),
            ("unsent", unsent),
            ("not_written", not_written),
        ]
    }
}

/// A number that one thread writes and others read.
#[derive(Debug)]
struct Seen(AtomicU64);

impl Seen {
    fn new(value: f64) -> Self {
        Self(AtomicU64::new(value.to_bits()))
    }

    fn set(&self, value: f64) {
        self.0.store(value.to_bits(), Relaxed);
    }

    fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Relaxed))
    }
}

const N_COUNTS: usize = 11;

#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) names: Names,
    clock: Instant,
    counts: [AtomicU64; N_COUNTS],
    pub(crate) log_dropped: AtomicU64,
    pub(crate) unsent: AtomicU64,
    pub(crate) not_written: AtomicU64,
    time_s: Seen,
    arrived_s: Seen,
    pace_hz: Seen,
    silent: AtomicBool,
    pub(crate) stop: AtomicBool,
    pub(crate) reset: AtomicBool,
    /// As its writer tells it.
    pub(crate) log: Mutex<Option<LogState>>,
    /// Said by other threads than the receiving one.
    pub(crate) remarks: Mutex<Vec<Happening>>,
    fatal: Mutex<Option<String>>,
    finished: Mutex<bool>,
    finish: Condvar,
}

impl Shared {
    pub(crate) fn new(names: Names) -> Self {
        Self {
            names,
            clock: Instant::now(),
            counts: std::array::from_fn(|_| AtomicU64::new(0)),
            log_dropped: AtomicU64::new(0),
            unsent: AtomicU64::new(0),
            not_written: AtomicU64::new(0),
            time_s: Seen::new(f64::NAN),
            arrived_s: Seen::new(f64::NAN),
            pace_hz: Seen::new(f64::NAN),
            silent: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            reset: AtomicBool::new(false),
            log: Mutex::new(None),
            remarks: Mutex::new(Vec::new()),
            fatal: Mutex::new(None),
            finished: Mutex::new(false),
            finish: Condvar::new(),
        }
    }

    /// Seconds since construction, by a clock that is never set.
    pub(crate) fn now_s(&self) -> f64 {
        self.clock.elapsed().as_secs_f64()
    }

    /// How the engine stands, for all to see.
    pub(crate) fn show(&self, engine: &Engine) {
        let Totals { tally, malformed, refused, readings, valid, alarms } = engine.totals();
        let Tally { received, lost, repeated, reordered, filled, restarts } = tally;
        let values =
            [received, lost, repeated, reordered, filled, restarts, malformed, refused, readings, valid, alarms];
        for (count, value) in self.counts.iter().zip(values) {
            count.store(value, Relaxed);
        }
        self.time_s.set(engine.time_s());
        self.arrived_s.set(engine.arrived_s().unwrap_or(f64::NAN));
        self.pace_hz.set(engine.pace_hz());
        self.silent.store(engine.is_silent(), Relaxed);
    }

    pub(crate) fn summary(&self) -> Summary {
        let [received, lost, repeated, reordered, filled, restarts, malformed, refused, readings, valid, alarms] =
            std::array::from_fn(|i| self.counts[i].load(Relaxed));
        let tally = Tally { received, lost, repeated, reordered, filled, restarts };
        Summary {
            totals: Totals { tally, malformed, refused, readings, valid, alarms },
            log_dropped: self.log_dropped.load(Relaxed),
            unsent: self.unsent.load(Relaxed),
            not_written: self.not_written.load(Relaxed),
        }
    }

    pub(crate) fn time_s(&self) -> f64 {
        self.time_s.get()
    }

    pub(crate) fn pace_hz(&self) -> f64 {
        self.pace_hz.get()
    }

    /// Seconds since the newest sample; NaN before the first.
    pub(crate) fn age_s(&self) -> f64 {
        let arrived_s = self.arrived_s.get();
        if arrived_s.is_nan() { f64::NAN } else { (self.now_s() - arrived_s).max(0.0) }
    }

    pub(crate) fn state(&self) -> &'static str {
        match (self.arrived_s.get().is_nan(), self.silent.load(Relaxed)) {
            (true, _) => "waiting",
            (false, true) => "silent",
            (false, false) => "running",
        }
    }

    pub(crate) fn is_stopping(&self) -> bool {
        self.stop.load(Relaxed)
    }

    pub(crate) fn remark(&self, what: Happening) {
        let mut remarks = locked(&self.remarks);
        if remarks.len() < 100 {
            remarks.push(what);
        }
    }

    pub(crate) fn fatal(&self) -> Option<String> {
        locked(&self.fatal).clone()
    }

    /// The stream has ended, of itself or because of this.
    pub(crate) fn finish(&self, fatal: Option<&str>) {
        if let Some(why) = fatal {
            locked(&self.fatal).get_or_insert_with(|| why.to_owned());
        }
        *locked(&self.finished) = true;
        self.finish.notify_all();
    }

    /// Whether the stream has ended, after this time at the latest.
    pub(crate) fn wait(&self, timeout: Duration) -> bool {
        let finished = locked(&self.finished);
        let (finished, _) = self
            .finish
            .wait_timeout_while(finished, timeout, |finished| !*finished)
            .unwrap_or_else(PoisonError::into_inner);
        *finished
    }
}
