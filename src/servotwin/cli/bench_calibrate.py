"""`servotwin bench calibrate`: what a multimeter and a dial say of the bench, with standard errors."""

from __future__ import annotations

import contextlib
import math
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servotwin.cli import bench_options as words
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, pairs, show

if TYPE_CHECKING:
    from servotwin.bench.recording import AnalogRig, Calibration, Limits, Wiring

_LOOK = 0.5  # s over which counts are averaged
_ANGLES, _FEWEST = 7, 4  # positions, unless they are given; a table needs as many
_WHAT = ("reference", "supply", "shunt", "angle")
_SET = {"reference": "Put a voltage at A3, below the reference; what does the meter say",
        "supply": "Set a supply voltage; what does the meter say",
        "shunt": "Draw a current through the shunt; what does the meter say"}
_EXAMPLE = {"reference": "1.213V", "supply": "6.02V", "shunt": "0.35A"}


def calibrate(
    what: Annotated[str, typer.Argument(
        help="reference (of the converter), supply (its divider), shunt, or angle (of the servo, by a dial).")],
    port: words.PortOption = None,
    wiring: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="Wires of the bench; what is measured is written into it.",
        rich_help_panel=words.BENCH)] = None,
    meter: Annotated[str | None, typer.Option(
        metavar="VALUES", help="What the meter or the dial says at each point, with commas, instead of a question; "
        "the points are taken one after the other.", rich_help_panel=words.BENCH)] = None,
    span: words.RangeOption = None,
    voltage: words.VoltageOption = None,
    current_limit: words.CurrentOption = None,
    servo: Annotated[str | None, typer.Option(
        metavar="ID", help="Servo that takes what the angles say.", rich_help_panel=words.SAID)] = None,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Of angle: the servo (.toml) or the table of readings (.csv).",
        rich_help_panel=shared.OUTPUT)] = None,
    force: Annotated[bool, typer.Option(
        "--force", help="Replace existing files.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Calibrate one thing of the bench."""
    from servotwin.bench.backends import SerialBackend
    from servotwin.bench.recording import AnalogRig
    from servotwin.errors import InputError, UnknownNameError

    if what not in _WHAT:
        raise UnknownNameError("calibration", what, _WHAT)
    for given, option in ((out, "--out"), (span, "--range"), (servo, "--servo")):
        if given is not None and what != "angle":
            raise InputError(option, got=f"calibrate {what}", allowed="calibrate angle alone")
    if what != "angle" and wiring is None:
        raise InputError("--wiring", got="none", allowed="the file that takes what is measured, new or not")
    if meter is None and not (sys.stdin and sys.stdin.isatty()):
        raise InputError("--meter", got="none", allowed="its values, where nobody can be asked")
    base = words.wiring_from(wiring if wiring is not None and wiring.exists() else None)
    if what == "angle":
        _angle(AnalogRig(SerialBackend(words.port_from(port)), base), meter, (span, voltage, current_limit), servo,
               out, force=force, as_json=as_json)
        return
    rig = AnalogRig(SerialBackend(words.port_from(port)), _with_channel(base, what))
    found = _wires(rig, what, meter)
    place = Path(wiring or "")
    found.wiring.replace(channels=base.channels).save(place, overwrite=True)
    _show(found, place, as_json=as_json)


def _with_channel(base: Wiring, what: str) -> Wiring:
    from servotwin.bench.recording.calibrate import CHANNEL

    return base.replace(channels=tuple(dict.fromkeys((*base.channels, CHANNEL[what]))))


def _wires(rig: AnalogRig, what: str, meter: str | None) -> Calibration:
    """Read a channel at each value of the meter; nothing moves."""
    from servotwin.bench.recording import calibrated
    from servotwin.bench.recording.calibrate import CHANNEL, UNIT
    from servotwin.units.quantities import quantity

    dimension = "current" if UNIT[what] == "A" else "voltage"
    values, counts = [], []
    with contextlib.closing(rig):
        rig.open()
        for text in _asked(meter, f"{_SET[what]} (such as {_EXAMPLE[what]}; empty: that is all)"):
            values.append(quantity("what the meter says", text, dimension))
            counts.append(statistics.fmean(rig.measure(_LOOK)[CHANNEL[what]]))
    return calibrated(rig.wiring, what, values, counts)


def _asked(given: str | None, question: str) -> Iterator[str]:
    """Yield what the meter says, out of a list or asked for one by one until nothing is said."""
    if given is not None:
        yield from given.split(",")
        return
    while text := str(typer.prompt(question, default="", show_default=False, err=True)).strip():
        yield text


def _show(found: Calibration, place: Path, *, as_json: bool) -> None:
    values = {name: getattr(found.wiring, name) for name in found.changed}
    if as_json:
        emit_json({"wiring": str(place), "remarks": list(found.remarks),
                   **{name: {"value": one.value, "std": one.std, "unit": one.unit} for name, one in values.items()}})
        return
    rows = [(name, f"{one.value:.5g} {one.spread} {one.unit}") for name, one in values.items()]
    show(pairs([*rows, ("written", str(place))]), *(f"- {text}" for text in found.remarks))


def _angle(rig: AnalogRig, meter: str | None, said: tuple[str | None, str | None, str | None], servo: str | None,
           out: Path | None, *, force: bool, as_json: bool) -> None:
    """Move the servo from place to place, read the tap, and take the angle of a dial."""
    from servotwin.bench import calibrate_table
    from servotwin.cli.fit_table import calibration_facts, show_table_calibration
    from servotwin.cli.outputs import Target, check_targets
    from servotwin.parameters import load_servo, write_file
    from servotwin.tables import csv_text

    limits = words.limits_from("pulse_width", *said)
    if out is not None:
        check_targets([Target(option="--out", path=out, endings=(".toml", ".csv"))], force=force)
    loaded = None if servo is None else load_servo(servo)
    table = _readings(rig, limits, meter)
    text = csv_text({name: list(column) for name, column in table.items()}).encode()
    if out is not None and out.suffix == ".csv":
        write_file(out, text, overwrite=force)
    found = calibrate_table(table, loaded, source="servotwin bench calibrate angle")
    if out is not None and out.suffix == ".toml":
        found.servo.save(out, overwrite=force)
    if as_json:
        emit_json(calibration_facts(found, out))
    else:
        show_table_calibration(found, out)


def _readings(rig: AnalogRig, limits: Limits, meter: str | None) -> dict[str, list[float]]:
    """Return pulse, tap and dial at each place; all are come to from below."""
    from servotwin.errors import InputError
    from servotwin.parameters.output_file import undone
    from servotwin.units.quantities import quantity

    given = None if meter is None else meter.split(",")
    count = _ANGLES if given is None else len(given)
    if "tap" not in rig.wiring.channels or count < _FEWEST:
        raise InputError("calibrate angle", got=f"{count} angles" if count < _FEWEST else "no tap in the wiring",
                         allowed=f"at least {_FEWEST} angles, and a tap")
    table: dict[str, list[float]] = {"pulse_width_us": [], "feedback_voltage_V": [], "output_angle_deg": []}
    with contextlib.closing(rig), undone(rig.limp):
        rig.open()
        rig.approach(limits.low)
        for k in range(count):
            width = limits.at(k / (count - 1))
            rig.approach(width)
            tap = statistics.fmean(rig.measure(_LOOK)["tap"])
            dial = given[k] if given is not None else str(typer.prompt(
                f"{1e6 * width:.0f} us: what does the dial say (such as 45deg)", err=True))
            table["pulse_width_us"].append(round(1e6 * width, 3))
            table["feedback_voltage_V"].append(rig.wiring.value("tap", tap))
            table["output_angle_deg"].append(math.degrees(quantity("what the dial says", dial, "angle")))
    return table
