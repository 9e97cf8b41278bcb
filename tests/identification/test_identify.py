"""The fit as a whole, on logs of servos that are known."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.fits import BOUNDED, DISC, FREE, MOTIONS, STD, WRONG, fitted, near, some, true
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification.fitting.search.free import nominal

# --------------------------------------------------------------------------------------- the truth

@pytest.mark.long(but="bounded")
@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_exact_logs_give_the_truth(kind):
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    found = fitted(some(std=0.0, model=model), WRONG, model=model, free=free, intervals=False)
    for name in (*free, "delay"):
        assert found.estimates[name] == pytest.approx(true(name), rel=2e-3), name
    assert abs(found.estimates["angle_offset"]) < 1e-4
    assert isinstance(found.model, model)


@pytest.mark.long
def test_random_starts_find_the_truth_from_afar():
    far = TRUTH.replace({"motor.rotor_inertia": 2.5 * TRUTH.motor.rotor_inertia,
                         "electronics.stretcher_gain": 0.4 * TRUTH.electronics.stretcher_gain,
                         "motor.armature_resistance": 1.6 * TRUTH.motor.armature_resistance})
    found = fitted(some(), far, starts=3, seed=1)
    near(found)
    assert len(found.starts) == 3
    assert [s.cost for s in found.starts] == sorted(s.cost for s in found.starts)


def test_values_lie_within_their_intervals(fit):
    near(fit)
    assert fit.warnings == ()
    assert fit.unidentifiable == ()
    assert fit.at_bound == ()
    assert fit.names == (*FREE, "delay", "angle_offset")
    assert fit.noise["output_angle"] == pytest.approx(STD, rel=0.2)


@pytest.mark.long(but="huber")
@pytest.mark.parametrize("loss", ["huber", "squares"])
def test_outliers(loss):
    """Every twentieth value off by 0.2 rad: least squares feel it, Huber's loss hardly."""
    rng = np.random.default_rng(3)
    spoilt = []
    for log in some():
        angle = log.measured["output_angle"] + 0.2 * (rng.random(len(log)) < 0.05)
        angle[:5] = log.measured["output_angle"][:5]
        spoilt.append(replace(log, measured={"output_angle": angle}))
    found = fitted(spoilt, loss=loss)
    off = abs(found.estimates["angle_offset"])
    assert off < 1.5e-3 if loss == "huber" else off > 4e-3


@pytest.mark.long
def test_what_priors_say_holds_where_logs_say_less():
    """A belief of 0.01 % beside logs that say 0.16 % wins, and nearly all of the interval is prior."""
    value = 1.002 * TRUTH.motor.armature_resistance
    found = fitted(some(), priors={"motor.armature_resistance": (value, 1e-4 * value)})
    assert found.yielded == ()
    assert found.prior_share["motor.armature_resistance"] > 0.99
    assert found.prior_share["electronics.stretcher_gain"] < 0.5
    assert found.estimates["motor.armature_resistance"] == pytest.approx(value, rel=1e-3)
    width = np.diff(found.intervals()["motor.armature_resistance"][:2])[0]
    assert width == pytest.approx(2.0 * 1.96 * 1e-4 * value, rel=0.1)


# ----------------------------------------------------------------------------------- the same again

def test_a_fit_is_the_same_each_time_bit_for_bit(logs, fit):
    again = fitted([replace(log) for log in logs])
    assert again.estimates == fit.estimates
    np.testing.assert_array_equal(again.covariance, fit.covariance)
    assert again.intervals() == fit.intervals()
    assert again.servo == fit.servo


def test_the_order_of_logs_changes_rounding_only(logs, fit):
    turned = fitted(logs[::-1])
    for name in fit.names:
        lower, upper, _ = fit.intervals()[name]
        assert abs(turned.estimates[name] - fit.estimates[name]) < 0.01 * (upper - lower), name


