"""Remarks on a completed run: refused pulses, an end stop, a load too heavy, trips, a shaft without rest.

A remark is no failure: the run reached its end, and `Status` says so. One look at the end of the run finds it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models import DigitalServo
from servotwin.models.engine import cosim
from servotwin.models.engine.memory import FLAT
from servotwin.models.standing import standing_current
from servotwin.models.terms import heat
from servotwin.models.terms.frame import NO_CHIP
from servotwin.models.terms.numbers import at_temperature
from servotwin.parameters import printed_flags, sheet_voltages
from servotwin.parameters.registers.held import registers_of
from servotwin.physics.motor import electromagnetic_torque
from servotwin.physics.pieces import piece_value
from servotwin.signals.signal import headers
from servotwin.simulation.metrics import least

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from servotwin.models import Model
    from servotwin.models.columns import Samples
    from servotwin.models.terms.firmware import Firmware
    from servotwin.models.terms.numbers import Numbers
    from servotwin.parameters import Servo, Supply
    from servotwin.signals import Signal
    from servotwin.simulation.rest import Rest
    from servotwin.simulation.result import Result
    from servotwin.simulation.trajectory import Trajectory


# --- How far the supply falls -----------------------------------------------------------------------------------------

Array = NDArray[np.float64]
LOW = 0.8
"""Of the supply's voltage: below it a servo has a fifth less torque and speed, `assumed` to be what people notice."""
LONG = 0.02
"""s, a frame of pulses: a supply that is low or at its limit for less holds nothing back, `assumed`."""
ELECTRONICS = 3.0
"""V, below which chips of analog servos stop, `assumed`: sheets print 4.8 V."""
_SAME = 1e-6  # of the supply's voltage: what it falls by less is rounding


class Sag(NamedTuple):
    """How far a supply fell.

    Parameters
    ----------
    voltage, time : float
        Least voltage [V] and when it came first [s].
    low, limited : float
        For how long it was below 0.8 of its voltage without load, and at its limit of current [s].
    limit : float
        That limit, inf where it has none [A].
    """

    voltage: float
    time: float
    low: float
    limited: float
    limit: float

    @property
    def holds_back(self) -> bool:
        """Whether it was low or at its limit for a frame or more."""
        return self.low >= LONG or self.limited >= LONG


def sag_of(trajectories: Sequence[Trajectory], voltage: Callable[[Samples], Array], supply: Supply) -> Sag | None:
    """Return how far a supply fell that servos are on; None where it stayed as it is.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        Of all servos on it.
    voltage : callable
        Of the supply [V], by samples of a trajectory.
    supply : Supply
    """
    V = supply.open_circuit_voltage or math.nan
    limit = math.inf if supply.current_limit is None else supply.current_limit
    if not may_fall(supply):
        return None
    different = {one.segments.starts.tobytes(): one for one in reversed(trajectories)}
    found = [least(one, voltage) for one in different.values() if one.segments]
    if not found:  # a run that failed at once
        return None
    lowest = min(one.value for one in found)
    first = min(one.time for one in found if one.value <= lowest + FLAT)
    if not lowest < V * (1.0 - _SAME):
        return None
    ends = LOW * V, V * (1.0 - _SAME) - (supply.internal_resistance or 0.0) * limit  # at its limit it lies below

    def below(samples: Samples) -> Array:
        return (voltage(samples) < np.array(ends)[:, None]).astype(np.float64)

    low, limited = trajectories[0].integral(below).tolist() if lowest < max(ends) else (0.0, 0.0)
    return Sag(lowest, first, low, limited, limit)


def may_fall(supply: Supply) -> bool:
    """Tell whether the voltage of a supply may fall."""
    return bool(supply.internal_resistance) or supply.current_limit is not None


def sag_in(time: Array, voltage: Array, supply: Supply, lowest: tuple[float, float] | None = None) -> Sag | None:
    """Return how far a supply fell, among samples that are evenly spaced: time [s] and voltage [V], shape (n,).

    `lowest` is its least voltage [V] and when it came first [s] where these are known between samples too.
    """
    V, limit = supply.open_circuit_voltage or math.nan, supply.current_limit or math.inf
    least = lowest[0] if lowest is not None else float(voltage.min()) if len(time) else math.nan
    if not len(time) or not least < V * (1.0 - _SAME):
        return None
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    at_limit = V * (1.0 - _SAME) - (supply.internal_resistance or 0.0) * limit
    low, limited = (step * float(np.count_nonzero(voltage < end)) for end in (LOW * V, at_limit))
    when = lowest[1] if lowest is not None else float(time[np.argmax(voltage <= least + FLAT)])
    return Sag(least, when, low, limited, limit)


