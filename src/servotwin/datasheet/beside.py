"""What a sheet prints beside what the servo made of it does when it is simulated, figure by figure."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin import signals
from servotwin.datasheet.conditions import at_voltage
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.guesses import Span, spans, variants
from servotwin.datasheet.holding import hold, smallest_stir
from servotwin.datasheet.rotor import slow_rotor
from servotwin.datasheet.turning import is_pulsed, still_pulses, wheel_speed_of
from servotwin.errors import InputError
from servotwin.models import default_model, mid_travel
from servotwin.parameters import printed_fact, printed_points
from servotwin.parameters.sheet_table import ELSE, POINT
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo

_MOST_OFF = 0.15  # of a printed figure: what is further off is flagged
_MOST_TIME = 1.4  # times the printed time for 60°, in which a step of 60° from rest passes 54°
_STEP, _PASSED = math.radians(60.0), math.radians(54.0)
_SETTLES = 1.0  # s
_SHARE = 0.25  # of the stall torque, which a servo holds


class Figure(NamedTuple):
    """A printed figure and what the servo does (SI).

    Parameters
    ----------
    name : str
        In words, such as "stall torque".
    unit : str
    voltage : float
        Supply voltage that it holds for [V].
    printed, simulated : float
        A time for 60° as such.
    source : str
        Where it is printed.
    remark : str
        Why it is off, where that is known.
    """

    name: str
    unit: str
    voltage: float
    printed: float
    simulated: float
    source: str
    remark: str = ""

    @property
    def off(self) -> float:
        """How far the servo is off what is printed, of that [1]."""
        return self.simulated / self.printed - 1.0

    @property
    def flag(self) -> str:
        """The same in words, where it is off by more than 15 %; else empty."""
        if abs(self.off) <= _MOST_OFF:
            return ""
        why = f" ({self.remark})" if self.remark else ""
        return (f"{self.name} at {self.voltage:g} V: {self.simulated:.3g} {self.unit} simulated, {self.printed:.3g} "
                f"printed{why}")


def printed_beside(servo: Servo, *, steady: bool = False) -> tuple[Figure, ...]:
    """Return every figure that a sheet prints of what a servo does, with what it does when it is simulated.

    Torque, speed and currents at each voltage are those of the model's steady motion at full drive; travel, pulses and
    deadband those of its chip or program.

    Parameters
    ----------
    servo : Servo
        With a table [sheet].
    steady : bool
        Whether to leave out what has to be simulated pulse by pulse.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = printed_beside(load_servo("hitec-hs-645mg"), steady=True)
    >>> [(figure.name, round(figure.off, 2)) for figure in found[:2]]
    [('stall torque', 0.01), ('time for 60 deg', -0.03)]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a sheet contradicts itself is said elsewhere
        return tuple(_figures(servo, steady=steady))


def _figures(servo: Servo, *, steady: bool) -> Iterator[Figure]:
    model = _quiet_model(servo)
    others = servo.sheet.get(ELSE)
    tables = [table for table in (servo.sheet, *(others if isinstance(others, list) else []))
              if isinstance(table, Mapping)]
    for table in tables:
        yield from _at_a_voltage(model, table, steady=steady)
    if not steady:
        yield from _of_the_whole(model)


def beside_flags(servo: Servo, figures: Iterable[Figure], motion: Motion | None = None) -> tuple[str, ...]:
    """Return what of a servo does not go with its sheet, each in words that name it and both numbers.

    Figures that are off by more than 15 %, a rotor that takes longer to speed up than the printed time, and a step of
    60° that takes longer than 1.4 times that.
    """
    slow, said = slow_rotor(servo), {figure.name if figure.remark else figure.flag: figure.flag
                                     for figure in reversed([*figures]) if figure.flag}
    found = [*([slow] if slow is not None else []), *reversed(said.values())]
    if motion is not None and motion.late and servo.kind != "bus":  # of a bus servo its registers decide
        found.append(f"60 deg from rest: {motion.words}, {motion.printed_time:.3g} s for 60 deg printed")
    return tuple(found)


class Motion(NamedTuple):
    """A step of 60° from rest in the middle of the travel, and a load that is held there.

    Parameters
    ----------
    passes : float
        When it passes 54°; nan where it does not [s].
    overshoot : float
        Beyond its target, of the way [1].
    printed_time : float
        For 60° at the servo's voltage; nan where that is not printed [s].
    torque, error : float
        A quarter of the stall torque [N m], and how far it pulls the servo off; nan where that does not stand [rad].
    spans : mapping of str to Span
        Ranges of `passes`, `overshoot` and `error`, where they rest on guesses.
    """

    passes: float
    overshoot: float
    printed_time: float
    torque: float
    error: float
    spans: Mapping[str, Span]

    @property
    def late(self) -> bool:
        """Whether the step takes longer than 1.4 times the printed time."""
        return self.printed_time > 0.0 and not self.passes <= _MOST_TIME * self.printed_time

    @property
    def words(self) -> str:
        """When it passes 54°."""
        return "does not pass 54 deg" if math.isnan(self.passes) else f"passes 54 deg after {self.passes:.3g} s"


