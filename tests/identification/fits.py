"""Fits of logs of a servo that is known, and whether they find it."""

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification import identify
from servotwin.identification.fitting.search.free import nominal

DISC = st.loads.Inertia(1.06e-2) + st.loads.Constant(0.3)
FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain"]
BOUNDED = [*FREE[:4], "electronics.bridge_gain"]
OFF = {"motor.armature_resistance": 1.15, "motor.torque_constant": 0.9, "motor.back_emf_constant": 0.9,
       "motor.rotor_inertia": 0.7, "friction.coulomb_torque_forward": 1.3, "friction.coulomb_torque_backward": 1.3,
       "electronics.stretcher_gain": 0.8, "electronics.bridge_gain": 0.8}
WRONG = TRUTH.replace({name: factor * TRUTH.get(name) for name, factor in OFF.items()})
MOTIONS = ("step", "prbs", "triangle")
STD = 1e-3  # rad


def some(servo=TRUTH, std=STD, motions=MOTIONS, **more):
    logs = [run(servo, motion, seed=k, **{"load": DISC, "kind": "pulse_width", "delay": 0.05, "duration": 1.5, **more})
            for k, motion in enumerate(motions)]
    return [noisy(log, std, seed=k) for k, log in enumerate(logs)] if std else logs


def fitted(logs, servo=TRUTH, **more):
    plain = {"free": FREE, "priors": None, "starts": 1, "compare_with": (), "holdout": 0, "diagnose": False}
    return identify(logs, servo, **{**plain, **more})


def true(name, servo=TRUTH):
    return {"delay": 0.05, "angle_offset": 0.0}.get(name) if name in ("delay", "angle_offset") \
        else nominal(servo, name)


def near(fit, widths=4.0, servo=TRUTH, but=()):
    """Check that every value is within some half widths of 1.96 standard errors."""
    for name, interval in fit.intervals().items():
        if name in but:
            continue
        half = 0.5 * (interval.upper - interval.lower) / 1.96
        assert half > 0.0, name
        assert abs(fit.estimates[name] - true(name, servo)) < widths * half, name
