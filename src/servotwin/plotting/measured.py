"""A measured log over time: command and angle, and below them what else was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.look import COLOURS, axes_grid, context, finished
from servotwin.plotting.responses import SHOWN, shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.logs import Log

_COMMANDS = {"angle": "command_angle", "pulse_width": "pulse_width", "voltage": "command_voltage"}


def log_over_time(log: Log, gaps: Sequence[tuple[float, float]] = ()) -> Figure:
    """Return the picture of a log.

    Parameters
    ----------
    log : Log
    gaps : sequence of (float, float)
        Begin and length of stretches without rows, which are shaded [s].

    Examples
    --------
    >>> from servotwin.logs import Log
    >>> log = Log(name="a", time=[0.0, 0.1, 0.2], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0], "supply_current": [0.1, 0.2, 0.1]})
    >>> [axes.get_ylabel() for axes in log_over_time(log).axes]
    ['output angle (°)', 'supply current (A)']
    """
    names = [log.angle_name, *(name for name in log.measured if name != log.angle_name and name in SHOWN)]
    together = (log.command_kind, log.angle_name) == ("angle", "output_angle")
    with context():
        figure, axes = axes_grid(len(names) + (not together), height=1.2 + 1.6 * (len(names) + (not together)))
        if together:
            _command(axes[0], log, dash=(0, (1, 1.6)))
        else:
            _command(axes[0], log)
        for ax, name in zip(axes[not together:], names, strict=True):
            ax.plot(log.time, shown(name, log.measured[name]), color=COLOURS["blue"], linewidth=1.3, label="measured")
            ax.set_ylabel(f"{SHOWN[name].words} ({SHOWN[name].label})")
        for ax in axes:
            for begin, length in gaps:
                ax.axvspan(begin, begin + length, color=COLOURS["black"], alpha=0.12, linewidth=0)
        if together:
            axes[0].legend(loc="best")
        axes[-1].set_xlabel("time (s)")
        axes[0].set_title(log.name)
    return finished(figure)


def _command(ax: Axes, log: Log, dash: object = "-") -> None:
    name = _COMMANDS[log.command_kind]
    ax.plot(log.time, shown(name, log.command), color=COLOURS["black"], linestyle=dash, linewidth=1.1,
            drawstyle="steps-post", label="command")
    ax.set_ylabel(f"{SHOWN[name].words} ({SHOWN[name].label})")
