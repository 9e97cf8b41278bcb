"""The gains that a servo can be given: P and D of its program by register, or by number where it has no register."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np

from servotwin.models import DigitalServo, PulseServo, PulseServoInductive
from servotwin.parameters import REGISTER_FAMILIES

_TRIED = 60  # P gains for each D, evenly by their logarithm
_RANGE = (0.02, 50.0)  # of P without a register, over what the servo has
_NEXT = 1e-4  # of a gain: nothing is between two that are nearer
_LEADS = (0.0, 0.005, 0.01, 0.02, 0.04)  # s, D over P without a register; as long as ticks and motors take


class _Names(NamedTuple):
    P: str
    D: str
    most: int
    tried: tuple[int, ...]  # of D


_REGISTERS = {
    "feetech-sts": _Names("P_Coefficient", "D_Coefficient", 254, (0, 8, 16, 32, 64, 128, 254)),
    "dynamixel-x": _Names("Position_P_Gain", "Position_D_Gain", 16383, (0, 250, 500, 1000, 2000, 4000, 8000, 16000)),
    **dict.fromkeys(("dynamixel-mx", "dynamixel-xl320"), _Names("P_Gain", "D_Gain", 254, (0, 8, 16, 32, 64, 128, 254))),
}


class Gain(NamedTuple):
    """A servo with other gains, or with a loop around it: what was set, and to what."""

    settings: dict[str, float]
    model: DigitalServo | PulseServo | PulseServoInductive


def gains_of(model: DigitalServo, *, derivative: bool) -> list[list[Gain]]:
    """Return servos with other gains P, growing, in a list for every D; that of the servo alone unless asked."""
    names = _REGISTERS.get(str(model.servo.sheet.get("registers")))
    if names is None:
        return _by_number(model, derivative=derivative)
    values = np.unique(np.round(np.geomspace(1.0, names.most, 2 * _TRIED)).astype(int)).tolist()
    own: tuple[int | None, ...] = names.tried if derivative else (None,)
    return [[_set(model, names, P, D) for P in values] for D in own]


def _set(model: DigitalServo, names: _Names, P: int, D: int | None) -> Gain:
    settings = {names.P: P} | ({} if D is None else {names.D: D})
    with warnings.catch_warnings():  # of registers that were not asked for
        warnings.simplefilter("ignore")
        servo = REGISTER_FAMILIES[str(model.servo.sheet["registers"])](settings, servo=model.servo)
    return Gain(dict(settings), DigitalServo(servo))


def _by_number(model: DigitalServo, *, derivative: bool) -> list[list[Gain]]:
    P_own = model.value("firmware.proportional_gain")
    found = []
    for lead in _LEADS if derivative else (None,):
        row = []
        for P in (P_own * np.geomspace(*_RANGE, _TRIED)).tolist():
            settings = {"firmware.proportional_gain": P}
            if lead is not None:
                settings["firmware.derivative_gain"] = lead * P
            row.append(Gain(settings, DigitalServo(model.servo.replace(settings))))
        found.append(row)
    return found


def between(low: Gain, high: Gain) -> Gain | None:
    """Return a gain between two of one row, or around one servo; None where nothing is between them.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> between(Gain({"outer_gain": 0.1}, model), Gain({"outer_gain": 0.4}, model)).settings
    {'outer_gain': 0.2}
    """
    model = low.model
    names = _REGISTERS.get(str(model.servo.sheet.get("registers")))
    if names is not None and names.P in low.settings and isinstance(model, DigitalServo):
        P = int(low.settings[names.P] + high.settings[names.P]) // 2
        D = low.settings.get(names.D)
        return None if P == low.settings[names.P] else _set(model, names, P, None if D is None else int(D))
    if all(high.settings[name] <= value * (1.0 + _NEXT) for name, value in low.settings.items()):
        return None
    settings = {name: math.sqrt(value * high.settings[name]) for name, value in low.settings.items()}
    return Gain(settings, DigitalServo(model.servo.replace(settings)) if isinstance(model, DigitalServo) else model)
