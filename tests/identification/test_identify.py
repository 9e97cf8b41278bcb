"""The fit as a whole, on logs of servos that are known."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import PENDULUM, TRUTH, noisy, run
from servotwin.identification import identify
from servotwin.identification.fitting.free import nominal

DISC = st.loads.Inertia(1.06e-2) + st.loads.Constant(0.3)
FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain"]
BOUNDED = [*FREE[:4], "electronics.bridge_gain"]
OFF = {"motor.armature_resistance": 1.15, "motor.torque_constant": 0.9, "motor.back_emf_constant": 0.9,
       "motor.rotor_inertia": 0.7, "friction.coulomb_torque_forward": 1.3, "friction.coulomb_torque_backward": 1.3,
       "electronics.stretcher_gain": 0.8, "electronics.bridge_gain": 0.8}
WRONG = TRUTH.replace({name: factor * TRUTH.get(name) for name, factor in OFF.items()})
MOTIONS = ("step", "prbs", "triangle")
STD = 1e-3  # rad


def some(servo=TRUTH, std=STD, motions=MOTIONS, **more):
    logs = [run(servo, motion, seed=k, **{"load": DISC, "kind": "pulse_width", "delay": 0.05, "duration": 1.5, **more})
            for k, motion in enumerate(motions)]
    return [noisy(log, std, seed=k) for k, log in enumerate(logs)] if std else logs


def fitted(logs, servo=TRUTH, **more):
    plain = {"free": FREE, "priors": None, "starts": 1, "compare_with": (), "holdout": 0}
    return identify(logs, servo, **{**plain, **more})


def true(name, servo=TRUTH):
    return {"delay": 0.05, "angle_offset": 0.0}.get(name) if name in ("delay", "angle_offset") \
        else nominal(servo, name)


def near(fit, widths=4.0, servo=TRUTH, but=()):
    """Check that every value is within some half widths of 1.96 standard errors."""
    for name, interval in fit.intervals().items():
        if name in but:
            continue
        half = 0.5 * (interval.upper - interval.lower) / 1.96
        assert half > 0.0, name
        assert abs(fit.estimates[name] - true(name, servo)) < widths * half, name


@pytest.fixture(scope="module")
def logs():
    return some()


@pytest.fixture(scope="module")
def fit(logs):
    return fitted(logs)


# --------------------------------------------------------------------------------------- the truth

@pytest.mark.parametrize("kind", ["pulse", "bounded"])
def test_exact_logs_give_the_truth(kind):
    model, free = (st.PulseServo, FREE) if kind == "pulse" else (st.BoundedServo, BOUNDED)
    found = fitted(some(std=0.0, model=model), WRONG, model=model, free=free, intervals=False)
    for name in (*free, "delay"):
        assert found.estimates[name] == pytest.approx(true(name), rel=2e-3), name
    assert abs(found.estimates["angle_offset"]) < 1e-4
    assert isinstance(found.model, model)


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


def test_what_priors_say_holds_where_logs_say_less():
    """A belief of 0.1 % beside logs that say 1 % wins; the servo's own spread is taken unless told otherwise."""
    value = 1.05 * TRUTH.motor.armature_resistance
    found = fitted(some(), priors={"motor.armature_resistance": (value, 1e-4 * value)})
    assert found.estimates["motor.armature_resistance"] == pytest.approx(value, rel=1e-3)
    width = np.diff(found.intervals()["motor.armature_resistance"][:2])[0]
    assert width == pytest.approx(2.0 * 1.96 * 1e-4 * value, rel=0.1)


# ----------------------------------------------------------------------------------- the same again

def test_a_fit_is_the_same_each_time_bit_for_bit(logs, fit):
    again = fitted([replace(log) for log in logs])
    assert again.estimates == fit.estimates
    assert (again.covariance == fit.covariance).all()
    assert again.intervals() == fit.intervals()
    assert again.servo == fit.servo


def test_the_order_of_logs_changes_rounding_only(logs, fit):
    turned = fitted(logs[::-1])
    for name in fit.names:
        lower, upper, _ = fit.intervals()[name]
        assert abs(turned.estimates[name] - fit.estimates[name]) < 0.01 * (upper - lower), name


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


