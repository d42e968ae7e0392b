"""Everything that is known of one target/measured pair, as plain frozen data.

The command, the report and the figures take an `Assessment` and compute nothing themselves.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import partial
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from rthstrack.errors import SettingError, SignalError
from rthstrack.evaluation.dependence import dependence
from rthstrack.evaluation.indices import index_histories, indices
from rthstrack.evaluation.inputs import TOLERANCE, _number, _single, settled
from rthstrack.evaluation.response import frequency_response, frequency_slopes
from rthstrack.evaluation.settings import Settings
from rthstrack.evaluation.time_frequency import TimeFrequency, time_frequency
from rthstrack.evaluation.tracking import Evaluator, bridged, evaluate_moving
from rthstrack.said import coded, failed
from rthstrack.values import Shown, Value
from rthstrack.verdict.argument import argument as argued
from rthstrack.verdict.difference import differ
from rthstrack.verdict.display import DRAWN_GREY_BELOW, signal_roles
from rthstrack.verdict.limits import EXCEEDED, NOT_JUDGED, Limits, conclusion, gates, outcome
from rthstrack.verdict.sentence import _undetermined, no_motion, reason, sentence, still_in_band, with_cause
from rthstrack.verdict.warnings import OF_PUBLISHED
from rthstrack.verdict.warnings import warnings as found_warnings

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from rthstrack.evaluation.dependence import Dependence
    from rthstrack.evaluation.factors import Factors
    from rthstrack.evaluation.indices import IndexHistories, Indices
    from rthstrack.evaluation.response import FrequencyResponse, FrequencySlopes
    from rthstrack.evaluation.tracking import MovingTracking, Tracking
    from rthstrack.said import Said
    from rthstrack.verdict.limits import Gate
    from rthstrack.verdict.loop import LoopEffect
    from rthstrack.virtual_test.parts import VirtualTest

_T = TypeVar("_T")

#: Length of a moving window unless told otherwise, in seconds, but never more than a quarter of the record.
MOVING_S = 4.0
#: Readings a window's length.
READINGS_PER_WINDOW = 16
# Of the variation frequency and time must each explain so much, for a picture over both to say something.
_BOTH = 0.1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Assessment(Value):
    """One pair, judged.

    `part` is "whole" (target to measured), "compensator" (target to command) or "actuator" (command to measured).
    `target` and `measured` are the raw samples, `unit` theirs; `time_s` starts at the recording's own start.
    `settings` holds what was done before the evaluation (cut, fill, resample, scale, rate and where it came from)
    and the evaluation's own settings. `warnings` and the notes are texts with `code` and `values`.
    `tracking`, `moving` are judged: by default `trusted`, `trusted_moving`, least squares on every sample, the same
    objects then. `published`, `published_moving` are the published average of the same window, band, P and Q, the same
    objects where that was asked for. `variants`: what was tried to tell why `beside` differs from the trusted estimate:
    it with one setting changed, by what was changed ("detrend", "window", "band", "estimator"). `argument` says in one
    sentence which to use, and why.
    `gates`: each limit with what was found, `conclusion` all of them in one line. `loop`: what the delay does to the
    structure, where one was given.
    """

    file: str
    actuator: int
    part: str
    target_name: str
    measured_name: str
    unit: str | None
    rate_hz: float
    start_s: float
    target: NDArray[np.float64]
    measured: NDArray[np.float64]
    tracking: Tracking  # evaluated with weights=True: spectra and weights inside
    moving: MovingTracking | None
    moving_note: Said | None  # why there is no moving evaluation, when there is none
    trusted: Tracking
    trusted_moving: MovingTracking | None  # over the same windows
    published: Tracking
    published_moving: MovingTracking | None
    variants: Mapping[str, Tracking]
    response: FrequencyResponse | None  # aligned at the slopes' delay, or the trusted one
    response_note: Said | None
    slopes: FrequencySlopes | None
    slopes_note: Said | None
    depends_on: str | None
    dependence: Dependence | None
    indices: Indices
    histories: IndexHistories
    settings: dict[str, Any]
    verdict: str
    argument: str
    warnings: tuple[Said, ...]
    limits: Limits
    gates: tuple[Gate, ...]
    conclusion: str
    loop: LoopEffect | None
    factors: Factors | None = None  # P and Q with their bound, where the program chose them

    @property
    def actuator_number(self) -> int:
        """The actuator as people count, from 1."""
        return self.actuator + 1

    @property
    def actuator_name(self) -> str:
        """What it is called: its target's channel."""
        return self.target_name

    @property
    def outcome(self) -> str | None:
        """The worst state of all gates: "exceeded", "not_judged" or "passed"; None where nothing is limited."""
        return outcome(self.gates)

    @property
    def exceeded(self) -> tuple[Said, ...]:
        """Each limit that was exceeded, in one sentence."""
        return tuple(gate.reason for gate in self.gates if gate.state == EXCEEDED)

    @property
    def not_judged(self) -> tuple[Said, ...]:
        """Why a limit could not be judged."""
        return tuple(dict.fromkeys(gate.reason for gate in self.gates if gate.state == NOT_JUDGED))

    @property
    def beside(self) -> Tracking:
        """What stands beside the judged estimate: the trusted one, or where that is judged the published one."""
        return self.published if self.tracking is self.trusted else self.trusted

    @property
    def beside_moving(self) -> MovingTracking | None:
        """The moving windows that are drawn with the trusted ones: of the estimate asked for, or the published one."""
        other = self.published_moving if self.moving is self.trusted_moving else self.moving
        return self.moving if other is None else other

    def _shown(self) -> Shown:
        rows = [
            *([("file", self.file)] if self.file else []),
            ("pair", f"{self.target_name}, {self.measured_name}: {self.target.size} samples at {self.rate_hz:g} Hz"),
        ]
        for t in (self.tracking, self.beside):
            rows += [(f"{label}, {t.settings.estimator}", text) for label, text in t._number_rows()[:2]]
        rows += [("", self.argument)] + ([("limits", self.conclusion)] if self.conclusion else [])
        rows += [("warnings", ", ".join(one.code for one in map(coded, self.warnings)))] if self.warnings else []
        return Shown(f"Assessment: {self.verdict}", rows)

    @property
    def largest_delay_s(self) -> float:
        """The largest |delay| of the moving windows."""
        moving = self.moving
        return math.nan if moving is None or not moving.valid.any() else float(abs(moving.delay_s[moving.valid]).max())

    def over_limit_s(self) -> dict[str, list[tuple[float, float]]]:
        """From when to when windows exceed a limit of "amplitude" or of "delay", each window as wide as one hop."""
        half = 0.0 if self.moving is None else self.moving.hop_s / 2
        over: dict[str, list[tuple[float, float]]] = {"amplitude": [], "delay": []}
        for gate in self.gates:
            spans = over["amplitude" if gate.name == "amplitude" else "delay"]
            spans += [(first - half, last + half) for first, last in gate.over_s]
        return over

    def time_frequency(self) -> TimeFrequency | None:
        """Gain and delay over time and frequency, computed at each call; None where they do not change with both."""
        d = self.dependence
        if d is None or self.response is None or self.slopes is None:
            return None
        if min(d.shares["frequency"], max(d.shares["time"], d.shares["clock"])) < _BOTH:
            return None
        t, m = self.target, self.measured
        if self.trusted.bad_samples:
            t, m = bridged(t, m, self.rate_hz, self.trusted)
        found = time_frequency(
            t,
            m,
            self.rate_hz,
            self.slopes.band_hz,
            align_s=self.response.align_s,
            dispersion=self.response.dispersion,
            least_coherence=DRAWN_GREY_BELOW,
        )
        return found if found is not None and found.changes_with_both else None


