"""Part 6: bus servos with play and load friction on shared supplies, and how exact they are; warm ones beside.

A row is so many STS3215 on each of some supplies of 0.3 Ω, with goals that are new every 20 ms, and loads and torques
of their own; ticks come together, or each servo's at a time of its own. Times are of the CPU and of one thread, in
calls of 20 ms. Errors are the largest differences from `simulate_bus`, and of one alone from `simulate` at 1e-13 rad.
"""

import time
from typing import Any

import numpy as np

import servotwin as st
from servotwin.robots.servos.mount import with_heat

SERVO = st.load_servo("feetech-sts3215-12v").replace({"supply.internal_resistance": 0.3})
SUPPLY = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.3)
EVERY, CALLS, LANES, CHECKED = 0.02, 25, 84, 0.2  # s, of a run, about, s
ACCURACY = 1e-13


def draws(count: int, unlike: bool, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return what differs among servos, and goals, a row a call."""
    rng = np.random.default_rng(seed)
    found = {"load.inertia": rng.uniform(1e-3, 1e-2, count), "load.torque": rng.uniform(-0.3, 0.3, count)}
    if unlike:
        found["firmware.control_phase"] = 1e-3 * (np.arange(count) % 14) / 14
    return found, 0.4 * rng.normal(size=(CALLS, count))


def simulator(model: st.DigitalServo, count: int, own: dict[str, np.ndarray], each: int) -> st.VectorSimulator:
    """Return servos at their start, so many on each supply; 0: each with one of its own."""
    buses = [(SUPPLY, range(k, k + each)) for k in range(0, count, each)] if each else None
    sims = st.VectorSimulator(model, count, load=st.loads.Inertia(1e-3) + st.loads.Constant(0.0), parameters=own,
                              bus=buses, threads=1)
    sims.reset(command_angle=np.zeros(count))
    return sims


def cost(model: st.DigitalServo, each: int, unlike: bool) -> float:
    """Return the time of a millisecond of a servo [s]."""
    count = LANES // each * each if each else LANES
    own, goals = draws(count, unlike)
    found = []
    for _ in range(3):
        sims, taken = simulator(model, count, own, each), 0.0
        for row in goals:
            start = time.thread_time()
            sims.advance(EVERY, command_angle=row)
            taken += time.thread_time() - start
        found.append(taken)
    return min(found) / (count * 1e3 * EVERY * CALLS)


def error(model: st.DigitalServo, each: int, unlike: bool) -> float:
    """Return how far angles are off, of one bus or one lane [rad]."""
    count = each or 1
    own, goals = draws(count, unlike)
    calls = round(CHECKED / EVERY)
    sims, seen = simulator(model, count, own, each), np.empty((calls, count))
    for k in range(calls):
        sims.advance(EVERY, command_angle=goals[k])
        seen[k] = sims["output_angle"]
    at = EVERY * np.arange(calls)
    servos: dict[str, Any] = {}
    for k in range(count):
        phase = {"firmware.control_phase": float(own["firmware.control_phase"][k])} if unlike else {}
        told = st.signals.samples(np.concatenate([[-EVERY], at]), np.concatenate([[0.0], goals[:calls, k]]), unit="rad",
                                  hold="previous")
        load = st.loads.Inertia(own["load.inertia"][k]) + st.loads.Constant(own["load.torque"][k])
        servos[f"servo {k}"] = (type(model)(model.servo.replace(phase)), told, load)
    times = EVERY * np.arange(1, calls + 1)
    if each:
        fleet = st.simulate_bus(servos, supply=SUPPLY, duration=CHECKED, output_times=times)
        there = np.column_stack([fleet[name]["output_angle"] for name in servos])
    else:
        there = st.simulate(*servos["servo 0"][:2], load=servos["servo 0"][2], duration=CHECKED, output_times=times,
                            accuracy=ACCURACY)["output_angle"][:, None]
    return float(np.abs(seen - there).max())


def main() -> dict[str, float]:
    print(f"{'STS3215 12 V on a supply':30} {'us/lane-ms':>10} {'warm':>8} {'error [rad]':>12} {'warm':>8}")
    cold = st.DigitalServo(SERVO)
    for each, unlike in ((0, False), (2, False), (6, False), (14, False), (6, True), (14, True)):
        name = f"{each or 1}{', each at a time of its own' if unlike else ''}"
        own = [cost(model, each, unlike) for model in (cold, with_heat(cold))]
        off = [error(model, each, unlike) for model in (cold, with_heat(cold))]
        print(f"{name:30} {1e6 * own[0]:10.3f} {1e6 * own[1]:8.3f} {off[0]:12.1e} {off[1]:8.1e}", flush=True)
    return {}


if __name__ == "__main__":
    main()
