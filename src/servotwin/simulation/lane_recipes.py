"""The forms in which lanes run compiled: what each leaves out, and what it can follow of what terms do."""

from __future__ import annotations

from servotwin.models.engine import tiles
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.dependence import BY_SHARE, CURVED_Q, FADING, ON_HEAT, ON_I, ON_Q, TWO_BODIES
from servotwin.simulation.compile import Recipe

_SIDE = tuple(f"servotwin.models.engine.side_by_side:{name}" for name in ("start", "go_on", "advance", "refit"))
_ENTRIES = tuple(f"servotwin.models.engine.runs:{name}" for name in ("start", "go_on"))
_PROGRAM = ("firmware", "bridge.pwm", "bridge.one_way")  # what only digital servos have
_APART = (*_PROGRAM, "elastic")  # what has kernels of its own, one lane after the other
ALL_RUNS = Recipe("runs", _ENTRIES, absent=_APART)  # everything else
_FORMS = ("ONE_FORMULA", "ARCS", "BANDS", "STRIDES", "COILS", "GAPS")
_PENDULUM, _COIL, _PLAY = "load.gravity", "motor.L", "play"
BANDED = ("friction.varies", "source.I_max")
STRIDING = ("heat", _PENDULUM, "load.stiffness")
_PLAYED = ("INSIDE", "ON_FORWARD", "ON_BACKWARD", "APART")  # with play alone
_NO_SIDE = ("friction.kappa", "follower", "sweep", *_APART)  # what no lanes side by side have
_NOT_IN_STRIDES = (*_NO_SIDE, _PLAY, _COIL)
_NOT_IN_BANDS = (*_NOT_IN_STRIDES, *STRIDING)
_NOT_IN_GAPS = (*_NO_SIDE, _COIL, *STRIDING, "friction.varies")
_RARE = (*BANDED, "friction.kappa", _PLAY, "heat", _COIL, "sensor.half_slack")
_DIGITAL = ("firmware.T_c", "bridge.pwm")  # what each of them has
_NO_DIGITAL = ("friction.kappa", "follower", "chip", _COIL)  # what no digital servo has
_SPRUNG, _NOT_SPRUNG = "elastic.k", ("friction.kappa", "follower", _PLAY)  # what springs have, and what not


def _side(name: str, forms: tuple[str, ...], knows: int, absent: tuple[str, ...], never: tuple[str, ...] = (),
          single: bool = False, spares: tuple[str, ...] = ()) -> Recipe:
    """Return the recipe of lanes that go side by side in some forms."""
    return Recipe(name, _SIDE, vector=True, single=single, absent=absent, knows=knows, spares=spares,
                  never=(*(form for form in _FORMS if form not in forms), *never))


# Numbers that a form follows though it lacks one of their readers, a way to solve that it does not go, or what happens
# at a stop, which it leaves to others; and though it leaves them to functions of others, which read them as ever
_NOT_OF_ARCS = ("shaft.J_out", "shaft.b_out", "stops.restitution", "load.rest_angle", *(
    f"chip.{name}" for name in ("T_0", "slope", "half_deadband", "K", "t_min", "shortest", "longest", "V_oc")))
_NOT_OF_GAPS = (*_NOT_OF_ARCS, "source.I_max")
_NOT_OF_BANDS = (*_NOT_OF_GAPS, "friction.varies", "friction.w_s", "friction.K_m", "friction.K_e")
_NOT_OF_STRIDES = (*_NOT_OF_BANDS, "friction.K_ms", "friction.K_es", "load.stiffness", "load.gravity",
                   "load.hanging_angle", "heat.magnet", "friction.F_forward", "friction.F_backward",
                   "friction.breakaway", "friction.alpha", "friction.K_mq", "friction.K_eq")
_BY_ARCS = {dtype: _side(f"side_by_side_{dtype}", ("ONE_FORMULA", "ARCS"), 0, (*_NOT_IN_BANDS, *BANDED),
                         ("CORE", *_PLAYED), single=dtype == "float32", spares=_NOT_OF_ARCS)
            for dtype in ("float64", "float32")}
_SMOOTH, _BANDS_TOO = ON_HEAT | ON_Q | CURVED_Q, BY_SHARE | FADING
_BY_BANDS = {creeps: _side("by_bands" + "_and_creep" * creeps, ("BANDS",), _BANDS_TOO, (
    _NOT_IN_BANDS if creeps else (*_NOT_IN_BANDS, "friction.w_s")), ("CORE", *_PLAYED), spares=_NOT_OF_BANDS)
    for creeps in (False, True)}
