"""Fits that are stopped at any time, by a signal or by the clock: the best so far is kept, what is unknown is said."""

import os
import signal
import threading
import time as clock

import numpy as np
import pytest

import servotwin as st
from identification.fits import fitted
from servotwin.errors import InputError
from servotwin.identification.fitting.search.stopping import Course, Within


def test_the_time_that_a_fit_may_take_stops_it(logs):
    began = clock.monotonic()
    found = fitted(logs, within=0.3, starts=6, seed=3)
    assert clock.monotonic() - began < 3.0
    assert found.interrupted
    assert any(each.startswith("intervals") for each in found.unknown)
    assert found.warnings[0].startswith("stopped: the best so far; not known are ")
    assert found.servo.fit["unknown"] == list(found.unknown)
    assert np.isfinite(found.training.total()["PulseServo"])


def test_a_fit_that_has_time_is_the_same(logs):
    short, free = fitted(logs, within=600.0, intervals=False), fitted(logs, intervals=False)
    assert short.estimates == free.estimates
    assert short.unknown == ()


@pytest.mark.parametrize("within", [0.0, -1.0, "soon", float("inf"), True])
def test_a_time_has_to_be_one(logs, within):
    with pytest.raises(InputError, match="within"):
        fitted(logs, within=within)


@pytest.mark.long(but="all logs-what is left")
@pytest.mark.parametrize(("at", "unknown"), [("6 starts", "what is left"), ("all logs", "what is left"),
                                             ("intervals", "intervals"), ("errors", "what may be the matter")])
def test_ctrl_c_at_any_time_keeps_the_best_so_far(logs, at, unknown):
    """The signal is noted, and the fit ends at the next simulation."""
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals go to the main thread")
    before, sent = signal.getsignal(signal.SIGINT), []

    def tell(share, text):
        if text.startswith(at) and not sent:
            sent.append(text)
            os.kill(os.getpid(), signal.SIGINT)

    found = fitted(logs, starts=6, seed=3, intervals=True, progress=tell)
    assert sent
    assert found.interrupted
    assert any(each.startswith(unknown) for each in found.unknown)
    assert found.traces
    assert (found.verdict is None) == (unknown == "what is left")
    assert signal.getsignal(signal.SIGINT) is before


def test_what_is_left_rises_by_itself_by_no_more_than_a_tenth():
    """A search that goes on and on is said to take longer; the share that is done never falls."""
    time, told = [0.0], []
    course = Course(Within(), beside=2)
    course.clock, course._since = lambda: time[0], 0.0
    course.show = lambda share, text: told.append((time[0], share, text))
    for now, share, text in ((0.1, 0.0, "3 starts"), (0.5, 0.1, "3 starts"), (2.0, 0.42, "all logs"),
                             *((float(now), 0.42, "all logs") for now in range(3, 200)), (200.0, 0.76, "intervals"),
                             (205.0, 0.95, "errors"), (206.0, 0.96, "trying"), (220.0, 0.98, "trying")):
        time[0] = now
        course(share, text)
    shares = [share for _, share, _ in told]
    assert shares == sorted(shares)
    left = [now * (1.0 - share) / share for now, share, _ in told if now > 1.0]
    assert all(value <= 1.1 * min(left[:k + 1]) + 1e-9 for k, value in enumerate(left))
    assert told[10][2] == "all logs"
    assert told[150][2] == "all logs, longer than usual"


@pytest.mark.long
def test_a_fit_that_is_stopped_has_wider_intervals(logs):
    """They are those of the problem made straight at the best so far."""
    def tell(share, text):
        if text.startswith("all logs"):
            raise KeyboardInterrupt

    whole, short = (fitted(logs, starts=3, seed=3, intervals=True, progress=progress) for progress in (False, tell))
    assert short.interrupted
    for name, (lower, upper, method) in short.intervals().items():
        begin, end, _ = whole.intervals()[name]
        if method in ("linearised", "by pulses"):
            assert upper - lower > end - begin
    assert "linearised" in {method for _, _, method in short.intervals().values()}


def test_a_ladder_has_one_time_for_all(logs):
    began = clock.monotonic()
    found = st.friction_ladder(logs, st.load_servo("hitec-hs-755hb"), free=["output_inertia"], rungs=("M1", "M3"),
                               within=0.5, starts=2)
    assert clock.monotonic() - began < 5.0
    assert found.rungs[-1].fit.interrupted


def test_a_stopped_fit_says_what_it_has_left_open(logs):
    def tell(share, text):
        if text.startswith("all logs"):
            raise KeyboardInterrupt

    found = fitted(logs[:1], starts=2, seed=3, intervals=True, progress=tell)
    methods = {method for _, _, method in found.intervals().values()}
    assert methods <= {"linearised", "by pulses", "at bound", "not determined yet", "not sought"}
    assert ("linearised" in methods) == any(each.startswith("intervals (") for each in found.unknown)
