"""The world of the page: the catalog, lessons, names, ranges and rules, as plain values."""

from __future__ import annotations

import math
import random
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import errors, units
from servotwin.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER, ControlSupply, PulseGenerator
from servotwin.errors import ParameterError, ServotwinError
from servotwin.identification.report.pictures import sensor_shown
from servotwin.loads import Load, Pendulum
from servotwin.logs.columns import COMMANDS, SWITCH, TIME, own_columns
from servotwin.logs.log_checks import FEWEST, LIMITS, PULSES
from servotwin.models import DigitalServo
from servotwin.models.engine.live import posts, screen
from servotwin.models.engine.live.posts import NEVER
from servotwin.models.engine.live.posts import UNITS as SIGNAL_UNITS
from servotwin.models.engine.live.screen import FIELDS, LEFT, PERIODS, TOO_LONG, USED
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.outputs import SIGNALS
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.frame import FRAME
from servotwin.models.terms.given import field_of
from servotwin.models.terms.wiring import PULSE_RANGE, TRAVEL_SLACK
from servotwin.parameters import GROUPS, catalog_names
from servotwin.parameters.groups import RULES, Firmware
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.table import Family, Setting, family_label, written
from servotwin.parameters.servo import KINDS as KINDS_OF_SERVOS
from servotwin.parameters.servo import PLACES, SET_BY_USER, USUAL_NAMES
from servotwin.physics.pieces import Piece
from servotwin.signals.signal import KINDS
from servotwin.simulation.bus import MODEL_NAMES, OF_BUS
from servotwin.simulation.engine import failure
from servotwin.simulation.result import shown_columns
from servotwin.simulation.start import Status
from servotwin.tables.reading import BY_POINTS, MISSING, WHOLE, WHOLE_OR_POINT
from servotwin.web.lessons import mystery
from servotwin.web.lessons.lessons import lessons
from servotwin.web.live import rules
from servotwin.web.live.actions import command_signal
from servotwin.web.live.facts import SLIDER, facts_of, load_facts, register_facts
from servotwin.web.live.live_bench import NO_PLAY, load_of, middle_of, models_of
from servotwin.web.live.live_bench import WHOLE as LAST_COUNTS
from servotwin.web.live.overlay import STRETCHES
from servotwin.web.live.replay import APART, SCRIPT, STEP
from servotwin.web.live.replay import KINDS as KINDS_OF_FILES
from servotwin.web.live.rules import FRAME_RATE, RATES
from servotwin.web.live.scene import (
    FORMAT,
    LONGEST_TEXT,
    MOST_ACTIONS,
    MOST_SERVOS,
    MOST_VIEW,
    SERVO_MODELS,
    TABLES,
    TOP,
    Scene,
    SceneServo,
    model_named,
)
from servotwin.web.server import session
from servotwin.web.server.app import catalog_list, curves_data
from servotwin.web.server.own.reading import DIGITS, MOST_PLAYED, UNITS

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo


# --- Between what a page may tell a servo commands, by the names of the parameters that say so ------------------------

_DEGREES = 180.0 / math.pi


def bounds_of(model: Model) -> dict[str, list[dict[str, Any]]]:
    """Return the bounds of commands by their units; a unit that is missing is none that the model takes.

    A bound is of what is commanded, or of the pulse that follows from it (SI). Its ends are numbers, or names of
    parameters with a number for where there is none. Its words may tell both ends, what was got, and the servo's name.

    Examples
    --------
    >>> import servotwin as st
    >>> sorted(bounds_of(st.DigitalServo(st.load_servo("feetech-sts3215-12v"))))
    ['deg']
    """
    goals = isinstance(model, DigitalServo) and model.takes_goals
    found: dict[str, list[dict[str, Any]]] = {}
    if not goals and ("pulse_width" in model.available):
        positive = [{"of": "command", "low": 0.0, "open": True, "factor": 1.0,
                     "words": "pulse width: got {got}, allowed: a positive width [s]"}]
        found["us"] = [*positive, *_pulses(model, accepted=not isinstance(model, SwitchedServo))]
    if "command_angle" in model.available:
        digital = isinstance(model, DigitalServo)
        found["deg"] = [*(_angles("the goals", "firmware.lower_goal", "firmware.upper_goal") if digital else ()),
                        *_angles("the travel", "stops.lower_angle", "stops.upper_angle"),
                        *(() if goals else _pulses(model, accepted=False))]
    if not goals and "command_voltage" in model.available:
        found["V"] = [*_pulses(model, accepted=False)]
    return found


