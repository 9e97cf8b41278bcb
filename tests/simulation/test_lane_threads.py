"""Lanes that advance one a thread: the same servos as lanes side by side, whatever they have, in any order.

Here a processor goes through the text; on a GPU it is the same text, made to PTX.
"""

import ctypes
import math
import re
import shutil
import subprocess

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.models.engine.one_lane import BY_ARCS, COMMAND_ANGLE, PULSE_WIDTH, Stand, pulses
from servotwin.models.state.modes import Vector
from servotwin.models.terms.dependence import REGULATED
from servotwin.models.terms.frame import AT_START
from servotwin.models.terms.friction import Friction
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.source import Source
from servotwin.models.terms.stops import Stops
from servotwin.simulation.compile import threads
from servotwin.simulation.compile.standalone import Standalone
from servotwin.simulation.compile.threads import PULSES_BY_ARCS, PULSES_BY_LEGS, SEEN, TICKS, LaneText
from servotwin.simulation.lanes.lane_threads import ThreadedLanes, text_of
from servotwin.simulation.start import Status

PLAIN, GOALS, PULSES = "hitec-hs-755hb", "feetech-sts3215-12v", "dsservo-ds3218"
FADING_BEHIND_PLAY = {"friction.stribeck_speed": 5.0, "friction.breakaway_ratio": 1.4, "gear.output_inertia": 1e-5,
                      "gear.backlash": np.array([0.0, 0.01])}


def chosen(rng, lanes, share=0.5, **numbers):
    """Return columns in which a share of the lanes has a number within these bounds, and the others the last one."""
    found = {}
    for name, (low, high, off) in numbers.items():
        values = np.where(rng.random(lanes) < share, rng.uniform(low, high, lanes), off)
        found[name.replace("__", ".")] = values
    return found


def words(rng, lanes, *allowed):
    return np.array(allowed)[rng.integers(len(allowed), size=lanes)]


def analog(rng, lanes):
    """Servos of which each has what it has by chance."""
    return chosen(
        rng, lanes, electronics__minimum_drive_time=(1e-4, 6e-4, 0.0), motor__brush_drop_voltage=(0.1, 0.4, 0.0),
        supply__bridge_drop_voltage=(0.1, 0.6, 0.0), supply__bridge_drop_resistance=(0.05, 0.2, 0.0),
        supply__internal_resistance=(0.05, 0.4, 0.0), electronics__supply_coupling=(5e-4, 3e-3, 0.0),
        electronics__back_emf_injection=(5e-4, 2e-3, 0.0), potentiometer__noise=(5e-4, 3e-3, 0.0),
        electronics__pulse_timeout=(0.012, 0.06, 10.0), electronics__pulse_width_max=(1.6e-3, 2.2e-3, 3e-3),
        friction__breakaway_ratio=(1.1, 1.5, 1.0), stops__upper_angle=(1.2, 2.0, 4.0), gear__backlash=(2e-3, 2e-2, 0.0),
        gear__output_inertia=(1e-5, 1e-4, 1e-5), friction__load_friction=(0.05, 0.3, 0.0),
        load__inertia=(1e-4, 3e-3, 5e-4), load__coulomb_torque=(0.0, 0.05, 0.0),
    ) | {"electronics.off_state": words(rng, lanes, "coast", "brake"),
         "electronics.silence_state": words(rng, lanes, "coast", "brake")}


def plain(rng, lanes):
    """Servos that go by arcs, some of them against a stop."""
    return chosen(rng, lanes, electronics__deadband=(2e-6, 3e-5, 8e-6), potentiometer__noise=(5e-4, 3e-3, 0.0),
                  potentiometer__backlash=(1e-3, 1e-2, 0.0), potentiometer__quantisation=(1e-3, 2e-2, 1e-6),
                  stops__upper_angle=(1.2, 2.0, 4.0), load__inertia=(1e-4, 3e-3, 5e-4))


