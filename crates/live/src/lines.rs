//! A stream of lines, from standard input or a file. One thread reads and may have to wait; another evaluates.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use crate::engine::Engine;
use crate::event::Happening;
use crate::line::{Line, LineParser, MAX_LINE, Splitter};
use crate::outlets::Outlets;
use crate::receive::{Reminded, Rounds};

const CHUNK: usize = 65_536;
/// Chunks that wait to be evaluated; then the sender waits, as is usual for a pipe.
const CHUNKS: usize = 8;
const TIMEOUT: Duration = Duration::from_millis(50);

/// Where lines come from.
pub(crate) enum Input {
    Stdin,
    File(File),
}

type Chunks = Receiver<std::io::Result<Vec<u8>>>;

/// Begins to read. The thread ends with the input, or when nobody listens any more; until something comes it cannot be stopped.
fn reader(input: Input) -> std::io::Result<Chunks> {
    let (sender, receiver) = sync_channel(CHUNKS);
    thread::Builder::new().name("rthstrack lines".to_owned()).spawn(move || match input {
        Input::Stdin => read(&mut std::io::stdin().lock(), &sender),
        Input::File(mut file) => read(&mut file, &sender),
    })?;
    Ok(receiver)
}

fn read(input: &mut impl Read, sender: &SyncSender<std::io::Result<Vec<u8>>>) {
    let mut bytes = vec![0; CHUNK];
    loop {
        let found = match input.read(&mut bytes) {
            Ok(0) => return,
            Ok(n) => Ok(bytes[..n].to_vec()),
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => Err(error),
        };
        let failed = found.is_err();
        if sender.send(found).is_err() || failed {
            return;
        }
    }
}

/// A stream of lines.
pub(crate) struct Lines {
    pub(crate) input: Input,
    pub(crate) parser: LineParser,
}

impl Lines {
    /// Reads until the end of the input, or until it is stopped.
    pub(crate) fn run(self, mut engine: Engine, mut out: Outlets, mut rounds: Rounds) {
        let shared = rounds.shared.clone();
        let n = self.parser.n_actuators();
        let mut taker = Taker {
            patience: Patience::Left,
            parser: self.parser,
            values: [vec![0.0; n], vec![0.0; n]],
            reminded: Reminded::default(),
        };
        let mut splitter = Splitter::default();
        match reader(self.input) {
            Err(error) => engine.fail(format!("the input cannot be read: {error}")),
            Ok(chunks) => loop {
                let found = chunks.recv_timeout(TIMEOUT);
                let now_s = shared.now_s();
                match found {
                    Ok(Ok(bytes)) => splitter.push(&bytes, |line| taker.take(now_s, line, &mut engine, &mut out)),
                    Ok(Err(error)) => engine.fail(format!("the input cannot be read any more: {error}")),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => {
                        if let Some(rest) = splitter.finish() {
                            taker.take(now_s, Some(&rest), &mut engine, &mut out);
                        }
                        break;
                    }
                }
                if !rounds.make(now_s, &mut engine, &mut out) {
                    break;
                }
                taker.patience = taker.patience.give(&out);
            },
        }
        shared.show(&engine);
        shared.finish(engine.fatal());
    }
}

/// A file comes faster than it can be logged. Whoever reads the queues is given time, as long as it makes use of it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Patience {
    Left,
    Lost,
}

impl Patience {
    fn give(self, out: &Outlets) -> Self {
        const STEP: Duration = Duration::from_millis(2);
        const MOST: u32 = 500;
        if !out.is_crowded() {
            return Patience::Left;
        }
        if self == Patience::Left {
            for _ in 0..MOST {
                thread::sleep(STEP);
                if !out.is_crowded() {
                    return Patience::Left;
                }
            }
        }
        Patience::Lost
    }
}

/// So many lines of which none is a sample end the run.
const HOPELESS: u64 = 100;

struct Taker {
    patience: Patience,
    parser: LineParser,
    values: [Vec<f64>; 2],
    reminded: Reminded,
}

impl Taker {
    fn take(&mut self, now_s: f64, line: Option<&[u8]>, engine: &mut Engine, out: &mut Outlets) {
        if engine.fatal().is_some() {
            return;
        }
        let [target, measured] = &mut self.values;
        let found = line.map_or(Line::Malformed, |line| self.parser.read(line, target, measured));
        match found {
            Line::Nothing => {}
            Line::Sample(counter) => engine.sample(now_s, counter, target, measured, out),
            Line::Unusable(why) => engine.fail(why),
            Line::Malformed => {
                engine.malformed();
                if self.reminded.is_due(now_s, 0) {
                    let (line, expected) = (excerpt(line), self.parser.expected().to_string());
                    engine.tell(now_s, Happening::MalformedLine { line, expected }, out);
                }
                if engine.totals().malformed == HOPELESS && engine.totals().tally.received == 0 {
                    engine.fail(format!(
                        "none of the first {HOPELESS} lines is a sample: expected {}",
                        self.parser.expected()
                    ));
                }
            }
        }
    }
}

/// The beginning of a line, to recognise it by.
fn excerpt(line: Option<&[u8]>) -> String {
    const MOST: usize = 60;
    let Some(line) = line else { return format!("a line of more than {MAX_LINE} bytes") };
    let text = String::from_utf8_lossy(&line[..line.len().min(4 * MOST)]);
    let shown: String = text.trim().chars().take(MOST).collect();
    format!("the line '{shown}' is no sample")
}
