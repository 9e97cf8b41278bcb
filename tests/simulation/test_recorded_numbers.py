"""The compiled kernels give the numbers that they gave when these were recorded, all bits of them.

On a machine that rounds otherwise, for its C library or for the want of fused multiply-adds, numbers are compared to
1e-9, and to 1e-4 in float32; where a compiler may take a sum in any order, to 1e-12. The name of each test says which.
`recorded/record.py` says what is recorded, and when it may be written anew.
"""

import warnings

import pytest

from costs import BUDGETS
from simulation.recorded.machine import installed
from simulation.recorded.populations import JOINTS, SETS
from simulation.recorded.recipes import all_recipes
from simulation.recorded.record import differences, loaded, same_machine, tolerance_of, whole

TEXT, PLACES, VALUES = loaded()
EXACT = same_machine(TEXT)
ELSEWHERE = {"together"}  # compared with plain Python in tests/web/live/test_shared_supply.py
QUICK = set(BUDGETS["kernels"]["quick"])


def cases():
    """Return a case for each set, whose name says what is compared; those that need other kernels are long."""
    tolerances = {name: tolerance_of(name, one, EXACT) for name, one in TEXT["sets"].items()}
    return [pytest.param(name, tolerance, id=f"{name}: {f'to {tolerance:.0e}' if tolerance else 'all bits'}",
                         marks=() if set(TEXT["sets"][name]["recipes"]) <= QUICK else pytest.mark.long)
            for name, tolerance in tolerances.items()]


def test_all_sets_and_all_recipes_are_recorded():
    assert list(TEXT["sets"]) == list(SETS)
    assert {recipe for one in TEXT["sets"].values() for recipe in one["recipes"]} == all_recipes() - ELSEWHERE


@pytest.mark.parametrize(("name", "tolerance"), cases())
def test_kernels_give_what_was_recorded(name, tolerance):
    if name in JOINTS:
        pytest.importorskip("mujoco")
        if installed("mujoco") != TEXT["versions"]["mujoco"]:
            tolerance = max(tolerance, 1e-9)
    one = TEXT["sets"][name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of servos that cannot do what they are told
        found = SETS[name]()
    lines = list(differences(found, one, PLACES[name], VALUES[name], tolerance))
    assert not lines, "\n".join([f"{name}, {'all bits' if tolerance == 0.0 else f'to {tolerance:.0e}'}", *lines])
    assert tolerance > 0.0 or whole(found) == one["sha256"]
