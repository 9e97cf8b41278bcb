"""Describing functions beside simulated sines: frames make a servo later than the mean of its voltage."""

import math
import warnings

import numpy as np
import pytest

import servotwin as st
from servotwin.linear.overview import overview


@pytest.mark.long
@pytest.mark.parametrize("name", ["hitec-hs-422", "towerpro-sg90", "hitec-hs-755hb"])
def test_describing_functions_have_the_delay_of_the_frames(name):
    """From half of the bandwidth on phases agree within 25 degrees; without that delay they differ by 24 to 52."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = overview(st.PulseServo(st.load_servo(name)), amplitudes=[math.radians(10.0)])
    (sines,) = found.sines
    near = found.frequency > 0.5 * sines.bandwidth
    assert near.sum() >= 4
    off = np.angle(sines.described[near] / found.simulated.response[0][near])
    assert np.abs(np.degrees(off)).max() < 25.0
    frames = np.exp(1j * found.frequency[near] * 0.01)
    without = np.angle(sines.described[near] * frames / found.simulated.response[0][near])
    assert np.abs(without).max() > np.abs(off).max()
