"""Draw the pictures of the pages on the pulse servo again: run this file."""

from pathlib import Path

import numpy as np
import set_s

import servotwin as st
from servotwin.look import context

IMAGES = Path(__file__).resolve().parents[1] / "images"
COLOURS, LINES, Curve = st.plotting.COLOURS, st.plotting.LINES, st.plotting.Curve


def frame():
    """Two frames of set S at an error of 10°: the two pulses, the drive, the current and the angle."""
    result = st.simulate(st.PulseServo(set_s.servo()), st.signals.constant(0.0, unit="deg"), duration=0.042,
                         initial={"output_angle": np.radians(-10.0)}, output_step=1e-5)
    time, own = 1e3 * result.time, 0.6 - 0.1  # ms
    figure, axes = st.plotting.axes_grid(4, height=5.6, share=False, ratios=(1.5, 1.0, 1.0, 1.0))
    with context():
        pulses, *others = axes
        for level, width, words, style in ((1.3, 0.6, "command", 0), (0.0, own, "one-shot", 1)):
            pulses.plot([-0.1, 0.0, 0.0, width, width, 1.0], level + np.array([0.0, 0.0, 0.8, 0.8, 0.0, 0.0]),
                        color=LINES[style][0], solid_joinstyle="miter")
            pulses.text(0.02, level + 0.4, words, va="center", fontsize=8)
        for x in (own, 0.6):
            pulses.axvline(x, color=COLOURS["grey"], linewidth=0.8, linestyle=(0, (2, 2)))
        pulses.annotate("error 100 µs", xy=(0.55, 0.4), xytext=(0.66, 0.4), va="center", fontsize=8,
                        arrowprops={"arrowstyle": "-", "linewidth": 0.8})
        pulses.annotate("decision", xy=(0.6, 1.7), xytext=(0.66, 1.7), va="center", fontsize=8,
                        arrowprops={"arrowstyle": "-", "linewidth": 0.8})
        pulses.set(yticks=[], ylabel="pulses", xlim=(-0.1, 1.0), ylim=(-0.15, 2.3),
                   xlabel="time since the rising edge, enlarged (ms)")
        pulses.grid(visible=False)
        for ax, values, label in zip(others, (result["drive"], result["armature_current"],
                                              np.degrees(result["output_angle"])),
                                     ("drive\n(−1, 0, +1)", "armature\ncurrent (A)", "output\nangle (°)"), strict=True):
            ax.plot(time, values, color=LINES[0][0])
            ax.set(ylabel=label, xlim=(0.0, 42.0))
            for edge in (0.0, 20.0, 40.0):
                ax.axvline(edge, color=COLOURS["grey"], linewidth=0.8, linestyle=(0, (2, 2)))
            if ax is not others[-1]:
                ax.tick_params(labelbottom=False)
        others[-1].set_xlabel("time (ms); dashed: rising edges")
        figure.align_ylabels(axes)
    return st.plotting.finished(figure)


def sag():
    """Sag over load at three frame periods."""
    torques = np.array([0.0, 0.1, set_s.FRICTION, np.nan, *np.arange(0.25, 0.81, 0.05)])
    figure, axes = st.plotting.axes_grid(1, height=3.4)
    with context():
        ax = axes[0]
        for period, (colour, _), marker in zip(set_s.PERIODS, LINES, "os^", strict=False):
            words = f"{1e3 * period:g} ms"
            half = np.degrees(0.5 * set_s.DEADBAND / set_s.PULSE_PER_RADIAN)
            held, most = set_s.FRICTION, 0.8
            sag_at_most = half + np.degrees((most - held) / set_s.stiffness(period))
            ax.plot([0.0, held, held, most], [0.0, 0.0, half, sag_at_most], color=colour,
                    linestyle=LINES[1][1], label=f"mean voltage, {words}")
            sags = [np.nan if np.isnan(torque) else set_s.settled_sag(period, torque) for torque in torques]
            ax.plot(torques, sags, color=colour, linestyle="-", linewidth=1.0, marker=marker, markersize=4.0,
                    label=f"pulses, {words}")
        ax.set(xlabel="load (N m)", ylabel="sag (°)", xlim=(0.0, 0.81), ylim=(-0.3, None))
        ax.legend(loc="upper left", handlelength=3.2)
    return st.plotting.finished(figure)


def small_step():
    """A step of 2°, with pulses and with their mean."""
    drawn = []
    for period in set_s.PERIODS:
        drawn.append(Curve(f"pulses, {1e3 * period:g} ms", *set_s.after_step(set_s.models(period)[0], 2.0, 1.0)))
    for period in (0.005, 0.02):
        time, angle = set_s.after_step(set_s.models(period)[1], 2.0, 1.0)
        drawn.append(Curve(f"mean voltage, {1e3 * period:g} ms", time, angle))
    figure = st.plotting.curves(drawn, x_label="time (s)", y_label="output angle (°)", height=3.4,
                                limits=[st.plotting.Limit("command", 2.0)])
    figure.axes[0].set_xlim(-0.03, 1.75)  # room for the legend
    figure.axes[0].set_xticks(np.linspace(0.0, 1.0, 6))
    figure.axes[0].get_legend().set_loc("center right")
    return figure


PICTURES = {"frame": frame, "sag": sag, "small_step": small_step}


def main():
    for name, make in PICTURES.items():
        st.plotting.save(make(), IMAGES / f"pulse_{name}.png", overwrite=True)


if __name__ == "__main__":
    main()
