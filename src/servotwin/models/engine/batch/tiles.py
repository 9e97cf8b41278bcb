"""Tiles: what pulse servos that run side by side are, remember and work with, 128 lanes of each number in a row.

Times count from now, within a frame, so that float32 keeps their digits; clocks are float64.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.models.engine.batch.rk_steps import SMOOTH, STEEP, slots_type
from servotwin.models.engine.batch.segments import inductive_segments, linear_segments, piecewise_segments
from servotwin.models.engine.batch.segments.inductive_segments import Circuit, Course, Winding
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.dynamics import contacts
from servotwin.models.engine.lanes import chip_at, chip_of, numbers_at, numbers_of
from servotwin.models.engine.memory import FIRST_STEP
from servotwin.models.engine.motions.motion import FINE
from servotwin.models.engine.motions.warm_exponential import Gone, Law
from servotwin.models.state.modes import INSIDE, RIGID
from servotwin.models.state.records import TILE, fill, reader, room, rows_of, tile_of, writer
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.physics.backlash import play

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.models.engine.lanes import Lanes

FEW = 2  # lanes that are not worth going together
# How lanes go through a phase: as `braked_rounds`, `arc_rounds`, `band_rounds`, `stride_rounds`, `coil_rounds` and
# `gap_rounds` have it
ONE_FORMULA, BANDS, STRIDES, COILS, GAPS = range(5)


class Meter(NamedTuple):
    """The voltages at the chip when it measures while a current flows."""

    V: float
    R_b: float
    K_b: float
    R: float
    V_br: float
    coast: float
    D_drive: float
    R_drive: float
    D_off: float
    R_off: float
    p: float
    b_o: float


class Servo(NamedTuple):
    """The state of a servo between two windows; times count from now [s]."""

    q: float
    w: float
    drive: float
    left: float  # of the drive
    silence: float  # until the drive ends for want of pulses
    error: float  # of the latest decision
    width: float  # of the pulse
    due: float  # until the next decision; inf: none waits
    sign: float
    duration: float
    decided: float  # its error
    later_due: float  # of a second one that waits
    later_sign: float
    later_duration: float
    later_decided: float
    wiper: float  # angle of the potentiometer, where that has play
    i: float  # current, where it has inertia
    T_w: float  # temperatures of winding and housing [K]
    T_h: float
    q_m: float  # angle and speed of the motor at the output shaft, where the gear has play
    w_m: float
    mesh: float
    step: float  # length that an integrator would try next [s]


class Clock(NamedTuple):
    """Where a lane is in time [s]."""

    period: float
    edge: float  # when its frame began, since its start
    since: float  # the time since then
    length: float  # of the frame; at its end the next pulse rises, when time advances
    remaining: float  # of the call
    owed: float  # of a call that the general way has to finish
    piece_end: float  # when the command's piece is over or its value changes
    output: float  # the next one


class Count(NamedTuple):
    """Whole numbers of a lane."""

    number: int  # of the next frame
    first_draw: int  # of noise, that of frame 0
    seed: int
    piece: int
    last_piece: int
    output: int
    first_edge: int
    edges: int  # −1: they come regularly
    zone: int  # of the current, within a phase
    share: int  # sign of the torques through the gear
    ends_at: int  # what ends a band
    which: int  # a list of lanes, written without branches: a wrong guess costs more than an entry


class Plan(NamedTuple):
    """Arrays of one window."""

    window: float
    at_edge: float  # 1: a pulse rises at its beginning
    decides: float  # 1: the decision lies in it
    last: float  # 1: with it the call is over
    draw: float
    v_m: float
    V_bus: float
    lost: float  # 1: for the general way
    end1: float  # of the drive left over, of the rest before the decision, of the drive after it
    end2: float
    end3: float
    time1: float
    time2: float
    time3: float
    time4: float
    drive1: float
    drive3: float
    time: float  # of a phase
    power: float
    ends: float
    way: float  # −1 or +1: which way it slides
    start: float  # −1, 0, +1: which way it starts from rest
    turned: float  # where it stopped last
    creeps: float  # time for it to creep
    sensed: float  # angle of the potentiometer
    q1: float  # angle and speed at the start of each phase
    w1: float
    wiper1: float
    q2: float
    w2: float
    wiper2: float
    q3: float
    w3: float
    wiper3: float
    q4: float
    w4: float
    wiper4: float
    edge_speed: float  # of a arc
    pull_there: float
    rate: float
    per_rate: float
    pull: float
    way_time: float
    way_angle: float
    q_before: float  # what was so before the window
    wiper_before: float
    w_before: float
    left_before: float
    silence_before: float
    error_before: float
    due_before: float
    sign_before: float
    duration_before: float
    decided_before: float


class More(NamedTuple):
    """The parts of a servo's state that only few forms change, by the names that it has in `Servo`."""

    i: float
    T_w: float
    T_h: float
    q_m: float
    w_m: float
    mesh: float
    step: float


