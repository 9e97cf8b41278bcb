"""End stops at speed: neither tunnelled through nor a source of energy, whatever pushes and whatever gives way."""

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.optimize import brentq

from servotwin.models.engine.motions.motion import ended, prepared, state
from validation.test_drivetrain_armature import LOCKED, N, driven, undriven
from validation.test_drivetrain_reference import simulate

STOP = 0.1  # rad
SPEED = 10.0  # rad/s, three times what the free servo reaches
INERTIA, OUTPUT = 8e-3, 2e-3  # kg m²: all of it, and what is behind the play
PLAY = {"gear.backlash": 0.02, "gear.output_inertia": OUTPUT}
COULOMB = {"friction.coulomb_torque_forward": 0.1 / N, "friction.coulomb_torque_backward": 0.1 / N}


def around(result, kind):
    """States just before and just after each event of a kind, as the engine's vectors; it comes alone at its time."""
    segments = result.trajectory.segments
    pairs = {b.start: (a, b) for a, b in itertools.pairwise(segments) if b.anchor == b.start}
    count = Counter(event.time for event in result.events)
    times = [event.time for event in result.events if event.kind == kind and count[event.time] == 1]
    return [(ended(prepared(a.motion), b.start - a.anchor), state(b.motion, 0.0))
            for a, b in (pairs[t] for t in times if t in pairs)]


def kinetic(y):
    return 0.5 * OUTPUT * y[1] ** 2 + 0.5 * (INERTIA - OUTPUT) * y[6] ** 2


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("play", [False, True])
@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize(("off", "side"), [("brake", 1), ("coast", -1)])
def test_a_stop_at_speed(restitution, play, inductance, off, side):
    which = "upper" if side > 0 else "lower"
    values = COULOMB | {f"stops.{which}_angle": side * STOP, "stops.restitution": restitution,
                        "electronics.off_state": off} | (PLAY if play else {"gear.output_inertia": OUTPUT})
    case = undriven(values, initial={"output_angle": 0.0, "output_speed": side * SPEED}, duration=0.3).replace(
        motor__armature_inductance=inductance)
    if play:
        case.initial.update(motor_speed=side * SPEED * N, motor_angle=0.0)
    result = simulate(case, np.linspace(0.0, 0.3, 3001))
    impacts = around(result, f"{which} stop")
    assert impacts
    assert np.max(side * result["output_angle"]) <= STOP + 1e-13
    assert np.all(np.isfinite(result["output_speed"]))
    for before, after in impacts:
        assert before[0] == pytest.approx(side * STOP, abs=1e-13)
        assert side * before[1] >= 0.0
        assert after[1] == 0.0 or after[1] == pytest.approx(-restitution * before[1], rel=1e-12)
        assert kinetic(after) <= kinetic(before) + 1e-15
        assert after[2] == pytest.approx(before[2], rel=1e-12, abs=1e-15)  # the current goes on
        alone = play and after[6] != after[1]
        assert after[6] == pytest.approx(before[6] if alone else after[1], rel=1e-12)
    energy = result.energy
    turnover = abs(energy.supply) + energy.winding + abs(energy.load) + energy.friction + abs(energy.stored)
    assert abs(energy.residual) <= 1e-9 * turnover
    assert energy.stops >= (1.0 - restitution**2) * 0.5 * OUTPUT * impacts[0][0][1] ** 2 - 1e-15


@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_a_drive_holds_the_shaft_on_its_stop(restitution, inductance):
    """It bounces ever lower, comes to rest in a finite time, and the current grows to that of the stalled motor."""
    values = COULOMB | {"stops.upper_angle": 0.1, "stops.restitution": restitution, "gear.output_inertia": OUTPUT}
    result = simulate(driven(values, duration=0.5).replace(motor__armature_inductance=inductance), np.array([0.4, 0.5]))
    assert result["output_angle"].tolist() == [0.1, 0.1]
    assert result["output_speed"].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(result["armature_current"], 6.0 / 3.0, rtol=1e-12)


def test_a_ball_on_a_table():
    """Constant torque, no motor: the heights go as e², and all bounces together last (1 + e)/(1 − e) of the fall."""
    e, torque, height = 0.5, 0.2, 0.02
    values = {"motor.torque_constant": 1e-12, "motor.back_emf_constant": 1e-12, "stops.lower_angle": 0.0,
              "stops.restitution": e, "gear.output_inertia": OUTPUT}
    fall = math.sqrt(2.0 * height * INERTIA / torque)
    case = undriven(values, load={"torque": torque}, initial={"output_angle": height}, duration=0.2)
    result = simulate(case, fall * np.array([1.0 + e, 1.0 + 2.0 * e + e**2, (1.0 + e) / (1.0 - e) + 1e-6]))
    np.testing.assert_allclose(result["output_angle"], [height * e**2, height * e**4, 0.0], rtol=0.0, atol=1e-12)
    assert result["output_speed"][-1] == 0.0
    assert result.energy.stops == pytest.approx(torque * height, rel=1e-9)


