"""A plot in the terminal while a log is recorded."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping

_SHOWN = 6.0  # s of the run
_PAUSE = 0.2  # s between two pictures
_ROWS = 14
_COMMANDS = ("pulse_width_us", "command_angle_deg")
_ANSWERS = ("output_angle_deg", "feedback_voltage_V")
_NUMBERS = ("supply_current_A", "armature_current_A", "bus_voltage_V", "housing_temperature_K")

Watch = Callable[[Mapping[str, float]], None]


@contextlib.contextmanager
def live_plot(name: str) -> Iterator[Watch]:
    """Give a function that takes rows and shows the last seconds of command and answer; elsewhere it does nothing."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda row: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(stderr=True)
    rows: deque[Mapping[str, float]] = deque()
    last = 0.0
    with Live(console=console, auto_refresh=False, transient=True) as live:

        def watch(row: Mapping[str, float]) -> None:
            nonlocal last
            rows.append(row)
            while rows[0]["time_s"] < row["time_s"] - _SHOWN:
                rows.popleft()
            if time.monotonic() - last > _PAUSE:
                last = time.monotonic()
                live.update(Text.from_ansi(picture(name, list(rows), min(console.width, 100))), refresh=True)

        yield watch


def picture(name: str, rows: list[Mapping[str, float]], width: int) -> str:
    """Return command and answer over time as text.

    Examples
    --------
    >>> rows = [{"time_s": 0.1 * k, "pulse_width_us": 1500.0, "feedback_voltage_V": 1.0 + k} for k in range(9)]
    >>> "feedback_voltage_V" in picture("step", rows, 60)
    True
    """
    import plotext

    plotext.clear_figure()
    plotext.theme("clear")
    plotext.plotsize(width, _ROWS)
    command = next((one for one in _COMMANDS if one in rows[0]), None)
    answer = next((one for one in _ANSWERS if one in rows[0]), None)
    for column, side in ((command, "left"), (answer, "right")):
        points = [(row["time_s"], row[column]) for row in rows if column and not math.isnan(row[column])]
        if points and column:
            plotext.plot(*map(list, zip(*points, strict=True)), label=column, yside=side, marker="braille",
                         color="blue" if side == "left" else "orange")
    numbers = [f"{column} {found[-1]:.3g}" for column in _NUMBERS
               if (found := [row[column] for row in rows if column in row and not math.isnan(row[column])])]
    plotext.title("   ".join([f"{name}, {rows[-1]['time_s']:.1f} s", *numbers]))
    plotext.xlabel("time_s")
    return str(plotext.build())
