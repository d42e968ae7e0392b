"""Frozen values: read-only arrays, pickling, how they show themselves; recordings as containers and tables."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rthstrack
from rthstrack.recording import on_one_clock
from rthstrack.virtual_test import Actuator, Structure

RATE = 200.0
EXAMPLE = Path(__file__).parent.parent / "examples" / "data" / "utfsm_chirp_0A.csv"


def signals() -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(6000) / RATE
    noise = np.random.default_rng(3).normal(size=(2, t.size)) * 1e-3

    def motion(at: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * 1.1 * at) * np.sin(2 * np.pi * 0.05 * at) + 0.2 * np.sin(2 * np.pi * 2.7 * at)

    return motion(t) + noise[0], 0.97 * motion(t - 0.015) + noise[1]


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    """One of everything that is handed out."""
    target, measured = signals()
    pair, both = (target, measured, RATE), (np.c_[target, target], np.c_[measured, target], RATE)
    monitor = rthstrack.Monitor(RATE, 4.0, 4.0)
    sweep = rthstrack.SweepTarget(0.01, 0.5, 5.0, 10.0)
    run = rthstrack.simulate(rthstrack.VirtualTest(Structure.none(), (Actuator(delay_s=0.01),)), sweep)
    recording = rthstrack.read_recording(EXAMPLE)
    assessment = rthstrack.assess(*pair, unit="mm")
    return {
        "tracking": rthstrack.evaluate(*pair, weights=True),
        "trackings": rthstrack.evaluate(*both, estimator="least_squares", weights=True),
        "moving": rthstrack.evaluate_moving(*pair),
        "movings": rthstrack.evaluate_moving(*both),
        "readings": monitor.process(target, measured),
        "response": rthstrack.frequency_response(*pair),
        "slopes": rthstrack.frequency_slopes(*pair),
        "indices": rthstrack.indices(*pair),
        "histories": rthstrack.index_histories(*pair),
        "factors": rthstrack.choose_factors(*pair),
        "key": rthstrack.key_frequencies(target, RATE),
        "assessment": assessment,
        "run": run,
        "motion": rthstrack.synthetic_ground_motion(seed=1),
        "damping": rthstrack.delay_damping(linear_test(), 0.001),
        "critical": rthstrack.critical_delay(linear_test()),
        "study": rthstrack.study([run], P=[1, 2], Q=[1], timing=False),
        "recording": recording,
        "channel": recording.channels[1],
    }


def linear_test() -> rthstrack.VirtualTest:
    from rthstrack.virtual_test import Spring

    return rthstrack.VirtualTest(Structure.sdof(frequency_hz=5, damping_ratio=0.02), (Actuator(specimen=(Spring(),)),))


NAMES = (
    "tracking", "trackings", "moving", "movings", "readings", "response", "slopes", "indices", "histories", "factors",
    "key", "assessment", "run", "motion", "damping", "critical", "study", "recording", "channel",
)  # fmt: skip


def arrays(value: Any, path: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Every array in a value, however deep."""
    if isinstance(value, np.ndarray):
        yield path, value
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from arrays(getattr(value, field.name), f"{path}.{field.name}")
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from arrays(one, f"{path}[{key}]")
    elif isinstance(value, tuple | list):
        for i, one in enumerate(value):
            yield from arrays(one, f"{path}[{i}]")


@pytest.mark.parametrize("name", NAMES)
def test_arrays_of_a_value_are_read_only_and_its_fields_fixed(name: str, values: dict[str, Any]) -> None:
    value = values[name]
    assert [path for path, array in arrays(value) if array.flags.writeable] == []
    with pytest.raises((dataclasses.FrozenInstanceError, TypeError)):
        value.something = 1


def test_what_the_caller_gave_stays_the_callers() -> None:
    target, measured = signals()
    found = rthstrack.assess(target, measured, RATE)
    target[0] = 1.0
    assert not found.target.flags.writeable


@pytest.mark.parametrize("name", [name for name in NAMES if name != "key"])
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_a_value_comes_back_from_a_pickle_and_from_a_copy(name: str, how: str, values: dict[str, Any]) -> None:
    value = values[name]
    back = pickle.loads(pickle.dumps(value)) if how == "pickle" else copy.deepcopy(value)
    assert type(back) is type(value)
    assert repr(back) == repr(value)
    pairs = list(zip(arrays(value), arrays(back), strict=True))
    assert all(
        not there.flags.writeable and np.array_equal(here, there, equal_nan=True) for (_, here), (_, there) in pairs
    )