def test_a_log_that_begins_in_motion():
    """Cut out of a run: the servo moves when the log begins, and its command acts only after the delay."""
    whole = some(std=0.0, motions=("prbs", "prbs", "prbs", "triangle"), duration=2.0)
    logs = [noisy(log.part(at, 2.0, name=f"part {k}"), 3e-4, seed=k)
            for k, (log, at) in enumerate(zip(whole, (0.4, 0.6, 0.5, 0.77), strict=True))]
    found = fitted(logs)
    for name, share in (("output_inertia", 0.15), ("output_torque_constant", 0.05), ("delay", 0.08)):
        assert found.estimates[name] == pytest.approx(true(name), rel=share), name


def test_the_delay_of_each_log():
    delays = (0.045, 0.05, 0.06)
    logs = [noisy(run(TRUTH, motion, seed=k, load=DISC, delay=d, duration=1.5), STD, seed=k)
            for k, (motion, d) in enumerate(zip(MOTIONS, delays, strict=True))]
    found = fitted(logs, nuisance=("delay", "log_delay", "angle_offset", "initial_state"))
    near(found, but=("delay",))
    assert found.estimates["delay"] == pytest.approx(0.0517, abs=0.004)


# -------------------------------------------------------------------------------- what cannot be said

RAW = ["gear.gear_reduction", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
       "friction.coulomb_torque_forward", "friction.coulomb_torque_backward"]


def test_a_reduction_has_no_interval_from_motion_alone():
    """N k_t, N k_b, N² J and N F are what the output shaft sees: five products of six numbers."""
    found = fitted(some(load=PENDULUM), free=RAW)
    (item,) = found.unidentifiable
    assert set(item.parameters) == set(RAW)
    step = dict(zip(item.parameters, item.direction, strict=True))
    relative = {name: step[name] / (1.0 if found.space.parameters[RAW.index(name)].logarithmic
                                    else found.best[RAW.index(name)]) for name in RAW}
    for name in RAW[1:]:
        power = 2.0 if name == "motor.rotor_inertia" else 1.0
        assert relative[name] / relative[RAW[0]] == pytest.approx(-power, rel=0.02), name
    intervals = found.intervals()
    for name in RAW:
        assert intervals[name].method == "undetermined"
        assert math.isnan(intervals[name].lower)
        assert math.isnan(intervals[name].upper)
    assert intervals["delay"].method in ("normal", "profile")
    assert found.undetermined == item.parameters
    row = found.names.index(RAW[0])
    assert np.isnan(found.covariance[row]).all()
    assert math.isfinite(found.covariance[found.names.index("delay"), found.names.index("delay")])


@pytest.fixture(scope="module")
def free_shaft():
    """Return logs of an unloaded servo: torques are known up to a factor only."""
    return some(load=None, motions=("step", "prbs"), signals=("output_angle", "supply_current"))


SCALED = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]


def test_without_a_load_torques_are_known_up_to_a_factor(free_shaft):
    """K² / R, J and F go together: only 1/R per J and F per J are seen, and K by the speed."""
    angle = [replace(log, measured={"output_angle": log.measured["output_angle"]}) for log in free_shaft]
    (item,) = fitted(angle, free=SCALED).unidentifiable
    assert set(item.parameters) == {SCALED[0], *SCALED[2:]}
    assert len(item.combinations) == 2
    assert any("current" in text for text in item.remedies)
    assert "would separate them" in str(item)


def test_a_current_that_is_sampled_between_pulses_misleads_no_search(free_shaft):
    """Beside the angle a pulsed current, noise and all: the delay is found as well as from the angle alone."""
    rng = np.random.default_rng(6)
    logs = [replace(log, measured={**log.measured, "supply_current": log.measured["supply_current"]
                                   + 0.02 * rng.normal(size=len(log))}) for log in free_shaft]
    found = fitted(logs, free=SCALED)
    assert found.estimates["delay"] == pytest.approx(0.05, abs=1e-3)
    assert found.noise["output_angle"] < 2.0 * STD


def test_a_sensor_that_is_named_as_a_remedy_is_one(free_shaft):
    angle = [replace(log, measured={"output_angle": log.measured["output_angle"]}) for log in free_shaft]
    (item,) = fitted(angle, free=SCALED).unidentifiable
    sensor = {"a motor current measurement": "armature_current", "a supply current measurement": "supply_current"}
    for text in item.remedies:
        logs = some(load=None, motions=("step", "prbs"), signals=("output_angle", sensor[text]), delay=0.0)
        rng = np.random.default_rng(1)
        logs = [replace(log, measured={**log.measured, sensor[text]: log.measured[sensor[text]]
                                       + 0.02 * rng.normal(size=len(log))}) for log in logs]
        found = fitted(logs, free=SCALED, nuisance=("angle_offset", "initial_state"))
        assert found.unidentifiable == ()
        near(found)


