"""The ticks of a program that pulses command: how they go with the pulses of a log, and which commands they take."""

import numpy as np
import pytest

import servotwin as st
from identification.digital_servos import PULSED, digital_log
from identification.fits import near
from servotwin.identification import Space, identify
from servotwin.identification.fitting.diagnosis.bench import Purse, Watched
from servotwin.identification.fitting.identify import NUISANCE, usual_nuisance
from servotwin.identification.fitting.search.case import DELAY_SCALE, Frames, Point
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.least_squares import Loss
from servotwin.identification.fitting.search.phases import Scan, Ticks, ticks_of
from validation.test_digital_coverage import MOTIONS, OFF, bench

DISC = st.loads.Inertia(4e-3)  # rests until the first tick
TICK = PULSED.firmware.control_period
FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "firmware.proportional_gain", "firmware.derivative_gain"]


def forecast_of(log, servo=PULSED):
    model = st.DigitalServo(servo)
    return Forecast([log], model, Space(model, ["output_inertia"]), ("delay", "frame_phase", "control_phase"),
                    ("output_angle",))


def part(forecast, first, tick=0.0):
    """Return what a log says where its first pulse comes at `first`, and ticks by `tick` later than they would [s]."""
    shared = np.append(forecast.space.start, 0.06 / DELAY_SCALE)
    return forecast.at(point(shared, first, tick), derivatives=False)[0]


def point(shared, first, tick):
    return Point(shared, (np.array([first / DELAY_SCALE]),), (Frames(0.005, 0.01, tick),))


