"""Working records of digital servos on one supply that go from tick to tick: one a servo, and one for the supply."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.state.modes import Mode, Vector
from servotwin.models.state.records import record_reader, record_writer
from servotwin.models.terms.numbers import Numbers

TERMS = 24  # of a power series at most

if TYPE_CHECKING:
    Coefficients = list[float]
    Course = list[float]
else:
    Coefficients = tuple[(float,) * TERMS]
    Course = tuple[(float,) * (TERMS + 2)]


class Law(NamedTuple):
    """The law of a servo in a mode, at the temperatures at which a leg begins; all but four numbers stay with these.

    R i = s V − K_b w − drop; of what the motor turns ẇ = pull + per_torque K i − rate w; inside the play the output has
    ẇ = output_pull − output_rate w.
    """

    R: float  # of the loop of a cold winding [Ω]
    winding: float  # of the winding [Ω]
    R_slope: float  # by how much both grow per kelvin of the winding; 0: temperatures stay
    K: float
    K_b: float
    K_slope: float  # of K per kelvin of the housing
    K_b_slope: float
    per_heat: float  # by how much the winding warms per joule [K/J], and the housing
    per_flow: float
    drop: float
    conducts: float  # one by that of the loop; 0: no current flows
    moves: float  # 1: what the motor turns moves
    pull: float
    per_torque: float
    rate: float
    apart: float  # 1: the output moves alone
    output_pull: float
    output_rate: float
    low: float  # between which what drives the current lies [V]
    high: float
    ahead: float  # by which angle the motor is ahead of the output where they touch [rad]
    press: float  # how motor and output press together at rest, without torque [rad/s²]
    press_forward: float  # more of it per torque of the motor [N m], forward or backward
    press_backward: float
    press_speed: float
    gear: float  # the same of what the torques through the gear add to its friction, with the sign that lasts [N m]
    gear_torque: float
    gear_speed: float


class Unit(NamedTuple):
    """A servo; times by its own clock [s]. What legs look at stands first."""

    active: int  # 1: it moves, or gets warm
    kinds: int  # of guards that can end its mode
    sign: float  # which part of the bus voltage is in its circuit, with its sign; 0: none
    draws: float  # from the bus, of a volt in its circuit [A]
    gain: float  # acceleration per ampere [rad/s²/A]
    back: float  # the last coefficient of the voltage that speed, drops and warming take, but for s V
    bend: float  # h² max|ẅ| of what the motor turns
    field: float  # what warming magnets add to the next current's torque
    warming: float  # what warming adds to the voltage along the winding
    hot: int  # coefficients of temperatures that count
    mild: int  # of the housing's alone
    open: int  # 1: diodes lead back to the supply
    anew: int  # 1: another duty than when its mode was found
    short: int  # legs in a row that took no time
    law: Law
    mode: Mode
    mesh: int  # of the mode in which it came to its state: what is found there under another voltage may not hold
    y: Vector
    after: Vector  # the state at the end of a leg
    speed: Coefficients
    output: Coefficients
    current: Coefficients
    fall: Coefficients  # of the voltage along the winding
    winding: Coefficients  # temperature [K]
    housing: Coefficients
    course: Course  # of a guard, in parts of a leg
    place: int  # where its memory stands among those of all
    lane: int  # where its numbers do
    duty: float  # nan: not found out yet
    torque: float  # of its load, the external one [N m]
    time: float
    due: float  # when its program does something next
    last: float  # how far it may go
    slack: float  # within which two instants are one
    frames: int
    origin: float
    tick: float  # how long one lasts
    numbers: Numbers  # at its duty, as on a stiff source
    given: Numbers


class Coupling(NamedTuple):
    """What servos have in common along a leg."""

    V: float  # of the supply without current
    R_b: float
    I_max: float
    voltage: Coefficients  # of the bus
    terms: int  # of all series
    now: float  # the voltage of the bus where the servos are
    then: float  # and at the end of the leg
    bend: float  # h² max|V̈|
    jumped: int  # 1: a speed has jumped, and with it the currents of all


unit_numbers = record_reader("unit_numbers", Numbers)
put_unit_numbers = record_writer("put_unit_numbers", Numbers)
unit_mode = record_reader("unit_mode", Mode)
put_unit_mode = record_writer("put_unit_mode", Mode)
unit_state = record_reader("unit_state", Vector)
put_unit_state = record_writer("put_unit_state", Vector)
put_unit_law = record_writer("put_unit_law", Law)
