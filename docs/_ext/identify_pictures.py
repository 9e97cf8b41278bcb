"""Draw the pictures of the guide's page on identification again, from the fits of that page: run this file."""

import os
import re
import tempfile
from pathlib import Path

import numpy as np

import servotwin as st
from servotwin.identification.fitting.slew_lag import fit_slew_lag
from servotwin.look import COLOURS, LINES, WIDTH, context, finished, new_figure

DOCS = Path(__file__).resolve().parents[1]
IMAGES, PAGE = DOCS / "images", DOCS / "guide" / "identify.md"
MEMBERS = {"output_torque_constant": "motor.torque_constant", "output_inertia": "motor.rotor_inertia",
           "output_coulomb_torque": "friction.coulomb_torque_forward"}


def run_page():
    """Run the code of the page; return its names, and all fits that it made one after the other."""
    names, fits = {"__name__": "page"}, []
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for block in blocks:
            exec(block, names)
            if "fit" in names and (not fits or fits[-1] is not names["fit"]):
                fits.append(names["fit"])
        os.chdir(here)
    return names, fits


def intervals(names, fits):
    """What the servo file states, what the logs with a free horn tell, and what those with a disc add."""
    rows = ("servo file", "free horn", "and disc")
    figure = new_figure(WIDTH, 4.4)
    with context():
        ax = figure.subplots()
        places = []
        for k, name in enumerate(names["free"]):
            member, place = MEMBERS.get(name, name), 4.0 * k
            stated = names["sheet"].source(member)
            nominal = next(p.start for p in fits[0].space.parameters if p.name == name)
            truth = next(p.start for p in st.identification.Space(st.PulseServo(names["mine"]), [name]).parameters)
            ax.plot([truth / nominal] * 2, [place - 0.6, place + 2.6], color=COLOURS["black"], linewidth=1.0,
                    linestyle=LINES[1][1], label="truth" if k == 0 else None)
            ax.plot(np.array([stated.lower, stated.upper]) / names["sheet"].get(member), [place] * 2,
                    color=COLOURS["grey"], linewidth=4.0, alpha=0.5, solid_capstyle="butt")
            for row, fit in enumerate(fits, start=1):
                low, high, method = fit.intervals()[name]
                colour = COLOURS["vermilion"] if row == 1 else COLOURS["blue"]
                if method == "undetermined":
                    ax.annotate("undetermined", (0.995, place + row), xycoords=("axes fraction", "data"), ha="right",
                                va="center", fontsize=7.5, color=colour)
                    continue
                ax.plot(np.array([low, high]) / nominal, [place + row] * 2, color=colour, linewidth=4.0,
                        solid_capstyle="butt")
                ax.plot(fit.estimates[name] / nominal, place + row, marker="o", markersize=4.0, color=colour)
            places += [(place + row, word) for row, word in enumerate(rows)]
            ax.annotate(name, (0.0, place - 0.55), xycoords=("axes fraction", "data"), xytext=(3.0, 0.0),
                        textcoords="offset points", va="bottom", fontsize=8.0, weight="bold")
        ax.set_yticks([at for at, _ in places], [word for _, word in places])
        ax.set_ylim(4.0 * len(names["free"]) - 0.6, -1.9)
        ax.grid(visible=False, axis="y")
        ax.set_xscale("log")
        ax.set_xlim(0.15, 5.0)
        ax.set_xticks([0.2, 0.5, 1.0, 2.0, 4.0], ["0.2", "0.5", "1", "2", "4"])
        ax.minorticks_off()
        ax.set_xlabel("relative to the value of the servo file (1)")
        ax.legend(loc="lower left")
    return finished(figure)


def log(names, fits):
    """A log with large motion that was held out: measured, the fitted servo, and delay, slew and lag."""
    fit = fits[-1]
    fitted = [trace.log for trace in fit.traces if not trace.held_out]
    trace = max((t for t in fit.traces if t.held_out and t.log.motion == "random"),
                key=lambda t: float(np.ptp(t.measured)))
    slew = np.degrees(np.asarray(fit_slew_lag(fitted, loss="huber").predict(trace.log)))
    time, seen, servo = trace.time, np.degrees(trace.measured), np.degrees(trace.simulated)
    Curve = st.plotting.Curve
    figure = st.plotting.curves(
        [Curve("fitted servo", time, servo), Curve("delay + slew + lag", time, slew),
         Curve("measured, not fitted", time[::2], seen[::2], points=True, style=4)],
        x_label="time (s)", y_label="output angle (°)", height=4.2, below_label="less\nmeasured (°)",
        below=[Curve("fitted servo", time, servo - seen), Curve("delay + slew + lag", time, slew - seen)])
    with context():
        ax = figure.axes[0]
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.18 * (high - low))  # room for the legend
        ax.legend(loc="upper center", ncols=3, handlelength=3.0, columnspacing=1.2, borderaxespad=0.0)
    return figure


def main():
    names, fits = run_page()
    for name, draw in (("identify_intervals", intervals), ("identify_log", log)):
        st.plotting.save(draw(names, fits), IMAGES / f"{name}.png", overwrite=True)


if __name__ == "__main__":
    main()
