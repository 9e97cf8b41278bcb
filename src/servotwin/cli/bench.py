"""`servotwin bench`: a real servo on a board, or the firmware of the board in emulation, and what they tell."""

from __future__ import annotations

import contextlib
import math
import shutil
import statistics
import sys
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, Commands, usual, with_records
from servotwin.cli.terminal import emit, emit_help, emit_json, json_text, pairs, patience, show, table, typed
from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.bench.emulator.plant import ChainRow
    from servotwin.bench.recording import About, AnalogRig, Calibration, Experiment, Limits, Recorded, Wiring
    from servotwin.bench.video import Filmed
    from servotwin.bench.video.marker import Region
    from servotwin.cli.bench_jobs import Job
    from servotwin.cli.output_files import Target
    from servotwin.loads import Load
    from servotwin.models import Model


# --- Common options of the commands of the bench ----------------------------------------------------------------------

BENCH, RUN, SAID = "Bench", "Experiment", "What the log says"

PortOption = Annotated[str | None, typer.Option(
    metavar="PORT", help="Serial port, such as /dev/ttyUSB0 or COM3; the only one that there is unless given.",
    rich_help_panel=BENCH)]
WiringOption = Annotated[Path | None, typer.Option(
    metavar="FILE.toml", help="Wires of the bench, as servotwin bench calibrate writes them; those of the guide unless "
    "given.", rich_help_panel=BENCH)]
OutOption = Annotated[Path, typer.Option(
    metavar="FOLDER", help="Folder for the logs, made if it is not there.", rich_help_panel=shared.OUTPUT)]
Ending = Annotated[shared.Ending, {"force": "Replace logs of the same name."}]

_ASKED = {"range": ("--range", "Commands that are allowed (low:high, such as {example})"),
          "voltage": ("--voltage", "Voltage of the supply (such as 6V)"),
          "current": ("--current-limit", "Mean current that ends the run (such as 0.8A)")}
_ABOUT_EXAMPLE = {"pulse_width": "1000us:2000us", "angle": "-60deg:60deg"}
_DIMENSION = {"pulse_width": "time", "angle": "angle"}


@dataclass(frozen=True, kw_only=True)
class _Allowed:
    """The limits of a run, as they were typed; what was not is asked for on a terminal."""

    span: Annotated[str | None, typer.Option(
        "--range", metavar="LOW:HIGH", help="Commands that are allowed, such as 1000us:2000us, or -60deg:60deg on a "
        "bus.", rich_help_panel=RUN)] = None
    voltage: Annotated[str | None, typer.Option(
        metavar="VOLTS", help="Supply of the servo as it is set, such as 6V.", rich_help_panel=RUN)] = None
    current_limit: Annotated[str | None, typer.Option(
        "--current-limit", metavar="AMPERES", help="Mean supply current over 0.25 s that ends the run, such as 0.8A.",
        rich_help_panel=RUN)] = None

    def limits(self, kind: str) -> Limits:
        """Return the limits of commands of a kind (see `limits_from`)."""
        return limits_from(kind, self.span, self.voltage, self.current_limit)


@dataclass(frozen=True, kw_only=True)
class _Course:
    """The experiments of a run, as they were typed."""

    experiment: Annotated[str, typer.Option(
        "--experiment", "-e", metavar="NAMES", help="steps, staircase, ramp, chirp, prbs, frame_rates, missing, "
        "torque_off, hold, several with commas; all; or advise: the one that would tell most of this servo.",
        rich_help_panel=RUN)] = "steps"
    duration: Annotated[float, typer.Option(
        metavar="SECONDS", help="Of each experiment, about.", rich_help_panel=RUN)] = 10.0
    frame_period: Annotated[str, typer.Option(
        metavar="TIME", help="From pulse to pulse, 3.003ms to 25ms; on a bus from goal to goal.", rich_help_panel=RUN)
        ] = "20ms"
    rate: Annotated[str, typer.Option(
        metavar="HOW", help="When the board reads: fast (1 kHz) or frame (once, at each rising edge).",
        rich_help_panel=RUN)] = "fast"
    seed: Annotated[int, typer.Option(help="Of what is random in an experiment.", rich_help_panel=RUN)] = 0

    @property
    def period(self) -> float:
        """From command to command [s]."""
        return seconds("--frame-period", self.frame_period)

    def experiments(self, limits: Limits, servo: str) -> list[Experiment]:
        """Return the experiments within limits."""
        from servotwin.bench.recording import experiments

        if self.experiment != "advise":
            return experiments(self.experiment, limits, duration=self.duration, frame_period=self.period,
                               seed=self.seed)
        return [_advised(limits, servo, self.period)]


