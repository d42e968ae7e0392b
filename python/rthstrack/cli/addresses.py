"""Addresses as the on-line commands take them: udp://HOST:PORT."""

from __future__ import annotations

import argparse
import ipaddress
import re
import socket
from typing import Any


def udp(text: str) -> str:
    """`udp://HOST:PORT` with a port from 1 on as numbers, "127.0.0.1:5005"."""
    return _address(text, 1)


def udp_or_any_port(text: str) -> str:
    """The same; port 0 stands for a free one."""
    return _address(text, 0)


def port(text: str) -> int:
    """A TCP or UDP port to listen at; 0 stands for a free one."""
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"expected a port, 1 to 65535, or 0 for a free one, found '{text}'")
    return int(text)


def host(text: str) -> str:
    """The address, in numbers, that a name or address stands for."""
    return _resolved(text)[0]


def host_name(text: str) -> str:
    """A name that stands for itself, as browsers write it, without a port."""
    if not re.fullmatch(
        r"[a-z0-9_]([a-z0-9_.-]{0,252}[a-z0-9_])?\.?|\[?[0-9a-f:]*:[0-9a-f:.]*\]?", text, re.ASCII | re.I
    ):
        raise argparse.ArgumentTypeError(f"expected the name of a machine, such as lab.example, found '{text}'")
    return text


def senders(text: str) -> list[str]:
    """All addresses, in numbers, that a name or address stands for."""
    # What comes in bears no interface that could be compared.
    return [address.partition("%")[0] for address in _resolved(text)]


def is_loopback(address: str) -> bool:
    """Whether only this machine reaches an address, `HOST` or `HOST:PORT` in numbers."""
    bare = address.rpartition(":")[0] if address.count(":") == 1 or address.startswith("[") else address
    return ipaddress.ip_address(bare.strip("[]")).is_loopback


def _address(text: str, lowest: int) -> str:
    found = re.fullmatch(r"udp://(\[[^\[\]]+\]|[^:/\[\]]+):(\d{1,9})/?", text, re.ASCII | re.IGNORECASE)
    if found is None:
        raise argparse.ArgumentTypeError(f"expected udp://HOST:PORT, such as udp://127.0.0.1:5005, found '{text}'")
    if not lowest <= int(found[2]) <= 65535:
        free = ", or 0 for a free one" if lowest == 0 else ""
        raise argparse.ArgumentTypeError(f"expected a port from 1 to 65535{free}, found {found[2]}")
    address = _resolved(found[1].strip("[]"))[0]
    return f"[{address}]:{int(found[2])}" if ":" in address else f"{address}:{int(found[2])}"


def _resolved(name: str) -> list[str]:
    try:
        found = socket.getaddrinfo(name, None, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        raise argparse.ArgumentTypeError(f"expected an address or the name of a machine, found '{name}'") from None
    # IPv4 first, as what sends to a name such as localhost usually takes it.
    found.sort(key=lambda one: one[0] != socket.AF_INET)
    return list(dict.fromkeys(_with_scope(one[4]) for one in found))


def _with_scope(address: tuple[Any, ...]) -> str:
    """The address in numbers; a link-local one means nothing without its interface, fe80::1%2."""
    scope = address[3] if len(address) > 3 else 0
    return f"{address[0].partition('%')[0]}%{scope}" if scope else str(address[0])
