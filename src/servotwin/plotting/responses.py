"""Signals of a result over time, in stacked panels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.look import COLOURS, LINES, axes_grid, context, finished, readable
from servotwin.models.outputs import SIGNALS
from servotwin.simulation.remarks import TRIPS

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from servotwin.logs import Log
    from servotwin.simulation import Result
    from servotwin.studies import Bar, Tornado


# --- Signals of a result over time, in stacked panels -----------------------------------------------------------------

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


# --- A measured log over time: command and angle, and below them what else was measured -------------------------------

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


# --- The tornado of a sweep: how far each parameter alone moves a metric ----------------------------------------------

_METRICS = {
    "overshoot": Shown("overshoot", "", "%", "%", "number"),
    "rise_time": Shown("rise time", "", "ms", "ms", "time"),
    "settling_time": Shown("settling time", "", "ms", "ms", "time"),
    "steady_error": Shown("steady error", "", "°", "deg", "angle"),
    "rest_swing": Shown("swing at rest", "", "°", "deg", "angle"),
    "slew_rate": Shown("slew rate", "", "°/s", "deg/s", "speed"),
    "peak_current": Shown("peak current", "", "A", "A", "current"),
    "lowest_voltage": Shown("least voltage", "", "V", "V", "voltage"),
    "rms_error": Shown("rms error", "", "°", "deg", "angle"),
    "peak_error": Shown("peak error", "", "°", "deg", "angle"),
}
_WIDTH, _ROW = 6.6, 0.42  # inch
_LETTER, _GAP, _ROOM, _ROUNDS = 4.3, 6.0, 240.0, 30  # pt: of a label; of the axis, beside names and shares
_SIDES = (("low end (5 %)", COLOURS["blue"], ""), ("high end (95 %)", COLOURS["orange"], "////"))


def metric_shown(name: str) -> Shown:
    """Return how a metric of a sweep is shown: in words, and in which unit.

    Examples
    --------
    >>> metric_shown("overshoot").label, metric_shown("end_output_angle").words
    ('%', 'final output angle')
    """
    if name in _METRICS:
        return _METRICS[name]
    signal = name.removeprefix("end_")
    if signal in SHOWN:
        return SHOWN[signal]._replace(words=f"final {SHOWN[signal].words}")
    unit = SIGNALS[signal].unit
    dimension = next(name for name, known in units.DIMENSIONS.items() if unit in known)
    return Shown(f"final {signal.replace('_', ' ')}", "", unit if unit != "1" else "", unit, dimension)


def tornado(found: Tornado, *, most: int = 12) -> Figure:
    """Return a figure with two bars for each parameter: the metric at its low end and at its high end.

    Parameters
    ----------
    found : Tornado
        Of `Study.tornado`.
    most : int
        How many parameters are drawn, the most important ones.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> from servotwin.studies import Bar, Tornado
    >>> bars = (Bar("motor.torque_constant", 3.3e-3, 4.1e-3, 0.19, 0.18, reach=0.01, share=0.9),)
    >>> tornado(Tornado("rise_time", 0.185, bars)).axes[0].get_xlabel()
    'rise time (ms)'
    """
    bars = found.bars[:most] if most > 0 else ()
    if not bars:
        raise InputError("bars of a tornado", got="none", allowed="at least one parameter")
    shown = metric_shown(found.metric)
    figure, (ax,) = axes_grid(1, width=_WIDTH, height=1.15 + _ROW * len(bars))
    with context():
        leftward = any(at < found.nominal for bar in bars for at in (bar.at_low, bar.at_high))
        for row, bar in enumerate(bars):
            _draw(ax, row, bar, found.nominal, shown, leftward=leftward)
        if math.isfinite(found.nominal):
            ax.axvline(_in(shown, found.nominal), color=COLOURS["black"], linewidth=1.0)
        ax.set_yticks(range(len(bars)), [bar.name for bar in bars])
        ax.set_ylim(len(bars) - 0.45, -0.55)
        ax.set_xlim(*_limits(bars, found.nominal, shown, leftward=leftward))
        ax.grid(visible=False, axis="y")
        ax.set_xlabel(f"{shown.words} ({shown.label})" if shown.label else shown.words)
        for label, colour, hatch in _SIDES:
            ax.barh([0], [0.0], color=colour, hatch=hatch, edgecolor="white", label=label, linewidth=0.0,
                    left=_in(shown, found.nominal) if math.isfinite(found.nominal) else 0.0)
        ax.legend(loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=2)
        ax.annotate("share of\nvariance", xy=(1.0, 1.0), xycoords="axes fraction", xytext=(4.0, 3.0),
                    textcoords="offset points", ha="left", va="bottom", fontsize=7.5, color=COLOURS["grey"])
    return finished(figure)


def _goes_right(at: float, nominal: float, side: int, *, leftward: bool) -> bool:
    """Tell on which side of its bar a label stands; where no bar goes left, names stand there and no label."""
    return at > nominal or (at == nominal and (side > 0 or not leftward))


def _limits(bars: Sequence[Bar], nominal: float, shown: Shown, *, leftward: bool) -> tuple[float, float]:
    """Return an axis on which every label has room beside its bar."""
    from servotwin.studies import dimension_of

    labels = [(_in(shown, at), _goes_right(at, nominal, side, leftward=leftward),
               (_GAP + _LETTER * len(readable(value, dimension_of(bar.name)))) / _ROOM) for bar in bars
              for side, value, at in ((-1, bar.low, bar.at_low), (1, bar.high, bar.at_high)) if math.isfinite(at)]
    ends = [x for x, _, _ in labels] + ([_in(shown, nominal)] if math.isfinite(nominal) else [])
    low, high = min(ends, default=0.0), max(ends, default=1.0)
    if high - low < 1e-9 * max(abs(low), abs(high), 1e-300):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(low) or 1.0)
    for _ in range(_ROUNDS):  # a wider axis makes every label wider on it
        width = high - low
        low = min([low, *(x - share * width for x, right, share in labels if not right)])
        high = max([high, *(x + share * width for x, right, share in labels if right)])
    return low, high


def _draw(ax: Axes, row: int, bar: Bar, nominal: float, shown: Shown, *, leftward: bool) -> None:
    from servotwin.studies import dimension_of

    for side, value, at, (_, colour, hatch) in ((-1, bar.low, bar.at_low, _SIDES[0]),
                                                (1, bar.high, bar.at_high, _SIDES[1])):
        y = row + 0.19 * side
        words = readable(value, dimension_of(bar.name))
        if not (math.isfinite(at) and math.isfinite(nominal)):
            ax.annotate(f"{words}: no value", xy=(0.5, y), xycoords=("axes fraction", "data"), fontsize=7.0,
                        ha="center", va="center", color=COLOURS["grey"], zorder=3.0,
                        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8})
            continue
        left, right = _in(shown, nominal), _in(shown, at)
        ax.barh(y, right - left, height=0.36, left=left, color=colour, hatch=hatch, edgecolor="white", linewidth=0.0)
        ends_right = _goes_right(at, nominal, side, leftward=leftward)
        ax.annotate(words, xy=(right, y), xytext=(3.0 if ends_right else -3.0, 0.0), textcoords="offset points",
                    ha="left" if ends_right else "right", va="center", fontsize=7.0)
    if math.isfinite(bar.share):
        ax.annotate(f"{100.0 * bar.share:.0f} %", xy=(1.0, row), xycoords=("axes fraction", "data"),
                    xytext=(4.0, 0.0), textcoords="offset points", ha="left", va="center", fontsize=8.0,
                    annotation_clip=False)


def _in(shown: Shown, value: float) -> float:
    return units.from_si(value, shown.unit, shown.dimension)
