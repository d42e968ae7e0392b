"""A pair judged: two channels of a recording, the likely ones where none are named, or two arrays."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

from rthstrack.errors import ChannelError, SettingError, SignalError, UnknownSettingError
from rthstrack.keyed_table import suggestion
from rthstrack.recording.chosen import choose
from rthstrack.recording.recording import Recording
from rthstrack.said import Said, coded
from rthstrack.verdict.assessment import assess_samples
from rthstrack.verdict.limits import Limits

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from numpy.typing import ArrayLike

    from rthstrack.evaluation.settings import Settings
    from rthstrack.verdict.assessment import Assessment
    from rthstrack.virtual_test.parts import VirtualTest


class Judging(TypedDict, total=False):
    """How a pair is judged."""

    settings: Settings | None
    choose: Collection[str]
    tolerance: float
    moving_s: float | None
    hop_s: float | None
    limits: Limits | None
    structure: VirtualTest | None
    actuator: int


class OfSamples(Judging, total=False):
    """The same, and what arrays do not say of themselves."""

    file: str
    part: str
    target_name: str
    measured_name: str
    unit: str | None
    measured_unit: str | None
    start_s: float
    origin: Mapping[str, Any] | None


@overload
def assess(
    recording: Recording, /, target: str | None = None, measured: str | None = None, **how: Unpack[Judging]
) -> Assessment: ...


@overload
def assess(target: ArrayLike, measured: ArrayLike, rate_hz: float, **how: Unpack[OfSamples]) -> Assessment: ...


def assess(  # type: ignore[misc]  # the target may be given by its name too
    recording: Any = None, /, target: Any = None, measured: Any = None, rate_hz: float | None = None, **how: Any
) -> Assessment:
    """Judges one pair in every way there is: whole record, moving windows, over frequency, indices, warnings.

    assess(recording): the likely target and measured, as `rthstrack evaluate FILE` takes them, with what the command
    says of them; or channels named, assess(recording, target="cmd", measured="meas"): by name, path or `#index`.

    assess(target, measured, rate_hz): samples (n_samples,) in `unit` (and `measured_unit`, the same unless given).

    settings: of `evaluate`; their expected_delay_s is the trusted estimate's too, and its alone where the estimator is
    "fei".
    choose: "P", "Q" or both are chosen within `tolerance` (`choose_factors`), in place of those in settings. They fit
    the whole record only: moving windows have 1 in their place.
    moving_s, hop_s: moving windows; by default 4 s but at most a quarter of the record, sixteen readings a window.
    limits: what is allowed (`gates`). structure: the test whose only actuator this is; its critical delay at the
    measured gain is a limit, too, unless one is given. `origin` says what was done to the samples before.

    Raises SignalError, SettingError, of recordings also RecordingError and ChannelError; where only the moving
    evaluation or the frequency response is impossible, it is None and its note says why, unless `moving_s` or `hop_s`
    asked for it.
    """
    known = OfSamples.__annotations__ | Judging.__annotations__
    if unknown := [name for name in how if name not in known]:
        near = suggestion(unknown[0], known)
        raise UnknownSettingError(
            f"assess has no argument {unknown[0]!r}{near}; how the pair is evaluated stands in settings=Settings(...), "
            "what is allowed in limits=Limits(...)"
        )
    if not isinstance(how.get("limits"), Limits | None):
        raise SettingError(f"limits: expected Limits(...), found {how['limits']!r}")
    if isinstance(recording, Recording):
        if rate_hz is not None:
            raise SettingError("rate_hz: a recording has its own; give it to read_recording")
        return _of_recording(recording, target, measured, **how)
    given = [one for one in (recording, target, measured, rate_hz) if one is not None]
    if len(given) != 3:
        raise TypeError("assess takes a Recording, or target, measured and rate_hz")
    return assess_samples(*given, **how)


def _of_recording(recording: Recording, target: str | None, measured: str | None, **how: Unpack[Judging]) -> Assessment:
    if (target is None) != (measured is None):
        raise SettingError("target and measured go in pairs: name both, or neither for the likely ones")
    chosen = choose(
        recording,
        targets=() if target is None else (target,),
        measured=() if measured is None else (measured,),
    )
    if len(chosen.pairs) > 1:
        listed = ", ".join(f"'{one}' and '{other}'" for one, other in chosen.pairs)
        raise ChannelError(
            f"there are {len(chosen.pairs)} pairs: {listed}",
            file=recording.file,
            code="several_pairs",
            advice="judge one at a time: {target}, {measured}",
        )
    ((asked, answered),) = chosen.pairs
    return assess_pair(chosen.recording, asked, answered, chosen.proposal, **how)


def assess_pair(
    recording: Recording,
    target: str,
    measured: str,
    proposal: Said | None = None,
    *,
    part: str = "whole",
    origin: Mapping[str, Any] | None = None,
    **how: Unpack[Judging],
) -> Assessment:
    """Judges two channels of a recording as `choose` leaves it, with what is to be said of where they come from.

    proposal: why these, where they were not named. origin: what was done to the recording. Raises SignalError,
    SettingError, with the file named.
    """
    asked, answered = recording.channel(target), recording.channel(measured)
    assert recording.rate_hz is not None
    whole = part == "whole"
    about = {
        "rate_source": recording.rate_source,
        **(origin or {}),
        "notes": list(recording.notes),
        "channels": proposal or "named by the user",
    }
    try:
        found = assess_samples(
            asked.values,
            answered.values,
            recording.rate_hz,
            file=recording.file,
            part=part,
            target_name=asked.name,
            measured_name=answered.name,
            unit=asked.unit,
            measured_unit=answered.unit,
            start_s=recording.start_s,
            origin=about,
            **how,
        )
    except SignalError as error:
        if error.code == "not_finite" and not about.get("fill"):
            error.advice = "{filled(SAMPLES)} interpolates short gaps"
        names = f"target '{asked.name}', measured '{answered.name}'"
        raise error.reworded(f"{names}: {error.args[0]}").about(recording.file) from None
    except SettingError as error:
        raise error.about(recording.file) from None
    notes = [coded(note) for note in recording.notes]
    guesses = [note for note in notes if note.code in _GUESSES]
    said = list(found.warnings)
    if whole:
        # What the number stands and falls with comes first.
        said = [*guesses, *said, *(note for note in notes if note.code not in _GUESSES)]
    if whole and proposal is not None:
        words = f"no channels were named: judged target '{asked.name}', measured '{answered.name}' ({proposal})"
        said.insert(0, Said(words, "channels_proposed"))
    causes = [proposal.cause] if proposal is not None and proposal.code == "pair_guessed" else []
    causes += dict.fromkeys(note.cause for note in guesses)
    causes += [f"but {warning.cause}" for warning in found.warnings if warning.code == "copy"]
    return dataclasses.replace(found, warnings=tuple(said), verdict=", ".join([found.verdict, *causes]))


#: Notes on what is only a guess, which the verdict says too.
_GUESSES = ("time_unit_guessed", "clocks_assumed", "clocks_aligned")
