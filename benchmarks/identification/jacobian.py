"""Part 1: the derivatives of one log of 6 s by 8 parameters, beside JAX's `jacfwd` through a fixed-step simulation."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import peer_jax

from logs import DURATION, FREE, NOMINAL, SAMPLE

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

import servotwin as st
from servotwin.identification.fitting.search.case import Point
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import Space
from servotwin.loads import Load
from servotwin.logs import Log
from servotwin.models import Model

LOAD = Load(inertia=1e-3)
STEPS = (1e-3, 5e-4, 2.5e-4)  # s, of the peer
NEAR = 1e-4  # of the logarithm of a parameter, for central differences
TIME = SAMPLE * np.arange(round(DURATION / SAMPLE) + 1)


def widths(*, jumps: bool) -> np.ndarray:
    """Return pulse widths of 200 Hz [s]: two jumps a second, or two sines, which change with every sample."""
    rng = np.random.default_rng(0)
    angle = 1.5 + 0.7 * np.sin(2.0 * TIME) + 0.3 * np.sin(9.0 * TIME)
    if jumps:
        angle = rng.uniform(0.3, 2.6, 13)[(2.0 * TIME).astype(int)]
    electronics, pot = NOMINAL.electronics, NOMINAL.potentiometer
    return electronics.one_shot_offset + electronics.one_shot_slope * (pot.feedback_gain * angle + pot.feedback_offset)


class Ours:
    """Our Jacobian of one log: copies of the servo that differ a little, beside the nominal one, in one batch."""

    def __init__(self, kind: type[Model], width: np.ndarray) -> None:
        log = Log(name="one", time=TIME, command=width, command_kind="pulse_width", load=LOAD,
                  measured={"output_angle": np.zeros_like(TIME)})
        model = kind(NOMINAL)
        self.space = Space(model, FREE[kind])
        self.forecast = Forecast([log], model, self.space, (), ["output_angle"])
        self.at = self._point(self.space.start)
        self()  # compiles

    def _point(self, x: np.ndarray) -> Point:
        return Point(x, tuple(self.forecast.own_start(case) for case in self.forecast.cases))

    def __call__(self) -> np.ndarray:
        """Return d angle / d logarithm of each parameter, shape (n, p) [rad]."""
        return self.forecast.at(self.at)[0].shared

    def central(self) -> np.ndarray:
        """Return the same by central differences, for which everything is simulated twice for each parameter."""
        columns = []
        for k in range(len(self.space)):
            shift = NEAR * (np.arange(len(self.space)) == k)
            parts = [self.forecast.at(self._point(self.space.start + way * shift), derivatives=False)[0]
                     for way in (1.0, -1.0)]
            columns.append((parts[0].residual - parts[1].residual) / (2.0 * NEAR))
        return np.column_stack(columns)


def apart(jacobian: np.ndarray, exact: np.ndarray) -> float:
    """Return the rms difference of the worst column, relative to the rms of that column."""
    return float(np.max(np.sqrt(np.mean((jacobian - exact) ** 2, axis=0) / np.mean(exact**2, axis=0))))


def peer(width: np.ndarray, step: float) -> Callable[[], np.ndarray]:
    """Return JAX's Jacobian of the bounded servo, compiled."""
    model = st.BoundedServo(NOMINAL)
    command = model.command(st.signals.samples(TIME, width, unit="s", hold="previous"))(TIME)
    return peer_jax.prepare(model, LOAD, command, SAMPLE, step)


def main() -> None:
    print(f"Jacobian of one log of {DURATION:g} s, 200 Hz, by 8 parameters, one thread; error: worst column, against "
          "central differences of the exact solution")
    for jumps in (True, False):
        width = widths(jumps=jumps)
        print("two jumps a second" if jumps else "a command that changes with every sample")
        times = {}
        for kind in (st.PulseServo, st.BoundedServo):
            ours = Ours(kind, width)
            exact = ours.central()
            times[kind] = best(ours, 100)
            print(f"  servotwin, {kind.__name__:12}    {1e3 * times[kind]:8.2f} ms   error {apart(ours(), exact):.1e}")
        for step in STEPS:
            try:
                run = peer(width, step)
            except ImportError as missing:
                print(f"  JAX: left out, because {missing.name or missing} is not installed")
                break
            spent = best(run, 20)
            ratios = ", ".join(f"{spent / own:.1f}x {kind.__name__}" for kind, own in times.items())
            print(f"  JAX jacfwd, RK4 {1e3 * step:5.2f} ms    {1e3 * spent:8.2f} ms   error {apart(run(), exact):.1e}"
                  f"   {ratios}", flush=True)


if __name__ == "__main__":
    main()