def assess_samples(
    target: ArrayLike,
    measured: ArrayLike,
    rate_hz: float,
    *,
    settings: Settings | None = None,
    choose: Collection[str] = (),
    tolerance: float = TOLERANCE,
    moving_s: float | None = None,
    hop_s: float | None = None,
    limits: Limits | None = None,
    structure: VirtualTest | None = None,
    file: str = "",
    actuator: int = 0,
    part: str = "whole",
    target_name: str = "target",
    measured_name: str = "measured",
    unit: str | None = None,
    measured_unit: str | None = None,
    start_s: float = 0.0,
    origin: Mapping[str, Any] | None = None,
) -> Assessment:
    """Judges one pair of arrays (n_samples,) as `assess` of `recorded` describes."""
    asked_for = settings or Settings()
    settings = without_trusted(asked_for)
    limits = limits or Limits()
    t, m = _single(target, measured)
    rate_hz = _number("rate_hz", rate_hz)
    if not t.size:
        raise SignalError("there are no samples to judge: both channels are empty")
    factors = _chosen(t, m, rate_hz, settings, choose, tolerance) if choose else None
    for_record = settings if factors is None else factors.settings
    asked = moving_s is not None or hop_s is not None
    window_s = min(MOVING_S, t.size / rate_hz / 4) if moving_s is None else moving_s
    hop_s = max(window_s / READINGS_PER_WINDOW, 1 / rate_hz) if hop_s is None else hop_s
    for_windows = settled(settings if factors is None else factors.reference.settings)
    of_trusted = trusted_settings(for_record, asked_for.expected_delay_s)
    of_published = published_settings(asked_for)
    of_windows = (for_windows, of_trusted, for_windows if settings.estimator == "fei" else of_published)
    windows = _aside(partial(_windows, t, m, rate_hz, window_s, hop_s, of_windows))
    tracking = Evaluator(t.size, rate_hz, for_record).evaluate(t, m, weights=True)
    still = still_in_band(t, tracking) or no_motion(m)
    if still is not None:
        tracking = _without_numbers(tracking, still)
    trusted = tracking
    if tracking.settings != of_trusted:
        trusted = Evaluator(t.size, rate_hz, of_trusted).evaluate(t, m)
        if still is not None:
            trusted = _without_numbers(trusted, still)
    _check_limits(limits, trusted)
    published = tracking
    if settings.estimator != "fei":
        published = _published(t, m, of_published, tracking, still)
    # Curves over frequency and what gain and delay depend on need every sample.
    beside = published if tracking.settings == of_trusted else tracking
    raw, without_bad = (t, m), beside
    if trusted.bad_samples:
        t, m = bridged(t, m, rate_hz, trusted)
        without_bad = Evaluator(t.size, rate_hz, beside.settings).evaluate(t, m, weights=True)
    slopes, slopes_note = None, None
    # Where one delay explains measured, segments are aligned at it: bursts and drift would lead the search for another.
    explained = math.isfinite(float(trusted.delay_interval_s[0]))
    try:
        slopes = frequency_slopes(
            t, m, rate_hz, band_hz=for_record.band_hz, align_s=float(trusted.delay_s) if explained else None
        )
    except (SettingError, SignalError) as error:
        slopes_note = failed(error)
    response, response_note = _response(t, m, rate_hz, slopes, trusted)
    depends = dependence(t, m, without_bad, trusted, response)
    t, m = raw
    same, trusted = tracking is trusted, with_cause(trusted, depends)
    if same:
        tracking = trusted
    names = (target_name, measured_name)
    units = (unit, measured_unit or unit)
    found_indices = indices(t, m, rate_hz)
    moving, trusted_moving, published_moving, moving_note = None, None, None, None
    try:
        moving, trusted_moving, published_moving = windows()
    except (SettingError, SignalError) as error:
        if asked:
            raise error.reworded(f"moving windows of {window_s:g} s: {error}") from None
        moving_note = failed(error)
    warnings = found_warnings(
        t, m, tracking, published, trusted, moving, response, found_indices.rms_error_percent, depends, units, names
    )
    suspect = "mean" if "offset" in warnings and "drift" not in warnings else "linear"
    changes = _changes(beside.settings, of_trusted, slopes, suspect) if differ(beside, trusted) else {}
    variants: dict[str, Tracking | None] = {} if without_bad is beside else {"bad_samples": without_bad}

    def variant(name: str) -> Tracking | None:
        if name in changes and name not in variants:
            variants[name] = _variant(t, m, beside, changes[name])
        return variants.get(name)

    argument = argued(t, tracking, beside, trusted, depends, slopes, variant, warnings, unit, start_s)
    copy = warnings.get("copy")
    loop = None if structure is None or copy is not None else _loop(structure, trusted)
    if loop is not None and limits.critical_delay_s is None:
        limits = dataclasses.replace(limits, critical_delay_s=loop.critical_delay_s)
    found_gates = gates(tracking, moving, limits, target=t, trusted=trusted, copy=copy, start_s=start_s)
    told = {argument.told} if tracking.settings.estimator == "fei" else {argument.told, *OF_PUBLISHED}
    evaluation = dataclasses.asdict(tracking.settings) | _factor_settings(factors)
    evaluation["expected_delay_s"] = of_trusted.expected_delay_s
    return Assessment(
        file=file,
        actuator=actuator,
        part=part,
        target_name=target_name,
        measured_name=measured_name,
        unit=unit,
        rate_hz=tracking.rate_hz,
        start_s=start_s,
        target=t,
        measured=m,
        tracking=tracking,
        moving=moving,
        moving_note=moving_note,
        trusted=trusted,
        trusted_moving=trusted_moving,
        published=published,
        published_moving=published_moving,
        variants={name: found for name, found in variants.items() if found is not None},
        response=response,
        response_note=response_note,
        slopes=slopes,
        slopes_note=slopes_note,
        depends_on=None if depends is None else depends.kind,
        dependence=depends,
        indices=found_indices,
        histories=index_histories(t, m, rate_hz),
        settings=evaluation | {"moving_s": window_s, "hop_s": hop_s} | dict(origin or {}),
        verdict=_verdict(tracking, trusted, part, on_average=argument.is_average),
        argument=argument.text if copy is None else f"no number says anything here: {copy.cause}",
        warnings=tuple(warning for code, warning in warnings.items() if code not in told),
        limits=limits,
        gates=found_gates,
        conclusion=conclusion(found_gates),
        loop=loop,
        factors=factors,
    )


