"""How warm the servos of a robot get, in a motion and where it goes on for ever."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.conditions import at_temperatures, changed
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.warming import WIRE_LIMIT, Masses, thermal_masses
from servotwin.errors import InputError
from servotwin.physics import Temperatures, winding_resistance
from servotwin.physics.thermal import COPPER_COEFFICIENT, copper_loss
from servotwin.robots.mount import Mount

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.robots.record import ServoRecord

Array = NDArray[np.float64]
_NUMBERS = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient", "ambient",
            "magnet_coefficient")
_DUTIES = ("firmware.torque_limit", "firmware.duty_limit")
_LONGEST = 3600.0  # s; what is not too hot by then never gets so
_SOON = 600.0  # s
_STEPS = 720
_MELTED = 1e4  # K; beyond it numbers say nothing


@dataclass(frozen=True, kw_only=True)
class Heating:
    """How warm a servo gets whose motion is repeated without a pause.

    Parameters
    ----------
    heat : float
        Mean of i² R over the motion [W].
    winding, housing : float
        Temperatures to which they come in the end; inf where there is none [K].
    limit_time : float
        When the winding passes 130 °C, beginning cool; nan where it does not within an hour [s].
    trip_temperature : float
        Of the housing, at which the program trips; inf where it does not [K].
    trip_time : float
        When it gets so hot, likewise [s].
    soon : Temperatures
        After ten minutes, beginning cool [K].
    masses : Masses
    """

    heat: float
    winding: float
    housing: float
    limit_time: float
    trip_temperature: float
    trip_time: float
    soon: Temperatures
    masses: Masses


def with_heat(model: Model) -> Model:
    """Return a model whose winding and housing get warm, with thermal masses assumed by its mass if it has none.

    A servo of which the mass is not known either stays as it is, and so does a model without temperatures.

    Examples
    --------
    >>> import servotwin as st
    >>> "winding_temperature" in with_heat(st.PulseServo(st.load_servo("hitec-hs-755hb"))).available
    True
    """
    masses = thermal_masses(model.servo)
    if masses is None or not masses.assumed or "thermal.winding_capacity" not in model.optional:
        return model
    return changed(model, {f"thermal.{name}": getattr(masses, name) for name in _NUMBERS})


def warm_mounts(servos: Mapping[str, Model | Mount], *, assume_heat: bool, shared: bool) -> dict[str, Mount]:
    """Return mounts of servos, with thermal numbers by their mass where that is asked for and possible."""
    if not isinstance(servos, Mapping) or not servos:
        raise InputError("servos of a robot", got=servos, allowed="a mapping of joints to models")
    found = {name: given if isinstance(given, Mount) else Mount(given) for name, given in servos.items()}
    if not assume_heat:
        return found
    warm: dict[int, Model] = {id(mount.model): with_heat(mount.model) for mount in found.values()}
    known = [model.servo.thermal.winding_capacity is not None for model in warm.values()]
    if shared and not all(known):  # servos on a shared supply all have thermal masses, or none
        return found
    return {name: replace(mount, model=warm[id(mount.model)]) for name, mount in found.items()}


def heat_notes(given: Mapping[str, Model | Mount], mounts: Mapping[str, Mount]) -> tuple[str, ...]:
    """Return sentences on thermal numbers that mounts have and their servos were given without, and on none at all."""
    assumed, unknown = [], []
    for joint, mount in mounts.items():
        servo = given[joint]
        own = servo.model if isinstance(servo, Mount) else servo
        if mount.model is not own:
            assumed.append(joint)
        elif "thermal.winding_capacity" in own.optional and "winding_temperature" not in own.available:
            unknown.append(joint)
    said = []
    if assumed:
        said.append(f"thermal numbers of {', '.join(assumed)} are assumed by the servo's mass")
    if unknown:
        said.append(f"temperatures of {', '.join(unknown)} are not known: the servo has no thermal numbers, and no "
                    "mass either, or shares its supply with such a one")
    return tuple(said)


def mean_heat(record: ServoRecord, masses: Masses, since: float, until: float) -> float:
    """Return the mean heat of a winding between two times [W]: what both masses have kept and given to the air.

    Samples of a current that flows in short pulses would not tell. A model without temperatures has no such pulses.
    """
    inside = (record.time >= since) & (record.time <= until)
    time = record.time[inside]
    if time.size < 2:
        return math.nan
    if "winding_temperature" not in record:
        R = record.mount.model.value("motor.armature_resistance")
        return copper_loss(math.sqrt(float(np.mean(record["armature_current"][inside]**2))), R)
    winding, housing = record["winding_temperature"][inside], record["housing_temperature"][inside]
    lost = float(np.trapezoid(housing - masses.ambient, time)) / masses.housing_to_ambient
    kept = masses.winding_capacity * (winding[-1] - winding[0]) + masses.housing_capacity * (housing[-1] - housing[0])
    return max((float(kept) + lost) / float(time[-1] - time[0]), 0.0)


def heating(heat: float, mean_winding: float, masses: Masses, trip_temperature: float = math.inf) -> Heating:
    """Return how warm a servo gets that goes on making a heat [W], which grows with the resistance of its copper.

    Parameters
    ----------
    heat : float
        While the winding was at `mean_winding` [W]
    mean_winding : float
        [K]
    masses : Masses
    trip_temperature : float
        Of the housing, at which the servo's program trips [K]

    Examples
    --------
    >>> from servotwin.datasheet.warming import masses_by_mass
    >>> cool, hot = (heating(heat, 298.15, masses_by_mass(0.055)) for heat in (0.5, 3.0))
    >>> round(cool.winding), cool.limit_time, hot.winding > 403.15, round(hot.limit_time)
    (315, nan, True, 553)
    """
    per_watt = masses.winding_to_housing + masses.housing_to_ambient
    cold = heat / float(winding_resistance(mean_winding, 1.0))  # at the reference temperature
    slope = COPPER_COEFFICIENT * cold * per_watt
    first = cold * per_watt * float(winding_resistance(masses.ambient, 1.0))
    rise = math.inf if slope >= 1.0 else first / (1.0 - slope)
    winding_time, housing_time, soon = _passing(cold, masses, WIRE_LIMIT, trip_temperature)
    return Heating(
        heat=heat, winding=masses.ambient + rise, housing=masses.ambient + rise * masses.housing_to_ambient / per_watt,
        limit_time=winding_time, trip_temperature=trip_temperature, trip_time=housing_time, soon=soon,
        masses=masses)


def _passing(cold: float, masses: Masses, winding: float, housing: float) -> tuple[float, float, Temperatures]:
    """Return when winding and housing pass temperatures [K], of a heat [W] made at the reference temperature.

    And the temperatures after ten minutes.
    """
    now, step, found = Temperatures(masses.ambient, masses.ambient), _LONGEST / _STEPS, [math.nan, math.nan]
    soon = now
    for k in range(_STEPS):
        if now.winding > _MELTED:
            break
        after = masses.after(step, cold * float(winding_resistance(now.winding, 1.0)), now)
        for at, (limit, old, new) in enumerate(zip((winding, housing), now, after, strict=True)):
            if math.isnan(found[at]) and new > limit:
                found[at] = step * (k + float((limit - old) / (new - old)))
        now = Temperatures(float(after.winding), float(after.housing))
        soon = now if (k + 1) * step <= _SOON else soon
    return found[0], found[1], soon


def lasting_torque(model: Model, masses: Masses) -> float:
    """Return the torque that a servo can lift slowly without end: its winding comes to 130 °C [N m].

    Where it holds still instead, friction helps it. 0 where that current does not move the shaft, nan of a model that
    knows no limit of current.
    """
    if "supply.current_limit" not in model.optional:
        return math.nan
    hot = masses.with_winding(WIRE_LIMIT)
    warm = at_temperatures(model, hot, masses.magnet_coefficient)
    allowed = (WIRE_LIMIT - masses.ambient) / (masses.winding_to_housing + masses.housing_to_ambient)
    limit = math.sqrt(allowed / warm.value("motor.armature_resistance"))
    # At full duty the current of the supply is that of the motor; what the program's own duty gives is the other bound.
    free = {name: None for name in _DUTIES if warm.servo.get(name) is not None}
    try:
        by_heat = FullDrive(changed(warm, {**free, "supply.current_limit": limit})).stall_torque
        return min(by_heat, FullDrive(warm).stall_torque)
    except InputError:  # the shaft does not turn by it
        return 0.0