def programmed(rng, lanes):
    return chosen(
        rng, lanes, firmware__proportional_gain=(2.0, 20.0, 8.0), firmware__integral_gain=(1.0, 10.0, 0.0),
        firmware__derivative_gain=(0.01, 0.1, 0.0), firmware__deadband_angle=(1e-3, 6e-3, 0.0),
        firmware__torque_limit=(0.3, 0.9, 1.0), firmware__duty_slew=(10.0, 60.0, 1e6),
        firmware__compute_delay=(1e-4, 3e-3, 0.0), firmware__overload_duty=(0.2, 0.6, 1.0),
        firmware__overload_time=(0.02, 0.1, 2.0), firmware__overload_output=(0.1, 0.3, 0.2),
        firmware__trip_current=(0.3, 1.5, 9.0), firmware__trip_time=(0.01, 0.05, 1.0),
        supply__internal_resistance=(0.05, 0.4, 0.0), motor__brush_drop_voltage=(0.1, 0.4, 0.0),
        gear__backlash=(2e-3, 2e-2, 0.0), gear__output_inertia=(1e-5, 1e-4, 1e-5), load__inertia=(1e-4, 3e-3, 5e-4),
    ) | {"firmware.off_state": words(rng, lanes, "brake", "coast", "diode")}


def goals(rng, lanes):
    return programmed(rng, lanes) | chosen(
        rng, lanes, firmware__speed_limit=(0.5, 5.0, 1e3), firmware__acceleration_limit=(5.0, 80.0, 1e5),
        firmware__bus_latency=(1e-4, 2e-3, 0.0))


def limited(draw):
    """Return the same behind regulators, most of which give less than the servo takes at a standstill."""
    def drawn(rng, lanes):
        return draw(rng, lanes) | chosen(rng, lanes, 0.8, supply__current_limit=(0.3, 1.5, 9.0),
                                         stops__upper_angle=(1.2, 2.0, 4.0), stops__restitution=(0.1, 0.8, 0.0))
    return drawn


def creeping(draw):
    """Return the same with static friction that fades, or play of the gear; potentiometers with play and steps."""
    def drawn(rng, lanes):
        own, fading = limited(draw)(rng, lanes), rng.random(lanes) < 0.8
        own |= {name: np.where(fading, values, 1.0 if name == "friction.breakaway_ratio" else 0.0)
                for name, values in chosen(rng, lanes, 0.7, friction__breakaway_ratio=(1.1, 1.8, 1.0), **{
                    f"friction__load_friction_{side}{part}": bounds for side in ("motor", "external")
                    for part, bounds in (("", (0.05, 0.3, 0.0)), ("_stribeck", (0.02, 0.2, 0.0)),
                                         ("_quad", (0.1, 0.5, 0.0)))}).items()}
        own |= chosen(rng, lanes, 0.7, friction__stribeck_speed=(0.5, 100.0, 5.0),
                      friction__stribeck_exponent=(0.4, 3.0, 1.0))
        if "electronics.off_state" in own:
            own |= chosen(rng, lanes, potentiometer__backlash=(1e-3, 1e-2, 0.0),
                          potentiometer__quantisation=(1e-3, 2e-2, 1e-6))
        own.pop("friction.load_friction", None)
        return own | {"gear.backlash": np.where(fading, 0.0, rng.uniform(2e-3, 2e-2, lanes))}
    return drawn


WARM = {"thermal.winding_capacity": 1.5, "thermal.housing_capacity": 40.0, "thermal.winding_to_housing": 6.0,
        "thermal.housing_to_ambient": 12.0}


def warming(draw):
    """Return the same with windings and housings that warm up within a second or a minute, and magnets that fade."""
    def drawn(rng, lanes):
        return draw(rng, lanes) | {f"thermal.{name}": rng.uniform(*bounds, lanes) for name, bounds in {
            "winding_capacity": (0.3, 5.0), "housing_capacity": (5.0, 50.0), "winding_to_housing": (2.0, 10.0),
            "housing_to_ambient": (5.0, 20.0), "magnet_coefficient": (-2e-3, 0.0), "ambient": (270.0, 320.0)}.items()}
    return drawn