def _without_numbers(tracking: Tracking, why: Said) -> Tracking:
    """The same without gain and delay, for a reason that the estimate itself did not see."""
    names = ("amplitude", "phase_rad", "delay_s", "amplitude_std", "delay_std_s")
    nothing: dict[str, Any] = dict.fromkeys(names, math.nan)
    nothing |= dict.fromkeys(("amplitude_interval", "delay_interval_s"), (math.nan, math.nan))
    said: dict[str, Any] = {"reason": str(why), "reason_code": why.code, "reason_values": why.values}
    return dataclasses.replace(tracking, **nothing, **said)


def without_trusted(settings: Settings) -> Settings:
    """The settings of the estimator asked for, without what speaks of the trusted estimate beside it."""
    return dataclasses.replace(settings, expected_delay_s=None) if settings.estimator == "fei" else settings


def trusted_settings(settings: Settings, expected_delay_s: float | None) -> Settings:
    """Least squares on every sample, with the same window and band; two sensors are never assumed to share a zero."""
    return dataclasses.replace(
        settings,
        estimator="least_squares",
        data_decimation=1,
        frequency_decimation=1,
        decimator="spectral",
        weight_power=2,
        detrend="linear" if settings.detrend == "linear" else "mean",
        expected_delay_s=expected_delay_s,
    )


