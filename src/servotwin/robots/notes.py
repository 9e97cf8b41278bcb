"""What is odd about a motion: goals out of reach, collisions, and joints that do not come to rest after it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from servotwin.robots.model_file import joint_ranges
from servotwin.simulation.remarks import NOT_AT_REST, floor_of, held_back, watches_its_supply

if TYPE_CHECKING:
    from servotwin.parameters.groups import Supply
    from servotwin.robots.run import RobotRun
    from servotwin.simulation.remarks import Sag

_SLACK = math.radians(0.5)  # rad, of ends that goals are rounded to


def notes_of(run: RobotRun) -> tuple[str, ...]:
    """Return sentences on what was assumed of servos, goals out of reach, collisions, energies, and joints that swing.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots import Motion, run_motion
    >>> high = Motion(time=[0.0, 0.5], angles={"gripper": [1.5, 2.0]}, source="too far")
    >>> run = run_motion("so101", {"gripper": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, high, settle=0.0)
    >>> notes_of(run)
    ('goals of joint gripper go from 85.9 to 115 deg, beyond its range in the model, -10 to 100 deg',)
    """
    said = list(run.said)
    ranges = joint_ranges(run.model)
    for joint in run.motion.joints:
        goals, mount, servo = run.motion.angles[joint], run.mounts[joint], run.mounts[joint].model.servo
        if mount.model.endless:  # such as a bridge without its chip, whose goals are duties
            continue
        lows = [x for x in (servo.stops.lower_angle, servo.firmware.lower_goal) if x is not None]
        highs = [x for x in (servo.stops.upper_angle, servo.firmware.upper_goal) if x is not None]
        angles, ends = (goals - mount.zero) / mount.gain, (max(lows, default=-math.inf), min(highs, default=math.inf))
        if _beyond(angles, ends, _SLACK):
            said.append(f"goals of joint {joint} go {_between(angles, slides=False)} at the servo, beyond "
                        f"what it takes, {_ends(*ends, slides=False)}")
        slides = run.slides(joint)
        if joint in ranges and _beyond(goals, ranges[joint], _SLACK * (mount.ratio if slides else 1.0)):
            said.append(f"goals of joint {joint} go {_between(goals, slides=slides)}, beyond its range in the model, "
                        f"{_ends(*ranges[joint], slides=slides)}")
    said += [words for joints, supply, sag in run.sags for words in _sag_words(run, joints, supply, sag)]
    swings = (f"joint {joint} {remark.words}" for joint in run.mounts for remark in run.tracking[joint].remarks
              if remark.kind == NOT_AT_REST)
    return (*said, *(touch.words for touch in run.ideal.touches), *run.record.notes, *swings)


def _sag_words(run: RobotRun, joints: tuple[str, ...], supply: Supply, sag: Sag) -> list[str]:
    """Return that a supply holds servos back, and that it falls below what anybody knows of them."""
    who = "the supply" if len(joints) == len(run.mounts) else f"the supply of {', '.join(joints)}"
    said = [f"{who} holds back: {held_back(sag).words.partition(': ')[2]}, at {sag.time:.2f} s, of "
            f"{supply.open_circuit_voltage:g} V"] if sag.holds_back else []
    below = {joint: floor_of(run.mounts[joint].model.servo).voltage for joint in joints
             if not watches_its_supply(run.mounts[joint].model)}
    low = [joint for joint, floor in below.items() if sag.voltage < floor]
    if low:
        said.append(f"{who} falls to {sag.voltage:.2f} V: below {below[low[0]]:g} V nobody knows what the servo of "
                    f"{low[0]} does" + (f", and {len(low) - 1} more" if len(low) > 1 else ""))
    return said


def _beyond(values: np.ndarray[tuple[int], np.dtype[np.float64]], ends: tuple[float, float], slack: float) -> bool:
    return bool(values.min() < ends[0] - slack or values.max() > ends[1] + slack)


def _between(values: np.ndarray[tuple[int], np.dtype[np.float64]], *, slides: bool) -> str:
    return f"from {_ends(float(values.min()), float(values.max()), slides=slides)}"


def _ends(low: float, high: float, *, slides: bool) -> str:
    factor, unit = (1e3, "mm") if slides else (math.degrees(1.0), "deg")
    return f"{factor * low:.3g} to {factor * high:.3g} {unit}"
