"""A servo as the page's controls have it: each parameter with unit, range, meaning and source; travel, registers."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from servotwin.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER
from servotwin.datasheet.static_loop import loop_of
from servotwin.errors import ServotwinError
from servotwin.models import DigitalServo
from servotwin.models.outputs import SIGNALS
from servotwin.models.terms.wiring import PULSE_RANGE
from servotwin.parameters import GROUPS
from servotwin.parameters.registers.held import registers_of
from servotwin.parameters.registers.table import family_label
from servotwin.units import factor, si_unit
from servotwin.web.live.live_bench import load_of
from servotwin.web.live.rules import shown_in
from servotwin.web.live.scene import SERVO_MODELS, model_named, with_registers
from servotwin.web.live.station import names_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from servotwin.bench import Converter
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.web.live.scene import Scene


# --- The registers of a bus servo as the page shows them: the maker's names, what they hold, what may be --------------

def register_facts(servo: Servo) -> list[dict[str, Any]] | None:
    """Return the registers of a servo, each with what it holds, its range, and the numbers that follow from it.

    Examples
    --------
    >>> import servotwin as st
    >>> one, = (r for r in register_facts(st.load_servo("feetech-sts3215-12v")) if r["name"] == "P_Coefficient")
    >>> one["address"], one["value"], one["numbers"]
    (21, 32, ['firmware.proportional_gain'])
    """
    if family_label(servo) is None:
        return None
    return [{"name": name, "address": one.register.address, "low": one.register.lower, "high": one.register.upper,
             "only": list(one.register.only), "value": one.value, "why": one.register.why,
             "numbers": [f"firmware.{number}" for number in one.numbers]}
            for name, one in registers_of(servo).items() if _settable(servo, name, one.value)]


def _settable(servo: Servo, name: str, value: int) -> bool:
    """Tell whether a register can be written with what it holds: some stand for what is not computed."""
    try:
        with_registers(servo, {name: value})
    except ServotwinError:
        return False
    return True


# --- The display of the bench: the paper's seven readings, of a servo as it stands ------------------------------------

Reading = dict[str, float | None]


def reading_of(columns: Sequence[str], row: Sequence[float], rate: float) -> Reading:
    """Return the seven readings by name (SI); None of what a servo does not have.

    Parameters
    ----------
    columns : sequence of str
        Names of what the row holds.
    row : sequence of float
        (SI)
    rate : float
        Of the transmitter [Hz].

    Examples
    --------
    >>> reading_of(("command_voltage", "pulse_width", "output_angle"), (1.425, 1.53e-3, 1.5), 50.0)["command_count"]
    582
    """
    seen = dict(zip(columns, row, strict=True))
    pulsed = "pulse_width" in seen
    return {
        "command_voltage": _shown(seen.get("command_voltage")),
        "command_count": _count(INPUT_CONVERTER, seen.get("command_voltage")),
        "feedback_voltage": _shown(seen.get("feedback_voltage")),
        "feedback_count": _count(FEEDBACK_CONVERTER, seen.get("feedback_voltage")),
        "pulse_rate": rate if pulsed else None,
        "output_angle": _shown(seen.get("output_angle")),
        "pulse_width": _shown(seen.get("pulse_width"))}


def _shown(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _count(converter: Converter, voltage: float | None) -> int | None:
    try:
        return None if voltage is None else converter.count(voltage)
    except ServotwinError:
        return None


# --- A servo as the page's controls have it: each parameter with unit, range, meaning and source; travel, -------------



SLIDER: dict[str, Any] = {
    "wide": 4.0, "of_none": (0.0, 1.0), "positive": "a positive number", "least": 1e-3,
    "floors": {"a number of at least 1": 1.0, "a number of at least 0": 0.0}, "share": "a number from 0 to 1"}
"""Where a slider ends of which nothing else is known, assumed: times the value, of 0, and what its rule leaves."""
_GEAR_DENSITY = 1400.0  # kg/m³ of a servo with motor and gear: 40 g in 40 x 20 x 36 mm, a standard size; assumed
_SHAPE = (40.0, 20.0, 36.0)  # length to width to height of standard servos [mm]; assumed for all
_STANDARD_MASS = 0.04  # kg; assumed where a sheet prints none

LOADS = (
    ("load.inertia", "J_L", "inertia", "moment of inertia that turns with the shaft", 0.0, 5e-3),
    ("load.viscous_friction", "B_L", "torque per speed", "damping of the load", 0.0, 0.05),
    ("load.torque", "", "torque", "constant torque; positive pushes towards smaller angles", -2.0, 2.0),
    ("load.coulomb_torque", "", "torque", "dry friction of the load", 0.0, 0.5),
    ("load.pendulum.mass", "m", "mass", "mass at the end of an arm", 0.0, 2.0),
    ("load.pendulum.length", "l", "length", "length of the arm", 0.01, 0.5),
    ("load.pendulum.hanging_angle", "", "angle", "angle at which the arm hangs down", -math.pi, math.pi),
)
"""Numbers of the load on the shaft: name, symbol, dimension, meaning, and ends of its slider (SI; assumed)."""


def facts_of(model: Model, scene: Scene, registers: Servo | None = None) -> dict[str, Any]:
    """Return what the page has of a servo, as plain values.

    Parameters
    ----------
    model : Model
        With its numbers of now.
    scene : Scene
        Says what hangs on the shaft.
    registers : Servo, optional
        Of which the registers are; the model's unless given.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.web.live import Scene, SceneServo
    >>> scene = Scene(servos=(SceneServo(id="hitec-hs-755hb"),))
    >>> facts = facts_of(st.PulseServo(st.load_servo("hitec-hs-755hb")), scene)
    >>> facts["pulse_us"], [round(end) for end in facts["travel_deg"]], facts["models"][:2]
    ([300.0, 2700.0], [-15, 195], ['AveragedServo', 'AveragedServoInductive'])
    """
    servo = model.servo
    names = names_of(model, load_of(scene))
    return {
        "id": servo.name, "title": servo.title or servo.name, "kind": servo.kind, "model": type(model).__name__,
        "models": models_of(servo), "signals": {name: {"unit": SIGNALS[name].unit, "meaning": SIGNALS[name].meaning}
                                                for name in names},
        "parameters": parameters_of(model), "travel_deg": travel_of(model), "pulse_us": _pulses_of(model),
        "voltage": _voltages_of(model), "horn": size_of(servo), "registers": register_facts(registers or servo),
        "loop": _loop_of(model)}


def load_facts(scene: Scene, changed: Mapping[str, float] | None = None) -> list[dict[str, Any]]:
    """Return the controls of what hangs on the shafts.

    Parameters
    ----------
    scene : Scene
    changed : mapping, optional
        Numbers that are others by now, by dotted name (SI).

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> load_facts(Scene(servos=(SceneServo(id="hitec-hs-755hb"),), load={"torque": 0.1}))[2]["value"]
    0.1
    """
    load = load_of(scene)
    found = []
    for name, symbol, dimension, meaning, low, high in LOADS:
        part, key = (load.pendulum, name.rpartition(".")[2]) if "pendulum" in name else (load, name.partition(".")[2])
        found.append(_control(name, symbol, dimension, meaning, getattr(part, key), low, high))
    return [one | {"value": (changed or {}).get(one["name"], one["value"])} for one in found]


def parameters_of(model: Model) -> list[dict[str, Any]]:
    """Return all parameters that a servo can have, those that it lacks with the value None."""
    servo, read = model.servo, {*model.requires, *model.optional}
    found = []
    for group, kind in GROUPS.items():
        for one in fields(kind):
            name, of = f"{group}.{one.name}", one.metadata
            value = servo.get(name)
            known = servo.source(name) if value is not None else None
            choices = list(of["rule"]) if isinstance(of["rule"], tuple) else None
            low, high = (None, None) if choices or of["rule"] == "table" else _range(value, of["rule"], known)
            found.append({
                **_control(name, of["symbol"], of["dimension"], of["meaning"], value, low, high),
                "origin": known.origin if known else None, "source": known.source if known else None,
                "spread": known.spread if known else "", "rule": "one of" if choices else of["rule"],
                "choices": choices, "read": name in read})
    return found


def travel_of(model: Model) -> list[float]:
    """Return the lowest and highest angle that commands may ask for [deg]."""
    servo, ends = model.servo, []
    takes_goals = isinstance(model, DigitalServo) and model.takes_goals
    for stop, goal, usual in (("stops.lower_angle", "firmware.lower_goal", -math.pi),
                              ("stops.upper_angle", "firmware.upper_goal", math.pi)):
        found = [float(value) for name in (stop, *((goal,) if takes_goals else ()))
                 if isinstance(value := servo.get(name), float)]
        if not found and not takes_goals:  # as far as its pulses go
            width = _pulses_of(model)
            found = [] if width is None else [_angle_of(model, 1e-6 * width[usual > 0.0], usual)]
        ends.append((max if usual < 0.0 else min)(found, default=usual))
    return [math.degrees(end) for end in sorted(ends)]


def models_of(servo: Servo) -> list[str]:
    """Return the names of the models that can be built of a servo."""
    found = []
    for name in SERVO_MODELS:
        try:
            model_named(name)(servo)
        except ServotwinError:
            continue
        found.append(name)
    return found


def size_of(servo: Servo) -> dict[str, float]:
    """Return how large a servo is drawn: from its mass, by the density and shape of a standard servo (assumed)."""
    printed: Any = servo.sheet.get("mass")
    mass = _STANDARD_MASS
    if isinstance(printed, dict) and isinstance(printed.get("value"), int | float):
        mass = float(printed["value"]) * factor(str(printed.get("unit", "g")), "mass")
    scale = (mass / _GEAR_DENSITY / math.prod(side * 1e-3 for side in _SHAPE)) ** (1.0 / 3.0)
    length, width, height = (scale * side * 1e-3 for side in _SHAPE)
    return {"length_m": length, "width_m": width, "height_m": height, "horn_m": 0.5 * length, "mass_kg": mass}


def _control(name: str, symbol: str, dimension: str, meaning: str, value: Any, low: float | None,
             high: float | None) -> dict[str, Any]:
    return {"name": name, "symbol": symbol, "unit": "" if dimension == "word" else si_unit(dimension),
            "dimension": dimension, "meaning": meaning, "value": list(value) if isinstance(value, tuple) else value,
            "low": low, "high": high, "shown": shown_in(dimension)}



def _range(value: Any, rule: str, known: Any) -> tuple[float | None, float | None]:
    """Return the ends of a slider: what the record states as range, wider where it says how sure it is."""
    if value is None:
        return None, None
    if known.lower is not None or known.upper is not None:
        low, high = (value if end is None else end for end in (known.lower, known.upper))
        low, high = (min(low, 0.5 * value), max(high, 2.0 * value)) if value > 0.0 else (low, high)
    elif known.std:
        low, high = value - 10.0 * known.std, value + 10.0 * known.std
    else:
        low, high = sorted((value / SLIDER["wide"], value * SLIDER["wide"])) if value else SLIDER["of_none"]
    floors = {**SLIDER["floors"], SLIDER["positive"]: SLIDER["least"] * abs(value)}
    low = max(low, floors.get(rule, low))
    return (max(low, 0.0), min(high, 1.0)) if rule == SLIDER["share"] else (low, high)


def _pulses_of(model: Model) -> list[float] | None:
    """Return the shortest and longest pulse [µs]; None of a servo that takes none."""
    if "pulse_width" not in model.available:
        return None
    return [1e6 * model.value_or(f"electronics.pulse_width_{end}", usual)
            for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True)]


def _voltages_of(model: Model) -> list[float] | None:
    """Return the command voltages of the shortest and the longest pulse, but of at least 0 [V]; None without."""
    gain = model.servo.get("electronics.voltage_to_pulse_gain")
    pulses = _pulses_of(model)
    if "command_voltage" not in model.available or pulses is None or not isinstance(gain, float):
        return None
    offset = model.value_or("electronics.command_pulse_offset", 0.0)
    return [max((1e-6 * width - offset) / gain, 0.0) for width in pulses]


def _angle_of(model: Model, width: float, usual: float) -> float:
    import numpy as np

    from servotwin import signals

    if "command_angle" not in model.available:
        return usual
    drive = model.command(signals.constant(width, unit="s")).table[0].value
    return float(model.command_signal("command_angle", np.float64(drive)))  # type: ignore[arg-type]


def _loop_of(model: Model) -> dict[str, float] | None:
    loop = loop_of(model)
    if loop is None:
        return None
    return {"stiffness_nm_per_rad": loop.stiffness, "cap_error_rad": loop.cap_error, "cap_torque_nm": loop.cap_torque}
