"""The energy balance of the pulse-level servo, as a property over random servos, loads and commands."""

import numpy as np
import pytest

from reference.pulse_cases import random_pulse_case
from validation.test_pulse_reference import simulate

# Random commands may come after the end of a run, or go to and fro from one short frame to the next.
pytestmark = pytest.mark.filterwarnings("ignore:.*comes at", "ignore:.*faster than any servo")


@pytest.mark.long(but="1022")
@pytest.mark.parametrize("seed", range(1000, 1040))
def test_energy_balances(seed):
    case = random_pulse_case(seed)
    energy = simulate(case, np.array([case.duration])).energy
    turnover = abs(energy.supply) + energy.winding + energy.friction + abs(energy.load) + abs(energy.stored)
    assert abs(energy.residual) <= 1e-9 * max(turnover, 1e-6)
    assert min(energy.winding, energy.bridge, energy.brush) >= 0.0
    assert energy.friction >= -1e-15
    assert energy.stops >= -1e-15  # of rounding at a rest
