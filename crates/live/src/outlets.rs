//! The receiving thread's side of everything that goes out. Nothing here waits: what does not fit is counted.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use rthstrack::{Monitor, MonitorState, Reading};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::alarm::{Alarm, Change};
use crate::engine::{Outlet, Sample, Totals};
use crate::event::{Event, Happening};
use crate::json;
use crate::shared::Shared;

/// For the page and the terminal view.
#[derive(Debug, Clone)]
// A reading is what is sent most; in a box each would be allocated.
#[allow(clippy::large_enum_variant)]
pub(crate) enum Item {
    Reading(Reading),
    Alarm(usize, Alarm),
    Event(Event),
}

/// A reading for the log.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Judged {
    pub(crate) reading: Reading,
    pub(crate) totals: Totals,
    pub(crate) raised: u32,
}

/// How deep the queues are, in seconds.
const LOG_S: f64 = 60.0;
const BOARD_S: f64 = 10.0;
/// Of items that come irregularly.
const SPARE: usize = 1024;

/// Longest queue of words, 64 MiB, and of readings.
const MAX_WORDS: usize = 1 << 23;
const MAX_READINGS: usize = 1 << 20;

/// Words before the numbers in a row of the log: index, counter, filled.
pub(crate) const ROW_HEAD: usize = 3;

/// Queues of one thread to one other.
pub(crate) struct Queues<S, J, R, I, W> {
    /// Rows of the log: the head, then the bits of target and measured.
    pub(crate) samples: Option<S>,
    pub(crate) judged: Option<J>,
    pub(crate) file: Option<R>,
    pub(crate) items: Option<I>,
    /// Rows of the scope: time (NaN where it starts anew), target, measured.
    pub(crate) rows: Option<W>,
}

pub(crate) type Ends = Queues<Consumer<u64>, Consumer<Judged>, Consumer<Reading>, Consumer<Item>, Consumer<f64>>;
type Starts = Queues<Producer<u64>, Producer<Judged>, Producer<Reading>, Producer<Item>, Producer<f64>>;

fn queue<T>(wanted: bool, capacity: usize) -> (Option<Producer<T>>, Option<Consumer<T>>) {
    if !wanted {
        return (None, None);
    }
    let (producer, consumer) = RingBuffer::new(capacity);
    (Some(producer), Some(consumer))
}

/// The same of plain words, whose memory is taken now and not while samples come.
fn words<T: Copy + Default>(wanted: bool, row: usize, rows: usize) -> (Option<Producer<T>>, Option<Consumer<T>>) {
    let capacity = row * rows.min(MAX_WORDS / row);
    let (mut producer, mut consumer) = queue(wanted, capacity);
    if let (Some(producer), Some(consumer)) = (&mut producer, &mut consumer) {
        while producer.push(T::default()).is_ok() {}
        while consumer.pop().is_ok() {}
    }
    (producer, consumer)
}

/// A socket to one address that never waits.
#[derive(Debug)]
pub(crate) struct Sender {
    socket: UdpSocket,
    to: SocketAddr,
}

impl Sender {
    pub(crate) fn new(to: SocketAddr) -> std::io::Result<Self> {
        let from = match (to.ip().is_loopback(), to.is_ipv6()) {
            (true, false) => "127.0.0.1:0",
            (true, true) => "[::1]:0",
            (false, false) => "0.0.0.0:0",
            (false, true) => "[::]:0",
        };
        let socket = UdpSocket::bind(from)?;
        socket.set_nonblocking(true)?;
        // Only an address that is one is refused without it.
        socket.set_broadcast(true)?;
        Ok(Self { socket, to })
    }

    fn send(&self, text: &str, shared: &Shared) {
        if let Err(error) = self.socket.send_to(text.as_bytes(), self.to)
            && shared.unsent.fetch_add(1, Relaxed) == 0
        {
            shared.remark(Happening::Unsent { to: self.to, error: error.to_string() });
        }
    }
}

/// Who wants what.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted {
    pub(crate) log: bool,
    pub(crate) file: bool,
    pub(crate) page: bool,
}

pub(crate) struct Outlets {
    shared: Arc<Shared>,
    readings: Option<Sender>,
    alarms: Option<Sender>,
    queues: Starts,
    text: String,
    words: Vec<u64>,
    row: Vec<f64>,
}

