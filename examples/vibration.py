"""The vibration of the paper's first bench: servo and control circuit on one soft supply, and the cures."""

import math

import numpy as np

import servotwin as st
from servotwin.bench import Bench, ControlSupply, bench_servo, run_on_one_supply, standing

SOFT = 0.5  # ohm, less than four fresh AA cells
servo = bench_servo(st.load_servo("hitec-hs-755hb")).replace({"supply.internal_resistance": SOFT})
bench = Bench(st.PulseServo(servo))
command = st.signals.step(0.609, 1.425, at=0.1, unit="V")  # from 0 to 90 degrees in the paper's Table II
circuits = {
    "one soft supply": ControlSupply(),
    "separate supplies": ControlSupply(command_share=0.0),
    "one supply, sampled 10 ms late": ControlSupply(sampling_delay=0.01),
    "one supply, reference sags too": ControlSupply(reference_share=1.0),
}

time = np.arange(0.0, 2.5, 1e-3)
angles, asked = [], []
for style, (name, control) in enumerate(circuits.items()):
    run = run_on_one_supply(bench, command, 4.0, control)
    still = standing(run.result, 1.5)
    print(f"{name:31} stands at {math.degrees(still.mean):5.1f} deg, swings {math.degrees(still.swing):4.2f} deg "
          f"{still.frequency:3.1f} times a second, {still.current:.2f} A rms")
    if style < 2:
        angles.append(st.plotting.Curve(name, time, np.degrees(run.result.at("output_angle", time)), style=style))
        asked.append(st.plotting.Curve("", time, np.degrees(run.result.at("command_angle", time)), style=style))
figure = st.plotting.curves(angles, x_label="time (s)", y_label="output angle (°)", height=4.4,
                            below=asked, below_label="asked for\nby the pulses (°)")
figure.axes[0].legend(loc="lower right")
st.plotting.save(figure, "vibration.png", overwrite=True)