CASES = {  # servo, what its lanes have, way, how many, and how far they may be off [rad]; play multiplies rounding
    "arcs": (st.PulseServo, PLAIN, plain, PULSES_BY_ARCS, 120, 1e-12),
    "legs": (st.PulseServo, PLAIN, analog, PULSES_BY_LEGS, 240, 1e-11),
    "goals": (st.DigitalServo, GOALS, goals, TICKS, 160, 1e-9),
    "pulses": (st.DigitalServo, PULSES, programmed, TICKS, 80, 1e-11),
    "legs, limited": (st.PulseServo, PLAIN, limited(analog), PULSES_BY_LEGS, 240, 1e-11),
    "legs, creeping": (st.PulseServo, PLAIN, creeping(analog), PULSES_BY_LEGS, 240, 1e-12),
    "goals, limited": (st.DigitalServo, GOALS, limited(goals), TICKS, 200, 1e-11),
    "goals, creeping": (st.DigitalServo, GOALS, creeping(goals), TICKS, 200, 1e-12),
    "pulses, limited": (st.DigitalServo, PULSES, limited(programmed), TICKS, 80, 1e-11),
    "pulses, creeping": (st.DigitalServo, PULSES, creeping(programmed), TICKS, 80, 1e-11),
    "legs, warming": (st.PulseServo, PLAIN, warming(limited(analog)), PULSES_BY_LEGS, 80, 1e-11),
    "goals, warming": (st.DigitalServo, GOALS, warming(goals), TICKS, 80, 1e-11),
    "pulses, warming": (st.DigitalServo, PULSES, warming(limited(programmed)), TICKS, 120, 1e-10)}


def made(case, lanes=None, seed=5):
    """Return lanes side by side, bounds of their angles, and a generator."""
    kind, name, draw, _, count, _ = CASES[case]
    rng, lanes, warms = np.random.default_rng(seed), lanes or count, "warming" in case
    sims = st.VectorSimulator(kind(st.load_servo(name).replace(WARM if warms else {})), lanes, seed=seed,
                              parameters=draw(rng, lanes), accuracy=1e-11 if warms else 1e-9)
    lower, upper, _ = sims._numbers.now(Stops)
    return sims, max(lower.max(), -1.5), min(upper.min(), 1.5), rng


def entered(sims, dtype="float64"):
    """Return the same lanes one a thread, as they stand."""
    own, every = ThreadedLanes(sims._numbers, dtype), np.arange(len(sims))
    own.put(every, sims._store.memories())
    return own, every


def met_by(sims):
    """Return which lanes creep where friction fades, are at their regulator's most, and are at a stop."""
    stops, own, source = (sims._numbers.now(kind) for kind in (Stops, Friction, Source))
    q, w, i = sims["output_angle"], np.abs(sims["output_speed"]), np.abs(sims["armature_current"])
    slow = np.where((own.varies > 0.0) & (own.w_s > 0.0), own.w_s * 39.0 ** (1.0 / own.alpha), 0.0)
    part = np.abs(sims["duty"]) if "duty" in sims.signals else 1.0  # of a mean current, at the source
    most = np.isclose(i, source.I_max, 1e-9, 0.0) | np.isclose(i * part, source.I_max, 1e-9, 0.0)
    return np.array([(w > 0.0) & (w < slow), most, (q == stops.lower) | (q == stops.upper)])


def advanced(sims, own, low, high, rng, steps=40):
    """Advance both under the same commands, torques and resets.

    Return by how much each lane is off at the most, how many lanes arcs have left, and how many have met what. Those
    behind regulators are pushed against their stops; digital ones go in parts of a tick there, for lanes follow them
    from event to event so, and not by power series.
    """
    lanes, worst, left, met = len(sims), np.zeros(len(sims)), 0, np.zeros((3, len(sims)), bool)
    limited, digital = own.text.flags & REGULATED, own.text.way == TICKS
    most, push = 9e-4 if digital and limited else math.inf, (5.0 if digital else 1.5) if limited else 0.05
    for k in range(steps):
        if k % 10 == 5:
            mask = np.flatnonzero(rng.random(lanes) < 0.4)
            sims.reset(command_angle=rng.uniform(low, high, len(mask)), lanes=mask)
            own.put(mask, sims._store.memories(mask))
        if k % 10 == 8:  # a cut: to records and back
            own.put(np.arange(lanes), own.memories(np.arange(lanes)))
        if k % 10 == 9:
            speeds = rng.uniform(-15.0, 15.0, lanes)
            sims.set(output_speed=speeds)
            own.put(np.arange(lanes), sims._store.memories())
        duration, torque = rng.choice([1e-3, 0.02, 0.0137, 0.11]), rng.uniform(-push, push, lanes)
        parts, angles = 1 + int(duration / most), rng.uniform(low, high, lanes)
        for _ in range(parts):
            sims.advance(duration / parts, command_angle=angles, external_torque=torque)
        own.advance(duration, sims._store.command, sims._store.torque)
        left, met = left + own.left, met | met_by(sims)
        assert np.array_equal(own.status != 0, sims.status != 0)
        np.testing.assert_allclose(own.time, sims.time, rtol=0.0, atol=1e-6 if own.text.floats else 1e-9)
        worst = np.fmax(worst, np.abs(own.column("stand.y.q") - sims["output_angle"]))
    return worst, left, met.sum(axis=1)


