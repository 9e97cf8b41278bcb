"""The digital servos of the part `digital`, what they are told and what they carry; and the plain one beside them."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "digital_servo"))
import digital_fleet

DURATION, EVERY = 1.0, 0.02  # s
LEROBOT = {"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32, "Acceleration": 254,
           "Maximum_Acceleration": 254}
SPRING = {"gear.stiffness": 150.0, "gear.damping": 0.05}  # N m/rad, N m s/rad
INERTIAS, TORQUE = (1e-3, 5e-3), 0.3  # kg m², N m either way
FEETECH = {"STS3215 12 V": "feetech-sts3215-12v", "STS3215 7.4 V": "feetech-sts3215-7v4"}


def servos() -> dict[str, st.Servo]:
    """Return all by name."""
    found = {}
    for name, servo in FEETECH.items():
        found[name] = st.load_servo(servo)
        found[f"{name}, LeRobot"] = st.feetech_sts(LEROBOT, servo=servo)
    found["XL330-M288"] = st.load_servo("dynamixel-xl330-m288")
    sprung = {f"{name}, spring": servo.replace(SPRING | _inertia(servo)) for name, servo in found.items()}
    return found | sprung


def _inertia(servo: st.Servo) -> dict[str, float]:
    return {} if servo.gear.output_inertia else {"gear.output_inertia": 1e-6}


def plain() -> st.DigitalServo:
    """Return the servo of the scenario `digital_servo`: no play, load friction, drop or trip."""
    return digital_fleet.model_of_fleet()


def _levels(every: float) -> Callable[[np.random.Generator], st.signals.Signal]:
    def goals(rng: np.random.Generator) -> st.signals.Signal:
        at = np.arange(0.0, DURATION, every)
        return st.signals.samples(at, rng.uniform(-1.0, 1.0, len(at)), unit="rad", hold="previous")
    return goals


def _sines(rng: np.random.Generator) -> st.signals.Signal:
    """Two sines as a program writes them, 50 times a second."""
    at, (slow, fast) = np.arange(0.0, DURATION, EVERY), rng.uniform((0.3, 1.0), (1.0, 3.0))
    a, b = rng.uniform(0.0, 6.0, 2)
    goals = 0.6 * np.sin(2.0 * np.pi * slow * at + a) + 0.2 * np.sin(2.0 * np.pi * fast * at + b)
    return st.signals.samples(at, goals, unit="rad", hold="previous")


def _constant(rng: np.random.Generator) -> st.signals.Signal:
    return st.signals.constant(float(rng.uniform(-1.0, 1.0)), unit="rad")


GOALS = {"new every 20 ms": _levels(EVERY), "new every 0.3 s": _levels(0.3), "two sines": _sines,
         "constant": _constant}


def told(goals: str, lanes: int) -> list[st.signals.Signal]:
    """Return what each lane is told, 64 different goals."""
    rng = np.random.default_rng(4)
    some = [GOALS[goals](rng) for _ in range(64)]
    return [some[k % 64] for k in range(lanes)]


def load(inertia: float) -> st.loads.Load:
    """Return what hangs on all shafts; `parameters` has the torque of each lane."""
    return st.loads.Inertia(inertia) + st.loads.Constant(TORQUE)


def parameters(lanes: int) -> dict[str, np.ndarray]:
    """Return torques, to and fro in turns, so that goals and torques meet in all ways."""
    return {"load.torque": TORQUE * np.where(np.arange(lanes) // 2 % 2, 1.0, -1.0)}