class Floor(NamedTuple):
    """The voltage below which it is unknown what a servo does [V], and whether a register says so."""

    voltage: float
    of_register: bool


def floor_of(servo: Servo) -> Floor:
    """Return below which voltage it is unknown what a servo does.

    That is Min_Voltage_Limit of a servo with registers, what its maker promises; else what chips need.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [floor_of(load_servo(name)).voltage for name in ("feetech-sts3215-12v", "towerpro-sg90")]
    [4.0, 3.0]
    """
    held = registers_of(servo).get("Min_Voltage_Limit")
    return Floor(ELECTRONICS, False) if held is None or not held.value else Floor(0.1 * held.value, True)


def watches_its_supply(model: Model) -> bool:
    """Tell whether a protection of the servo's program acts where its supply is low."""
    return isinstance(model, DigitalServo) and model.servo.firmware.undervoltage is not None


# --- Remarks on a completed run ---------------------------------------------------------------------------------------

NOT_AT_REST, BUZZES = "does not come to rest", "buzzes at rest"
HELD_BACK, BELOW_CHIP, BELOW_REGISTER = (
    "held back by its supply", "supply below what its electronics need", "supply below its registers")
REFUSED, ON_STOP, CANNOT_HOLD = KINDS = ("pulses refused", "ended on a stop", "cannot hold")
COLUMNS = {kind: kind.replace(" ", "_") for kind in KINDS}
"""Name of a table's column that holds the time of a kind."""
TRIPS = ("overload", "current", "heat", "undervoltage")
"""Protections of a digital servo; the number of one in the signal `trip` is its place from 1 on."""
STAYS_TRIPPED = "stays tripped"
_TRIPPED = {f"tripped by {kind}": f"trips by {kind}" for kind in TRIPS}  # kinds, and the events that they are of


def swing_words(swing: float, frequency: float) -> str:
    """Return a swing from end to end [rad] and its frequency [Hz] as people read them."""
    return f"swings {math.degrees(swing):.2f} deg at {frequency:.2g} Hz"


def drive_words(rate: float, duty: float, current: float) -> str:
    """Return how a bridge drives a shaft that stands, as people read it: rate [Hz], duty [1] and current [A].

    Examples
    --------
    >>> drive_words(50.0, 0.021, 0.0312), drive_words(0.0, 0.25, 0.31)
    ('drives 50 times a second, duty 2.1 %, 0.031 A in the mean', 'drives all the time, duty 25 %, 0.310 A in the mean')
    """
    often = f"{rate:.3g} times a second" if rate > 0.0 else "all the time"
    percent = f"{100.0 * duty:.2g}" if duty < 0.995 else f"{100.0 * duty:.0f}"  # not 1e+02
    return f"drives {often}, duty {percent} %, {current:.3f} A in the mean"


def held_back_words(voltage: float, low: float, limited: float, limit: float = math.inf) -> str:
    """Return how a supply holds a servo back: least voltage [V], time below 0.8 of its own and at its limit [s, A].

    Examples
    --------
    >>> held_back_words(1.75, 0.8, 0.84, 0.2), held_back_words(3.61, 0.05, 0.0)
    ('at its limit of 0.2 A for 0.84 s, 1.75 V at least', 'below 80 % of its voltage for 0.05 s, 3.61 V at least')
    """
    when = f"at its limit of {limit:g} A for {limited:.2g} s" if limited >= low else (
        f"below {100.0 * LOW:.0f} % of its voltage for {low:.2g} s")
    return f"{when}, {voltage:.2f} V at least"


def _beyond_words(why: str) -> Callable[..., str]:
    return lambda voltage, floor: f"{voltage:.2f} V at least, {why.format(floor=floor)}"


_NUMBERS: dict[str, Callable[..., str]] = {
    NOT_AT_REST: swing_words, BUZZES: drive_words, HELD_BACK: held_back_words,
    BELOW_CHIP: _beyond_words("and below about {floor:g} V (assumed) such electronics stop: no model here knows that"),
    BELOW_REGISTER: _beyond_words("its protection does not watch the supply, and below {floor:g} V, its "
                                  "Min_Voltage_Limit, the maker promises nothing")}
_MARKS = {ON_STOP: cosim.ON_STOP, CANNOT_HOLD: cosim.CANNOT_HOLD}
_AT_STOP = 1e-6  # rad, relative beyond 1 rad: as in `ending`
_ROUNDING = 1e-9  # rad


class _Kind(NamedTuple):
    kind: str
    time: float


