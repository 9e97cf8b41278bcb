"""One `BoundedServo`, 180° step of 2 s, 201 outputs, beside LSODA at rtol 1e-8."""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import TIMES, best, bounded_right_side, standstill

import servotwin as st
from servotwin.loads import Load


def stepped(model: st.BoundedServo, v_c: float, method: str, rtol: float,
            corners: tuple[float, ...] = ()) -> np.ndarray:
    """The angle by a SciPy integrator that stops where the servo sticks, and at given errors v_e, its corners."""
    sensor = model.pack(Load()).sensor
    f = bounded_right_side(model, v_c)
    events = [standstill]
    for corner in corners:
        def reached(t: float, y: np.ndarray, corner: float = corner) -> float:
            return v_c - sensor.p * y[0] - sensor.b_o - corner
        reached.terminal, reached.direction = True, -1.0
        events.append(reached)
    t, y, out = 0.0, (0.0, 0.0), np.zeros_like(TIMES)
    while True:
        run = solve_ivp(f, (t, 2.0), y, method=method, rtol=rtol, atol=1e-2 * rtol, events=events, dense_output=True)
        inside = (TIMES >= t) & (TIMES <= run.t[-1])
        out[inside] = run.sol(TIMES[inside])[0]
        t, y = float(run.t[-1]), run.y[:, -1]
        if run.t_events[0].size or t >= 2.0:
            out[TIMES > t] = y[0]
            return out


def main() -> None:
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    command = st.signals.step(0.0, 180.0, unit="deg")
    v_c = float(model.command(command)(1.0))
    gain, half_deadband, V_max = model.pack(Load()).follower
    corners = (half_deadband + V_max / gain, half_deadband)
    exact = stepped(model, v_c, "DOP853", 1e-12, corners)

    def ours() -> np.ndarray:
        return st.simulate(model, command, duration=2.0, output_times=TIMES)["output_angle"]

    def lsoda() -> np.ndarray:
        return stepped(model, v_c, "LSODA", 1e-8)

    a, b = best(ours, 30), best(lsoda, 10)
    print("BoundedServo, 180 deg step, 2 s, 201 outputs; errors [rad] against DOP853 at rtol 1e-12")
    print(f"servotwin        {1e3 * a:8.3f} ms   error {np.abs(ours() - exact).max():.1e}")
    print(f"LSODA, rtol 1e-8 {1e3 * b:8.3f} ms   error {np.abs(lsoda() - exact).max():.1e}")
    print(f"ratio            {b / a:8.1f} times faster")


if __name__ == "__main__":
    main()
