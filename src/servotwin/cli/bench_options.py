"""What the commands of the bench ask for in the same words, and what those words mean."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import shared_options as shared

if TYPE_CHECKING:
    from servotwin.bench.recording import About, Limits, Wiring

BENCH, RUN, SAID = "Bench", "Experiment", "What the log says"

PortOption = Annotated[str | None, typer.Option(
    metavar="PORT", help="Serial port, such as /dev/ttyUSB0 or COM3; the only one that there is unless given.",
    rich_help_panel=BENCH)]
WiringOption = Annotated[Path | None, typer.Option(
    metavar="FILE.toml", help="Wires of the bench, as servotwin bench calibrate writes them; those of the guide unless "
    "given.", rich_help_panel=BENCH)]
ExperimentOption = Annotated[str, typer.Option(
    "--experiment", "-e", metavar="NAMES", help="steps, staircase, ramp, chirp, prbs, frame_rates, missing, "
    "torque_off, hold, several with commas; all; or advise: the one that would tell most of this servo.",
    rich_help_panel=RUN)]
RangeOption = Annotated[str | None, typer.Option(
    "--range", metavar="LOW:HIGH", help="Commands that are allowed, such as 1000us:2000us, or -60deg:60deg on a bus.",
    rich_help_panel=RUN)]
VoltageOption = Annotated[str | None, typer.Option(
    metavar="VOLTS", help="Supply of the servo as it is set, such as 6V.", rich_help_panel=RUN)]
CurrentOption = Annotated[str | None, typer.Option(
    "--current-limit", metavar="AMPERES", help="Mean supply current over 0.25 s that ends the run, such as 0.8A.",
    rich_help_panel=RUN)]
DurationOption = Annotated[float, typer.Option(
    metavar="SECONDS", help="Of each experiment, about.", rich_help_panel=RUN)]
FramePeriodOption = Annotated[str, typer.Option(
    metavar="TIME", help="From pulse to pulse, 3.003ms to 25ms; on a bus from goal to goal.", rich_help_panel=RUN)]
RateOption = Annotated[str, typer.Option(
    metavar="HOW", help="When the board reads: fast (1 kHz) or frame (once, at each rising edge).",
    rich_help_panel=RUN)]
SeedOption = Annotated[int, typer.Option(help="Of what is random in an experiment.", rich_help_panel=RUN)]
LicenceOption = Annotated[str, typer.Option(
    metavar="TEXT", help="Under which the logs may be used, such as CC-BY-4.0.", rich_help_panel=SAID)]
AuthorOption = Annotated[str, typer.Option(metavar="TEXT", help="Who recorded them.", rich_help_panel=SAID)]
NoteOption = Annotated[str, typer.Option(metavar="TEXT", help="Anything else.", rich_help_panel=SAID)]
LoadOption = Annotated[list[str] | None, typer.Option(
    metavar="PART=VALUE", help="What hangs on the shaft, as for simulate: inertia=1e-3, arm=0.2kg:10cm.",
    rich_help_panel=SAID)]
OutOption = Annotated[Path, typer.Option(
    metavar="FOLDER", help="Folder for the logs, made if it is not there.", rich_help_panel=shared.OUTPUT)]
ForceOption = Annotated[bool, typer.Option(
    "--force", help="Replace logs of the same name.", rich_help_panel=shared.OUTPUT)]

_ASKED = {"range": ("--range", "Commands that are allowed (low:high, such as {example})"),
          "voltage": ("--voltage", "Voltage of the supply (such as 6V)"),
          "current": ("--current-limit", "Mean current that ends the run (such as 0.8A)")}
_EXAMPLE = {"pulse_width": "1000us:2000us", "angle": "-60deg:60deg"}
_DIMENSION = {"pulse_width": "time", "angle": "angle"}


def limits_from(kind: str, span: str | None, voltage: str | None, current: str | None) -> Limits:
    """Return the limits of a run; what was not given is asked for on a terminal.

    Raises
    ------
    InputError
        If one is missing and nobody can be asked, or makes no sense.

    Examples
    --------
    >>> limits_from("pulse_width", "1000us:2000us", "6V", "0.8A").current
    0.8
    """
    from servotwin.bench.recording import Limits
    from servotwin.errors import InputError
    from servotwin.units.quantities import quantity

    said = {"range": span, "voltage": voltage, "current": current}
    missing = [name for name, value in said.items() if value is None]
    if missing and not (sys.stdin and sys.stdin.isatty()):
        raise InputError("before anything moves", got="no " + ", ".join(_ASKED[name][0] for name in missing),
                         allowed="all of --range, --voltage and --current-limit")
    for name in missing:
        said[name] = typer.prompt(_ASKED[name][1].format(example=_EXAMPLE[kind]), err=True)
    low, colon, high = str(said["range"]).partition(":")
    if not colon:
        raise InputError("--range", got=said["range"], allowed=f"LOW:HIGH, such as {_EXAMPLE[kind]}")
    unit = _DIMENSION[kind]
    return Limits(kind=kind, low=quantity("--range", low, unit), high=quantity("--range", high, unit),
                  voltage=quantity("--voltage", str(said["voltage"]), "voltage", positive=True),
                  current=quantity("--current-limit", str(said["current"]), "current", positive=True))


def wiring_from(path: Path | None) -> Wiring:
    """Return the wiring of a file; that of the guide without one."""
    from servotwin.bench.recording import Wiring, load_wiring

    return Wiring() if path is None else load_wiring(path)


def about_from(servo: str, licence: str, author: str, note: str, load: list[str] | None) -> About:
    """Return what the logs say of themselves."""
    from servotwin.bench.recording import About
    from servotwin.cli.load_words import load_from
    from servotwin.logs.sidecar import words_of_load

    return About(servo=servo, licence=licence, author=author, note=note, load=words_of_load(load_from(load or [])))


def port_from(port: str | None) -> str:
    """Return the port that was given, or the only one that has a USB plug.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    from servotwin.bench.backends import serial_ports
    from servotwin.errors import InputError

    if port is not None:
        return port
    found = [one.device for one in serial_ports() if one.identity]
    if len(found) != 1:
        raise InputError("--port", got=", ".join(found) or "no serial port with a USB plug on this computer",
                         allowed="the name of one; servotwin bench rehearse needs none")
    return found[0]


def seconds(what: str, text: str) -> float:
    """Return a time [s] out of words such as "20ms"."""
    from servotwin.units.quantities import quantity

    return quantity(what, text, "time", positive=True)
