//! What the page and the terminal view are told, as JSON.

use std::sync::{Arc, Mutex};

use rthstrack::Monitor;
use rthstrack::setting::{Configuration, Value};

use crate::alarm::{AlarmConfig, Kind};
use crate::board::Board;
use crate::event::LogState;
use crate::json::{self, boolean, key, list, number, optional, text, whole};
use crate::names::Names;
use crate::settings::OutputsConfig;
use crate::shared::{Shared, locked};
use crate::spectrum::{Spectra, windows};

/// Samples a second of the scope that a picture needs.
const SCOPE_HZ: f64 = 512.0;
/// And how much of the past is sent to a new page, a window at least.
const SCOPE_S: f64 = 10.0;
/// Events that the terminal is told each time: as many as alarms may come at once.
const STATUS_EVENTS: usize = 256;

/// Everything that is looked at.
pub(crate) struct Page {
    shared: Arc<Shared>,
    monitor: Arc<Monitor>,
    pub(crate) board: Mutex<Board>,
    spectra: Mutex<Spectra>,
    hello: String,
    stride: u64,
}

impl Page {
    pub(crate) fn new(
        shared: Arc<Shared>,
        monitor: Arc<Monitor>,
        board: Board,
        limits: &AlarmConfig,
        source: &str,
        outputs: &OutputsConfig,
    ) -> Self {
        Self {
            spectra: Mutex::new(Spectra::new(monitor.evaluator())),
            board: Mutex::new(board),
            hello: hello(&monitor, limits, source, outputs, &shared.names),
            stride: (monitor.evaluated_rate_hz() / SCOPE_HZ).ceil().max(1.0) as u64,
            shared,
            monitor,
        }
    }

    /// What does not change.
    pub(crate) fn hello(&self) -> String {
        self.hello.clone()
    }

    /// What is new since a cursor, and the cursor after it. An unknown cursor has seen nothing.
    pub(crate) fn frame(&self, cursor: u64) -> (String, u64) {
        self.refresh_spectrum();
        let mut out = String::with_capacity(16_384);
        out.push('{');
        self.head(&mut out);
        let board = locked(&self.board);
        let since = if cursor > board.version { 0 } else { cursor };
        key(&mut out, "readings");
        list(&mut out, board.readings_since(since), json::reading_row);
        self.scope(&mut out, &board, since);
        self.alarms(&mut out, &board);
        key(&mut out, "events");
        list(&mut out, board.events_since(since), |out, event| event.write(out, &self.shared.names));
        let version = board.version;
        drop(board);
        key(&mut out, "spectrum");
        let spectra = locked(&self.spectra);
        // Made of a version that the reader may know already.
        if spectra.latest.0 > since {
            out.push_str(&spectra.latest.1);
        } else {
            out.push_str("null");
        }
        out.push('}');
        (out, version)
    }

    /// The latest reading of each actuator, and how all stands.
    pub(crate) fn status(&self) -> String {
        let mut out = String::with_capacity(4096);
        out.push('{');
        self.head(&mut out);
        let board = locked(&self.board);
        key(&mut out, "readings");
        list(&mut out, &board.latest, |out, reading| match reading {
            Some(reading) => json::reading(out, reading, &self.shared.names),
            None => out.push_str("null"),
        });
        self.alarms(&mut out, &board);
        key(&mut out, "events");
        list(&mut out, board.last_events(STATUS_EVENTS), |out, event| event.write(out, &self.shared.names));
        out.push('}');
        out
    }

    fn head(&self, out: &mut String) {
        let shared = &self.shared;
        key(out, "time_s");
        number(out, shared.time_s());
        key(out, "state");
        text(out, shared.state());
        key(out, "health");
        out.push('{');
        // The alarms themselves stand beside it.
        for (name, count) in shared.summary().named().into_iter().filter(|(name, _)| *name != "alarms") {
            key(out, name);
            whole(out, count);
        }
        key(out, "pace_hz");
        number(out, shared.pace_hz());
        key(out, "age_s");
        number(out, shared.age_s());
        key(out, "log");
        let log = locked(&shared.log);
        json::displayed(out, log.as_ref());
        key(out, "log_code");
        json::displayed(out, log.as_ref().map(LogState::code).as_ref());
        out.push('}');
    }

