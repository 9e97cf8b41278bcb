"""Several servos on one bus against the independent reference, which solves all of them as one system."""

import math

import numpy as np
import pytest

import servotwin as st
from reference.drivetrain import simulate_bus
from reference.drivetrain_cases import command_of, load_of, random_case, servo_of
from reference.drivetrain_circuit import Source

SHORT, LONG = 0.1, 0.2  # s: each servo has started, most are on their way | ten frames, all have met each other
BATTERY, REGULATOR = (6.0, 0.4, None), (6.0, 0.4, 1.2)
FEW = [((), BATTERY, 7), ((), REGULATOR, 7), (("coast",), BATTERY, 7), (("inductance",), REGULATOR, 7),
       (("backlash", "stribeck"), REGULATOR, 7), (("heat", "m5"), BATTERY, 7)]
ALL = ("inductance", "coast", "heat", "m4", "backlash")
MANY = [(terms, supply, seed) for seed in range(2) for supply in (BATTERY, REGULATOR)
        for terms in ((), ("coast",), ("inductance",), ("coast", "inductance"), ("backlash", "stribeck"),
                      ("coulomb", "spring", "stops"), ALL)]


def fleets(terms, supply, seed, longest, servos=3):
    """Return the fleet, and the traces of the reference at its output times, of `longest` seconds at most."""
    V_oc, R_b, I_max = supply
    cases = [random_case(10 * seed + k, frozenset(terms)) for k in range(servos)]
    duration = min(longest, *(case.duration for case in cases))
    times = np.linspace(0.0, duration, 41)
    model = st.PulseServoInductive if "inductance" in terms else st.PulseServo
    fleet = st.simulate_bus(
        {f"servo {k}": (model(servo_of(case)), command_of(case), load_of(case)) for k, case in enumerate(cases)},
        supply=st.Supply(open_circuit_voltage=V_oc, internal_resistance=R_b, current_limit=I_max), duration=duration,
        output_times=times, initial={f"servo {k}": dict(case.initial) for k, case in enumerate(cases)})
    source = Source(V_oc, R_b, math.inf if I_max is None else I_max)
    return fleet.raise_if_failed(), simulate_bus(cases, source, times)


def agrees(terms, supply, seed, longest):
    fleet, traces = fleets(terms, supply, seed, longest)
    for result, trace in zip(fleet.values(), traces, strict=True):
        np.testing.assert_allclose(result["output_angle"], trace.output_angle, rtol=0.0, atol=1e-8)
        away = ~trace.near_event(fleet.time)
        np.testing.assert_allclose(result["armature_current"][away], trace.armature_current[away], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(fleet.bus_voltage[away], trace.bus_voltage[away], rtol=0.0, atol=1e-6)
    energy = fleet.energy
    turnover = abs(energy.supply) + energy.winding + energy.friction + abs(energy.load)
    assert abs(energy.residual) <= 1e-9 * turnover


@pytest.mark.slow
@pytest.mark.parametrize(("terms", "supply", "seed"), FEW)
def test_three_servos_on_one_bus(terms, supply, seed):
    agrees(terms, supply, seed, longest=SHORT)


@pytest.mark.slow
@pytest.mark.parametrize(("terms", "supply", "seed"), MANY)
def test_many_fleets_on_one_bus(terms, supply, seed):
    agrees(terms, supply, seed, longest=LONG)


@pytest.mark.parametrize("terms", [(), ("inductance", "coast", "limit"), ("backlash", "heat", "m6", "wiper")])
@pytest.mark.parametrize("seed", range(3))
def test_one_servo_on_a_bus_is_the_servo_alone(terms, seed):
    case = random_case(seed, frozenset(terms))
    servo = servo_of(case)
    model = (st.PulseServoInductive if "inductance" in terms else st.PulseServo)(servo)
    supply = st.Supply(**{name: servo.get(f"supply.{name}")
                          for name in ("open_circuit_voltage", "internal_resistance", "current_limit")})
    fleet = st.simulate_bus({"one": (model, command_of(case), load_of(case))}, supply=supply, duration=case.duration,
                            initial={"one": dict(case.initial)})
    alone = st.simulate(model, command_of(case), duration=case.duration, load=load_of(case), initial=dict(case.initial))
    np.testing.assert_allclose(fleet["one"]["output_angle"], alone["output_angle"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(fleet.bus_voltage, alone["bus_voltage"], rtol=0.0, atol=1e-9)