_BY_STRIDES = {banded: _side("by_strides" + "_in_bands" * banded, ("STRIDES",), _SMOOTH | _BANDS_TOO * banded, (
    _NOT_IN_STRIDES if banded else (*_NOT_IN_STRIDES, *BANDED)), ("CORE", *_PLAYED), spares=_NOT_OF_STRIDES)
    for banded in (False, True)}
_BY_COILS = _side("by_coils", ("COILS",), ON_I, (*_NO_SIDE, _PLAY, *STRIDING, *BANDED), (
    "CORE", *_PLAYED, "LINEAR", "LINEAR_BACKWARD", "LIMITED_FORWARD", "LIMITED_BACKWARD", "SHORT_FORWARD",
    "SHORT_BACKWARD"), spares=_NOT_OF_ARCS)
_BY_GAPS = _side("by_gaps", ("GAPS",), TWO_BODIES, _NOT_IN_GAPS, ("CORE",), spares=_NOT_OF_GAPS)
_NOT_PLAIN = ("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE")
PLAIN_RUNS = Recipe(
    "plain_runs", _ENTRIES, absent=(*_RARE, _PENDULUM, "sweep", *_APART), never=_NOT_PLAIN, knows=ON_Q)
# What it has from others' coefficients, or acts in pulses and at events, which it leaves to others
_NOT_CALM = (
    "motor.K", "motor.K_b", "motor.R", "bridge.D_drive", "bridge.R_drive", "bridge.off.coast", "bridge.silence.coast",
    "bridge.V_br", "source.V", "source.R_b", "follower.half_deadband", "shaft.J", "shaft.b", "shaft.J_out",
    "shaft.b_out", "load.coulomb", "load.stiffness", "stops.restitution", "sensor.b_o", "sensor.step",
    *(f"chip.{name}" for name in Chip._fields))
CALM = Recipe("calm", ("servotwin.models.engine.calm:go",), absent=PLAIN_RUNS.absent, never=PLAIN_RUNS.never,
              spares=_NOT_CALM)
PENDULUM_RUNS = Recipe(
    "pendulum_runs", _ENTRIES, absent=(*_RARE, "sweep", *_APART),
    never=("SERIES", "HELD", "WITH_CURRENT", *_PLAYED, "CORE"), knows=ON_Q | CURVED_Q)
GAP_RUNS = Recipe(
    "gap_runs", _ENTRIES, absent=_NOT_IN_GAPS,
    never=("LONG_STEP", "STEP", "SERIES", "HELD", "WITH_CURRENT", "CREEP", "CORE"), knows=TWO_BODIES)
LOOK_SIDE_BY_SIDE = Recipe("look_side_by_side", ("servotwin.models.engine.sights:side_by_side",), absent=(
    "friction.kappa", "follower", *_APART))
LOOK_ONE_BY_ONE = Recipe("look_one_by_one", ("servotwin.models.engine.sights:one_by_one",), absent=_APART)
LOOK_DIGITAL = Recipe("look_digital", LOOK_ONE_BY_ONE.entries, absent=(*_NO_DIGITAL, "elastic"), present=_DIGITAL)
ALL_DIGITAL = Recipe("digital_runs", _ENTRIES, absent=(*_NO_DIGITAL, "elastic"), present=_DIGITAL)
PLAIN_DIGITAL = Recipe("plain_digital_runs", _ENTRIES, absent=(*_RARE, _PENDULUM, *_NO_DIGITAL, "elastic"),
                       never=_NOT_PLAIN, present=_DIGITAL, knows=ON_Q)

_NOT_TICKING = (*PLAIN_DIGITAL.absent, "load.stiffness")
_TICKS = tuple(f"servotwin.models.engine.{name}" for name in (
    "loop_tiles:enter", "loop_rounds:watch", "loop_rounds:decide", "loop_rounds:move", "loop_rounds:move_on",
    "loop_rounds:follow"))
# Numbers that act only where a program that goes in one loop, or beside others, gives way to the general engine
_GIVES_WAY = (
    "source.V", "motor.R", "follower.half_deadband", "shaft.J", "shaft.J_out", "shaft.b_out", "friction.K_m",
    "friction.K_e", "load.coulomb", "load.rest_angle", "stops.restitution", "play.bearing", "elastic.J",
    "firmware.t_phi", "firmware.goals", "firmware.latency", "firmware.T_f")
