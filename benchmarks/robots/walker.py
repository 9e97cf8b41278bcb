"""Fourteen STS3215 in a robot: what its servos cost beside `mj_step`, on a supply each, and on one battery."""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import arms

import servotwin as st

JOINTS, DT, STEPS, REPEATS = 14, 2e-3, 500, 3
BATTERY = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.05)
NAMES = [f"j{k}" for k in range(JOINTS)]


def servos(unlike: bool = False) -> dict[str, st.DigitalServo]:
    """Return the servos by joint, with programs whose ticks come together or, `unlike`, each at a time of its own."""
    servo = st.load_servo("feetech-sts3215-12v")
    phases = np.arange(JOINTS) / JOINTS if unlike else np.zeros(JOINTS)
    return {name: st.DigitalServo(servo.replace({"firmware.control_phase": float(1e-3 * phase)}))
            for name, phase in zip(NAMES, phases, strict=True)}


def policy(drive: st.robots.ServoDrive, data: mujoco.MjData) -> Callable[[int], None]:
    """Return a step of a robot whose policy tells all joints new goals every 20 ms."""
    rng = np.random.default_rng(0)

    def step(k: int) -> None:
        if k % 10 == 0:
            drive.command(data, dict(zip(NAMES, 0.3 * rng.normal(size=JOINTS), strict=True)))
        drive.step(data)
    return step


def standing(drive: st.robots.ServoDrive, data: mujoco.MjData) -> Callable[[int], None]:
    """Return a step of a robot that holds still."""
    drive.command(data, dict.fromkeys(NAMES, 0.2))
    return lambda k: drive.step(data)


def timed(step: Callable[[int], None]) -> float:
    """Return the CPU time of a step, the least of some runs [s]."""
    found = []
    for _ in range(REPEATS):
        start = time.thread_time()
        for k in range(STEPS):
            step(k)
        found.append((time.thread_time() - start) / STEPS)
    return min(found)


def table() -> None:
    """Print what a step of 2 ms costs, beside one without servos."""
    xml = arms.chains(JOINTS, DT)
    plain = mujoco.MjModel.from_xml_string(xml)
    own = mujoco.MjData(plain)
    alone = timed(lambda k: mujoco.mj_step(plain, own))
    print(f"{JOINTS} STS3215 in a step of {1e3 * DT:g} ms; mj_step alone {1e6 * alone:.1f} us of CPU")
    print(f"{'':26}{'policy [us]':>14}{'standing [us]':>16}")
    for warm in (False, True):
        for name, bus, unlike in (("a supply each", None, False), ("one battery", BATTERY, False),
                                  ("one battery, unlike", BATTERY, True)):
            row = []
            for move in (policy, standing):
                drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), servos(unlike), bus=bus,
                                             assume_heat=warm)
                row.append(timed(move(drive, mujoco.MjData(drive.model))) - alone)
            print(f"{name + (', warm' if warm else ''):26}{1e6 * row[0]:14.1f}{1e6 * row[1]:16.1f}", flush=True)


if __name__ == "__main__":
    table()
