"""Friction M1 to M6 against their six formulas, stepped blindly: the gap closes as the steps shrink.

While the shaft slides one way the steps are of fourth order, and their limit is the engine's angle to 2e-13 rad. A
start that comes within a step is late by a part of it (second order), a stop drops what is left of it (first order);
both scatter with where in the step they fall.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from reference.drivetrain_laws import make_plant
from reference.drivetrain_steps import LAWS, creep
from reference.test_drivetrain import law_case, rotor
from validation.test_drivetrain_armature import N, driven
from validation.test_drivetrain_reference import simulate

NO_DROPS = {f"{group}__{name}": None for group, name in (
    ("supply", "bridge_drop_voltage"), ("supply", "bridge_drop_resistance"), ("supply", "internal_resistance"),
    ("motor", "brush_drop_voltage"))}
END = 0.1  # s


def case_of(law, seed, inductance):
    """A braked bridge without drops, so that the armature voltage is the drive times the supply's."""
    more = frozenset({"pendulum", "inductance"} if inductance else {"pendulum"})
    return replace(law_case(law, seed, more).replace(**NO_DROPS), duration=END)


def profile(case):
    """Armature voltage between the switchings of a run [s, V], and the run."""
    drives = [event for event in simulate(case, np.array([END])).events if event.kind.startswith("drive")]
    sign = {"drive forward": 1.0, "drive backward": -1.0, "drive ends": 0.0}
    V = case.values["supply.open_circuit_voltage"]
    voltage = [(0.0, 0.0), *((event.time, V * sign[event.kind]) for event in drives)]
    times = np.array([t for t, _ in voltage] + [END])
    return voltage, simulate(case, times)["output_angle"]


def gaps(law, case, steps):
    """Largest gap of the angle [rad] at the switchings, by size of the steps."""
    voltage, angle = profile(case)
    R = rotor(make_plant(case.values, case.load), case.values)
    return [float(np.max(np.abs(creep(R, law, voltage, END, h, start=angle[0])[0] - angle[1:]))) for h in steps]


@pytest.mark.long(but="False-21-M3")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("inductance", "seed"), [(False, 21), (True, 24)])
def test_small_steps_come_to_the_same_angle(law, inductance, seed):
    """Starts, stops and reversals under pulses: each may cost a step at a few rad/s, and no more."""
    case = case_of(law, seed, inductance)
    voltage, angle = profile(case)
    assert len(voltage) >= 2
    assert np.ptp(angle) > 0.01
    assert gaps(law, case, [2e-5])[0] < 4.0 * 2e-5


@pytest.mark.parametrize("law", LAWS)
def test_halving_the_steps_closes_the_gap(law):
    """First order at least, through five pulses or so and the stops between them."""
    steps = 4e-4 * 0.5 ** np.arange(4)
    errors = np.array(gaps(law, case_of(law, 21, False), steps))
    assert np.all(errors < 4.0 * steps)
    assert errors[-1] < 0.3 * errors[0]


# --- one drive, one direction: nothing but RK4 ------------------------------------------------------------------------

SHARES = {
    "M1": {}, "M2": {}, "M3": {"load_friction": 0.2}, "M4": {"load_friction": 0.2, "load_friction_stribeck": 0.1},
    "M5": {"load_friction_motor": 0.2, "load_friction_external": 0.15, "load_friction_motor_stribeck": 0.1,
           "load_friction_external_stribeck": 0.05}}
SHARES["M6"] = SHARES["M5"] | {"load_friction_motor_quad": 0.3, "load_friction_external_quad": 0.5}


def one_drive(law):
    """A servo driven forward against a torque towards -q; Stribeck with the exponent 2 is smooth at rest too."""
    friction = {"coulomb_torque_forward": 0.1 / N, "coulomb_torque_backward": 0.12 / N, "stribeck_speed": 2.0 * N,
                "stribeck_exponent": 2.0, "breakaway_ratio": 1.0 if law in ("M1", "M3") else 1.4} | SHARES[law]
    values = {f"friction.{name}": value for name, value in friction.items()}
    return driven(values, duration=END, load={"torque": 0.08, "viscous_friction": 5e-3, "inertia": 1e-3})


@pytest.mark.parametrize("law", LAWS)
def test_while_it_slides_one_way_the_steps_converge_with_order_four(law):
    """To the engine's angle and to no other."""
    coarse, half, fine = gaps(law, one_drive(law), [2e-3, 1e-3, 1e-4])
    assert math.log2(coarse / half) == pytest.approx(4.0, abs=0.15)
    assert fine < 2e-12
