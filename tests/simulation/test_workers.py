"""Pieces of work: done in order by anybody, done again where a worker is lost, given up where the work itself kills."""

import multiprocessing
import os
import signal
from collections import Counter
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import pytest

from servotwin.errors import InputError, ParameterError
from servotwin.simulation.progress import Crew, Here

SPAWN = multiprocessing.get_context("spawn")


def square(number):
    return number * number


def killed_once(path, number):
    """Return the square; the first worker that comes here dies of it."""
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return number * number
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def deadly(number):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def refused(number):
    raise ParameterError("motor.armature_resistance", got=number, allowed="a positive number")


class Backwards:
    """An executor that does what waits only when one is asked for, the last first."""

    def __init__(self):
        self.waiting = []

    def submit(self, work, *arguments):
        self.waiting.append(Waits(self, work, arguments))
        return self.waiting[-1]


class Forgetful(Here):
    """An executor that loses what came of each piece as often as is said, as a cluster does whose worker is killed."""

    def __init__(self, times):
        self.times, self.lost = times, Counter()

    def submit(self, work, *arguments):
        future = super().submit(work, *arguments)
        self.lost[arguments] += 1
        if self.lost[arguments] <= self.times:
            future = Future()
            future.set_exception(ValueError("too many values to unpack (expected 3)"))
        return future


class Waits:
    def __init__(self, owner, work, arguments):
        self.owner, self.work, self.arguments = owner, work, arguments

    def result(self):
        while self.owner.waiting:
            one = self.owner.waiting.pop()
            one.found = one.work(*one.arguments)
        return self.found

    def cancel(self):
        return True


@pytest.mark.parametrize("executor", [None, Here(), ThreadPoolExecutor(3), Backwards()],
                         ids=["own threads", "here", "threads", "backwards"])
def test_results_come_in_the_order_of_the_pieces(executor):
    with Crew(executor) as crew:
        assert list(crew.done(square, ((k,) for k in range(200)))) == [k * k for k in range(200)]
        assert crew.is_here == (executor is None)


def test_no_more_is_handed_in_than_is_done_soon():
    taken = []
    with Crew(Here()) as crew:
        running = crew.done(square, ((taken.append(k) or k,) for k in range(100)))
        assert next(running) == 0
        assert taken == [0, 1]
        running.close()
    assert taken == [0, 1]


@pytest.mark.long
def test_a_killed_worker_of_a_pool_loses_nothing(tmp_path):
    with ProcessPoolExecutor(2, mp_context=SPAWN) as pool, Crew(pool) as crew:
        pieces = [(str(tmp_path / "killed"), k) for k in range(20)]
        assert list(crew.done(killed_once, pieces)) == [k * k for k in range(20)]
        assert list(crew.done(square, [(7,)])) == [49]  # though the pool that was given does nothing more
    assert (tmp_path / "killed").exists()


@pytest.mark.long
def test_work_that_kills_every_worker_is_said():
    said = r"executor: got 'BrokenProcessPool: .*, allowed: one that finishes every job"
    with ProcessPoolExecutor(1, mp_context=SPAWN) as pool, Crew(pool) as crew, pytest.raises(InputError, match=said):
        list(crew.done(deadly, [(k,) for k in range(6)], finishing="job"))


@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor(1)], ids=["own threads", "threads"])
def test_errors_of_the_work_pass_through(executor):
    with Crew(executor) as crew, pytest.raises(ParameterError, match="armature_resistance"):
        list(crew.done(refused, [(1.0,)]))


@pytest.mark.parametrize("executor", [3, ThreadPoolExecutor, "threads"])
def test_what_is_no_executor_is_refused(executor):
    with pytest.raises(InputError, match="one with a submit method"):
        Crew(executor)


@pytest.mark.parametrize("times", [1, 3, 4])
def test_what_an_executor_loses_is_done_again(times):
    with Crew(Forgetful(times)) as crew:
        if times < 4:
            assert list(crew.done(square, [(2,), (3,)])) == [4, 9]
        else:
            with pytest.raises(InputError, match="too many values"):
                list(crew.done(square, [(2,), (3,)]))
