"""The duty that an XL330 logs of itself is that of its registers: P of the error in counts, cut to steps, clipped."""

import json

import numpy as np
import pytest

import servotwin as st
from servotwin import physics

COUNT, FULL = 2.0 * np.pi / 4096.0, 885
READ_LATER = 2.1e-3  # s: the angle is read before the load of the same row
BOUNDS = {100: 1.5, 200: 1.5, 800: 5.0}  # counts of the PWM, rms


@pytest.mark.parametrize("gain", BOUNDS)
def test_the_logged_duty_follows_from_the_logged_error(data_folder, gain):
    found = []
    for path in sorted((data_folder / "bam_xl330" / "raw").glob("*.json")):
        log = json.loads(path.read_text(encoding="utf-8"))
        if log["kp"] != gain:
            continue
        firmware = st.dynamixel_x({"Position_P_Gain": gain}, servo="dynamixel-xl330-m288").firmware
        time, angle, goal, load, torque = (np.array([row[name] for row in log["entries"]], dtype=float) for name in (
            "timestamp", "position", "goal_position", "load", "torque_enable"))
        load = np.where(load > 32767.0, load - 65536.0, load)
        error = COUNT * (np.round(goal / COUNT) - np.round(np.interp(time + READ_LATER, time, angle) / COUNT))
        duty = physics.duty_of(firmware.proportional_gain, error, firmware.duty_quantum)
        counts = FULL * np.clip(duty, -firmware.duty_limit, firmware.duty_limit)
        on = (torque[:-1] > 0.0) & (torque[1:] > 0.0)
        on[0] = False  # nothing was read before the first row
        found.append(np.sqrt(np.mean((counts - load)[:-1][on] ** 2)))
    assert len(found) == 4
    assert max(found) <= BOUNDS[gain]
    assert min(found) > 0.1  # it is measured
