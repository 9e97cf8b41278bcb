"""Draw the pictures of the page on the vibration again: run this file."""

from pathlib import Path

import numpy as np
import vibration

import servotwin as st
from servotwin.bench import ControlSupply

IMAGES = Path(__file__).resolve().parents[1] / "images"
Curve, Limit = st.plotting.Curve, st.plotting.Limit
OVERVIEW, CLOSE = 2.5, (2.0, 2.3)  # s


def seen(control, end):
    """When the program looks [s], and what the supply of the control circuit is then [V]."""
    made = vibration.run(control)
    looks = control.sampling_times(made.pulses)
    looks = looks[looks < end]
    sag = 6.0 - made.result.at("bus_voltage", looks)
    return looks, 6.0 - control.command_share * sag


def overview():
    """Angle, and below it the supply as the program sees it, on one soft supply and on separate ones."""
    time = np.arange(0.0, OVERVIEW, 1e-3)
    drawn, below = [], []
    for words, control in (("one soft supply", ControlSupply()), ("separate supplies", vibration.SEPARATE)):
        looks, volts = seen(control, OVERVIEW)
        drawn.append(Curve(words, time, np.degrees(vibration.run(control).result.at("output_angle", time))))
        below.append(Curve("", np.repeat(looks, 2)[1:], np.repeat(volts, 2)[:-1]))
    figure = st.plotting.curves(drawn, x_label="time (s)", y_label="output angle (°)", height=4.4, below=below,
                                below_label="supply seen\nby the program (V)",
                                limits=[Limit("asked for", np.degrees(vibration.target()))])
    figure.axes[0].legend(loc="lower right", handlelength=3.2)
    figure.axes[1].set_ylim(4.7, 6.15)
    return figure


def frames():
    """Some swings on one soft supply: what each pulse asks for, the angle, the supply, and the looks at it."""
    result = vibration.run(ControlSupply()).result
    time = np.linspace(*CLOSE, 6001)
    looks, volts = seen(ControlSupply(), CLOSE[1])
    shown = looks > CLOSE[0]
    figure = st.plotting.curves(
        [Curve("asked for by the pulse", time, np.degrees(result.at("command_angle", time)), style=1),
         Curve("output angle", time, np.degrees(result.at("output_angle", time)), style=0)],
        x_label="time (s)", y_label="angle (°)", height=4.4, below_label="supply (V)",
        below=[Curve("", time, result.at("bus_voltage", time), style=0),
               Curve("", looks[shown], volts[shown], points=True, style=1)])
    figure.axes[0].margins(y=0.25)
    figure.axes[0].legend(loc="upper center", ncols=2, handlelength=3.2)
    figure.axes[1].set_ylim(4.7, 6.15)
    return figure


PICTURES = {"overview": overview, "frames": frames}


def main():
    for name, make in PICTURES.items():
        st.plotting.save(make(), IMAGES / f"vibration_{name}.png", overwrite=True)


if __name__ == "__main__":
    main()
