//! A run: sockets and files opened at construction, threads from start to stop.

use std::fmt;
use std::fs::File;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rthstrack::{Monitor, Reading};
use rtrb::Consumer;
use socket2::SockRef;

use crate::alarm::Kind;
use crate::board::Board;
use crate::engine::{Engine, EngineConfig, Totals};
use crate::event::{Happening, LogState};
use crate::layout::Layout;
use crate::line::LineParser;
use crate::lines::{Input, Lines};
use crate::names::Names;
use crate::outlets::{Ends, Item, Judged, Outlets, ROW_HEAD, Sender, Wanted};
use crate::page::Page;
use crate::publish::{keep_board, open_readings, write_readings};
use crate::receive::{Receiver, Rounds, bind, bind_control};
use crate::settings::{LiveConfig, SourceConfig};
use crate::shared::{Shared, Summary, locked};

/// Less than this for datagrams that wait is worth a remark.
const SMALL_BUFFER: usize = 1 << 20;

/// Why a run cannot begin.
#[derive(Debug)]
pub enum LiveError {
    /// Settings that are not possible, a line each.
    Settings(Vec<String>),
    /// A socket or file that the system refuses, with one line that names it.
    System(io::Error),
}

impl fmt::Display for LiveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LiveError::Settings(mistakes) => f.write_str(&mistakes.join("\n")),
            LiveError::System(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for LiveError {}

/// The same kind of error with what was tried.
fn refused(what: impl fmt::Display) -> impl FnOnce(io::Error) -> LiveError {
    move |error| LiveError::System(io::Error::new(error.kind(), format!("{what}: {error}")))
}

/// Samples for the log, a column each; target and measured with the actuators of a sample side by side.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleColumns {
    /// From 0, without a break.
    pub index: Vec<i64>,
    /// index / rate.
    pub time_s: Vec<f64>,
    /// As it was sent.
    pub counter: Vec<i64>,
    /// Put on a straight line over a gap.
    pub filled: Vec<bool>,
    /// (n_samples, n_actuators)
    pub target: Vec<f64>,
    /// (n_samples, n_actuators)
    pub measured: Vec<f64>,
}

/// A reading for the log.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedReading {
    /// The reading.
    pub reading: Reading,
    /// Everything counted when it was made.
    pub totals: Totals,
    /// Names of the raised alarms of its actuator and of the stream, with commas.
    pub alarms: String,
}

enum Source {
    Udp(Receiver),
    Lines(Lines),
}

/// What the threads take with them.
struct Parts {
    source: Source,
    engine: Engine,
    outlets: Outlets,
    rounds: Rounds,
    items: Option<Consumer<Item>>,
    rows: Option<Consumer<f64>>,
    file: Option<(File, PathBuf, Consumer<Reading>)>,
}

/// The on-line monitor. All methods may be called from any thread.
pub struct Live {
    shared: Arc<Shared>,
    page: Arc<Page>,
    parts: Mutex<Option<Parts>>,
    threads: Mutex<Vec<JoinHandle<()>>>,
    samples: Mutex<Option<Consumer<u64>>>,
    judged: Mutex<Option<Consumer<Judged>>>,
    address: String,
    control_address: String,
    n_actuators: usize,
    rate_hz: f64,
}

