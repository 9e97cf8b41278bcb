"""Signals of a result over time, in stacked panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.look import LINES, axes_grid, context
from servotwin.models.outputs import SIGNALS
from servotwin.simulation.remarks import TRIPS

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from servotwin.simulation import Result


class Shown(NamedTuple):
    """How a signal is shown: words, symbol, unit as printed, unit of `servotwin.units`, its dimension."""

    words: str
    symbol: str
    label: str
    unit: str
    dimension: str


SHOWN: dict[str, Shown] = {
    "command_voltage": Shown("command voltage", r"$v_i$", "V", "V", "voltage"),
    "command_angle": Shown("command angle", r"$q^*$", "°", "deg", "angle"),
    "pulse_width": Shown("pulse width", r"$t_a$", "µs", "us", "time"),
    "armature_voltage": Shown("armature voltage", r"$v_a$", "V", "V", "voltage"),
    "armature_current": Shown("armature current", r"$i_a$", "A", "A", "current"),
    "duty": Shown("duty", r"$d$", "%", "%", "number"),
    "goal_angle": Shown("goal", r"$g$", "°", "deg", "angle"),
    "reference_angle": Shown("reference", r"$r$", "°", "deg", "angle"),
    "motor_angle": Shown("motor angle", r"$q_m$", "°", "deg", "angle"),
    "motor_speed": Shown("motor speed", r"$\dot{q}_m$", "rpm", "rpm", "speed"),
    "motor_torque": Shown("motor torque", r"$\tau_o$", "mN m", "mN m", "torque"),
    "output_angle": Shown("output angle", r"$q$", "°", "deg", "angle"),
    "output_speed": Shown("output speed", r"$\dot{q}$", "°/s", "deg/s", "speed"),
    "load_torque": Shown("load torque", r"$\tau_L$", "N m", "N m", "torque"),
    "bus_voltage": Shown("supply voltage", r"$V_{bus}$", "V", "V", "voltage"),
    "supply_current": Shown("supply current", r"$i_s$", "A", "A", "current"),
    "feedback_voltage": Shown("feedback voltage", r"$v_o$", "V", "V", "voltage"),
}
"""By signal name; a signal that is not here is shown in its SI unit."""

# Beside the shaft's angle its command; then what moves it.
_DEFAULT = ("output_angle", "motor_angle", "output_speed", "motor_speed", "duty", "armature_voltage",
            "armature_current")
_WITH = {"output_angle": "command_angle"}
_PROFILE = {"output_angle": ("reference_angle", "goal_angle")}  # drawn too where the reference is not the goal
_TRIPS = ("", *TRIPS)


def shown(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return values of a signal (SI) in the unit in which it is shown, same shape.

    Examples
    --------
    >>> shown("pulse_width", [0.0015]).tolist()
    [1500.0]
    """
    import numpy as np

    if name not in SHOWN:
        return np.asarray(values, dtype=np.float64)
    return np.asarray(units.from_si(np.asarray(values, dtype=np.float64), SHOWN[name].unit, SHOWN[name].dimension))


def time_response(result: Result, signals: Sequence[str] | None = None) -> Figure:
    """Return a figure of signals over time, one panel each.

    Parameters
    ----------
    result : Result
        Of `simulate`.
    signals : sequence of str, optional
        Signal names; unless given, angle with command, speed, armature voltage or duty, and current. A servo's angle
        brings its command along, and the reference of its profile; while a protection acts the panel of the duty is
        shaded.

    Raises
    ------
    UnknownNameError
        If the model has no such signal.
    InputError
        If it is no result, or `signals` is empty.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(model, st.signals.step(0.0, 90.0, at=0.1, unit="deg"), duration=1.0)
    >>> len(time_response(result, ["output_angle", "armature_voltage"]).axes)
    2
    """
    from servotwin.simulation import Result

    if not isinstance(result, Result):
        raise InputError("result of time_response", got=result, allowed="what simulate returns")
    names = _names(result, signals)
    figure, axes = axes_grid(len(names), height=0.7 + 1.25 * len(names), margins=(0.88, 0.1, 0.45, 0.3, 0.15))
    with context():
        for ax, name in zip(axes, names, strict=True):
            _panel(ax, result, name)
        axes[-1].set_xlabel("time (s)")
        axes[-1].set_xlim(float(result.time[0]), float(result.time[-1]) or 1.0)
        figure.suptitle(f"{result.model.servo.name}, {type(result.model).__name__}", fontsize=9,
                        y=1.0 - 0.06 / figure.get_figheight())
        for ax in axes:
            ax.yaxis.set_label_coords(-0.11, 0.5)
    return figure


def _names(result: Result, signals: Sequence[str] | None) -> list[str]:
    if signals is None:
        has_output = "output_angle" in result.names
        skip = {"motor_angle", "motor_speed"} if has_output else set()
        skip |= {"armature_voltage"} if "duty" in result.names else set()
        return [name for name in _DEFAULT if name in result.names and name not in skip]
    names = [signals] if isinstance(signals, str) else list(signals)
    if not names:
        raise InputError("signals", got=names, allowed="at least one name")
    for name in names:
        if name not in result.names or name == "time":
            raise UnknownNameError(f"signal of {type(result.model).__name__}", name,
                                   [known for known in result.names if known != "time"])
    return names


def _panel(ax: Axes, result: Result, name: str) -> None:
    label = SHOWN[name].label if name in SHOWN else SIGNALS[name].unit
    ax.set_ylabel(f"{SHOWN[name].words if name in SHOWN else name}\n({label})")
    companion = _WITH.get(name, "")
    if companion in result.names:
        # As steps only where the command is one of levels: a ramp is a line.
        levels = all(p.slope == 0.0 and p.amplitude == 0.0 for p in result.command.pieces.table)
        ax.plot(result.time, shown(companion, result[companion]), color=LINES[1][0], linestyle=LINES[1][1],
                linewidth=1.1, label="command", drawstyle="steps-post" if levels else "default")
    lines = _profile(ax, result, name)
    ax.plot(result.time, shown(name, result[name]), color=LINES[0][0], linestyle=LINES[0][1],
            label=SHOWN[name].words if name in SHOWN else name)
    trips = _shade(ax, result) if name == "duty" else 0
    if companion in result.names or lines or trips:
        ax.legend(loc="upper left" if trips else "lower right")


def _profile(ax: Axes, result: Result, name: str) -> int:
    """Draw the reference of a profile beside an angle; return how many lines that makes."""
    reference, goal = _PROFILE.get(name, ("", ""))
    if reference not in result.names or (result[reference] == result[goal]).all():
        return 0
    ax.plot(result.time, shown(reference, result[reference]), color=LINES[2][0], linestyle=LINES[2][1], linewidth=1.1,
            label=SHOWN[reference].words)
    return 1


def _shade(ax: Axes, result: Result) -> int:
    """Shade where a protection acts, named in the legend; return how many kinds do."""
    import numpy as np

    trip, acting = result["trip"], 0
    for k, words in enumerate(_TRIPS):
        if k > 0 and (trip == k).any():
            ax.fill_between(result.time, 0.0, 1.0, where=np.asarray(trip == k), transform=ax.get_xaxis_transform(),
                            color=LINES[k][0], alpha=0.25, linewidth=0.0, label=f"tripped by {words}")
            acting += 1
    return acting
