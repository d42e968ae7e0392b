"""Strong-motion records of the networks: ESM, COSMOS and CSMIP V2, SMC of USGS, K-NET and KiK-net."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import tidy
from rthstrack.recording.readers.at2 import acceleration_unit, decoded
from rthstrack.recording.readers.contents import Contents, RateStatement, Series
from rthstrack.said import Said

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
# COSMOS' and CSMIP's line above the numbers: how many, of what, in which unit, in columns of which width.
_V2_DATA = re.compile(
    r"^\s*(?P<n>\d{1,9})\s+(?:points\s+of\s+)?acc\w*\b.*?(?:units?\s*=\s*|,\s*in\s+)(?P<unit>[a-z][a-z/0-9^*]*).*"
    r"\(\s*\d+[fe](?P<width>\d+)\.\d+",
    re.IGNORECASE,
)
_V2_STEP = re.compile(rf"equally[ -]spaced (?:at|intervals of)\s*(?P<dt>{_NUMBER})\s*sec", re.IGNORECASE)
_V2_LENGTH = re.compile(rf"approx\w*\s+({_NUMBER})\s*sec", re.IGNORECASE)
_V2_REALS = re.compile(
    r"^\s*\d+\s+real-header values follow on\s+(?P<n>\d+)\s+lines.*\(\d+[fe](?P<width>\d+)\.", re.IGNORECASE
)
# Which of COSMOS' real values is the interval, from 0.
_V2_INTERVAL = 33
_KNET_FREQUENCY = re.compile(r"^Sampling Freq\(Hz\)\s+([\d.]+)", re.MULTILINE)
_KNET_SCALE = re.compile(rf"^Scale Factor\s+({_NUMBER})\s*\(gal\)\s*/\s*({_NUMBER})", re.MULTILINE)
_SMC_COMMENTS = "|"


def kind(head: bytes) -> str | None:
    """Which of them a file's first bytes show, or None."""
    text = head.decode("latin-1")
    first = text.split("\n", 1)[0]
    if text.startswith("EVENT_NAME:") or "\nSAMPLING_INTERVAL_S:" in text:
        return "ESM"
    if text.startswith("Origin Time") and _is_knet(text):
        return "K-NET"
    if re.match(r"\s*[0-4*]\s+(?:UN)?(?:CORRECTED|PROCESSED) ACCELEROGRAM", first):
        return "SMC"
    if re.match(r"\s*(?:corrected|uncorrected|processed) accel", first, re.IGNORECASE):
        return "V2"
    return None


def _is_knet(text: str) -> bool:
    return "Station Code" in text or "Sampling Freq" in text


def read(path: Path) -> Contents:
    """Reads the acceleration of one direction; its header states rate and unit."""
    content = path.read_bytes()
    form = kind(content[:512])
    lines = decoded(content).splitlines()
    readers: dict[str | None, Callable[[list[str]], tuple[NDArray[np.float64], str, float, str]]] = {
        "ESM": _esm, "K-NET": _knet, "SMC": _smc, "V2": _v2,
    }  # fmt: skip
    values, unit, rate_hz, source = readers[form](lines)
    if not 0 < rate_hz < 1e6:
        raise RecordingError(f"{source} states {rate_hz:g} Hz; expected a positive rate")
    if len(values) < 2:
        raise RecordingError(f"expected at least 2 values below the header, found {len(values)}; the file is truncated")
    notes = [f"header: {' '.join(line.split())}" for line in lines[:2] if line.strip()]
    n_records = sum(_V2_DATA.match(line) is not None for line in lines) if form == "V2" else 1
    if n_records > 1:
        notes.insert(
            0, Said(f"the file holds {n_records} accelerations: the first was read", "first_of_several", (n_records,))
        )
    series = (Series("acceleration", "acceleration", unit, values),)
    return Contents(f"{form} accelerogram", series, (), (RateStatement(source, tidy(rate_hz)),), tuple(notes))


def _esm(lines: list[str]) -> tuple[NDArray[np.float64], str, float, str]:
    fields: dict[str, str] = {}
    at = 0
    while at < len(lines) and (found := re.match(r"([A-Z][A-Z0-9_/\[\]. ]*):(.*)", lines[at])):
        fields[found[1].strip()] = found[2].strip()
        at += 1
    if "ACCEL" not in (kind := fields.get("DATA_TYPE", "ACCELERATION").upper()):
        raise RecordingError(f"DATA_TYPE is {kind}: no acceleration; give the record's acceleration file")
    unit = _unit(fields.get("UNITS", "cm/s^2"))
    values = _numbers(" ".join(lines[at:]).split(), at + 1)
    _check_length(values, fields.get("NDATA"), "NDATA")
    return (
        values,
        unit,
        1 / _positive(fields.get("SAMPLING_INTERVAL_S"), "SAMPLING_INTERVAL_S"),
        "header 'SAMPLING_INTERVAL_S'",
    )