    fn scope(&self, out: &mut String, board: &Board, since: u64) {
        let n = self.monitor.config().n_actuators;
        let most_s = SCOPE_S.max(self.monitor.config().window_s);
        let (rows, end_s) = board.scope.since(since, self.stride, most_s);
        key(out, "scope");
        out.push('{');
        key(out, "rate_hz");
        number(out, self.monitor.evaluated_rate_hz() / self.stride as f64);
        key(out, "end_s");
        number(out, if rows.is_empty() { f64::NAN } else { end_s });
        for (name, measured) in [("target", false), ("measured", true)] {
            key(out, name);
            list(out, 0..n, |out, actuator| {
                list(out, &rows, |out, row| json::coarse(out, board.scope.at(*row, actuator, measured)));
            });
        }
        out.push('}');
    }

    fn alarms(&self, out: &mut String, board: &Board) {
        key(out, "alarms");
        list(out, &board.alarms, |out, alarm| json::alarm(out, alarm, &self.shared.names));
    }

    /// One caller makes it; others meanwhile show the last.
    fn refresh_spectrum(&self) {
        let now_s = self.shared.now_s();
        let Ok(mut spectra) = self.spectra.try_lock() else { return };
        if !spectra.is_due(now_s) {
            return;
        }
        let evaluator = self.monitor.evaluator();
        let board = locked(&self.board);
        let found = windows(&board, evaluator, self.monitor.config().n_actuators);
        let version = board.version;
        drop(board);
        if let Some(windows) = found {
            spectra.make(now_s, version, evaluator, &windows);
        }
    }
}

fn hello(monitor: &Monitor, limits: &AlarmConfig, source: &str, outputs: &OutputsConfig, names: &Names) -> String {
    let config = monitor.config();
    let mut made = String::from("{");
    let out = &mut made;
    key(out, "version");
    text(out, env!("CARGO_PKG_VERSION"));
    for (name, value) in [
        ("rate_hz", config.rate_hz),
        ("window_s", config.window_s),
        ("update_hz", monitor.update_hz()),
        ("latency_s", monitor.latency_s()),
    ] {
        key(out, name);
        number(out, value);
    }
    key(out, "estimator");
    text(out, config.evaluator.estimator.code());
    key(out, "band_hz");
    match config.evaluator.band_hz {
        Some((low, high)) => list(out, [low, high], number),
        None => out.push_str("null"),
    }
    key(out, "n_actuators");
    whole(out, config.n_actuators as u64);
    key(out, "names");
    list(out, 0..config.n_actuators, |out, a| text(out, names.of(a)));
    key(out, "units");
    list(out, 0..config.n_actuators, |out, a| match outputs.units.get(a) {
        Some(Some(unit)) => text(out, unit),
        _ => out.push_str("null"),
    });
    key(out, "source");
    text(out, source);
    key(out, "limits");
    out.push('{');
    for setting in AlarmConfig::TABLE.iter().filter(|setting| !AlarmConfig::RULES.contains(&setting.name)) {
        // A share of what is not given is no limit.
        let is_idle = setting.name == "critical_fraction" && limits.critical_delay_s.is_none();
        key(out, limit_name(setting.name));
        let value = match (setting.get)(limits) {
            Value::Number(value) => Some(value),
            Value::Whole(value) => Some(value as f64),
            _ => None,
        };
        optional(out, value.filter(|_| !is_idle));
    }
    key(out, "latch");
    boolean(out, limits.latch);
    out.push('}');
    key(out, "alarm_kinds");
    list(out, Kind::ALL.iter().map(|kind| kind.row()), |out, row| {
        out.push('{');
        for (name, value) in [
            ("name", Some(row.name)),
            ("title", Some(row.title)),
            ("quantity", row.quantity),
            ("limit", Some(limit_name(row.setting))),
        ] {
            key(out, name);
            json::displayed(out, value.as_ref());
        }
        out.push('}');
    });
    out.push('}');
    made
}

/// What the page calls a limit.
fn limit_name(setting: &str) -> &str {
    setting.strip_prefix("limit_").unwrap_or(setting)
}
