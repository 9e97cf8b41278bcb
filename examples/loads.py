"""The same step with different things on the shaft."""

import math

import servotwin as st
from servotwin.loads import Constant, Inertia, Pendulum, Spring

model = st.PulseServo(st.load_servo("hitec-hs-311"))
command = st.signals.step(-45.0, 45.0, at=0.05, unit="deg")

for name, load in {
    "free shaft": None,
    "wheel": Inertia(5e-3),
    "arm with weight": Pendulum(mass=0.1, length=0.1),
    "return spring": Spring(stiffness=0.1),
    "pull of 0.1 N m": Constant(0.1),
}.items():
    result = st.simulate(model, command, duration=1.5, load=load)
    metrics = result.step_metrics()
    print(f"{name:16} rise {metrics.rise_time:.3f} s, overshoot {100 * metrics.overshoot:4.1f} %, "
          f"stands {math.degrees(metrics.steady_error):5.2f} deg short, {metrics.peak_current:.2f} A")
