"""Creep and bands: shafts whose friction depends on speed and torques, against a fine numerical solution."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import servotwin as st
from servotwin.models.engine import bands, contacts, creep, currents
from servotwin.models.engine.modes import NOWHERE, RIGID, Mode, Vector
from servotwin.models.terms.bridge import NO_BRIDGE, Off
from servotwin.models.terms.friction import NO_FRICTION, creeping_speed
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source

FINE = 1e-12  # tolerance of a creep
FRICTION = NO_FRICTION._replace(F_forward=0.2, F_backward=0.25, breakaway=1.5, varies=1.0)
LAWS = {
    "M2": {"w_s": 0.05, "alpha": 1.0}, "M2, steep": {"w_s": 0.05, "alpha": 2.5},
    "M2, flat": {"w_s": 0.02, "alpha": 0.6},
    "M3": {"K_m": 0.1, "K_e": 0.1, "breakaway": 1.0},
    "M4": {"K_m": 0.1, "K_e": 0.1, "K_ms": 0.05, "K_es": 0.05, "w_s": 0.05, "alpha": 1.5},
    "M5": {"K_m": 0.1, "K_e": 0.6},
    "M6": {"K_m": 0.1, "K_e": 0.2, "K_ms": 0.05, "K_es": 0.1, "K_mq": 0.3, "K_eq": 0.2, "w_s": 0.1, "alpha": 1.5}}
SOURCES = {"battery": Source(6.0, 0.05, math.inf), "regulator": Source(6.0, 0.05, 0.9)}
LOADS = (0.0, 0.3, -0.6)


def numbers_of(law, source="battery"):
    return Numbers(
        motor=Motor(1.03, 1.0, 3.0, 0.0), shaft=Shaft(6e-3, 2e-3, 1e-3, 1e-3), source=SOURCES[source],
        bridge=NO_BRIDGE._replace(D_drive=0.4, R_drive=3.15, off=Off(0.0, 3.0, 0.0)),
        friction=FRICTION._replace(**LAWS[law]))


def fine(numbers, torque, drive, q, w, end):
    """Solve the general law of acceleration numerically, stopping wherever the speed is zero."""
    u = drive * numbers.source.V

    def acceleration(w, contact):
        zone = currents.zone_of(numbers, u, 0.0, 0.0, w, 0.0)
        return contacts.acceleration(numbers, Mode(zone, contact, RIGID, 0, 0), u, torque, state(w))

    def state(w):
        return Vector(0.0, w, 0.0, 0.0, 0.0, 0.0, w)

    t = 0.0
    while t < end:
        zone = currents.zone_of(numbers, u, 0.0, 0.0, w, 0.0)
        contact = contacts.settled(numbers, zone, u, torque, state(w), RIGID, False).contact
        way = {1: 1.0, 2: -1.0}.get(contact, 0.0)
        if way == 0.0:
            break

        def stands(t, y, way=way, begin=t):
            return y[1] if t > begin + 1e-9 else way

        stands.terminal, stands.direction = True, -way
        run = solve_ivp(lambda _, y, contact=contact: [y[1], acceleration(y[1], contact)], (t, end), [q, w],
                        method="DOP853", rtol=1e-11, atol=1e-13, events=stands, max_step=(end - t) / 100)
        t, (q, w) = run.t[-1], run.y[:, -1]
        if run.status == 1:
            w = 0.0
    return q, w


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("law", LAWS)
def test_a_slide_follows_the_law(law, source):
    numbers = numbers_of(law, source)
    for torque in LOADS:
        begins = bands.starts(numbers, torque)
        for drive, w in ((1.0, 0.0), (1.0, -2.0), (-1.0, 0.3), (0.0, 1.5), (0.0, -0.04)):
            q, speed, _, done = bands.slide(numbers, torque, begins, drive, 0.3, w, 0.03, FINE)
            assert done
            np.testing.assert_allclose((q, speed), fine(numbers, torque, drive, 0.3, w, 0.03), rtol=0, atol=3e-8)


@pytest.mark.parametrize("law", [name for name, numbers in LAWS.items() if "w_s" in numbers])
def test_a_creep_in_parts_is_the_creep(law):
    """From rest to a time, by one creep or by many: to rounding; and the same backward from its end."""
    numbers = numbers_of(law)
    begins = bands.starts(numbers, 0.1)
    for end in (1e-5, 3e-4, 1.3e-3, 4e-3):
        whole = bands.slide(numbers, 0.1, begins, 1.0, 0.0, 0.0, end, FINE)
        q = w = 0.0
        for _ in range(7):
            q, w, _, _ = bands.slide(numbers, 0.1, begins, 1.0, q, w, end / 7, FINE)
        assert w == pytest.approx(whole.w, rel=1e-9)
        assert q == pytest.approx(whole.q, rel=1e-9)


def test_a_creep_is_as_accurate_as_asked():
    numbers = numbers_of("M2")
    mode = Mode(currents.zone_of(numbers, 6.0, 0.0, 0.0, 0.0, 0.0), 1, RIGID, 0, 0)
    start = NOWHERE

    def time_to_the_top(tolerance):
        y, time = start, 0.0
        while y.w < creeping_speed(numbers.friction) and time < 1.0:
            went = creep.creep(numbers, mode, 6.0, 0.1, y, 1.0, tolerance)
            assert went.done
            time += went.time
            if went.ends_by >= 0 or went.time == 0.0:
                break
            y = Vector(went.q, went.w, 0.0, 0.0, 0.0, went.q, went.w)
        return time

    exact = time_to_the_top(1e-14)
    errors = [abs(time_to_the_top(10.0**-k) - exact) for k in (4, 6, 8, 10)]
    assert all(error <= 10.0**-k for error, k in zip(errors, (4, 6, 8, 10), strict=True))
    assert errors[-1] < 1e-3 * errors[0] or errors[0] < 1e-13


def test_a_creep_knows_where_it_stands_in_between():
    numbers = numbers_of("M4")
    mode = Mode(currents.zone_of(numbers, 6.0, 0.0, 0.0, 0.0, 0.0), 1, RIGID, 0, 1)
    start = NOWHERE._replace(q=0.2)
    went = creep.creep(numbers, mode, 6.0, 0.1, start, 1.0, FINE)
    end = Vector(went.q, went.w, 0.0, 0.0, 0.0, went.q, went.w)
    for part in (0.01, 0.4, 0.99):
        q, w = creep.at_time(numbers, mode, 6.0, 0.1, start, end, went.time, part * went.time)
        np.testing.assert_allclose((q, w), fine(numbers, 0.1, 1.0, 0.2, 0.0, part * went.time), rtol=0, atol=1e-9)


def test_a_shaft_that_creeps_for_ever_comes_close_to_its_final_speed(servo):
    """Static friction that is nearly the torque: the final speed lies within the creep, and is never reached."""
    slow = servo.replace({"friction.breakaway_ratio": 1.0, "friction.stribeck_speed": 300.0,
                          "friction.load_friction_motor_quad": 1e-9, "motor.motor_viscous_friction": 3e-4})
    runs = [st.simulate(st.PulseServo(slow), st.signals.step(0.0, 120.0, unit="deg"), duration=0.5, output_step=0.01,
                        accuracy=accuracy)["output_speed"] for accuracy in (1e-9, 1e-12)]
    np.testing.assert_allclose(*runs, rtol=0, atol=1e-7)
    assert 0.05 < np.max(np.abs(runs[0])) < 1.1  # rad/s, and creeping ends at 39 times 300/280
