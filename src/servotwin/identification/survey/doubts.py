"""What cannot be right in a log, and which experiment it lacks: sentences, each with what to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.look import rough_noise
from servotwin.loads import Load
from servotwin.logs.columns import COMMANDS
from servotwin.logs.defined import is_defined
from servotwin.units.words import unit_shown

if TYPE_CHECKING:
    from servotwin.identification.survey.clock import Clock
    from servotwin.identification.survey.motion import Motion
    from servotwin.identification.survey.values import Values
    from servotwin.logs.log import Log

_ARRIVED = 0.6  # s of one command, within which any servo gets there
_LATE = 0.2  # s: more than a servo's dead time
_CLEAR, _SURE = 0.6, 0.95  # correlation, that tells a sign, and a scale
_SCALES = {180.0 / math.pi: "degrees were taken for radians", math.pi / 180.0: "radians were taken for degrees",
           2.0: "a factor of two", 0.5: "a factor of two"}
_NEAR = 0.07
_USUAL = (0.7, 1.4)  # angle over commanded angle
_PULSE_GAINS = (math.radians(0.03) * 1e6, math.radians(0.4) * 1e6)  # rad/s of pulse
_FASTEST = math.radians(3000.0)  # rad/s
_ALONE = math.radians(5.0)  # more than noise
_SELDOM, _OFTEN = 0.1, 0.5  # of the rows
_STUCK, _MUCH_NOISE = 10, 2.0  # rows without noise, of a sensor that has so many steps of it elsewhere
_TURN = 2.0 * math.pi
_CENTRE = math.radians(90.0)
_OFF_ZERO = 10.0  # deg
_OFF_CENTRE = math.radians(10.0)
_SMALL = {"angle": math.radians(3.0), "pulse_width": 30e-6}
_LARGE = {"angle": math.radians(45.0), "pulse_width": 450e-6}


def wrong_of(log: Log, clock: Clock, values: Values, motion: Motion) -> Iterator[str]:
    """Give what cannot be right, each in one sentence."""
    angle = log.measured[log.angle_name]
    seen = angle[np.isfinite(angle)]
    failed = _failed(log, angle)
    count = int(failed.sum())
    if count:
        at, half = float(log.time[np.argmax(failed)]), 0.5 * clock.period
        yield (f"{count} {'reading' if count == 1 else 'readings'} of the angle, the first at {at:.4g} s, far from "
               "those before and after, as no servo moves: the sensor failed there; "
               f"--leave-out {max(at - half, 0.0):.4g}..{at + half:.4g} leaves one out")
        seen = angle[np.isfinite(angle) & ~failed]
    jumps = int((np.abs(np.abs(np.diff(seen)) - _TURN) < 0.25 * _TURN).sum()) if log.angle_name == "output_angle" else 0
    if jumps:
        yield (f"the angle jumps by a whole turn, {jumps} times: a sensor that begins again; servotwin fit ... --mend "
               "wrap joins the pieces")
    elif np.fmax(motion.speed, np.ptp(seen) / log.duration) > _FASTEST and log.angle_name == "output_angle":
        speed = float(np.fmax(motion.speed, np.ptp(seen) / log.duration))
        yield (f"the shaft turns at {math.degrees(speed):.0f} deg/s, faster than any servo: look at the "
               f"units of angle and time ({clock.period:.3g} s a row)")
    if not len(log.changes) and motion.onset > _LATE and not _defined(log):
        yield (f"the shaft begins to move {motion.onset:.2g} s after the first row, and the command never changes: "
               "look which column is the command")
    if log.angle_name == "output_angle":
        yield from _against(log, motion)
    if values.flat_low or values.flat_high:
        ends = [f"{count} rows stand at {'the lowest' if low else 'the highest'} value"
                for count, low in ((values.flat_low, True), (values.flat_high, False)) if count]
        yield f"{' and '.join(ends)} without noise: the sensor is at the end of its range, or the shaft on a stop"
    yield from _stands(log, angle, values)
    moves = [float(np.mean(np.diff(each) != 0.0)) for each in (angle, log.held)]
    if moves[0] < _SELDOM < _OFTEN < moves[1] and motion.lag < 0.5 * clock.period:
        yield ("the angle jumps and stands, the command moves in each row and comes no earlier: are they each other's "
               "columns?")
    if motion.lag < 0.0 and motion.steps == 0 and abs(motion.correlation) > _CLEAR:
        yield (f"the angle comes {-1e3 * motion.lag:.0f} ms before the command: the columns have two clocks, or the "
               "command was logged late")


def _stands(log: Log, angle: NDArray[np.float64], values: Values) -> Iterator[str]:
    """Give where a reading stays the same to the last digit, of a sensor with noise, long after the command moved."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.diff(angle) == 0.0, [False]]).astype(int)))
    runs = [(first, last) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
            if last - first >= _STUCK]
    others = np.ones(len(angle), np.bool_)
    for first, last in runs:
        others[first:last + 1] = False
    if not rough_noise(angle[others & np.isfinite(angle)]) > _MUCH_NOISE * values.step > 0.0:
        return
    for first, last in runs:
        moved = np.abs(log.held[first:last + 1] - log.held[first]) > _LARGE.get(log.command_kind, math.inf) / 10.0
        if moved.any() and log.time[last] - log.time[first + np.argmax(moved)] > _ARRIVED:
            start, stop = float(log.time[first]), float(log.time[last])
            yield (f"the angle stays the same to the last digit from {start:.4g} to {stop:.4g} s, while the command "
                   f"moves on: the sensor stood still there; --leave-out {start:.4g}..{stop:.4g} leaves that out")