def published_settings(settings: Settings) -> Settings:
    """The published average with the same window, band, P and Q, and what it subtracts unless told otherwise."""
    return settled(
        dataclasses.replace(settings, estimator="fei", expected_delay_s=None, noise="white", noise_ratio=0.0)
    )


def _loop(structure: VirtualTest, trusted: Tracking) -> LoopEffect | None:
    # What virtual tests need is loaded only where one is given.
    from rthstrack.verdict.loop import loop_effect

    return loop_effect(structure, trusted)


def _verdict(tracking: Tracking, trusted: Tracking, part: str, *, on_average: bool) -> str:
    """The headline. Where no number can be trusted it says so, whatever the estimate that was asked for reads."""
    missing = _undetermined(trusted)
    if tracking is trusted or missing is None or _undetermined(tracking) is not None:
        return sentence(tracking, *signal_roles(part), on_average=on_average)
    return f"no number can be trusted: {missing}"


def _check_limits(limits: Limits, trusted: Tracking) -> None:
    """Refuses a limit of the delay that no reading could exceed."""
    quarter_s = trusted.n_samples / trusted.rate_hz / 4
    bounds = ((trusted.settings.max_delay_s, "max_delay_s"), (quarter_s, "a quarter of the record"))
    limits.check(*min(bounds))


def _windows(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    rate_hz: float,
    window_s: float,
    hop_s: float,
    settings: Sequence[Settings],
) -> list[MovingTracking | None]:
    """The moving windows of each of the settings, those of equal ones once.

    The first must be; what stands beside may fail where the judged windows do not, and is None then.
    """
    found: dict[Settings, MovingTracking | None] = {}
    for one in settings:
        if one in found:
            continue
        try:
            found[one] = evaluate_moving(target, measured, rate_hz, one, window_s=window_s, hop_s=hop_s)
        except (SettingError, SignalError):
            if not found:
                raise
            found[one] = None
    return [found[one] for one in settings]