_DECIDES_ALONE = (
    "bridge.R_drive", "bridge.off.R", "bridge.off.coast", "bridge.silence.R", "bridge.silence.coast", "bridge.one_way",
    "follower.V_max", "firmware.resolution", "firmware.restart_time", "firmware.per_second", "firmware.at_nothing",
    "firmware.shortest", "firmware.longest")
# Numbers of programs that these leave to functions of others, which read them as ever
_DECIDED = tuple(f"firmware.{name}" for name in (
    "T_d", "quantum", "k_p", "k_i", "k_d", "k_v", "k_a", "m", "threshold", "I_limit", "kappa", "at_rest", "delta",
    "duty_limit", "slew", "I_m", "brakes", "v", "a", "v_0", "overload_duty", "overload_time", "stall_travel",
    "overload_output", "latches", "trip_current", "trip_time", "resets", "timeout", "loss", "failsafe", "soft_duty",
    "soft_time", "noise", "b_o", "weight", "h", "gate", "rest_travel", "whole", "minimum", "torque_limit"))
# Not compiled for their own sake: what these call says which numbers are known where a program goes in one loop
_LEGS = (Recipe("by_legs", _ENTRIES, absent=("source.I_max", "heat", "sensor.half_slack", _PENDULUM, "load.stiffness",
                                             *_NO_DIGITAL, "elastic"), never=_NOT_PLAIN[:-1], present=_DIGITAL,
                   spares=(*_GIVES_WAY, *_DECIDED, "motor.K", "follower.V_max", "shaft.b", "friction.varies",
                           "friction.w_s", "friction.K_ms", "friction.K_es")), ("servotwin.models.engine.tick_legs:go",))
_TICKING = (Recipe("ticking", ("servotwin.models.engine.loops:go_on",), vector=True, absent=_NOT_TICKING,
                   never=_NOT_PLAIN, present=_DIGITAL, spares=(*_GIVES_WAY, *_DECIDED, *_DECIDES_ALONE)), _TICKS)
BY_TICKS = Recipe("by_ticks", ("servotwin.models.engine.loops:go_on",), vector=True, absent=PLAIN_DIGITAL.absent,
                  never=PLAIN_DIGITAL.never, present=_DIGITAL)


def _sprung(name: str, entries: tuple[str, ...]) -> dict[bool, Recipe]:
    """Return the recipes of servos with a spring between two bodies, analog and digital."""
    return {digital: Recipe(name + "_digital" * digital, entries, never=("APART", "CREEP", "CORE"), absent=(
        *(_NO_DIGITAL if digital else _PROGRAM), *_NOT_SPRUNG), present=(*(_DIGITAL if digital else ()), _SPRUNG))
        for digital in (False, True)}


ELASTIC_RUNS = _sprung("elastic_runs", _ENTRIES)
LOOK_ELASTIC = _sprung("look_elastic", LOOK_ONE_BY_ONE.entries)
ENDING = Recipe("ending", ("servotwin.models.engine.ending:look_at_lanes",), vector=True, absent=_PROGRAM)
_PARTS = {PLAIN_RUNS: ((PLAIN_RUNS, ()), (CALM, ())), PLAIN_DIGITAL: ((PLAIN_DIGITAL, ()), _LEGS, _TICKING),
          ALL_DIGITAL: ((ALL_DIGITAL, ()), _LEGS)}


def parts_of(recipe: Recipe) -> tuple[tuple[Recipe, tuple[str, ...]], ...]:
    """Return the kernels by which lanes of a form may go, as `compile.unread` is asked of them.

    Those that say by themselves whether they do follow all numbers.
    """
    return _PARTS.get(recipe, ((recipe, ()),))


def side_by_side(form: int, dtype: str, creeps: bool, banded: bool) -> Recipe:
    """Return the kernels of lanes that go side by side in a form; whether some creep, or stride in bands."""
    if form == tiles.BANDS:
        return _BY_BANDS[creeps]
    if form == tiles.STRIDES:
        return _BY_STRIDES[banded]
    return _BY_COILS if form == tiles.COILS else _BY_GAPS if form == tiles.GAPS else _BY_ARCS[dtype]