@pytest.mark.parametrize("friction", [{}, COULOMB], ids=["smooth", "dry"])
def test_a_torque_that_grows_towards_a_stop_leaves_the_shaft_there(friction):
    """The current of a drive into the stop rises from zero: what friction held, the stop holds."""
    values = friction | {"stops.lower_angle": 0.2, "motor.armature_inductance": 3e-4}
    result = simulate(driven(values, way=-1), np.array([0.1]))
    assert result["output_angle"][0] == 0.2
    assert result["armature_current"][0] == pytest.approx(-2.0, rel=1e-9)
    assert sum(event.kind == "lower stop" for event in result.events) == 0


@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize("pull", [0.05, 0.5])
def test_a_motor_that_pins_the_output_to_its_stop_rests_with_it(pull, inductance):
    """The load holds the output on the stop; what the motor brings goes into the stop at once, not into small blows.

    With the pull of 0.5 N m the output alone would be the faster of the two at first, if only it could move.
    """
    case = driven(PLAY | {"stops.lower_angle": 0.2}, way=-1, load={"torque": pull}, duration=0.02).replace(
        motor__armature_inductance=inductance)
    alone = simulate(case.replace(gear__backlash=1.0), np.array([0.02]))  # the motor on its way across the play
    meets = brentq(lambda t: alone.at("motor_angle", t)[0] / N - 0.2 + 0.5 * PLAY["gear.backlash"], 0.002, 0.02,
                   xtol=1e-15)
    soon = replace(case, duration=meets + 1e-7)
    result = simulate(soon, np.array([soon.duration]))
    assert result["output_angle"][0] == 0.2
    assert result["motor_speed"][0] == 0.0
    assert len(result.events) < 20


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("pull", [0.0, 0.5])
def test_a_flank_that_hits_an_output_on_its_stop(restitution, pull):
    """Motor and output go on together, into the stop: both come back at restitution times that, as one body."""
    open_loop = {"electronics.off_state": "coast"}
    case = undriven(PLAY | open_loop | {"stops.lower_angle": 0.2, "stops.restitution": restitution},
                    load={"torque": pull}, duration=0.01,
                    initial={"output_angle": 0.2, "motor_angle": 0.2 * N, "motor_speed": -2.0 * N})
    back = 2.0 * restitution * (1.0 - OUTPUT / (6e-3 + OUTPUT))
    result = simulate(case, np.array([0.005 + 1e-9]))
    assert result["motor_speed"][0] / N == pytest.approx(back, abs=1e-6)
    assert result["output_speed"][0] == pytest.approx(back, abs=1e-6)
    assert result.energy.stops > 0.0


def impacts(way, speed, pull, restitution):
    """Yield when each impact comes of an output that is pulled to a stop ahead of its motor, with the motor's speed.

    Both begin together, so far before the stop. Each flight is a parabola, in 60 digits, and no impact is too small.
    """
    with mp.workdps(60):
        left, gap, w, v, t, a = mpf(way), mpf(0), mpf(speed), mpf(speed), mpf(0), pull / mpf(OUTPUT)
        while True:
            root, closing = mp.sqrt(w * w + 2 * a * left), v - w
            hits = 2 * left / (w + root) if w > 0 else (root - w) / a
            reach = closing * closing - 2 * a * gap
            meets = 2 * gap / (closing + mp.sqrt(reach)) if closing > 0 and reach > 0 else mp.inf
            after = min(hits, meets)
            left -= w * after + a * after**2 / 2
            gap += a * after**2 / 2 - closing * after
            w, t = w + a * after, t + after
            if hits < meets:
                left, w = mpf(0), -restitution * w
            else:
                gap, w = mpf(0), (OUTPUT * w + (INERTIA - OUTPUT) * v) / INERTIA
                v = w
            yield float(t), float(v), float(left + gap)