def test_a_load_that_is_named_as_a_remedy_is_one(free_shaft):
    """Of inertia alone a known inertia tells; the potentiometer's gain by a tap is none of that."""
    both = ["output_inertia", "load.inertia"]
    angle = [replace(log, load=st.loads.Inertia(1e-3), measured={"output_angle": log.measured["output_angle"]})
             for log in free_shaft]
    (item,) = fitted(angle, free=both).unidentifiable
    assert set(item.parameters) == set(both)
    assert not any("tap" in text for text in item.remedies)


def test_inductance_cannot_be_seen_in_motion():
    logs = some(motions=("step",), duration=1.0)
    found = fitted(logs, free=["output_inertia", "motor.armature_inductance"], model=st.PulseServoInductive,
                   servo=TRUTH.replace({"motor.armature_inductance": 1e-4}))
    assert [item.parameters for item in found.unidentifiable] in ([], [("motor.armature_inductance",)])
    if not found.unidentifiable:  # or it is, but hardly
        lower, upper, _ = found.intervals()["motor.armature_inductance"]
        assert upper > 1.5 * max(lower, 1e-9)


# ----------------------------------------------------------------------------------------- bounds

def test_what_ends_at_a_bound_is_named_and_has_no_interval(logs):
    limit = 1.2 * nominal(TRUTH, "output_inertia")
    found = fitted(logs, bounds={"output_inertia": (limit, 10.0 * limit)})
    assert found.at_bound == ("output_inertia",)
    assert found.intervals()["output_inertia"].method == "at bound"
    assert found.estimates["output_inertia"] == pytest.approx(limit)
    assert np.isnan(found.covariance[2, 2])
    assert found.intervals()["delay"].method in ("normal", "profile")


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


# -------------------------------------------------------------------------------------- the outcome

def test_traces_and_errors_are_those_of_the_simulation(logs, fit):
    for trace, log in zip(fit.traces, logs, strict=True):
        assert trace.log.name == log.name
        np.testing.assert_array_equal(trace.time, log.time)
        np.testing.assert_array_equal(trace.measured, log.measured["output_angle"])
        at = log.time - fit.estimates["delay"]
        result = st.simulate(fit.model, log.signal(0.01), load=log.load, duration=float(at[-1]))
        simulated = result.at("output_angle", np.maximum(at, 0.0)) + fit.estimates["angle_offset"]
        assert np.abs(trace.simulated - simulated).max() < 3e-3  # its start apart
        (error,) = [e for e in fit.training.errors["PulseServo"] if e.log == log.name]
        assert error.rms == pytest.approx(np.sqrt(np.mean(trace.residual**2)))
        assert error.largest == pytest.approx(np.abs(trace.residual).max())
    assert not fit.holdout


def test_logs_that_are_held_out_have_no_say(logs):
    other = noisy(run(WRONG, "prbs", seed=9, load=DISC, delay=0.05, duration=1.5), STD)
    found = fitted([*logs, other], holdout=[other.name])
    alone = fitted(logs)
    assert found.estimates == alone.estimates
    assert [t.held_out for t in found.traces] == [False, False, False, True]
    assert found.holdout.logs == (other.name,)
    assert found.training.logs == tuple(log.name for log in logs)
    assert found.holdout.total()["PulseServo"] > 3.0 * found.training.total()["PulseServo"]


def test_simpler_models_stand_beside():
    """Of a servo with friction that grows with load, M1 is off, and so is delay + slew + lag."""
    truth = TRUTH.replace({"friction.load_friction": 0.25})
    found = fitted(some(truth), truth, free=["output_inertia", "friction.load_friction"], compare_with=("slew", "M1"))
    total = found.training.total()
    assert set(total) == {"PulseServo", "M1", "delay + slew + lag"}
    assert total["PulseServo"] < total["M1"]
    assert total["PulseServo"] < total["delay + slew + lag"]