@pytest.mark.parametrize("case", [
    pytest.param(case, marks=() if case == "arcs" else pytest.mark.slow) for case in CASES])
def test_random_servos_are_those_of_lanes(case):
    sims, low, high, rng = made(case)
    own, _ = entered(sims)
    assert own.text.way == CASES[case][3]
    worst, left, (creep, most, stand) = advanced(sims, own, low, high, rng)
    assert worst.max() <= CASES[case][5], np.argmax(worst)
    assert (left > 0) == (case == "arcs")  # some met a stop
    if "warming" in case:
        same, y = worst <= CASES[case][5], sims._store.memories().rows["point"]["y"]
        for name in ("T_w", "T_h"):
            np.testing.assert_allclose(own.column(f"stand.y.{name}")[same], y[name][same], rtol=1e-9, atol=0.0)
    assert (most > 20) == ("limited" in case or "creeping" in case or case in ("legs, warming", "pulses, warming"))
    assert "warming" not in case or np.ptp(sims["winding_temperature"] - sims["housing_temperature"]) > 5.0  # K
    assert (creep > 40) == ("creeping" in case)
    assert stand > 0 or case in ("arcs", "goals", "pulses", "goals, warming")


@pytest.mark.slow
def test_outputs_that_a_motor_hammers_against_a_stop_are_those_of_lanes():
    """Where rounding put a meeting just before the stop, four of these were off by up to 0.04 rad."""
    sims, low, high, rng = made("pulses, limited", 300, 22)
    own, _ = entered(sims)
    worst, *_ = advanced(sims, own, low, high, rng, 25)
    assert worst.max() <= 1e-10, np.argmax(worst)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["arcs", "legs, creeping"])
def test_floats_are_off_by_what_they_round(case):
    sims, low, high, rng = made(case)
    own, _ = entered(sims, "float32")
    assert own.array("reals").dtype == np.float32
    worst, *_ = advanced(sims, own, low, high, rng)
    assert 0.0 < np.quantile(worst, 0.99) <= 5e-6  # where a pulse more or less is decided by a digit, more


@pytest.mark.parametrize("case", ["arcs", pytest.param("legs, creeping", marks=pytest.mark.slow)])
def test_a_lane_is_the_same_alone_among_others_and_in_any_order(case):
    (sims, low, high, rng), draw = made(case), CASES[case][2]
    own, every = entered(sims)
    command = sims._numbers.translate.command(None, rng.uniform(low, high, len(sims)), None, None)
    order = rng.permutation(every)
    others = {name: values[order] for name, values in draw(np.random.default_rng(5), len(sims)).items()}
    shuffled = st.VectorSimulator(sims._numbers.model, len(sims), parameters=others)
    shuffled._numbers.columns.seeds[:] = sims._numbers.columns.seeds[order]
    again = ThreadedLanes(shuffled._numbers)
    again.put(every, sims._store.memories(order))
    alone = st.VectorSimulator(sims._numbers.model, 1, seed=8, parameters={
        name: values[3] for name, values in draw(np.random.default_rng(5), len(sims)).items()})
    one = ThreadedLanes(alone._numbers)
    one.put(np.arange(1), sims._store.memories(np.arange(3, 4)))
    for duration in (0.02, 1e-3, 0.3):
        own.advance(duration, command, 0.0)
        again.advance(duration, command[order], 0.0)
        one.advance(duration, command[3], 0.0)
    assert np.array_equal(own.array("reals")[:, order], again.array("reals"))
    assert np.array_equal(own.array("wholes")[:, order], again.array("wholes"))
    assert np.array_equal(own.array("reals")[:, 3], one.array("reals")[:, 0])


