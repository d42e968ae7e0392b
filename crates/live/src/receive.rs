//! The receiving thread: datagrams in, readings out. It waits for nothing but the socket.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use socket2::{Domain, Protocol, Socket, Type};

use crate::engine::Engine;
use crate::event::Happening;
use crate::layout::{Layout, MAX_DATAGRAM};
use crate::outlets::Outlets;
use crate::shared::Shared;

/// Bytes asked of the system for datagrams that wait; it may grant less.
const BUFFER: usize = 8 << 20;
/// From one look at the clock, the control socket and the flags to the next.
const TICK_S: f64 = 0.02;
const TIMEOUT: Duration = Duration::from_millis(50);
/// Errors of the socket in a row that end the run.
const MAX_ERRORS: u32 = 100;
/// Between two events about the same kind of bad datagram.
const REMIND_S: f64 = 60.0;

/// A bound socket that waits [`TIMEOUT`] for a datagram.
pub(crate) fn bind(address: SocketAddr) -> std::io::Result<UdpSocket> {
    let socket = Socket::new(Domain::for_address(address), Type::DGRAM, Some(Protocol::UDP))?;
    // Less is better than nothing: the counter tells what is lost.
    let _ = socket.set_recv_buffer_size(BUFFER);
    socket.bind(&address.into())?;
    match address.ip() {
        IpAddr::V4(ip) if ip.is_multicast() => socket.join_multicast_v4(&ip, &Ipv4Addr::UNSPECIFIED)?,
        IpAddr::V6(ip) if ip.is_multicast() => socket.join_multicast_v6(&ip, 0)?,
        _ => {}
    }
    let socket = UdpSocket::from(socket);
    socket.set_read_timeout(Some(TIMEOUT))?;
    Ok(socket)
}

