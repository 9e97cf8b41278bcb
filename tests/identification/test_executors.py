"""Who simulates does not matter: fits are the same to the last bit, and a killed worker costs nothing but time."""

import multiprocessing
import os
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import servotwin as st
from identification.fits import WRONG, fitted, some
from identification.synthetic_logs import PENDULUM
from servotwin.errors import InputError
from servotwin.identification import friction_ladder
from servotwin.identification.fitting.search.case import Point
from servotwin.identification.fitting.search.forecast import Forecast, Running
from servotwin.identification.fitting.search.free import Space
from simulation.test_workers import Backwards

SPAWN = multiprocessing.get_context("spawn")
OPTIONS = {"starts": 3, "holdout": 0.25, "compare_with": ("M1",)}


class Counting(ThreadPoolExecutor):
    """Threads that count what they are handed."""

    pieces = 0

    def submit(self, work, *arguments):
        self.pieces += 1
        return super().submit(work, *arguments)


@pytest.fixture(scope="module")
def mixed():
    """Logs of other lengths, times, loads and kinds, so that calls hold several at once or one."""
    plain = some(duration=1.0)
    return [*plain, *some(duration=0.8, sample=0.013, load=PENDULUM, kind="angle", motions=("triangle",), name="other")]


@pytest.fixture(scope="module")
def local(mixed):
    return fitted(mixed, WRONG, **OPTIONS)


def check_same(found, expected):
    assert found.estimates == expected.estimates
    assert found.intervals() == expected.intervals()
    assert found.cost == expected.cost
    assert found.starts == expected.starts
    assert found.warnings == expected.warnings
    assert found.noise == expected.noise
    assert found.holdout == expected.holdout
    assert found.servo == expected.servo
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    for one, other in zip(found.traces, expected.traces, strict=True):
        np.testing.assert_array_equal(one.simulated, other.simulated, err_msg=one.log.name)


@pytest.mark.long
@pytest.mark.parametrize("executor", [Counting(1), Counting(3), Backwards()], ids=["one", "three", "backwards"])
def test_the_fit_is_the_same_to_the_last_bit(mixed, local, executor):
    check_same(fitted(mixed, WRONG, executor=executor, **OPTIONS), local)
    if isinstance(executor, Counting):
        assert executor.pieces > 50


@pytest.mark.slow
def test_a_killed_worker_costs_nothing_but_time(mixed, local):
    killed = []
    with ProcessPoolExecutor(2, mp_context=SPAWN) as pool:
        def kill(share, text):
            if share > 0.2 and not killed:
                killed.extend(pool._processes)
                os.kill(killed[0], signal.SIGKILL)

        check_same(fitted(mixed, WRONG, executor=pool, progress=kill, **OPTIONS), local)
    assert killed


@pytest.mark.long
def test_a_ladder_hands_its_executor_on(logs):
    with Counting(1) as pool:
        friction_ladder(logs, WRONG, free=["output_inertia"], rungs=("M1",), priors=None, starts=1, holdout=0,
                        intervals=False, executor=pool)
    assert pool.pieces > 5


@pytest.mark.parametrize(("given", "said"), [
    ({"executor": ThreadPoolExecutor}, "one with a submit method"),
    ({"accuracy": 0.0}, "accuracy: got 0.0, allowed: a number of radians, from 1e-13 to 0.0001"),
    ({"accuracy": -1e-9}, "accuracy: got -1e-09"),
    ({"accuracy": float("nan")}, "accuracy: got nan"),
    ({"accuracy": 1e-3}, "accuracy: got 0.001"),
    ({"accuracy": "fine"}, "accuracy: got 'fine'"),
])
def test_bad_ways_to_run_are_refused(logs, given, said):
    with pytest.raises(InputError) as caught:
        fitted(logs, **given)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_executor_that_is_lost_is_said_in_one_line(logs):
    class Away:
        def submit(self, work, *arguments):
            raise ConnectionError("all workers are gone")

    with pytest.raises(InputError, match="executor: got 'ConnectionError: all workers are gone'"):
        fitted(logs, executor=Away())


# ----------------------------------------------------------------------------------------- accuracy

@pytest.mark.long
def test_what_is_not_integrated_does_not_ask_for_accuracy(logs, fit):
    check_same(fitted(logs, accuracy=1e-11), fit)


@pytest.fixture(scope="module")
def swinging():
    return some(load=PENDULUM, kind="angle", duration=1.0, motions=("step", "prbs"))


@pytest.mark.long
def test_fits_ask_for_a_tenth_of_a_microradian_unless_told(swinging):
    usual, said, fine = (fitted(swinging, WRONG, model=st.BoundedServo, free=["output_inertia"], nuisance=(), **more)
                         for more in ({}, {"accuracy": 1e-7}, {"accuracy": 1e-11}))
    check_same(usual, said)
    low, high, _ = fine.intervals()["output_inertia"]
    assert 0.0 < abs(usual.estimates["output_inertia"] - fine.estimates["output_inertia"]) < 1e-3 * (high - low)


def test_simulations_are_as_close_as_asked(swinging):
    model = st.BoundedServo(WRONG)
    space = Space(model, ["output_inertia"])

    def residual(accuracy):
        f = Forecast(swinging, model, space, (), ["output_angle"], Running(accuracy=accuracy))
        return np.concatenate([part.residual for part in f.at(Point(space.start, ((), ())), derivatives=False)])

    exact = residual(1e-12)
    off = [float(np.abs(residual(accuracy) - exact).max()) for accuracy in (1e-4, 1e-7, 1e-10)]
    assert off[0] > 10.0 * off[1] > 100.0 * off[2]
    assert all(error < accuracy for error, accuracy in zip(off, (1e-4, 1e-7, 1e-10), strict=True))


@pytest.mark.long
@pytest.mark.parametrize("accuracy", [1e-7, 1e-10])
def test_what_pendulum_logs_leave_open_is_told_alike_at_any_accuracy(swinging, accuracy):
    free = ["output_torque_constant", "output_inertia", "output_coulomb_torque", "gear.gear_reduction"]
    fit = fitted(swinging, WRONG, model=st.BoundedServo, free=free, nuisance=(), accuracy=accuracy)
    assert {name for one in fit.unidentifiable for name in one.parameters} == {"gear.gear_reduction"}