def motion_of(servo: Servo) -> Motion | None:
    """Return how a servo moves and holds, with ranges; None of one that turns without end.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> found = motion_of(load_servo("hitec-hs-645mg"))
    >>> found.late, round(found.passes, 2)
    (False, 0.21)
    """
    model = _quiet_model(servo)
    if model.endless:
        return None
    torque = _SHARE * FullDrive(model).stall_torque
    own = _moves_and_holds(model, torque)
    found = spans(own, (_moves_and_holds(each, torque) for each in variants(model, rotor=True)))
    at, volts = printed_points(servo), model.value("supply.open_circuit_voltage")
    printed = next((point.time_60 for point in at if point.time_60 and point.supply_voltage == volts), math.nan)
    return Motion(own["passes"], own["overshoot"], float(printed), torque, own["error"], found)


def _moves_and_holds(model: Model, torque: float) -> dict[str, float]:
    start = mid_travel(model) - 0.5 * _STEP
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a contradiction is said elsewhere
        run = simulate(model, signals.step(start, start + _STEP, at=0.0, unit="rad"), duration=_SETTLES,
                       output_step=5e-4)
        held = hold(model, torque)
    turned = run["output_angle"] - start
    passed = run.time[turned > _PASSED]
    return {"passes": float(passed[0]) if len(passed) else math.nan,
            "overshoot": max(0.0, float(turned.max()) / _STEP - 1.0), "error": held.error}


def _quiet_model(servo: Servo) -> Model:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # which model stands for it is said elsewhere
        return default_model(servo)


def _at_a_voltage(model: Model, table: Mapping[str, Any], *, steady: bool) -> Iterator[Figure]:
    """Yield the figures of one row of the sheet."""
    volts = printed_fact(table, "supply_voltage")
    if volts is None:
        return
    try:
        there = at_voltage(model, volts)
        drive = FullDrive(there)
    except InputError:
        return  # a supply that the model refuses, or that does not turn it, is said by all that simulates it
    free = drive.no_load_speed
    values = {"stall_torque": ("stall torque", "N m", drive.stall_torque),
              "speed_per_60deg": ("time for 60 deg", "s", math.pi / 3.0 / free),
              "no_load_current": ("current without load", "A", drive.current(free)),
              "stall_current": ("stall current", "A", drive.stall_current)}
    for key in POINT:
        printed = printed_fact(table, key)
        if key in values and printed:
            name, unit, simulated = values[key]
            yield Figure(name, unit, volts, printed, simulated, _source(table, key))
    idle = printed_fact(table, "idle_current")
    if idle and not steady and not model.endless:
        yield Figure("current at rest", "A", volts, idle, hold(there, 0.0).current, _source(table, "idle_current"),
                     "the model has no current of its own electronics")


def _of_the_whole(model: Model) -> Iterator[Figure]:
    """Yield the figures of chip or program: deadband, and the angle between two pulses."""
    sheet, volts = model.servo.sheet, model.value("supply.open_circuit_voltage")
    if "pulse_width" not in model.available:
        return
    width = printed_fact(sheet, "deadband")
    if width:
        simulated = _deadband(model)
        if not math.isnan(simulated):
            yield Figure("deadband", "us", volts, 1e6 * width, 1e6 * simulated, _source(sheet, "deadband"))
    low, high, travel = (printed_fact(sheet, key) for key in ("pulse_min", "pulse_max", "travel"))
    if low and high and travel and not model.endless:
        angles = [math.degrees(_angle_at(model, pulse)) for pulse in (low, high)]
        yield Figure("travel", "deg", volts, math.degrees(travel), angles[1] - angles[0], _source(sheet, "travel"))


def _deadband(model: Model) -> float:
    """Return the full width of the pulses [s] that do not move the free shaft."""
    if is_pulsed(model):
        still = still_pulses(model, wheel_speed_of(model))
        return math.nan if still is None else still[1] - still[0]
    slope, p = model.servo.electronics.one_shot_slope, model.servo.potentiometer.feedback_gain
    return math.nan if slope is None or p is None else 2.0 * slope * p * smallest_stir(model)


def _angle_at(model: Model, pulse: float) -> float:
    """Return where a servo stands after a while of pulses of a width [s], or where a stop holds it [rad]."""
    return float(simulate(model, signals.constant(1e6 * pulse, unit="us"), duration=0.1,
                          output_times=[0.0, 0.1])["output_angle"][-1])


def _source(table: Mapping[str, Any], key: str) -> str:
    entry = table.get(key)
    return str(entry.get("source", "")) if isinstance(entry, Mapping) else ""