def _knet(lines: list[str]) -> tuple[NDArray[np.float64], str, float, str]:
    at = next((i for i, line in enumerate(lines) if line.startswith("Memo")), None)
    head = "\n".join(lines[:at])
    scale, rate = _KNET_SCALE.search(head), _KNET_FREQUENCY.search(head)
    if at is None or scale is None or rate is None:
        raise RecordingError(
            "a K-NET file, but its header states no 'Scale Factor' in gal, 'Sampling Freq(Hz)' or 'Memo.'"
        )
    counts = _numbers(" ".join(lines[at + 1 :]).split(), at + 2)
    return counts * (float(scale[1]) / float(scale[2])), "gal", float(rate[1]), "header 'Sampling Freq(Hz)'"


def _smc(lines: list[str]) -> tuple[NDArray[np.float64], str, float, str]:
    """Eleven lines of text, six of eight integers, ten of five numbers, comments, then values of ten characters."""
    if len(lines) < 28:
        raise RecordingError(f"an SMC file of {len(lines)} lines; expected a header of 27 and values; it is truncated")
    integers = [int(text) for line in lines[11:17] for text in line.split() if re.fullmatch(r"-?\d{1,12}", text)]
    reals = [_fixed(line, 15, at) for at, line in enumerate(lines[17:27], 18)]
    numbers = [value for row in reals for value in row]
    if len(integers) < 17 or len(numbers) < 2:
        raise RecordingError("an SMC file, but its header has fewer numbers than its format demands; it is damaged")
    n_comments = max(integers[15], 0)
    rows = lines[27 + n_comments :]
    values = np.array(
        [v for at, line in enumerate(rows, 28 + n_comments) for v in _fixed(line, 10, at)], dtype=np.float64
    )
    n_values = integers[16]
    if not 0 < n_values <= len(values):
        raise RecordingError(
            f"expected {n_values} values, as the header states, found {len(values)}; the file is truncated"
        )
    return values[:n_values], "cm/s2", numbers[1], "header, sampling rate"


def _v2(lines: list[str]) -> tuple[NDArray[np.float64], str, float, str]:
    """The first acceleration: a line says how many values follow, their unit and the width of their columns."""
    found = next(((i, m) for i, line in enumerate(lines) if (m := _V2_DATA.match(line))), None)
    if found is None:
        raise RecordingError("a V2 file without a line such as '3000 acceleration pts, units=cm/sec2, Format=(8F10.5)'")
    at, data = found
    n_values = int(data["n"])
    step = _v2_step(lines[: at + 1], n_values)
    values: list[float] = []
    for number, line in enumerate(lines[at + 1 :], at + 2):
        if len(values) >= n_values:
            break
        values += _fixed(line, int(data["width"]), number)
    if len(values) < n_values:
        raise RecordingError(
            f"expected {n_values} values, as line {at + 1} states, found {len(values)}; the file is truncated"
        )
    return np.array(values[:n_values], dtype=np.float64), _unit(data["unit"]), 1 / step, "header, interval"


def _v2_step(head: list[str], n_values: int) -> float:
    """The interval in seconds: CSMIP states it in words, COSMOS among its real values, in s or ms."""
    if stated := next((m for line in head if (m := _V2_STEP.search(line))), None):
        return _positive(stated["dt"], "interval")
    begin = next(((i, m) for i, line in enumerate(head) if (m := _V2_REALS.match(line))), None)
    length = _V2_LENGTH.search(head[-1])
    if begin is None or length is None:
        raise RecordingError("a V2 file whose header states no interval and duration")
    at, about = begin
    rows = head[at + 1 : at + 1 + int(about["n"])]
    reals = [value for i, line in enumerate(rows, at + 2) for value in _fixed(line, int(about["width"]), i)]
    if len(reals) <= _V2_INTERVAL or not reals[_V2_INTERVAL] > 0:
        raise RecordingError("a V2 file whose real header states no interval")
    duration = _positive(length[1], "duration")
    return min((reals[_V2_INTERVAL], reals[_V2_INTERVAL] / 1e3), key=lambda step: abs(step * n_values - duration))


def _unit(text: str) -> str:
    unit = acceleration_unit(text)
    if unit is None:
        raise RecordingError(f"the unit is '{text[:40]}'; expected one of acceleration, such as cm/s2 or g")
    return unit[0]


def _positive(text: str | None, what: str) -> float:
    value = float(text) if text and re.fullmatch(_NUMBER, text.replace("d", "x").replace("D", "x")) else 0.0
    if not value > 0:
        raise RecordingError(f"the header states no {what} above zero")
    return value


def _check_length(values: NDArray[np.float64], stated: str | None, what: str) -> None:
    if stated and stated.isdigit() and int(stated) != len(values):
        raise RecordingError(f"expected {stated} values, as {what} states, found {len(values)}; the file is damaged")


def _numbers(texts: list[str], line: int) -> NDArray[np.float64]:
    wrong = next((text for text in texts if not re.fullmatch(_NUMBER, text)), None)
    if wrong is not None:
        raise RecordingError(f"from line {line} on: expected numbers, found {wrong[:40]!r}; the file is damaged")
    return np.array([text.replace("D", "e").replace("d", "e") for text in texts], dtype=np.float64)


def _fixed(line: str, width: int, number: int) -> list[float]:
    """The numbers of a line in columns of this width, which need no blank between them."""
    line = line.rstrip()
    texts = [line[i : i + width].strip() for i in range(0, len(line), max(width, 1))]
    return list(map(float, _numbers([text for text in texts if text], number)))
