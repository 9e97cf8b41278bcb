"""Random pulse servos as work for the lanes: every lane another servo, load and command."""

import math

import numpy as np

from servotwin.models.terms.frame import Chip
from servotwin.models.terms.plant import Plant
from servotwin.simulation.lanes import Tables, Work, no_tables, regular_edges

STEPS = 4  # of each command


def case(lanes, *, duration, times, fields=("angle",), dtype="float64", seed=0, **changes):
    """Return random work; `changes` are fields of Plant or Chip."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return rng.uniform(low, high, lanes)

    R, K, p = between(2.0, 5.0), between(0.45, 1.1), between(0.38, 0.46)
    plant = dict.fromkeys(Plant._fields, 0.0) | {
        "J": between(3e-3, 1.4e-2), "b": between(0.0, 1e-2), "K": K, "K_b": K * between(1.0, 1.1), "R": R,
        "F_forward": between(0.05, 0.25), "F_backward": between(0.05, 0.25), "breakaway": between(1.0, 1.5),
        "coulomb": between(0.0, 0.02), "gain": 1.0, "p": p, "b_o": 0.6, "V_max": math.inf, "lower": -math.inf,
        "upper": math.inf, "I_max": math.inf, "alpha": 1.0, "V": 6.0,
         "D_drive": between(0.2, 0.4), "R_drive": R + 0.1, "R_off": R, "R_b": 0.05}
    chip = dict.fromkeys(Chip._fields, 0.0) | {
        "T_0": -0.163e-3, "slope": 1.36e-3, "p": p, "b_o": 0.6, "half_deadband": between(2e-6, 5e-6),
        "K": between(40.0, 120.0), "t_min": between(0.0, 5e-4), "longest": math.inf, "timeout": math.inf,
        "frame_period": 0.02, "R_a": R, "R_b": 0.05, "V_oc": 6.0}
    plant.update({name: value for name, value in changes.items() if name in plant})
    chip.update({name: value for name, value in changes.items() if name in chip})
    rows = np.zeros((lanes, STEPS, 7))
    rows[:, 1:, 0] = np.sort(rng.uniform(0.0, duration, (lanes, STEPS - 1)), axis=1)
    rows[:, :, 1] = rng.uniform(0.7e-3, 2.3e-3, (lanes, STEPS))
    first = np.arange(lanes) * STEPS
    return Work("pulse", Plant(**plant), Chip(**chip), Tables(first, np.full(lanes, STEPS), rows.reshape(-1, 7)),
                no_tables(lanes), between(-0.3, 0.4), regular_edges(lanes), start_at(between(0.3, 1.5)),
                np.arange(lanes) - 3, duration, np.asarray(times, float), tuple(fields), dtype)


def start_at(angle):
    """Return the states of shafts at rest at these angles."""
    start = np.zeros((7, len(angle)))
    start[0] = start[5] = angle
    return start
