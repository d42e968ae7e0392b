"""`rthstrack replay FILE --to udp://HOST:PORT`: a recorded or virtual test, sent at its own pace."""

from __future__ import annotations

import argparse
import contextlib
import socket
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.cli import addresses
from rthstrack.cli.arguments import add_signals, count, read_signals, together, told, two_files
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.quantities import positive
from rthstrack.cli.running import Ended, say
from rthstrack.errors import RecordingError, RthstrackError, SettingError
from rthstrack.live.layout import DatagramLayout, default_layout, read_layout

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

# Sleeping is no finer: what is due within it is sent in one burst.
_BURST_S = 1e-3
# Samples that are encoded at a time.
_BLOCK = 4096
_MOST_BYTES = 65507


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "replay",
        help=COMMANDS["replay"],
        description="Sends the samples of a recorded test, or of one that 'rthstrack simulate' wrote, as UDP datagrams "
        "at their own pace, so that 'rthstrack monitor' can be rehearsed: counter from 0, target and measured of each "
        "actuator, by default as little-endian doubles. Every sample has its place in time counted from the start, so "
        "lateness does not add up; above 1000 datagrams a second, what is due within a millisecond goes in one burst. "
        "Exit status: 0 sent (SIGINT and SIGTERM end it too), 1 the file cannot be read or nothing can be sent, "
        "2 misuse or a mistake in the layout.",
    )
    parser.add_argument("file", nargs="?", metavar="FILE", help="recorded test or run file of 'rthstrack simulate'; "
                        "none where --target and --measured are each FILE:CHANNEL")  # fmt: skip
    parser.add_argument("--to", type=addresses.udp, required=True, metavar="udp://HOST:PORT", help="where to")
    parser.add_argument("--speed", type=positive, default=1.0, metavar="X", help="times as fast as recorded (1)")
    parser.add_argument(
        "--layout", metavar="FILE.toml", help="where each number stands, as 'rthstrack monitor' takes it"
    )
    parser.add_argument("--samples-per-datagram", type=count, default=1, metavar="K", help="samples in a datagram (1)")
    parser.add_argument("--loop", action="store_true", help="begin anew at the end, with the counter going on")
    add_signals(parser, "signals (a channel is named by name, path or #index)")
    parser.set_defaults(run=lambda args: run(args, parser.error))


def run(args: argparse.Namespace, misuse: Callable[[str], Any]) -> int:
    """Sends the file; returns the exit status."""
    args.two = two_files(args, [args.file] if args.file else [], misuse)
    if args.two is not None:
        args.file = together(args.two)
    elif Path(args.file).is_dir():
        raise RecordingError("a folder; one test is sent at a time", file=args.file, advice="name one of its files")
    if len(args.target or []) != len(args.measured or []):
        misuse(f"--target and --measured go in pairs, found {len(args.target or [])} and {len(args.measured or [])}")
    if args.resample and args.rate:
        misuse("--resample interpolates the file's time stamps and excludes --rate")
    if args.start is not None and args.end is not None and args.start >= args.end:
        misuse(f"--start must come before --end, found {args.start:g} and {args.end:g}")
    layout = None if args.layout is None else read_layout(args.layout, "udp")
    told, signals = _read(args)
    if layout is None:
        layout = default_layout("udp", signals.n_actuators)
    assert isinstance(layout, DatagramLayout)
    _check(layout, signals, args)
    n, k = len(signals.target), args.samples_per_datagram
    pace_hz = signals.rate_hz * args.speed
    bursts = ", in bursts of a millisecond" if pace_hz / k > 1 / _BURST_S else ""
    say(
        f"sending {n} samples of {told}, at {pace_hz:g} Hz to udp://{args.to}{bursts}"
        f"{', over and over' if args.loop else ''}; Ctrl-C ends"
    )
    with Ended() as ended:
        sent = _send(signals, layout, args, ended)
    refused = f"; {sent.refused} datagrams found nobody listening" if sent.refused else ""
    say(f"sent {sent.samples} samples in {sent.seconds:.3f} s, at worst {1e3 * sent.worst_s:.2f} ms late{refused}")
    return 0


@dataclass(frozen=True, slots=True, eq=False)
class _Signals:
    """Target and measured, (n_samples, n_actuators) each."""

    rate_hz: float
    target: NDArray[np.float64]
    measured: NDArray[np.float64]

    @property
    def n_actuators(self) -> int:
        return int(self.target.shape[1])


