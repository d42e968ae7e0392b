"""What a study found: a cell a source and setting."""

from __future__ import annotations

import csv
import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rthstrack.errors import RecordingError, SettingError
from rthstrack.evaluation.results import _Result, json_ready
from rthstrack.studies.settings import _listed
from rthstrack.values import Shown

if TYPE_CHECKING:
    from pathlib import Path

    from rthstrack.evaluation.settings import Settings
    from rthstrack.studies.settings import StudySettings


@dataclass(frozen=True, slots=True)
class StudiedSource:
    """What was studied, without its samples."""

    name: str
    target_name: str
    measured_name: str
    rate_hz: float
    n_samples: int
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Cell:
    """One evaluation of a study; what could not be determined is NaN, `reason` says why, and `reason_code` by name.

    Changes are relative to P = Q = 1 of the same source, window and weight power: value / reference - 1. The truth is
    that at the cell's own equivalent frequency; errors are value / truth - 1, and `delay_error_s` is delay less true
    delay. `highest_frequency_hz` is rate/(2P). `computing_time_s` is the fastest of several calls of a planned
    `Evaluator`, planning left out.

    `kind` is "grid", "chosen" (P and Q of `choose_factors` within `tolerance`, with its bounds) or "key" (the bins that
    `key_frequencies` takes to hold `share` of the weight, evaluated alone; choosing them is not in the time).
    """

    source: str
    settings: Settings
    amplitude: float = math.nan
    phase_rad: float = math.nan
    delay_s: float = math.nan
    equivalent_frequency_hz: float = math.nan
    n_bins: int = 0
    delta_f_hz: float = math.nan
    highest_frequency_hz: float = math.nan
    amplitude_change: float = math.nan
    delay_change: float = math.nan
    true_amplitude: float = math.nan
    true_delay_s: float = math.nan
    amplitude_error: float = math.nan
    delay_error: float = math.nan
    delay_error_s: float = math.nan
    computing_time_s: float = math.nan
    reason: str = ""
    reason_code: str = ""
    kind: str = "grid"
    tolerance: float = math.nan
    amplitude_bound: float = math.nan
    delay_bound: float = math.nan
    delay_measure: str = ""
    share: float = math.nan


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Study(_Result):
    """The cells of a study, by source, window, weight power, P and Q in this order, and what was asked for.

    After each grid come the factors that were chosen and the key frequencies, where these were asked for.
    """

    sources: tuple[StudiedSource, ...]
    settings: StudySettings
    cells: tuple[Cell, ...]

    def _shown(self) -> Shown:
        s = self.settings
        rows = [(source.name, f"{source.n_samples} samples at {source.rate_hz:g} Hz") for source in self.sources]
        return Shown(f"Study, {s.estimator}: {len(self.cells)} cells, P {_listed(s.P)}, Q {_listed(s.Q)}", rows)

    def select(
        self,
        *,
        source: str | None = None,
        window: str | None = None,
        weight_power: int | None = None,
        P: int | None = None,
        Q: int | None = None,
        kind: str | None = "grid",
    ) -> tuple[Cell, ...]:
        """The cells with these settings, in the study's order; None takes all.

        kind: "grid", "chosen" (P and Q chosen by the program) or "key" (key frequencies).
        """
        wanted = (source, window, weight_power, P, Q)
        return tuple(
            cell
            for cell in self.cells
            if kind in (None, cell.kind)
            and all(w is None or w == found for w, found in zip(wanted, _key(cell.source, cell.settings), strict=True))
        )

    def cell(
        self,
        *,
        P: int = 1,
        Q: int = 1,
        window: str | None = None,
        weight_power: int | None = None,
        source: str | None = None,
    ) -> Cell:
        """The one cell of the grid with these settings; source, window, weight power may be left out if there is one.

        Raises SettingError where there is none, or more than one.
        """
        found = self.select(source=source, window=window, weight_power=weight_power, P=P, Q=Q)
        if len(found) == 1:
            return found[0]
        s = self.settings
        asked = {"source": source, "window": window, "weight_power": weight_power, "P": P, "Q": Q}
        named = ", ".join(f"{name} {value!r}" for name, value in asked.items() if value is not None)
        if found:
            there = {"source": self.source_names, "window": s.windows, "weight_power": s.weight_powers}
            more = ", ".join(name for name, values in there.items() if asked[name] is None and len(values) > 1)
            raise SettingError(f"{len(found)} cells have {named}; name also the {more}")
        raise SettingError(
            f"no cell has {named}; the study holds the sources {_listed(self.source_names)}, windows "
            f"{_listed(s.windows)}, weight powers {_listed(s.weight_powers)}, P {_listed(s.P)}, Q {_listed(s.Q)}"
            + (f", combined up to {s.combined}" if s.combined else "")
        )

    @property
    def source_names(self) -> tuple[str, ...]:
        """The names of the sources."""
        return tuple(source.name for source in self.sources)

    def rows(self) -> list[dict[str, Any]]:
        """A dict a cell with every setting in it: the rows of the CSV file and of `to_frame`."""
        about = {source.name: source for source in self.sources}
        return [_row(about[cell.source], cell) for cell in self.cells]

    def to_csv(self, path: str | Path) -> None:
        """Writes a row a cell, with every setting in it; what is NaN stays empty. Raises RecordingError."""
        rows = [{key: json_ready(value) for key, value in row.items()} for row in self.rows()]
        try:
            with open(path, "w", newline="", encoding="utf-8") as out:
                writer = csv.DictWriter(out, list(rows[0]), restval="")
                writer.writeheader()
                writer.writerows(rows)
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from None

    def _columns(self) -> dict[str, Any]:
        rows = self.rows()
        return {name: [row[name] for row in rows] for name in rows[0]}


def _key(source: str, settings: Settings) -> tuple[str, str, int, int, int]:
    return (
        source,
        settings.window,
        settings.weight_power,
        settings.data_decimation,
        settings.frequency_decimation,
    )


def _row(source: StudiedSource, cell: Cell) -> dict[str, Any]:
    settings = dataclasses.asdict(cell.settings)
    low_hz, high_hz = settings.pop("band_hz") or (math.nan, math.nan)
    about = {f.name: getattr(source, f.name) for f in dataclasses.fields(source) if f.name not in ("name", "notes")}
    numbers = {f.name: getattr(cell, f.name) for f in dataclasses.fields(cell) if f.name not in ("source", "settings")}
    return {"source": source.name} | about | settings | {"band_low_hz": low_hz, "band_high_hz": high_hz} | numbers
