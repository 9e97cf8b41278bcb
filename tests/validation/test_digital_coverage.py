"""Whether 95 % intervals of digital servos hold the truth in 95 % of fits, by the rule of analog ones.

The rig is that of the Miuzei data: 50 Hz, pulses at 100 Hz, a dead time of 45 to 60 ms, 1 mrad rms; ticks of 1 to 5 ms
begin anywhere in each run.
"""

import numpy as np
import pytest

from identification.digital_servos import PULSED, digital_log
from servotwin.identification import identify
from servotwin.identification.fitting.search.free import nominal

FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "firmware.proportional_gain", "firmware.derivative_gain")
SPREAD = {"motor.armature_resistance": 1.2, "motor.rotor_inertia": 1.4, "firmware.proportional_gain": 1.3,
          "firmware.derivative_gain": 1.3}
OFF = {"motor.armature_resistance": 1.15, "motor.torque_constant": 0.9, "motor.back_emf_constant": 0.9,
       "motor.rotor_inertia": 1.3, "friction.coulomb_torque_forward": 0.8, "friction.coulomb_torque_backward": 0.8,
       "firmware.proportional_gain": 1.2, "firmware.derivative_gain": 0.7}
GIVEN = {"supply.internal_resistance": 0.0, "friction.breakaway_ratio": 1.0,
         "motor.motor_viscous_friction": PULSED.get("motor.motor_viscous_friction")}
"""Numbers that are the truth's, and said to be: intervals are those of chance alone, and neither narrow nor wide."""
MOTIONS = ("step", "prbs", "triangle", "step")
TICKS = (1e-3, 2e-3, 5e-3)  # s
SERVOS, DRAWS = 9, 4


def bench(seed):
    """Return a random servo, and what is true of it and its rig."""
    rng = np.random.default_rng(1000 + seed)

    def about(name, share):
        return PULSED.get(name) * share ** rng.uniform(-1.0, 1.0)

    constant, coulomb = about("motor.torque_constant", 1.15), about("friction.coulomb_torque_forward", 1.3)
    servo = PULSED.replace({
        **{name: about(name, share) for name, share in SPREAD.items()}, "motor.torque_constant": constant,
        "motor.back_emf_constant": constant, "friction.coulomb_torque_forward": coulomb,
        "friction.coulomb_torque_backward": coulomb, "firmware.control_period": TICKS[seed % len(TICKS)]})
    return servo, {name: nominal(servo, name) for name in FREE} | {"delay": rng.uniform(0.045, 0.06)}, rng


@pytest.mark.slow
def test_intervals_of_digital_servos_hold_the_truth_as_often_as_they_say():
    """Of 36 draws at 95 %, 30 to 36 are three standard deviations; without a phase of ticks of 1 ms they held 55 %."""
    hits, off = {}, []
    for seed in range(SERVOS):
        servo, truth, rng = bench(seed)
        begin = servo.replace({name: factor * servo.get(name) for name, factor in OFF.items()} | GIVEN)
        for draw in range(DRAWS):
            logs = [digital_log(servo, motion, seed=100 * seed + 10 * draw + k, duration=1.6, phase=rng.uniform(),
                                delay=truth["delay"]) for k, motion in enumerate(MOTIONS)]
            fit = identify(logs, begin, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, diagnose=False)
            for name, true in truth.items():
                low, high, _ = fit.intervals()[name]
                hits.setdefault(name, []).append(low <= true <= high)
                off += [(fit.estimates[name] - true) / (0.5 * (high - low))] if name in FREE else []
    share = {name: float(np.mean(found)) for name, found in hits.items()}
    assert {name: value for name, value in share.items() if value < 0.83} == {}
    assert np.mean([share[name] for name in FREE]) > 0.92
    # In half widths: 0.51, if these are as wide as they say; one search of 36 that ends in another valley makes 0.63
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 0.7
