"""Random pulse servos as work for the lanes: every lane another servo, load and command."""

import math
from dataclasses import replace

import numpy as np

from servotwin.models.engine.lanes import Lanes
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.frame import NO_CHIP
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.load import NO_LOAD
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import Sensor
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.simulation.lanes.packed import Asked, Packed, Torques, Work

STEPS = 4  # of each command


def case(lanes, *, duration, times, fields=("angle",), dtype="float64", seed=0, changes=None):
    """Return random work; `changes` are numbers of terms ("motor.L") or of the chip ("chip.noise")."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return rng.uniform(low, high, lanes)

    R, K, p = between(2.0, 5.0), between(0.45, 1.1), between(0.38, 0.46)
    numbers = Numbers(
        shaft=Shaft(J=between(3e-3, 1.4e-2), b=between(0.0, 1e-2), J_out=0.0, b_out=0.0),
        motor=Motor(K=K, K_b=K * between(1.0, 1.1), R=R, L=0.0),
        friction=NO_FRICTION._replace(F_forward=between(0.05, 0.25), F_backward=between(0.05, 0.25),
                                      breakaway=between(1.0, 1.5)),
        load=NO_LOAD._replace(coulomb=between(0.0, 0.02)), source=Source(V=6.0, R_b=0.05, I_max=math.inf),
        bridge=Bridge(D_drive=between(0.2, 0.4), R_drive=R + 0.1, off=Off(0.0, R, 0.0), silence=Off(0.0, R, 0.0),
                      V_br=0.0),
        sensor=Sensor(p=p, b_o=0.6, half_slack=0.0, step=0.0))
    chip = NO_CHIP._replace(
        T_0=-0.163e-3, slope=1.36e-3, half_deadband=between(2e-6, 5e-6), K=between(40.0, 120.0),
        t_min=between(0.0, 5e-4), longest=math.inf, timeout=math.inf, frame_period=0.02, V_oc=6.0)
    changes = changes or {}
    numbers = replaced(numbers, {name: value for name, value in changes.items() if not name.startswith("chip.")})
    chip = chip._replace(**{name[5:]: value for name, value in changes.items() if name.startswith("chip.")})
    rows = np.zeros((lanes, STEPS, 7))
    rows[:, 1:, 0] = np.sort(rng.uniform(0.0, duration, (lanes, STEPS - 1)), axis=1)
    rows[:, :, 1] = rng.uniform(0.7e-3, 2.3e-3, (lanes, STEPS))
    first = np.arange(lanes) * STEPS
    torque, start = between(-0.3, 0.4), start_at(between(0.3, 1.5))
    none = np.zeros(lanes, np.int64)
    own = Lanes(numbers, chip, start, torque, np.arange(lanes) - 3, rows.reshape(-1, 7), first,
                np.full(lanes, STEPS), np.zeros(0), none, none - 1, ACCURACY, None)
    packed = Packed("pulse", own, np.zeros((0, 2)), Torques(np.zeros((0, 7)), none, none))
    return Work(packed, Asked(duration, np.asarray(times, float), (), dtype, ACCURACY), tuple(fields))


def with_lanes(work, **changes):
    """Return work whose lanes have others in some of their arrays."""
    return replace(work, packed=work.packed._replace(lanes=work.packed.lanes._replace(**changes)))


def replaced(numbers, changes):
    """Return numbers with others in some terms, by dotted name."""
    for name, value in changes.items():
        field, _, rest = name.partition(".")
        numbers = numbers._replace(**{field: replaced(getattr(numbers, field), {rest: value}) if rest else value})
    return numbers


def start_at(angle):
    """Return the states of shafts at rest at these angles."""
    start = np.zeros((7, len(angle)))
    start[0] = start[5] = angle
    return start
