"""The live page: a static page and a stream of server-sent events, for a few browsers at once.

The page only reads. It has two routes, takes no input beyond them, and asks its source for nothing but text. A browser
that is slow, stalled or gone concerns its own thread alone.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import socket
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from socketserver import TCPServer
from typing import Any, Protocol

from rthstrack.assets import asset, digest
from rthstrack.errors import SettingError

#: Browsers that may watch at once.
MOST_BROWSERS = 16
#: Connections that may be open at once, with those that only load the page or never ask for anything.
MOST_CONNECTIONS = 48
#: Frames to one browser are at least so far apart.
FRAME_S = 0.05
#: A frame with nothing new is sent so seldom; often enough that the page does not take the connection for lost (1.5 s).
IDLE_S = 0.2
#: A browser that takes nothing for so long is dropped.
STALLED_S = 5.0
#: A browser that lost the page tries again after so long.
RETRY_MS = 500

_PIECE = 1 << 16
_STYLES = ("uPlot.min.css", "charts.css", "live.css")
# The panels stand between what they use and the run that makes them.
_PANELS = ("cards", "moving", "signals", "spectrum", "health", "alarms")
_SCRIPTS = (
    "uPlot.iife.min.js",
    "charts.js",
    *(f"live/{name}.js" for name in ("page", "kept", *_PANELS, "run", "connection")),
)
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[^\[\]:/@\s]+)(?::\d{1,5})?", re.ASCII)
_LOOPBACK = ("localhost", "127.0.0.1", "::1")


class Source(Protocol):
    """What is shown. Both are called from several threads at once, one a browser, and must not wait."""

    def hello(self) -> str:
        """JSON of what stays the same: rate, window, names, limits."""

    def frame(self, cursor: int) -> tuple[str, int]:
        """JSON of what is new since `cursor` (0: everything kept), and the cursor to ask with next time."""


class Page:
    """Serves the live page of `source` at `url`, between `start` and `stop`; the port is taken when constructing.

    port: 0 takes a free one. host: the address to listen at; only this machine can reach the default. allowed_hosts:
    names by which browsers may call this machine, besides localhost and its addresses, whatever the port: it may be
    another one at the near end of a tunnel (`ssh -L`).
    Errors: SettingError where nothing can listen at that address and port.
    """

    def __init__(self, source: Source, port: int, host: str = "127.0.0.1", allowed_hosts: Iterable[str] = ()) -> None:
        self._server = _listening(source, host, port, allowed_hosts)
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Where to open the page on this machine."""
        return f"http://{_authority(self._server.shown_host, self._server.server_port)}/"

    def start(self) -> None:
        """Serve, in threads of its own; once only."""
        if self._thread is None:
            serve = self._server.serve_forever
            self._thread = threading.Thread(target=serve, args=(0.1,), name="rthstrack page", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Close the port and every connection; may be called again."""
        self._server.stopping.set()
        if self._thread is not None:
            self._server.shutdown()
            self._thread.join()
        self._server.server_close()
        self._server.hang_up()


# ---------------------------------------------------------------------------------------------------- listening


def _listening(source: Source, host: str, port: int, allowed_hosts: Iterable[str]) -> _Server:
    if not 0 <= port <= 65535:
        raise SettingError(f"the page's port is {port}; expected 1 to 65535, or 0 for a free one")
    try:
        (family, _, _, _, address), *_ = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
    except (OSError, UnicodeError) as error:
        raise SettingError(
            f"the page cannot listen at {host!r}: not an address of this machine ({error}); take 127.0.0.1"
        ) from error
    try:
        return _Server(source, family, address, allowed_hosts)
    except OSError as error:
        where = _authority(host, port)
        raise SettingError(f"the page cannot listen at {where}: {_what_to_do(error)}") from error


def _what_to_do(error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return "the port is in use; stop the program that has it, or choose another port (0 takes a free one)"
    if error.errno == errno.EACCES:
        return "this user may not use that port; choose one above 1023 (0 takes a free one)"
    if error.errno == errno.EADDRNOTAVAIL:
        return "this machine does not have that address; take one of its own, or 127.0.0.1"
    return f"{error.strerror or error}"


def _authority(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64
    # Elsewhere than on POSIX it would let another program take the port over.
    allow_reuse_address = os.name == "posix"

    def __init__(
        self, source: Source, family: socket.AddressFamily, address: tuple[Any, ...], allowed_hosts: Iterable[str]
    ) -> None:
        self.source = source
        self.address_family = family
        self.stopping = threading.Event()
        self.run = secrets.token_hex(4)
        self.content, self.policy = _content()
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._n_browsers = 0
        # Of IPv6 whole, for its last number is the interface of a link-local address.
        super().__init__(address, _Handler)  # type: ignore[arg-type, unused-ignore]
        bound = ip_address(self.server_name.partition("%")[0])
        any_address = {4: "127.0.0.1", 6: "::1"}
        self.shown_host = any_address[bound.version] if bound.is_unspecified else self.server_name
        names = {*_LOOPBACK, self.shown_host, *allowed_hosts}
        self.allowed = {name.lower().strip("[]") for name in names}

    def server_bind(self) -> None:
        """Bind without HTTPServer's search for this machine's name, which can take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.socket.getsockname()[:2]

    # socketserver leaves open what a request is; here it is a connection.
    def process_request(self, request: Any, client_address: Any) -> None:
        with self._lock:
            room = len(self._open) < MOST_CONNECTIONS
            if room:
                self._open.add(request)
        if room:
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def shutdown_request(self, request: Any) -> None:
        with self._lock:
            self._open.discard(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that went away is no error; a defect of this program stays visible."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)

    def hang_up(self) -> None:
        """End every connection, also those that are stuck in sending."""
        with self._lock:
            still_open = list(self._open)
        for connection in still_open:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    @contextlib.contextmanager
    def seat(self) -> Iterator[bool]:
        """Takes one of the places for browsers, if there is one."""
        with self._lock:
            free = self._n_browsers < MOST_BROWSERS
            self._n_browsers += free
        try:
            yield free
        finally:
            with self._lock:
                self._n_browsers -= free


# ---------------------------------------------------------------------------------------------------- answering


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = STALLED_S
    disable_nagle_algorithm = True
    server_version = "rthstrack"
    sys_version = ""

    def do_GET(self) -> None:
        if (refusal := self._refusal()) is not None:
            self._say(*refusal)
        elif self._route() == "/":
            self._answer(HTTPStatus.OK, "text/html; charset=utf-8", self.server.content)
        elif self._route() == "/events":
            self._events()
        else:
            self._say(HTTPStatus.NOT_FOUND, "There is nothing here; the page is at /.")

    def do_HEAD(self) -> None:
        """The same answers, without their content."""
        self.do_GET()

    def _route(self) -> str:
        return self.path.partition("?")[0]

    def _refusal(self) -> tuple[HTTPStatus, str] | None:
        """Why this request is not answered: it was made under a foreign name, or by a foreign page."""
        hosts = self.headers.get_all("Host", [])
        origins = self.headers.get_all("Origin", [])
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return HTTPStatus.FORBIDDEN, "This page is not known under that name; open it by its address."
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return HTTPStatus.FORBIDDEN, "Other pages may not read this one."
        # A link may lead to the page; pictures and scripts of other pages may not take up its streams.
        if self._route() != "/" and self.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            return HTTPStatus.FORBIDDEN, "Other pages may not read this one."
        return None

    def _is_ours(self, host: str) -> bool:
        """Whether `host` is a name of ours: a page elsewhere can let its own name lead to this address (rebinding).

        Any port will do, for a name that is ours leads to this machine, and what another of its ports serves is told by
        its Origin.
        """
        found = _HOST.fullmatch(host.strip().lower())
        reached = self.connection.getsockname()[0].partition("%")[0]
        return found is not None and found[1].strip("[]") in {*self.server.allowed, reached}

    # ------------------------------------------------------------------------------------------------ the stream

    def _events(self) -> None:
        with self.server.seat() as free:
            if not free:
                self._say(
                    HTTPStatus.SERVICE_UNAVAILABLE,
                    f"{MOST_BROWSERS} browsers are watching already, which is as many as may; close one of them.",
                )
                return
            self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
            if self.command != "HEAD":
                cursor = self._last_cursor()
                self._send(f"retry: {RETRY_MS}\n\n")
                self._event("hello", self.server.source.hello(), cursor)
                self._frames(cursor)

    def _frames(self, cursor: int) -> None:
        source, stopping = self.server.source, self.server.stopping
        sent = due = time.monotonic()
        first = True
        while not stopping.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            due = now + FRAME_S
            text, new_cursor = source.frame(cursor)
            if first or new_cursor != cursor or now - sent >= IDLE_S:
                self._event("frame", text, new_cursor)
                first, cursor, sent = False, new_cursor, now
            else:
                self._send(":\n\n")

    def _last_cursor(self) -> int:
        """Where a browser that comes back to the same run goes on; the beginning for every other."""
        run, _, cursor = self.headers.get("Last-Event-ID", "").partition("-")
        known = run == self.server.run and cursor.isascii() and cursor.isdigit() and len(cursor) < 19
        return int(cursor) if known else 0

    def _event(self, name: str, text: str, cursor: int) -> None:
        line = text.replace("\r", " ").replace("\n", " ")  # between JSON's tokens; inside a text they are escaped
        self._send(f"id: {self.server.run}-{cursor}\nevent: {name}\ndata: {line}\n\n")

    def _send(self, text: str) -> None:
        """Send in pieces: who takes one within the time limit is slow, not stalled."""
        content = memoryview(text.encode())
        for start in range(0, len(content), _PIECE):
            self.wfile.write(content[start : start + _PIECE])

    # ------------------------------------------------------------------------------------------------ answers

    def _head(self, status: HTTPStatus, kind: str, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", "GET, HEAD")
        self.send_header("Content-Security-Policy", self.server.policy)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("X-Frame-Options", "DENY")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _answer(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        self._head(status, kind, len(content))
        if self.command != "HEAD":
            self.wfile.write(content)

    def _say(self, status: HTTPStatus, sentence: str) -> None:
        self._answer(status, "text/plain; charset=utf-8", f"{sentence}\n".encode())

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What http.server refuses by itself: malformed requests, and methods that do not exist here."""
        if code == HTTPStatus.NOT_IMPLEMENTED:
            code = HTTPStatus.METHOD_NOT_ALLOWED
        self._say(HTTPStatus(code), f"{HTTPStatus(code).phrase}.")

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the terminal belongs to the monitor."""


# ---------------------------------------------------------------------------------------------------- the content


def _content() -> tuple[bytes, str]:
    """The page, everything inside, and the policy that lets a browser run nothing else."""
    style = "\n".join(map(asset, _STYLES))
    licence = f"/*! uPlot 1.6.32\n{asset('uPlot.LICENSE').strip()}\n*/\n"
    scripts = [(licence if name.startswith("uPlot") else "") + asset(name) for name in _SCRIPTS]
    page = asset("live.html")
    page = page.replace("<!-- style -->", f"<style>{style}</style>")
    page = page.replace("<!-- scripts -->", "".join(f"<script>{script}</script>" for script in scripts))
    policy = (
        f"default-src 'none'; script-src {' '.join(map(digest, scripts))}; style-src {digest(style)}; "
        "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return page.encode(), policy
