"""Bus servos of legs and arms, with play, load friction and bridge drop; what they are told and what they carry."""

from dataclasses import fields

import numpy as np

import servotwin as st
from servotwin.parameters import GROUPS

LEROBOT = {"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32, "Acceleration": 254,
           "Maximum_Acceleration": 254}
FEETECH = {"12 V": "feetech-sts3215-12v", "7.4 V": "feetech-sts3215-7v4"}
SERVOS = {f"{name}{more}": servo for name, catalog in FEETECH.items()
          for more, servo in (("", st.load_servo(catalog)), (", LeRobot", st.feetech_sts(LEROBOT, servo=catalog)))}
EVERY = 0.02  # s
TORQUES = (0.3, -0.3, 0.0, 0.05, -0.02)  # N m
INERTIAS = (1e-3, 5e-3)  # kg m²


def _levels(every):
    def goals(rng, duration):
        at = np.arange(0.0, duration, every)
        return at, rng.uniform(-1.0, 1.0, len(at))
    return goals


def _sines(rng, duration):
    at, (slow, fast) = np.arange(0.0, duration, EVERY), rng.uniform((0.3, 1.0), (1.0, 3.0))
    a, b = rng.uniform(0.0, 6.0, 2)
    return at, 0.6 * np.sin(2.0 * np.pi * slow * at + a) + 0.2 * np.sin(2.0 * np.pi * fast * at + b)


def _constant(rng, duration):
    return np.array([0.0]), rng.uniform(-1.0, 1.0, 1)


GOALS = {"new every 20 ms": _levels(EVERY), "new every 0.3 s": _levels(0.3), "two sines": _sines, "constant": _constant}


def goals_of(name, seed, duration=1.0):
    """Return times [s] and goals [rad] of one kind."""
    return GOALS[name](np.random.default_rng(seed), duration)


def written(times, goals):
    """Return these goals as a signal."""
    if len(times) == 1:
        return st.signals.constant(float(goals[0]), unit="rad")
    return st.signals.samples(times, goals, unit="rad", hold="previous")


def values_of(servo):
    """Return the numbers of a servo by group and field, as the references take them."""
    found = {name: {field.name: getattr(getattr(servo, name), field.name) for field in fields(kind)}
             for name, kind in GROUPS.items()}
    groups = {name: {key: value for key, value in group.items() if value is not None} for name, group in found.items()}
    groups["motor"].pop("armature_inductance", None)
    return {name: group for name, group in groups.items() if group}
