"""Creep and bands: shafts whose friction depends on speed and torques, against a fine numerical solution."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import servotwin as st
from servotwin.models.engine.batch.segments import piecewise_segments
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.legs import fading_legs, legs
from servotwin.models.engine.motions import dormand_prince, stribeck
from servotwin.models.state.modes import NOWHERE, ON_LOWER, ON_UPPER, RIGID, Mode, Vector
from servotwin.models.terms import friction
from servotwin.models.terms.bridge import NO_BRIDGE, Off
from servotwin.models.terms.friction import NO_FRICTION, creeping_speed
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.models.terms.stops import Stops

FINE = 1e-12  # tolerance of a creep
FRICTION = NO_FRICTION._replace(F_forward=0.2, F_backward=0.25, breakaway=1.5, varies=1.0)
LAWS = {
    "M2": {"w_s": 0.05, "alpha": 1.0}, "M2, steep": {"w_s": 0.05, "alpha": 2.5},
    "M2, flat": {"w_s": 0.02, "alpha": 0.6}, "M2, wide": {"w_s": 2.0, "alpha": 1.0},
    "M2, wide and steep": {"w_s": 1.5, "alpha": 4.0},
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


@pytest.mark.long(but="M2, steep-regulator")
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("law", LAWS)
def test_a_slide_follows_the_law(law, source):
    numbers = numbers_of(law, source)
    for torque in LOADS:
        begins = piecewise_segments.starts(numbers, torque)
        for drive, w in ((1.0, 0.0), (1.0, -2.0), (-1.0, 0.3), (0.0, 1.5), (0.0, -0.04)):
            q, speed, _, done = piecewise_segments.slide(numbers, torque, begins, drive, 0.3, w, 0.03, FINE)
            assert done
            np.testing.assert_allclose((q, speed), fine(numbers, torque, drive, 0.3, w, 0.03), rtol=0, atol=3e-8)


@pytest.mark.parametrize("law", [name for name, numbers in LAWS.items() if "w_s" in numbers])
def test_a_creep_in_parts_is_the_creep(law):
    """From rest to a time, by one creep or by many: to rounding; and the same backward from its end."""
    numbers = numbers_of(law)
    begins = piecewise_segments.starts(numbers, 0.1)
    for end in (1e-5, 3e-4, 1.3e-3, 4e-3):
        whole = piecewise_segments.slide(numbers, 0.1, begins, 1.0, 0.0, 0.0, end, FINE)
        q = w = 0.0
        for _ in range(7):
            q, w, _, _ = piecewise_segments.slide(numbers, 0.1, begins, 1.0, q, w, end / 7, FINE)
        assert w == pytest.approx(whole.w, rel=1e-9)
        assert q == pytest.approx(whole.q, rel=1e-9)


@pytest.mark.parametrize("law", ["M2", "M2, wide", "M2, wide and steep"])
def test_a_creep_is_as_accurate_as_asked(law):
    numbers = numbers_of(law)
    mode = Mode(currents.zone_of(numbers, 6.0, 0.0, 0.0, 0.0, 0.0), 1, RIGID, 0, 0)
    start = NOWHERE

    def time_to_the_top(tolerance):
        y, time = start, 0.0
        while y.w < creeping_speed(numbers.friction) and time < 1.0:
            went = stribeck.creep(numbers, mode, 6.0, 0.1, y, 1.0, tolerance)
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
    went = stribeck.creep(numbers, mode, 6.0, 0.1, start, 1.0, FINE)
    end = Vector(went.q, went.w, 0.0, 0.0, 0.0, went.q, went.w)
    for part in (0.01, 0.4, 0.99):
        q, w = stribeck.at_time(numbers, mode, 6.0, 0.1, start, end, went.time, part * went.time)
        np.testing.assert_allclose((q, w), fine(numbers, 0.1, 1.0, 0.2, 0.0, part * went.time), rtol=0, atol=1e-9)


def gone(numbers, torque, drive, q, w, time):
    """Return where legs lead to."""
    u, y = drive * numbers.source.V, Vector(q, w, 0.0, 0.0, 0.0, q, w)
    found = fading_legs.go(numbers, torque, u, y, legs.mode_from(numbers, torque, u, y, RIGID), q, time)
    assert found.done == 1.0
    assert (found.y.q_m, found.y.w_m) == (found.y.q, found.y.w)
    return found


@pytest.mark.parametrize("law", LAWS)
def test_legs_lead_where_slides_do(law):
    for source in SOURCES:
        numbers = numbers_of(law, source)
        for torque in LOADS:
            begins = piecewise_segments.starts(numbers, torque)
            for drive, w in ((1.0, 0.0), (1.0, -2.0), (-1.0, 0.3), (0.0, 1.5), (0.0, -0.04)):
                slid = piecewise_segments.slide(numbers, torque, begins, drive, 0.3, w, 0.03, FINE)
                y = gone(numbers, torque, drive, 0.3, w, 0.03).y
                np.testing.assert_allclose((y.q, y.w), (slid.q, slid.w), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("law", ["M2, wide", "M4", "M6"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_creep_meets_a_stop_and_rebounds_or_rests_until_its_torque_turns(law, way):
    stop, numbers = way * 2e-3, numbers_of(law)
    begins = piecewise_segments.starts(numbers, 0.0)

    def slid(time):
        return piecewise_segments.slide(numbers, 0.0, begins, way, 0.0, 0.0, time, FINE)

    met = brentq(lambda time: slid(time).q - stop, 1e-4, 0.1, xtol=1e-16, rtol=1e-15)
    speed = abs(slid(met).w)
    assert law == "M4" or speed < creeping_speed(numbers.friction)
    for restitution in (0.0, 0.5):
        there = numbers._replace(stops=Stops(-abs(stop), abs(stop), restitution))
        assert gone(there, 0.0, way, 0.0, 0.0, 0.999 * met).y.w == pytest.approx(slid(0.999 * met).w, rel=1e-9)
        after = gone(there, 0.0, way, 0.0, 0.0, met + 1e-9).y
        assert after.q == pytest.approx(stop, abs=1e-8)
        assert after.w == pytest.approx(-way * restitution * speed, abs=1e-5)
        rests = gone(there, 0.0, way, 0.0, 0.0, 0.5)
        assert (rests.y.q, rests.y.w) == (stop, 0.0)
        assert rests.mode.contact == (ON_UPPER if way > 0.0 else ON_LOWER)
        leaves = gone(there, 0.0, -way, rests.y.q, 0.0, 0.3 * met).y
        assert way * leaves.w < 0.0
        assert abs(leaves.q) < abs(stop)


def test_a_shaft_that_creeps_for_ever_comes_close_to_its_final_speed(servo):
    """Static friction that is nearly the torque: the final speed lies within the creep, and is never reached."""
    slow = servo.replace({"friction.breakaway_ratio": 1.0, "friction.stribeck_speed": 300.0,
                          "friction.load_friction_motor_quad": 1e-9, "motor.motor_viscous_friction": 3e-4})
    runs = [st.simulate(st.PulseServo(slow), st.signals.step(0.0, 120.0, unit="deg"), duration=0.5, output_step=0.01,
                        accuracy=accuracy)["output_speed"] for accuracy in (1e-9, 1e-12)]
    np.testing.assert_allclose(*runs, rtol=0, atol=1e-7)
    assert 0.05 < np.max(np.abs(runs[0])) < 1.1  # rad/s, and creeping ends at 39 times 300/280


def driven(numbers):
    """Return the mode of a shaft that is driven forward."""
    return Mode(currents.zone_of(numbers, 6.0, 0.0, 0.0, 0.0, 0.0), 1, RIGID, 0, 0)


def speed_law(numbers, torque):
    """Return the acceleration of that shaft, by its speed."""
    return lambda w: contacts.acceleration(numbers, driven(numbers), 6.0, torque,
                                           NOWHERE._replace(w=w, w_m=w))


@pytest.mark.parametrize("alpha", [0.7, 1.0, 1.5, 4.0])
def test_a_shaft_comes_as_close_to_its_final_speed_as_numbers_can_tell(alpha):
    """From below and from above, in one creep of any length; from then on it turns evenly."""
    numbers = numbers_of("M2, wide")
    numbers = numbers._replace(friction=numbers.friction._replace(alpha=alpha, w_s=3.0))
    final = brentq(speed_law(numbers, 0.1), 1.0, 6.0, xtol=1e-15, rtol=1e-15)
    for w in (0.0, 0.5 * final, 1.001 * final):
        start = NOWHERE._replace(w=w, w_m=w)
        one, two = (stribeck.creep(numbers, driven(numbers), 6.0, 0.1, start, limit, FINE) for limit in (2.0, 5.0))
        assert one.done == two.done == 1.0
        assert (one.time, two.time) == (2.0, 5.0)
        assert one.w == pytest.approx(final, rel=1e-13)
        assert two.q - one.q == pytest.approx(3.0 * final, rel=1e-12)


def test_at_its_final_speed_a_creep_knows_where_it_stands_before_its_end():
    numbers = numbers_of("M2, wide")
    start = NOWHERE._replace(w=4.5, w_m=4.5)
    went = stribeck.creep(numbers, driven(numbers), 6.0, 0.1, start, 0.4, FINE)
    end = Vector(went.q, went.w, 0.0, 0.0, 0.0, went.q, went.w)
    for before in (1e-3, 1e-9, 1e-12, 1e-15):
        q, _ = stribeck.at_time(numbers, driven(numbers), 6.0, 0.1, start, end, FINE, went.time - before)
        assert went.q - q == pytest.approx(before * went.w, rel=1e-9, abs=1e-15)


def test_near_its_final_speed_the_law_is_a_straight_line():
    numbers = numbers_of("M2, wide")
    law = speed_law(numbers, 0.1)
    final = brentq(law, 1.0, 6.0, xtol=1e-15, rtol=1e-15)
    rate = -(law(final + 1e-4) - law(final - 1e-4)) / 2e-4
    start = NOWHERE._replace(w=final - 1e-6, w_m=final - 1e-6)
    for time in (0.3 / rate, 3.0 / rate):
        went = stribeck.creep(numbers, driven(numbers), 6.0, 0.1, start, time, FINE)
        assert final - went.w == pytest.approx(1e-6 * math.exp(-rate * time), rel=1e-6)


@pytest.mark.parametrize("law", ["M2", "M2, flat", "M4", "M6"])
def test_where_nothing_is_left_of_static_friction_does_not_matter(law, monkeypatch):
    """What is taken as rounding, exp(-39), could be any other that small."""
    numbers, found = numbers_of(law), []
    for faded in (38.9, 39.0, 39.1, 45.0):
        monkeypatch.setattr(friction, "_FADED", faded)
        assert creeping_speed(numbers.friction) == pytest.approx(
            numbers.friction.w_s * faded ** (1.0 / numbers.friction.alpha))
        begins = piecewise_segments.starts(numbers, 0.1)
        found.append([(*piecewise_segments.slide(numbers, 0.1, begins, drive, 0.0, w, time, FINE)[:2],)
                      for drive, w in ((1.0, 0.0), (0.0, 2.0), (-1.0, 1.0)) for time in (1e-3, 2e-2)])
    np.testing.assert_allclose(found[1:], found[:1] * 3, rtol=0, atol=1e-13)


@pytest.mark.parametrize("alpha", [1.0, 1.5, 2.0])
def test_nothing_jumps_where_the_shaft_just_reaches_the_end_of_the_fading(alpha):
    numbers = numbers_of("M2")
    final = brentq(speed_law(numbers_of("M2, wide")._replace(friction=NO_FRICTION._replace(F_forward=0.2)), 0.1),
                   1.0, 6.0)
    found = []
    for part in (0.997, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 1.003):
        own = numbers.friction._replace(alpha=alpha, w_s=part * final * 39.0 ** (-1.0 / alpha))
        lane = numbers._replace(friction=own)
        found.append(piecewise_segments.slide(lane, 0.1, piecewise_segments.starts(lane, 0.1), 1.0, 0.0, 0.0, 0.5,
                                              FINE)[:2])
    steps = np.diff(found, axis=0)
    np.testing.assert_allclose(steps[1:3], 0.0, atol=1e-11)
    np.testing.assert_allclose(steps[0], steps[3], rtol=0.02, atol=1e-12)


def test_static_friction_that_never_fades_and_one_that_fades_at_once(servo):
    """The two ends of the range of Stribeck speeds are laws of their own."""
    sliding = {name: servo.source(name).value for name in (
        "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")}
    never = {name: 1.3 * value for name, value in sliding.items()} | {"friction.breakaway_ratio": 1.0}
    for speed, limit in ((1e12, never), (1e-7, {"friction.breakaway_ratio": 1.3})):
        fades = {"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": speed}
        runs = [st.simulate(st.PulseServo(servo.replace(one)), st.signals.step(0.0, 60.0, at=0.05, unit="deg"),
                            duration=0.4, load=st.loads.Inertia(2e-3), output_step=0.02)["output_angle"]
                for one in (fades, limit)]
        np.testing.assert_allclose(*runs, rtol=0, atol=1e-9)
        assert np.ptp(runs[0]) > 0.5


def test_no_step_is_taken_under_a_constant_load(servo, monkeypatch):
    """Any exponent, slow and fast fading, shares, a regulator: from rest to the final speed and back."""
    monkeypatch.setattr(dormand_prince, "step", lambda *_: pytest.fail("a step by time"))
    rng = np.random.default_rng(3)
    for _ in range(25):
        changes = {"gear.output_inertia": 10.0 ** rng.uniform(-5.0, -2.0),
                   "friction.breakaway_ratio": 1.0 + 10.0 ** rng.uniform(-1.5, 0.7),
                   "friction.stribeck_speed": 10.0 ** rng.uniform(-0.5, 3.5),
                   "friction.stribeck_exponent": 10.0 ** rng.uniform(-0.5, 0.8)}
        if rng.random() < 0.4:
            changes |= {f"friction.load_friction_{name}": rng.uniform(0.0, 0.4) for name in (
                "motor", "external", "motor_stribeck", "external_stribeck", "motor_quad", "external_quad")}
        if rng.random() < 0.3:
            changes["supply.current_limit"] = rng.uniform(0.3, 1.5)
        told = st.signals.samples([0.0, 0.15], rng.uniform(0.8e-3, 2.3e-3, 2), unit="s")
        st.simulate(st.PulseServo(servo.replace(changes)), told, duration=0.3, output_times=[0.3],
                    load=st.loads.Constant(rng.uniform(-0.6, 0.6))).raise_if_failed()


def test_a_shaft_that_slows_down_for_ever_takes_no_more_steps_than_frames():
    """Friction that grows with the load alone lets a coasting shaft go ever slower, down to numbers next to zero."""
    servo = st.load_servo("hitec-hs-422").replace({
        "friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
        "friction.breakaway_ratio": 1.0, "friction.stribeck_speed": 60.0, "friction.stribeck_exponent": 1.0,
        "friction.load_friction": None, "friction.load_friction_motor": 0.11, "friction.load_friction_external": 0.11,
        "friction.load_friction_motor_stribeck": 5e-4, "friction.load_friction_external_stribeck": 5e-4})
    command = st.signals.step(0.0, 40.0, at=0.1, unit="deg")
    looks = []

    def look(done, total):  # every 4096 steps: a run that never ends is stopped
        looks.append(done)
        assert len(looks) < 4

    result = st.simulate(st.PulseServo(servo), command, duration=20.0, output_times=np.linspace(0.5, 20.0, 40),
                         progress=look)
    speed = np.abs(result["output_speed"])
    rates = np.diff(np.log(speed[:10])) / np.diff(result["time"][:10])
    assert result.status is st.simulation.Status.COMPLETED
    np.testing.assert_allclose(rates[2:], rates[2], rtol=1e-6)  # next to a straight law: exponentially
    assert speed[-1] < 1e-200
    assert len(result.trajectory.segments) < 3 * 20.0 / servo.get("electronics.frame_period")
