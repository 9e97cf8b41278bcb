"""What is possible but odd in what is to be simulated: one warning for each, before anything runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.parameters import printed_flags, sheet_voltages
from servotwin.signals.signal import headers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from servotwin.parameters import Servo
    from servotwin.signals import Signal

_TOO_MUCH = 2.0  # times the highest supply voltage of the sheet


def warn_of(servo: Servo, commands: Sequence[Signal], duration: float, *, voltages: ArrayLike | None = None,
            known: NDArray[Any] | None = None, stacklevel: int = 3) -> None:
    """Warn of a servo whose sheet is impossible, of a supply that is far too high, and of commands that come too late.

    Parameters
    ----------
    servo : Servo
    commands : sequence of Signal
    duration : float
        Of the run [s].
    voltages : array_like, optional
        Of the supplies of all lanes [V]; the servo's own unless given.
    known : ndarray, optional
        `headers` of the commands, where the caller has them.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    known = headers(commands) if known is None else known
    for text in (*_of_servo(servo, voltages), *_of_commands(commands, known, duration)):
        warnings.warn(text, stacklevel=stacklevel)


def _of_servo(servo: Servo, voltages: ArrayLike | None) -> Iterator[str]:
    reason = next((flag for flag in printed_flags(servo) if flag.startswith("impossible")), None)
    if reason is not None:
        yield (f"{servo.name}: its data sheet contradicts itself ({reason}); no servo has all that it says, nor does "
               "this one")
    given = servo.supply.open_circuit_voltage if voltages is None else float(np.max(voltages))
    rated = sheet_voltages(servo)
    if given is not None and rated is not None and given > _TOO_MUCH * rated[1]:
        yield f"{servo.name}: a supply of {given:g} V is more than twice the {rated[1]:g} V of its data sheet"


def _of_commands(commands: Sequence[Signal], known: NDArray[Any], duration: float) -> Iterator[str]:
    starts = known["first_change"]
    late = np.flatnonzero(starts >= duration)
    if late.size:
        k, start = int(late[0]), float(starts[late[0]])
        which = "the command" if len(commands) == 1 else f"command {k}"
        more = f" (and those of {len(late) - 1} more)" if len(late) > 1 else ""
        what = "the first pulse" if commands[k].edges is not None else "the first change"
        yield f"{what} of {which}{more} comes at {start:g} s, when the run of {duration:g} s is over"