class Remark(_Kind):
    """A remark on a run; a pair (kind, time), with some numbers by name in `numbers`.

    Parameters
    ----------
    kind : str
        "pulses refused": the last pulse is too short or too long for the chip, and so are all from `time` on.
        "ended on a stop": it rests on an end stop, and its command asks for an angle elsewhere.
        "cannot hold": it is off its command, and full drive from a standstill does not turn the load towards it, where
        the shaft stands or where it was sent.
        "tripped by overload", "… current", "… heat", "… undervoltage": a protection of a digital servo has acted.
        "stays tripped": one still does.
        "does not come to rest": command and load stand still, and the shaft goes to and fro: `swing` from end to end
        [rad] at `frequency` [Hz].
        "buzzes at rest": the shaft stands where friction alone would hold it, and the bridge keeps switching: `rate`
        [Hz], `duty` in the mean [1], `current` of the supply in the mean [A].
        "held back by its supply": that fell to `voltage` [V], was below 0.8 of its own for `low` [s] and at its `limit`
        [A] for `limited` [s].
        "supply below what its electronics need", "... below its registers": it fell to `voltage`, below the `floor` [V]
        under which it is unknown what the servo does.
    time : float
        Of the first such pulse, trip, or least voltage; otherwise the end of the run, of which the remark speaks [s].
    **numbers : float
        Those of the kind (SI).

    Examples
    --------
    >>> Remark("cannot hold", 1.5).words
    'cannot hold its load at 1.5 s'
    >>> Remark("does not come to rest", 5.0, swing=0.0116, frequency=1.13).words
    'does not come to rest: swings 0.66 deg at 1.1 Hz'
    """

    numbers: dict[str, float]

    def __new__(cls, kind: str, time: float, **numbers: float) -> Remark:
        """Make a pair that carries numbers."""
        made = super().__new__(cls, kind, time)
        made.numbers = numbers
        return made

    def __getnewargs_ex__(self) -> tuple[tuple[str, float], dict[str, float]]:
        return (self.kind, self.time), self.numbers

    @property
    def words(self) -> str:
        """The remark as people read it."""
        said = _NUMBERS[self.kind](**self.numbers) if self.numbers else ""
        return f"{words(self.kind)}: {said}" if said else words(self.kind, f"{self.time:g} s")

    @property
    def facts(self) -> dict[str, str | float]:
        """Kind, time and numbers by name, as `Remark` takes them again."""
        return {**self._asdict(), **self.numbers}


class LaneRemark(NamedTuple):
    """A remark on one lane of many: the lane's number, kind and time [s] as in `Remark`."""

    lane: int
    kind: str
    time: float


class ServoRemark(NamedTuple):
    """A remark on one servo of several on a supply: its name, kind and time [s] as in `Remark`."""

    servo: str
    kind: str
    time: float


def words(kind: str, time: str = "") -> str:
    """Return a kind of remark as people read it, with its time where one is given.

    Examples
    --------
    >>> words("pulses refused", "0.1 s"), words("ended on a stop")
    ('all pulses refused from 0.1 s on', 'ended on a stop that it was not sent to')
    """
    text, before, after = {
        REFUSED: ("all pulses refused", "from", "on"), ON_STOP: ("ended on a stop that it was not sent to", "at", ""),
        CANNOT_HOLD: ("cannot hold its load", "at", ""), NOT_AT_REST: (NOT_AT_REST, "at", ""),
        BUZZES: (BUZZES, "at", ""), **{kind: (kind, "at", "") for kind in (HELD_BACK, BELOW_CHIP, BELOW_REGISTER)},
        STAYS_TRIPPED: ("a protection still acts", "at", ""),
        **{tripped: (tripped, "at", "") for tripped in _TRIPPED}}[kind]
    return " ".join(filter(None, (text, before, time, after))) if time else text


