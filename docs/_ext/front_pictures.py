"""Draw the pictures of README and front page again, but for that of identification: run this file."""

import math
from pathlib import Path

import numpy as np

import servotwin as st
from servotwin.look import COLOURS, LINES, WIDTH, context, finished, new_figure

IMAGES = Path(__file__).resolve().parents[1] / "images"
SERVO = st.load_servo("hitec-hs-755hb")


def step():
    """Half a turn: angle, armature voltage and current over time."""
    command = st.signals.step(0.0, 180.0, at=0.1, unit="deg")
    result = st.simulate(st.PulseServo(SERVO), command, duration=1.2)
    return st.plotting.time_response(result, ["output_angle", "armature_voltage", "armature_current"])


def loop():
    """An arm is loaded: the servo alone sags, and a controller around it takes the error away."""
    simulator = st.Simulator(st.PulseServo(SERVO))
    figure = new_figure(WIDTH, 2.8)
    with context():
        ax = figure.subplots()
        for (colour, dash), gain, label in ((LINES[1], 0.0, "servo alone"), (LINES[0], 0.1, "with a loop around it")):
            time, angle = _held(simulator, gain)
            ax.plot(time, angle, color=colour, linestyle=dash, label=label)
        ax.axhline(60.0, color=COLOURS["grey"], linewidth=1.0)
        ax.annotate("asked for", (0.02, 60.0), xytext=(0, 3), textcoords="offset points", color=COLOURS["grey"],
                    fontsize=8.0)
        ax.axvline(0.5, color=COLOURS["grey"], linewidth=0.8, linestyle=(0, (1, 1.4)))
        ax.annotate("0.5 N m from here on", (0.5, 61.6), xytext=(4, 0), textcoords="offset points", fontsize=8.0)
        ax.set(xlabel="time (s)", ylabel="output angle (°)", xlim=(0.0, 3.0), ylim=(54.0, 62.5))
        ax.legend(loc="lower right")
    return finished(figure)


def _held(simulator, gain):
    """Time [s] and angle [deg] of a servo at 60 degrees under a weight; an integrator corrects its command."""
    asked = target = math.radians(60.0)
    state = simulator.initial(st.signals.constant(asked, unit="rad"))
    time, angle = [0.0], [target]
    for k in range(1, 601):
        now = 0.005 * k
        state = simulator.advance(state, now, st.signals.constant(asked, unit="rad"),
                                  external_torque=0.5 if now > 0.5 else 0.0)
        if k % 4 == 0:  # it looks once a frame
            asked += gain * (target - state["output_angle"])
        time.append(now)
        angle.append(state["output_angle"])
    return time, np.degrees(angle)


def bench():
    """The paper's Table II: measured angles, and those of the bench as a program."""
    table = st.load_dataset("urrea-kern-table-2").columns
    rows = st.bench.Bench(st.PulseServo(st.bench.bench_servo(SERVO))).measure(table["V_i_V"])
    computed = [math.degrees(row.reading.output_angle) for row in rows]
    band = [math.degrees(row.standing_band) for row in rows]
    figure = new_figure(WIDTH, 2.8)
    with context():
        ax = figure.subplots()
        ax.errorbar(table["V_i_V"], computed - np.asarray(table["q_deg"]), yerr=band, color=COLOURS["blue"], marker="o",
                    markersize=4.0, linewidth=1.2, capsize=3.0, label="computed, with its standing band")
        ax.plot(table["V_i_V"], np.zeros(len(computed)), color=COLOURS["black"], linestyle="none", marker="s",
                markersize=5.0, label="measured, Table II")
        ax.set(xlabel="command voltage (V)", ylabel="angle less the\nmeasured one (°)", ylim=(-2.0, 2.0))
        ax.legend(loc="lower right")
    return finished(figure)


def main():
    for name, draw in (("step", step), ("loop", loop), ("bench", bench)):
        st.plotting.save(draw(), IMAGES / f"{name}.png", overwrite=True)


if __name__ == "__main__":
    main()
