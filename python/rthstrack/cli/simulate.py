"""`rthstrack simulate CONFIG.toml`: a virtual test in, a recording out."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rthstrack.cli.arguments import path
from rthstrack.cli.commands import COMMANDS
from rthstrack.cli.quantities import seconds
from rthstrack.errors import ConfigurationError, SettingError
from rthstrack.virtual_test.configuration import read_configuration
from rthstrack.virtual_test.simulation import delay_damping, simulate, true_tracking

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from rthstrack.virtual_test.run import Run

# Frequencies listed of a structure with many.
_MOST_MODES = 6


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to the command line."""
    parser = subparsers.add_parser(
        "simulate",
        help=COMMANDS["simulate"],
        description="Runs the virtual test that a TOML file describes (structure, restoring forces, actuators with "
        "their delay and compensation, ground motion; or actuators alone along a sine, a sweep or a recorded target; "
        "see docs/virtual-tests.md and examples/*.toml), says which delay its loop bears and what a delay costs in "
        "damping, and writes a recording that 'rthstrack evaluate' judges. "
        "Exit status: 0 done, 1 the test is unstable or a file failed, 2 misuse or a mistake in the configuration.",
    )
    parser.add_argument("config", metavar="CONFIG.toml", help="the test; every mistake in it is reported at once")
    parser.add_argument(
        "-o",
        "--output",
        type=path(".h5", ".hdf5"),
        metavar="RUN.h5",
        help="write target, command, measured, force and, of a structure, displacements and ground motion, with the "
        "configuration inside; a file of this name is replaced",
    )
    parser.add_argument("--duration", type=seconds, metavar="S", help="seconds, instead of the configuration's")
    parser.add_argument("--seed", type=_seed, metavar="N", help="of the sensors' noise, instead of the configuration's")
    parser.set_defaults(run=lambda args: run(args, parser.error))


def run(args: argparse.Namespace, misuse: Callable[[str], Any]) -> int:
    """Runs the test; returns the exit status."""
    if args.output is not None and not args.output.parent.is_dir():
        misuse(f"--output: there is no directory {args.output.parent}")
    configuration = read_configuration(args.config)
    test, table, duration_s = configuration
    if args.seed is not None:
        test = dataclasses.replace(test, seed=args.seed)
    motion = configuration.motion_from(Path(args.config).parent)
    try:
        finished = simulate(test, motion, duration_s=args.duration or duration_s)
    except SettingError as error:
        # What only test and motion together show, such as a delay longer than the record.
        mistakes = error.mistakes if isinstance(error, ConfigurationError) else [("", str(error))]
        raise ConfigurationError(args.config, mistakes) from None
    _print(finished, args.config)
    if args.output is not None:
        from rthstrack.virtual_test.run import write_run

        write_run(finished, args.output, motion=table)
        print(f"run written to {args.output}; judge it with: rthstrack evaluate {args.output}", file=sys.stderr)
    return 0


def _print(run: Run, config: str) -> None:
    from rich.table import Table
    from rich.text import Text

    from rthstrack.cli.output import Console

    console = Console()
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for label, value in (*_of_test(run, config), *_of_delay(run), *_of_run(run)):
        table.add_row(label, Text(value))
    console.print(table)
    for text in _warnings(run):
        console.print(Text("warning: ", style="yellow") + Text(text))


def _of_test(run: Run, config: str) -> Iterable[tuple[str, str]]:
    """What was run, as labels and values."""
    n, frequencies = run.n_samples, run.test.structure.natural_frequencies_hz
    yield "test", f"{config}: {n} samples at {run.rate_hz:g} Hz ({(n - 1) / run.rate_hz:g} s)"
    if run.ground_motion is None:
        yield "target", getattr(run.target_motion, "source", run.motion_name)
        yield from (("", note) for note in run.motion_notes)
        return
    yield "ground motion", f"{run.motion_name}, peak {np.abs(run.ground_motion).max():.4g} m/s2"
    yield from (("", note) for note in run.motion_notes)
    yield "structure", f"{len(frequencies)} degree{'s' * (len(frequencies) > 1)} of freedom, {_list(frequencies)} Hz"