def _angles(which: str, low: str, high: str) -> list[dict[str, Any]]:
    return [{"of": "command", "low": [low], "high": [high], "slack": TRAVEL_SLACK, "factor": _DEGREES,
             "words": f"angle command: got '{{got}} deg', allowed: {{low}} to {{high}} deg, {which} of {{name}}"}]


def _pulses(model: Model, *, accepted: bool) -> list[dict[str, Any]]:
    if accepted:
        return [{"of": "command", "low": ["electronics.pulse_width_min", PULSE_RANGE[0]],
                 "high": ["electronics.pulse_width_max", PULSE_RANGE[1]], "factor": 1e6,
                 "words": "pulse width, piece {piece} of the command (from {start} s on): got '{got} us', allowed: "
                          "{low} to {high} us, the pulses that {name} accepts"}]
    if not isinstance(model, SwitchedServo):
        return []
    return [{"of": "pulse", "low": 0.0, "high": ["electronics.frame_period", FRAME], "open": True, "factor": 1e6,
             "words": "pulse width: got '{got} us', allowed: more than 0 us and less than a frame of {high} us"}]


# --- Which tables the page as one file reads as logs: those that need no guess, by the rules of the one ---------------

ANGLE = "output_angle"
_NAMED = "named"  # how such a column is known


def csv_rules() -> dict[str, Any]:
    """Return the rules of such tables, as plain values.

    Examples
    --------
    >>> rules = csv_rules()
    >>> rules["columns"]["time_ms"], rules["limits"]["pulse_width"]
    (['time', 'ms', 0.001], [0.1, 's', 'microseconds?'])
    """
    return {
        "columns": {name: [signal, column.unit, float(column.to_si(np.ones(1), signal)[0])]
                    for name, (signal, column) in own_columns().items()},
        "time": TIME, "angle": ANGLE, "switch": SWITCH, "commands": COMMANDS, "positive": "pulse_width",
        "units": {kind: [unit, factor] for kind, (unit, factor) in UNITS.items()},
        "known": _NAMED, "missing": sorted(MISSING), "number": WHOLE_OR_POINT.pattern, "fewest": FEWEST,
        "grouped": BY_POINTS, "whole": WHOLE.pattern, "pulses": PULSES,
        "limits": {name: [limit, unit, meant] for name, (unit, limit, meant) in LIMITS.items()},
        "played": MOST_PLAYED, "digits": DIGITS, "stretches": STRETCHES, "shown": sensor_shown(ANGLE),
        "hold": "previous"}


# --- Every number that the page as one file goes by, of the modules that have it --------------------------------------

_AT_ONCE = 64  # rows of what each servo on a shared supply does at once
_STEPS = 150_000  # of a servo in a call, half a second of computing: a motion that takes more stands
_ROWS, _EVENTS, _PULSES, _TRAIN, _GIVEN = 4096, 512, 1024, 64, 8  # room for what shows, and what is sent


