"""Lanes of several logs go into few calls, shared out to all workers, and no lane feels its neighbours."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import PENDULUM, TRUTH, run
from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import DELAY_SCALE, Point
from servotwin.identification.fitting.search.forecast import Bundle, Forecast, Running, batches
from servotwin.identification.fitting.search.free import Space
from servotwin.simulation.progress import Crew

FREE = ("output_inertia", "electronics.stretcher_gain")
FAST, SLOW = 1e-5, 1e-2  # s that a second of a lane takes: of closed form, and of what is integrated in every frame


def bundle(lanes=8, duration=2.0, step=0.02):
    signal = st.signals.constant(1.0, unit="rad")
    return Bundle(np.arange(0.0, duration, step), duration, st.loads.Load(), [signal] * lanes, {}, {})


def crew(workers=2):
    return Crew(ThreadPoolExecutor(workers))


@pytest.mark.parametrize(("bundles", "pace", "calls"), [
    ([bundle() for _ in range(10)], FAST, 1),
    ([bundle(step=0.02 + 1e-4 * k) for k in range(5)], FAST, 1),  # other times, which cost less than another call
    ([bundle(duration=1.0 + 0.1 * k) for k in range(5)], FAST, 1),
    ([bundle(duration=1.0 + 0.1 * k) for k in range(5)], SLOW, 5),  # nobody waits for the longest
    ([bundle(lanes=1, step=0.02 + 1e-4 * k) for k in range(4)], SLOW, 2),
    ([bundle() for _ in range(100)], SLOW, 4),  # two for each worker
    ([bundle(lanes=1)], SLOW, 1),
    ([], FAST, 0),
])
def test_as_few_calls_as_keep_all_busy(bundles, pace, calls):
    found = batches(bundles, pace, crew())
    assert sorted(k for call in found for k in call) == list(range(len(bundles)))
    assert len(found) == calls
    costs = [sum(bundles[k].cost for k in call) for call in found]
    assert costs == sorted(costs, reverse=True)


def test_more_workers_get_more_calls():
    bundles = [bundle() for _ in range(100)]
    assert [len(batches(bundles, SLOW, crew(n))) for n in (1, 2, 5)] == [2, 4, 10]


@pytest.fixture(scope="module")
def logs():
    """Logs of other times, durations, loads and parameters, and one that is sampled twice as often."""
    return [run(TRUTH, "prbs", duration=0.6, kind="pulse_width", load=None, name="short"),
            run(TRUTH, "step", duration=1.1, sample=0.013, kind="pulse_width", load=None, name="long"),
            run(TRUTH, "step", duration=0.9, sample=0.01, kind="pulse_width", load=PENDULUM, name="swinging"),
            run(TRUTH, "step", duration=0.7, kind="angle", load=None, name="at 5 V",
                parameters={"supply.open_circuit_voltage": 5.0})]


def forecast(logs, executor=None):
    model = st.PulseServo(TRUTH)
    return Forecast(logs, model, Space(model, FREE), ("delay", "initial_state"), ["output_angle"],
                    Running(Crew(executor)))


def points(f):
    return [Point(np.append(f.space.start + shift, delay / DELAY_SCALE), tuple(f.own_start(case) for case in f.cases))
            for shift, delay in ((0.0, 0.02), (0.1, 0.035))]


class Counting(ThreadPoolExecutor):
    calls = 0

    def submit(self, work, *arguments):
        self.calls += 1
        return super().submit(work, *arguments)


def test_no_lane_feels_its_neighbours(logs):
    f = forecast(logs)
    together = f.at_all(points(f), derivatives=[True, False])
    for k, log in enumerate(logs):
        g = forecast([log])
        for at, (one, sloped) in enumerate(zip(points(g), (True, False), strict=True)):
            alone = g.at(one, derivatives=sloped)[0]
            for a, b in zip(together[at][k], alone, strict=True):
                np.testing.assert_array_equal(a, b, err_msg=f"{log.name}, point {at}")


def test_a_point_may_have_noise_of_its_own(logs):
    f = forecast(logs[:1])
    one, other = points(f)
    found = f.at_all([one, other], noises=[{"output_angle": 1.0}, {"output_angle": 2.0}])
    np.testing.assert_array_equal(found[0][0].residual, f.at(one, derivatives=False)[0].residual)
    np.testing.assert_allclose(found[1][0].residual, 0.5 * f.at(other, derivatives=False)[0].residual, rtol=1e-12)


def test_logs_and_points_of_closed_form_are_one_call(logs):
    pool = Counting(2)
    f = forecast(logs[:2], pool)
    f.at_all(points(f), derivatives=True)
    assert pool.calls == 1


def test_what_no_servo_is_fails_alone(logs):
    """A search may go too far; the logs of that point and no others count as failed."""
    f = forecast(logs[:2])
    good, bad = points(f)
    bad = bad._replace(shared=bad.shared + np.array([-800.0, 0.0, 0.0]))  # an inertia of 0
    f.strict = False
    found = f.at_all([good, bad])
    assert all(np.isnan(part.residual).all() for part in found[1])
    for part, alone in zip(found[0], f.at(good, derivatives=False), strict=True):
        np.testing.assert_array_equal(part.residual, alone.residual)
    f.strict = True
    with pytest.raises(InputError):
        f.at_all([good, bad])


def test_what_logs_said_last_is_said_again(logs):
    """A search begins where another one ended: nothing is simulated anew there, but its work counts."""
    f = forecast(logs)
    point = points(f)[0]
    first, cost = f.at(point), f.work
    f._simulate = None
    for part, again in zip(first, f.at(point), strict=True):
        assert part is again
    assert f.work == 2.0 * cost
    f.noise = {name: 2.0 * value for name, value in f.noise.items()}
    with pytest.raises(TypeError):
        f.at(point)
