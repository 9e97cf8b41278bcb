"""`servotwin catalog which`: which servos do a task within limits, side by side, and why the others do not."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.robot_options import ContactOption, PackageOption
from servotwin.cli.terminal import emit_json, pairs, patience, show, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servotwin.cli.which_words import Judged, Prices
    from servotwin.datasheet.choice import Limits
    from servotwin.parameters import Servo, Supply
    from servotwin.robots import Motion
    from servotwin.robots.model_file import Plant

_WHY = {"torque": "lack the torque", "time": "are too slow", "voltage": "are not for this voltage",
        "current": "draw too much", "mass": "are too heavy", "travel": "do not travel so far",
        "kind": "are of another kind", "price": "cost too much", "motion": "do not follow the motion"}
_MOST = 8  # candidates of which what takes seconds is simulated, unless they are named
_USUAL = "6"  # V
_TASK, _LIMITS = "Task", "Candidates and limits"


@dataclass(frozen=True, kw_only=True)
class _Asked:
    """What is to be done, on which supply, within which limits."""

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


def which(
    lift: Annotated[str | None, typer.Option(
        metavar="MASS", help="Mass to lift, such as 0.5kg, 120g, 4oz or 1lb; with --arm.",
        rich_help_panel=_TASK)] = None,
    arm: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="Length of the arm, such as 10cm, 80mm or 4in.", rich_help_panel=_TASK)] = None,
    motion: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Motion to follow, a table with time_s and a column such as arm_deg: of the arm of "
        "--lift, horizontal at 0, or of the joints of --robot.", rich_help_panel=_TASK)] = None,
    robot: Annotated[str | None, typer.Option(
        metavar="MODEL.xml", help="Robot whose joints follow --motion: MJCF or URDF file, or so101. Each candidate is "
        "put at all of its hinges.", rich_help_panel=_TASK)] = None,
    contact: ContactOption = None, package: PackageOption = None,
    joint: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="Joint of the motion that counts, repeatable (default: all).", rich_help_panel=_TASK)]
    = None,
    voltage: Annotated[str | None, typer.Option(
        metavar="VOLTS", help=f"Supply voltage (default: {_USUAL}).", rich_help_panel=_TASK)] = None,
    supply: shared.SupplyOption = None,
    among: Annotated[list[str] | None, typer.Option(
        metavar="ID", help="Candidates, with commas or repeatable: catalog ids, or paths of servo files (default: the "
        "catalog, or the servos of --prices).", rich_help_panel=_LIMITS)] = None,
    limit: Annotated[list[str] | None, typer.Option(
        metavar="NAME=VALUE", help="Limit, repeatable or with commas: current=1A, mass=60g, time=0.2s, price=20 at "
        "most; travel=180deg at least; voltage=7.4V, which the sheet has to reach; kind=analog, digital or bus.",
        rich_help_panel=_LIMITS)] = None,
    prices: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Prices: columns servo and price, or such as price_EUR.",
        rich_help_panel=_LIMITS)] = None,
    time: Annotated[str | None, typer.Option(
        metavar="SECONDS", help="Longest time allowed for 60 degrees, as --limit time=: with --lift from 30 below the "
        "horizontal to 30 above, else without load.", rich_help_panel=_LIMITS)] = None,
    register: shared.RegisterOption = None,
    why: Annotated[bool, typer.Option(
        "--why", help="Also list the servos that cannot, and why.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """List the servos that do a task within limits, side by side, and say why the others do not."""
    from servotwin.cli.lift_words import asked_lift
    from servotwin.cli.robot_words import overlap_of
    from servotwin.cli.which_words import limits_of, prices_of

    bounds, shop = limits_of(limit or [], time), None if prices is None else prices_of(prices)
    named = [name.strip() for word in among or [] for name in word.split(",") if name.strip()]
    at, bus = _supply(voltage, supply)
    weight = asked_lift(lift, arm)
    if not (weight or motion or robot or joint or limit or time or among or prices):
        raise _nothing()
    plant, followed = _motion(motion, robot, joint or [], weight, package or [])
    asked = _Asked(lift=weight, motion=followed, plant=plant, robot=robot, joints=tuple(joint or ()), at=at, bus=bus,
                   limits=bounds, named=bool(named), overlap=overlap_of(contact))
    servos = _servos(named, shop, prices, bounds, register or [])
    found = _judged(servos, asked, shop)
    if as_json:
        emit_json(_facts(asked, found))
        return
    show(asked.words, *_told(found, asked, shop, why=why))


def _nothing() -> Exception:
    from servotwin.errors import InputError

    return InputError("nothing is asked", allowed="--lift MASS --arm LENGTH, --motion FILE, --limit NAME=VALUE or "
                      "--among ID,ID")


def _supply(voltage: str | None, supply: str | None) -> tuple[Supply | float, Supply | None]:
    from servotwin.errors import InputError
    from servotwin.parameters import Supply
    from servotwin.units.quantities import quantity

    if supply is None:
        return quantity("--voltage", voltage or _USUAL, "voltage", bare=True, positive=True), None
    if voltage is not None:
        raise InputError("--supply", got=f"also --voltage {voltage}", allowed="one of them")
    found = Supply.of(supply, what="--supply")
    return found, found


def _motion(path: Path | None, robot: str | None, joints: list[str], lift: tuple[float, float] | None,
            packages: list[str]) -> tuple[Plant | None, Motion | None]:
    """Return robot and motion; without a robot that of an arm, whose joint is the column of the table."""
    from servotwin.errors import InputError

    if path is None:
        if robot is not None or joints:
            raise InputError("--robot" if robot is not None else "--joint", allowed="--motion FILE beside it")
        return None, None
    from servotwin.cli.robot_words import as_options, packages_of
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


def _column(path: Path, joints: list[str]) -> str:
    """Return the joint of a table of one joint: its column without the unit."""
    from servotwin.errors import InputError
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


def _servos(named: list[str], shop: Prices | None, file: Path | None, limits: Limits, register: list[str]
            ) -> list[tuple[Servo, float]]:
    """Return the candidates with their prices."""
    from servotwin.cli.register_words import with_registers
    from servotwin.errors import InputError, UnknownNameError
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
    """Return what one has to know to read the table."""
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
