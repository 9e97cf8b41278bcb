"""Logs of servos whose parameters are known: what tests of a fit compare with."""

from dataclasses import replace

import numpy as np

import servotwin as st
from servotwin.identification import Log

PENDULUM = st.loads.Pendulum(mass=0.227, length=0.587 / (0.227 * 9.80665), inertia=1.06e-2,
                             hanging_angle=0.5 * np.pi)
TRUTH = st.load_servo("hitec-hs-755hb").replace({  # what files leave out is given, so that intervals hold nothing of it
    "electronics.frame_period": 0.01, "supply.internal_resistance": 0.0, "motor.motor_viscous_friction": 0.0,
    "friction.breakaway_ratio": 1.0})
ENCODER = 2.0 * np.pi / 4096.0  # rad per count
MIDDLE = 0.5 * np.pi


def shape(motion, time, seed=0):
    """Return a command from −1 to 1."""
    rng = np.random.default_rng(seed)
    if motion == "step":
        levels = rng.uniform(0.3, 1.0, 20) * np.where(np.arange(20) % 2, -1.0, 1.0)
        return np.where(time < 0.2, 0.0, levels[np.minimum(((time - 0.2) / 0.6).astype(int), 19)])
    if motion == "prbs":
        return rng.choice([-0.6, 0.6], 500)[(time / 0.2).astype(int)]
    if motion == "triangle":
        return 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * time / 2.0))
    raise ValueError(motion)


def run(servo, motion="step", *, model=st.PulseServo, duration=2.0, sample=0.02, reach=0.8, middle=MIDDLE, seed=0,
        load=PENDULUM, time=None, signals=("output_angle",), name=None, kind="angle", delay=0.0, **more):
    """Return an exact log of a servo, without noise; a delay shifts what was measured."""
    time = np.arange(0.0, duration, sample) if time is None else np.asarray(time)
    angle = middle + reach * shape(motion, time - time[0], seed)
    command = angle if kind == "angle" else pulse_of(servo, angle)
    blank = {"output_angle": np.zeros(len(time))}
    log = Log(name=name or f"{motion} {seed}", time=time, command=command, command_kind=kind, measured=blank,
              load=st.loads.Load() if load is None else load, motion=motion, **more)
    at = log.time - log.time[0] - delay
    result = st.simulate(model(servo.replace(dict(log.parameters))), log.signal(servo.electronics.frame_period),
                         load=log.load, duration=float(max(at[-1], 0.01)))
    measured = {key: result.at(key, np.maximum(at, 0.0)) for key in signals}
    return replace(log, measured=measured)


def pulse_of(servo, angle):
    """Return the pulse width [s] at whose centre of the deadband an angle is."""
    e, p = servo.electronics, servo.potentiometer
    return e.one_shot_offset + (p.feedback_gain * angle + p.feedback_offset) * e.one_shot_slope


def noisy(log, std, seed=0, rho=0.0, count=None, offset=0.0):
    """Return a log with noise on its angle: white, or from one sample to the next with a correlation; in counts."""
    rng = np.random.default_rng(seed)
    e = rng.normal(0.0, 1.0, len(log))
    if rho:
        for k in range(1, len(e)):
            e[k] = rho * e[k - 1] + np.sqrt(1.0 - rho**2) * e[k]
    angle = log.measured["output_angle"] + offset + std * e
    if count:
        angle = count * np.round(angle / count)
    return replace(log, measured={**log.measured, "output_angle": angle})