impl Outlets {
    pub(crate) fn new(
        shared: Arc<Shared>,
        monitor: &Monitor,
        wanted: Wanted,
        readings: Option<Sender>,
        alarms: Option<Sender>,
    ) -> (Self, Ends) {
        let n = monitor.config().n_actuators;
        let depth = |seconds: f64, per_second: f64| (seconds * per_second).ceil() as usize + 1;
        let n_readings = |seconds| (n * depth(seconds, monitor.update_hz())).min(MAX_READINGS) + SPARE;
        let row = 1 + 2 * n;
        let (samples, samples_end) = words(wanted.log, ROW_HEAD + 2 * n, depth(LOG_S, monitor.config().rate_hz));
        let (judged, judged_end) = queue(wanted.log, n_readings(LOG_S));
        let (file, file_end) = queue(wanted.file, n_readings(LOG_S));
        // A reading may come with the standing of its alarms.
        let (items, items_end) = queue(true, 4 * n_readings(BOARD_S));
        let (rows, rows_end) = words(wanted.page, row, depth(BOARD_S, monitor.evaluated_rate_hz()));
        let queues = Queues { samples, judged, file, items, rows };
        let (words, row) = (vec![0; ROW_HEAD + 2 * n], vec![0.0; row]);
        let outlets = Self { shared, readings, alarms, queues, text: String::with_capacity(4096), words, row };
        let ends =
            Queues { samples: samples_end, judged: judged_end, file: file_end, items: items_end, rows: rows_end };
        (outlets, ends)
    }

    /// Whether a queue is more than half full, where it matters that nothing is dropped.
    pub(crate) fn is_crowded(&self) -> bool {
        fn crowded<T>(queue: &Option<Producer<T>>) -> bool {
            queue.as_ref().is_some_and(|q| q.slots() < q.buffer().capacity() / 2)
        }
        let Queues { samples, judged, file, items, .. } = &self.queues;
        crowded(samples) || crowded(judged) || crowded(file) || crowded(items)
    }

    fn item(&mut self, item: Item) {
        if let Some(items) = &mut self.queues.items
            && items.push(item).is_err()
        {
            self.shared.not_written.fetch_add(1, Relaxed);
        }
    }
}

impl Outlet for Outlets {
    fn reading(&mut self, reading: &Reading) {
        if let Some(sender) = &self.readings {
            self.text.clear();
            json::reading(&mut self.text, reading, &self.shared.names);
            sender.send(&self.text, &self.shared);
        }
    }

    fn alarm(&mut self, change: &Change) {
        if let Some(sender) = &self.alarms {
            self.text.clear();
            json::change(&mut self.text, change, &self.shared.names);
            sender.send(&self.text, &self.shared);
        }
    }

    fn standing(&mut self, number: usize, alarm: &Alarm) {
        self.item(Item::Alarm(number, *alarm));
    }

    fn judged(&mut self, reading: &Reading, totals: &Totals, raised: u32) {
        if let Some(file) = &mut self.queues.file
            && file.push(*reading).is_err()
        {
            self.shared.not_written.fetch_add(1, Relaxed);
        }
        if let Some(judged) = &mut self.queues.judged
            && judged.push(Judged { reading: *reading, totals: *totals, raised }).is_err()
        {
            self.shared.log_dropped.fetch_add(1, Relaxed);
        }
        self.item(Item::Reading(*reading));
    }

    fn sample(&mut self, sample: &Sample<'_>) {
        let Some(samples) = &mut self.queues.samples else { return };
        let head = [sample.index, sample.counter as u64, u64::from(sample.filled)];
        let bits = sample.target.iter().chain(sample.measured).map(|v| v.to_bits());
        for (word, value) in self.words.iter_mut().zip(head.into_iter().chain(bits)) {
            *word = value;
        }
        if samples.push_entire_slice(&self.words).is_err() {
            self.shared.log_dropped.fetch_add(1, Relaxed);
        }
    }

    fn evaluated(&mut self, time_s: f64, monitor: &Monitor, state: &MonitorState) {
        let Some(rows) = &mut self.queues.rows else { return };
        let n = monitor.config().n_actuators;
        self.row[0] = time_s;
        for actuator in 0..n {
            let (target, measured) = monitor.window(state, actuator);
            self.row[1 + actuator] = target.last().copied().unwrap_or(f64::NAN);
            self.row[1 + n + actuator] = measured.last().copied().unwrap_or(f64::NAN);
        }
        // The page misses what does not fit; it is a picture, not a record.
        let _ = rows.push_entire_slice(&self.row);
    }

    fn restarted(&mut self) {
        if let Some(rows) = &mut self.queues.rows {
            self.row.fill(f64::NAN);
            let _ = rows.push_entire_slice(&self.row);
        }
    }

    fn event(&mut self, event: Event) {
        self.item(Item::Event(event));
    }
}