def limits() -> dict[str, Any]:
    """Return these numbers by the names that the page has for them; times are in seconds, but for `pause` [ms].

    Examples
    --------
    >>> limits()["speeds"]
    (1e-06, 10.0)
    """
    return {
        "rows": _ROWS, "events": _EVENTS, "pulses": _PULSES, "train": _TRAIN, "used": USED, "left": LEFT,
        "given": _GIVEN, "ends": 4, "at_once": _AT_ONCE,
        "piece": len(Piece._fields), "most_pieces": 2 * PERIODS + 1, "never": NEVER,
        "frame_rate": FRAME_RATE, "accuracy": ACCURACY, "rates": RATES,
        "format": FORMAT, "actions": MOST_ACTIONS, "servos": MOST_SERVOS,
        "text": LONGEST_TEXT, "view": MOST_VIEW,
        "speeds": session.SPEEDS, "unpaced": session.UNPACED, "over": session.OVER, "late": session.LATE,
        "steps": _STEPS, "too_long": TOO_LONG,
        "rate": session.RATE, "points": session.POINTS, "coarsest": session.COARSEST,
        "frame_points": session.FRAME_POINTS,
        "tick": session.TICK, "rounding": session.ROUNDING, "far": session.FAR, "pause": 1e3 / session.RATE,
        "budget": session.BUDGET, "short": session.SHORT / session.BUDGET, "first_stretch": session.FIRST,
        "longest": session.LONGEST}


# --- Programs of bus servos by their registers, as tables -------------------------------------------------------------

# The registers of a catalog servo are written by the package's own laws, value by value; where a register does not go
# by few straight lines it has no table, and the page says that only a server writes it.

_MOST_PIECES = 8
_ALL = 1100  # values that are all tried; of more, the ends and some between
_ENDS, _BETWEEN = 70, 400
_SAME = 1e-12

Made = tuple[Any, ...] | None  # what the numbers of a register are at a value; None: the value is refused


def register_tables(model: Model) -> list[dict[str, Any]] | None:
    """Return the registers of a servo that the page can write, as plain data; None of a servo without.

    Examples
    --------
    >>> import servotwin as st
    >>> tables = register_tables(st.DigitalServo(st.load_servo("feetech-sts3215-12v")))
    >>> one, = (table for table in tables if table["name"] == "P_Coefficient")
    >>> one["numbers"], len(one["pieces"]), one["shared"]
    (['firmware.proportional_gain'], 1, [])
    """
    servo = model.servo
    label, facts = family_label(servo), register_facts(servo)
    if label is None or facts is None:
        return None
    family = register_family_of(servo)
    return [table for one in facts if (table := _table(family, servo, one)) is not None]


def family_names(servo: Servo) -> dict[str, Any] | None:
    """Return what the family of a servo's registers is called, and the names of all of them; None without.

    Examples
    --------
    >>> import servotwin as st
    >>> family_names(st.load_servo("feetech-sts3215-12v"))["names"][:2]
    ['P_Coefficient', 'D_Coefficient']
    """
    label = family_label(servo)
    if label is None:
        return None
    family = register_family_of(servo)
    return {"label": label, "names": [*family.registers, *family.other_names]}


def _table(family: Family, servo: Servo, facts: dict[str, Any]) -> dict[str, Any] | None:
    name = facts["name"]
    moved = [other for other, source in family.copied.items() if source == name]
    settings = [one for one in family.settings if any(own in one.registers for own in (name, *moved))]
    raw, register = written(family, servo), family.registers[name]

    def made(value: int) -> Made:
        now = {**raw, name: value, **dict.fromkeys(moved, value)}
        try:
            family.check(now)
        except ParameterError:
            return None
        found = tuple(one.value(now, servo) for one in settings)
        return found if all(map(_fits, settings, found)) else None

    values = register.only or _values(register.lower, register.upper)
    pieces = _pieces([(value, made(value)) for value in values])
    if len(pieces) > _MOST_PIECES:
        return None
    shared = sorted({other for one in settings for other in one.registers} - {name, *moved, *family.masks})
    return {**facts, "numbers": [f"firmware.{one.name}" for one in settings], "pieces": pieces,
            "shared": [*shared, *(mask for mask in family.masks if any(mask in one.registers for one in settings)
                                  and mask != name)],
            "what": f"register {name} ({register.address}) of {family.model if family.reference else family.label}",
            "allowed": register.allowed}