@pytest.mark.long(but="twice")
@pytest.mark.parametrize("told", ["first half", "second half", "twice"])
def test_halves_of_the_logs_and_all_of_them_twice_say_the_same(logs, fit, told):
    """Within the intervals of the fit with fewer; the same logs twice over leave narrower ones."""
    again = [replace(log, name=f"{log.name} again") for log in logs]
    half = len(logs) // 2
    other = fitted({"first half": logs[:half], "second half": logs[half:], "twice": [*logs, *again]}[told])
    fewer, more = (fit, other) if told == "twice" else (other, fit)
    for name in fit.names:
        lower, upper, _ = fewer.intervals()[name]
        assert lower <= more.estimates[name] <= upper, name
        assert np.diff(more.intervals()[name][:2])[0] <= 1.02 * (upper - lower), name


@pytest.mark.long(but="bounded")
@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_half_the_output_step_moves_nothing(kind):
    """Midpoints at which nothing was measured: by less than 1 % of the interval, as promised."""
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    plain = some(model=model)
    fine = []
    for log in plain:
        time = np.sort(np.concatenate([log.time, 0.5 * (log.time[1:] + log.time[:-1])]))
        angle = np.full(len(time), np.nan)
        angle[::2] = log.measured["output_angle"]
        # something that is asked for at every instant, and counts for nothing
        fine.append(replace(log, time=time, command=np.repeat(log.command, 2)[:-1],
                            measured={"output_angle": angle, "feedback_voltage": np.zeros(len(time))}))
    a = fitted(plain, model=model, free=free)
    b = fitted(fine, model=model, free=free, sensors=("output_angle", "feedback_voltage"),
               noise={"output_angle": a.noise["output_angle"], "feedback_voltage": 1e9})
    for name, (lower, upper, _) in a.intervals().items():
        assert abs(a.estimates[name] - b.estimates[name]) < 0.01 * (upper - lower), name


# ------------------------------------------------------------------------------------ odd logs

@pytest.mark.long
def test_uneven_samples_gaps_and_other_clocks():
    rng = np.random.default_rng(8)
    logs = []
    for k, motion in enumerate(MOTIONS):
        time = 1e4 * k + np.cumsum(rng.uniform(0.005, 0.035, 80))
        time[50:] += 0.3
        logs.append(noisy(run(TRUTH, motion, time=time, seed=k, load=DISC, delay=0.05), STD, seed=k))
    near(fitted(logs))


def test_disturbed_windows_that_are_left_out_change_nothing(logs, fit):
    spoilt = []
    for log in logs:
        hit = (log.time > 1.0) & (log.time < 1.2)
        angle = np.where(hit, 9.0, log.measured["output_angle"])
        spoilt.append(replace(log, measured={"output_angle": angle}, left_out=((1.001, 1.199),)))
    found = fitted(spoilt)
    near(found)
    for name in found.names:
        lower, upper, _ = fit.intervals()[name]
        assert abs(found.estimates[name] - fit.estimates[name]) < upper - lower


@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_stretches_without_torque(kind):
    """A pulse servo falls as its logs do; for a bounded one the log ends there."""
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    servo = TRUTH.replace({"electronics.pulse_timeout": 0.03})
    torque = np.ones(75, np.bool_)
    torque[50:65] = False
    if kind == "bounded":
        sagging = np.where(np.arange(75) < 50, 1.0, 0.9)
        logs = [replace(log, torque_on=torque, measured={"output_angle": sagging * log.measured["output_angle"]})
                for log in some(model=model)]
    else:
        logs = some(servo, torque_on=torque)
    near(fitted(logs, servo, model=model, free=free))


def test_logs_of_a_potentiometer_only():
    """The voltage tells the angle by a gain that is searched too, and is 5 % off to begin with."""
    rng = np.random.default_rng(2)
    logs = [replace(log, measured={"feedback_voltage": v + 4e-4 * rng.normal(size=len(v))})
            for log in some(std=0.0, signals=("feedback_voltage",)) for v in (log.measured["feedback_voltage"],)]
    free = ["output_inertia", "output_coulomb_torque", "potentiometer.feedback_gain"]
    wrong = TRUTH.replace({"potentiometer.feedback_gain": 1.05 * TRUTH.potentiometer.feedback_gain})
    for servo in (TRUTH, wrong):
        found = fitted(logs, servo, free=free, nuisance=("delay", "initial_state"))
        near(found)
        assert found.traces[0].signal == "feedback_voltage"