def _aside(make: Callable[[], _T]) -> Callable[[], _T]:
    """Begins it on another thread: the core holds no lock. What is returned waits for its value or error."""
    outcome: list[_T | BaseException] = []

    def run() -> None:
        try:
            outcome.append(make())
        except BaseException as error:
            outcome.append(error)

    thread = Thread(target=run)
    thread.start()

    def wait() -> _T:
        thread.join()
        if isinstance(outcome[0], BaseException):
            raise outcome[0]
        return outcome[0]

    return wait


def _published(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    settings: Settings,
    tracking: Tracking,
    still: Said | None,
) -> Tracking:
    """The published average; where it is refused, as where a sum leaves the range, what is judged stands without it."""
    try:
        found = Evaluator(target.size, tracking.rate_hz, settings).evaluate(target, measured, weights=True)
    except (SettingError, SignalError) as error:
        return dataclasses.replace(_without_numbers(tracking, failed(error)), settings=settings)
    return found if still is None else _without_numbers(found, still)


def _response(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    rate_hz: float,
    slopes: FrequencySlopes | None,
    trusted: Tracking,
) -> tuple[FrequencyResponse | None, Said | None]:
    """Gain and delay over frequency, segments aligned by what is known of the delay, or why there are none."""
    if slopes is not None:
        known_s, dispersion = slopes.align_s, slopes.dispersion
    else:
        known_s, dispersion = float(trusted.delay_s), False
    note, unaligned = None, "" if math.isfinite(known_s) else str(reason(trusted) or "")
    # A record may be long enough for segments, but not for segments that are moved.
    for align_s in (known_s, 0.0) if math.isfinite(known_s) else (0.0,):
        try:
            found = frequency_response(target, measured, rate_hz, align_s=align_s, dispersion=dispersion)
        except (SettingError, SignalError) as error:
            note, unaligned = failed(error), str(error)
            continue
        return dataclasses.replace(found, unaligned=unaligned), None
    return None, note


def _changes(
    settings: Settings, trusted: Settings, slopes: FrequencySlopes | None, detrend: str
) -> dict[str, dict[str, Any]]:
    """What may be changed of an evaluation, each a suspect where it and the trusted estimate differ."""
    changes: dict[str, dict[str, Any]] = {
        "window": {"window": "hann" if settings.window == "boxcar" else "boxcar"},
        "estimator": {
            "estimator": "aligned",
            "data_decimation": 1,
            "frequency_decimation": 1,
            "decimator": "spectral",
            "expected_delay_s": trusted.expected_delay_s,
        },
    }
    if settings.detrend == "none" or (settings.detrend == "mean" and detrend == "linear"):
        changes["detrend"] = {"detrend": detrend}
    if slopes is not None:
        low, high = settings.band_hz or (0.0, math.inf)
        changes["band"] = {"band_hz": (low, min(high, slopes.band_hz[1]))}
    return changes


def _variant(
    target: NDArray[np.float64], measured: NDArray[np.float64], tracking: Tracking, change: dict[str, Any]
) -> Tracking | None:
    """The evaluation with one thing changed, or None where nothing is left to judge by."""
    try:
        return Evaluator(target.size, tracking.rate_hz, tracking.settings, **change).evaluate(target, measured)
    except (SettingError, SignalError):
        return None


def _chosen(
    target: NDArray[np.float64],
    measured: NDArray[np.float64],
    rate_hz: float,
    settings: Settings,
    choose: Collection[str],
    tolerance: float,
) -> Factors:
    from rthstrack.evaluation.factors import choose_factors

    if unknown := [name for name in choose if name not in ("P", "Q")]:
        raise SettingError(f"choose takes P and Q, not {unknown[0]!r}")
    p, q = settings.data_decimation, settings.frequency_decimation
    return choose_factors(
        target,
        measured,
        rate_hz,
        tolerance=tolerance,
        data_decimation=None if "P" in choose else p,
        frequency_decimation=None if "Q" in choose else q,
        settings=settings,
    )


def _factor_settings(factors: Factors | None) -> dict[str, Any]:
    """What was chosen and the bound it keeps to, for `Assessment.settings`; nothing where nothing was chosen."""
    if factors is None:
        return {}
    reference = factors.reference.settings
    return {
        "chosen_factors": {
            "tolerance": factors.tolerance,
            "amplitude_bound": factors.amplitude_bound,
            "delay_bound": factors.delay_bound,
            "delay_measure": factors.delay_measure,
            # moving windows are evaluated with these, too
            "reference_data_decimation": reference.data_decimation,
            "reference_frequency_decimation": reference.frequency_decimation,
            "windowed": None if factors.windowed is None else factors.windowed.to_dict(),
        }
    }
