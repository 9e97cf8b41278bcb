"""Tables and lines of `servotwin log`."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from servotwin import units
from servotwin.cli.terminal import pairs, table

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import RenderableType

    from servotwin.identification.survey.survey import Clock, Motion, Survey, Values
    from servotwin.logs import Log

# signal or kind of command -> (unit as printed, of `servotwin.units`, its dimension)
_UNITS = {"output_angle": ("deg", "angle"), "load_angle": ("deg", "angle"), "angle": ("deg", "angle"),
          "feedback_voltage": ("V", "voltage"), "voltage": ("V", "voltage"), "bus_voltage": ("V", "voltage"),
          "armature_voltage": ("V", "voltage"), "supply_current": ("A", "current"),
          "armature_current": ("A", "current"),
          "output_speed": ("deg/s", "speed"), "pulse_width": ("us", "time")}
_BLOCKS = "▁▂▃▄▅▆▇█"
_WIDE, _NARROW = 60, 36  # characters of a curve
_ROOM = 110  # characters of a line, from which on curves are wide
_MOST_GAPS = 3


def sections(found: Survey, files: Sequence[str]) -> list[RenderableType]:
    """Return all that is said of one log."""
    log = found.log
    parts: list[RenderableType] = [f"{log.name}: {len(log)} rows in {log.duration:.4g} s"]
    if log.reading is not None:
        parts += [table(("column", "signal", "unit", "known"), [
            (one.column, one.signal, one.unit, one.known) for one in log.reading.columns]), ""]
    rows = [*_curves(log), ("clock", _clock(found.clock)), *_gaps(found.clock)]
    rows += [(name.replace("_", " "), _values(name, one)) for name, one in found.values.items()]
    rows += [("supply", f"{found.supply.voltage:.2f} V at least, at {found.supply.time:.3g} s")] if found.supply else []
    rows += [("motion", line) for line in _motion(log, found.motion)]
    if log.reading is not None:
        rows += [("mended" if "are joined" in one or "left out" in one or "spread" in one else "remark", one)
                 for one in log.reading.remarks]
        rows += [("not read", ", ".join(log.reading.unread))] if log.reading.unread else []
    rows += [("wrong?", one) for one in found.wrong] or [("wrong?", "nothing that shows without a servo")]
    rows += [("lacks", one) for one in found.missing]
    return [*parts, pairs([*rows, *(("written", name) for name in files)])]


def _curves(log: Log) -> Iterator[tuple[str, str]]:
    """Give command and angle as curves of a line each."""
    width = _WIDE if shutil.get_terminal_size((_ROOM, 1)).columns >= _ROOM else _NARROW
    for label, kind, values in (("command", log.command_kind, log.command),
                                (log.angle_name.replace("_", " "), log.angle_name, log.measured[log.angle_name])):
        seen = values[np.isfinite(values)]
        yield label, f"{curve(log.time, values, width)}  {_range(kind, float(seen.min()), float(seen.max()))}"


def curve(time: NDArray[np.float64], values: NDArray[np.float64], width: int) -> str:
    """Return values over time as one line of blocks; a blank where there are none.

    Examples
    --------
    >>> curve(np.arange(8.0), np.arange(8.0), 8)
    '▁▂▃▄▅▆▇█'
    """
    place = np.minimum(((time - time[0]) / (time[-1] - time[0]) * width).astype(int), width - 1)
    low, high = np.nanmin(values), np.nanmax(values)
    line = []
    for k in range(width):
        here = values[place == k]
        here = here[np.isfinite(here)]
        share = 0.0 if high == low or not len(here) else (float(np.median(here)) - low) / (high - low)
        line.append(_BLOCKS[min(int(share * len(_BLOCKS)), len(_BLOCKS) - 1)] if len(here) else " ")
    return "".join(line)


def _in_units(kind: str, value: float) -> tuple[float, str]:
    unit, dimension = _UNITS.get(kind, ("", "number"))
    return (float(units.from_si(value, unit, dimension)), f" {unit}") if unit else (value, " SI")


def _range(kind: str, low: float, high: float) -> str:
    a, unit = _in_units(kind, low)
    b, _ = _in_units(kind, high)
    return f"{a:z.5g}{unit}" if a == b else f"{a:z.5g} to {b:z.5g}{unit}"


def _clock(clock: Clock) -> str:
    parts = [f"a row each {1e3 * clock.period:.4g} ms ({1.0 / clock.period:.4g} Hz)"]
    if clock.jitter > 1e-3 * clock.period:
        parts.append(f"steps scatter by {1e3 * clock.jitter:.2g} ms")
    if clock.unit:
        parts.append(f"stamps in whole {1e3 * clock.unit:g} ms")
    if clock.off_beat:
        parts.append(f"{clock.off_beat} stamps off the beat of the others")
    return ", ".join(parts)


def _gaps(clock: Clock) -> list[tuple[str, str]]:
    if not clock.gaps:
        return []
    some = ", ".join(f"{1e3 * gap.length:.4g} ms at {gap.at:.4g} s" for gap in clock.gaps[:_MOST_GAPS])
    more = ", ..." if len(clock.gaps) > _MOST_GAPS else ""
    return [("gaps", f"{len(clock.gaps)}: {some}{more}")]


def _values(name: str, found: Values) -> str:
    noise, unit = _in_units(name, found.noise)
    parts = [_range(name, found.low, found.high), f"noise {noise:.2g}{unit}"]
    if found.counts:
        parts.append(f"{found.counts} counts a turn")
    elif found.step:
        parts.append(f"in steps of {_in_units(name, found.step)[0]:.3g}{unit}")
    if found.missing:
        parts.append(f"missing in {found.missing} rows")
    if found.flat_low or found.flat_high:
        parts.append(f"flat at an end in {found.flat_low + found.flat_high} rows")
    return ", ".join(parts)


def _motion(log: Log, motion: Motion) -> Iterator[str]:
    if motion.still:
        yield "none: the shaft stands still"
        return
    if math.isfinite(motion.lag):
        late = 1e3 * motion.lag
        yield (f"begins {late:.0f} ms after the command, in the median of {motion.steps} step"
               f"{'s' * (motion.steps != 1)}" if motion.steps else f"{late:.0f} ms behind the command")
    elif not len(log.changes) and math.isfinite(motion.onset):
        yield f"first seen {1e3 * motion.onset:.0f} ms after the first row"
    if math.isfinite(motion.speed):
        speed, unit = _in_units("output_speed", motion.speed) if log.angle_name == "output_angle" else (
            motion.speed, " V/s")
        yield f"fastest {speed:.4g}{unit}"
    if math.isfinite(motion.gain) and log.angle_name == "output_angle" and log.command_kind in ("angle", "pulse_width"):
        if log.command_kind == "angle":
            yield (f"{motion.gain:.3g} deg for each commanded, 0 at a command of "
                   f"{math.degrees(motion.zero):z.2f} deg; correlation {motion.correlation:.3f}")
        else:
            yield (f"{math.degrees(motion.gain) * 1e-6:.4g} deg/us, 0 at {1e6 * motion.zero:.1f} us; correlation "
                   f"{motion.correlation:.3f}")

