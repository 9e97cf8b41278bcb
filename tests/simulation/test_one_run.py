"""One loop with one log: compiled and plain it is the same run, and how its log is cut shows in nothing."""

import signal
import time
from contextlib import nullcontext

import numpy as np
import pytest

import kept_runs
import plain_run
import servotwin as st
from servotwin.simulation import engine, trajectory

CASES = kept_runs.every()
NAMES = [name for name in CASES if name.startswith(("generated", "digital"))]
FEW = NAMES[::12]


def run(one):
    return st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                       seed=one.seed, output_times=np.linspace(0.0, one.duration, 30))


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name in FEW else pytest.mark.long) for name in NAMES[::2]])
def test_plain_text_is_the_compiled_run(name):
    one = CASES[name]
    plain_run.is_the_same(run(one), plain_run.simulate(
        one.model, one.command, duration=one.duration, load=one.load, initial=one.initial, seed=one.seed,
        output_times=np.linspace(0.0, one.duration, 30)), 1e-9)


@pytest.mark.parametrize("plainly", [False, True])
@pytest.mark.parametrize("name", FEW[::3])
def test_how_often_a_log_is_read_shows_in_nothing(monkeypatch, name, plainly):
    one, runs = CASES[name], []
    for rows, steps in ((engine.ROOM, engine.STEPS), (7, engine.STEPS), (engine.ROOM, 3)):
        monkeypatch.setattr(engine, "ROOM", rows)
        monkeypatch.setattr(engine, "STEPS", steps)
        with plain_run.plain() if plainly else nullcontext():
            result = run(one)
            runs.append(({signal: result[signal].tobytes() for signal in result.names}, result.events, result.stats,
                         kept_runs.pieces(one).tobytes()))
    assert runs[0] == runs[1] == runs[2]


def test_a_long_run_is_interrupted_at_once():
    model, begun = st.PulseServo(st.load_servo("hitec-hs-755hb")), time.monotonic()

    def stop(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        with pytest.raises(KeyboardInterrupt):
            st.Simulator(model).advance(st.Simulator(model).initial(swing := st.signals.sine(
                mean=0.8, amplitude=0.3, frequency=2.0, unit="rad")), 1e6, swing)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - begun < 10.0


def test_progress_is_told_of_a_compiled_run():
    told = []
    st.simulate(st.PulseServo(st.load_servo("hitec-hs-755hb")), st.signals.sine(
        mean=0.8, amplitude=0.3, frequency=2.0, unit="rad"), duration=60.0, output_times=[60.0],
        progress=lambda done, whole: told.append(done / whole))
    assert len(told) > 1
    assert told[-1] == 1.0


def test_without_a_library_nobody_waits_for_it(monkeypatch):
    """The plain text runs while another process makes the kernels, which are taken once they are there."""
    made, there = [], []
    monkeypatch.setattr(engine, "_beside", {})
    monkeypatch.setattr(engine, "_LOOKS", 0.0)
    monkeypatch.setattr(engine, "is_compiled", lambda recipe: bool(there))
    monkeypatch.setattr(engine, "_make_beside", made.append)
    one = CASES[FEW[0]]
    plain = run(one)
    assert made == [engine.ONE]
    assert isinstance(plain.trajectory.segments._parts[0].rows, list)
    there.append(1)
    compiled = run(one)
    assert made == [engine.ONE]
    assert isinstance(compiled.trajectory.segments._parts[0].rows, np.ndarray)
    plain_run.is_the_same(compiled, plain)


def test_rows_of_a_plain_run_are_read_by_kernels_and_the_other_way_round():
    one = CASES[FEW[1]]
    with plain_run.plain():
        plain = st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                            seed=one.seed)
    compiled = st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                           seed=one.seed)
    read = plain["output_speed"]
    with plain_run.plain():
        np.testing.assert_allclose(compiled["output_speed"], read, rtol=1e-12, atol=1e-12)
    assert trajectory.kernels_of_one() is not None
