//! The threads behind the receiving one: one keeps the board, one writes the file of readings.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use rthstrack::Reading;
use rtrb::Consumer;

use crate::json;
use crate::outlets::Item;
use crate::page::Page;
use crate::shared::{Shared, locked};

const PERIOD: Duration = Duration::from_millis(20);
/// What a reader of the file waits at most.
const FLUSH: Duration = Duration::from_millis(100);

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
pub(crate) fn write_readings(shared: &Arc<Shared>, file: File, path: &Path, mut readings: Consumer<Reading>) {
    let mut file = BufWriter::with_capacity(1 << 16, file);
    let mut line = String::with_capacity(1024);
    loop {
        let ended = readings.is_abandoned();
        if let Err(error) = write_all(&mut file, &mut line, &mut readings) {
            shared.remark(format!("readings are no longer written to {}: {error}", path.display()));
            // What is in the buffer cannot be written either.
            let _ = file.into_parts();
            return;
        }
        if ended {
            return;
        }
        thread::sleep(FLUSH);
    }
}

fn write_all(file: &mut impl Write, line: &mut String, readings: &mut Consumer<Reading>) -> std::io::Result<()> {
    while let Ok(reading) = readings.pop() {
        line.clear();
        json::reading(line, &reading);
        line.push('\n');
        file.write_all(line.as_bytes())?;
    }
    file.flush()
}