def _failed(log: Log, angle: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which samples of an angle lie alone: further from both neighbours, on one side, than any servo goes."""
    step, apart = np.diff(angle), np.diff(log.time)
    turns = np.abs(np.abs(step) - _TURN) < _OFF_CENTRE  # noise where a sensor begins again
    fast = (np.abs(step) > _FASTEST * apart + _ALONE) & ~turns
    found = np.zeros(len(angle), np.bool_)
    if log.angle_name == "output_angle":
        found[1:-1] = fast[:-1] & fast[1:] & (step[:-1] * step[1:] < 0.0)
    return found


def _slow(log: Log) -> bool:
    """Tell whether each command is held for so long that any servo would have followed it."""
    return bool(np.min(np.diff([log.start, *log.time[log.changes]]), initial=math.inf) > _ARRIVED)


def _defined(log: Log) -> bool:
    """Tell whether the command was said, and is none of the file."""
    return log.reading is not None and any(is_defined(one.column) for name, one in log.reading.layout.items()
                                           if name in COMMANDS)


def _against(log: Log, motion: Motion) -> Iterator[str]:
    """Give what is wrong between angle and command."""
    gain, kind = motion.gain, log.command_kind
    moves = np.ptp(log.held) > _LARGE.get(kind, math.inf) / 3.0
    if not math.isfinite(gain) or abs(motion.correlation) < _CLEAR:
        if moves and not motion.still and motion.steps and _slow(log):
            yield "the angle does not follow the command: look at wiring and supply, and which column is which"
        elif moves and motion.still:
            yield "the command moves and the shaft does not: look at wiring and supply"
        return
    if gain < 0.0:
        yield (f"the angle falls where the command grows; unless the servo is built in reverse, "
               f"{_say(log, -1.0, motion)} turns it")
    if abs(motion.correlation) < _SURE:
        return
    if kind == "angle":
        known = next((what for factor, what in _SCALES.items() if abs(math.log(abs(gain) / factor)) < _NEAR), "")
        soft = abs(gain) < 1.0 and bool(log.load.pendulums or log.load.springs or log.load.recorded)
        if not soft and (known or not _USUAL[0] < abs(gain) < _USUAL[1]):
            yield (f"the shaft moves {abs(gain):.3g} times as far as it is asked to{f': {known}' if known else ''}; "
                   f"{_say(log, 1.0 / gain)} puts that right if the command is right")
        elif abs(motion.zero - _CENTRE) < _OFF_CENTRE and log.held.min() >= 0.0:
            yield (f"the angle is 0 where the command is {math.degrees(motion.zero):.0f} deg: the command counts from "
                   f"an end, as servo.write does; {_say_command(log)} counts it from the centre")
    elif kind == "pulse_width" and not _PULSE_GAINS[0] < abs(gain) < _PULSE_GAINS[1]:
        yield (f"the shaft turns {math.degrees(gain) * 1e-6:.3g} deg per us of pulse, and servos 0.05 to 0.2: look at "
               "the unit of the angle")


def _say(log: Log, factor: float, motion: Motion | None = None) -> str:
    """Return the words of --columns that multiply the angle; one that is turned keeps the zero of its command."""
    column = None if log.reading is None else log.reading.layout.get(log.angle_name)
    if column is None:
        return "a scale of the angle"
    zero = 0.0 if motion is None or log.command_kind != "angle" or column.unit != "deg" else math.degrees(motion.zero)
    zero = 0.0 if abs(zero) < _OFF_ZERO else round(zero)
    scale, offset = (float(f"{value:.4g}") for value in (factor * column.scale, factor * column.offset + zero))
    shown = unit_shown(column.unit, scale, offset)
    return f'--columns "angle={column.column}:{shown}"'


def _say_command(log: Log) -> str:
    name = next(name for name, kind in COMMANDS.items() if kind == log.command_kind)
    column = None if log.reading is None else log.reading.layout.get(name)
    if column is None:
        return "a zero of the command"
    return f'--columns "command={column.column}:{unit_shown(column.unit, column.scale, column.offset - 90.0)}"'


def missing_of(log: Log, clock: Clock, motion: Motion) -> Iterator[str]:
    """Give the experiments that a log lacks, each with what it would tell."""
    held, changes = log.held, log.changes
    sizes = np.abs(np.diff(held))[np.diff(held) != 0.0]
    small, large = _SMALL.get(log.command_kind, math.nan), _LARGE.get(log.command_kind, math.nan)
    if motion.still or not len(changes):
        if motion.still:
            yield "a motion: steps of the command of 10 to 60 deg, there and back, each held for a second"
            return
        yield "a command that changes within the log, and a column that says when: the dead time hangs on it"
    elif log.time[changes[0]] - log.start < 0.2:
        yield "rest before the first command, 0.3 s or more: it tells noise and zero"
    if len(sizes) and math.isfinite(large):
        if np.ptp(held) < large:
            yield "a large step, 60 deg or more: it tells the speed"
        if motion.steps and not (sizes <= small).any():
            yield "small steps, 0.2 to 3 deg both ways, each held for a second: they tell deadband, play and friction"
        if not ((np.diff(held) > 0.0).any() and (np.diff(held) < 0.0).any()):
            yield "the way back: friction, play and droop differ by direction"
    if not any(name in log.measured for name in ("supply_current", "armature_current")):
        yield "a current (0.1 ohm in the supply line, or an INA219): it tells torque from speed"
    if log.load == Load():
        yield "the same motion with a known weight on an arm (a sidecar says which): it tells the torque"
    if clock.period > 0.021:
        yield f"more rows: one each {1e3 * clock.period:.0f} ms hides what happens within a frame; 5 to 20 ms tell it"