def _fits(setting: Setting, value: Any) -> bool:
    """Tell whether a number of the firmware keeps its rule."""
    rule = Firmware.__dataclass_fields__[setting.name].metadata["rule"]
    if not isinstance(value, float) or rule not in RULES:
        return True
    low, high, open_ = RULES[rule]
    return bool((low < value if open_ else low <= value) and value <= high)


def _values(low: int, high: int) -> list[int]:
    """Return values of a register from the lowest to the highest, all of them where there are few."""
    if high - low <= _ALL:
        return list(range(low, high + 1))
    rng = random.Random(0)
    ends = {one for n in range(_ENDS) for one in (low + n, high - n)}
    about_powers = {sign * 2**k + d for k in range(31) for d in (-1, 0, 1) for sign in (-1, 1)}
    some = {rng.randint(low, high) for _ in range(_BETWEEN)}
    return sorted(one for one in ends | about_powers | some if low <= one <= high)


def _pieces(made: list[tuple[int, Made]]) -> list[list[Any]]:
    """Return pieces of straight lines: from which value on, the numbers there, and by how much they grow a step."""
    found: list[list[Any]] = []
    n = 0
    while n < len(made):
        start, at = made[n]
        if at is None:
            found.append([start])
            n += 1
            while n < len(made) and made[n][1] is None:
                n += 1
            continue
        slopes: tuple[float, ...] = (0.0,) * len(at)
        if n + 1 < len(made) and made[n + 1][1] is not None:
            over, after = made[n + 1][0] - start, made[n + 1][1]
            slopes = tuple((b - a) / over if isinstance(a, float) and isinstance(b, float) else 0.0
                           for a, b in zip(at, after or (), strict=True))
        found.append([start, list(at), list(slopes)])
        n += 1
        while n < len(made) and _on_line(made[n][1], made[n][0] - start, at, slopes):
            n += 1
    return found


def _on_line(now: Made, steps: int, at: tuple[Any, ...], slopes: tuple[float, ...]) -> bool:
    return now is not None and all(
        math.isclose(value, first + slope * steps, rel_tol=_SAME, abs_tol=1e-15)
        if isinstance(value, float) and isinstance(first, float) else value == first
        for value, first, slope in zip(now, at, slopes, strict=True))


# --- Refusals of the page as one file, beside the refusals of the rules -----------------------------------------------