impl Live {
    /// Checks everything, binds sockets and opens files. Datagrams wait in the socket from here on.
    ///
    /// # Errors
    /// [`LiveError::Settings`] with all mistakes, [`LiveError::System`].
    pub fn new(config: LiveConfig) -> Result<Self, LiveError> {
        let monitor = checked(&config)?;
        let shared = Arc::new(Shared::new(Names::new(&config.outputs.names, config.monitor.n_actuators)));
        let (source, address, described, bits) = open_source(&config.source, &shared)?;
        let outputs = &config.outputs;
        let control = outputs
            .control
            .map(|at| bind_control(at).map_err(refused(format!("cannot listen for a reset on {at}"))))
            .transpose()?;
        let control_address = local(control.as_ref());
        let sender = |to: Option<SocketAddr>, what: &str| {
            to.map(|to| Sender::new(to).map_err(refused(format!("cannot send {what} to {to}")))).transpose()
        };
        let (readings, alarms) = (sender(outputs.readings_udp, "readings")?, sender(outputs.alarm_udp, "alarms")?);
        let file = outputs.readings_file.clone().map(|path| {
            let file = open_readings(&path).map_err(refused(format!("cannot write readings to {}", path.display())))?;
            Ok((file, path))
        });
        let file = file.transpose()?;
        let wanted = Wanted { log: outputs.log, file: file.is_some(), page: outputs.page };
        let engine = Engine::new(
            monitor.clone(),
            &EngineConfig {
                counter_bits: bits,
                fill_samples: config.fill_samples,
                check_pace: config.check_pace,
                alarms: config.alarms,
            },
        );
        let board = Board::new(&monitor, engine.alarms());
        let (n_actuators, rate_hz) = (monitor.config().n_actuators, monitor.config().rate_hz);
        let (outlets, ends) = Outlets::new(shared.clone(), &monitor, wanted, readings, alarms);
        let Ends { samples, judged, file: readings_end, items, rows } = ends;
        let parts = Parts {
            source,
            engine,
            outlets,
            rounds: Rounds::new(shared.clone(), control),
            items,
            rows,
            file: file.zip(readings_end).map(|((file, path), readings)| (file, path, readings)),
        };
        Ok(Self {
            page: Arc::new(Page::new(shared.clone(), monitor, board, &config.alarms, &described, outputs)),
            shared,
            parts: Mutex::new(Some(parts)),
            threads: Mutex::new(Vec::new()),
            samples: Mutex::new(samples),
            judged: Mutex::new(judged),
            address,
            control_address,
            n_actuators,
            rate_hz,
        })
    }

    /// Starts the threads; a second time does nothing.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(&self) -> io::Result<()> {
        let Some(parts) = locked(&self.parts).take() else { return Ok(()) };
        let Parts { source, engine, outlets, rounds, items, rows, file } = parts;
        let mut threads = locked(&self.threads);
        let mut spawn = |name: &str, run: Box<dyn FnOnce() + Send>| {
            threads.push(thread::Builder::new().name(format!("rthstrack {name}")).spawn(run)?);
            io::Result::Ok(())
        };
        if let Some(items) = items {
            let (shared, page) = (self.shared.clone(), self.page.clone());
            spawn("board", Box::new(move || keep_board(&shared, &page, items, rows)))?;
        }
        if let Some((file, path, readings)) = file {
            let shared = self.shared.clone();
            spawn("readings", Box::new(move || write_readings(&shared, file, &path, readings)))?;
        }
        // Whoever waits is told, whatever happens in there.
        let finish = Finish(self.shared.clone());
        spawn(
            "receive",
            Box::new(move || {
                let _finish = finish;
                match source {
                    Source::Udp(receiver) => receiver.run(engine, outlets, rounds),
                    Source::Lines(lines) => lines.run(engine, outlets, rounds),
                }
            }),
        )
    }

    /// Ends the run and waits for its threads: what was received is written out. A second time does nothing.
    pub fn stop(&self) {
        self.shared.stop.store(true, Relaxed);
        if locked(&self.parts).take().is_some() {
            self.shared.finish(None);
        }
        let threads = std::mem::take(&mut *locked(&self.threads));
        for thread in threads {
            let _ = thread.join();
        }
    }

    /// Whether the run has ended, after this time at the latest.
    pub fn wait(&self, timeout: Duration) -> bool {
        self.shared.wait(timeout)
    }

    /// Where it listens; empty for lines.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Where a reset may be asked for; empty where there is no such place.
    pub fn control_address(&self) -> &str {
        &self.control_address
    }

    /// Why the run has ended of itself.
    pub fn fatal(&self) -> Option<String> {
        self.shared.fatal()
    }

    /// Ends alarms that are held, within some milliseconds.
    pub fn reset(&self) {
        self.shared.reset.store(true, Relaxed);
    }

    /// Everything counted.
    pub fn summary(&self) -> Summary {
        self.shared.summary()
    }

    /// Whether an alarm has been raised at any time.
    pub fn alarmed(&self) -> bool {
        self.shared.summary().totals.alarms > 0
    }

    /// For the page: what does not change, as JSON.
    pub fn hello(&self) -> String {
        self.page.hello()
    }

    /// For the page: what is new since a cursor (0 for everything kept), as JSON, and the next cursor.
    pub fn frame(&self, cursor: u64) -> (String, u64) {
        self.page.frame(cursor)
    }

    /// For the terminal view: how all stands, as JSON.
    pub fn status(&self) -> String {
        self.page.status()
    }

    /// What the log's writer says of itself; `None` when there is no log.
    pub fn note_log(&self, state: Option<LogState>) {
        let mut log = locked(&self.shared.log);
        // Its reason may change, which is nothing new.
        if let Some(state) = state.as_ref().filter(|new| log.as_ref().map(LogState::code) != Some(new.code())) {
            self.shared.remark(Happening::Log { state: state.clone() });
        }
        *log = state;
    }

    /// Number of actuators.
    pub fn n_actuators(&self) -> usize {
        self.n_actuators
    }

    /// Takes the samples that wait for the log.
    pub fn take_samples(&self) -> SampleColumns {
        let mut columns = SampleColumns::default();
        let mut samples = locked(&self.samples);
        let Some(samples) = samples.as_mut() else { return columns };
        let n = self.n_actuators;
        let mut words = vec![0; ROW_HEAD + 2 * n];
        while samples.pop_entire_slice(&mut words).is_ok() {
            columns.index.push(words[0] as i64);
            columns.time_s.push(words[0] as f64 / self.rate_hz);
            columns.counter.push(words[1] as i64);
            columns.filled.push(words[2] != 0);
            let values = words[ROW_HEAD..].iter().map(|w| f64::from_bits(*w));
            columns.target.extend(values.clone().take(n));
            columns.measured.extend(values.skip(n));
        }
        columns
    }

    /// Takes the readings that wait for the log.
    pub fn take_readings(&self) -> Vec<LoggedReading> {
        let mut found = Vec::new();
        let mut judged = locked(&self.judged);
        let Some(judged) = judged.as_mut() else { return found };
        while let Ok(Judged { reading, totals, raised }) = judged.pop() {
            let names: Vec<&str> =
                Kind::ALL.iter().filter(|kind| raised & kind.bit() != 0).map(|kind| kind.name()).collect();
            found.push(LoggedReading { reading, totals, alarms: names.join(",") });
        }
        found
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.stop();
    }
}