def remarks_of(result: Result) -> tuple[Remark, ...]:
    """Return the remarks on a run; none on one that ended before its time."""
    if not result.status.ok:
        return ()
    model, load, end = result.model, result.load, result.ended
    last = result.trajectory.at(np.array([end]))
    numbers = _under_sag(result, model.plant(load), last)
    chip, firmware = model.chip(result.command), model.firmware(result.command)
    if isinstance(model, DigitalServo) and firmware is not None:
        pulsed, accepts = not model.takes_goals, NO_CHIP._replace(shortest=firmware.shortest, longest=firmware.longest)
        period = firmware.T_f
    else:
        pulsed, accepts, period = chip is not None, chip or NO_CHIP, 0.0 if chip is None else chip.frame_period
    own = model.edges(result.command) if pulsed else None
    edges, period = own or (), period if own is None else 0.0
    rows = result.drive.rows
    refused = cosim.refused_from(accepts, rows, period, edges, end) if pulsed else math.nan
    tau = piece_value(cosim.piece_before(load.torque_pieces.rows, end, False), end)
    final = [float(values[0]) for values in (last.angle, last.speed, last.winding, last.housing)]
    if model.endless:  # it takes no angle
        marks = 0
    elif firmware is not None:
        marks = _program_marks(numbers, firmware, last, tau, final)
    else:
        marks = cosim.marks(pulsed, numbers, accepts, rows, tau, period, edges, end, numbers.source.V,
                                   not math.isnan(refused), final)
    said = tuple(Remark(remark.kind, remark.time) for remark in lane_remarks([refused], [marks], end))
    trips = () if firmware is None else _trips(result, last)
    return (*said, *trips, *_of_supply(result), *_of_rest(result.rest, end, alone=not said))


def _of_supply(result: Result) -> tuple[Remark, ...]:
    """Return that the supply holds a servo back, and that it falls below what is known of it."""
    sag, said = result.sag, []
    if sag is None:
        return ()
    if sag.holds_back:
        said.append(held_back(sag))
    floor = floor_of(result.model.servo)
    if sag.voltage < floor.voltage and not watches_its_supply(result.model):
        said.append(Remark(BELOW_REGISTER if floor.of_register else BELOW_CHIP, sag.time, voltage=sag.voltage,
                           floor=floor.voltage))
    return tuple(said)


def held_back(sag: Sag) -> Remark:
    """Return the remark on a supply that holds back what is on it."""
    limit = {"limit": sag.limit} if math.isfinite(sag.limit) else {}
    return Remark(HELD_BACK, sag.time, voltage=sag.voltage, low=sag.low, limited=sag.limited, **limit)


def _of_rest(rest: Rest | None, end: float, *, alone: bool) -> tuple[Remark, ...]:
    """Return that a shaft does not come to rest, or, where nothing else is to be said, that it buzzes there."""
    if rest is None:
        return ()
    if rest.swing > 0.0:
        return (Remark(NOT_AT_REST, end, swing=rest.swing, frequency=rest.frequency),)
    if alone and rest.buzzes:
        return (Remark(BUZZES, end, rate=rest.drive_rate, duty=rest.duty, current=rest.current),)
    return ()


def _under_sag(result: Result, numbers: Numbers, last: Samples) -> Numbers:
    """Return the numbers of a plant whose source is what the other servos on a bus leave of it."""
    if last.bus is None:
        return numbers
    own = float(result.model.output("supply_current", last, result.drive, result.load)[0])
    source = numbers.source
    return numbers._replace(source=source._replace(V=float(last.bus[0]) + source.R_b * own))


def _program_marks(numbers: Numbers, firmware: Firmware, last: Samples, tau: float, final: Sequence[float]) -> int:
    """Return what is so at the end of a digital servo's run, as `ending.marks` does: judged by its goal and its cap."""
    if last.goal is None or last.duty is None or last.trip is None:
        return 0
    (q, w, T_w, T_h), goal, trip = final, float(last.goal[0]), int(last.trip[0])
    if abs(goal - q) <= firmware.h + firmware.quantum + _ROUNDING:
        return 0
    upper, lower = numbers.stops.upper, numbers.stops.lower
    at_stop = q >= upper - _AT_STOP * max(abs(upper), 1.0) or q <= lower + _AT_STOP * max(abs(lower), 1.0)
    found = cosim.ON_STOP if w == 0.0 and at_stop else 0
    if abs(float(last.duty[0])) > 1.0 or trip > 1:  # without torque, as it is commanded
        return found
    if heat.present(numbers.heat):
        numbers = at_temperature(numbers, T_w, T_h)
    most = min(firmware.torque_limit, firmware.duty_limit, firmware.overload_output if trip == 1 else 1.0)
    torque = electromagnetic_torque(standing_current(numbers, firmware, most), numbers.motor.K)
    forward, sent = goal > q, min(max(goal, lower), upper)
    able = all(cosim.starts(numbers, forward, torque, tau, at) for at in (q, sent))
    return found if able else found + cosim.CANNOT_HOLD


def _trips(result: Result, last: Samples) -> tuple[Remark, ...]:
    """Return by what a digital servo tripped, when first, and whether something still acts."""
    said = []
    for kind, named in _TRIPPED.items():
        first = next((event.time for event in result.events if event.kind == named), None)
        if first is not None:
            said.append(Remark(kind, first))
    acts = last.trip is not None and last.trip[0] != 0.0
    return (*said, *([Remark(STAYS_TRIPPED, result.ended)] if acts else []))


