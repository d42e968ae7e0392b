//! The on-line monitor: what stands around [`rthstrack::Monitor`] when samples come from a laboratory while the test runs.
//!
//! ```text
//! datagrams, lines -> samples -> sequence -> Monitor -> readings -> alarms -> datagrams, file, log, page
//! ```
//!
//! Data flows through the modules in this order:
//!
//! 1. [`settings`]: the user's settings, every key checked.
//! 2. [`layout`] and [`mod@line`]: bytes to samples. Pure.
//! 3. [`sequence`]: what was lost, repeated, reordered, by the sender's counter. Pure.
//! 4. [`engine`]: fills short gaps, starts windows anew, steps the monitor. Pure; so are [`alarm`], [`event`] and `pace`, which it
//!    uses.
//! 5. `receive`, `lines`: the receiving thread. It waits for its input and for nothing else.
//! 6. `outlets`: that thread's end of all queues, and the datagrams that it sends itself.
//! 7. `publish`: the threads behind it; `board` is what they keep for the page and the terminal view.
//! 8. `page`, `spectrum`, [`json`]: what those are told, made in the thread of whoever asks.
//! 9. [`Live`]: the whole.
//!
//! Time is that of the stream, index over rate; the clock behind silence and pace is monotonic, so setting the computer's clock
//! changes nothing.

#![forbid(unsafe_code)]

pub mod alarm;
mod board;
pub mod engine;
pub mod event;
pub mod json;
pub mod layout;
pub mod line;
mod lines;
mod live;
pub mod names;
mod outlets;
mod pace;
mod page;
mod publish;
mod receive;
pub mod sequence;
pub mod settings;
mod shared;
mod spectrum;

pub use live::{Live, LiveError, LoggedReading, SampleColumns};
pub use settings::{LiveConfig, OutputsConfig, SourceConfig};
pub use shared::Summary;