def _of_delay(run: Run) -> Iterable[tuple[str, str]]:
    """What the actuators leave, what the loop bears, and what that costs."""
    left = [_left(run, frequency_hz) for frequency_hz in _frequencies(run)]
    for number in range(len(run.test.actuators)):
        which = f"actuator {number + 1}" if len(run.test.actuators) > 1 else "actuator"
        # What varies has no value at any frequency.
        for tracking in dict.fromkeys(found[number] for found in left):
            if tracking is None:
                yield which, "gain and delay vary: no one value"
            else:
                amplitude, delay_s, frequency_hz = tracking
                way = f"{_ms(abs(delay_s))} {'lag' if delay_s >= 0 else 'lead'}"
                yield which, f"gain {amplitude:.4g}, {way} at {frequency_hz:.4g} Hz, compensation included"
            which = ""
    if run.ground_motion is None:
        return
    critical = run.critical_delay
    if critical is None:
        yield "critical delay", "not computed: known for one actuator only"
    elif math.isinf(critical.delay_s):
        yield "critical delay", "none: no constant delay makes the elastic loop unstable"
    else:
        said = "" if critical.exact else ", of the elastic stiffness, before anything yields"
        at = f" at {critical.frequency_hz:.4g} Hz" if math.isfinite(critical.frequency_hz) else ""
        yield "critical delay", f"{_ms(critical.delay_s)}{at}, with gain {critical.gain:g}{said}"
    first = left[0][0]
    delay_s = first[1] if critical is not None and first is not None else 0.0
    if delay_s > 0:
        cost = delay_damping(run.test, delay_s)
        gain = f", with gain {critical.gain:g}" if critical is not None and critical.gain != 1 else ""
        yield "damping", f"{_list(100 * cost.damping_ratio_without)} % without delay{gain}"
        yield "", f"{_list(100 * cost.damping_ratio)} % with {_ms(delay_s)}"
        yield "", f"{_list(100 * cost.first_order_change)} % is the first-order change, -(K k_e / k) omega tau / 2"


def _of_run(run: Run) -> Iterable[tuple[str, str]]:
    """What came out."""
    names = ("target", "measured", "force")
    peaks = {name: np.atleast_1d(np.abs(getattr(run, name)).max(axis=0)) for name in names}
    for i in range(len(run.test.actuators)):
        which = f"peaks, actuator {i + 1}" if len(run.test.actuators) > 1 else "peaks"
        target, measured, force = (float(peaks[name][i]) for name in names)
        yield which, f"target {1e3 * target:.4g} mm, measured {1e3 * measured:.4g} mm, force {force / 1e3:.4g} kN"
    if run.target_motion is not None:
        motion, _ = run.target_motion.sampled(run.rate_hz, (run.n_samples - 1) / run.rate_hz)
        speed = float(np.abs(motion[:, 1]).max())
        yield "", f"the target moves by up to {1e3 * speed:.4g} mm/s"
    if run.test.stepping == "cr":
        integrator = "cr, one step a sample" if run.ground_motion is not None else "once a sample, as a controller does"
        yield "stepping", integrator
    else:
        steps = f"{run.steps_per_sample} step{'s' * (run.steps_per_sample > 1)} a sample"
        what = "target and measured" if run.ground_motion is not None else "measured and force"
        change = f"halving the step last changed {what} by {run.error_estimate:.2g} of their peaks"
        yield "stepping", f"continuous, {steps}; {change}"


def _warnings(run: Run) -> Iterable[str]:
    if run.error_estimate > run.test.tolerance:
        yield (
            f"the step was halved as often as it may be, and the error estimate of {run.error_estimate:.2g} is still "
            f"above test.tolerance = {run.test.tolerance:g}"
        )
    for i, actuator in enumerate(run.test.actuators):
        for name, signal, what in (
            ("command_converter", run.command, "command"),
            ("displacement_sensor", run.measured, "measured displacement"),
            ("force_sensor", run.force, "measured force"),
        ):
            values = signal if signal.ndim == 1 else signal[:, i]
            share = float(np.mean(np.abs(values) >= getattr(actuator, name).limit * (1 - 1e-9)))
            if share:
                yield f"the {what} of actuator {i + 1} was at its limit in {100 * share:.2g} % of the samples"
    critical = run.critical_delay
    if critical is None:
        return
    left = _left(run, _frequencies(run)[0])[0]
    if left is not None and left[1] >= critical.delay_s:
        yield (
            f"the lag of {_ms(left[1])} exceeds the critical delay of {_ms(critical.delay_s)}: the elastic loop is "
            "unstable; what kept this test within its bounds is its length or what yields"
        )


def _frequencies(run: Run) -> Sequence[float]:
    """Where gain and delay are told: where the loop would ring, else the first mode; of a target its own."""
    if run.target_motion is not None:
        return run.target_motion.frequencies_hz
    critical = run.critical_delay
    if critical is not None and math.isfinite(critical.frequency_hz):
        return (critical.frequency_hz,)
    return (float(run.test.structure.natural_frequencies_hz[0]),)


def _left(run: Run, frequency_hz: float) -> Sequence[tuple[float, float, float] | None]:
    """Gain, delay and the frequency they hold at, for each actuator."""
    found = (true_tracking(run.test, frequency_hz, actuator) for actuator in range(len(run.test.actuators)))
    return [None if one is None else (one[0].item(), one[1].item(), frequency_hz) for one in found]


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.4g} ms"


def _list(values: NDArray[np.float64]) -> str:
    listed = ", ".join(f"{value:.4g}" for value in values[:_MOST_MODES])
    return listed + (f" and {len(values) - _MOST_MODES} more" if len(values) > _MOST_MODES else "")


def _seed(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 on, found '{text}'")
    return int(text)
