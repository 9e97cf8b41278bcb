"""Guards along a coupled leg as power series and as straight lines, against the guards of the general engine."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.legs.coupled_legs import first_below
from servotwin.models.engine.legs.coupled_units import Unit, pressing_of, share_of
from servotwin.models.state.modes import (
    BACKWARD,
    CURRENT_BACKWARD,
    CURRENT_FORWARD,
    FORWARD,
    INSIDE,
    ON_BACKWARD,
    ON_FORWARD,
    Mode,
    Vector,
)
from servotwin.models.state.records import object_of
from simulation.test_bus_digital import LOAD

TERMS, LENGTH, HALF = 6, 1e-3, 2e-3


def inside(seed):
    """Return a servo inside its play whose motor and output move by random series, and how far ahead its motor is."""
    rng, unit = np.random.default_rng(seed), object_of(Unit)
    unit.mode.mesh, unit.mode.motor, unit.mode.contact = INSIDE, FORWARD, BACKWARD
    unit.law.moves = unit.law.apart = 1.0
    unit.numbers.play.half = HALF
    unit.y.q, unit.y.q_m = 1.0, 1.0 + HALF * rng.uniform(-0.9, 0.9)
    for n in range(TERMS + 1):
        unit.speed[n], unit.output[n] = rng.normal(size=2) * 2.0 * 40.0**n / math.factorial(n)
    return unit


def falls(polynomial):
    """Return where a polynomial, above zero at 0, falls below within a leg [s]; inf: it does not."""
    roots = polynomial.roots()
    real = np.sort(roots[np.abs(roots.imag) < 1e-12].real)
    real = real[(real > 0.0) & (real < LENGTH)]
    return real[0] if len(real) else math.inf


@pytest.mark.parametrize("alike", [3e-5, 1e-4, 3.2e-4])  # s
@pytest.mark.parametrize("closing", [-1e-6, 1e-6])  # rad/s, at first
def test_teeth_that_would_leave_each_other_again_within_a_leg_meet(alike, closing):
    """Their accelerations cross, so that the way between them turns twice: at first open, then closed, then open."""
    unit, b = inside(1), 1e6
    unit.y.q_m = 1.0 - HALF + 1e-11
    unit.speed[:TERMS + 1] = [5.0 - closing, -b * alike, 0.5 * b] + [0.0] * (TERMS - 2)
    unit.output[:TERMS + 1] = [5.0] + [0.0] * TERMS
    way = np.polynomial.Polynomial([1e-11, -closing, -0.5 * b * alike, b / 6.0])
    assert first_below(unit, guards.MEET_BACKWARD, TERMS, LENGTH) == pytest.approx(falls(way), rel=1e-9)
    assert way(LENGTH) > 0.0
    assert first_below(unit, guards.MEET_FORWARD, TERMS, LENGTH) == math.inf


@pytest.mark.parametrize("seed", range(60))
def test_when_teeth_meet_and_speeds_end_is_a_root_of_their_series(seed):
    unit = inside(seed)
    motor, output = (np.polynomial.Polynomial(x[:TERMS + 1]) for x in (unit.speed, unit.output))
    ahead = (motor - output).integ() + (unit.y.q_m - unit.y.q)
    wanted = {guards.MEET_FORWARD: HALF - ahead, guards.MEET_BACKWARD: HALF + ahead}
    if unit.speed[0] > 0.0:
        wanted[guards.MOTOR_SPEED] = motor
    if unit.output[0] < 0.0:
        wanted[guards.SPEED] = -output
    for kind, polynomial in wanted.items():
        found = first_below(unit, kind, TERMS, LENGTH)
        assert found == pytest.approx(falls(polynomial), rel=1e-12, abs=1e-15)


def test_a_guard_that_dips_below_zero_between_its_ends_is_seen():
    unit = inside(0)
    unit.y.q_m = unit.y.q + HALF - 1e-6
    unit.speed[:] = [8e-3, -16.0] + [0.0] * (len(unit.speed) - 2)  # it goes 2 µrad ahead, and comes back
    unit.output[:] = [0.0] * len(unit.output)
    found = first_below(unit, guards.MEET_FORWARD, TERMS, LENGTH)
    assert found == pytest.approx((8e-3 - math.sqrt(8e-3**2 - 4 * 8.0 * 1e-6)) / 16.0, rel=1e-9)
    unit.speed[0] = 4e-3  # half a µrad
    assert first_below(unit, guards.MEET_FORWARD, TERMS, LENGTH) == math.inf


@pytest.mark.parametrize("friction", [0.0, 0.2])
@pytest.mark.parametrize("contact", [FORWARD, BACKWARD])
@pytest.mark.parametrize("mesh", [ON_FORWARD, ON_BACKWARD])
def test_how_teeth_press_is_a_straight_line_in_torque_and_speed(friction, contact, mesh):
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({
        "friction.load_friction_motor": friction, "friction.load_friction_external": 0.5 * friction}))
    numbers, tau, way = model.pack(LOAD), 0.3, 1.0 if contact == FORWARD else -1.0
    for zone, share in ((CURRENT_FORWARD, 1), (CURRENT_BACKWARD, -1)):
        mode = Mode(zone, contact, mesh, 0, share if friction > 0.0 else 0)
        line, gear = pressing_of(numbers, mode, tau), share_of(numbers, mode, tau)
        for u, w in ((5.0, 0.5), (-3.0, 2.0), (0.5, 0.01)):
            y = Vector(0.2, way * w, 0.0, 298.15, 298.15, 0.2, way * w)
            torque = currents.drive_torque(numbers, zone, u, y)
            per_torque = line.forward if torque > 0.0 else line.backward
            assert line.still + per_torque * torque + line.speed * way * w == pytest.approx(
                contacts.pressing_along(numbers, mode, u, tau, y), rel=1e-12)
            if friction > 0.0:
                assert gear.still + gear.forward * torque + gear.speed * way * w == pytest.approx(
                    share * contacts.through_gear(numbers, mesh, torque, tau, y), rel=1e-12)

