"""Random servos, loads and commands whose results are frozen: `frozen_results.npz`, which `test_frozen.py` reads.

    python tests/models/frozen_servos.py --write

writes the file anew from the engine as it is (a quarter of an hour). That may be done only where a change of results is
meant, and said in the CHANGELOG; a change of form, speed or structure leaves the file as it is.

    python tests/models/frozen_servos.py --renew 1e-9

takes over the results of those cases that another method has moved by more than is allowed and by no more than that;
draws, times and allowances stay. It tells which, and which have moved further or differ in their events: these stay.

Everything is drawn from seeds, nothing from the catalog. A case is its number, which fixes model and features, and
its draw, which fixes all numbers; the file keeps the draws that rounding alone does not move (`frozen_search.py`).
"""

import math
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

import servotwin as st
from servotwin.models import MODELS
from servotwin.models.outputs import SIGNALS as ALL_SIGNALS

FILE = Path(__file__).with_name("frozen_results.npz")
LATER = ("duty", "goal_angle", "reference_angle", "trip", "load_angle")  # than the results were frozen
SIGNALS = tuple(name for name in ALL_SIGNALS if name not in LATER)
TIMES = 6  # of each case
BUSES = 20
MOST_ON_BUS = 3
TRAVEL = (0.2, 1.9)  # rad, of commands
SMALL = 1.0 / 280.0  # what a load is scaled by to hang on a motor without a gear

_ONE_LAW = ("K_l", "K_ls")
BATCHED = (st.PulseServo, st.PulseServoInductive, st.BoundedServo, st.DigitalServo)
_TWO_LAWS = ("K_m", "K_e", "K_ms", "K_es", "K_mq", "K_eq")
_HEAT = {"thermal.winding_capacity": 0.6, "thermal.housing_capacity": 6.0, "thermal.winding_to_housing": 10.0,
         "thermal.housing_to_ambient": 20.0}

