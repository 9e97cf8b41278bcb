"""The tornado of a sweep: how far each parameter alone moves a metric."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin import units
from servotwin.errors import InputError
from servotwin.look import COLOURS, axes_grid, context, finished, readable
from servotwin.models.outputs import SIGNALS
from servotwin.plotting.responses import SHOWN, Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.studies import Bar, Tornado

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