def _read(args: argparse.Namespace) -> tuple[str, _Signals]:
    """What is sent, and in words which channels it is."""
    recording, rate_hz, pairs, _ = read_signals(args, args.file)
    channels = [(recording.channel(target), recording.channel(measured)) for target, measured in pairs]
    lengths = {one.name: len(one.values) for pair in channels for one in pair}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"'{name}' {length}" for name, length in lengths.items())
        raise RecordingError(f"expected channels of one length, found {listed}; name them with --target "
                             "and --measured", file=args.file)  # fmt: skip
    if not all(lengths.values()):
        raise RecordingError("there are no samples to send", file=args.file)
    names = ", ".join(f"target '{target.name}', measured '{measured.name}'" for target, measured in channels[:3])
    names += f" and {len(channels) - 3} more pairs" if len(channels) > 3 else ""
    target, measured = (np.column_stack([pair[i].values for pair in channels]) for i in (0, 1))
    return names, _Signals(rate_hz, target, measured)


def _check(layout: DatagramLayout, signals: _Signals, args: argparse.Namespace) -> None:
    """Raises SettingError, a line for each thing that does not fit."""
    mistakes = []
    most = (_MOST_BYTES - layout.header_bytes) // layout.sample_bytes
    if args.samples_per_datagram > most:
        mistakes.append(f"--samples-per-datagram: expected at most {most}, which fill a datagram, found "
                        f"{args.samples_per_datagram}")  # fmt: skip
    if layout.n_actuators != signals.n_actuators:
        mistakes.append(f"{args.layout}: expected an [[actuator]] for each target and measured, {signals.n_actuators}, "
                        f"found {layout.n_actuators}; --target and --measured choose")  # fmt: skip
    else:
        for i in range(signals.n_actuators):
            for name in ("target", "measured"):
                try:
                    layout.check_range(name, i, getattr(signals, name)[:, i])
                except SettingError as error:
                    mistakes.append(told(error))
    if mistakes:
        raise SettingError("\n".join(mistakes))


@dataclass(slots=True)
class _Sent:
    samples: int = 0
    seconds: float = 0.0
    worst_s: float = 0.0
    refused: int = 0


def _datagrams(signals: _Signals, layout: DatagramLayout, k: int, *, loop: bool) -> Iterator[tuple[int, list[bytes]]]:
    """Datagrams in order, a list at a time, with the counter of the first sample in each list."""
    n = len(signals.target)
    block = max(_BLOCK // k, 1) * k
    header = bytes(layout.header_bytes)
    size, first = layout.sample_bytes * k, 0
    while True:
        for begin in range(0, n, block):
            part = slice(begin, min(begin + block, n))
            counter = np.arange(first + part.start, first + part.stop, dtype=np.int64)
            content = layout.encoded(counter, signals.target[part], signals.measured[part]).tobytes()
            yield first + begin, [header + content[at : at + size] for at in range(0, len(content), size)]
        if not loop:
            return
        first += n


def _send(signals: _Signals, layout: DatagramLayout, args: argparse.Namespace, ended: Ended) -> _Sent:
    """Sends until the end. The datagram whose last sample is i is due i / rate after the start."""
    sent = _Sent()
    k, step_s = args.samples_per_datagram, 1 / (signals.rate_hz * args.speed)
    host, _, port = args.to.rpartition(":")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as sock:
        try:
            # A link-local address bears its interface, which connecting to a text would forget.
            sock.connect(socket.getaddrinfo(host.strip("[]"), int(port), family, socket.SOCK_DGRAM)[0][4])
        except OSError as error:
            raise RthstrackError(f"--to: nothing can be sent to udp://{args.to}: {error.strerror}") from None
        n, begin_s = len(signals.target), time.monotonic()
        for first, datagrams in _datagrams(signals, layout, k, loop=args.loop):
            here = first
            for datagram in datagrams:
                # The last datagram of a record may be short.
                here += min(k, n - here % n)
                due_s = begin_s + (here - 1) * step_s
                while (wait_s := due_s - time.monotonic()) > 0 and not ended.asked:
                    # A signal cuts no sleep short: it is looked for twice a second.
                    time.sleep(min(max(wait_s, _BURST_S if k * step_s < _BURST_S else 0.0), 0.5))
                if ended.asked:
                    return sent
                _deliver(sock, datagram, args.to, sent)
                now_s = time.monotonic()
                sent.samples, sent.seconds = here, now_s - begin_s
                sent.worst_s = max(sent.worst_s, now_s - due_s)
    return sent


def _deliver(sock: socket.socket, datagram: bytes, to: str, sent: _Sent) -> None:
    try:
        sock.send(datagram)
    except ConnectionRefusedError:
        # Told of an earlier datagram: nobody listened. Somebody may from now on.
        sent.refused += 1
        with contextlib.suppress(ConnectionRefusedError):
            sock.send(datagram)
    except OSError as error:
        raise RthstrackError(f"--to: udp://{to}: {error.strerror or error}; {sent.samples} samples were sent") from None