@pytest.mark.long
@pytest.mark.parametrize("first", [0.004, 0.0049, -0.002, -2e-5])
@pytest.mark.parametrize("tick", [1e-3, TICK])
def test_pulses_that_come_later_move_the_motion_by_as_much(first, tick):
    """Ticks that stayed where they were had made steps of it, of up to a tick; and a pulse before 0 was left out."""
    forecast = forecast_of(digital_log(PULSED.replace({"firmware.control_period": tick}), "prbs", std=0.0, delay=0.06),
                           PULSED.replace({"firmware.control_period": tick}))
    here, there = part(forecast, first), part(forecast, first + 1e-5)
    expected = here.later * (1e-5 / DELAY_SCALE)
    np.testing.assert_allclose(there.residual - here.residual, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.long
@pytest.mark.parametrize("first", [1.3, -1.3])
def test_a_trial_whose_pulses_come_after_the_log_can_be_run(first):
    assert np.isfinite(part(forecast_of(digital_log(PULSED, "prbs", delay=0.06)), first).residual).all()


@pytest.mark.long
def test_between_the_ends_of_pulses_ticks_cannot_be_told_from_pulses():
    forecast = forecast_of(digital_log(PULSED, "step", std=0.0, duration=1.6, delay=0.06, load=DISC))
    shared = np.append(forecast.space.start, 0.06 / DELAY_SCALE)
    ticks = ticks_of(forecast, point(shared, 0.0, 0.0), 0)
    wide = [gap for gap in ticks.gaps if gap.width > 1e-4]
    assert ticks.period == TICK
    assert sum(gap.width for gap in ticks.gaps) == pytest.approx(TICK, abs=1e-5)
    assert len(wide) > 2
    for gap in wide:
        assert (gap.low, gap.high) == pytest.approx(tuple(ticks.gap_of(gap.middle)))
        first, last = (part(forecast, 0.005 - tick, tick).residual
                       for tick in (gap.low + 0.01 * gap.width, gap.high - 0.01 * gap.width))
        np.testing.assert_allclose(last, first, atol=1e-11)
        after = part(forecast, 0.005 - gap.high - 1e-5, gap.high + 1e-5).residual
        assert np.abs(after - first).max() > 1e-3
    assert Ticks(TICK, np.array([1e-3]), ()).wait(1.5e-3) == pytest.approx(0.5e-3)
    waits = [ticks.wait(tick) for tick in np.arange(0.0, TICK, 1e-5)]
    assert np.mean(waits) == pytest.approx(0.5 * TICK, rel=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("tick", "phases"), [
    (1e-3, (0.634, 0.631, 0.722, 0.414)), (TICK, (0.262, 0.323, 0.011, 0.398))],
                         ids=["1 ms, all between the ends of pulses", "5 ms, two between them"])
def test_ticks_are_found_for_all_logs_at_once(tick, phases):
    """Taken one by one, the logs kept wrong commands that parameters, 5 % off, made up for: none alone could go."""
    servo = PULSED.replace({"firmware.control_period": tick, "motor.armature_resistance": 2.1})
    motions = ("step", "prbs", "triangle", "step")
    logs = [digital_log(servo, motion, seed=730 + k, duration=1.6, phase=phase, delay=0.05)
            for k, (motion, phase) in enumerate(zip(motions, phases, strict=True))]
    begin = servo.replace({"motor.armature_resistance": 2.4, "firmware.proportional_gain": 4.8,
                           "firmware.derivative_gain": 0.02})
    fit = identify(logs, begin, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, diagnose=False)
    assert fit.noise["output_angle"] == pytest.approx(1e-3, rel=0.2)
    assert fit.servo.fit["control_phase"] == "of each log"
    near(fit, servo=servo, but=("delay",))
    low, high, method = fit.intervals()["delay"]
    assert method == "by pulses"
    assert low < 0.05 < high < low + 0.01 + tick + 1e-3


@pytest.mark.long
def test_friction_that_went_to_nothing_comes_back():
    """The search of these logs ended with a quarter of their friction, beside a ridge: 2.1 mrad were left of them."""
    servo, truth, rng = bench(7)
    begin = servo.replace({name: factor * servo.get(name) for name, factor in OFF.items()})
    phases = rng.uniform(size=(3, len(MOTIONS)))[2]
    logs = [digital_log(servo, motion, seed=720 + k, duration=1.6, phase=phase, delay=truth["delay"])
            for k, (motion, phase) in enumerate(zip(MOTIONS, phases, strict=True))]
    fit = identify(logs, begin, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, diagnose=False,
                   intervals=False)
    assert fit.noise["output_angle"] == pytest.approx(1e-3, rel=0.3)
    assert fit.estimates["output_coulomb_torque"] == pytest.approx(truth["output_coulomb_torque"], rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("watched", [False, True])
def test_trials_of_several_logs_say_what_each_says_alone(watched):
    """Logs have as many trials as they have gaps: one runs on where another has none left, to the same bits."""
    logs = [digital_log(PULSED, motion, seed=k, duration=duration, delay=0.05)
            for k, (motion, duration) in enumerate((("prbs", 1.2), ("step", 1.0)))]
    model = st.DigitalServo(PULSED)
    what = (logs, model, Space(model, ["output_inertia"]), ("delay", "frame_phase", "control_phase"),
            ("output_angle",))
    forecast = Watched(Purse(1e9), 1.0, *what) if watched else Forecast(*what)
    forecast.seen = tuple(np.arange(case.count) % 2 == 0 for case in forecast.cases)
    shared = np.append(forecast.space.start, 0.05 / DELAY_SCALE)
    scan = Scan(forecast, Loss(), Point(shared, tuple(np.zeros(1) for _ in logs), forecast.frames))
    choices = {k: scan.later(k, 2)[:5 - 2 * k] for k in (0, 1)}
    assert [len(some) for some in choices.values()] == [5, 3]
    both = scan.parts(choices, rates=True)
    for k, some in choices.items():
        for one, part in zip(some, both[k], strict=True):
            alone, = scan.parts({k: [one]}, rates=True)[k]
            assert part.residual.tobytes() == alone.residual.tobytes()
            assert part.later.tobytes() == alone.later.tobytes()


def test_ticks_have_a_phase_unless_one_says_where_pulses_command_a_program():
    goals = PULSED.replace({"firmware.command_kind": "goal"})
    assert usual_nuisance(st.DigitalServo(PULSED)) == (*NUISANCE, "control_phase")
    for model in (st.DigitalServo(goals), st.PulseServo(st.load_servo("hitec-hs-755hb"))):
        assert usual_nuisance(model) == NUISANCE
