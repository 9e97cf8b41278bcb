"""`servotwin catalog`: which servos there are, what is known of one, and what a servo file gives."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import Commands, usual, with_records
from servotwin.cli.robot_options import ContactOption, PackageOption, as_options, overlap_of, packages_of
from servotwin.cli.terminal import emit_help, emit_json, pairs, patience, show, table, with_span
from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.cli.which_words import Judged, Prices
    from servotwin.datasheet.choice import Limits
    from servotwin.identification import Sheet
    from servotwin.parameters import Servo, Supply
    from servotwin.robots import Motion
    from servotwin.robots.model_file import Plant


# --- `servotwin catalog registers` ------------------------------------------------------------------------------------

def registers(
    model: Annotated[str | None, typer.Argument(
        metavar="MODEL", help="A model such as XL330-M288; none: all models, and how many values are assumed.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the registers of bus servos."""
    if model is None:
        _all(as_json=as_json)
    else:
        _one(model, as_json=as_json)


def _all(*, as_json: bool) -> None:
    from servotwin.parameters.registers.listing import listed_models

    found = [{"family": each.family, "model": each.name, "number": each.number, "registers": each.rows,
              "assumed": each.assumed, "page": each.page} for each in listed_models()]
    if as_json:
        emit_json(found)
        return
    rows = [(str(each["family"]), str(each["model"]), str(each["number"]), str(each["registers"]),
             str(each["assumed"]), str(each["page"]) or "none was seen") for each in found]
    show(table(("family", "model", "number", "registers", "assumed", "page"), rows))


def _one(name: str, *, as_json: bool) -> None:
    from servotwin.parameters.registers.listing import listed_model, rows_of

    model = listed_model(name)
    rows: list[dict[str, Any]] = [row._asdict() for row in rows_of(model)]
    facts = {"family": model.family, "model": model.name, "number": model.number, "registers": model.rows,
             "assumed": model.assumed, "page": model.page}
    if as_json:
        emit_json({**facts, "rows": rows})
        return
    show(pairs([("family", model.family), ("model number", str(model.number)), ("page", model.page or "none was seen"),
                ("registers", f"{model.rows}, {model.assumed} of them assumed")]), "",
         table(("address", "register", "new", "range", "printed in"),
               [(str(row["address"]), row["name"], str(row["value"]), f"{row['lower']} to {row['upper']}",
                 row["document"] or "assumed") for row in rows]))


# --- `servotwin catalog which` ----------------------------------------------------------------------------------------

_WHY = {"torque": "lack the torque", "time": "are too slow", "voltage": "are not for this voltage",
        "current": "draw too much", "mass": "are too heavy", "travel": "do not travel so far",
        "kind": "are of another kind", "price": "cost too much", "motion": "do not follow the motion"}
_MOST = 8  # candidates of which what takes seconds is simulated, unless they are named
_USUAL = "6"  # V
_TASK, _LIMITS = "Task", "Candidates and limits"


@dataclass(frozen=True, kw_only=True)
class _Asked:
    """The task, its supply and its limits."""

    lift: tuple[float, float] | None
    motion: Motion | None
    plant: Plant | None
    robot: str | None
    joints: tuple[str, ...]
    at: Supply | float
    bus: Supply | None
    limits: Limits
    named: bool
    overlap: str

    @property
    def words(self) -> str:
        """The task in words."""
        parts = []
        if self.lift is not None:
            mass, arm = self.lift
            parts.append(f"{1e3 * mass:.4g} g on {1e2 * arm:.4g} cm ({mass * 9.80665 * arm:.3g} N m)")
        if self.robot is not None:
            parts.append(self.robot)
        if self.motion is not None:
            parts.append(f"{self.motion.source}, {self.motion.duration:.4g} s")
        parts = [" along ".join(parts) or "any task"]
        volts = self.at if isinstance(self.at, float) else self.at.open_circuit_voltage
        parts.append(f" at {volts:g} V")
        if self.bus is not None and self.bus.current_limit is not None:
            parts.append(f", {self.bus.current_limit:g} A")
        if self.limits.time is not None:
            parts.append(f", 60 deg within {self.limits.time:g} s")
        return "".join(parts)


@dataclass(frozen=True, kw_only=True)
class _Task:
    """The options that say what is to be done, as they were typed."""

    lift: Annotated[str | None, typer.Option(
        metavar="MASS", help="Mass to lift, such as 0.5kg, 120g, 4oz or 1lb; with --arm.",
        rich_help_panel=_TASK)] = None
    arm: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="Length of the arm, such as 10cm, 80mm or 4in.", rich_help_panel=_TASK)] = None
    motion: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Motion to follow, a table with time_s and a column such as arm_deg: of the arm of "
        "--lift, horizontal at 0, or of the joints of --robot.", rich_help_panel=_TASK)] = None
    robot: Annotated[str | None, typer.Option(
        metavar="MODEL.xml", help="Robot whose joints follow --motion: MJCF or URDF file, or so101. Each candidate is "
        "put at all of its hinges.", rich_help_panel=_TASK)] = None
    contact: ContactOption = None
    package: PackageOption = ()
    joint: Annotated[Sequence[str], typer.Option(
        metavar="NAME", help="Joint of the motion that counts, repeatable (default: all).", rich_help_panel=_TASK)] = ()
    voltage: Annotated[str | None, typer.Option(
        metavar="VOLTS", help=f"Supply voltage (default: {_USUAL}).", rich_help_panel=_TASK)] = None
    supply: shared.SupplyOption = None