@dataclass(frozen=True, kw_only=True)
class _About:
    """The logs' own statements, as typed."""

    load: Annotated[Sequence[str], typer.Option(
        metavar="PART=VALUE", help="What hangs on the shaft, as for simulate: inertia=1e-3, arm=0.2kg:10cm.",
        rich_help_panel=SAID)] = ()
    licence: Annotated[str, typer.Option(
        metavar="TEXT", help="Under which the logs may be used, such as CC-BY-4.0.", rich_help_panel=SAID)] = "not said"
    author: Annotated[str, typer.Option(metavar="TEXT", help="Who recorded them.", rich_help_panel=SAID)] = ""
    note: Annotated[str, typer.Option(metavar="TEXT", help="Anything else.", rich_help_panel=SAID)] = ""

    def of(self, servo: str) -> About:
        """Return what the logs of a servo say."""
        from servotwin.bench.recording import About
        from servotwin.cli.option_values import load_from
        from servotwin.logs.sidecar import words_of_load

        return About(servo=servo, licence=self.licence, author=self.author, note=self.note,
                     load=words_of_load(load_from(self.load)))


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
    from servotwin.units.quantities import quantity

    said = {"range": span, "voltage": voltage, "current": current}
    missing = [name for name, value in said.items() if value is None]
    if missing and not (sys.stdin and sys.stdin.isatty()):
        raise InputError("before anything moves", got="no " + ", ".join(_ASKED[name][0] for name in missing),
                         allowed="all of --range, --voltage and --current-limit")
    for name in missing:
        said[name] = typer.prompt(_ASKED[name][1].format(example=_ABOUT_EXAMPLE[kind]), err=True)
    low, colon, high = str(said["range"]).partition(":")
    if not colon:
        raise InputError("--range", got=said["range"], allowed=f"LOW:HIGH, such as {_ABOUT_EXAMPLE[kind]}")
    unit = _DIMENSION[kind]
    return Limits(kind=kind, low=quantity("--range", low, unit), high=quantity("--range", high, unit),
                  voltage=quantity("--voltage", str(said["voltage"]), "voltage", positive=True),
                  current=quantity("--current-limit", str(said["current"]), "current", positive=True))


def wiring_from(path: Path | None) -> Wiring:
    """Return the wiring of a file; that of the guide without one."""
    from servotwin.bench.recording import Wiring, load_wiring

    return Wiring() if path is None else load_wiring(path)


def port_from(port: str | None) -> str:
    """Return the port that was given, or the only one that has a USB plug.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    from servotwin.bench.backends import serial_ports

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


# --- `servotwin bench calibrate`: what a multimeter and a dial say of the bench, with standard errors -----------------

_LOOK = 0.5  # s over which counts are averaged
_ANGLES, _FEWEST = 7, 4  # positions, unless they are given; a table needs as many
_WHAT = ("reference", "supply", "shunt", "angle")
_SET = {"reference": "Put a voltage at A3, below the reference; what does the meter say",
        "supply": "Set a supply voltage; what does the meter say",
        "shunt": "Draw a current through the shunt; what does the meter say"}
_EXAMPLE = {"reference": "1.213V", "supply": "6.02V", "shunt": "0.35A"}


@usual("port", "wiring", "meter", "range", "voltage", "current-limit", "servo", "out", "force", "json")
@with_records
def calibrate(
    *,
    what: Annotated[str, typer.Argument(
        help="reference (of the converter), supply (its divider), shunt, or angle (of the servo, by a dial).")],
    port: PortOption = None,
    wiring: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="Wires of the bench; what is measured is written into it.",
        rich_help_panel=BENCH)] = None,
    meter: Annotated[str | None, typer.Option(
        metavar="VALUES", help="What the meter or the dial says at each point, with commas, instead of a question; "
        "the points are taken one after the other.", rich_help_panel=BENCH)] = None,
    allowed: _Allowed,
    servo: Annotated[str | None, typer.Option(
        metavar="ID", help="Servo that takes what the angles say.", rich_help_panel=SAID)] = None,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Of angle: the servo (.toml) or the table of readings (.csv).",
        rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Calibrate one thing of the bench."""
    from servotwin.bench.backends import SerialBackend
    from servotwin.bench.recording import AnalogRig

    if what not in _WHAT:
        raise UnknownNameError("calibration", what, _WHAT)
    for given, option in ((out, "--out"), (allowed.span, "--range"), (servo, "--servo")):
        if given is not None and what != "angle":
            raise InputError(option, got=f"calibrate {what}", allowed="calibrate angle alone")
    if what != "angle" and wiring is None:
        raise InputError("--wiring", got="none", allowed="the file that takes what is measured, new or not")
    if meter is None and not (sys.stdin and sys.stdin.isatty()):
        raise InputError("--meter", got="none", allowed="its values, where nobody can be asked")
    base = wiring_from(wiring if wiring is not None and wiring.exists() else None)
    if what == "angle":
        _angle(AnalogRig(SerialBackend(port_from(port)), base), meter, allowed, servo, out, force=ending.force,
               as_json=ending.as_json)
        return
    rig = AnalogRig(SerialBackend(port_from(port)), _with_channel(base, what))
    found = _wires(rig, what, meter)
    place = Path(wiring or "")
    found.wiring.replace(channels=base.channels).save(place, overwrite=True)
    _show_wiring(found, place, as_json=ending.as_json)


