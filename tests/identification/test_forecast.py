"""What a model says that logs should show: against single simulations, and the Jacobian against differences of them."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import PENDULUM, TRUTH, noisy, run
from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import DELAY_SCALE, FINE, OFFSET_SCALE, SPEED_SCALE, Point
from servotwin.identification.fitting.search.forecast import Forecast, Running
from servotwin.identification.fitting.search.free import Space

FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain", "electronics.deadband", "load.pendulum.mass")
BOUNDED = (*FREE[:4], "electronics.bridge_gain", "potentiometer.feedback_gain", "load.pendulum.mass")
LOAD = {"load.pendulum.mass": PENDULUM.mass}
SENSORS = ("output_angle", "supply_current")


UNKNOWN = 5  # samples, 0.1 s: what a log that begins in motion does before its first command acts


def moving(model=st.PulseServo, servo=TRUTH, sensors=("output_angle",), **more):
    """Return a log that begins in motion, so that it has all numbers of its own."""
    log = run(servo, "step", seed=3, duration=0.8, model=model, kind="pulse_width", signals=sensors, **more)
    angle = log.measured["output_angle"] + 1.5 * np.exp(-log.time / 0.1)
    return replace(log, measured={**log.measured, "output_angle": angle})


def forecast(logs, free=FREE, model=st.PulseServo, servo=TRUTH, sensors=("output_angle",), nuisance=(
        "delay", "log_delay", "angle_offset", "initial_state")):
    return Forecast(logs, model(servo), Space(model(servo), free, load=LOAD), nuisance, sensors, Running(accuracy=1e-9))


def point(f, delay=0.031, offset=0.02, own=(1.3, 0.4, 0.003)):
    """Return a point at which nothing is 0: start angle [rad] and speed [rad/s], delays [s], offset [rad]."""
    extra = {"delay": delay / DELAY_SCALE, "angle_offset": offset / OFFSET_SCALE}
    x = np.concatenate([f.space.start + np.linspace(-0.05, 0.04, len(f.space)), [extra[n] for n in f.extra]])
    scale = {"output_angle": own[0] / OFFSET_SCALE, "output_speed": own[1] / SPEED_SCALE,
             "log_delay": own[2] / DELAY_SCALE}
    return Point(x, tuple(np.array([scale[n] for n in f.names_of_own(case)]) for case in f.cases))


def alone(f, k, at):
    """Return what one simulation of `st.simulate` says that log k shows: its own words, not those of the package."""
    case = f.cases[k]
    own = dict(zip(f.names_of_own(case), at.own[k], strict=True))
    extra = dict(zip(f.extra, at.shared[len(f.space):], strict=True))
    late = (extra.get("delay", 0.0) + own.get("log_delay", 0.0)) * DELAY_SCALE
    offset = extra.get("angle_offset", 0.0) * OFFSET_SCALE
    servo = f.space.servo_at(at.shared[:len(f.space)]).replace(dict(case.log.parameters))
    load = case.log.load
    columns = f.space.columns(at.shared[None, :len(f.space)])
    if "load.pendulum.mass" in columns:
        load = replace(PENDULUM, mass=float(columns["load.pendulum.mass"][0]))
    initial = {}
    if "output_angle" in own:
        initial = {"output_angle": own["output_angle"] * OFFSET_SCALE - offset,
                   "output_speed": own.get("output_speed", 0.0) * SPEED_SCALE}
    model = type(f.model)(servo)
    signal = case.log.signal(servo.electronics.frame_period)
    if isinstance(model, st.BoundedServo):
        signal = replace(signal, edges=None)
    result = st.simulate(model, signal, load=load, duration=case.log.duration, initial=initial or None)
    residuals = []
    for name, place in case.places.items():
        times = case.times[place] - late
        values = result.at(name, np.maximum(times, 0.0))
        if name == "output_angle":
            values = values + offset + initial.get("output_speed", 0.0) * np.minimum(times, 0.0)
        assert len(times) == len(place)
        residuals.append((values - case.values[name]) / f.noise[name])
    return np.concatenate(residuals)


def differences(f, k, at, step):
    """Return the Jacobian of log k by central differences of single simulations: shared numbers, its own numbers."""
    def column(change):
        ahead, behind = (alone(f, k, change(side * step)) for side in (1.0, -1.0))
        return (ahead - behind) / (2.0 * step)

    def shared(i):
        return lambda h: at._replace(shared=at.shared + h * np.eye(len(at.shared))[i])

    def own(i):
        return lambda h: at._replace(own=(*at.own[:k], at.own[k] + h * np.eye(len(at.own[k]))[i], *at.own[k + 1:]))

    return (np.column_stack([column(shared(i)) for i in range(f.size)]),
            np.column_stack([column(own(i)) for i in range(len(at.own[k]))]))


# --------------------------------------------------------------------------------------- residuals

@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_residuals_are_simulated_less_measured_in_units_of_noise(kind):
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    logs = [moving(model), run(TRUTH, "prbs", duration=0.6, model=model, name="other")]
    f = forecast(logs, free, model)
    f.noise = {"output_angle": 2e-3}
    at = point(f)
    for k, part in enumerate(f.at(at, derivatives=False)):
        np.testing.assert_allclose(part.residual, alone(f, k, at), rtol=0.0, atol=1e-8)


def test_residuals_of_a_truth_are_zero():
    logs = [run(TRUTH, "step", delay=0.04, kind="pulse_width"), run(TRUTH, "triangle", delay=0.04, kind="angle")]
    f = forecast(logs, nuisance=("delay",))
    at = Point(np.append(f.space.start, 0.04 / DELAY_SCALE), ((), ()))
    for part in f.at(at, derivatives=False):
        np.testing.assert_allclose(part.residual, 0.0, atol=1e-9)


def test_several_sensors_stand_one_after_the_other_each_in_its_noise():
    log = moving(sensors=SENSORS)
    f = forecast([log], sensors=SENSORS)
    f.noise = {"output_angle": 1e-3, "supply_current": 0.05}
    at = point(f)
    residual = f.at(at, derivatives=False)[0].residual
    assert len(residual) == 2 * (len(log) - UNKNOWN)
    np.testing.assert_allclose(residual, alone(f, 0, at), atol=1e-6)


def test_what_does_not_count_is_left_out():
    log = moving()
    angle = log.measured["output_angle"].copy()
    angle[7:10] = np.nan
    log = replace(log, measured={"output_angle": angle}, left_out=((0.3, 0.5),))
    f = forecast([log])
    at = point(f)
    residual = f.at(at, derivatives=False)[0].residual
    assert len(residual) == len(log) - UNKNOWN - 3 - 10
    np.testing.assert_allclose(residual, alone(f, 0, at), atol=1e-9)


def test_time_stamps_may_be_uneven_with_gaps_and_begin_anywhere():
    rng = np.random.default_rng(5)
    time = 1000.0 + np.cumsum(rng.uniform(0.004, 0.03, 60))
    time[40:] += 0.4
    log = run(TRUTH, "step", time=time, kind="pulse_width", delay=0.05)
    f = forecast([log], nuisance=("delay",))
    at = Point(np.append(f.space.start, 0.05 / DELAY_SCALE), ((),))
    np.testing.assert_allclose(f.at(at, derivatives=False)[0].residual, 0.0, atol=1e-8)


def test_logs_of_one_batch_keep_their_own_conditions():
    """Same times, different supply, load and command: each as if it were alone."""
    logs = [run(TRUTH, "prbs", duration=0.6, seed=k, name=f"{k}", load=load,
                parameters={"supply.open_circuit_voltage": volt})
            for k, (volt, load) in enumerate([(4.8, PENDULUM), (6.0, replace(PENDULUM, mass=0.1)), (7.4, PENDULUM)])]
    f = Forecast(logs, st.PulseServo(TRUTH), Space(st.PulseServo(TRUTH), FREE[:5]), ("initial_state",),
                 ("output_angle",))
    at = Point(f.space.start, tuple(f.own_start(case) for case in f.cases))
    for part in f.at(at, derivatives=False):
        np.testing.assert_allclose(part.residual, 0.0, atol=1e-9)


@pytest.mark.parametrize("off_state", ["brake", "coast"])
def test_torque_off_is_missing_pulses_for_a_pulse_servo_and_the_end_for_a_bounded_one(off_state):
    servo = TRUTH.replace({"electronics.pulse_timeout": 0.03, "electronics.off_state": off_state})
    on = np.arange(50) < 25
    log = run(servo, "step", seed=1, duration=1.0, middle=1.0, torque_on=on)
    f = forecast([log], servo=servo, nuisance=())
    at = Point(f.space.start, ((),))
    np.testing.assert_allclose(f.at(at, derivatives=False)[0].residual, 0.0, atol=1e-9)
    always = forecast([replace(log, torque_on=None)], servo=servo, nuisance=())
    assert np.abs(always.at(at, derivatives=False)[0].residual).max() > 0.05
    bounded = forecast([log], BOUNDED, st.BoundedServo, servo, nuisance=())
    assert bounded.cases[0].count == 25
    missing = replace(log, torque_on=None, command=np.where(on, log.command, np.nan))
    np.testing.assert_array_equal(forecast([missing], servo=servo, nuisance=()).at(at, derivatives=False)[0].residual,
                                  f.at(at, derivatives=False)[0].residual)
    assert forecast([missing], BOUNDED, st.BoundedServo, servo, nuisance=()).cases[0].count == 25


def test_a_log_means_the_same_after_another_model_has_followed_it():
    servo = TRUTH.replace({"electronics.pulse_timeout": 0.03})
    log = run(servo, "step", seed=1, duration=1.0, middle=1.0, torque_on=np.arange(50) < 25)
    at = Point(Space(st.PulseServo(servo), FREE[:5]).start, ((),))
    residual = {}
    for name, first in (("fresh", ()), ("used", (st.BoundedServo,))):
        same = replace(log)
        for model in first:
            forecast([same], BOUNDED, model, servo, nuisance=())
        slow = TRUTH.replace({"electronics.frame_period": 0.02, "electronics.pulse_timeout": 0.03})
        if first:
            forecast([same], FREE[:5], st.PulseServo, slow, nuisance=())
        f = forecast([same], FREE[:5], servo=servo, nuisance=())
        residual[name] = f.at(at, derivatives=False)[0].residual
    np.testing.assert_array_equal(residual["fresh"], residual["used"])


def test_a_recorded_torque_as_long_as_its_log_is_followed():
    time = np.linspace(0.0, 0.6, 31)
    load = st.loads.Recorded(time.tolist(), (0.2 * np.sin(5.0 * time)).tolist())
    log = run(TRUTH, "prbs", time=time, load=load)
    f = Forecast([log], st.PulseServo(TRUTH), Space(st.PulseServo(TRUTH), FREE[:4]), (), ("output_angle",))
    np.testing.assert_allclose(f.at(Point(f.space.start, ((),)), derivatives=False)[0].residual, 0.0, atol=1e-9)


def test_noise_of_the_potentiometer_is_not_drawn():
    servo = TRUTH.replace({"potentiometer.noise": 5e-3})
    logs = [run(TRUTH, "prbs", duration=0.6)]
    f = forecast(logs, servo=servo, nuisance=())
    np.testing.assert_allclose(f.at(Point(f.space.start, ((),)), derivatives=False)[0].residual, 0.0, atol=1e-9)


# ---------------------------------------------------------------------------------------- Jacobian

@pytest.mark.long
@pytest.mark.parametrize(("kind", "central"), [("pulse", True), ("bounded", False)], ids=["central", "forward"])
def test_jacobian_is_that_of_single_simulations(kind, central):
    """All kinds of numbers: servo, lumps, load, delays, offset, start angle and speed; and of a current beside it."""
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    sensors = SENSORS if kind == "pulse" else ("output_angle",)
    f = forecast([moving(model, sensors=sensors), run(TRUTH, "prbs", duration=0.6, model=model, name="other",
                                                      signals=sensors)], free, model, sensors=sensors)
    f.noise = dict.fromkeys(sensors, 1e-2)
    assert f.names_of_own(f.cases[0]) == ("output_angle", "output_speed", "log_delay")
    assert f.names_of_own(f.cases[1]) == ("output_angle", "log_delay")
    at = point(f)
    at = at._replace(own=(at.own[0], at.own[1]))
    parts = f.at(at, central=central, step=FINE)
    for k, part in enumerate(parts):
        shared, own = differences(f, k, at, FINE)
        angles = len(f.cases[k].places["output_angle"])
        for found, expected in ((part.shared, shared), (part.own, own)):
            assert found.shape == expected.shape
            scale = np.abs(expected[:angles]).max(axis=0)
            assert (scale > 1e-3).all()  # every number matters
            # Curvature over one step, and kinks of single samples where friction lets go
            off = np.abs(found - expected)[:angles] / scale
            assert np.quantile(off, 0.98) < 2e-3
            assert np.median(off) < 2e-4


def test_a_step_never_leaves_the_bounds():
    """Where a number is at a bound, its derivative is that to the inside."""
    free = ("electronics.deadband", "friction.breakaway_ratio", "electronics.minimum_drive_time")
    f = forecast([run(TRUTH, "prbs", duration=0.6)], free, nuisance=())
    lower = Point(f.space.lower.copy(), ((),))
    inside = f.at(lower, step=1e-5)[0].shared
    assert np.isfinite(inside).all()
    np.testing.assert_allclose(f.at(lower, central=True, step=1e-5)[0].shared, inside, rtol=1e-3, atol=1e-6)
    f = forecast([run(TRUTH, "prbs", duration=0.6)], ("stops.restitution", "motor.armature_resistance"), nuisance=())
    upper = Point(f.space.upper.copy(), ((),))
    assert np.isfinite(f.at(upper, central=True)[0].shared).all()


# ------------------------------------------------------------------------------------ step and threads

@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_asking_the_engine_twice_as_often_changes_nothing(kind):
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    log = run(TRUTH, "step", duration=0.8, model=model, kind="pulse_width", signals=("output_angle", "output_speed"))
    time = np.unique(np.concatenate([log.time, 0.5 * (log.time[1:] + log.time[:-1])]))
    there = np.searchsorted(time, log.time)
    held = log.command[np.searchsorted(log.time, time, side="right") - 1]
    angle, speed = np.full(len(time), np.nan), np.zeros(len(time))
    angle[there] = log.measured["output_angle"]
    fine = replace(log, time=time, command=held, measured={"output_angle": angle, "output_speed": speed})
    plain = forecast([replace(log, measured={"output_angle": log.measured["output_angle"]})], free, model,
                     nuisance=("delay", "initial_state"))
    twice = forecast([fine], free, model, sensors=("output_angle", "output_speed"),
                     nuisance=("delay", "initial_state"))
    assert len(twice.cases[0].times) == 2 * len(log) - 1
    at = point(plain)
    a, b = plain.at(at, step=FINE)[0], twice.at(at, step=FINE)[0]
    np.testing.assert_allclose(b.residual[:len(log)], a.residual, atol=1e-9)
    np.testing.assert_allclose(b.shared[:len(log)], a.shared, atol=1e-3 * np.abs(a.shared).max())


def test_the_order_of_logs_and_their_company_change_no_bit():
    logs = [noisy(run(TRUTH, "prbs", duration=0.5, seed=k, name=f"{k}"), 1e-3, seed=k) for k in range(5)]
    f, g, single = forecast(logs), forecast(logs[::-1]), forecast(logs[2:3])
    at = point(f)
    parts, back, one = f.at(at), g.at(point(g))[::-1], single.at(point(single))[0]
    for a, b in zip(parts, back, strict=True):
        assert all((x == y).all() for x, y in zip(a, b, strict=True))
    assert all((x == y).all() for x, y in zip(parts[2], one, strict=True))
    some = f.at(at, cases=[3, 1])
    assert (some[0].residual == parts[3].residual).all()
    assert (some[1].shared == parts[1].shared).all()


def test_many_points_at_once_are_as_one_after_the_other():
    f = forecast([run(TRUTH, "prbs", duration=0.5), run(TRUTH, "step", duration=0.5)])
    points = [point(f, delay=d) for d in (0.0, 0.02, 0.02, 0.05)]
    together = f.at_all(points)
    for k, at in enumerate(points):
        for a, b in zip(together[k], f.at(at, derivatives=False), strict=True):
            assert (a.residual == b.residual).all()


# ------------------------------------------------------------------------------------ numbers of a log

def test_the_start_of_a_log_is_what_was_measured():
    still = noisy(run(TRUTH, "step", duration=1.0), 1e-3)
    f = forecast([still, moving()])
    angle, speed, own = f.own_start(f.cases[1]) * [OFFSET_SCALE, SPEED_SCALE, DELAY_SCALE]
    assert own == 0.0
    assert f.cases[0].moving is False
    assert f.cases[1].moving is True
    slope = np.polyfit(moving().time[:5], moving().measured["output_angle"][:5], 1)[0]
    assert speed == pytest.approx(slope)
    assert angle == pytest.approx(moving().measured["output_angle"][0])
    assert f.cases[0].start[0] == still.measured["output_angle"][0]
    assert 0.5e-3 < f.cases[0].scatter < 5e-3


@pytest.mark.parametrize("late", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shaft_that_sets_off_within_the_first_samples_begins_at_rest(late, sign):
    """It speeds up evenly from rest, and swings to and fro later, which is no noise of its start."""
    still = run(TRUTH, "step", time=np.arange(0.0, 1.0, 0.02))
    gone = np.maximum(still.time - late, 0.0)
    angle = 0.5 + sign * np.where(gone < 0.3, 20.0 * gone**2, 1.8 + np.sin(25.0 * (gone - 0.3)))
    case, = forecast([replace(still, measured={"output_angle": np.round(angle / 1.5e-3) * 1.5e-3})]).cases
    assert case.moving is False
    assert case.start == pytest.approx((0.5, 0.0), abs=1.5e-3)
    assert case.scatter < 0.02
    case, = forecast([replace(still, measured={"output_angle": angle + 2.0 * sign * still.time})]).cases
    assert case.moving is True


def test_a_log_that_tells_what_was_before_is_not_held_at_its_first_command():
    loose = TRUTH.replace({f"friction.coulomb_torque_{way}": 1e-6 for way in ("forward", "backward")})
    log = run(TRUTH, "step", time=np.arange(0.0, 1.0, 0.02), kind="pulse_width")
    angles = [np.full(50, 0.3), np.where(log.time < 0.1, np.nan, 0.3)]
    f = forecast([replace(log, name=f"log {k}", measured={"output_angle": q}) for k, q in enumerate(angles)],
                 servo=loose, nuisance=("delay", "frame_phase", "initial_state"))
    assert [f.hunts(case) for case in f.cases] == [True, False]


def test_a_log_that_begins_in_motion_is_believed_to_be_where_it_was_measured():
    """A servo that goes on at 3 rad/s until its command acts: at the truth, the belief about its start costs little."""
    servo, speed, late = TRUTH, 3.0, 0.05
    time = np.arange(0.0, 0.8, 0.02)
    log = run(servo, "step", time=time, kind="pulse_width", middle=2.0)
    result = st.simulate(st.PulseServo(servo), log.signal(0.01), duration=0.8, load=PENDULUM,
                         initial={"output_angle": 1.2, "output_speed": speed})
    angle = result.at("output_angle", np.maximum(time - late, 0.0)) + speed * np.minimum(time - late, 0.0)
    log = noisy(replace(log, measured={"output_angle": angle}), 5e-4)
    f = forecast([log], nuisance=("delay", "initial_state"))
    f.noise = {"output_angle": 5e-4}
    mean, weight = f.own_belief(f.cases[0])
    best = min((np.append(np.sum(f.at(at, derivatives=False)[0].residual ** 2), at.own[0][0]) for at in (
        Point(np.append(f.space.start, late / DELAY_SCALE), (np.array([a / OFFSET_SCALE, speed / SPEED_SCALE]),))
        for a in (1.2, 1.2 - speed * late))), key=lambda pair: pair[0])
    assert best[0] < 2.0 * len(time)  # one of the two is the start at the truth
    assert abs(best[1] - mean[0]) * weight[0] < 4.0


@pytest.mark.parametrize("wrong", [1.0, 1.05])
def test_a_start_read_by_a_potentiometer_is_not_believed_more_than_its_gain(wrong):
    """The gain is searched: what its nominal value makes of a voltage is no measurement of an angle."""
    log = run(TRUTH, "step", duration=0.8, signals=("feedback_voltage",))
    servo = TRUTH.replace({"potentiometer.feedback_gain": wrong * TRUTH.potentiometer.feedback_gain})
    f = forecast([log], ("output_inertia", "potentiometer.feedback_gain"), servo=servo, sensors=("feedback_voltage",),
                 nuisance=("initial_state",))
    mean, weight = f.own_belief(f.cases[0])
    truth = (log.measured["feedback_voltage"][0] - TRUTH.potentiometer.feedback_offset) \
        / TRUTH.potentiometer.feedback_gain
    assert abs(truth / OFFSET_SCALE - mean[0]) * weight[0] < 4.0


# ------------------------------------------------------------------------------------ what is refused

@pytest.mark.parametrize(("change", "free", "nuisance", "sensors", "words"), [
    ({}, FREE, ("dleay",), ("output_angle",), "delay, log_delay"),
    ({"parameters": {"electronics.stretcher_gain": 60.0}}, FREE, (), ("output_angle",), "stretcher_gain"),
    ({"parameters": {"motor.rotor_inertia": 6e-8}}, FREE, (), ("output_angle",), "rotor_inertia"),
    ({"parameters": {"gear.gear_reduction": 200.0}}, FREE, (), ("output_angle",), "gear_reduction"),
    ({}, FREE, (), ("supply_current",), "no value of supply_current"),
    ({}, FREE, ("angle_sag",), ("output_angle",), "internal_resistance"),
], ids=["nuisance", "log parameter", "member of a lump", "reduction of a lump", "sensor", "sag"])
def test_what_cannot_be_compared_is_refused(change, free, nuisance, sensors, words):
    log = replace(run(TRUTH, "step", duration=0.5), **change)
    with pytest.raises(InputError, match=words) as caught:
        forecast([log], free, nuisance=nuisance, sensors=sensors)
    assert "\n" not in str(caught.value)


def test_what_no_servo_is_counts_as_failed_and_harms_no_other():
    logs = [run(TRUTH, "step", duration=0.5), run(TRUTH, "prbs", duration=0.5)]
    f = forecast(logs, nuisance=("initial_state",))
    at = Point(f.space.start, (np.array([9.0 / OFFSET_SCALE]), f.own_start(f.cases[1])))  # beyond the stops
    with pytest.raises(InputError, match="stops"):
        f.at(at)
    f.strict = False
    bad, good = f.at(at)
    assert np.isnan(bad.residual).all()
    assert np.isnan(bad.shared).all()
    assert np.isfinite(good.residual).all()
    assert np.isfinite(good.shared).all()


@pytest.mark.long
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("central", [False, True])
def test_a_shaft_that_starts_on_a_stop_has_derivatives(side, central):
    """They are those from within: no difference starts beyond the stop."""
    servo = TRUTH.replace({"stops.lower_angle": -1.3, "stops.upper_angle": 1.3})
    f = forecast([moving(servo=servo)], servo=servo)
    part, = f.at(point(f, offset=0.0, own=(1.3 * side, 0.0, 0.0)), central=central)
    inside, = f.at(point(f, offset=0.0, own=(1.29 * side, 0.0, 0.0)), central=central)
    assert np.isfinite(part.residual).all()
    k = f.names_of_own(f.cases[0]).index("output_angle")
    assert part.own[:, k] == pytest.approx(inside.own[:, k], abs=0.02 * np.abs(inside.own[:, k]).max())


def test_copies_of_a_log_say_what_the_logs_themselves_would():
    """A pulse left out, and a row put in that says nothing but its command: all samples of the original count."""
    log = noisy(run(TRUTH, "prbs", seed=5, duration=1.0, kind="pulse_width"), 1e-3)
    sent = np.ones(len(log), np.bool_)
    sent[30] = False
    later = np.where(np.arange(len(log)) >= 30, log.time + 0.02, log.time)
    copies = [log, replace(log, torque_on=sent), replace(
        log, time=np.insert(later, 30, later[30] - 0.02), command=np.insert(log.command, 30, log.command[29]),
        measured={"output_angle": np.insert(log.measured["output_angle"], 30, np.nan)})]
    model = st.PulseServo(TRUTH)
    given = (model, Space(model, ["output_inertia"]), ("delay", "frame_phase", "angle_offset", "initial_state"),
             ("output_angle",))
    first = Forecast([log], *given)
    at = Point(np.append(first.space.start, [3.0, 0.5]), (first.own_start(first.cases[0]),) * 3, (first.frames[0],) * 3)
    parts = [[part.residual for part in Forecast(copies, *given, None, original).at(at, derivatives=False)]
             for original in (None, first.cases[0])]
    for whole, copied in zip(*parts, strict=True):
        np.testing.assert_array_equal(copied, whole)
    for changed in parts[1][1:]:
        assert np.abs(changed - parts[1][0])[:30].max() == 0.0
        assert np.abs(changed - parts[1][0])[30:].max() > 10e-3