@dataclass(frozen=True, kw_only=True)
class _Bounds:
    """The options that say which servos are candidates, and what they may cost, as they were typed."""

    among: Annotated[Sequence[str], typer.Option(
        metavar="ID", help="Candidates, with commas or repeatable: catalog ids, or paths of servo files (default: the "
        "catalog, or the servos of --prices).", rich_help_panel=_LIMITS)] = ()
    limit: Annotated[Sequence[str], typer.Option(
        metavar="NAME=VALUE", help="Limit, repeatable or with commas: current=1A, mass=60g, time=0.2s, price=20 at "
        "most; travel=180deg at least; voltage=7.4V, which the sheet has to reach; kind=analog, digital or bus.",
        rich_help_panel=_LIMITS)] = ()
    prices: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Prices: columns servo and price, or such as price_EUR.",
        rich_help_panel=_LIMITS)] = None
    time: Annotated[str | None, typer.Option(
        metavar="SECONDS", help="Longest time allowed for 60 degrees, as --limit time=: with --lift from 30 below the "
        "horizontal to 30 above, else without load.", rich_help_panel=_LIMITS)] = None
    register: shared.RegisterOption = ()


@usual("lift", "arm", "motion", "robot", "voltage", "limit", "prices", "why", "json")
@with_records
def which(
    *,
    task: _Task,
    bounds: _Bounds,
    why: Annotated[bool, typer.Option(
        "--why", help="Also list the servos that cannot, and why.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """List the servos that do a task within limits, side by side, and say why the others do not."""
    from servotwin.cli.option_values import asked_lift
    from servotwin.cli.which_words import limits_of, prices_of

    limits, prices = limits_of(bounds.limit, bounds.time), bounds.prices
    shop = None if prices is None else prices_of(prices)
    named = [name.strip() for word in bounds.among for name in word.split(",") if name.strip()]
    at, bus = _supply(task.voltage, task.supply)
    weight = asked_lift(task.lift, task.arm)
    if not (weight or task.motion or task.robot or task.joint or bounds.limit or bounds.time or bounds.among or prices):
        raise _nothing()
    plant, followed = _motion(task.motion, task.robot, task.joint, weight, task.package)
    asked = _Asked(lift=weight, motion=followed, plant=plant, robot=task.robot, joints=tuple(task.joint), at=at,
                   bus=bus, limits=limits, named=bool(named), overlap=overlap_of(task.contact))
    found = _judged(_servos(named, shop, prices, limits, bounds.register), asked, shop)
    if as_json:
        emit_json(_facts(asked, found))
        return
    show(asked.words, *_told(found, asked, shop, why=why))


def _nothing() -> Exception:
    return InputError("nothing is asked", allowed="--lift MASS --arm LENGTH, --motion FILE, --limit NAME=VALUE or "
                      "--among ID,ID")


def _supply(voltage: str | None, supply: str | None) -> tuple[Supply | float, Supply | None]:
    from servotwin.parameters import Supply
    from servotwin.units.quantities import quantity

    if supply is None:
        return quantity("--voltage", voltage or _USUAL, "voltage", bare=True, positive=True), None
    if voltage is not None:
        raise InputError("--supply", got=f"also --voltage {voltage}", allowed="one of them")
    found = Supply.of(supply, what="--supply")
    return found, found


def _motion(path: Path | None, robot: str | None, joints: Sequence[str], lift: tuple[float, float] | None,
            packages: Sequence[str]) -> tuple[Plant | None, Motion | None]:
    """Return robot and motion; without a robot that of an arm, whose joint is the column of the table."""
    if path is None:
        if robot is not None or joints:
            raise InputError("--robot" if robot is not None else "--joint", allowed="--motion FILE beside it")
        return None, None
    from servotwin.robots import joint_names, joint_ranges, read_motion
    from servotwin.robots.choice import arm_of, moved_joints
    from servotwin.robots.model_file import plant_of

    if robot is not None and lift is not None:
        raise InputError("--robot", got="also --lift", allowed="one of them: a robot has its own masses")
    plant = plant_of(arm_of(_column(path, joints), lift) if robot is None else robot, packages_of(packages))
    with as_options(), patience(f"reading {path}"):
        found = read_motion(path, joint_names(plant.model), ranges=joint_ranges(plant.model))
    moved_joints(plant, found, joints)
    return plant, found


def _column(path: Path, joints: Sequence[str]) -> str:
    """Return the joint of a table of one joint: its column without the unit."""
    from servotwin.tables import read_table
    from servotwin.units.words import unit_word

    header = [name for name in read_table(path, lambda name: name.startswith("time")).header
              if name and not name.startswith("time")]
    names = [name.rpartition("_")[0] if "_" in name and unit_word(name.rpartition("_")[2]) else name
             for name in header]
    if joints and joints[0] not in names:
        raise InputError(f"--joint {joints[0]}", got=f"no column of it in {path}", allowed=", ".join(names) or "none")
    if len(names) != 1:
        raise InputError(f"{path}: columns", got=", ".join(header) or "none but time",
                         allowed="time_s and one such as arm_deg; --robot MODEL.xml takes several joints")
    return names[0]


def _servos(named: list[str], shop: Prices | None, file: Path | None, limits: Limits, register: Sequence[str]
            ) -> list[tuple[Servo, float]]:
    """Return the candidates with their prices."""
    from servotwin.cli.shared_options import with_registers
    from servotwin.parameters import catalog_names, load_servo

    if limits.price is not None and shop is None:
        raise InputError("--limit price", allowed="--prices FILE.csv beside it")
    repeated = next((name for name in named if named.count(name) > 1), None)
    if repeated is not None:
        raise InputError("--among", got=f"{repeated!r} twice", allowed="each once")
    names = named or (list(catalog_names()) if shop is None else list(shop.of))
    missing = None if shop is None else next((name for name in names if name not in shop.of), None)
    if missing is not None:
        load_servo(missing)  # an unknown one is said to be that
        raise InputError(f"{file}: price of {missing}", got="none", allowed="a row of each servo of --among")
    found = []
    with patience("reading the catalog"):
        for name in names:
            try:
                servo = load_servo(name)
            except UnknownNameError as error:
                if named:
                    raise
                raise InputError(f"{file}: {error}") from None
            own = with_registers(servo, register) if servo.kind == "bus" else servo
            found.append((own, math.nan if shop is None else shop.of[name]))
    return found


def _judged(servos: Sequence[tuple[Servo, float]], asked: _Asked, shop: Prices | None) -> list[Judged]:
    """Return all candidates in the order in which one would take them: the lightest first, or the cheapest."""
    from dataclasses import replace

    from servotwin.cli.which_words import Judged
    from servotwin.datasheet.choice import candidate, standing_of

    limits = asked.limits if asked.motion is None else replace(asked.limits, current=None)  # that of the run counts
    lift = asked.lift if asked.motion is None else None
    with patience("asking the catalog"):
        found = [Judged(candidate(servo, asked.at, lift=lift, limits=limits, price=price)) for servo, price in servos]
    found.sort(key=lambda each: _order(each, shop))
    if asked.motion is not None:
        with patience("following the motion"):
            found = [_tried(each, asked) for each in found]
    shown = [each for each in found if each.candidate.suits][:None if asked.named else _MOST]
    if asked.named:  # those that do not suit stand beside them too
        shown = [each for each in found if each.candidate.model is not None and not each.candidate.model.endless]
    with patience("simulating where they stand"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        rests = {id(each): standing_of(each.candidate.model, lift, ranges=asked.named) for each in shown
                 if each.candidate.model is not None}
    return [each._replace(rest=rests.get(id(each))) for each in found]


def _tried(each: Judged, asked: _Asked) -> Judged:
    from servotwin.robots.choice import try_motion

    if asked.motion is None or asked.plant is None or each.candidate.model is None or (
            each.candidate.reasons and not asked.named):
        return each
    tried = try_motion(each.candidate, asked.plant, asked.motion, joints=asked.joints, bus=asked.bus,
                       limits=asked.limits, overlap=asked.overlap)
    return each._replace(candidate=tried.candidate, tried=tried)


def _order(each: Judged, shop: Prices | None) -> tuple[Any, ...]:
    """Unknown masses come last."""
    made = each.candidate
    price = 0.0 if shop is None else made.price
    return price, math.isnan(made.mass), made.mass, -made.margin, made.servo.name


def _told(found: list[Judged], asked: _Asked, shop: Prices | None, *, why: bool) -> list[Any]:
    from servotwin.cli import which_words as words

    able = [each for each in found if each.candidate.suits]
    unable = [each.candidate for each in found if not each.candidate.suits]
    shown = found if asked.named else able
    current = asked.limits.current is not None
    parts: list[Any] = ["", table(*words.suiting_table(shown, shop, current=current))] if shown else []
    if not able:
        parts += [*([""] if shown else []), f"no servo of {'these' if asked.named else 'the catalog'} can"]
    if unable and (why or asked.named):
        parts += ["", table(("cannot", "why"), [(each.servo.name, words.why(each)) for each in unable])]
    notes = words.note_pairs(shown)
    parts += ["", pairs(notes)] if notes else []
    count = Counter(each.reasons[0].kind for each in unable)
    cannot = ", ".join(f"{count[kind]} {phrase}" for kind, phrase in _WHY.items() if count[kind])
    if not asked.named:
        parts += ["", f"{len(unable)} cannot: {cannot}" if cannot else "all that were asked can"]
    return [*parts, *_footnotes(shown, asked)]


def _footnotes(shown: list[Judged], asked: _Asked) -> list[str]:
    """Return the notes that the table needs."""
    notes, looked = [], [each for each in shown if each.rest is not None]
    if len(looked) < len(shown) and not asked.named:
        notes.append(f"what takes long is simulated of the first {len(looked)}; --among ID,ID names others")
    if asked.motion is not None and shown:
        notes.append("margin, off by (rms) and draws: the worst joint; 10 min: winding, if the motion is "
                     "repeated")
    elif asked.lift is not None and shown:
        notes.append("10 min: winding, after holding the arm horizontal; droop: below its command there")
    task = asked.motion is not None or asked.lift is not None
    if shown and task and any(each.candidate.servo.thermal.winding_capacity is None for each in shown):
        notes[-1] += "; thermal numbers assumed by mass"
    if any(each.rest is not None and each.rest.move_span is not None for each in looked):
        notes.append("ranges in brackets: with what is assumed at the ends of its range")
    return notes


def _facts(asked: _Asked, found: list[Judged]) -> dict[str, Any]:
    from servotwin.cli.which_words import candidate_facts

    mass, arm = asked.lift or (math.nan, math.nan)
    at = asked.at
    able = [candidate_facts(each) for each in found if each.candidate.suits]
    unable = [candidate_facts(each) for each in found if not each.candidate.suits]
    return {
        "torque": mass * 9.80665 * arm, "supply_voltage": at if isinstance(at, float) else at.open_circuit_voltage,
        "current_limit": None if isinstance(at, float) else at.current_limit,
        "motion": None if asked.motion is None else asked.motion.source, "found": able,
        "refused": [{**each, "kind": each["reasons"][0]["kind"], "reason": each["reasons"][0]["text"],
                     "servo_kind": each["kind"]} for each in unable]}


# --- `servotwin catalog from-sheet`: what a maker prints becomes a servo file -----------------------------------------

_POINT, _WHOLE, _MANY, _OUTPUT = ("At a supply voltage (repeatable)", "Whole servo", "Other ways to give a sheet",
                                  "Result")
_Figures = Sequence[str]


def _at(metavar: str, text: str) -> Any:
    return typer.Option(metavar=metavar, help=text, rich_help_panel=_POINT)


def _of(metavar: str, text: str) -> Any:
    return typer.Option(metavar=metavar, help=text, rich_help_panel=_WHOLE)


@dataclass(frozen=True, kw_only=True)
class _Points:
    """The figures of a sheet at supply voltages, as they were typed."""

    torque: Annotated[_Figures, _at('"1.29 N m @6.0"', "Stall torque: N m, N cm, kgf.cm, oz.in.")] = ()
    speed: Annotated[_Figures, _at('"0.23 s/60deg @6.0"', "No-load speed: s/60deg, deg/s, rad/s, rpm.")] = ()
    running_current: Annotated[_Figures, _at('"285 mA @6.0"', "Current when running without load: A, mA.")] = ()
    stall_current: Annotated[_Figures, _at('"1.8 A @6.0"', "Current with the shaft held still: A, mA.")] = ()
    idle_current: Annotated[_Figures, _at('"9 mA @6.0"', "Current at rest: A, mA.")] = ()
    at: Annotated[str | None, typer.Option(
        metavar="VOLTAGE", help="Supply voltage for figures that do not name one.", rich_help_panel=_POINT)] = None


@dataclass(frozen=True, kw_only=True)
class _Whole:
    """The figures of a sheet of the whole servo, as they were typed."""

    name: Annotated[str | None, _of("ID", "Short id, such as my-servo.")] = None
    title: Annotated[str | None, _of("TEXT", "Name for human readers.")] = None
    voltage_range: Annotated[str | None, _of('"4.8-7.2 V"', "Supply voltages that the maker states.")] = None
    deadband: Annotated[str | None, _of('"8 us"', "Deadband, taken as its full width.")] = None
    pulse_range: Annotated[str | None, _of('"500-2500 us"', "Pulse widths between which the servo turns.")] = None
    travel: Annotated[str | None, _of('"180 deg"', "Angle between these pulses; endless: as --continuous.")] = None
    continuous: Annotated[bool, typer.Option(
        "--continuous", help="Turns without end: a pulse is a speed, the deadband the pulses at which it stands.",
        rich_help_panel=_WHOLE)] = False
    rate: Annotated[str | None, _of('"45 deg/400us"', "Angle per pulse width.")] = None
    neutral: Annotated[str | None, _of('"1500 us"', "Pulse width at the middle position.")] = None
    stops: Annotated[str | None, _of('"200 deg"', "Angle from stop to stop.")] = None
    mass: Annotated[str | None, _of('"40 g"', "Mass: g, kg, oz.")] = None
    gear_ratio: Annotated[str | None, _of("280:1", "Motor turns per output turn.")] = None
    backlash: Annotated[str | None, _of('"0.5 deg"', "Play of the gear.")] = None
    motor_type: Annotated[str, _of("TEXT", "Such as 3-pole or coreless.")] = ""
    modulation: Annotated[str, _of("WORD", "analog, digital or bus.")] = ""
    registers: Annotated[str, _of("WORD", "Of a bus servo: feetech-sts, dynamixel-x, -mx or -ax.")] = ""
    source: Annotated[str, _of("TEXT", "Where the figures come from.")] = ""
    note: Annotated[str, _of("TEXT", "Remark for human readers.")] = ""


@usual("torque", "speed", "stall-current", "at", "name", "travel", "pulse-range", "mass", "csv", "out", "force", "json")
@with_records
def from_sheet(
    *,
    again: Annotated[str | None, typer.Argument(
        metavar="SERVO", help="A servo whose own \\[sheet] to use: catalog id, or path.")] = None,
    points: _Points,
    whole: _Whole,
    list_file: Annotated[Path | None, typer.Option(
        "--csv", metavar="FILE", help="A list of servos, one row for each servo and voltage: maker, model, V, "
        "stall_torque_Nm, speed_s_per_60deg, ... (see the guide).", rich_help_panel=_MANY)] = None,
    plain: Annotated[bool, typer.Option(
        "--plain", help="Leave out play and the gear losses that grow with the load: faster, but too strong.",
        rich_help_panel=_OUTPUT)] = False,
    allow_impossible: Annotated[bool, typer.Option(
        "--allow-impossible", help="Make a servo even from a sheet that contradicts itself, and flag it.",
        rich_help_panel=_OUTPUT)] = False,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="Write the servo file; with --csv, a folder.", rich_help_panel=_OUTPUT)] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=_OUTPUT)] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.", rich_help_panel=_OUTPUT)] = False,
) -> None:
    """Make a servo file from a data sheet."""
    typed = [f"--{option.replace('_', '-')}" for option, given in (asdict(whole) | asdict(points)).items() if given]
    how = {"load_friction": not plain, "backlash": not plain, "allow_impossible": allow_impossible}
    if list_file is not None:
        _one_way("--csv", typed, again)
        _many(list_file, how, out, force=force, as_json=as_json)
        return
    if again is not None:
        _one_way("SERVO", [word for word in typed if word not in ("--name", "--title")], None)
    sheet = _again(again, whole.name, whole.title) if again is not None else _sheet(points, whole)
    weighed = any(unit in text for text in points.torque for unit in ("kg", "oz"))
    _one_sheet(sheet, how, out, weighed=weighed, force=force, as_json=as_json)


def _one_way(way: str, typed: list[str], again: str | None) -> None:
    beside = [*typed, *([again] if again is not None else [])]
    if beside:
        raise InputError(f"{way} holds the sheet already", got=", ".join(beside), allowed="one way to give a sheet")


def _again(servo: str, name: str | None, title: str | None) -> Sheet:
    from dataclasses import replace

    from servotwin.identification import sheet_of
    from servotwin.parameters import load_servo

    sheet = sheet_of(load_servo(servo))
    return replace(sheet, name=name or sheet.name, title=title or (name or sheet.title))


def _sheet(points: _Points, whole: _Whole) -> Sheet:
    from servotwin.cli import option_values as fig
    from servotwin.identification import Sheet
    from servotwin.identification.sheets.sheet import ENDLESS
    from servotwin.units.quantities import quantity

    if not whole.name:
        raise InputError("--name is missing", allowed="a short id, such as --name my-servo")
    usual = None if points.at is None else quantity("--at", points.at, "voltage", bare=True, positive=True)
    endless = (whole.travel or "").strip().lower() in ENDLESS
    lowest, highest = fig.two_ends("--voltage-range", whole.voltage_range, "voltage") if whole.voltage_range else (
        None, None)
    low, high = fig.two_ends("--pulse-range", whole.pulse_range, "time") if whole.pulse_range else (None, None)

    def one(option: str, dimension: str) -> float | None:
        text = getattr(whole, option)
        return None if text is None or (option == "travel" and endless) else quantity(
            f"--{option}", text, dimension, positive=True)

    return Sheet(
        name=whole.name, title=whole.title or "", points=_points(points, usual), pulse_min=low, pulse_max=high,
        voltage_min=lowest, voltage_max=highest, deadband=one("deadband", "time"),
        neutral_pulse=one("neutral", "time"), travel=one("travel", "angle"),
        stop_travel=one("stops", "angle"), mass=one("mass", "mass"), backlash=one("backlash", "angle"),
        angle_per_pulse=fig.rate("--rate", whole.rate) if whole.rate else None,
        gear_reduction=fig.ratio("--gear-ratio", whole.gear_ratio) if whole.gear_ratio else None,
        motor_type=whole.motor_type, modulation=whole.modulation, registers=whole.registers,
        continuous=whole.continuous or endless, source=whole.source, note=whole.note)


def _points(given: _Points, usual: float | None) -> tuple[Any, ...]:
    from servotwin.cli import option_values as fig
    from servotwin.identification import SheetPoint
    from servotwin.units.quantities import quantity

    columns = {"stall_torque": "torque", "no_load_speed": "speed", "no_load_current": "running_current",
               "stall_current": "stall_current", "idle_current": "idle_current"}
    found: dict[float, dict[str, Any]] = {}
    for column, name in columns.items():
        option = f"--{name.replace('_', '-')}"
        for text in getattr(given, name):
            words, volts = fig.without_voltage(option, text, usual)
            value = fig.speed(option, words) if column == "no_load_speed" else quantity(
                option, words, "torque" if column == "stall_torque" else "current", positive=True)
            if column in found.setdefault(volts, {}):
                raise InputError(f"{option} at {volts:g} V",
                                 got=f"two, {found[volts][column]:.4g} and {value:.4g} in SI",
                                 allowed="one figure")
            found[volts][column] = value
    if not found:
        raise InputError("no figures of a sheet are given", allowed="at least --torque and --speed; or --csv, or the "
                         "servo whose [sheet] is taken")
    return tuple(SheetPoint(supply_voltage=volts, **values) for volts, values in sorted(found.items()))


def _one_sheet(sheet: Sheet, how: dict[str, bool], out: Path | None, *, weighed: bool, force: bool,
               as_json: bool) -> None:
    from servotwin.cli.summary import parameter_table
    from servotwin.identification import servo_from_sheet, write_servo_text

    with warnings.catch_warnings():
        if weighed:
            warnings.filterwarnings("ignore", message=".*kgf cm")  # who typed these meant them
        servo = servo_from_sheet(sheet, **how)
    if out is not None:
        write_servo_text(servo, out, overwrite=force)
    with patience("simulating"):
        found = sheet_facts(sheet, servo)
    if as_json:
        emit_json({**found, "files": [] if out is None else [str(out)]})
        return
    parts: list[RenderableType] = [f"{sheet.title} ({sheet.name}), from its sheet", *lines(found)]
    if out is None:
        parts += ["", *parameter_table(found["parameters"])]
    else:
        parts += ["", f"written: {out}"]
    show(*parts)


def _many(path: Path, how: dict[str, bool], out: Path | None, *, force: bool, as_json: bool) -> None:
    from servotwin.cli.interrupts import held
    from servotwin.identification import read_sheets, servo_from_sheet, sheet_contradictions, write_servo_text

    found = read_sheets(path)
    kept = [sheet for sheet in found.sheets if how["allow_impossible"] or not sheet_contradictions(sheet)]
    refused = [sheet for sheet in found.sheets if sheet not in kept]
    servos = [servo_from_sheet(sheet, **how) for sheet in kept]
    files = [] if out is None else [out / f"{servo.name}.toml" for servo in servos]
    for file in files:
        if file.exists() and not force:  # before the first is written
            raise OutputExistsError(file)
    if out is not None:
        _folder(out)
        with held():
            for servo, file in zip(servos, files, strict=True):
                write_servo_text(servo, file, overwrite=force)
    rows = [sheet_facts(sheet, servo, steady=True) for sheet, servo in zip(kept, servos, strict=True)]
    left = [*found.left_out, *(f"{sheet.title}: {sheet_contradictions(sheet)[0].text}" for sheet in refused)]
    if as_json:
        emit_json({"servos": rows, "left_out": left, "files": [str(file) for file in files]})
        return
    show(table(("id", "resistance", "torque per current", "efficiency", "flags"), [
        (row["id"], *(ranged(row["motor"][name]) for name in (
            "resistance", "output_torque_constant", "gear_efficiency")), "; ".join(row["flags"])) for row in rows]),
         "", *[f"left out: {text}" for text in left],
         *([f"written: {len(files)} servo files to {out}"] if out is not None else []))


def _folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{out} cannot be written ({error.strerror})") from None


# --- A sheet of `servotwin catalog from-sheet` and the servo made of it, as facts and as lines ------------------------

_UNCHECKED = "not checked, needs a current"


def sheet_facts(sheet: Sheet, servo: Servo, *, steady: bool = False) -> dict[str, Any]:
    """Return what follows from a sheet, and the servo made of it beside each printed figure, in SI, ready for JSON.

    Parameters
    ----------
    sheet : Sheet
    servo : Servo
        Made of it.
    steady : bool
        Whether to leave out what has to be simulated pulse by pulse.
    """
    from dataclasses import asdict

    from servotwin.cli.summary import headline, parameters
    from servotwin.datasheet.sheet import beside_flags, motion_of, printed_beside
    from servotwin.identification import motor_range, sheet_contradictions
    from servotwin.identification.sheets.motor_range import no_load_current_is_known, stall_current_is_known

    motor, contradictions = motor_range(sheet), sheet_contradictions(sheet)
    ranges = {name: asdict(getattr(motor, name)) for name in (
        "resistance", "output_torque_constant", "gear_efficiency", "no_load_current", "coulomb_torque")}
    possible = motor.possible and not contradictions
    checked = stall_current_is_known(sheet) or no_load_current_is_known(sheet)
    beside, motion = printed_beside(servo, steady=steady), None if steady else motion_of(servo)
    head = headline(servo)
    return {**head, "flags": [*head["flags"], *beside_flags(servo, beside, motion)],
            "possible": possible if checked or not possible else None,
            "contradictions": [asdict(one) for one in contradictions],
            "voltages": [point.supply_voltage for point in sheet.main],
            "motor": {**ranges, "drop_voltage": motor.drop_voltage},
            "figures": [{**figure._asdict(), "off": figure.off} for figure in beside],
            "motion": None if motion is None else motion._asdict(), "notes": servo.notes.strip(),
            "parameters": parameters(servo)}


def lines(found: dict[str, Any]) -> list[RenderableType]:
    """Return what the sheet says of the motor, whether it can be true, and what the servo does beside it."""
    names = {"resistance": ("resistance of the motor's circuit", "ohm"),
             "output_torque_constant": ("torque per current, at the output", "N m/A"),
             "gear_efficiency": ("efficiency of the gear", "1"), "no_load_current": ("running current", "A"),
             "coulomb_torque": ("Coulomb friction, at the output", "N m")}
    rows = [(words, f"{found['motor'][name]['value']:z.4g}", unit,
             f"{found['motor'][name]['lower']:z.4g} to {found['motor'][name]['upper']:z.4g}")
            for name, (words, unit) in names.items()]
    volts = ", ".join(f"{v:g} V" for v in found["voltages"])
    possible = {True: "yes", False: "NO", None: _UNCHECKED}[found["possible"]]
    parts: list[RenderableType] = [
        pairs([("voltages", volts), ("possible", possible), ("flags", "; ".join(found["flags"]) or "none")]),
        *[one["text"] for one in found["contradictions"]], "",
        table(("what follows", "value", "unit", "range"), rows)]
    beside = [(figure["name"], f"{figure['voltage']:g} V", f"{figure['printed']:.4g}", f"{figure['simulated']:.4g}",
               figure["unit"], f"{100.0 * figure['off']:+z.0f} %") for figure in found["figures"]]
    if beside:
        parts += ["", table(("printed figure", "at", "printed", "simulated", "unit", "off"), beside)]
    return parts if found["motion"] is None else [*parts, "", pairs(_motion_words(found["motion"]))]


def ranged(found: dict[str, float]) -> str:
    """Return a value with its range."""
    return f"{found['value']:z.3g} ({found['lower']:z.3g} to {found['upper']:z.3g})"


def _motion_words(found: dict[str, Any]) -> list[tuple[str, str]]:
    spans = found["spans"]
    passes = ("does not pass 54 deg" if math.isnan(found["passes"]) else
              f"passes 54 deg after {with_span(found['passes'], spans.get('passes'), '.3f', 's')}")
    over = with_span(100.0 * found["overshoot"], spans.get("overshoot"), ".1f", "%", scale=100.0)
    held = ("does not hold it" if math.isnan(found["error"]) else
            f"{with_span(math.degrees(found['error']), spans.get('error'), '.1f', 'deg', scale=math.degrees(1.0))} off")
    said = [("60 deg from rest", f"{passes}, overshoot {over}"), (f"holding {found['torque']:.2g} N m", held)]
    return [*said, ("ranges", "with what is guessed at the ends of its own")] if spans else said


# --- `servotwin catalog`: which servos there are, what is known of one, and what a servo file gives -------------------

_TELLING = ("impossible", "sources disagree", "digital", "bus", "currents unknown", "stall current unknown",
            "running current unknown")  # what a list has room for
_Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

catalog = Commands(
    help="List and show the servos that come with servotwin; make and check servo files.",
    epilog="Example: servotwin catalog show hitec-hs-755hb")


@catalog.callback(invoke_without_command=True)
def _catalog(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@catalog.command("list", help="List the servos in the catalog.", epilog="Example: servotwin catalog list --json")
def list_servos(as_json: _Json = False) -> None:
    """List the servos of the catalog."""
    from servotwin.cli.summary import headline
    from servotwin.parameters import catalog_names, load_servo

    with patience("reading the catalog"):
        found = [headline(load_servo(name)) for name in catalog_names()]
    if as_json:
        emit_json(found)
        return
    rows = [(servo["id"], servo["title"], _number(servo["supply_voltage"], "{:.3g} V"),
             _number(servo["stall_torque"], "{:.3g} N m"),
             _number(servo["twin_stall_torque"], "{:.3g} N m"), _number(servo["speed"], "{:.0f} deg/s"),
             _brief(servo["flags"])) for servo in found]
    show(table(("id", "title", "at", "torque", "of twin", "speed", "flags"), rows))


@catalog.command("show", help="Show every parameter of a servo and its source.",
                 epilog="Example: servotwin catalog show hitec-hs-755hb")
def show_servo(
    servo: Annotated[str, typer.Argument(metavar="ID", help="Catalog id, or path of a servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Show every parameter of a servo."""
    from servotwin.cli.summary import heading, headline, parameter_table, parameters
    from servotwin.cli.summary import servo_rows as figures
    from servotwin.parameters import load_servo

    loaded = load_servo(servo)
    facts, found = headline(loaded), parameters(loaded)
    if as_json:
        emit_json({**facts, "notes": loaded.notes.strip(), "parameters": found})
        return
    show(*heading(loaded), *figures(facts), "", *parameter_table(found))


@catalog.command("check", help="Check a servo file and say which models it can run.",
                 epilog="Example: servotwin catalog check my-servo.toml")
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A servo file (.toml).")],
    as_json: _Json = False,
) -> None:
    """Check a servo file."""
    from servotwin.cli.summary import readiness
    from servotwin.datasheet.turning import slow_rotor
    from servotwin.parameters import load_servo

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        servo = load_servo(file)
        models = readiness(servo)
    slow = slow_rotor(servo)
    found = {
        "file": str(file), "id": servo.name, "title": servo.title, "kind": servo.kind, "parameters": len(servo.names()),
        "origins": dict(Counter(servo.source(name).origin for name in servo.names())), "models": models,
        "warnings": [*dict.fromkeys(str(warning.message) for warning in caught), *([slow] if slow is not None else [])],
    }
    if as_json:
        emit_json(found)
    else:
        _show_check(servo, found)


def _show_check(servo: Servo, found: dict[str, Any]) -> None:

    origins = ", ".join(f"{count} {origin}" for origin, count in found["origins"].items()) or "none"
    given: dict[str, list[str]] = {}
    for name in servo.names():
        group, _, key = name.partition(".")
        given.setdefault(group, []).append(key)
    show(f"{found['file']}: {servo.title} ({servo.name}), a valid file of a servo of kind {servo.kind}",
         pairs([("parameters", f"{found['parameters']} ({origins})"),
                *[(group, ", ".join(keys)) for group, keys in given.items()]]),
         "models",
         pairs([(name, _ready(model)) for name, model in found["models"].items()]),
         *[f"warning: {text}" for text in found["warnings"]])


def _ready(model: dict[str, Any]) -> str:
    if not model["runs"]:
        return "cannot run: " + (f"lacks {', '.join(model['lacks'])}" if model["lacks"] else model["problem"])
    return "runs" + (f", {len(model['ignored'])} parameters not read" if model["ignored"] else "")


def _brief(flags: list[str]) -> str:
    """Return the flags that matter most when one looks for a servo, each in a word or two."""
    short = (flag.partition(":")[0].replace("current not given", "current unknown").replace(
        "no current given", "currents unknown") for flag in flags)
    return "; ".join(dict.fromkeys(flag for flag in short if flag in _TELLING))


def _number(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


catalog.command("from-sheet", help="Make a servo file from a data sheet.", epilog=(
    'Example: servotwin catalog from-sheet --name my-servo --torque "13.2 kgf.cm" --speed "0.23 s/60deg" '
    '--running-current "285 mA" --at 6V --deadband "8 us" --out my-servo.toml\n\n'
    "Example: servotwin catalog from-sheet --csv sheets.csv --out my-catalog"))(from_sheet)
catalog.command("registers", help="Show what the registers of a model of bus servo hold when it is new, and which page "
                "prints it.", epilog="Example: servotwin catalog registers XL330-M288")(registers)
catalog.command("which", help="Which servo: those that lift a mass, follow a motion or keep limits, side by side, "
                "and why the others do not.", epilog=(
    "Example: servotwin catalog which --lift 0.5kg --arm 10cm --voltage 5 --time 0.3\n\n"
    "Example: servotwin catalog which --lift 50g --arm 8cm --supply usb "
    "--among towerpro-sg90,towerpro-mg90s,hitec-hs-422\n\n"
    "Example: servotwin catalog which --robot arm.xml --motion wave.csv --limit mass=60g,current=1A"))(which)
