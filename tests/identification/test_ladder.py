"""The friction laws one after the other: the simplest that predicts, and what happens beyond."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.errors import InputError
from servotwin.identification import RUNGS, friction_ladder
from servotwin.identification.fitting.fit import Rung, begin_after
from servotwin.identification.fitting.ladder import choice_of, told_of, with_criterion

FREE = ["motor.armature_resistance", "output_inertia", "electronics.stretcher_gain"]
PLAIN = {"starts": 1, "priors": None, "nuisance": ("delay", "angle_offset", "initial_state")}
LOADED = TRUTH.replace({"friction.load_friction": 0.35})
SOFT = TRUTH.replace({"supply.internal_resistance": 0.8})


def logs(servo, std=1e-3, count=12, noise=0, duration=1.0):
    """Return logs under loads that push either way: load friction shows where the load changes."""
    some = []
    for k in range(count):
        load = st.loads.Inertia(5e-3) + st.loads.Constant((0.0, 0.3, -0.3, 0.5)[k % 4])
        log = run(servo, ("step", "prbs", "triangle")[k % 3], seed=k, load=load, delay=0.03, duration=duration,
                  kind="pulse_width", name=f"{k}")
        some.append(noisy(log, std, seed=(noise, k)))
    return some


@pytest.fixture(scope="module")
def plain():
    return friction_ladder(logs(TRUTH), TRUTH, free=FREE, rungs=("M1", "M3"), **PLAIN)


@pytest.fixture(scope="module")
def soft():
    return friction_ladder(logs(SOFT), TRUTH, free=FREE, rungs=("M1", "M3"), gives_way=True, **PLAIN)


@pytest.fixture(scope="module")
def loaded():
    return friction_ladder(logs(LOADED), TRUTH, free=FREE, rungs=("M1", "M3"), **PLAIN)


@pytest.mark.long
def test_coulomb_and_viscous_friction_is_enough_where_there_is_no_more(plain):
    assert plain.chosen == "M1"
    assert "simplest" in plain.reason or "smallest" in plain.reason
    assert plain.fit is plain["M1"].fit


@pytest.mark.long
def test_load_friction_is_found_where_there_is_some(loaded):
    assert loaded.chosen == "M3"
    assert loaded["M1"].holdout > 2.0 * loaded["M3"].holdout
    interval = loaded["M3"].fit.intervals()["friction.load_friction"]
    assert interval.lower < 0.35 < interval.upper or abs(
        loaded["M3"].fit.estimates["friction.load_friction"] - 0.35) < 0.02


@pytest.mark.long
def test_a_supply_that_gives_way_is_found_on_the_best_law(soft):
    """Stands behind its law, and is searched where the law is chosen; the reason says what it gains, and where."""
    names = [rung.name for rung in soft.rungs]
    assert soft.chosen in ("M1, soft supply", "M3, soft supply")
    assert names[names.index(soft.chosen):][:2] == [soft.chosen, f"{soft.chosen[:2]}, soft bridge"]
    assert soft["M1"].holdout > 1.3 * soft[soft.chosen].holdout
    assert soft.fit.estimates["supply.internal_resistance"] == pytest.approx(0.8, rel=0.1)
    assert "% less off than M" in soft.reason
    assert "held out" in soft.reason


def test_a_supply_is_tried_only_where_nobody_knows_it():
    from servotwin.identification.fitting.ladder import may_give_way

    model, some = st.PulseServo(TRUTH), logs(TRUTH, count=2)
    assert may_give_way(model, some, FREE) == ("soft supply", "soft bridge")
    assert may_give_way(st.BoundedServo(TRUTH), some, FREE) == ()
    assert may_give_way(model, some, [*FREE, "supply.internal_resistance"]) == ("soft bridge",)
    known = replace(some[0], parameters={"supply.internal_resistance": 0.1})
    seen = replace(some[0], measured={**some[0].measured, "bus_voltage": np.full(len(some[0].time), 6.0)})
    assert may_give_way(model, [some[1], known], FREE) == ("soft bridge",)
    assert may_give_way(model, [some[1], seen], FREE) == ("soft bridge",)


@pytest.mark.slow
def test_the_criterion_chooses_the_same_here():
    rungs = ("M1", "M3")
    for servo, expected in ((TRUTH, "M1"), (LOADED, "M3")):
        ladder = friction_ladder(logs(servo, count=6), TRUTH, free=FREE, rungs=rungs, select="criterion", holdout=0,
                                 **PLAIN)
        assert ladder.chosen == expected
        assert ladder.reason.startswith("smallest information criterion")
        assert all(math.isnan(rung.holdout) for rung in ladder.rungs)


@pytest.mark.long
def test_more_terms_fit_what_is_fitted_at_least_as_well(plain, loaded):
    for ladder in (plain, loaded):
        assert ladder["M3"].training < 1.001 * ladder["M1"].training


def test_each_rung_searches_its_own_terms(plain, loaded):
    for ladder in (plain, loaded):
        for rung in ladder.rungs:
            assert set(rung.fit.names) == {*FREE, *RUNGS[rung.name], "delay", "angle_offset"}
            servo = rung.fit.servo
            for term in ("friction.load_friction", "friction.stribeck_speed", "friction.load_friction_stribeck"):
                assert (servo.get(term) is not None) == (term in RUNGS[rung.name]), (rung.name, term)


def test_errors_are_those_of_the_fits(plain):
    for rung in plain.rungs:
        assert rung.training == rung.fit.training.total()["PulseServo"]
        assert rung.holdout == rung.fit.holdout.total()["PulseServo"]
    assert 0.0 < plain.error < 1.5 * max(rung.holdout for rung in plain.rungs)
    assert plain["M1"].fit.holdout.logs == plain["M3"].fit.holdout.logs


def test_only_the_chosen_rung_is_searched_to_its_end(loaded):
    """The others are there to be compared."""
    chosen, other = loaded["M3"].fit, loaded["M1"].fit
    assert chosen.verdict is not None
    assert chosen.ends
    assert other.verdict is None
    assert not other.ends
    assert not other.interrupted


PENDULUMS = st.load_servo("dynamixel-xl330-m288").replace({
    "supply.bridge_drop_resistance": None, "friction.load_friction": 0.2})


def swung(servo, count=5, duration=2.0):
    """Return logs of a bus servo that swings pendulums, of two gains of its loop."""
    some = []
    for k in range(count):
        time, gain = np.arange(0.0, duration, 0.01), 2.8774e-3 * (100, 400)[k % 2]
        command = (1.2, 0.8, 0.5, 1.0)[k % 4] * np.sin(2.0 * np.pi * (0.5, 0.8, 1.2, 0.6)[k % 4] * time)
        command += 0.3 * (np.floor(time / 0.7) % 2)
        log = st.Log(name=f"{k}", time=time, command=command, command_kind="angle", motion=f"{k}",
                     load=st.loads.Pendulum(mass=0.25 + 0.1 * (k % 3), length=0.12, inertia=0.0),
                     parameters={"firmware.proportional_gain": gain}, measured={"output_angle": np.zeros(len(time))})
        seen = st.simulate(st.DigitalServo(servo.replace(log.parameters)), log.signal(None), load=log.load,
                           duration=float(time[-1]), output_times=time, initial={"output_angle": float(command[0])})
        some.append(noisy(replace(log, measured={"output_angle": seen["output_angle"]}), 2e-3, seed=(0, k)))
    return some


@pytest.mark.long
@pytest.mark.parametrize(("truth", "expected"), [
    (PENDULUMS, "M3"), (PENDULUMS.replace({"supply.bridge_drop_resistance": 2.0}), "M3, soft bridge")],
    ids=["hard", "soft"])
def test_the_law_and_the_bridge_of_a_bus_servo_are_named(truth, expected):
    """From a winding 20 % off, where lanes go nearly."""
    far = PENDULUMS.replace({"motor.armature_resistance": 1.2 * PENDULUMS.motor.armature_resistance})
    found = friction_ladder(swung(truth), far, free=["motor.armature_resistance", "output_torque_constant",
                            "output_inertia"], rungs=("M1", "M3"), gives_way=True, select="criterion", holdout=0,
                            priors=None, starts=1, intervals=False)
    assert found.chosen == expected
    assert found.fit.estimates["friction.load_friction"] == pytest.approx(0.2, abs=0.01)


@pytest.mark.slow
def test_all_rungs_on_few_logs():
    """Six laws on four short logs: each begins where a simpler one ended, and the noise is all that is left to fit."""
    ladder = friction_ladder(logs(LOADED, count=6, duration=0.6), TRUTH, free=FREE, intervals=False,
                             holdout=["4", "5"], gives_way=False, **PLAIN)
    assert [rung.name for rung in ladder.rungs] == list(RUNGS)
    for rung in ladder.rungs:
        assert set(rung.fit.names) == {*FREE, *RUNGS[rung.name], "delay", "angle_offset"}
        for inner in ladder.rungs:
            if set(RUNGS[inner.name]) <= set(RUNGS[rung.name]):
                assert rung.training < 1.02 * inner.training
    assert ladder.chosen not in ("M1", "M2")
    assert ladder["M6"].training < 1.02 * ladder["M3"].training < 0.6 * ladder["M1"].training


# --------------------------------------------------------------------------- the choice among given errors

class _Fit:
    """As much of a fit as a choice reads."""

    def __init__(self, errors):
        from servotwin.identification import ErrorTable, LogError

        self.model = st.PulseServo(TRUTH)
        self.holdout = ErrorTable(("PulseServo",), {"PulseServo": tuple(
            LogError(f"{k}", "step", {}, e, e, 100) for k, e in enumerate(errors))})


def rung(name, holdout, training=0.01, criterion=0.0):
    return Rung(name, _Fit(holdout), training, float(np.sqrt(np.mean(np.square(holdout)))) if holdout else math.nan,
                criterion)


def test_the_simplest_within_one_standard_error_of_the_best_is_chosen():
    """M3 is better by far, M4 a little and not on every log: M3."""
    rungs = [rung("M1", [0.03, 0.04, 0.05, 0.03]), rung("M3", [0.010, 0.012, 0.011, 0.013]),
             rung("M4", [0.0101, 0.0119, 0.0112, 0.0126])]
    assert choice_of(rungs, "holdout")[0] == "M3"
    assert "M4" in choice_of(rungs, "holdout")[1]


def test_a_small_gain_on_every_log_is_one():
    rungs = [rung("M1", [0.0120, 0.0221, 0.0319, 0.0420]), rung("M2", [0.0110, 0.0211, 0.0310, 0.0411])]
    assert choice_of(rungs, "holdout") == ("M2", "smallest error on logs that were held out")


def test_two_logs_do_not_say_how_logs_scatter():
    """A law that is wrong on one of two logs does not pass as one standard error of a scatter of two."""
    rungs = [rung("M2", [0.0011, 0.0051]), rung("M3", [0.00111, 0.00117]), rung("M4", [0.00111, 0.00116])]
    assert choice_of(rungs, "holdout")[0] == "M3"


def test_overfitting_is_shown_and_not_chosen():
    """M6 is best on what it was fitted to, and worse on others."""
    rungs = [rung("M1", [0.011, 0.012, 0.010], training=0.010), rung("M6", [0.030, 0.020, 0.025], training=0.002)]
    assert [r.overfits for r in rungs] == [False, True]
    assert choice_of(rungs, "holdout")[0] == "M1"


def test_without_logs_held_out_the_criterion_decides():
    rungs = [rung("M1", [], criterion=-10.0), rung("M2", [], criterion=-12.0)]
    assert choice_of(rungs, "holdout") == ("M2", "smallest information criterion")


class _Seen:
    """A fit as a criterion reads it: errors that remember the one before, and so many numbers."""

    def __init__(self, size, memory, names):
        rng, error = np.random.default_rng(int(100 * memory)), np.zeros(4000)
        for k in range(1, len(error)):
            error[k] = memory * error[k - 1] + rng.normal()
        error *= size / np.sqrt(np.mean(error**2))
        self.names = ("x",) * names
        self.traces = (type("T", (), {"time": np.arange(4000.0), "residual": error, "held_out": False})(),)


def test_a_criterion_counts_all_rungs_by_the_same_residuals():
    """One whose errors remember longer would seem to explain more of them, each counted by its own."""
    rungs = with_criterion([Rung("M1", _Seen(0.012, 0.9, 3), 0.012, math.nan, math.nan),
                            Rung("M3", _Seen(0.010, 0.5, 5), 0.010, math.nan, math.nan)])
    samples = 4000 / 3.0  # (1 + rho)/(1 - rho) of the better one
    gap = samples * 2.0 * math.log(1.2) - 2.0 * math.log(samples)
    assert rungs[0].criterion - rungs[1].criterion == pytest.approx(gap, rel=0.1)


def test_the_error_is_told_by_logs_that_did_not_choose():
    """Twelve rungs that are alike but for luck: the chosen one looks better than it is, its told error does not."""
    rng = np.random.default_rng(3)
    seen, told = [], []
    for _ in range(200):
        rungs = [rung(f"M{k}", np.sqrt(rng.chisquare(3, 8) / 3.0).tolist()) for k in range(1, 13)]
        chosen = choice_of(rungs, "holdout")[0]
        seen.append(next(r.holdout for r in rungs if r.name == chosen) ** 2)
        told.append(told_of(rungs, "holdout").error ** 2)
    assert np.mean(told) == pytest.approx(1.0, abs=0.06)  # what every rung is worth
    assert np.mean(seen) < 0.85


def test_halves_that_choose_differently_are_named():
    rungs = [rung("M1", [0.01, 0.03, 0.01, 0.03]), rung("M3", [0.03, 0.01, 0.03, 0.01])]
    found = told_of(rungs, "holdout")
    assert found.choices == ("M1", "M3")
    assert found.error == pytest.approx(0.03)
    assert math.isnan(told_of([rung("M1", [0.01])], "holdout").error)
    assert told_of(rungs, "criterion") == (rungs[0].holdout, ())


@pytest.mark.parametrize(("more", "words"), [({"rungs": ("M7",)}, "rungs"), ({"rungs": ()}, "at least one rung"),
                                             ({"select": "best"}, "criterion"), ({"rungs": "M1"}, "rungs")],
                         ids=["unknown", "none", "select", "text"])
def test_what_makes_no_sense_is_refused(more, words):
    with pytest.raises(InputError, match=words):
        friction_ladder(logs(TRUTH, count=1), TRUTH, **more)


def test_a_rung_that_is_not_there_is_named(plain):
    with pytest.raises(InputError, match="M1, M3"):
        plain["M6"]


@pytest.mark.parametrize("exactly", [True, False])
def test_a_search_begins_where_a_fit_ended(exactly):
    own = (np.array([0.1]), np.array([0.2]))
    fit = SimpleNamespace(phased=False, estimates={"delay": 0.02, "output_inertia": 1e-3}, scales={"delay": 1e-3},
                          own=own)
    begun = begin_after(fit, exactly=exactly)
    assert (begun.searches, begun.shared, begun.own, begun.exactly) == (1, {"delay": 0.02}, own, exactly)
    anew = begin_after(SimpleNamespace(phased=True), exactly=exactly)  # when pulses come is found again
    assert (anew.shared, anew.own, anew.exactly) == ({}, (), exactly)