def _with_channel(base: Wiring, what: str) -> Wiring:
    from servotwin.bench.recording.bench_wiring import CHANNEL

    return base.replace(channels=tuple(dict.fromkeys((*base.channels, CHANNEL[what]))))


def _wires(rig: AnalogRig, what: str, meter: str | None) -> Calibration:
    """Read a channel at each value of the meter; nothing moves."""
    from servotwin.bench.recording import calibrated
    from servotwin.bench.recording.bench_wiring import CHANNEL, UNIT
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


def _show_wiring(found: Calibration, place: Path, *, as_json: bool) -> None:
    values = {name: getattr(found.wiring, name) for name in found.changed}
    if as_json:
        emit_json({"wiring": str(place), "remarks": list(found.remarks),
                   **{name: {"value": one.value, "std": one.std, "unit": one.unit} for name, one in values.items()}})
        return
    rows = [(name, f"{one.value:.5g} {one.spread} {one.unit}") for name, one in values.items()]
    show(pairs([*rows, ("written", str(place))]), *(f"- {text}" for text in found.remarks))


def _angle(rig: AnalogRig, meter: str | None, allowed: _Allowed, servo: str | None, out: Path | None, *, force: bool,
           as_json: bool) -> None:
    """Move the servo from place to place, read the tap, and take the angle of a dial."""
    from servotwin.bench import calibrate_table
    from servotwin.cli.fit_report import calibration_facts, show_table_calibration
    from servotwin.cli.output_files import Target, check_targets
    from servotwin.parameters import load_servo, write_file
    from servotwin.tables import csv_text

    limits = allowed.limits("pulse_width")
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


# --- `servotwin bench paper`: the paper's five voltages through the emulated bench, beside Table II -------------------

_TABLE = "urrea-kern-table-2"
_FRAME = 1.0 / 61.0  # s, as Table II prints it
_SHOWN = 3  # pulses
_PICTURES = ((0, 22), (2, 23), (4, 24))  # row of the table, number of the paper's figure


def bench_paper(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for table and oscilloscope pictures.")] = Path(
        "bench-paper"),
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Run the paper's bench in emulation."""
    from servotwin.bench import compare
    from servotwin.bench.emulator.plant import chain_rows
    from servotwin.parameters import load_dataset
    from servotwin.plotting import save
    from servotwin.tables import csv_text

    names = ["table-2.csv", *(f"oscilloscope-{number}.png" for _, number in _PICTURES)]
    files = _files(out, names, force=force)
    columns = load_dataset(_TABLE).columns
    with patience("emulating the bench"):
        rows = chain_rows([float(v) for v in columns["V_i_V"]])
    off = compare(rows, columns)
    facts = [_facts(row) for row in rows]
    text = csv_text({name: [one[name] for one in facts] for name in facts[0]})
    files[0].write_text(text, encoding="utf-8")
    for (k, _), file in zip(_PICTURES, files[1:], strict=True):
        save(_oscilloscope(rows[k], 1e-6 * float(columns["t_a_us"][k])), file, overwrite=True)
    if as_json:
        emit_json({"rows": facts, "differences": [one._asdict() for one in off], "files": [str(f) for f in files]})
        return
    header = ("V_i", "ADC_i", "t_a", "q", "V_o", "ADC_o", "display after an approach from below")
    made = [(f"{one['V_i_V']:.3f} V", _beside(one["ADC_i"], d.command_count),
             _beside(one["t_a_us"], round(1e6 * d.pulse_width), "us"),
             _beside(one["q_deg"], math.degrees(d.output_angle), "deg", 2),
             _beside(one["V_o_V"], d.feedback_voltage, "V", 3), _beside(one["ADC_o"], d.feedback_count),
             " | ".join(row.displays[0])) for one, d, row in zip(facts, off, rows, strict=True)]
    show("emulated (less Table II of the paper)", "", table(header, made), "",
         "written: " + ", ".join(map(str, files)))