/// The socket on which a reset is asked for.
pub(crate) fn bind_control(address: SocketAddr) -> std::io::Result<UdpSocket> {
    let socket = UdpSocket::bind(address)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// What is looked at now and then, whatever the source.
pub(crate) struct Rounds {
    pub(crate) shared: Arc<Shared>,
    pub(crate) control: Option<UdpSocket>,
    due_s: f64,
}

impl Rounds {
    pub(crate) fn new(shared: Arc<Shared>, control: Option<UdpSocket>) -> Self {
        Self { shared, control, due_s: 0.0 }
    }

    /// Whether to go on.
    pub(crate) fn make(&mut self, now_s: f64, engine: &mut Engine, out: &mut Outlets) -> bool {
        if now_s < self.due_s {
            return engine.fatal().is_none();
        }
        self.due_s = now_s + TICK_S;
        engine.idle(now_s, out);
        if self.control.as_ref().is_some_and(reset_asked) | self.shared.reset.swap(false, Relaxed) {
            engine.reset(now_s, out);
        }
        self.shared.show(engine);
        !self.shared.is_stopping() && engine.fatal().is_none()
    }
}

/// Only this machine may reset.
fn reset_asked(control: &UdpSocket) -> bool {
    let mut text = [0; 64];
    let mut asked = false;
    for _ in 0..16 {
        match control.recv_from(&mut text) {
            Ok((len, from)) => {
                asked |= from.ip().to_canonical().is_loopback() && text[..len].trim_ascii() == b"reset";
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(_) => {}
        }
    }
    asked
}

/// So many samples in the other byte order, and none in this one, are no accident.
const HOPELESS: u64 = 100;

/// A stream of datagrams.
pub(crate) struct Receiver {
    pub(crate) socket: UdpSocket,
    pub(crate) senders: Option<Vec<IpAddr>>,
    pub(crate) layout: Layout,
}

impl Receiver {
    /// Receives until it is stopped or cannot go on.
    pub(crate) fn run(self, mut engine: Engine, mut out: Outlets, mut rounds: Rounds) {
        let shared = rounds.shared.clone();
        // Room for more than is taken: what is cut off would look whole.
        let mut datagram = vec![0; 1 << 16];
        let mut values = [vec![0.0; self.layout.n_actuators()], vec![0.0; self.layout.n_actuators()]];
        let mut errors = 0;
        let (mut reminded, mut senders) = (Reminded::default(), Senders::default());
        loop {
            let found = self.socket.recv_from(&mut datagram);
            let now_s = shared.now_s();
            match found {
                Ok((len, from)) => {
                    errors = 0;
                    if self.accepts(from) {
                        if let Some(other) = senders.other(now_s, from) {
                            engine.tell(now_s, Happening::TwoSenders { sender: from, other }, &mut out);
                        }
                        self.take(now_s, &datagram[..len], &mut values, &mut engine, &mut out, &mut reminded);
                    } else {
                        engine.refused();
                        if reminded.is_due(now_s, 0) {
                            engine.tell(now_s, Happening::SenderRefused { sender: from.ip() }, &mut out);
                        }
                    }
                }
                // Timeouts, and what Windows says of a port that the last answer did not reach.
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(e) if matches!(e.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionReset) => {}
                Err(error) => {
                    errors += 1;
                    if errors == MAX_ERRORS {
                        engine.fail(format!("nothing can be received any more: {error}"));
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            if !rounds.make(now_s, &mut engine, &mut out) {
                break;
            }
        }
        shared.show(&engine);
        shared.finish(engine.fatal());
    }

    fn accepts(&self, from: SocketAddr) -> bool {
        self.senders.as_ref().is_none_or(|senders| senders.contains(&from.ip().to_canonical()))
    }

    fn take(
        &self,
        now_s: f64,
        datagram: &[u8],
        [target, measured]: &mut [Vec<f64>; 2],
        engine: &mut Engine,
        out: &mut Outlets,
        reminded: &mut Reminded,
    ) {
        let Some(n) = self.layout.n_samples(datagram.len()).filter(|_| datagram.len() <= MAX_DATAGRAM) else {
            engine.malformed();
            if reminded.is_due(now_s, 1) {
                let (bytes, expected) = (datagram.len(), self.layout.expected().to_string());
                engine.tell(now_s, Happening::MalformedSize { bytes, expected }, out);
            }
            return;
        };
        engine.comes_in_blocks(n);
        for i in 0..n {
            match self.layout.decode(datagram, i, target, measured) {
                Some(counter) => {
                    let counter = self.layout.is_counted().then_some(counter);
                    engine.sample(now_s, counter, target, measured, out);
                }
                None => {
                    engine.malformed();
                    let is_other = self.layout.counts_in_other_order(datagram, i);
                    if reminded.is_due(now_s, 2) {
                        let what = if is_other { Happening::OtherByteOrder {} } else { Happening::MalformedCounter {} };
                        engine.tell(now_s, what, out);
                    }
                    // A counter of zero is the same in both orders.
                    if is_other && engine.totals().malformed == HOPELESS && engine.totals().tally.received <= 1 {
                        engine.fail(format!(
                            "none of the first {HOPELESS} samples has a counter that counts, unless their bytes are in \
                             the other order: is byte_order of the layout right?"
                        ));
                    }
                }
            }
        }
    }
}

/// Who sends: the last two, and when the other of them last did.
#[derive(Debug, Default)]
struct Senders {
    last: Option<SocketAddr>,
    other: Option<(SocketAddr, f64)>,
    told_s: Option<f64>,
}

impl Senders {
    /// The other sender, where two take turns within a second; once a minute.
    fn other(&mut self, now_s: f64, from: SocketAddr) -> Option<SocketAddr> {
        let last = self.last.replace(from)?;
        if last == from {
            return None;
        }
        let takes_turns = self.other.is_some_and(|(other, at_s)| other == from && now_s - at_s < 1.0);
        self.other = Some((last, now_s));
        let is_due = self.told_s.is_none_or(|told_s| now_s - told_s >= REMIND_S);
        (takes_turns && is_due).then(|| {
            self.told_s = Some(now_s);
            last
        })
    }
}

/// When something was last told.
#[derive(Debug, Default)]
pub(crate) struct Reminded([Option<f64>; 3]);

impl Reminded {
    pub(crate) fn is_due(&mut self, now_s: f64, what: usize) -> bool {
        let due = self.0[what].is_none_or(|last| now_s - last >= REMIND_S);
        if due {
            self.0[what] = Some(now_s);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_senders_that_take_turns_are_told_once_and_one_that_moved_is_not() {
        let at = |port| SocketAddr::from(([127, 0, 0, 1], port));
        let mut senders = Senders::default();
        let mut told = |now_s, port| senders.other(now_s, at(port));
        assert_eq!([(0.0, 1), (0.1, 1), (5.0, 2), (5.1, 2), (9.0, 1), (9.1, 1)].map(|(t, p)| told(t, p)), [None; 6]);
        assert_eq!(told(9.2, 2), Some(at(1)));
        assert_eq!(told(9.3, 1), None, "once a minute");
    }
}
