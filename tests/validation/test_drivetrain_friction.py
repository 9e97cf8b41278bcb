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
from reference.drivetrain_cases import random_case
from reference.drivetrain_steps import LAWS, Rotor, creep
from validation.test_drivetrain_armature import N, driven
from validation.test_drivetrain_reference import simulate

LETTERS = {"K_l": "load_friction", "K_ls": "load_friction_stribeck", "K_m": "load_friction_motor",
           "K_e": "load_friction_external", "K_ms": "load_friction_motor_stribeck",
           "K_es": "load_friction_external_stribeck", "K_mq": "load_friction_motor_quad",
           "K_eq": "load_friction_external_quad"}
NO_DROPS = {f"{group}__{name}": None for group, name in (
    ("supply", "bridge_drop_voltage"), ("supply", "bridge_drop_resistance"), ("supply", "internal_resistance"),
    ("motor", "brush_drop_voltage"))}
END = 0.1  # s


def case_of(law, seed, inductance):
    """A braked bridge without drops, so that the armature voltage is the drive times the supply's."""
    terms = {"pendulum", *{"M1": (), "M2": ("stribeck",)}.get(law, (law.lower(), "stribeck"))}
    case = random_case(seed, frozenset(terms | ({"inductance"} if inductance else set())))
    speed = case.values.get("friction.stribeck_speed", 100.0)  # M1 and M3 do not read it
    plain = {"friction__breakaway_ratio": 1.0} if law in ("M1", "M3") else {}
    return replace(case.replace(friction__stribeck_speed=speed, **plain, **NO_DROPS), duration=END)


def rotor(case):
    P = make_plant(case.values, case.load)
    F = {name.removeprefix("friction."): x for name, x in case.values.items() if name.startswith("friction.")}
    return Rotor(
        N=P.N, J=P.J, k_a=P.K / P.N, k_b=P.K_b / P.N, R_a=P.R, L_a=P.L, B_m=P.B_m / P.N**2, B_L=P.B_L,
        F_forward=F["coulomb_torque_forward"], F_backward=F["coulomb_torque_backward"],
        r=F.get("breakaway_ratio", 1.0), v_s=F["stribeck_speed"], alpha=F.get("stribeck_exponent", 1.0),
        **{letter: F.get(name, 0.0) for letter, name in LETTERS.items()}, coulomb=P.coulomb, torque=P.external)


def profile(case):
    """Armature voltage between the switchings of a run [s, V], and the run."""
    drives = [event for event in simulate(case, np.array([END])).events if event.kind.startswith("drive")]
    sign = {"drive forward": 1.0, "drive backward": -1.0, "drive ends": 0.0}
    V = case.values["supply.open_circuit_voltage"]
    voltage = [(0.0, 0.0), *((event.time, V * sign[event.kind]) for event in drives)]
    times = np.array([t for t, _ in voltage] + [END])
    return voltage, simulate(case, times)["output_angle"]


def gaps(case, steps):
    """Largest gap of the angle [rad] at the switchings, by size of the steps."""
    voltage, angle = profile(case)
    R, law = rotor(case), case_law(case)
    return [float(np.max(np.abs(creep(R, law, voltage, END, h, start=angle[0])[0] - angle[1:]))) for h in steps]


def case_law(case):
    """The law that a case's numbers make."""
    F = {name.removeprefix("friction.") for name in case.values}
    if "load_friction_motor_quad" in F:
        return "M6"
    if "load_friction_motor" in F:
        return "M5"
    static = "load_friction_stribeck" in F or case.values.get("friction.breakaway_ratio", 1.0) > 1.0
    return ("M4" if static else "M3") if "load_friction" in F else ("M2" if static else "M1")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("inductance", "seed"), [(False, 21), (True, 24)])
def test_small_steps_come_to_the_same_angle(law, inductance, seed):
    """Starts, stops and reversals under pulses: each may cost a step at a few rad/s, and no more."""
    case = case_of(law, seed, inductance)
    assert case_law(case) == law
    voltage, angle = profile(case)
    assert len(voltage) >= 2
    assert np.ptp(angle) > 0.01
    assert gaps(case, [2e-5])[0] < 4.0 * 2e-5


@pytest.mark.parametrize("law", LAWS)
def test_halving_the_steps_closes_the_gap(law):
    """First order at least, through five pulses or so and the stops between them."""
    steps = 4e-4 * 0.5 ** np.arange(4)
    errors = np.array(gaps(case_of(law, 21, False), steps))
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
    coarse, half, fine = gaps(one_drive(law), [2e-3, 1e-3, 1e-4])
    assert math.log2(coarse / half) == pytest.approx(4.0, abs=0.15)
    assert fine < 2e-12
