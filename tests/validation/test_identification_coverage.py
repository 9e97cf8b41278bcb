"""Whether 95 % intervals hold the truth in 95 % of fits, on logs of a bench that shares no code with the package.

`benchmarks/identification/run.py coverage` has the table: ten conditions, ten benches each. Here are two of each. The
intervals of one fit miss together: with a correlation of 0.3 between them, 160 intervals miss 8 ± 4.9, and the 16 of
a condition 0.8 ± 1.5. Limits are four and five of these above: a false alarm in thousands.
"""

import numpy as np
import pytest

from identification.synthetic_logs import ENCODER, TRUTH, noisy, run
from reference.rig_draws import CONDITIONS
from reference.rig_fits import judged
from servotwin import loads
from servotwin.identification import identify
from servotwin.identification.fitting.search.free import nominal

SEEDS = (20, 21)
MOST_OF_ALL, MOST_OF_ONE = 28, 8


@pytest.mark.slow
def test_intervals_hold_the_truth_under_every_condition():
    fits = {condition: [judged(condition, seed) for seed in SEEDS] for condition in CONDITIONS}
    missed = {condition: [name for fit in found for name, held in fit.held.items() if not held]
              for condition, found in fits.items()}
    assert {condition: names for condition, names in missed.items() if len(names) > MOST_OF_ONE} == {}
    assert sum(map(len, missed.values())) <= MOST_OF_ALL
    every = [fit for found in fits.values() for fit in found]
    assert sum(len(fit.endless) for fit in every) < 0.1 * sum(len(fit.held) for fit in every)
    # Nor are they wide: in half widths the truth is off by 0.51 rms, and by 0.3 if they were 1.7 times too wide
    off = [x for fit in every for name, x in fit.off.items() if name != "delay"]
    assert np.sqrt(np.mean(np.square(off))) > 0.3


@pytest.mark.slow
def test_the_deepest_valley_is_found_where_pulses_come_when_they_do():
    """With pulses that come alike for all logs another valley looks deeper: a fit ended in it at 1.10 mrad."""
    assert judged("short logs", 3).rms < 1e-3


# The same with many draws of noise on few servos, where chance scatters less. The logs are the package's own, their rig
# is that of the Miuzei data: 50 Hz, a 12-bit encoder, pulses at 100 Hz, a dead time of 45 to 60 ms, 0.05 degrees rms.

FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain")
NAMES = (*FREE, "delay", "angle_offset")
DISC = loads.Inertia(1.06e-2) + loads.Constant(0.3)  # closed form: a tenth of the time of a pendulum
MOTIONS = ("step", "prbs", "triangle")
STD = np.radians(0.05)
SERVOS, DRAWS = 10, 10


def bench(seed):
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
    logs = [run(servo, motion, seed=10 * seed + k, kind="pulse_width", delay=truth["delay"], duration=2.0, load=DISC)
            for k, motion in enumerate(MOTIONS)]
    return servo, truth, logs


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["huber", "squares"])
def test_intervals_hold_the_truth_as_often_as_they_say(loss):
    """Of 100 draws at 95 %, 89 to 100 are three standard deviations; the delay is told by a range, which holds more."""
    hits = {name: [] for name in NAMES}
    for seed in range(SERVOS):
        servo, truth, logs = bench(seed)
        for draw in range(DRAWS // 2):
            seen = [noisy(log, STD, seed=(seed, draw, k), count=ENCODER, offset=truth["angle_offset"])
                    for k, log in enumerate(logs)]
            fit = identify(seen, servo, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, loss=loss)
            for name, interval in fit.intervals().items():
                hits[name].append(interval.lower <= truth[name] <= interval.upper)
    share = {name: 100.0 * np.mean(found) for name, found in hits.items()}
    assert {name: value for name, value in share.items() if value < 86.0} == {}