def test_levels(fit):
    """Of a normal law: 1.645, 1.960 and 2.576 standard errors."""
    k = fit.names.index("delay")
    std = math.sqrt(fit.covariance[k, k])
    for level, reach in ((0.90, 1.644854), (0.95, 1.959964), (0.99, 2.575829)):
        lower, upper, method = fit.intervals(level)["delay"]
        assert method == "normal"
        assert 0.5 * (upper - lower) == pytest.approx(reach * std, rel=1e-6)
        assert all(type(x) is float for x in (lower, upper))


def test_correlation(fit):
    c = fit.correlation
    assert np.diag(c) == pytest.approx(np.ones(len(c)))
    np.testing.assert_allclose(c, c.T, atol=1e-12)
    assert (np.abs(c) <= 1.0 + 1e-12).all()


def test_draws_have_the_covariance_and_stay_within_bounds(fit):
    drawn = fit.draw(4000, seed=1)
    columns = {"motor.armature_resistance": "motor.armature_resistance", "output_inertia": "motor.rotor_inertia",
               "output_torque_constant": "motor.torque_constant"}
    x = np.array([np.log(drawn[member]) for member in columns.values()])
    which = [fit.names.index(name) for name in columns]
    values = np.array([fit.estimates[name] for name in columns])
    expected = fit.covariance[np.ix_(which, which)] / np.outer(values, values)
    found = np.cov(x)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.08)
    assert all(column.shape == (4000,) for column in drawn.values())
    np.testing.assert_array_equal(drawn["motor.torque_constant"], drawn["motor.back_emf_constant"])
    again = fit.draw(4000, seed=1)
    assert all((again[name] == column).all() for name, column in drawn.items())
    assert not (fit.draw(10, seed=2)["motor.rotor_inertia"] == drawn["motor.rotor_inertia"][:10]).any()
    st.simulate_many(fit.model, st.signals.step(0.0, 0.5, at=0.1, unit="rad"), duration=0.3, parameters=fit.draw(3),
                     output_times=[0.3], outputs=("output_angle",))


def test_draws_keep_to_bounds(logs):
    value = nominal(TRUTH, "output_inertia")
    found = fitted(logs, bounds={"output_inertia": (0.999 * value, 1.001 * value)})
    drawn = found.draw(500)["motor.rotor_inertia"] * TRUTH.gear.gear_reduction**2
    assert (drawn >= 0.999 * value * (1.0 - 1e-12)).all()
    assert (drawn <= 1.001 * value * (1.0 + 1e-12)).all()


def test_without_intervals(logs):
    found = fitted(logs, intervals=False)
    assert found.doubt is None
    assert {i.method for i in found.intervals().values()} == {"not sought"}
    assert np.isnan(found.covariance).all()
    drawn = found.draw(3)
    assert (drawn["motor.armature_resistance"] == found.estimates["motor.armature_resistance"]).all()


# ---------------------------------------------------------------------------------------- interrupts

def stopping(at):
    def tell(share, text):
        assert 0.0 <= share <= 1.0
        if text.startswith(at):
            raise KeyboardInterrupt
    return tell


@pytest.mark.parametrize("at", ["all logs", "intervals", "errors"])
def test_an_interrupt_keeps_the_best_so_far(logs, at):
    found = fitted(logs, progress=stopping(at), starts=2, seed=3)
    assert found.interrupted
    assert all(math.isfinite(value) for value in found.estimates.values())
    assert found.traces
    assert found.servo.fit["interrupted"] is True


def test_an_interrupt_in_a_bad_start_keeps_the_good_one(logs):
    """The first start ends at the truth; the others begin at random, and the last is interrupted midway."""
    best = fitted(logs, intervals=False)
    bounds = {"output_inertia": (0.05, 0.2)} | {"motor.armature_resistance": (3.0, 60.0)}
    good = fitted(logs, intervals=False, bounds=bounds)
    found = fitted(logs, progress=stopping("start 3"), starts=3, seed=0, bounds=bounds)
    assert found.interrupted
    assert found.training.total()["PulseServo"] < 1.5 * good.training.total()["PulseServo"]
    assert best.training.total()["PulseServo"] <= good.training.total()["PulseServo"]


def test_progress_grows_to_the_end(logs):
    told = []
    fitted(logs, progress=lambda share, text: told.append(share))
    assert told == sorted(told)
    assert told[-1] >= 0.9


def test_a_fit_is_pickled(fit):
    again = pickle.loads(pickle.dumps(fit))
    assert again.estimates == fit.estimates
    assert again.intervals() == fit.intervals()
