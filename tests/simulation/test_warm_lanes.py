"""Lanes that warm up, or whose current has inertia: as `simulate`, whoever their neighbours, in calls of any length."""

import signal

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.lanes import forms
from warm_cases import DURATION, Case, case

ACCURACY = 1e-9  # rad
TIMES = np.linspace(0.0, DURATION, 13)[1:] - 1e-5
SEEDS = {  # by the kernels that they take
    "by_strides": (9, 29, 49, 53, 15, 22, 33), "by_gaps": (3, 12, 31, 42),
    "by_coils": (2, 17, 19), "runs": (13, 25)}
BLOCK, BLOCKS = 25, 4
WORK = 20.0  # s of this process for one by `simulate`: of small bodies that heat fast it may take minutes

pytestmark = pytest.mark.filterwarnings("ignore::servotwin.errors.PlausibilityWarning")


def seen(one: Case) -> dict[str, float]:
    """Return the signals that are compared, and what each may be off."""
    warms = one.model.servo.get("thermal.winding_capacity") is not None
    return {"output_angle": ACCURACY, "output_speed": 1e-6, "drive": 0.0} | (
        {"winding_temperature": 1e-6} if warms else {})


class SlowError(Exception):
    """A run that takes plain Python too long."""


def alone(one: Case, lane: int) -> st.Result | None:
    """Return a run of one lane by `simulate`; none where it takes too long."""
    def stop(*_: object) -> None:
        raise SlowError

    model, load = one.alone(lane)
    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, WORK)
    try:
        return st.simulate(model, one.command, duration=DURATION, load=load, output_times=TIMES, initial=one.initial,
                           seed=3)
    except SlowError:
        return None
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def many(one: Case, which: slice = slice(None), accuracy: float = ACCURACY) -> st.Batch:
    """Return a run of some lanes."""
    return st.simulate_many(
        one.model, one.command, duration=DURATION, load=one.load, output_times=TIMES, initial=one.initial, seeds=3,
        accuracy=accuracy, outputs=tuple(seen(one)),
        parameters={name: values[which] for name, values in one.parameters.items()})


def kernels_of(one: Case) -> str:
    """Return the name of the kernels that a case takes."""
    model, load = one.alone(0)
    nobody = np.zeros(1, np.bool_)
    recorded = nobody | bool(load.recorded)
    (kind,) = forms.kinds_with(model.pack(load), model.chip(), 1, "float64", nobody, recorded, False)
    return kind.recipe.name


def compare(one: Case, seed: int, lanes: tuple[int, ...]) -> None:
    """Compare lanes with themselves beside others, and with `simulate`."""
    batch, some = many(one), many(one, slice(1, 3))
    for name in seen(one):
        np.testing.assert_array_equal(some[name], batch[name][1:3], err_msg=f"{seed} {one.said}")
    for lane in lanes:
        plain = alone(one, lane)
        if plain is None:  # then they are compared with themselves, held to a thousandth
            want = many(one, slice(lane, lane + 1), 1e-3 * ACCURACY)
            ok, found = want.status[0] == 0, {name: want[name][0] for name in seen(one)}
        else:
            ok, found = plain.status.ok, {name: plain[name] for name in seen(one)}
        assert ok == (batch.status[lane] == 0), seed
        for name, off in seen(one).items():
            np.testing.assert_allclose(batch[name][lane], found[name], rtol=0.0, atol=off, err_msg=f"{seed} {one.said}")


def stop_and_go(one: Case, seed: int) -> None:
    """Compare a tick of a millisecond with one of twenty, with pulses that change in each of the latter."""
    widths, found = np.random.default_rng(seed).uniform(1e-3, 2e-3, (6, 4)), []
    for tick, count in ((1e-3, 20), (20e-3, 1)):
        sims = st.VectorSimulator(one.model, 4, load=one.load, parameters=one.parameters, seed=3, threads=1)
        sims.reset(pulse_width=widths[0], output_angle=one.initial["output_angle"])
        for width in widths:
            for _ in range(count):
                sims.advance(tick, pulse_width=width)
        found.append(sims["output_angle"])
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=ACCURACY, err_msg=f"{seed} {one.said}")


@pytest.mark.long(but="by_strides-49")
@pytest.mark.parametrize(("kernels", "seed"), [(name, seed) for name, seeds in SEEDS.items() for seed in seeds])
def test_some_servos(kernels, seed):
    one = case(seed)
    assert kernels_of(one) == kernels
    compare(one, seed, (0,))
    stop_and_go(one, seed)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_many_servos(block):
    """Those that take the general kernels are `simulate` compiled: of them one in five is compared."""
    for seed in range(BLOCK * block, BLOCK * (block + 1)):
        one = case(seed)
        compare(one, seed, (0, 2) if kernels_of(one) != "runs" or seed % 5 == 0 else ())
        stop_and_go(one, seed)