ONLY_WITH_SERVER = "only with the server: servotwin web"
WORDS = {
    "alone": "This bench computes here, without a server. Only with one (servotwin web): fits, logs but plain CSV, "
             "servo files but of catalog servos.",
    "only_with_server": ONLY_WITH_SERVER,
    "no_plain_log": "{name}: got {got}, allowed: plain CSV with columns such as time_s, pulse_width_us, "
                    "output_angle_deg; the server's page (servotwin web) reads far more",
    "a_number": "a number", "a_width": "a positive width", "rows": "a header and at least one row",
    "cut_line": "line {line} does not end in a newline and was left out",
    "log": "log: got none, allowed: a log that is dropped on the page first",
    "log_hint": "Drop a plain CSV table anywhere on the page: columns such as time_s, pulse_width_us (or "
                "command_angle_deg), output_angle_deg. The server's page (servotwin web) reads other tables, too.",
    "twin": "The twin begins at rest where the log begins; delay, phase of the pulses and zero of the angle are fitted "
            "by the server's page (servotwin web).",
    "types": {"number": "float", "whole": "int", "string": "str", "boolean": "bool", "array": "list", "object": "dict"},
    "digits": 6, "smallest": -4,
    "known": {"parameter": "GROUP.NAME, with a group of " + ", ".join(GROUPS)},
    "places": {"parameter": tuple(PLACES)}, "groups": {"parameter": tuple(GROUPS)}, "usual": {"parameter": USUAL_NAMES},
    "near": {"least": errors.NEAR, "longest": errors.LONGEST_NAME, "suggestions": errors.SUGGESTIONS,
             "letters": errors.FEWEST_LETTERS, "begins": errors.BEGINS, "holds": errors.HOLDS},
    "none": "none", "longest": errors.LONGEST_SHOWN, "dots": "...",
    "stands": "the bench stands: ",
    "too_long": "motion: got 'one that takes too long to compute at t = {time} s', allowed: numbers of a servo that is "
                "not so fast, and a new beginning",
    "repeating": "action: got 'while the bench is being repeated', allowed: a moment later",
    "no_single_frame": "single frame: got 'a bench that is being repeated', allowed: one that stands",
    "new_beginning": "bench: got {got}, allowed: a new beginning",
    "speed": "speed: got {got}, allowed: a number from 1e-06 to 10, or unpaced",
    "mystery": "Mystery servo {seed}",
    "mystery_scene": 'format = 1\nname = "Mystery servo {seed}"\n[[servo]]\nmystery = {seed}\nmodel = "PulseServo"\n',
    "no_such_model": "model of {id}: got {got}, allowed: one that the servo has numbers for",
    "takes_goals": "{kind} command of {name}: got '{word}', allowed: angles: it takes goals on a bus "
                   "(firmware.command_kind)",
    "no_supply": "supply of a scene: allowed: a Supply with open_circuit_voltage, such as "
                 "Supply(open_circuit_voltage=6.0, internal_resistance=0.5)",
    "bus_models": MODEL_NAMES,
    "rigid": "a stiff gear and shaft: on a shared supply there are no springs between two bodies",
    "no_inertia": "gear.backlash: got {got}, allowed: play only with inertia behind it: gear.output_inertia, or a load "
                  "that has some",
    "frame_rate": "frame rate: got {got}, allowed: frames that a pulse fits into",
    "a_register": "the name of a register, such as {such}",
    "no_servo_file": "servo file: got {got}, allowed: a file of a servo of the catalog with its parameters; the "
                     "server's page (servotwin web) reads any",
    "no_mystery_file": "servo file of a mystery servo: allowed: none: find out what it is",
    "no_circuit": "a bench that has one", "of_pulses": "one of pulses",
    "late_circuit": "less than what a frame leaves after its longest pulse [s]",
    "no_reference": "reference of a converter that hangs on the supply: allowed: a positive voltage: the supply has "
                    "broken down",
    "no_registers": "none: it is no bus servo", "bus_registers": "registers of a bus servo",
    "no_torque": "torque_enable of {model}: got {got}, allowed: nothing: an analog servo has no such switch",
    "no_torque_switch": "torque: got {got}, allowed: nothing: no servo here has such a switch",
    "too_many_actions": "record of the bench: got '100000 actions', allowed: no more: start it anew",
}
"""Messages by their names; {got} is what was given."""


# --- The world of the page: the catalog, lessons, names, ranges and rules, as plain values ----------------------------

_OF_ALL = ("name", "symbol", "unit", "dimension", "meaning", "shown", "rule", "choices")  # alike of all servos
_SPREAD = ("std", "lower", "upper")
_OF_EACH = ("value", "origin", "source", "spread", "low", "high")