def _files(out: Path, names: Sequence[str], *, force: bool) -> list[Path]:
    if out.exists() and not out.is_dir():
        raise OutputError(f"--out {out} is no folder")
    files = [out / name for name in names]
    for file in files:
        if file.exists() and not force:
            raise OutputExistsError(file)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"--out {out} cannot be made ({error.strerror})") from None
    return files


def _facts(row: ChainRow) -> dict[str, Any]:
    one = row.reading
    return {"V_i_V": one.command_voltage, "ADC_i": one.command_count, "t_a_us": round(1e6 * one.pulse_width),
            "f_Hz": round(one.pulse_rate, 3), "q_deg": math.degrees(one.output_angle),
            "V_o_V": one.feedback_voltage, "ADC_o": one.feedback_count}


def _beside(value: float, off: float, unit: str = "", digits: int = 0) -> str:
    shown = f"{value:.{digits}f} {unit}".rstrip()
    return f"{shown} ({off:+z.{digits}f})"


def _oscilloscope(row: ChainRow, printed: float) -> Figure:
    """Draw the last pulses at the pin, and below them what Table II prints."""
    from servotwin.plotting.panels import Train, pulses

    start = row.pulses[0][0]
    edges, widths = [rise - start for rise, _ in row.pulses[:_SHOWN]], [width for _, width in row.pulses[:_SHOWN]]
    paper = Train(f"Table II: {1e6 * printed:.0f} µs, 61 Hz", [k * _FRAME for k in range(len(edges))],
                  [printed] * len(edges))
    return pulses(edges, widths, frame_period=edges[1], beside=paper, label="pin of the emulated board")


# --- `servotwin bench marker` and `servotwin bench video`: the angle of a horn out of a phone's clip ------------------

_MARKER_PICTURES = (".svg", ".pdf", ".png")
_ZERO, _TIME = "Angle", "Time"  # panels of the help

MARKER_HELP = "Print a mark for the horn, whose angle `servotwin bench video` reads."
MARKER_EPILOG = "Example: servotwin bench marker --side 20mm --out horn.pdf"
VIDEO_HELP = "Read the angle of a marked horn out of a phone's clip."
VIDEO_EPILOG = "Example: servotwin bench video clip.mp4 --log step.csv --instant led --out filmed.csv"