struct Finish(Arc<Shared>);

impl Drop for Finish {
    fn drop(&mut self) {
        let broken = thread::panicking().then_some("the monitor broke: this is a mistake of ours, please report it");
        self.0.finish(broken);
    }
}

/// The monitor's plan, when there is no mistake at all.
fn checked(config: &LiveConfig) -> Result<Arc<Monitor>, LiveError> {
    let mistakes = config.mistakes();
    if !mistakes.is_empty() {
        return Err(LiveError::Settings(mistakes));
    }
    let monitor = Monitor::new(config.monitor).map_err(|error| LiveError::Settings(vec![error.to_string()]))?;
    Ok(Arc::new(monitor))
}

/// The source, where it listens, the same in words, and the width of its counter.
fn open_source(source: &SourceConfig, shared: &Shared) -> Result<(Source, String, String, u32), LiveError> {
    match source {
        SourceConfig::Udp { address, senders, layout } => {
            let layout = Layout::new(layout.clone()).map_err(LiveError::Settings)?;
            let socket = bind(*address).map_err(refused(format!("cannot listen on {address}")))?;
            let granted = SockRef::from(&socket).recv_buffer_size().unwrap_or(SMALL_BUFFER);
            if granted < SMALL_BUFFER {
                shared.remark(Happening::SmallBuffer { kib: granted >> 10 });
            }
            let (bits, at) = (layout.counter_bits(), local(Some(&socket)));
            let receiver = Receiver { socket, senders: senders.clone(), layout };
            Ok((Source::Udp(receiver), at.clone(), format!("udp {at}"), bits))
        }
        SourceConfig::Lines { path, layout } => {
            let parser = LineParser::new(layout.clone()).map_err(LiveError::Settings)?;
            let (input, described) = match path {
                None => (Input::Stdin, "standard input".to_owned()),
                Some(path) => {
                    let shown = path.display();
                    let file = File::open(path).map_err(refused(format!("cannot read {shown}")))?;
                    (Input::File(file), format!("file {shown}"))
                }
            };
            Ok((Source::Lines(Lines { input, parser }), String::new(), described, 64))
        }
    }
}

fn local(socket: Option<&UdpSocket>) -> String {
    socket.and_then(|s| s.local_addr().ok()).map_or_else(String::new, |address| address.to_string())
}
