"""Digital servos with ticks of 1 ms: a fleet on two cores and one servo in plain Python, beside fixed-step rules.

`run.py` prints servo-seconds per second of 4096 servos for 2 s, and the time of one servo-second in plain Python.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import fixed_step
import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

LANES, FEW, DURATION, TICK = 4096, 64, 2.0, 1e-3
COUNT = 2.0 * np.pi / 4096.0
PLANT = {
    "motor": {"armature_resistance": 3.0, "torque_constant": 3e-3, "back_emf_constant": 3e-3, "rotor_inertia": 1e-8,
              "motor_viscous_friction": 1e-8},
    "gear": {"gear_reduction": 345.0}, "friction": {"coulomb_torque_forward": 2e-4, "coulomb_torque_backward": 2e-4},
    "supply": {"open_circuit_voltage": 12.0},
    "firmware": {"control_period": TICK, "compute_delay": TICK, "command_kind": "goal", "proportional_gain": 8.0,
                 "derivative_gain": 0.05, "angle_quantum": COUNT, "duty_limit": 0.97},
}


def fleet(lanes: int) -> dict[str, np.ndarray]:
    """Return what differs between servos: gain, voltage, friction, load."""
    rng = np.random.default_rng(1)
    return {"firmware.proportional_gain": rng.uniform(3.0, 15.0, lanes),
            "supply.open_circuit_voltage": rng.uniform(10.0, 12.6, lanes),
            "friction.coulomb_torque_forward": rng.uniform(5e-5, 4e-4, lanes),
            "load.inertia": rng.uniform(5e-4, 5e-3, lanes), "load.torque": rng.uniform(-0.3, 0.3, lanes)}


def commands(lanes: int) -> list[st.signals.Signal]:
    """Return goals that jump five times a second, 64 different ones."""
    rng = np.random.default_rng(2)
    times = np.arange(0.0, DURATION, 0.2)
    some = [st.signals.samples(times, rng.uniform(-1.0, 1.0, len(times)), unit="rad", hold="previous")
            for _ in range(64)]
    return [some[k % 64] for k in range(lanes)]


def main() -> None:
    model = st.DigitalServo(st.servo_from_values("fleet", PLANT, kind="bus"))
    numbers, told = fleet(LANES), commands(LANES)

    def ours() -> np.ndarray:
        batch = st.simulate_many(model, told, duration=DURATION, parameters=numbers, output_times=[DURATION],
                                 outputs=("output_angle",))
        return batch["output_angle"][:, 0]

    angles = ours()  # compiles
    rows: list[tuple[str, float, str]] = [("servotwin, exact between ticks", LANES * DURATION / best(ours, 5), "")]
    for name, step in (("NumPy, a rule of 1 ms", TICK), ("NumPy, a rule of 5 ms", 5e-3)):
        run = fixed_step.prepare(numbers, PLANT, told, DURATION, step, FEW * 8)
        off = np.abs(run() - angles[:FEW * 8])
        rows.append((name, FEW * 8 * DURATION / best(run, 2),
                     f"off by {np.median(off):.1e} rad, {off.max():.1e} at most"))
    peer = _mujoco(told)
    if peer is not None:
        rows.append(("mujoco.rollout, P joint at 1 ms", FEW * DURATION / best(peer, 3), ""))
    for name, speed, more in rows:
        print(f"{name:34} {speed:10.2e} servo-s/s   servotwin {rows[0][1] / speed:8.3g}x   {more}")
    print(f"one servo in plain Python: {1e3 * best(lambda: st.simulate(model, told[0], duration=1.0), 5):.0f} ms a "
          "servo-second, with 1001 outputs")


def _mujoco(told: list[st.signals.Signal]) -> Callable[[], object] | None:
    try:
        return fixed_step.rollout(told[:FEW], DURATION, TICK)
    except ImportError as missing:
        print(f"mujoco.rollout: left out, because {missing.name} is not installed")
        return None


if __name__ == "__main__":
    main()