def test_logs_of_different_supplies_and_loads():
    logs = [noisy(run(TRUTH, motion, seed=k, load=load, delay=0.05, name=f"{k}",
                      parameters={"supply.open_circuit_voltage": volt}), STD, seed=k)
            for k, (motion, volt, load) in enumerate([("step", 4.8, None), ("prbs", 6.0, DISC), ("step", 7.4, DISC)])]
    near(fitted(logs))


@pytest.mark.slow
def test_a_log_that_begins_in_motion():
    """Cut out of a run: the servo moves when the log begins, and its command acts only after the delay."""
    whole = some(std=0.0, motions=("prbs", "prbs", "prbs", "triangle"), duration=2.0)
    logs = [noisy(log.part(at, 2.0, name=f"part {k}"), 3e-4, seed=k)
            for k, (log, at) in enumerate(zip(whole, (0.4, 0.6, 0.5, 0.77), strict=True))]
    found = fitted(logs)
    for name, share in (("output_inertia", 0.15), ("output_torque_constant", 0.05)):
        assert found.estimates[name] == pytest.approx(true(name), rel=share), name
    low, high, _ = found.intervals()["delay"]  # the true one is at its end: pulses come with the samples
    assert low - 1e-3 < true("delay") < high + 1e-3
    assert high - low < 0.012


def test_the_delay_of_each_log():
    delays = (0.045, 0.05, 0.06)
    logs = [noisy(run(TRUTH, motion, seed=k, load=DISC, delay=d, duration=1.5), STD, seed=k)
            for k, (motion, d) in enumerate(zip(MOTIONS, delays, strict=True))]
    found = fitted(logs, nuisance=("delay", "log_delay", "angle_offset", "initial_state"))
    near(found, but=("delay",))
    assert found.estimates["delay"] == pytest.approx(0.0517, abs=0.004)


# ----------------------------------------------------------------------------------------- bounds

@pytest.mark.long
def test_what_ends_at_a_bound_is_named_and_has_no_interval(logs):
    limit = 1.2 * nominal(TRUTH, "output_inertia")
    found = fitted(logs, bounds={"output_inertia": (limit, 10.0 * limit)})
    assert found.at_bound == ("output_inertia",)
    assert found.intervals()["output_inertia"].method == "at bound"
    assert found.estimates["output_inertia"] == pytest.approx(limit)
    assert np.isnan(found.covariance[2, 2])
    assert found.intervals()["angle_offset"].method in ("normal", "profile")


@pytest.mark.long
@pytest.mark.parametrize("name", ["motor.motor_viscous_friction", "electronics.minimum_drive_time",
                                  "friction.breakaway_ratio", "supply.internal_resistance", "friction.load_friction"])
def test_what_the_servo_does_not_have_is_found_to_be_nearly_nothing(logs, name):
    """The truth is the least value that there is: at its bound or with an interval that holds it, and no warning."""
    found = fitted(logs, free=["output_inertia", "output_coulomb_torque", name])
    least = 1.0 if name == "friction.breakaway_ratio" else 0.0
    most = {"motor.motor_viscous_friction": 3e-8, "electronics.minimum_drive_time": 3e-5,
            "friction.breakaway_ratio": 1.05, "supply.internal_resistance": 0.05, "friction.load_friction": 0.02}[name]
    assert least <= found.estimates[name] < most
    assert found.estimates["output_inertia"] == pytest.approx(nominal(TRUTH, "output_inertia"), rel=0.05)


def test_viscous_friction_is_found_from_nothing():
    truth = TRUTH.replace({"motor.motor_viscous_friction": 2e-7})
    found = fitted(some(truth), free=["output_inertia", "output_coulomb_torque", "motor.motor_viscous_friction"])
    near(found, servo=truth)
    lower, upper, _ = found.intervals()["motor.motor_viscous_friction"]
    assert upper - lower < 1e-7