def world(first: Scene) -> dict[str, Any]:
    """Return what the page has, as plain values; `first` is the bench that it begins with.

    Raises
    ------
    InputError
        If that bench is one that the page cannot have.
    """
    example = facts_of(models_of(Scene(servos=(SceneServo(id=catalog_names()[0]),)))[0], first)
    load = load_of(Scene(servos=(SceneServo(id=catalog_names()[0]),)))
    of_load = {name: float(getattr(load.pendulum if "pendulum" in name else load, name.rpartition(".")[2]))
               for name in _LOADS}
    no_load = {_LOADS[name]: value for name, value in of_load.items()}
    return {
        "first": first.text(), "lessons": [{**one.listed(), "text": one.scene.text()} for one in lessons()],
        "servos": {name: _servo(name) for name in catalog_names()}, "catalog": catalog_list(), "curves": _curves(),
        "parameters": [[one[key] for key in _OF_ALL] for one in example["parameters"]], "of_all": _OF_ALL,
        "of_each": _OF_EACH, "given": {
            one["name"]: None if one["rule"] == "table" else field_of(one["name"]) for one in example["parameters"]},
        "models": {name: _model(name) for name in SERVO_MODELS}, "loads": load_facts(Scene(servos=first.servos)),
        "load": _LOADS, "of_bus": OF_BUS, "switched": [
            name for name in SERVO_MODELS if issubclass(model_named(name), SwitchedServo)],
        "signals": {name: {"unit": one.unit, "meaning": one.meaning} for name, one in SIGNALS.items()},
        "columns": screen.COLUMNS, "events": {str(code): word for code, word in screen.SHOWN.items()},
        "rules": {"actions": rules.ACTIONS, "for_all": rules.FOR_ALL, "scene": rules.SCENE, "view": rules.VIEW,
                  "servo": rules.SERVO, "loads": {name: _load_rule(name) for name in _LOADS}},
        "mystery": {
            "base": mystery.BASE, "hidden": mystery.unknowns(), "both_ways": mystery.BOTH_WAYS,
            "friction": mystery.FRICTION, "good": mystery.GOOD, "fair": mystery.FAIR, "seeds": mystery.SEEDS},
        "file": {"groups": [*GROUPS], "spread": _SPREAD, "no_play": NO_PLAY, "usual": KINDS_OF_SERVOS[0], "units": {
            name: {unit: units.factor(unit, name) for unit in known} for name, known in units.DIMENSIONS.items()}},
        "files": _files(), "csv": csv_rules(),
        "no_load": no_load, "made": ["", "no_inertia"],
        "set": {"origin": "assumed", "source": SET_BY_USER, "spread": ""},
        "slider": SLIDER, "ranges": {name: _ends(one) for name, one in RULES.items()},
        "less": [[f"{title}.{name}" for name in pair] for title, group in GROUPS.items() for pair in group.less],
        "limits": limits(), "words": WORDS, "shapes": FIELDS, "units": SIGNAL_UNITS,
        "kinds": {unit: KINDS[unit][0] for unit in SIGNAL_UNITS}, "lines": "linear", "hold": "hold",
        "degrees": "deg", "whole": LAST_COUNTS, "status": [_failed(one) for one in Status],
        "scene": {"servo": [*rules.SERVO["fields"]], "sources": rules.SOURCES, "tables": TABLES, "top": TOP,
                  "row": (3, 4)},
        "control": _control(),
        "converters": [{"name": name, "of": of, "gain": one.gain, "offset": one.offset, "highest": one.highest}
                       for name, of, one in (("command_count", "command_voltage", INPUT_CONVERTER),
                                             ("feedback_count", "feedback_voltage", FEEDBACK_CONVERTER))]}


_GAIN = "firmware.proportional_gain"
_LOADS = {"load.inertia": "inertia", "load.viscous_friction": "viscous_friction", "load.torque": "torque",
          "load.coulomb_torque": "coulomb_torque", "load.pendulum.mass": "mass", "load.pendulum.length": "arm",
          "load.pendulum.hanging_angle": "hanging_angle"}
"""Fields of a scene's load, by what an action calls them."""


def _load_rule(name: str) -> dict[str, Any]:
    """Return the rule of a number of a load, as `check_number` has it."""
    part = Pendulum if "pendulum" in name else Load
    if name.rpartition(".")[2] in part.not_negative:
        return {"is": "number", "what": name, "low": 0.0, "allowed": "a finite number of at least 0"}
    return {"is": "number", "what": name, "allowed": "a finite number"}


def _model(name: str) -> dict[str, Any]:
    """Return what is alike of all servos of a model."""
    kind = model_named(name)
    return {"family": posts.FAMILIES[name], "requires": kind.requires, "reads": [*kind.requires, *kind.optional]}


