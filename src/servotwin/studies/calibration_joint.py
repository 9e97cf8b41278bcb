"""Pulse and angle: the potentiometer and the chip's one-shot share a scale, and only their product turns the shaft."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from servotwin.parameters import Quantity, Servo
from servotwin.physics import averaged_bridge_gain
from servotwin.studies.joint import (
    TINY,
    Column,
    Coordinate,
    Joint,
    holds,
    number,
    own_spread,
    scaled_spread,
)
from servotwin.studies.kinds import Distribution, Normal, Uniform

_GAIN, _OFFSET = "potentiometer.feedback_gain", "potentiometer.feedback_offset"
_SLOPE, _BEGIN, _BACK = ("electronics.one_shot_slope", "electronics.one_shot_offset",
                         "electronics.pulse_to_voltage_gain")
_BESIDE, _START = "electronics.command_offset", "electronics.command_pulse_offset"
_K, _FRAME, _WIDTH = "electronics.stretcher_gain", "electronics.frame_period", "electronics.deadband"
_SUPPLY, _DROP = "supply.open_circuit_voltage", "supply.bridge_drop_voltage"
_RATE, _ZERO = "calibration.angle_per_pulse", "calibration.zero_pulse"


class CalibrationJoint(Joint):
    """Angle per pulse width 1/(p · one_shot_slope) and pulse at angle 0, T_0 + one_shot_slope · b_o, of a servo.

    The slope is drawn for itself: p and b_o follow, so that a pulse means the same angle whatever it is. What the
    averaged models have of the chip follows too, as far as it does so in the file: k_p2 = 1/slope, the offset b_i, the
    deadband w/slope in volts, and A k_s = (V_oc − V_ce0) K slope/T_f.

    Parameters
    ----------
    servo : Servo

    Examples
    --------
    >>> import servotwin as st
    >>> joint = CalibrationJoint(st.load_servo("hitec-hs-485hb"))
    >>> round(joint.coordinates["calibration.zero_pulse"].nominal * 1e6)
    1500
    """

    def __init__(self, servo: Servo) -> None:
        self._servo = servo
        self._laws: dict[str, float] = {}  # what follows besides p and b_o -> its value over the relation
        self.coordinates: dict[str, Coordinate] = {}
        self.covers = frozenset[str]()
        slope = number(servo, _SLOPE, 1.0 / number(servo, _BACK))
        gain = number(servo, _GAIN)
        if not (math.isfinite(gain) and math.isfinite(slope)):
            return
        self._per_angle, self._slope = gain * slope, slope
        # Where the chip's own offset is not given, that of the control voltage stands for it
        self._begin = number(servo, _BEGIN, 0.0 if servo.get(_SLOPE) is not None or servo.get(_BESIDE) is None else
                             number(servo, _START, 0.0) - number(servo, _BESIDE) * slope)
        self.coordinates[_RATE] = Coordinate(
            dimension="angle per pulse", lower=TINY, upper=math.inf, nominal=1.0 / self._per_angle,
            spread=self._of_rate())
        offset = servo.get(_OFFSET)
        if isinstance(offset, float):
            self.coordinates[_ZERO] = Coordinate(
                dimension="time", lower=TINY, upper=math.inf, nominal=self._begin + slope * offset,
                spread=self._of_zero(offset))
        for name, law in self._relations({}).items():
            value = servo.get(name)
            if isinstance(value, float) and holds(value, law()):
                self._laws[name] = value / law() if value else 1.0
        self.covers = frozenset((_GAIN, *((_OFFSET,) if _ZERO in self.coordinates else ()), *self._laws))

    def inputs(self) -> tuple[str, ...]:
        """Return the numbers of the chip that what follows is made of."""
        found = {_BACK: (_SLOPE,), _BESIDE: (_SLOPE, _BEGIN, _START),
                 "electronics.voltage_deadband": (_WIDTH, _SLOPE),
                 "electronics.bridge_gain": (_K, _FRAME, _SLOPE, _DROP)}
        return tuple(dict.fromkeys(name for law in self._laws for name in found[law]))

    def _scale(self) -> Quantity:
        """Return the slope, or where it is not given k_p2 in its place."""
        if self._servo.get(_SLOPE) is not None:
            return self._servo.source(_SLOPE)
        q = self._servo.source(_BACK)
        return Quantity(value=self._slope, unit="s/V", origin="assumed",
                        lower=None if q.upper is None else 1.0 / q.upper,
                        upper=None if q.lower is None else 1.0 / q.lower)

    def _of_rate(self) -> Distribution | None:
        found, nominal = scaled_spread(self._servo.source(_GAIN), self._scale(), 1.0), 1.0 / self._per_angle
        if isinstance(found, Normal):
            return Normal(nominal, nominal * found.std)
        return Uniform(nominal / found.upper, nominal / found.lower) if isinstance(found, Uniform) else None

    def _of_zero(self, offset: float) -> Distribution | None:
        quantity, slope, begin = self._servo.source(_OFFSET), self._slope, self._begin
        found = scaled_spread(quantity, self._scale(), slope * offset) if offset else own_spread(quantity, slope)
        if isinstance(found, Normal):
            return Normal(begin + found.mean, found.std)
        return Uniform(begin + found.lower, begin + found.upper) if isinstance(found, Uniform) else None

    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return what follows of potentiometer and chip."""
        active = any(name in drawn for name in self.coordinates)
        chip = [name for name in self._laws if (name == "electronics.bridge_gain" and _K in drawn)
                or (name == "electronics.voltage_deadband" and _WIDTH in drawn)]
        if not active and not chip:
            return {}
        found: dict[str, Any] = {}
        slope, begin = self._chip(drawn)
        if active:
            found[_GAIN] = 1.0 / (drawn.get(_RATE, 1.0 / self._per_angle) * slope)
        if active and _ZERO in self.coordinates:
            found[_OFFSET] = (drawn.get(_ZERO, self.coordinates[_ZERO].nominal) - begin) / slope
        relations = self._relations(drawn)
        found |= {name: factor * relations[name]() for name, factor in self._laws.items() if active or name in chip}
        return {name: column for name, column in found.items() if not isinstance(column, float)}

    def _chip(self, drawn: Mapping[str, Column]) -> tuple[Any, Any]:
        """Return slope and offset of the one-shot."""
        if self._servo.get(_SLOPE) is None and _BACK in drawn:
            return 1.0 / drawn[_BACK], drawn.get(_BEGIN, self._begin)
        return drawn.get(_SLOPE, self._slope), drawn.get(_BEGIN, self._begin)

    def _relations(self, drawn: Mapping[str, Column]) -> dict[str, Callable[[], Any]]:
        """Return what the averaged models have of the chip, by name; k_p2 where it does not stand for the slope."""
        slope, begin = self._chip(drawn)

        def of(name: str) -> Any:
            return drawn.get(name, number(self._servo, name))

        gain = number(self._servo, "electronics.comparator_gain", 1.0)
        known = {} if self._servo.get(_SLOPE) is None else {_BACK: lambda: 1.0 / slope}
        return {**known, _BESIDE: lambda: (drawn.get(_START, number(self._servo, _START, 0.0)) - begin) / slope,
                "electronics.voltage_deadband": lambda: of(_WIDTH) / slope,
                "electronics.bridge_gain": lambda: averaged_bridge_gain(
                    of(_SUPPLY), drawn.get(_DROP, number(self._servo, _DROP, 0.0)), of(_K), of(_FRAME), slope) / gain}
