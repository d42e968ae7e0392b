//! The threads behind the receiving one: one keeps the board, one writes the file of readings.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use rthstrack::Reading;
use rtrb::Consumer;

use crate::event::Happening;
use crate::json;
use crate::names::Names;
use crate::outlets::Item;
use crate::page::Page;
use crate::shared::{Shared, locked};

const PERIOD: Duration = Duration::from_millis(20);
/// What a reader of the file waits at most.
const FLUSH: Duration = Duration::from_millis(100);
/// Bytes.
const MOST_AT_ONCE: usize = 1 << 16;

/// Keeps the board until the stream has ended and all is taken.
pub(crate) fn keep_board(shared: &Shared, page: &Page, mut items: Consumer<Item>, mut rows: Option<Consumer<f64>>) {
    loop {
        let ended = items.is_abandoned();
        let remarks = std::mem::take(&mut *locked(&shared.remarks));
        locked(&page.board).drain(&mut items, rows.as_mut(), remarks);
        if ended {
            return;
        }
        thread::sleep(PERIOD);
    }
}

/// Opens the file of readings; what is there already stays.
pub(crate) fn open_readings(path: &Path) -> std::io::Result<File> {
    OpenOptions::new().create(true).append(true).open(path)
}

/// Writes readings as lines until the stream has ended. When the disk is full it says so, and the monitor goes on.
pub(crate) fn write_readings(shared: &Arc<Shared>, mut file: File, path: &Path, mut readings: Consumer<Reading>) {
    let mut lines = String::with_capacity(1 << 16);
    let mut length = file.metadata().map_or(0, |m| m.len());
    loop {
        let ended = readings.is_abandoned();
        while !readings.is_empty() {
            take_lines(&mut lines, &mut readings, &shared.names);
            if let Err(error) = file.write_all(lines.as_bytes()) {
                // No part of a line stays behind; a device has no length to go back to.
                let _ = file.set_len(length);
                let (path, error) = (path.display().to_string(), error.to_string());
                shared.remark(Happening::ReadingsStopped { path, error });
                return;
            }
            length += lines.len() as u64;
        }
        if ended {
            return;
        }
        thread::sleep(FLUSH);
    }
}

/// As many as are written at once.
fn take_lines(lines: &mut String, readings: &mut Consumer<Reading>, names: &Names) {
    lines.clear();
    while lines.len() < MOST_AT_ONCE
        && let Ok(reading) = readings.pop()
    {
        json::reading(lines, &reading, names);
        lines.push('\n');
    }
}