# What a feature of a pulse servo sets, by its name; u(low, high) draws a number
SERVO = {
    "brake": lambda u: {"electronics.off_state": "brake"},
    "coast": lambda u: {"electronics.off_state": "coast"},
    "soft supply": lambda u: {"supply.internal_resistance": u(0.1, 0.6)},
    "bridge voltage": lambda u: {"supply.bridge_drop_voltage": u(0.1, 0.6)},
    "bridge resistance": lambda u: {"supply.bridge_drop_resistance": u(0.05, 0.4)},
    "brush drop": lambda u: {"motor.brush_drop_voltage": u(0.1, 0.5)},
    "regulator": lambda u: {"supply.current_limit": u(0.3, 1.0)},
    "play": lambda u: {"gear.backlash": u(0.005, 0.03), "gear.output_inertia": u(3e-4, 2e-3),
                       "friction.bearing_coulomb_torque": 0.0},  # younger than the results
    "output inertia": lambda u: {"gear.output_inertia": u(3e-4, 2e-3)},
    "sensor play": lambda u: {"potentiometer.backlash": u(3e-3, 0.02)},
    "sensor table": lambda u: {"potentiometer.linearity_angle": [0.0, 0.6, 1.1, 1.7, 2.2],
                               "potentiometer.linearity_error": [u(-0.02, 0.02) for _ in range(5)]},
    "quantisation": lambda u: {"potentiometer.quantisation": u(5e-4, 5e-3)},
    "noise": lambda u: {"potentiometer.noise": u(3e-4, 3e-3)},
    "rc stretcher": lambda u: {"electronics.stretcher_time_constant": u(5e-3, 0.03)},
    "minimum drive": lambda u: {"electronics.minimum_drive_time": u(3e-4, 1.5e-3)},
    "no deadband": lambda u: {"electronics.deadband": 0.0},
    "injection": lambda u: {"electronics.back_emf_injection": u(1e-3, 6e-3) * (-1.0 if u(0.0, 1.0) < 0.3 else 1.0)},
    "supply coupling": lambda u: {"electronics.supply_coupling": u(2e-3, 0.02),
                                  "supply.internal_resistance": u(0.1, 0.6)},
    "timeout": lambda u: {"electronics.pulse_timeout": u(3e-3, 0.025)},
    "breakaway": lambda u: {"friction.breakaway_ratio": u(1.1, 1.8)},
    "stribeck": lambda u: {"friction.breakaway_ratio": u(1.1, 1.8), "friction.stribeck_speed": u(10.0, 200.0)} | (
        {"friction.stribeck_exponent": u(0.6, 2.0)} if u(0.0, 1.0) < 0.7 else {}),
    "K_l": lambda u: {"friction.load_friction": u(0.03, 0.2)},
    "K_ls": lambda u: {"friction.load_friction_stribeck": u(0.03, 0.2), "friction.stribeck_speed": u(10.0, 200.0)},
    "K_m": lambda u: {"friction.load_friction_motor": u(0.03, 0.2)},
    "K_e": lambda u: {"friction.load_friction_external": u(0.03, 0.2)},
    "K_ms": lambda u: {"friction.load_friction_motor_stribeck": u(0.03, 0.2),
                       "friction.stribeck_speed": u(10.0, 200.0)},
    "K_es": lambda u: {"friction.load_friction_external_stribeck": u(0.03, 0.2),
                       "friction.stribeck_speed": u(10.0, 200.0)},
    "K_mq": lambda u: {"friction.load_friction_motor_quad": u(0.1, 0.4), "friction.stribeck_speed": u(10.0, 200.0)},
    "K_eq": lambda u: {"friction.load_friction_external_quad": u(0.1, 0.6), "friction.stribeck_speed": u(10.0, 200.0)},
    "no friction": lambda u: {"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0},
    "sided friction": lambda u: {"friction.coulomb_torque_backward": u(3e-4, 1.6e-3)},
    "heat": lambda u: {name: value * u(0.5, 2.0) for name, value in _HEAT.items()} | {
        "thermal.ambient": u(270.0, 310.0), "thermal.magnet_coefficient": u(-3e-3, -5e-4)},
    "negative offset": lambda u: {"electronics.one_shot_offset": u(-2e-4, -1e-4)},
    "voltage deadband": lambda u: {"electronics.voltage_deadband": u(5e-3, 0.05)},
    "dead stop": lambda u: {"stops.restitution": 0.0},
    "bouncing stop": lambda u: {"stops.restitution": u(0.2, 0.8)},
    "refused pulses": lambda u: {},
}
LOADS = {
    "inertia": lambda u, s: st.loads.Inertia(s * s * u(2e-4, 3e-3)),
    "viscous": lambda u, s: st.loads.Viscous(s * s * u(2e-3, 0.03)),
    "dry load": lambda u, s: st.loads.Coulomb(s * u(0.01, 0.08)),
    "torque": lambda u, s: st.loads.Constant(s * u(0.05, 0.3) * (-1.0 if u(0.0, 1.0) < 0.5 else 1.0)),
    "pendulum": lambda u, s: st.loads.Pendulum(
        mass=s * u(0.05, 0.15), length=u(0.05, 0.15), hanging_angle=u(-1.0, 2.0),
        inertia=None if s == 1.0 else s * s * u(2e-4, 2e-3)),
    "spring": lambda u, s: st.loads.Spring(s * s * u(0.1, 0.6), u(0.0, 2.0)),
    "recorded": None,  # it needs the duration
}
COMMANDS = ("constant", "ramp", "sine", "chirp", "prbs", "samples", "linear samples", "pulse train")
UNITS = ("us", "volts")
STARTS = ("initial angle", "initial speed")
NEED_TORQUE = ("breakaway", "K_e", "K_es", "K_mq", "K_eq")  # a load without which they do nothing
STOPS = ("dead stop", "bouncing stop")
_ALL = (*SERVO, *LOADS, *COMMANDS, *UNITS, *STARTS, "frame period")

_BASIC = (*LOADS, *(name for name in COMMANDS if name != "pulse train"), *STARTS)
_MEAN = (*_BASIC, *UNITS, "output inertia", "no friction", "sided friction", "negative offset")
_PULSED = tuple(name for name in _ALL if name != "voltage deadband")
FEATURES = {
    "dc-motor": _BASIC,
    "geared-motor": (*_BASIC, "output inertia"),
    "averaged": _MEAN,
    "averaged-inductive": _MEAN,
    "bounded": (*_MEAN, "voltage deadband", "bridge voltage", "breakaway", *STOPS),
    "pulse": _PULSED,
    "pulse-inductive": _PULSED,
}
MIXED = {"dc-motor": 4, "geared-motor": 5, "averaged": 6, "averaged-inductive": 6, "bounded": 50, "pulse": 96,
         "pulse-inductive": 90}
WITH_ALL = {"bounded": 4, "pulse": 8, "pulse-inductive": 8}

# Features that exclude each other
_CLASHES = [
    {"brake", "coast"}, set(STOPS), {"no friction", "sided friction"}, {"no friction", "breakaway"},
    {"no friction", "stribeck"}, set(COMMANDS), set(UNITS), {"volts", "pulse train"}, {"volts", "frame period"},
    {"pulse train", "frame period"}, *({a, b} for a in _ONE_LAW for b in _TWO_LAWS)]


class Case(NamedTuple):
    """One run: a servo of some model, its load and command, and what it starts from."""

    model: st.models.Model
    command: st.signals.Signal
    load: st.loads.Load
    duration: float
    initial: dict[str, float]
    seed: int

    def with_servo(self, changes):
        """Return the case with other numbers of the servo."""
        return self._replace(model=type(self.model)(self.model.servo.replace(changes)))


class Frozen(NamedTuple):
    """What is kept of a case; a signal that a model has not is nan."""

    signals: np.ndarray  # (18, times)
    last: np.ndarray  # angle and speed at the end
    events: int
    status: int


def _compatible(names, count):
    """Return the first names that go together, `count` of them at most."""
    chosen = []
    for name in names:
        if len(chosen) < count and not any(name in clash and clash & set(chosen) for clash in _CLASHES):
            chosen.append(name)
    return tuple(sorted(chosen, key=_ALL.index))


@cache
def plan():
    """Return model and features of every case: each feature alone, then mixed, then all at once."""
    numbers = np.random.default_rng(1)
    found = []
    for model, features in FEATURES.items():
        found += [(model, ()), *((model, (name,)) for name in features)]
        for _ in range(MIXED[model]):
            found.append((model, _compatible(numbers.permutation(features).tolist(), numbers.integers(2, 7))))
        for _ in range(WITH_ALL.get(model, 0)):
            found.append((model, _compatible(numbers.permutation(features).tolist(), len(features))))
    return tuple(found)


def _uniform(*seed):
    """Return what draws a number between two bounds; each seed has its own stream."""
    return np.random.default_rng(seed).uniform


def servo_of(features, *seed, stops=None):
    """Return a random servo with these features; every feature draws from a stream of its own."""
    u = _uniform(*seed, 1000)
    K = 3.7e-3 * u(0.85, 1.2)
    F, slope = 9e-4 * u(0.6, 1.3), 1.36e-3 * u(0.95, 1.05)
    values = {
        "motor.armature_resistance": u(2.4, 3.8), "motor.armature_inductance": u(2e-4, 1e-3),
        "motor.torque_constant": K, "motor.back_emf_constant": K * u(1.0, 1.05), "motor.rotor_inertia": u(5e-8, 1.2e-7),
        "motor.motor_viscous_friction": u(2e-8, 2e-7), "gear.gear_reduction": u(250.0, 300.0),
        "friction.coulomb_torque_forward": F, "friction.coulomb_torque_backward": F,
        "friction.zero_crossing_slope": u(0.5, 10.0),
        "electronics.bridge_gain": u(25.0, 60.0), "electronics.comparator_gain": u(0.6, 1.1),
        "electronics.voltage_to_pulse_gain": 1.09e-3, "electronics.command_pulse_offset": u(-5e-5, 5e-5),
        "electronics.one_shot_slope": slope, "electronics.one_shot_offset": u(5e-5, 1.5e-4),
        "electronics.deadband": u(3e-6, 1.2e-5), "electronics.stretcher_gain": u(40.0, 120.0),
        "electronics.frame_period": u(0.012, 0.02), "potentiometer.feedback_gain": 0.42 * u(0.97, 1.03),
        "potentiometer.feedback_offset": u(0.55, 0.62), "supply.open_circuit_voltage": u(4.8, 7.4)}
    for name in features:
        if name in SERVO:
            values |= SERVO[name](_uniform(*seed, _ALL.index(name)))
    values["electronics.pulse_to_voltage_gain"] = 1.0 / slope
    values["electronics.command_offset"] = (
        values["electronics.command_pulse_offset"] - values["electronics.one_shot_offset"]) / slope
    values |= stops or {}
    groups = {}
    for name, value in values.items():
        group, key = name.split(".")
        groups.setdefault(group, {})[key] = value
    return st.servo_from_values("frozen", groups)


def load_of(features, duration, scale, *seed):
    """Return the sum of all loads among the features."""
    total = st.loads.as_load(None)
    for name in features:
        u = _uniform(*seed, _ALL.index(name))
        if name == "recorded":
            times = np.linspace(0.0, 1.01 * duration, 6) + np.array([0.0, *u(-0.04, 0.04, 4), 0.0]) * duration
            total = total + st.loads.Recorded(times, scale * u(-0.2, 0.2, 6))
        elif name in LOADS:
            total = total + LOADS[name](u, scale)
    return total


def command_of(shape, a, b, duration, unit, frame_period, convert, *seed):
    """Return a command from the angle `a` to `b` and in between [rad]; `convert` gives an angle in its unit."""
    u = _uniform(*seed, 1001)
    given = {"unit": unit} | ({} if frame_period is None else {"frame_period": frame_period})
    y_a, y_b = convert(a), convert(b)
    if shape == "constant":
        return st.signals.constant(y_b, **given)
    if shape == "ramp":
        return st.signals.ramp(y_a, y_b, at=u(0.0, 0.2) * duration, over=u(0.2, 0.7) * duration, **given)
    wave = {"mean": 0.5 * (y_a + y_b), "amplitude": 0.5 * abs(y_b - y_a)} | given
    if shape == "sine":
        phase = math.copysign(0.5 * math.pi, y_a - y_b) + u(-0.3, 0.3)  # about y_a at the start
        return st.signals.sine(frequency=u(2.0, 12.0), phase=phase, **wave)
    if shape == "chirp":
        return st.signals.chirp(start_frequency=u(1.0, 4.0), end_frequency=u(6.0, 15.0), duration=duration, **wave)
    if shape == "prbs":
        return st.signals.prbs(y_a, y_b, bit_time=u(0.015, 0.04), duration=duration, seed=int(u(0.0, 500.0)), **given)
    if shape in ("samples", "linear samples"):
        times = duration * np.array([0.0, u(0.05, 0.25), u(0.3, 0.45), u(0.5, 0.65), u(0.7, 0.9)])
        shares = np.array([0.0, u(0.8, 1.0), u(0.3, 1.0), u(0.0, 0.7), u(0.0, 1.0)])
        return st.signals.samples(times, y_a + shares * (y_b - y_a), hold="linear" if "linear" in shape else "previous",
                                  **given)
    if shape == "pulse train":
        edges = u(0.0, 5e-3) + np.cumsum(u(3e-3, 0.025, math.ceil(duration / 3e-3)))
        shares = np.clip(u(-0.1, 1.0, edges.size), 0.0, 1.0)
        shares[1:5] = 1.0
        keep = edges < duration
        keep[0] = True
        return st.signals.pulse_train(edges[keep], (y_a + shares * (y_b - y_a))[keep], unit=unit)
    return st.signals.step(y_a, y_b, at=u(2e-3, 0.025), **given)


def case(model, features, *seed):
    """Return a case with these features; the seeds draw its numbers."""
    u = _uniform(*seed, 1002)
    a = u(0.4, 1.7)
    far = u(0.3, 0.9) * (-1.0 if u(0.0, 1.0) < 0.5 else 1.0)
    b = a + far if TRAVEL[0] <= a + far <= TRAVEL[1] else min(max(a - far, TRAVEL[0]), TRAVEL[1])
    duration = u(0.12, 0.3) if len(features) < 2 else u(0.05, 0.6) if len(features) < 7 else u(0.06, 0.2)
    upwards = math.copysign(1.0, b - a)
    stop = next((name for name in STOPS if name in features), None)
    stops = {}
    if stop is not None:
        between, behind = a + u(0.15, 0.6) * (b - a), a - upwards * u(0.1, 0.4)
        stops = {"stops.lower_angle": min(between, behind), "stops.upper_angle": max(between, behind)}
        if len(features) < 7:
            duration = max(duration, 0.25)
    if "refused pulses" in features:
        stops = stops | _width_limits(servo_of(features, *seed), a, b, u)
    servo = servo_of(features, *seed, stops=stops)
    motor = model in ("dc-motor", "geared-motor")
    kind = "V" if motor or "volts" in features else "us" if {"us", "pulse train", "frame period", *STOPS} & set(
        features) else "deg"
    shape = next((name for name in COMMANDS if name in features), "step")
    period = _uniform(*seed, _ALL.index("frame period"))(3e-3, 0.02) if "frame period" in features else None
    command = command_of(shape, a, b, duration, kind, period, _converter(servo, kind, motor), *seed)
    initial = {}
    names = ("motor_angle", "motor_speed") if model == "dc-motor" else ("output_angle", "output_speed")
    if shape == "constant":
        initial[names[0]] = a
    if "initial angle" in features:
        initial[names[0]] = a + u(0.02, 0.12) * (b - a)
    if "initial speed" in features:
        initial[names[1]] = u(1.0, 6.0) * upwards
    hanging = ("torque",) if len(features) == 1 and features[0] in NEED_TORQUE else features
    load = load_of(hanging, duration, SMALL if model == "dc-motor" else 1.0, *seed)
    return Case(MODELS[model](servo), command, load, duration, initial, int(u(0.0, 1e6)))


def _width_limits(servo, a, b, u):
    """Return a limit of the pulses that refuses some of those between the angles `a` and `b`."""
    widths = [1e-6 * _converter(servo, "us", False)(angle) for angle in (a, b)]
    limit = widths[0] + u(0.4, 0.8) * (widths[1] - widths[0])
    return {"electronics.pulse_width_max": limit, "electronics.pulse_width_min": 3e-4} if widths[1] > widths[0] else {
        "electronics.pulse_width_min": limit, "electronics.pulse_width_max": 2.7e-3}


def _converter(servo, unit, motor):
    """Return what gives an angle [rad] in the unit of a command."""
    if motor:
        return lambda angle: 6.0 * (angle - 1.05) / 0.85
    if unit == "deg":
        return math.degrees
    chip, sensor = servo.electronics, servo.potentiometer

    def width(angle):
        return chip.one_shot_offset + chip.one_shot_slope * (sensor.feedback_gain * angle + sensor.feedback_offset)
    if unit == "us":
        return lambda angle: 1e6 * width(angle)
    return lambda angle: (width(angle) - chip.command_pulse_offset) / chip.voltage_to_pulse_gain


def case_of(number, draw):
    """Return a case of the plan by its number; the draw fixes its numbers."""
    return case(*plan()[number], number, draw)


class BusCase(NamedTuple):
    """Some servos on one supply."""

    servos: tuple[Case, ...]
    supply: st.Supply
    duration: float
    seed: int


def bus_features(number):
    """Return what the servos of a bus have: model and features of each; off states alternate."""
    numbers = np.random.default_rng([2, number])
    own = [name for name in _PULSED if name not in ("soft supply", "regulator", "brake", "coast", "recorded")]
    found = []
    for k in range(2 + number % 2):
        off = ("brake", "coast")[(number + k * (number // 4)) % 2]
        mixed = numbers.permutation(own).tolist()
        found.append((("pulse", "pulse-inductive")[(number // 2 + k) % 2],
                      _compatible([off, *mixed], 1 + numbers.integers(0, 4))))
    return tuple(found)


def bus_of(number, draw):
    """Return a bus by its number; a battery, or every other time a regulator."""
    u = _uniform(3, number, draw)
    servos = tuple(case(*one, 3, number, k, draw) for k, one in enumerate(bus_features(number)))
    limit = u(0.6, 2.0)
    supply = st.Supply(open_circuit_voltage=u(4.8, 7.4), internal_resistance=u(0.05, 0.4),
                       current_limit=limit if number % 4 >= 2 else None)
    return BusCase(servos, supply, min(one.duration for one in servos), int(u(0.0, 1e6)))


def _frozen(result, times):
    """Return what is kept of a result."""
    signals = np.full((len(SIGNALS), len(times)), np.nan)
    for name in result.model.available:
        signals[SIGNALS.index(name)] = result[name][:len(times)]
    shaft = result.model.layout[:2]  # angle and speed
    return Frozen(signals, np.array([result[name][-1] for name in shaft]), len(result.events), result.status.code)


def run(one, times):
    """Return a case's frozen results at `times` [s], and the result itself."""
    result = st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                         seed=one.seed, output_times=[*times, one.duration])
    return _frozen(result, times), result


def run_bus(bus, times):
    """Return the frozen results of all servos of a bus, the voltage of the bus, shape (times,), and the fleet."""
    names = [f"servo {k}" for k in range(len(bus.servos))]
    fleet = st.simulate_bus(
        {name: (one.model, one.command, one.load) for name, one in zip(names, bus.servos, strict=True)},
        supply=bus.supply, duration=bus.duration, output_times=[*times, bus.duration], seed=bus.seed,
        initial={name: one.initial for name, one in zip(names, bus.servos, strict=True)})
    return [_frozen(fleet[name], times) for name in names], fleet.bus_voltage[:len(times)], fleet


def is_batched(number):
    """Tell whether the lanes of a case are frozen too."""
    return MODELS[plan()[number][0]] in BATCHED


def run_lanes(one, times, dtype="float64", parameters=None):
    """Return signals (lanes, 18, times) and status (lanes,) of a case by `simulate_many`; one lane unless columns."""
    outputs = one.model.available if dtype == "float64" else ("output_angle",)
    batch = st.simulate_many(one.model, one.command, duration=one.duration, load=one.load, output_times=times,
                             initial=one.initial, seeds=one.seed, dtype=dtype, outputs=outputs,
                             parameters=parameters)
    signals = np.full((len(batch), len(SIGNALS), len(times)), np.nan)
    for name in outputs:
        signals[:, SIGNALS.index(name)] = batch[name]
    return signals, np.array(batch.status)


def moves(before, after):
    """Return how far numbers of shape (..., times) moved, relative to the largest of each row but at least to 1.

    What is nan in both has not moved; what is nan in one of them has moved by inf.
    """
    size = np.max(np.abs(before), axis=-1, keepdims=True, initial=1.0, where=np.isfinite(before))
    with np.errstate(invalid="ignore"):
        moved = np.where(before == after, 0.0, np.abs(after - before) / size)
    return np.where(np.isnan(before) & np.isnan(after), 0.0, np.where(np.isnan(moved), np.inf, moved))


def described(number, draw):
    """Return what a failure says of a case."""
    model, features = plan()[number]
    return f"case {number} ({model}: {', '.join(features) or 'plain'}; draw {draw})"


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from models.frozen_search import renew, write

    if sys.argv[1:] == ["--write"]:
        write()
    elif sys.argv[1:2] == ["--renew"] and len(sys.argv) == 3:
        renew(float(sys.argv[2]))
    else:
        sys.exit(__doc__)