def lane_remarks(refused: ArrayLike, marks: ArrayLike, end: float) -> tuple[LaneRemark, ...]:
    """Return the remarks on many lanes, in the order of the lanes.

    Parameters
    ----------
    refused, marks : array_like, shape (B,)
        As in `lanes.Raw`.
    end : float
        Of the runs [s].

    Examples
    --------
    >>> lane_remarks([np.nan, 0.02], [2, 0], 1.5)
    (LaneRemark(lane=0, kind='cannot hold', time=1.5), LaneRemark(lane=1, kind='pulses refused', time=0.02))
    """
    since, codes = np.asarray(refused, dtype=np.float64), np.asarray(marks)
    found = []
    for lane in np.flatnonzero(~np.isnan(since) | (codes != 0)).tolist():
        if not np.isnan(since[lane]):
            found.append(LaneRemark(lane, REFUSED, float(since[lane])))
        found += [LaneRemark(lane, kind, end) for kind, mark in _MARKS.items() if codes[lane] & mark]
    return tuple(found)


def columns(remarks: Sequence[LaneRemark], lanes: int) -> dict[str, NDArray[np.float64]]:
    """Return a column for each kind of remark, by its name in `COLUMNS`: its time [s], nan where it is not said.

    Examples
    --------
    >>> columns([LaneRemark(1, "cannot hold", 1.5)], 2)["cannot_hold"].tolist()
    [nan, 1.5]
    """
    found = {name: np.full(lanes, np.nan) for name in COLUMNS.values()}
    for lane, kind, time in remarks:
        found[COLUMNS[kind]][lane] = time
    return found


def of_columns(table: Mapping[str, NDArray[np.float64]]) -> tuple[LaneRemark, ...]:
    """Return the remarks that the columns of a table hold, in the order of the lanes.

    Examples
    --------
    >>> of_columns(columns([LaneRemark(1, "cannot hold", 1.5)], 2))
    (LaneRemark(lane=1, kind='cannot hold', time=1.5),)
    """
    found = [LaneRemark(lane, kind, float(table[name][lane]))
             for kind, name in COLUMNS.items() for lane in np.flatnonzero(~np.isnan(table[name])).tolist()]
    return tuple(sorted(found, key=lambda remark: remark.lane))


# --- Odd but possible numbers of a simulation: one warning for each, before anything runs -----------------------------

_TOO_MUCH = 2.0  # times the highest supply voltage of the sheet


def warn_of(servo: Servo, commands: Sequence[Signal], duration: float, *, voltages: ArrayLike | None = None,
            known: NDArray[Any] | None = None, stacklevel: int = 3) -> None:
    """Warn of a servo whose sheet is impossible, of a supply that is far too high, and of commands that come too late.

    Parameters
    ----------
    servo : Servo
    commands : sequence of Signal
    duration : float
        Of the run [s].
    voltages : array_like, optional
        Of the supplies of all lanes [V]; the servo's own unless given.
    known : ndarray, optional
        `headers` of the commands, where the caller has them.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    known = headers(commands) if known is None else known
    for text in (*_of_servo(servo, voltages), *_of_commands(commands, known, duration)):
        warnings.warn(text, stacklevel=stacklevel)


def _of_servo(servo: Servo, voltages: ArrayLike | None) -> Iterator[str]:
    reason = next((flag for flag in printed_flags(servo) if flag.startswith("impossible")), None)
    if reason is not None:
        yield (f"{servo.name}: its data sheet contradicts itself ({reason}); no servo has all that it says, nor does "
               "this one")
    given = servo.supply.open_circuit_voltage if voltages is None else float(np.max(voltages))
    rated = sheet_voltages(servo)
    if given is not None and rated is not None and given > _TOO_MUCH * rated[1]:
        yield f"{servo.name}: a supply of {given:g} V is more than twice the {rated[1]:g} V of its data sheet"


def _of_commands(commands: Sequence[Signal], known: NDArray[Any], duration: float) -> Iterator[str]:
    starts = known["first_change"]
    late = np.flatnonzero(starts >= duration)
    if late.size:
        k, start = int(late[0]), float(starts[late[0]])
        which = "the command" if len(commands) == 1 else f"command {k}"
        more = f" (and those of {len(late) - 1} more)" if len(late) > 1 else ""
        what = "the first pulse" if commands[k].edges is not None else "the first change"
        yield f"{what} of {which}{more} comes at {start:g} s, when the run of {duration:g} s is over"
