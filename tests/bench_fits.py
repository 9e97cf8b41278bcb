"""Random servos on the emulated bench, recorded as a user would, and fitted: do the intervals hold the truth?"""

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

import servotwin as st
from servotwin.bench.recording import About, Limits, Wiring, experiments, record
from servotwin.bench.rehearsal import rehearsal_rig
from servotwin.identification import identify
from servotwin.identification.fitting.search.free import nominal
from servotwin.loads import Constant, Inertia, Load

BASE = "hitec-hs-755hb"
FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain", "electronics.deadband")
SPREAD = {"motor.armature_resistance": 1.2, "motor.rotor_inertia": 1.4, "electronics.stretcher_gain": 1.3,
          "electronics.deadband": 1.3}
OFF = {"motor.armature_resistance": 1.15, "motor.torque_constant": 0.9, "motor.back_emf_constant": 0.9,
       "motor.rotor_inertia": 1.3, "friction.coulomb_torque_forward": 0.8, "friction.coulomb_torque_backward": 0.8,
       "electronics.stretcher_gain": 0.8, "electronics.deadband": 1.2}
LIMITS = Limits(kind="pulse_width", low=0.9e-3, high=2.1e-3, voltage=6.0, current=5.0)
LOAD = Load() + Inertia(2e-3) + Constant(0.2)  # a weight on a drum: without a torque only ratios are seen
ABOUT = About(servo="emulated", load={"inertia": 2e-3, "torque": 0.2})
MOTIONS = "steps,prbs,ramp,staircase"


class Judged(NamedTuple):
    held: dict[str, bool]
    off: dict[str, float]  # half widths from the estimate to the truth
    rms: float  # V


def servo_of(seed):
    """Return a random servo."""
    rng, base = np.random.default_rng(1000 + seed), st.load_servo(BASE)

    def about(name, share):
        return base.get(name) * share ** rng.uniform(-1.0, 1.0)

    constant, coulomb = about("motor.torque_constant", 1.15), about("friction.coulomb_torque_forward", 1.3)
    return base.replace({
        **{name: about(name, share) for name, share in SPREAD.items()}, "motor.torque_constant": constant,
        "motor.back_emf_constant": constant, "friction.coulomb_torque_forward": coulomb,
        "friction.coulomb_torque_backward": coulomb, "supply.open_circuit_voltage": LIMITS.voltage})


def recorded(servo, seed, folder, *, rate="frame", duration=4.0, mock=False):
    """Record a servo on the emulated bench, and return its logs."""
    wiring = Wiring(channels=("tap",))
    for one in experiments(MOTIONS, LIMITS, duration=duration, seed=seed):
        rig, _ = rehearsal_rig(st.PulseServo(servo), LOAD, wiring, rate=rate, seed=seed, mock=mock)
        rig.open()
        try:
            record(rig, one, Path(folder) / f"{one.name}.csv", limits=LIMITS, about=ABOUT)
        finally:
            rig.close()
    return st.read_logs(folder)


def judged(seed, **options):
    """Record and fit a random servo, and return how its intervals do."""
    servo = servo_of(seed)
    with tempfile.TemporaryDirectory() as folder:
        logs = recorded(servo, seed, folder, **options)
    begin = servo.replace({name: factor * servo.get(name) for name, factor in OFF.items()})
    fit = identify(logs, begin, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, diagnose=False)
    held, off = {}, {}
    for name, (low, high, _) in fit.intervals().items():
        if name in FREE:
            true = nominal(servo, name)
            held[name] = low <= true <= high
            off[name] = (fit.estimates[name] - true) / (0.5 * (high - low))
    return Judged(held, off, fit.noise.get("feedback_voltage", float("nan")))
