"""Digital servos with ticks of 1 ms: a fleet on two cores and one servo by `simulate`, beside fixed-step rules.

`run.py` prints servo-seconds per second of 4096 servos for 2 s, and the time of one servo-second by `simulate`.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import fixed_step
import numpy as np
from digital_fleet import DURATION, PLANT, TICK, commands, fleet, model_of_fleet

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

LANES, FEW = 4096, 64


def main() -> None:
    model = model_of_fleet()
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
    print(f"one servo by simulate: {1e3 * best(lambda: st.simulate(model, told[0], duration=1.0), 5):.1f} ms a "
          "servo-second, with 1001 outputs")


def _mujoco(told: list[st.signals.Signal]) -> Callable[[], object] | None:
    try:
        return fixed_step.rollout(told[:FEW], DURATION, TICK)
    except ImportError as missing:
        print(f"mujoco.rollout: left out, because {missing.name} is not installed")
        return None


if __name__ == "__main__":
    main()