class _Table(HTMLParser):
    """Which tags were opened and closed, and the cells' texts."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.mark.parametrize("name", NAMES)
def test_a_value_shows_itself_in_a_terminal_and_in_a_notebook(name: str, values: dict[str, Any]) -> None:
    value = values[name]
    lines = repr(value).splitlines()
    assert len(lines) <= 16
    assert max(map(len, lines)) < 80
    assert type(value).__name__ in lines[0]
    table = _Table()
    table.feed(value._repr_html_())
    assert table.open == []
    assert len(value._repr_html_()) < 4000
    # The same numbers, in both.
    first = next(text for text in table.texts[1:] if text)
    assert first.split()[0] in repr(value)


def test_an_assessment_says_its_verdict_and_every_row_is_text(values: dict[str, Any]) -> None:
    found = values["assessment"]
    assert " ".join(repr(found).split()).startswith(f"Assessment: {found.verdict}")
    odd = dataclasses.replace(found, target_name="<b>&", file="a<script>.csv")
    assert "<script>" not in odd._repr_html_()
    assert "&lt;b&gt;&amp;" in odd._repr_html_()


def test_a_recording_of_many_channels_is_short() -> None:
    one = rthstrack.Channel("x", "x", None, np.zeros(3))
    channels = tuple(dataclasses.replace(one, name=f"c{i}", path=f"c{i}") for i in range(300))
    recording = rthstrack.Recording("many.csv", "text", channels, 1.0, "given", 0.0, ())
    assert len(repr(recording).splitlines()) <= 14
    assert repr(recording).endswith("and 289 more")


@pytest.mark.parametrize("name", ["tracking", "trackings", "moving", "movings", "readings", "response", "slopes",
                                  "indices", "histories", "factors", "key", "study"])  # fmt: skip
def test_results_become_plain_values_and_frames(name: str, values: dict[str, Any]) -> None:
    result = values[name]
    json.dumps(result.to_dict())
    frame = result.to_frame()
    assert len(frame)
    assert frame.shape[1] == len(set(frame.columns))


# Recordings -----------------------------------------------------------------------------------------------------------


def recorded(**more: Any) -> rthstrack.Recording:
    channels = (
        rthstrack.Channel("t", "t", "s", np.arange(5) / 10, is_time=True),
        rthstrack.Channel("x", "a/x", "mm", np.arange(5.0)),
        rthstrack.Channel("x", "b/x", None, np.arange(3.0) + 10),
    )
    whole: dict[str, Any] = {"rate_hz": 10.0, "rate_source": "given", "start_s": 2.0, "notes": ()} | more
    return rthstrack.Recording("f.h5", "HDF5", channels, **whole)


def test_a_recording_is_a_container_of_channels() -> None:
    recording = recorded()
    assert len(recording) == 3
    assert list(recording) == list(recording.channels)
    assert "a/x" in recording
    assert "#2" in recording
    assert recording.channels[1] in recording
    assert "x" not in recording  # it names two
    assert "y" not in recording
    assert len(recording.channels[2]) == 3


def test_times_start_where_the_recording_does() -> None:
    np.testing.assert_allclose(recorded().time_s, [2.0, 2.1, 2.2, 2.3, 2.4], rtol=0, atol=1e-12)
    assert not recorded().time_s.flags.writeable
    with pytest.raises(rthstrack.RecordingError, match=r"f.h5: no times: no time column; give rate_hz"):
        _ = recorded(rate_hz=None, rate_source="no time column").time_s


def test_a_recording_as_a_frame_and_as_a_dataset() -> None:
    frame = recorded().to_frame()
    assert list(frame.columns) == ["a/x", "b/x"]
    assert frame.index.name == "time_s"
    np.testing.assert_allclose(frame.index, [2.0, 2.1, 2.2, 2.3, 2.4], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(frame["b/x"], [10, 11, 12, np.nan, np.nan])
    assert frame.attrs["units"] == {"a/x": "mm", "b/x": None}
    dataset = recorded().to_xarray()
    assert dict(dataset.sizes) == {"time_s": 5}
    np.testing.assert_array_equal(dataset["a/x"].values, frame["a/x"])
    assert dataset["a/x"].attrs == {"units": "mm"}
    assert dataset.attrs["rate_hz"] == 10.0
    by_sample = recorded(rate_hz=None, rate_source="not stated").to_frame()
    assert by_sample.index.name == "sample"
    assert list(by_sample.index) == [0, 1, 2, 3, 4]


def test_channels_with_clocks_of_their_own_have_no_index_in_common() -> None:
    from rthstrack.recording.recording import OwnTime

    fast = rthstrack.Channel("fast", "fast", "mm", np.sin(np.arange(40) / 4), OwnTime("its own", 20.0, 0.0))
    slow = rthstrack.Channel("slow", "slow", "mm", np.sin(np.arange(20) / 2), OwnTime("its own", 10.0, 0.0))
    recording = rthstrack.Recording("two.tdms", "TDMS", (fast, slow), None, "several", 0.0, ())
    for method in ("to_frame", "to_xarray"):
        with pytest.raises(rthstrack.RecordingError, match="clocks of their own, such as 'fast'; put those") as told:
            getattr(recording, method)()
        assert told.value.code == "own_times"
    one = on_one_clock(recording, ["fast", "slow"])
    assert list(one.to_frame().columns) == ["fast", "slow"]


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_frame"), ("xarray", "to_xarray")])
def test_a_package_that_is_not_there_is_named(package: str, method: str) -> None:
    code = (
        f"import sys\nsys.modules['{package}'] = None\nimport rthstrack\n"
        f"recording = rthstrack.read_recording({str(EXAMPLE)!r})\n"
        f"try:\n    recording.{method}()\nexcept rthstrack.RthstrackError as error:\n    print(error.code, error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == (
        f"not_installed {method} needs {package}, which is not installed: pip install 'rthstrack[{package}]'"
    )