def _servo(name: str) -> dict[str, Any]:
    """Return what is known of a servo of the catalog, with each model that it has numbers for."""
    models: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for kind in SERVO_MODELS:
        scene = Scene(servos=(SceneServo(id=name, model=kind),))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                model, = models_of(scene)
        except ServotwinError:
            continue
        facts = facts_of(model, scene)
        found = {key: facts[key] for key in ("id", "title", "kind", "models", "horn")}
        found["registers"], found["family"] = register_tables(model), family_names(model.servo)
        found["values"] = [[one[key] for key in _OF_EACH] for one in facts["parameters"]]
        found["stated"] = _stated(model.servo)
        found |= {"notes": model.servo.notes, "sheet": dict(model.servo.sheet), "fit": dict(model.servo.fit)}
        models[kind] = {"columns": ["time", *facts["signals"]], "bounds": bounds_of(model), "middle": middle_of(model),
                        "refused": _refused(model),
                        **{key: facts[key] for key in ("travel_deg", "pulse_us", "voltage", "loop")}}
        if isinstance(model, DigitalServo) and facts["loop"]:
            models[kind]["loop"] = {**facts["loop"], "gain": _GAIN,
                                    "per_gain": model.loop_stiffness() / model.value(_GAIN)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        default = models_of(Scene(servos=(SceneServo(id=name),)))[0]
    return {**found, "model": type(default).__name__, "of": models}


def _refused(model: Model) -> dict[str, str]:
    """Return what is said of commands that a model does not take, by their units."""
    found = {}
    for unit in sorted({*SIGNAL_UNITS} - {*bounds_of(model)}):
        try:
            model.command(command_signal({"shape": "hold", "unit": unit, "value": 1.0}, 0.0))
        except ServotwinError as error:
            found[unit] = " ".join(str(error).split())
    return found


def _stated(servo: Servo) -> dict[str, list[float | None]]:
    """Return how sure a servo's record is of its numbers: std, lower and upper (SI) of those where it says so."""
    found = {name: [getattr(servo.source(name), key) for key in _SPREAD] for name in servo.names()}
    return {name: ends for name, ends in found.items() if any(end is not None for end in ends)}


def _control() -> dict[str, Any]:
    """Return the control circuit: what it is unless a scene says more, and its converter and generator."""
    usual, generator = ControlSupply(), PulseGenerator()
    return {"usual": {name: getattr(usual, name) for name in rules.CONTROL_FIELDS},
            "longest": generator.width(INPUT_CONVERTER.highest), "delay": rules.CONTROL_FIELDS[2],
            "fields": {"gain": INPUT_CONVERTER.gain, "offset": INPUT_CONVERTER.offset,
                       "highest": INPUT_CONVERTER.highest, "step": generator.step, "base": generator.base,
                       "counts_per_step": generator.counts_per_step}, "shares": rules.CONTROL_FIELDS[:2],
            "unit": SIGNAL_UNITS[2], "bus": "bus_voltage", "full": "supply.open_circuit_voltage"}


def _files() -> dict[str, Any]:
    """Return how files are written: columns of tables by signal, with their factors, and the script."""
    columns = {}
    for name, one in {"time": None, **SIGNALS}.items():
        unit = "s" if one is None else one.unit
        (at_zero, at_one), = shown_columns({name: np.array([0.0, 1.0])}, {name: unit}).values()
        shown, = shown_columns({name: np.zeros(1)}, {name: unit})
        columns[name] = [shown, float(at_one - at_zero), float(at_zero)]
    return {"columns": columns, "digits": 12, "apart": APART, "rate": 1.0 / STEP, "script": SCRIPT,
            "kinds": KINDS_OF_FILES}


def _ends(one: Any) -> dict[str, Any]:
    ends = {name: end for name, end in (("low", one.low), ("high", one.high)) if math.isfinite(end)}
    return {**ends, "open": one.open}


def _failed(status: Status) -> str:
    """Return what is said of a bench that stands; {time} is when [s]."""
    return " ".join(str(failure(status, 0.0)).replace("0 s", "{time} s").split())


def _curves() -> dict[str, Any]:
    found = {}
    for name in catalog_names():
        try:
            found[name] = curves_data(name)
        except ServotwinError as error:
            found[name] = {"error": " ".join(str(error).split())}
    return found
