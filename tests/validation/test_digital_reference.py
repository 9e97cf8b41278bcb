"""Random digital servos, every option alone and mixed, against a reference written from the specification alone.

`python -m validation.test_digital_reference 200`, in tests/, prints the largest deviations of so many servos.
"""

import sys

import numpy as np
import pytest

import plain_run
import servotwin as st
from reference import digital
from servotwin.errors import CommandError

from .digital_servos import case_of, command_of, load_of, model_of

pytestmark = pytest.mark.slow

BLOCK = 8
BOUNDS = {True: 1e-11, False: 1e-9}  # rad, of linear plants and of others
TIE = 1e-9  # counts: so near to a change of its count an angle may be counted otherwise


def deviations(seed, linear, lanes=False, plain=False):
    """Return by how much angles [rad] and duties of a servo differ, and by how much a batch of it; None: refused."""
    case, record = case_of(seed, linear)
    model, load, command = model_of(case), load_of(case, record), command_of(case)
    times = (np.arange(1, 60) / 60.0 + 3e-4) * 0.99 * case.duration
    asked = {"duration": case.duration, "load": load, "output_times": times, "accuracy": 1e-12}
    try:
        result = st.simulate(model, command, initial={"output_angle": 0.0}, **asked).raise_if_failed()
    except CommandError:  # goals that servotwin refuses and a servo clips
        return None
    if plain:
        again = plain_run.simulate(model, command, initial={"output_angle": 0.0}, **asked).raise_if_failed()
        plain_run.is_the_same(result, again)
    trace = digital.run(case.values, case.command, case.load, case.duration, times)
    angle = np.abs(result["output_angle"] - trace.output_angle).max()
    period = case.values["firmware"]["control_period"]
    delay, phase = (case.values["firmware"].get(name, 0.0) for name in ("compute_delay", "control_phase"))
    since = (times - phase - delay) / period  # in ticks, since the first duty
    known = (since >= 0.0) & (np.abs(since - np.round(since)) > 1e-6)
    wanted = np.nan_to_num(trace.duty[np.floor(since[known]).astype(int)], nan=0.0)
    duty = np.abs(result["duty"][known] - wanted).max(initial=0.0)
    batch = 0.0
    if lanes:
        names = ("output_angle", "duty", "goal_angle", "reference_angle", "armature_current", "bus_voltage")
        batch = st.simulate_many(model, command, initial={"output_angle": 0.0}, outputs=names, **asked)
        batch = max(np.abs(batch[name][0] - result[name]).max() for name in names)
    return angle, duty, batch, trace.least_tie


@pytest.mark.parametrize("linear", [True, False], ids=["linear", "general"])
@pytest.mark.parametrize("first", range(0, 40, BLOCK))
def test_angles_and_duties_are_those_of_the_reference(first, linear):
    compared = 0
    for seed in range(first, first + BLOCK):
        found = deviations(seed, linear, lanes=True, plain=seed == first)
        if found is None or found[-1] < TIE:
            continue
        angle, duty, batch, _ = found
        assert angle <= BOUNDS[linear], seed
        assert duty <= 1e-6, seed
        assert batch <= 1e-8, seed
        compared += 1
    assert compared >= BLOCK // 2


if __name__ == "__main__":
    for linear in (True, False):
        runs = [run for seed in range(int(sys.argv[1])) if (run := deviations(seed, linear)) is not None]
        good = np.array([run for run in runs if run[-1] >= TIE])
        sys.stdout.write(f"{'linear' if linear else 'general'}: {len(good)} servos, {len(runs) - len(good)} ties; "
                         f"angles within {good[:, 0].max():.1e} rad, duties within {good[:, 1].max():.1e}\n")