@pytest.mark.parametrize(("pull", "way"), [(1e-6, 5e-3), (0.02, 1e-3), (0.5, 1e-4), (5.0, 1e-5)])
@pytest.mark.parametrize("restitution", [0.1, 0.395, 0.7])
def test_an_output_between_motor_and_stop_hits_both_until_they_rest(restitution, pull, way):
    """Ever smaller impacts without end, in no time: where they lead is where the engine stops both, on the stop."""
    stop, half = 1.0 + way, 0.5 * PLAY["gear.backlash"]
    case = undriven(PLAY | {"electronics.off_state": "coast", "stops.upper_angle": stop,
                            "stops.restitution": restitution}, load={"torque": -pull}, duration=0.005,
                    initial={"output_angle": 1.0, "output_speed": 1.2, "motor_angle": N * (1.0 + half),
                             "motor_speed": 1.2 * N})
    result = simulate(case, np.array([0.005]))
    every = list(itertools.takewhile(lambda impact: impact[1] > 1e-12, impacts(way, 1.2, pull, restitution)))
    _, slowest, left = every[-1]
    assert len(every) > 60
    assert slowest < 2e-12
    assert left < 1e-9  # of the motor's way to the stop, when it has lost all speed
    events = [event.time for event in result.events if event.kind != "release forward"]
    assert events == pytest.approx([time for time, _, _ in every[:len(events)]], abs=1e-9)
    assert result["output_angle"][0] == stop
    assert result["motor_angle"][0] / N - half == pytest.approx(stop, abs=1e-15)
    assert result["output_speed"][0] == result["motor_speed"][0] == 0.0
    assert result.energy.stops == pytest.approx(0.5 * INERTIA * 1.2**2 + way * pull, rel=1e-12,
                                                abs=1e-12 * pull)  # of the way that counts as none


@pytest.mark.parametrize("gap", [1e-11, 1e-8])
def test_a_motor_that_presses_close_behind_its_output_hits_the_stop_with_it(gap):
    """Output hits, is met, and both hit as one body: however little way there is, this is no bouncing without end."""
    restitution, stop, half = 0.5, 1.001, 0.5 * PLAY["gear.backlash"]
    case = undriven(PLAY | {"electronics.off_state": "coast", "stops.upper_angle": stop,
                            "stops.restitution": restitution}, load={"torque": 0.0}, duration=0.002,
                    initial={"output_angle": 1.0, "output_speed": 1.2, "motor_angle": N * (1.0 + half - gap),
                             "motor_speed": 1.2 * N})
    result = simulate(case, np.array([0.002]))
    met = 1.2 * (INERTIA - OUTPUT - restitution * OUTPUT) / INERTIA
    assert result["output_speed"][0] == pytest.approx(-restitution * met, rel=1e-12)
    assert result["motor_speed"][0] == pytest.approx(-restitution * met * N, rel=1e-12)
    assert result["output_angle"][0] == pytest.approx(stop - restitution * met * (0.002 - 1e-3 / 1.2),
                                                      abs=2.0 * gap + 1e-14)


@pytest.mark.parametrize(("speed", "after"), [(2e-6, 2e-6), (5e-7, 0.0)])
def test_a_motor_behind_an_output_that_comes_to_rest_on_its_stop_rests_only_if_as_slow(speed, after):
    """Both slower than 1e-6 rad/s rest; a faster motor goes on by itself, whatever its output has come to."""
    half, stop = 0.5 * PLAY["gear.backlash"], 1.0 + 1e-10
    case = undriven(PLAY | {"electronics.off_state": "coast", "stops.upper_angle": stop, "stops.restitution": 0.1},
                    load={"torque": -1e-6}, duration=1e-3,
                    initial={"output_angle": 1.0, "output_speed": speed, "motor_angle": N * (1.0 - half),
                             "motor_speed": speed * N})
    result = simulate(case, np.array([1e-3]))
    assert [event.kind for event in result.events] == ["gear meets", "upper stop"]  # they touch
    assert result["output_angle"][0] == stop
    assert result["output_speed"][0] == 0.0
    assert result["motor_speed"][0] / N == pytest.approx(after, rel=0.1, abs=1e-15)


def test_a_locked_motor_lets_the_output_bounce_within_its_play():
    """The output alone, without friction, goes to and fro between stop and flank; a plastic flank ends it."""
    case = undriven(LOCKED | PLAY | {"stops.upper_angle": 0.004, "stops.restitution": 1.0,
                                     "friction.bearing_coulomb_torque": 0.0},
                    initial={"output_angle": 0.0, "output_speed": 1.0, "motor_speed": 0.0, "motor_angle": 0.0},
                    duration=0.05)
    times = np.array([0.002, 0.004, 0.008, 0.0179])  # stop at 4 ms, the motor's flank at 18 ms
    result = simulate(case, times)
    np.testing.assert_allclose(result["output_angle"], [0.002, 0.004, 0.0, -0.0099], rtol=0.0, atol=1e-12)
    assert result["motor_angle"].tolist() == [0.0] * 4
    assert [event.kind for event in result.events][:2] == ["upper stop", "gear meets"]
