"""Synthetic pendulum logs of a servo whose parameters are known: 48 of 6 s at 200 Hz, motions as in BAM's data."""

from typing import NamedTuple

import numpy as np

import servotwin as st
from servotwin.logs import Log
from servotwin.models import Model

LOGS, DURATION, SAMPLE = 48, 6.0, 0.005  # s
MIDDLE = 0.5 * np.pi  # rad, where the arm hangs
NOISE = 1e-3  # rad, white, on every sample
NOMINAL = st.load_servo("hitec-hs-755hb")
COMMON = ("motor.armature_resistance", "output_torque_constant", "output_inertia",
          "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")
FREE = {
    st.PulseServo: (*COMMON, "electronics.stretcher_gain", "electronics.deadband", "potentiometer.feedback_gain"),
    st.BoundedServo: (*COMMON, "electronics.bridge_gain", "electronics.voltage_deadband",
                      "potentiometer.feedback_gain"),
}
_SPREAD = {"potentiometer.feedback_gain": 1.1}  # of the truth about the nominal servo, as a factor either way
_WIDE = {"potentiometer.feedback_gain": 1.25}  # of the search


class Task(NamedTuple):
    """What a fit gets, and what only the judge knows."""

    logs: list[Log]
    begin: st.Servo  # where the search begins: random
    bounds: dict[str, tuple[float, float]]
    truth: dict[str, float]  # SI, by free name
    exact: np.ndarray  # angles without noise, shape (logs, times) [rad]


def nominal(name: str) -> float:
    """Return a free parameter of the nominal servo (SI)."""
    reduction = NOMINAL.gear.gear_reduction
    if name == "output_torque_constant":
        return reduction * NOMINAL.motor.torque_constant
    return reduction**2 * NOMINAL.motor.rotor_inertia if name == "output_inertia" else NOMINAL.get(name)


def servo_with(values: dict[str, float]) -> st.Servo:
    """Return the nominal servo with some free parameters replaced."""
    N = NOMINAL.gear.gear_reduction
    own = {name: x for name, x in values.items() if "." in name}
    K = values["output_torque_constant"] / N
    return NOMINAL.replace({**own, "motor.torque_constant": K, "motor.back_emf_constant": K,
                            "motor.rotor_inertia": values["output_inertia"] / N**2})


def drawn(free: tuple[str, ...], factors: dict[str, float], usual: float, rng: np.random.Generator) -> dict[str, float]:
    """Return random parameters about the nominal ones, evenly in their logarithm."""
    return {name: nominal(name) * factors.get(name, usual) ** rng.uniform(-1.0, 1.0) for name in free}


def motions(time: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Return one motion of each kind [rad]: two sines, a sine of growing rate, lift and drop, up and down."""
    a, b, c, d = rng.uniform(0.4, 0.9, 4) * rng.choice([-1.0, 1.0], 4)
    smooth = (1.0 - np.cos(np.pi * np.clip(time / 4.0, 0.0, 1.0))) / 2.0
    return [0.7 * a * np.sin(2.0 * time) + 0.3 * a * np.sin(9.0 * time), b * np.sin(time**2),
            np.where(time < 4.5, c * smooth, 0.0),
            d * (1.0 - np.cos(2.0 * np.pi * time / DURATION)) / 2.0 * np.where(time < 3.0, 1.0, -1.0)]


def make(kind: type[Model], seed: int) -> Task:
    """Return the logs of a random servo, and where to look for it."""
    rng = np.random.default_rng(seed)
    free = FREE[kind]
    truth, begin = drawn(free, _SPREAD, 1.4, rng), drawn(free, _WIDE, 3.0, rng)
    model = kind(servo_with(truth))
    time = SAMPLE * np.arange(round(DURATION / SAMPLE) + 1)
    electronics, pot = NOMINAL.electronics, NOMINAL.potentiometer
    names = ("two sines", "sine of t squared", "lift and drop", "up and down")
    parts = []
    for k in range(LOGS // len(names)):
        mass, length = rng.uniform(0.1, 0.35), rng.uniform(0.08, 0.16)
        load = st.loads.Pendulum(mass=mass, length=length, hanging_angle=MIDDLE)
        for motion, angle in zip(names, motions(time, rng), strict=True):
            width = electronics.one_shot_offset + electronics.one_shot_slope * (
                pot.feedback_gain * (MIDDLE + angle) + pot.feedback_offset)
            parts.append((f"{motion} {k}", motion, width, load))
    commands = [st.signals.samples(time, width, unit="s", hold="previous") for _, _, width, _ in parts]
    exact = st.simulate_many(model, commands, duration=DURATION, load=[load for *_, load in parts],
                             output_times=time)["output_angle"]
    logs = [Log(name=name, motion=motion, time=time, command=width, command_kind="pulse_width", load=load,
                measured={"output_angle": q + NOISE * rng.standard_normal(len(q))})
            for (name, motion, width, load), q in zip(parts, exact, strict=True)]
    bounds = {name: (nominal(name) / _WIDE.get(name, 3.0), nominal(name) * _WIDE.get(name, 3.0)) for name in free}
    return Task(logs, servo_with(begin), bounds, truth, exact)


def error(kind: type[Model], task: Task, servo: st.Servo) -> float:
    """Return the rms of what a servo predicts less the truth without noise, over all logs [rad]."""
    found = st.simulate_many(kind(servo), [log.signal() for log in task.logs], duration=DURATION,
                             load=[log.load for log in task.logs], output_times=task.logs[0].time)["output_angle"]
    return float(np.sqrt(np.mean((found - task.exact) ** 2)))