class Hung(NamedTuple):
    """Loads on the shafts of lanes that read their own numbers."""

    torque: float  # constant, external [N m]
    half_slack: float  # half of the play of the potentiometer
    tolerance: float  # of what is integrated
    dry: float  # 1: there is friction of some kind, or what counts as such


class Times(NamedTuple):
    """The clock before a window [s]."""

    now: float  # since the start
    since: float
    remaining: float


def has_more(form: int) -> bool:
    """Tell whether a form changes what is in `More`."""
    return form == STRIDES or form == COILS or form == GAPS


@cache
def tile_type(real: str, form: int) -> np.dtype[Any]:
    """Return the type of a tile whose servos have numbers of this type and go through phases in this form."""
    own = {"own": rows_of(Numbers, real)} if form >= BANDS else {}
    if has_more(form):
        own |= {f"more_{place}": rows_of(More, real) for place in ("before", 0, 1, 2, 3)}
    if form == COILS:
        own |= {"coil": rows_of(Course, real), "winding": rows_of(Winding, real), "circuit": rows_of(Circuit, real)}
    return tile_of({
        **own, "hung": rows_of(Hung, real), "arc": rows_of(ArcNumbers, real), "chip": rows_of(Chip, real),
        "meter": rows_of(Meter, real), "servo": rows_of(Servo, real), "clock": rows_of(Clock, np.float64),
        "count": rows_of(Count, np.int64)})


@cache
def plan_type(real: str, form: int) -> np.dtype[Any]:
    """Return the type of the room that a window is worked out in, by lanes that go through phases in this form."""
    slots = {"slots": slots_type(), "law": rows_of(Law, real), "gone": rows_of(Gone, real)} if form == STRIDES else {}
    return tile_of({"of": tile_of({**dict.fromkeys(Plan._fields, real), **slots}), "clock": rows_of(Times, np.float64)})


def plan_room(real: str, form: int) -> NDArray[Any]:
    """Return room to work windows out in; what is in empty slots may be computed with."""
    rows = room(1, plan_type(real, form))
    if form == STRIDES:
        rows.view(np.uint8)[...] = 0
        fill(rows["of"]["slots"]["own"], NEUTRAL)
    return rows


put_numbers = writer("put_numbers", Numbers)
put_chip = writer("put_chip", Chip)
arc_numbers_at = reader("arc_numbers_at", ArcNumbers)
put_arc_numbers = writer("put_arc_numbers", ArcNumbers)
winding_at = reader("winding_at", Winding)
put_winding = writer("put_winding", Winding)
circuit_at = reader("circuit_at", Circuit)
more_at = reader("more_at", More)
put_more = writer("put_more", More)
put_servo = writer("put_servo", Servo)
put_clock = writer("put_clock", Clock)
put_count = writer("put_count", Count)
meter_at = reader("meter_at", Meter)
put_meter = writer("put_meter", Meter)


