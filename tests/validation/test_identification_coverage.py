"""Whether 95 % intervals hold the truth in 95 % of draws: ten servos, twenty draws of noise each, as in a measured rig.

The rig is that of the Miuzei data: 50 Hz logs of a 12-bit encoder, pulses at 100 Hz, a dead time of 45 to 60 ms, a
pendulum of 0.587 N m and 1.06e-2 kg m², angle noise of about 0.05 degrees. Of 200 draws at 95 %, the share that holds
the truth scatters by 1.5 %: 90.5 to 98.5 % are three standard deviations.
"""

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import ENCODER, PENDULUM, TRUTH, noisy, run
from servotwin.identification import identify
from servotwin.identification.fitting.free import nominal

FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain")
NAMES = (*FREE, "delay", "angle_offset")
DISC = st.loads.Inertia(1.06e-2) + st.loads.Constant(0.3)  # closed form: a tenth of the time of a pendulum
MOTIONS = ("step", "prbs", "triangle")
STD = np.radians(0.05)
SERVOS, DRAWS = 10, 20


def rig(seed, load):
    """Return a random servo, what is true of its logs, and the logs without noise."""
    rng = np.random.default_rng(1000 + seed)

    def about(name, share):
        return TRUTH.get(name) * float(np.exp(rng.uniform(-np.log(share), np.log(share))))

    constant, coulomb = about("motor.torque_constant", 1.15), about("friction.coulomb_torque_forward", 1.3)
    servo = TRUTH.replace({
        "motor.armature_resistance": about("motor.armature_resistance", 1.2), "motor.torque_constant": constant,
        "motor.back_emf_constant": constant, "motor.rotor_inertia": about("motor.rotor_inertia", 1.4),
        "friction.coulomb_torque_forward": coulomb, "friction.coulomb_torque_backward": coulomb,
        "electronics.stretcher_gain": about("electronics.stretcher_gain", 1.3)})
    truth = {name: nominal(servo, name) for name in FREE}
    truth |= {"delay": rng.uniform(0.045, 0.06), "angle_offset": rng.uniform(-0.02, 0.02)}
    logs = [run(servo, motion, seed=10 * seed + k, kind="pulse_width", delay=truth["delay"], duration=2.0, load=load)
            for k, motion in enumerate(MOTIONS)]
    return servo, truth, logs


def held(load, *, draws, rho=0.0, std=STD, count=ENCODER, loss="huber", servos=SERVOS):
    """Return for each name the share of intervals that hold the truth [%]."""
    hits = {name: [] for name in NAMES}
    for seed in range(servos):
        servo, truth, logs = rig(seed, load)
        for draw in range(draws):
            offset = truth["angle_offset"] + (0.0 if std else ENCODER * (draw / draws - 0.5))
            seen = [noisy(log, std, seed=(seed, draw, k), rho=rho, count=count, offset=offset)
                    for k, log in enumerate(logs)]
            fit = identify(seen, servo, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, loss=loss)
            there = {**truth, "angle_offset": offset}
            for name, interval in fit.intervals().items():
                hits[name].append(interval.lower <= there[name] <= interval.upper)
    return {name: 100.0 * np.mean(found) for name, found in hits.items()}


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    share = held(PENDULUM, draws=DRAWS)
    assert {name: value for name, value in share.items() if not 90.5 <= value <= 98.5} == {}


@pytest.mark.slow
def test_they_do_so_with_least_squares():
    share = held(DISC, draws=10, loss="squares")
    assert {name: value for name, value in share.items() if not 89.0 <= value <= 100.0} == {}


@pytest.mark.slow
def test_they_do_so_where_noise_lasts():
    """Noise of which half is left after a sample: more than a rig has, less than a wrong model makes."""
    share = held(DISC, draws=10, rho=0.5)
    assert {name: value for name, value in share.items() if not 89.0 <= value <= 100.0} == {}


@pytest.mark.slow
def test_they_are_not_far_off_where_an_encoder_counts_without_noise():
    """Counts of a shaft at rest are always wrong by the same: the least that any noise does is missing."""
    share = held(DISC, draws=10, std=0.0)
    assert np.mean(list(share.values())) > 80.0
