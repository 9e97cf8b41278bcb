"""A servo as C: a header and a source that need nothing but a compiler."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError
from servotwin.loads import as_load
from servotwin.models import (
    AveragedServo,
    AveragedServoInductive,
    BoundedServo,
    DigitalServo,
    Model,
    PulseServo,
    PulseServoInductive,
)
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.terms import elastic
from servotwin.simulation.start import accuracy_of
from servotwin.text import LONGEST_STEM, identifier, is_taken

if TYPE_CHECKING:

    from servotwin.loads import Load, Part
from servotwin.export.c_writing import CCode, Writing

_NAME = re.compile(rf"[a-z][a-z0-9_]{{0,{LONGEST_STEM - 1}}}")
_KNOWN = (AveragedServo, AveragedServoInductive, BoundedServo, PulseServo, PulseServoInductive, DigitalServo)
_IN_FLOATS, _FINEST_IN_FLOATS = 1e-5, 1e-6  # rad: accuracy unless another is asked for, and what rounding allows


def c(model: Model, load: Load | Part | None = None, *, name: str | None = None, accuracy: float | None = None,
      parameters: bool = False, dtype: str = "float64") -> CCode:
    """Return a servo as C: a header and a source of functions that start it, advance it, and look at it.

    They compute the same as `Simulator`, of the same kernels. The numbers of servo and load stand in a table;
    what these numbers have no use for is left out of the code.

    Parameters
    ----------
    model : Model
        Any but the two motors.
    load : Load, optional
        Load on the shaft; none unless given. A recorded torque is given at each call instead.
    name : str, optional
        Of the files, and the beginning of all names in them; that of the servo unless given.
    accuracy : float, optional
        Error that angles may have where motions are integrated [rad]: 1e-9 unless given, in floats 1e-5.
    parameters : bool
        Whether there is a function too that makes the numbers of the parameters of a servo file.
    dtype : str
        "float64", or "float32" for processors that have instructions for floats alone: angles are good to some
        1e-5 rad (of a servo on a bus to some counts, as each count decides), and times in the calls stay doubles. Not
        for programs that pulses tell their goals, for a spring between two bodies, nor with `parameters`.

    Returns
    -------
    CCode

    Raises
    ------
    InputError
        If there is no C for the model or the load, the name is none that C can have, or floats are not for it.

    Examples
    --------
    >>> import servotwin as st
    >>> code = c(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> code.name
    'hitec_hs_755hb'
    >>> "int hitec_hs_755hb_advance(" in code.header
    True
    """
    if not isinstance(model, _KNOWN):
        got = type(model).__name__
        raise InputError("export c", got=got, allowed="one of " + ", ".join(kind.__name__ for kind in _KNOWN))
    hung = as_load(load)
    if hung.recorded:
        raise InputError("export c", got="a recorded torque", allowed="loads without one: torque is told at each call")
    floats = _checked_floats(dtype, model, hung, accuracy=accuracy, parameters=parameters)
    name = identifier(model.servo.name) if name is None else name
    if not isinstance(name, str) or not _NAME.fullmatch(name) or is_taken(name):
        raise InputError("export c: name", got=name, allowed="small letters, digits and _, a letter first, at most "
                         f"{LONGEST_STEM}, and not the name of a header such as math")
    accuracy = accuracy_of((_IN_FLOATS if floats else ACCURACY) if accuracy is None else accuracy)
    return Writing(model, hung, name, accuracy, makes=parameters, floats=floats).code()


def _checked_floats(dtype: str, model: Any, load: Load, *, accuracy: float | None, parameters: bool) -> bool:
    """Tell whether a servo shall be written in floats."""
    if dtype not in ("float64", "float32"):
        raise InputError("dtype", got=dtype, allowed='"float64" or "float32"')
    if dtype == "float64":
        return False
    if isinstance(model, DigitalServo) and not model.takes_goals:
        raise InputError("dtype", got=f"{dtype} for a program that pulses tell its goals", allowed="float64")
    if elastic.present(model.pack(load).elastic):
        raise InputError("dtype", got=f"{dtype} for a spring between two bodies", allowed="float64")
    if parameters:
        raise InputError("dtype", got=f"{dtype} with parameters", allowed="float64, or a table alone")
    if accuracy is not None and accuracy < _FINEST_IN_FLOATS:
        raise InputError("accuracy", got=accuracy, allowed=f"at least {_FINEST_IN_FLOATS:g} rad in float32")
    return True


def table_for(model: Model, load: Load | Part | None = None, accuracy: float = ACCURACY) -> tuple[float, ...]:
    """Return `CCode.table` of a servo, without its code."""
    return Writing(model, as_load(load), "", accuracy_of(accuracy), makes=False, floats=False).table