@pytest.mark.parametrize("case", ["arcs", pytest.param("legs", marks=pytest.mark.slow),
                                  pytest.param("goals", marks=pytest.mark.slow),
                                  pytest.param("legs, creeping", marks=pytest.mark.slow),
                                  pytest.param("goals, limited", marks=pytest.mark.slow),
                                  pytest.param("goals, warming", marks=pytest.mark.slow)])
def test_lanes_begin_and_show_what_lanes_show(case):
    """They begin by a mask, at an angle or under a command of a kind; angles, speeds and inertias are imposed."""
    sims, low, high, rng = made(case, 60)
    own, every = entered(sims)
    kinds = {COMMAND_ANGLE: "command_angle",
             PULSE_WIDTH: "command_angle" if case.startswith("goals") else "pulse_width"}
    for k in range(12):
        kind = [COMMAND_ANGLE, PULSE_WIDTH][k % 2]
        angles = rng.uniform(low, high, 60)
        command = angles if kinds[kind] == "command_angle" else rng.uniform(1.1e-3, 1.9e-3, 60)
        if k % 3 == 1:
            mask, at = rng.random(60) < 0.4, np.where(rng.random(60) < 0.5, rng.uniform(low, high, 60), np.nan)
            begin = every[mask & ~np.isnan(at)], every[mask & np.isnan(at)]
            sims.reset(**{kinds[kind]: command[begin[0]]}, output_angle=at[begin[0]], lanes=begin[0])
            sims.reset(**{kinds[kind]: command[begin[1]]}, lanes=begin[1])
            own.tell(command, kind=kind)
            own.begin(at, mask=mask)
            assert own.time == pytest.approx(sims.time, abs=1e-12)
        sims.advance(0.0137, **{kinds[kind]: command}, external_torque=0.02)
        own.advance(0.0137, command, sims._store.torque, kind=kind)
        if k % 4 == 2:
            speed, turned = rng.uniform(-9.0, 9.0, 60), rng.random(60) < 0.5
            to = np.clip(sims["output_angle"] + rng.uniform(-0.05, 0.05, 60), low, high)
            inertia, J_L = rng.random(60) < 0.3, rng.uniform(1e-4, 4e-3, 60)
            sims.set(output_angle=to[turned], output_speed=speed[turned], lanes=turned)
            sims.set(output_speed=speed[~turned], lanes=~turned)
            sims.set(load_inertia=J_L[inertia], lanes=inertia)
            own.impose(angle=np.where(turned, to, np.nan), speed=speed)
            own.impose(inertia=J_L, mask=inertia)
        seen = dict(zip(SEEN, own.look(), strict=True))
        assert own.column("stand.y.q") == pytest.approx(sims["output_angle"], abs=1e-9)
        for name in ("time", *sims.signals):
            if name in seen:
                scale = max(1.0, np.abs(sims[name]).max())
                assert seen[name] == pytest.approx(sims[name], abs=1e-6 * scale), name


@pytest.mark.parametrize(("kind", "command", "angle"), [
    (COMMAND_ANGLE, np.nan, 0.5), (PULSE_WIDTH, -1e-3, 0.5), (PULSE_WIDTH, 0.1, 0.5), (PULSE_WIDTH, 1.5e-3, 99.0)])
def test_what_a_servo_does_not_take_fails_its_lane_and_no_other(kind, command, angle):
    sims, *_ = made("arcs", 6)
    own, _ = entered(sims)
    commands, angles = np.full(6, {COMMAND_ANGLE: 0.5, PULSE_WIDTH: 1.5e-3}[kind]), np.full(6, 0.5)
    commands[2], angles[2] = command, angle
    own.tell(commands, kind=kind)
    own.begin(angles)
    assert own.status.tolist() == [0, 0, Status.REFUSED.code, 0, 0, 0]
    own.tell(1.5e-3, kind=PULSE_WIDTH)
    own.begin()
    assert not own.status.any()
    if angle < 9.0:
        own.advance(0.02, commands, 0.0, kind=kind)
        assert own.status.tolist() == [0, 0, Status.REFUSED.code, 0, 0, 0]
        assert np.isnan(own.look()).any(axis=0).tolist() == [False, False, True, False, False, False]
    assert np.isfinite(np.delete(own.array("reals")[:2], 2, 1)).all()