def marker(
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where to write it: .svg, .pdf or .png, at its true size.")],
    side: Annotated[str, typer.Option(metavar="LENGTH", help="Of the black square, such as 20mm; the piece to cut out "
                                      "is half as large again.")] = "20mm",
    mark: Annotated[int, typer.Option("--id", metavar="ID", help="0 for the horn, 1 for the case.")] = 0,
    dpi: Annotated[float, typer.Option(metavar="NUMBER", help="Pixels an inch of a .png.")] = 600.0,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a mark with a ruler that checks the printer."""
    from servotwin.bench.video import mark_bytes
    from servotwin.cli.output_files import Target, check_targets, staged
    from servotwin.units.quantities import quantity

    length = quantity("--side", side, "length", positive=True)
    targets = [Target(option="--out", path=out, endings=_MARKER_PICTURES)]
    check_targets(targets, force=force)
    content = mark_bytes(out.suffix.lower()[1:], side=length, mark=mark, dpi=dpi)
    with staged(targets, force=force) as drafts:
        drafts[0].write_bytes(content)
    show(pairs([("mark", f"{mark}, black side {1e3 * length:g} mm"), ("written", str(out))]),
         "  Print it at 100 % on plain paper and measure the bar: it is 50 mm long.")


@usual("log", "instant", "led", "slow", "zero", "out", "force", "json")
@with_records
def video(
    *,
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="The clip, such as .mp4 or .mov.")],
    out: Annotated[Path, typer.Option(metavar="FILE.csv", help="Where to write the log; its sidecar is put beside it.",
                                      rich_help_panel=shared.OUTPUT)],
    log: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="The recorder's log of the same run, which has "
                                             "the command; a fit needs it.", rich_help_panel=_TIME)] = None,
    mend: Annotated[list[str] | None, typer.Option(
        metavar="KIND", help="What to put right in the recorder's log first, see servotwin log; repeatable.",
        rich_help_panel=_TIME)] = None,
    instant: Annotated[str | None, typer.Option(metavar="led|jump|none|TIME", help=(
        "Where clip and log meet: a light that goes on at the log's time 0, the first motion (which is that after the "
        "first change of the command), the first picture, or a time in the clip such as 1.25s (default: jump; led "
        "with --led)."), rich_help_panel=_TIME)] = None,
    led: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Where the light is in the picture, in pixels from "
                                            "its upper left corner.", rich_help_panel=_TIME)] = None,
    slow: Annotated[float, typer.Option(metavar="FACTOR", help="By how much the clip plays slower than it was filmed: "
                                        "8 for 240 pictures a second that play at 30.", rich_help_panel=_TIME)] = 1.0,
    mark: Annotated[int, typer.Option("--id", metavar="ID", help="Of the mark on the horn.",
                                      rich_help_panel=_ZERO)] = 0,
    zero: Annotated[str | None, typer.Option(metavar="ANGLE", help=(
        "Angle in the first picture, such as 12deg (default: counted from the mark on the case, else from the "
        "picture's horizontal)."), rich_help_panel=_ZERO)] = None,
    flip: Annotated[bool, typer.Option("--flip", help="Count clockwise, as the camera sees it, as positive.",
                                       rich_help_panel=_ZERO)] = False,
    ending: shared.Ending,
) -> None:
    """Write the angle of a marked horn as a log."""
    from servotwin.bench.video import read_clip
    from servotwin.bench.video.film_log import film_log
    from servotwin.cli.fit_report import reading_mends
    from servotwin.cli.output_files import Target, check_targets
    from servotwin.logs.sidecar import sidecar_path
    from servotwin.units.quantities import quantity

    targets = [Target(option="--out", path=out, endings=(".csv",)),
               Target(option="--out, its sidecar", path=sidecar_path(out), endings=(".json",))]
    check_targets(targets, force=ending.force, inputs=[clip] if log is None else [clip, log])
    options: dict[str, Any] = {
        "mark": mark, "flip": flip, "slow": slow, "instant": _instant(instant, led), "led": _region(led),
        "zero": None if zero is None else quantity("--zero", zero, "angle")}
    with patience(f"looking at {clip}"):
        filmed = read_clip(clip, **options)
    made = film_log(filmed, log, mend=reading_mends(mend))
    _write(targets, made.text, json_text(made.sidecar) + "\n", force=ending.force)
    remarks = [*filmed.remarks, *made.remarks]
    files = [str(target.path) for target in targets]
    if ending.as_json:
        emit_json({"video": dict(made.sidecar["recorded"]["video"]), "remarks": remarks, "files": files})
        return
    _show(filmed, remarks, files, commanded=log is not None)


def _region(words: str | None) -> Region | None:
    if words is None:
        return None
    parts = [part.strip() for part in words.split(",")]
    if len(parts) != 4 or not all(part.isascii() and part.isdigit() for part in parts):
        raise InputError("--led", got=words, allowed="X,Y,W,H in whole pixels, such as 620,80,24,24")
    left, top, width, height = map(int, parts)
    return left, top, width, height


def _instant(words: str | None, led: str | None) -> str | float:
    from servotwin.units.quantities import quantity

    if led is not None and words not in (None, "led"):
        raise InputError("--led", got=f"with --instant {words}", allowed="--instant led, or none at all")
    if words is None:
        return "jump" if led is None else "led"
    if words in ("led", "jump", "none"):
        return words
    if not any(c.isdigit() for c in words):
        raise InputError("--instant", got=words, allowed="led, jump, none, or a time in the clip, such as 1.25s")
    return quantity("--instant", words, "time")


def _write(targets: list[Target], text: str, sidecar: str, *, force: bool) -> None:
    from servotwin.cli.output_files import staged

    with staged(targets, force=force) as drafts:
        drafts[0].write_bytes(text.encode())
        drafts[1].write_bytes(sidecar.encode())


def _show(filmed: Filmed, remarks: list[str], files: list[str], *, commanded: bool) -> None:
    facts = filmed.facts
    rows = [
        ("clip", f"{facts['pictures']} pictures of {facts['width_px']} x {facts['height_px']} in "
                 f"{facts['seconds']:.3f} s, {facts['shortest_interval_s'] * 1e3:.1f} to "
                 f"{facts['longest_interval_s'] * 1e3:.1f} ms apart"),
        ("mark", f"{facts['mark']}, {facts['side_px']:.0f} pixels wide, seen in {facts['seen']} pictures, tilted by "
                 f"{facts['tilt_deg']:.0f} deg"),
        ("angle", f"standard error {facts['angle_std_deg']:.3f} deg at rest; {facts['turned']}, from {facts['zero']}"),
        ("time 0", f"{filmed.instant.kind}, at {filmed.instant.time:.4f} s of the clip, standard error "
                   f"{1e3 * filmed.instant.error:.1f} ms")]
    rows += [("remark", one) for one in remarks]
    if not commanded:
        rows.append(("remark", "there is no command in it: --log, with the recorder's log, makes it one for a fit"))
    show(pairs([*rows, *(("written", name) for name in files)]))


# --- `servotwin bench record` and `rehearse`: experiments on a bench, or on an emulated one, become logs --------------

_FIDELITIES = ("pulse", "pulse-inductive", "digital")
_SLICE = 0.1  # s


@usual("port", "bus", "experiment", "range", "voltage", "current-limit", "out", "force", "json")
@with_records
def record(
    *,
    servo: Annotated[str, typer.Argument(
        help="What is on the bench: catalog id or servo file (.toml), or any words where the logs are for others.")],
    out: OutOption,
    port: PortOption = None,
    bus: Annotated[str | None, typer.Option(
        metavar="FAMILY", help="Bus servos at a USB adapter instead of a board: feetech or dynamixel.",
        rich_help_panel=BENCH)] = None,
    identity: Annotated[list[int] | None, typer.Option(
        "--id", metavar="NUMBER", help="Of a servo on the bus, repeatable: all move at once, and each has its log; the "
        "only one that answers unless given.", rich_help_panel=BENCH)] = None,
    baud: Annotated[int | None, typer.Option(
        metavar="BIT/S", help="Of the bus; found unless given.", rich_help_panel=BENCH)] = None,
    wiring: WiringOption = None,
    course: _Course,
    allowed: _Allowed,
    about: _About,
    ending: Ending,
) -> None:
    """Record experiments."""
    from servotwin.cli.bench_jobs import Files, OneServo, SeveralServos, bus_of, recorded

    kind = "pulse_width" if bus is None else "angle"
    if bus is None and (identity or baud is not None):
        raise InputError("--id" if identity else "--baud", got="no --bus",
                         allowed="with --bus feetech or dynamixel")
    limits = allowed.limits(kind)
    said, period = about.of(servo), course.period
    made = course.experiments(limits, servo)
    files = Files(out, limits, said, ending.force)
    files.check(made, identity or [])
    job: Job
    if bus is None:
        from servotwin.bench.backends import SerialBackend
        from servotwin.bench.recording import AnalogRig

        job = OneServo(AnalogRig(SerialBackend(port_from(port)), wiring_from(wiring), rate=course.rate), files)
    else:
        job = SeveralServos(bus_of(bus, port_from(port), identity or [], baud, period), files)
    with files.made():
        done = recorded(job, made)
    _report(done, out, servo, job, as_json=ending.as_json)


@usual("experiment", "range", "voltage", "current-limit", "duration", "wiring", "out", "pty", "force", "json")
@with_records
def rehearse(
    *,
    servo: shared.ServoArgument,
    out: Annotated[Path | None, typer.Option(
        metavar="FOLDER", help="Folder for the logs, made if it is not there.", rich_help_panel=shared.OUTPUT)] = None,
    pty: Annotated[bool, typer.Option(
        "--pty", help="Offer the board as a serial port in real time, for any program, until Ctrl-C.",
        rich_help_panel=BENCH)] = False,
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="pulse, pulse-inductive or digital (default: by the kind of the servo).",
        rich_help_panel=BENCH)] = None,
    change: Annotated[list[str] | None, typer.Option(
        "--set", metavar="NAME=VALUE", help="Replace a parameter of the servo that is emulated; repeatable.",
        rich_help_panel=BENCH)] = None,
    noise: Annotated[str, typer.Option(
        metavar="VOLTS", help="Noise at each pin, one standard deviation (assumed).",
        rich_help_panel=BENCH)] = "1mV",
    mock: Annotated[bool, typer.Option(
        "--mock", help="A board in Python instead of the firmware itself under simavr.",
        rich_help_panel=BENCH)] = False,
    wiring: WiringOption = None,
    course: _Course,
    allowed: _Allowed,
    about: Annotated[_About, {"licence": LEFT_OUT, "author": LEFT_OUT, "note": LEFT_OUT}],
    ending: Ending,
) -> None:
    """Record experiments from an emulated bench."""
    from servotwin.bench.rehearsal import rehearsal_rig
    from servotwin.cli.bench_jobs import Files, OneServo, recorded
    from servotwin.cli.option_values import load_from
    from servotwin.cli.shared_options import model_of
    from servotwin.units.quantities import quantity

    if (out is None) is not pty or (pty and mock):
        raise InputError("--pty" if pty else "rehearse",
                         got=("with --mock" if mock else "with --out") if pty else "neither --out nor --pty",
                         allowed="--out FOLDER for logs, or --pty alone for a port")
    if out is None:
        board = model_of(servo, model, change or [], _FIDELITIES)
        _offered(board, load_from(about.load, board), wiring_from(wiring),
                 noise=quantity("--noise", noise, "voltage"), seed=course.seed)
        return
    limits = allowed.limits("pulse_width")
    whole = model_of(servo, model, [*(change or []), f"supply.open_circuit_voltage={limits.voltage}V"], _FIDELITIES)
    said = replace(about, licence="CC0-1.0", note="no real servo: the firmware of the bench under simavr, beside a "
                   "simulated servo").of(f"{servo} (emulated)")
    made = course.experiments(limits, servo)
    files = Files(out, limits, said, ending.force)
    files.check(made, [])
    rig, remark = rehearsal_rig(whole, load_from(about.load, whole), wiring_from(wiring), rate=course.rate, mock=mock,
                                noise=quantity("--noise", noise, "voltage"), seed=course.seed)
    if remark:
        warnings.warn(remark, stacklevel=2)
    job = OneServo(rig, files)
    with files.made():
        done = recorded(job, made)
    _report(done, out, servo, job, as_json=ending.as_json)


def _offered(model: Model, load: Load, wiring: Wiring, *, noise: float, seed: int) -> None:
    """Let any program talk to the board, until Ctrl-C."""
    from servotwin.bench.emulator.pseudo_terminal import Terminal
    from servotwin.bench.rehearsal import rehearsal_board

    board, _ = rehearsal_board(model, load, wiring, noise=noise, seed=seed, real_time=True)
    with Terminal(board) as terminal:
        emit(f"the board is at {terminal.port}, until Ctrl-C; try "
             + typed("servotwin", "bench", "check", "--port", terminal.port))
        while True:
            terminal.serve(_SLICE)


def _advised(limits: Limits, servo: str, frame_period: float) -> Experiment:
    """Return the command that would tell most of this servo, fitted into the range."""
    import numpy as np

    from servotwin.bench.recording import Experiment, Hold, of_log
    from servotwin.identification import advise
    from servotwin.parameters import load_servo

    with patience("simulating experiments"):
        best = advise(load_servo(servo), voltages=[limits.voltage], sensors=()).experiments[0]
    asked = of_log(best.command, name=best.motion.replace(" ", "_"), frame_period=frame_period)
    values = np.array([one.value for one in asked.holds if one.value is not None])
    low, high = float(values.min()), float(values.max())

    def fitted(value: float | None) -> float | None:
        return None if value is None else limits.at((value - low) / (high - low) if high > low else 0.5)

    holds = [Hold(max(round(one.duration / frame_period), 1) * frame_period, fitted(one.value)) for one in asked.holds]
    return Experiment(name=asked.name, motion=asked.motion, kind=limits.kind, holds=holds, frame_period=frame_period,
                      conditions={"advised": f"{best.motion}, {best.load}"})


def _report(found: Sequence[Recorded], out: Path, servo: str, job: Job, *, as_json: bool) -> None:
    facts = job.facts()
    if as_json:
        emit_json({"logs": [{"path": str(one.path), "rows": one.rows, "seconds": one.duration} for one in found],
                   "rig": facts})
        return
    rows = [(str(one.path), str(one.rows), f"{one.duration:.2f} s") for one in found]
    lost = facts.get("lost_frames", 0)
    remark = [f"{lost} frames of the wire were lost: there are gaps in the rows"] if lost else []
    show(table(("log", "rows", "time"), rows), *remark, "", "next: " + typed("servotwin", "fit", out, "--servo", servo))


# --- `servotwin bench`: a real servo on a board, or the firmware of the board in emulation, and what they -------------


bench = Commands(
    help="Record logs of a real servo, or rehearse it with an emulated board.",
    epilog="Example: servotwin bench rehearse hitec-hs-755hb --range 1000us:2000us --voltage 6V --current-limit 2A "
           "--out rehearsal")


@bench.callback(invoke_without_command=True)
def _bench(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@bench.command("list", help="List serial ports, and which tools of the bench are installed.",
               epilog="Example: servotwin bench list")
def list_ports(as_json: shared.JsonOption = False) -> None:
    """List ports and tools."""
    from servotwin.bench.backends import serial_ports

    found = serial_ports()
    tools = {"avrdude": "flash", "cc": "rehearse, with libsimavr-dev and libelf-dev"}
    there = {name: shutil.which(name) or "" for name in tools}
    if as_json:
        emit_json({"ports": [one._asdict() for one in found], "tools": there})
        return
    ports = [(one.device, one.identity or "-", one.description) for one in found]
    show(table(("port", "USB", "what it says of itself"), ports) if ports else "no serial port on this computer", "",
         pairs([(name, (there[name] or "not installed") + f" (for {use})") for name, use in tools.items()]))


@bench.command(help="Ask the board who it is, and read its channels.",
               epilog="Example: servotwin bench check --port /dev/ttyUSB0 --wiring bench.toml")
def check(port: PortOption = None, wiring: WiringOption = None, as_json: shared.JsonOption = False) -> None:
    """Ask the board how it does; nothing moves."""
    from servotwin.bench.backends import SerialBackend
    from servotwin.bench.recording import AnalogRig

    rig = AnalogRig(SerialBackend(port_from(port)), wiring_from(wiring))
    with contextlib.closing(rig):
        identity = rig.open()
        channels = _channels(rig)
        status = dict(rig.board.order("ask"))
    wire = {"bad_frames": rig.board.splitter.bad, "lost_frames": rig.board.splitter.lost,
            "bad_frames_board": status["bad"], "dropped_frames": status["dropped"], "late_edges": status["late"]}
    if as_json:
        emit_json({"port": rig.board.backend.name, "firmware": identity.firmware, "mode": identity.mode,
                   "channels": channels, **wire})
        return
    rows = [(name, f"{one['count']:.2f}", f"{one['std_count']:.2f}", f"{one['value']:.4g} {one['unit']}")
            for name, one in channels.items()]
    remarks = [f"- {name} is at the end of the converter; is it wired, and its divider right?"
               for name, one in channels.items() if (one["count"] < 1.0 and name != "shunt") or one["count"] > 1021.0]
    show(pairs([("board", rig.board.backend.name), ("firmware", identity.firmware), ("mode", identity.mode),
                ("wire", ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in wire.items()))]), "",
         table(("channel", "count", "noise", "which is"), rows), *remarks)


def _channels(rig: AnalogRig) -> dict[str, dict[str, Any]]:
    import statistics

    made = {}
    for name, counts in rig.measure(_LOOK).items():
        mean = statistics.fmean(counts)
        made[name] = {"count": mean, "std_count": statistics.pstdev(counts), "value": rig.wiring.value(name, mean),
                      "unit": "A" if name == "shunt" else "V"}
    return made


@bench.command(help="Put the firmware onto an Uno or a Nano, by avrdude.",
               epilog="Example: servotwin bench flash --port /dev/ttyUSB0 --board nano")
def flash(
    port: PortOption = None,
    board: Annotated[str, typer.Option(
        metavar="BOARD", help="uno, nano, or nano-old (the boot loader of old ones and of most copies).")] = "nano",
) -> None:
    """Flash the firmware."""
    from servotwin.bench.flash import flash as put

    where = port_from(port)
    put(where, board)
    emit(f"the firmware of the bench is on the board at {where}; next: "
         + typed("servotwin", "bench", "check", "--port", where))


_RANGE = "--range 1000us:2000us --voltage 6V --current-limit 0.8A"
bench.command("calibrate", help="Measure the wires of the bench with a multimeter, or angle over tap with a dial.",
              epilog="Example: servotwin bench calibrate supply --wiring bench.toml\n\n"
                     "Example: servotwin bench calibrate angle --range 1000us:2000us --voltage 6V "
                     "--current-limit 0.8A --servo hitec-hs-422 --out my-servo.toml")(calibrate)
bench.command("record", help="Record experiments with a servo into logs that servotwin fit reads.",
              epilog=f"Example: servotwin bench record hitec-hs-422 --experiment steps,chirp {_RANGE} --out runs\n\n"
                     "Example: servotwin bench record feetech-sts3215-12v --bus feetech --id 1 --range -60deg:60deg "
                     "--voltage 12V --current-limit 1.5A --out runs")(record)
bench.command("rehearse", help="Record experiments from an emulated bench: the firmware itself beside a simulated "
              "servo.",
              epilog=f"Example: servotwin bench rehearse hitec-hs-755hb -e steps,chirp {_RANGE} --out rehearsal"
              )(rehearse)
bench.command("paper", help="Run the paper's five voltages through the emulated bench, beside its Table II.",
              epilog="Example: servotwin bench paper --out bench-paper")(bench_paper)
bench.command("marker", help=MARKER_HELP, epilog=MARKER_EPILOG)(marker)
bench.command("video", help=VIDEO_HELP, epilog=VIDEO_EPILOG)(video)
