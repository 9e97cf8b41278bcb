"""What is possible but odd in what is to be simulated: one warning for each, before anything runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from servotwin.parameters import printed_flags, printed_points

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from servotwin.parameters import Servo
    from servotwin.signals import Signal

_TOO_MUCH = 2.0  # times the supply voltage of the sheet


def warn_of(servo: Servo, commands: Sequence[Signal], duration: float, *, voltages: ArrayLike | None = None,
            stacklevel: int = 3) -> None:
    """Warn of a servo whose sheet is impossible, of a supply that is far too high, and of commands that come too late.

    Parameters
    ----------
    servo : Servo
    commands : sequence of Signal
    duration : float
        Of the run [s].
    voltages : array_like, optional
        Of the supplies of all lanes [V]; the servo's own unless given.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    for text in (*_of_servo(servo, voltages), *_of_commands(commands, duration)):
        warnings.warn(text, stacklevel=stacklevel)


def _of_servo(servo: Servo, voltages: ArrayLike | None) -> Iterator[str]:
    reason = next((flag for flag in printed_flags(servo) if flag.startswith("impossible")), None)
    if reason is not None:
        yield (f"{servo.name}: its data sheet contradicts itself ({reason}); no servo has all that it says, nor does "
               "this one")
    given = servo.supply.open_circuit_voltage if voltages is None else float(np.max(voltages))
    printed = [point.supply_voltage for point in printed_points(servo) if point.supply_voltage is not None]
    rated = max(printed, default=None)
    if given is not None and rated is not None and given > _TOO_MUCH * rated:
        yield f"{servo.name}: a supply of {given:g} V is more than twice the {rated:g} V of its data sheet"


def _of_commands(commands: Sequence[Signal], duration: float) -> Iterator[str]:
    late = [(k, start) for k, start in enumerate(map(first_change, commands)) if start is not None
            and start >= duration]
    if late:
        k, start = late[0]
        which = "the command" if len(commands) == 1 else f"command {k}"
        more = f" (and those of {len(late) - 1} more)" if len(late) > 1 else ""
        what = "the first pulse" if commands[k].edges is not None else "the first change"
        yield f"{what} of {which}{more} comes at {start:g} s, when the run of {duration:g} s is over"


def first_change(command: Signal) -> float | None:
    """Return when a command changes first, or its first pulse comes [s]; None where it never changes.

    A single pulse that comes late is how a servo is left without pulses.

    Examples
    --------
    >>> from servotwin.signals import constant, pulse_train, step
    >>> first_change(step(0.0, 90.0, at=2.0, unit="deg")), first_change(constant(1500.0, unit="us"))
    (2.0, None)
    >>> first_change(pulse_train([0.5, 0.52], [1500.0, 1500.0]))
    0.5
    """
    if command.edges is not None:
        return command.edges[0] if len(command.edges) > 1 else None
    first, *rest = command.pieces.table
    if first.slope or first.amplitude:
        return first.start
    return rest[0].start if rest else None
