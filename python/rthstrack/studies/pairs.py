"""What is studied: pairs of recorded and simulated tests, with their truth where it is known."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.inputs import PUBLISHED, _number, _single
from rthstrack.evaluation.tracking import evaluate
from rthstrack.recording.chosen import read_chosen
from rthstrack.virtual_test.configuration import read_configuration
from rthstrack.virtual_test.run import Run, read_run_test
from rthstrack.virtual_test.simulation import simulate, true_tracking

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from rthstrack.recording.chosen import ChosenPairs
    from rthstrack.virtual_test.parts import VirtualTest

Truth: TypeAlias = tuple[float, float] | Callable[[float], tuple[float, float] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """One target with its measured, (n_samples,), at rate_hz; checked when made (SignalError, SettingError).

    truth: (amplitude, delay_s), NaN for what is not known; or a function of frequency in Hz that returns them, or None.
    """

    target: NDArray[np.float64] = field(repr=False)
    measured: NDArray[np.float64] = field(repr=False)
    rate_hz: float
    name: str = ""
    truth: Truth | None = None
    target_name: str = "target"
    measured_name: str = "measured"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        target, measured = _single(self.target, self.measured)
        rate_hz = _number("rate_hz", self.rate_hz)
        try:
            evaluate(target, measured, rate_hz, PUBLISHED)
        except SignalError as error:
            raise error.about(self.name) from None
        for name, value in (("target", target), ("measured", measured), ("rate_hz", rate_hz)):
            object.__setattr__(self, name, value)


Source: TypeAlias = Pair | Run | str | Path


def read_pairs(
    path: str | Path,
    *,
    targets: Sequence[str] = (),
    measured: Sequence[str] = (),
    rate_hz: float | None = None,
    time: str | None = None,
    resample_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    scale: Mapping[str, float] | None = None,
    fill: int | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    block: int | None = None,
    lines: tuple[int, int] | None = None,
) -> list[Pair]:
    """The pairs of a recorded test, or of a configuration (.toml), which is simulated: one an actuator.

    Without targets and measured a likely pair is proposed, and noted. The other arguments are those of `read_recording`
    and of `Recording`; they do not apply to a configuration.
    Raises RecordingError, ChannelError, SignalError, SettingError.
    """
    file = os.fspath(path)
    if file.lower().endswith(".toml"):
        return _pairs_of_run(_simulated(file), file)
    found = read_chosen(
        file,
        targets=targets,
        measured=measured,
        rate_hz=rate_hz,
        time=time,
        resample_hz=resample_hz,
        units=units,
        scale=scale,
        fill=fill,
        start_s=start_s,
        end_s=end_s,
        block=block,
        lines=lines,
    )
    return pairs_in(found, file, own_truth=not scale)


def pairs_in(chosen: ChosenPairs, file: str, *, own_truth: bool = False) -> list[Pair]:
    """Channels that were chosen, as pairs called by the file; own_truth: a run file knows what is true of its own."""
    recording, sampled_hz, channels, proposal = chosen
    found = []
    for actuator, (asked, answered) in enumerate(channels):
        t, m = recording.channel(asked), recording.channel(answered)
        truth = _truth_in_file(file, t.name, m.name) if own_truth else None
        notes = list(recording.notes)
        if proposal and truth is None:
            notes.insert(0, f"no channels were named: studied target '{t.name}', measured '{m.name}' ({proposal})")
        if t.unit and m.unit and t.unit != m.unit:
            notes.append(f"target is in {t.unit}, measured in {m.unit}: the amplitude holds the ratio of the units")
        name = _named(file, actuator, len(channels))
        found.append(Pair(t.values, m.values, sampled_hz, name, truth, t.name, m.name, tuple(notes)))
    return found


def pairs_of(sources: Source | Sequence[Source] | Mapping[str, Source], truth: Truth | None) -> list[Pair]:
    """Every source as pairs, each with a name of its own."""
    if isinstance(sources, Mapping):
        listed = list(sources.items())
    elif isinstance(sources, Pair | Run | str | Path):
        listed = [("", sources)]
    else:
        listed = [("", source) for source in sources]
    if not listed:
        raise SettingError("there is no source to study: give a Pair, a Run or a file")

    def read(name: str, source: Source) -> list[Pair]:
        if isinstance(source, Pair):
            pairs = [source if source.name else dataclasses.replace(source, name="test")]
        elif isinstance(source, Run):
            pairs = _pairs_of_run(source, source.motion_name)
        elif isinstance(source, str | Path):
            pairs = read_pairs(source)
        else:
            raise SettingError(f"a source must be a Pair, a Run or a file, not {type(source).__name__}")
        if name:
            pairs = [dataclasses.replace(p, name=_named(name, i, len(pairs))) for i, p in enumerate(pairs)]
        return pairs if truth is None else [dataclasses.replace(p, truth=truth) for p in pairs]

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        pairs = [pair for found in pool.map(read, *zip(*listed, strict=True)) for pair in found]
    names = [pair.name for pair in pairs]
    for name in names:
        if names.count(name) > 1:
            raise SettingError(
                f"{names.count(name)} sources are called '{name}'; give {{name: source}} with other names"
            )
    return pairs


def _named(name: str, actuator: int, n_actuators: int) -> str:
    return name if n_actuators == 1 else f"{name}, actuator {actuator + 1}"


def _pairs_of_run(run: Run, name: str) -> list[Pair]:
    targets, measured = (signal.reshape(len(signal), -1) for signal in (run.target, run.measured))
    n = targets.shape[1]
    return [
        Pair(
            targets[:, i],
            measured[:, i],
            run.rate_hz,
            _named(name, i, n),
            _truth_of(run.test, i),
            notes=run.motion_notes,
        )
        for i in range(n)
    ]


def _truth_of(test: VirtualTest, actuator: int) -> Truth:
    def truth(frequency_hz: float) -> tuple[float, float] | None:
        found = true_tracking(test, frequency_hz, actuator)
        return None if found is None else (found[0].item(), found[1].item())

    return truth


def _truth_in_file(file: str, target: str, measured: str) -> Truth | None:
    """What a virtual test left in its run file, for target and measured of one actuator; None for any other pair."""
    names = [re.fullmatch(rf"{role}(?:_(\d+))?", name) for role, name in (("target", target), ("measured", measured))]
    if not all(names) or len({name and name[1] for name in names}) != 1:
        return None
    test = read_run_test(file)
    number = int((names[0] and names[0][1]) or 1)
    return None if test is None or number > len(test.actuators) else _truth_of(test, number - 1)


def _simulated(file: str) -> Run:
    configuration = read_configuration(file)
    return simulate(
        configuration.test, configuration.motion_from(Path(file).parent), duration_s=configuration.duration_s
    )