def set_numbers(lanes: Lanes, form: int, first: int, size: int, tile: Any, place: int) -> None:
    """Put what servos are into a tile, from the lane `first` and the place `place` on."""
    for j in range(size):
        put_arc_numbers(tile.arc, place + j, linear_segments.arc_numbers(numbers_of(lanes, first + j),
                                                                         lanes.torque[first + j]))
        chip = chip_of(lanes, first + j)
        put_chip(tile.chip, place + j, chip)
        tile.clock.period[place + j] = chip.frame_period
    for j in range(size):
        numbers = numbers_of(lanes, first + j)
        path, motor, source, sensor = numbers.bridge, numbers.motor, numbers.source, numbers.sensor
        put_meter(tile.meter, place + j, Meter(
            source.V, source.R_b, motor.K_b, motor.R, path.V_br, path.off.coast, path.D_drive, path.R_drive, path.off.D,
            path.off.R, sensor.p, sensor.b_o))
    for j in range(size):
        numbers = numbers_of(lanes, first + j)
        tile.hung.half_slack[place + j] = numbers.sensor.half_slack
        rough = SMOOTH if form == GAPS or numbers.friction.varies == 0.0 else STEEP
        part = rough if form == STRIDES or form == GAPS else FINE
        tile.hung.tolerance[place + j] = part * lanes.accuracy
        tile.hung.dry[place + j] = 1.0 if contacts.has_friction(numbers) else 0.0
    if form == BANDS:
        for j in range(size):
            put_numbers(tile.own, place + j, numbers_of(lanes, first + j))
            hang(numbers_of(lanes, first + j), lanes.torque[first + j], tile, place + j)
    if has_more(form):
        for j in range(size):
            put_numbers(tile.own, place + j, numbers_of(lanes, first + j))
            tile.hung.torque[place + j] = lanes.torque[first + j]
            tile.arc.start_off[place + j] = 1.0  # whether it starts depends on where it stands
    if form == COILS:
        for j in range(size):
            put_winding(tile.winding, place + j, inductive_segments.winding(numbers_of(lanes, first + j)))


def hang(numbers: Numbers, torque: float, tile: Any, j: int) -> None:
    """Hang a constant external torque [N m] on the shaft of a lane that reads its own numbers."""
    begins = piecewise_segments.starts(numbers, torque)
    tile.hung.torque[j] = torque
    tile.arc.start_forward[j] = begins.forward
    tile.arc.start_backward[j] = begins.backward
    tile.arc.start_off[j] = begins.off


def drag(tile: Any, q: float, j: int) -> None:
    """Let the potentiometer of a lane follow its shaft, which has gone one way to q [rad]."""
    tile.servo.wiper[j] = play(tile.servo.wiper[j], q, 2.0 * tile.hung.half_slack[j])


def dragged(half_slack: float, wiper: float, turned: float, q: float) -> float:
    """Return the angle of a potentiometer after its shaft has turned back, and gone to q [rad]."""
    return play(play(wiper, turned, 2.0 * half_slack), q, 2.0 * half_slack)


def start(lanes: Lanes, form: int, first: int, size: int, first_output: float, tile: Any) -> None:
    """Put lanes as they start into a tile, from the column `first` on."""
    set_numbers(lanes, form, first, size, tile, 0)
    for j in range(size):
        y, lane = lanes.start, first + j
        put_servo(tile.servo, j, Servo(
            y[0, lane], y[1, lane], 0.0, 0.0, -math.inf, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0,
            y[0, lane], y[2, lane], y[3, lane], y[4, lane], y[5, lane], y[6, lane],
            INSIDE if form == GAPS and numbers_of(lanes, lane).play.half > 0.0 else RIGID, FIRST_STEP))
    for j in range(size):
        own = lanes.edge_count[first + j]
        late = lanes.edges[lanes.edge_first[first + j]] if own > 0 else math.inf if own == 0 else 0.0
        put_clock(tile.clock, j, Clock(tile.clock.period[j], 0.0, 0.0, late, 0.0, 0.0, -math.inf, first_output))
        begin, count = lanes.piece_first[first + j], lanes.piece_count[first + j]
        put_count(tile.count, j, Count(0, 0, lanes.seeds[first + j], begin, begin + count - 1, 0,
                                       lanes.edge_first[first + j], own, 0, 0, 0, 0))


def plain_chip_at(rows: Any, j: int) -> Chip:
    """Return a chip without noise, coupling and RC stretcher."""
    x = chip_at(rows, j)
    return Chip(x.T_0, x.slope, 0.0, 0.0, 0.0, x.half_deadband, x.K, x.t_min, 0.0, x.shortest, x.longest, x.timeout,
                0.0, 0.0)


__all__ = ["FEW", "TILE", "Plan", "Servo", "arc_numbers_at", "chip_at", "numbers_at", "plan_type", "tile_type"]