@pytest.mark.parametrize("case", ["arcs", pytest.param("goals", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("call", "name", "value"), [
    ("tell", "torque", np.nan), ("tell", "torque", np.inf), ("impose", "inertia", np.inf), ("impose", "inertia", -1.0)])
def test_what_is_no_number_fails_its_lane_and_no_other(case, call, name, value):
    sims, *_ = made(case, 5)
    own, _ = entered(sims)
    own.tell(sims._store.command)
    values = np.full(5, 1e-3)
    values[2] = value
    getattr(own, call)(**{name: values})
    own.advance(0.05)
    assert own.status.tolist() == [0, 0, Status.REFUSED.code, 0, 0]
    assert np.isfinite(own.column("stand.y.q")).tolist() == [True, True, False, True, True]
    own.begin()
    assert (own.status[2] == 0) == (call == "impose")  # a torque stays until another comes
    own.tell(torque=0.0)
    own.begin()
    assert not own.status.any()


def test_twenty_ticks_are_a_frame():
    sims, low, high, rng = made("arcs")
    (whole, _), (parts, _) = entered(sims), entered(sims)
    command = sims._numbers.translate.command(None, rng.uniform(low, high, len(sims)), None, None)
    for _ in range(10):
        whole.advance(0.02, command, 0.0)
        for _ in range(20):
            parts.advance(1e-3, command, 0.0)
    assert np.array_equal(whole.column("stand.frames"), parts.column("stand.frames"))
    np.testing.assert_allclose(whole.column("stand.y.q"), parts.column("stand.y.q"), rtol=0.0, atol=1e-12)


def test_a_lane_that_has_failed_is_nan_until_it_is_put_anew_and_harms_no_other():
    sims, low, high, rng = made("arcs", 5)
    (own, every), (other, _) = entered(sims), entered(sims)
    own.column("stand.y.q")[2] = np.nan
    command = sims._numbers.translate.command(None, rng.uniform(low, high, 5), None, None)
    for each in (own, other):
        each.advance(0.05, command, 0.0)
    assert own.status[2] != 0
    assert np.isnan(own.column("stand.y.q")[2])
    assert np.array_equal(np.delete(own.array("reals"), 2, 1), np.delete(other.array("reals"), 2, 1))
    own.put(every[2:3], sims._store.memories(every[2:3]))
    own.advance(0.05, command, 0.0)
    assert own.status[2] == 0
    assert np.isfinite(own.array("reals")[:2, 2]).all()


@pytest.mark.parametrize(("kind", "name", "more", "dtype", "words"), [
    (st.PulseServo, PLAIN, {"load": st.loads.Pendulum(mass=0.1, length=0.1)}, "float64", "a pendulum"),
    (st.PulseServo, PLAIN, {"load": st.loads.Recorded(time=[0.0, 1.0], torque=[0.0, 0.1])}, "float64", "recorded"),
    pytest.param(st.PulseServoInductive, PLAIN, {}, "float64", "inductance", marks=pytest.mark.slow),
    (st.BoundedServo, PLAIN, {}, "float64", "follows the error"),
    (st.PulseServo, PLAIN, {"parameters": FADING_BEHIND_PLAY}, "float64", "friction that fades behind play"),
    (st.PulseServo, PLAIN, {"parameters": FADING_BEHIND_PLAY | WARM}, "float64", "friction that fades beside heat"),
    (st.PulseServo, PLAIN, {"bus": st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2)}, "float64", "supply"),
    pytest.param(st.DigitalServo, PULSES, {}, "float32", "pulses, in float32", marks=pytest.mark.slow)])
def test_lanes_that_it_does_not_follow_are_refused_by_name(kind, name, more, dtype, words):
    sims = st.VectorSimulator(kind(st.load_servo(name)), 2, **more)
    with pytest.raises(InputError, match=rf"^lanes one a thread: got .*{words}") as caught:
        text_of(sims._numbers, dtype)
    assert "\n" not in str(caught.value)


def on_device():
    """Return whether there is a clang that makes PTX."""
    if shutil.which("clang") is None:
        return False
    return "nvptx64" in subprocess.run(["clang", "--print-targets"], capture_output=True, text=True, check=False).stdout


@pytest.mark.slow
@pytest.mark.skipif(not on_device(), reason="no clang that makes PTX")
@pytest.mark.parametrize(("case", "most"), [
    ("arcs", 3e5), ("goals", 3e5), ("legs, creeping", 4.5e5), ("goals, limited", 6e5), ("goals, creeping", 5e5),
    ("goals, warming", 6e5)])
def test_ptx_of_floats_calls_nothing_and_has_no_doubles(case, most):
    sims, *_ = made(case, 2)
    text = text_of(sims._numbers, "float32")
    found = threads.ptx(text)
    assert re.findall(r"^\.(version|target) (.*)$", found, re.MULTILINE) == [("version", "7.0"), ("target", "sm_80")]
    entries = {"servotwin_advance", "servotwin_prepare"} if case == "arcs" else {"servotwin_advance"}
    assert set(re.findall(r"\.entry (\w+)", found)) == entries
    sizes = set(re.findall(r"\.param \.align 8 \.b8 servotwin_\w+_param_0\[(\d+)\]", found))
    assert sizes == {str(ctypes.sizeof(threads.table_type(True)))}
    assert ".extern" not in found
    assert ".f64" not in found
    assert len(found) <= most
    assert ".f64" in threads.ptx(LaneText(text.way, text.flags, False))


def test_numbers_that_act_in_nothing_have_no_place_in_a_thread():
    own = text_of(made("arcs", 2)[0]._numbers, "float64")
    assert {("heat.C_w", "Heat", "C_w"), ("motor.L", "Motor", "L")} <= set(threads._numbers_of(Numbers, ""))
    structs = {name: body for body, name in re.findall(r"typedef struct \{([^{}]*)\} (\w+);", own.text)}
    assert not structs["Heat"].strip()
    assert "L;" not in structs["Motor"]
    read = Standalone({}, unstored=frozenset({("Motor", "K"), ("Heat", "C_w")}))
    read.add(own.recipe, threads._signatures(own))
    assert read.types.missed == {("Motor", "K")}  # which is read: such a text is none


def test_the_text_in_plain_python_is_the_same():
    sims, low, high, rng = made("arcs", 4)
    own, _ = entered(sims)
    command = sims._numbers.translate.command(None, rng.uniform(low, high, 4), None, None)
    tiles = {name: own.array(name).view(np.recarray)[0] for name in ("numbers", "arcs", "chips")}
    y = Vector(*(own.column(f"stand.y.{name}")[2].item() for name in Vector._fields))
    stand, now = Stand(y, 0, y.q, 0, 0.0), AT_START
    told = int(sims._numbers.columns.seeds[2]), command[2].item(), 0.02
    for duration in (0.02, 3e-3, 0.17):
        own.advance(duration, command, 0.02)
        gone = pulses(BY_ARCS, *tiles.values(), 2, np.zeros((0, 2)), *told, stand, now, duration)
        stand, now = gone.stand, gone.chip
        assert gone.status == 0
        assert own.column("stand.y.q")[2] == pytest.approx(stand.y.q, abs=1e-12)
        assert (own.column("stand.frames")[2], own.column("now.number")[2]) == (stand.frames, now.number)


def test_decisions_that_come_after_the_next_edge():
    """Frames are shorter here than the pulse of the one-shot, so that a decision waits, and a second one behind it."""
    model, lanes, rng = st.PulseServo(st.load_servo(PLAIN)), 40, np.random.default_rng(3)
    periods = rng.uniform(1.55e-3, 1.9e-3, lanes)
    sims = st.VectorSimulator(model, lanes, parameters={"electronics.frame_period": periods})
    sims.reset(pulse_width=1.2e-3, output_angle=rng.uniform(2.0, 3.2, lanes))
    own, every = entered(sims)
    waited = False
    for k in range(40):
        width = rng.uniform(0.9e-3, 1.5e-3, lanes)
        sims.advance(3.1e-3, pulse_width=width)
        own.advance(3.1e-3, sims._store.command, sims._store.torque)
        waited = waited or np.any(own.column("now.pending.time") > periods)
        if k % 7 == 3:
            own.put(every, own.memories(every))
        np.testing.assert_allclose(own.column("stand.y.q"), sims["output_angle"], rtol=0.0, atol=1e-12)
        assert np.array_equal(own.status, sims.status)
    assert waited
