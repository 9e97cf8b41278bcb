"""Servos that stop and go on at every tick, beside MuJoCo's own step of a hinge; and whole calls of 4096 signals.

`run.py` does all parts; `run.py ticks`, `run.py between`, `run.py c` or `run.py calls` one of them. MuJoCo is the
peer; without it ratios are left out.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "pulse_servo"))
import from_c
import peer_mujoco
from common import best
from fleet import random_fleet

LANES, DURATION, THREADS = 4096, 2.0, 2
MODEL = st.PulseServo(st.load_servo("hitec-hs-755hb"))
WORN = {"regulator": {"supply.current_limit": 1.2}, "play": {"gear.backlash": 0.01, "gear.output_inertia": 5e-4},
        "load friction": {"friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1}}


def ticked(tick: Callable[[int], object], count: int) -> float:
    """Return the time of a tick, the best of several rows of them [s]."""
    place = [0]

    def run() -> None:
        for _ in range(count):
            place[0] += 1
            tick(place[0])
    run()
    return best(run, 7) / count


def lanes_tick(lanes: int, duration: float, dtype: str = "float64", torque: bool = False,
               changes: dict[str, float] | None = None) -> float:
    """Return the time of a tick of many servos that are sent to and fro [s]."""
    model = st.PulseServo(MODEL.servo.replace(changes)) if changes else MODEL
    sims = st.VectorSimulator(model, lanes, dtype=dtype, threads=THREADS)
    rng = np.random.default_rng(0)
    widths = [1.2e-3, 1.7e-3] if lanes == 1 else list(rng.uniform(1.1e-3, 1.9e-3, (2, lanes)))
    torques = rng.uniform(-0.1, 0.1, (7, lanes)) if torque else None
    turn = round(0.2 / duration)

    def tick(k: int) -> None:
        more = {} if torques is None else {"external_torque": torques[k % 7]}
        sims.advance(duration, pulse_width=widths[k // turn % 2], **more)
    return ticked(tick, 2000 if lanes == 1 else 300 if duration < 0.01 else 60)


def plain_tick() -> float:
    """Return the time of a tick of 1 ms of a plain `Simulator` [s]."""
    sim, commands = st.Simulator(MODEL), [st.signals.constant(w, unit="us") for w in (1200.0, 1700.0)]
    state = [sim.initial(commands[0])]

    def tick(k: int) -> None:
        state[0] = sim.advance(state[0], k * 1e-3, commands[k // 200 % 2])
    return ticked(tick, 1000)


def mujoco_tick() -> float | None:
    """Return the time of `mj_step` of 1 ms of one hinge with a position actuator [s]."""
    try:
        import mujoco
    except ImportError:
        print("MuJoCo: left out, because it is not installed")
        return None
    model = mujoco.MjModel.from_xml_string(peer_mujoco.HINGE)
    data = mujoco.MjData(model)

    def tick(k: int) -> None:
        data.ctrl[0] = 0.5 if k // 200 % 2 else 1.5
        mujoco.mj_step(model, data)
    return ticked(tick, 2000)


def ticks() -> None:
    """Print what a tick costs."""
    peer = mujoco_tick()
    print(f"{'a tick of':36} {'us':>9} {'us a lane':>10} {'mj_step over it':>16}")
    if peer is not None:
        print(f"{'mj_step, one hinge, 1 ms':36} {1e6 * peer:9.2f} {1e6 * peer:10.3f} {1.0:15.1f}x")
    table = [("Simulator.advance, 1 ms", 1, plain_tick()), ("one lane, 1 ms", 1, lanes_tick(1, 1e-3)),
             *((f"{LANES} lanes, {1e3 * dt:g} ms, {dtype}", LANES, lanes_tick(LANES, dt, dtype))
               for dtype in ("float64", "float32") for dt in (1e-3, 0.02)),
             (f"{LANES} lanes, 1 ms, new torques", LANES, lanes_tick(LANES, 1e-3, torque=True)),
             *((f"256 lanes, 1 ms, {name}", 256, lanes_tick(256, 1e-3, changes=changes))
               for name, changes in WORN.items())]
    for name, lanes, time in table:
        ratio = "" if peer is None else f"{peer * lanes / time:15.1f}x"
        print(f"{name:36} {1e6 * time:9.2f} {1e6 * time / lanes:10.4f} {ratio}")


def between() -> None:
    """Print what another simulator pays between two ticks: to impose numbers on all lanes, and to look at a signal."""
    peer = mujoco_tick()
    print(f"{'between two ticks':36} {'us':>9} {'us a lane':>10} {'mj_step over it':>16}")
    for lanes in (6, LANES):
        for name, model in (("plain", MODEL), ("play", st.PulseServo(MODEL.servo.replace(WORN["play"])))):
            sims = st.VectorSimulator(model, lanes, threads=THREADS)
            inertia, volts = np.full(lanes, 1e-3), np.full(lanes, 5.5)
            rows: dict[str, Callable[[int], object]] = {
                "load inertia": lambda k, s=sims, x=inertia: s.set(load_inertia=x),
                "speed": lambda k, s=sims, x=inertia: s.set(output_speed=x),
                "bus voltage": lambda k, s=sims, x=volts: s.set(bus_voltage=x),
                "speed, load torque": lambda k, s=sims, x=inertia: (s.set(output_speed=x), s["load_torque"])}
            for what, row in rows.items():
                time = ticked(row, 100)
                ratio = "" if peer is None else f"{peer * lanes / time:15.1f}x"
                print(f"{f'{lanes} lanes, {name}: {what}':36} {1e6 * time:9.2f} {1e6 * time / lanes:10.4f} {ratio}")


def c() -> None:
    """Print what a tick costs where compiled code calls the entry for C."""
    from_c.table({"plain": MODEL, "play": st.PulseServo(MODEL.servo.replace(WORN["play"]))}, lanes_tick(1, 1e-3),
                 mujoco_tick())


def calls() -> None:
    """Print what a whole call of `simulate_many` costs beside `mujoco.rollout`, which takes a lane after the other."""
    fleet = random_fleet(LANES, duration=DURATION)
    rng = np.random.default_rng(0)
    starts, ends = rng.uniform(20.0, 160.0, (2, LANES))
    signals = [st.signals.step(a, b, at=0.1, unit="deg") for a, b in zip(starts, ends, strict=True)]
    try:
        run = peer_mujoco.prepare(fleet, 64, DURATION, THREADS)
        peer = 64 * DURATION / best(run, 3)
    except ImportError:
        print("MuJoCo: left out, because it is not installed")
        peer = None
    print(f"{'whole call, 2 s':36} {'ms':>9} {'servo-s/s':>10} {'over rollout':>13}")
    for name, commands, dtype in (
            ("4096 different signals", signals, "float64"), ("4096 different signals", signals, "float32"),
            ("64 shared signals", [signals[k % 64] for k in range(LANES)], "float64"),
            ("64 shared signals", [signals[k % 64] for k in range(LANES)], "float32")):
        def call(commands: list[st.signals.Signal] = commands, dtype: str = dtype) -> object:
            return st.simulate_many(MODEL, commands, duration=DURATION, output_times=[DURATION], dtype=dtype)
        call()
        time = best(call, 15)
        speed = LANES * DURATION / time
        ratio = "" if peer is None else f"{speed / peer:12.0f}x"
        print(f"{name + ', ' + dtype:36} {1e3 * time:9.2f} {speed:10.2e} {ratio}")


def main() -> None:
    parts = {"ticks": ticks, "between": between, "c": c, "calls": calls}
    for part in sys.argv[1:] or parts:
        if part not in parts:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(parts)}")
        parts[part]()
        print(flush=True)


if __name__ == "__main__":
    main()
