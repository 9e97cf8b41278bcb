"""From a sheet to a servo: every parameter with its origin, its source and its range.

τ_m = J R/K_out² of an assembled servo, J with the wheels of its gear, is 36 to 52 ms of identified XL330, XL-320 and
STS3215, 19 to 22 ms of the Miuzei 25 kg and an MG90S, 11 to 18 ms of MX-64 and MX-106, whose motors are coreless. From
rest 60° take about τ_m longer than at full speed, so that the printed time for 60° bounds it too.
"""

from __future__ import annotations

import math
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from servotwin.errors import InputError
from servotwin.identification.sheets.motor_range import (
    Contradiction,
    MotorRange,
    Range,
    current_ratios,
    motor_range,
    seconds,
    sheet_contradictions,
    sheet_flags,
    torque_question,
)
from servotwin.identification.sheets.sheet import Sheet, sheet_table
from servotwin.parameters import GROUPS, KINDS, REGISTER_FAMILIES, Quantity, Servo, unit_of
from servotwin.physics import averaged_bridge_gain, load_share

# --- The rotor of a servo whose sheet does not tell it ----------------------------------------------------------------

CORED = Range(value=25e-3, lower=12e-3, upper=55e-3)  # s, iron-core brushed motors; assumed
CORELESS = Range(value=12e-3, lower=5e-3, upper=20e-3)  # s, coreless and brushless ones; assumed
SHARE, MOST_SHARE = 0.35, 0.6  # of the time for 60°: what τ_m is at most, and the end of its range
_LIGHT = re.compile(r"(core|iron|brush|slot)[\s-]?less|bldc|hollow[\s-]?cup", re.IGNORECASE)


def is_coreless(motor_type: str) -> bool:
    """Return whether words for a motor mean a coreless or a brushless one; without words it is one with an iron core.

    Examples
    --------
    >>> [is_coreless(words) for words in ("coreless", "Brushless", "3-pole", "iron core", "brushed", "")]
    [True, True, False, False, False, False]
    """
    return _LIGHT.search(motor_type) is not None


def time_constant(motor_type: str, time_60: float) -> Range:
    """Return the mechanical time constant that is assumed [s].

    Parameters
    ----------
    motor_type : str
        As the sheet says it.
    time_60 : float
        Printed time for 60° at the voltage of the servo [s].

    Examples
    --------
    >>> time_constant("", 0.2)
    Range(value=0.025, lower=0.012, upper=0.055)
    >>> found = time_constant("coreless", 0.02)
    >>> round(found.value, 6), round(found.lower, 6), round(found.upper, 6)
    (0.007, 0.002917, 0.012)
    """
    usual = CORELESS if is_coreless(motor_type) else CORED
    value = min(usual.value, SHARE * time_60)
    return Range(value=value, lower=value * usual.lower / usual.value, upper=min(usual.upper, MOST_SHARE * time_60))


def assumed_inertia(motor_type: str, time_60: float, output_torque_constant: float, resistance: float) -> Range:
    """Return the inertia of rotor and gear that is assumed, at the output: τ_m K_out²/R [kg m²].

    Parameters
    ----------
    motor_type : str
    time_60 : float
        [s].
    output_torque_constant : float
        K_out = N k_a [N m/A].
    resistance : float
        R of the circuit, bridge and wiring included [ohm].

    Examples
    --------
    >>> round(assumed_inertia("", 0.23, 1.04, 3.04).value, 5)
    0.00889
    """
    tau, by = time_constant(motor_type, time_60), output_torque_constant**2 / resistance
    return Range(value=tau.value * by, lower=tau.lower * by, upper=tau.upper * by)


def rotor_source(motor_type: str, time_60: float) -> str:
    """Return by which rule it is assumed, for people."""
    usual = CORELESS if is_coreless(motor_type) else CORED
    kind = "coreless and brushless" if usual is CORELESS else "iron-core"
    value = 1e3 * time_constant(motor_type, time_60).value
    return (f"no source: J R/K_out^2 of {value:.3g} ms, over gear_reduction^2; "
            f"{1e3 * usual.value:g} ms ({1e3 * usual.lower:g} to {1e3 * usual.upper:g}) for {kind} motors, at most "
            f"{SHARE:g} ({MOST_SHARE:g}) of the printed time for 60 degrees")


# --- The firmware of a digital RC servo: no sheet says any of it, so it is assumed, with wide ranges ------------------

_GUESS = "no source: guess for digital servos"
_TURN = 200.0 * math.pi / 180.0  # rad, that the converter of the potentiometer covers
_HALF_DEADBAND = Range(value=1e-6, lower=5e-7, upper=2e-6)  # s
_SIGNAL_TIMEOUT = Range(value=0.2, lower=0.05, upper=1.0)  # s


def digital_firmware(sheet: Sheet, rate: float, said: str) -> Iterator[tuple[str, Quantity]]:
    """Yield the numbers of the group `firmware` by dotted name.

    Parameters
    ----------
    sheet : Sheet
    rate : float
        Angle per pulse width [rad/s].
    said : str
        Where that comes from.
    """
    for name, value, source in (
            ("control_period", Range(value=1e-3, lower=3e-4, upper=3e-3), _GUESS),
            ("compute_delay", Range(value=0.0, lower=0.0, upper=1e-3), _GUESS),
            ("angle_quantum", Range(value=_TURN / 4096, lower=_TURN / 16384, upper=_TURN / 1024),
             f"{_GUESS}: 200 degrees in 12 bits, 14 to 10"),
            ("filter_weight", Range(value=0.2, lower=0.05, upper=0.5), _GUESS),
            _deadband(sheet, rate, said),
            ("proportional_gain", Range(value=8.0, lower=3.0, upper=20.0), _GUESS),
            ("derivative_gain", Range(value=0.05, lower=0.0, upper=0.3), _GUESS),
            ("minimum_duty", Range(value=0.03, lower=0.0, upper=0.1), _GUESS),
            ("signal_timeout", _SIGNAL_TIMEOUT, _GUESS)):
        yield f"firmware.{name}", Quantity(
            value=_six(value.value), lower=_six(value.lower), upper=_six(value.upper), origin="assumed", source=source,
            unit=unit_of(f"firmware.{name}"))
    yield "firmware.signal_loss", Quantity(value="limp", unit="", origin="assumed",
                                           source="no source: most go limp, some hold or fail safe")


def _deadband(sheet: Sheet, rate: float, said: str) -> tuple[str, Range, str]:
    """Return the half width of the dead zone; a sheet may print the full one or the half, and does not say which."""
    w = sheet.deadband
    half = _HALF_DEADBAND if w is None else Range(value=0.5 * w, lower=0.5 * w, upper=w)
    source = f"{_GUESS}: 1 us (0.5 to 2)" if w is None else f"half of the deadband, {sheet.source_of('deadband')}"
    return ("deadband_angle", Range(value=half.value * rate, lower=half.lower * rate, upper=half.upper * rate),
            f"{source}; times {said}")


def _six(x: float) -> float:
    """Return six digits: a guess has no more."""
    return float(f"{x:.6g}")


# --- From a sheet to a servo: every parameter with its origin, its source and its range -------------------------------

_NEUTRAL = 1.5e-3  # s
_S_R = Range(value=850.0, lower=700.0, upper=1000.0)  # V/s
_CLASS = "no source: prior for servos of this class"
_K = Range(value=120.0, lower=60.0, upper=200.0)
_FRAME = 0.02  # s
_REDUCTION = Range(value=280.0, lower=150.0, upper=400.0)
_BEYOND = (10.0, 15.0, 20.0)  # degrees from the electrical travel to a stop
_DEG = math.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class _Made:
    """The source of all groups."""

    sheet: Sheet
    motor: MotorRange
    load_friction: bool
    backlash: bool

    @property
    def reduction(self) -> float:
        return self.sheet.gear_reduction if self.sheet.gear_reduction is not None else _REDUCTION.value

    @property
    def voltage(self) -> float:
        return self.sheet.nominal.supply_voltage

    @property
    def relations(self) -> str:
        """How the motor follows, in words."""
        m, points = self.motor, self.sheet.main
        at = " and ".join(f"{point.supply_voltage:g}" for point in points)
        text = f"from [sheet] at {at} V by the stall and no-load relations, drop {m.drop_voltage:g} V (0 to 0.4)"
        if not m.efficiency_from_sheet:
            text += ", gear efficiency 0.8 assumed (0.7 to 0.9)"
        if not m.current_from_sheet:
            ratios = current_ratios(self.sheet)
            text += (f", no-load current assumed ({100.0 * min(ratios):g} to {100.0 * max(ratios):g} % of the stall "
                     "current)")
        if self.sheet.others:
            text += "; range over other sources too"
        return text if m.possible else f"{text}; the sheet contradicts itself"


def servo_from_sheet(sheet: Sheet, *, load_friction: bool = True, backlash: bool = True,
                     allow_impossible: bool = False) -> Servo:
    """Return a servo that every model can run, from what a sheet says and, where it is silent, from assumptions.

    Parameters
    ----------
    sheet : Sheet
    load_friction : bool
        Whether the losses of the gear grow with the load, so that stall torque and speed are those of the sheet.
        Without them the servo is simulated in closed form, and stalls at the sheet's torque over η_g.
    backlash : bool
        Whether the play of the gear, where the sheet has it, acts.
    allow_impossible : bool
        Make a servo of a sheet that contradicts itself. Its speed is the sheet's, and its torque what current and speed
        allow; flags and notes say so.

    Returns
    -------
    Servo
        Angle 0 is the middle position; of one that turns without end the potentiometer stands there. Ranges
        hold all combinations of what is assumed, all voltages and all sources. A digital servo has a firmware that is
        assumed, with wide ranges; a bus servo the factory's registers, an encoder at its output, and neither chip nor
        potentiometer.

    Warns
    -----
    UserWarning
        If a torque so large that kgf cm were probably meant is given in N m.

    Raises
    ------
    InputError
        If the sheet contradicts itself: names the figures, and what they could be.

    Examples
    --------
    >>> from servotwin.identification import Sheet, SheetPoint
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553, no_load_current=0.285)
    >>> servo = servo_from_sheet(Sheet(name="my-servo", points=(point,), source="the box"))
    >>> servo.source("motor.armature_resistance").spread
    '2.754 to 3.724'
    """
    found = sheet_contradictions(sheet)
    if found and not allow_impossible:
        more = f" ({len(found) - 1} more of this kind)" if len(found) > 1 else ""
        raise InputError(f"impossible sheet of {sheet.name!r}: {found[0].text}{more}")
    question = torque_question(sheet)
    if question is not None:
        warnings.warn(f"sheet of {sheet.name!r}: a stall torque of {question}", stacklevel=2)
    made = _Made(sheet=sheet, motor=motor_range(sheet), load_friction=load_friction, backlash=backlash)
    quantities: dict[str, Quantity] = {}
    for part in _parts(sheet):
        quantities |= dict(part(made))
    groups: dict[str, Any] = {}
    for group, kind in GROUPS.items():
        values = {name.partition(".")[2]: q.value for name, q in quantities.items() if name.startswith(f"{group}.")}
        groups[group] = kind(**values)
    servo = Servo(name=sheet.name, title=sheet.title, kind=sheet.modulation or KINDS[0], notes=_notes(made, found),
                  quantities=quantities, sheet=sheet_table(sheet, sheet_flags(sheet)), **groups)
    return REGISTER_FAMILIES[sheet.registers]({}, servo=servo) if sheet.modulation == "bus" else servo


def _parts(sheet: Sheet) -> tuple[Callable[[_Made], _Found], ...]:
    if sheet.modulation == "bus":  # a sheet without stops is of one that turns without end
        return (_motor, _gear, _friction, _supply, *((_stops,) if sheet.stop_travel is not None else ()))
    firmware = (_firmware,) if sheet.modulation == "digital" else ()
    return (_motor, _gear, _friction, _electronics, _potentiometer, *firmware, _supply,
            *(() if sheet.continuous else (_stops,)))


def _quantity(name: str, value: float | Range | str, origin: str, source: str, *,
              by: Callable[[float], float] | None = None) -> tuple[str, Quantity]:
    change = by or (lambda x: x)
    if isinstance(value, str):
        return name, Quantity(value=value, unit="", origin=origin, source=source)
    if not isinstance(value, Range):
        return name, Quantity(value=change(value), unit=unit_of(name), origin=origin, source=source)
    ends = sorted((change(value.lower), change(value.upper)))
    return name, Quantity(value=change(value.value), unit=unit_of(name), origin=origin, source=source,
                          lower=ends[0], upper=ends[1])


_Found = Iterator[tuple[str, Quantity]]


def _motor(made: _Made) -> _Found:
    m, N = made.motor, made.reduction
    known = m.current_from_sheet
    origin = "datasheet" if known else "assumed"
    yield _quantity("motor.armature_resistance", m.resistance,
                    "datasheet" if known or m.efficiency_from_sheet else "assumed",
                    f"{made.relations}; includes bridge and wiring")
    yield _quantity("motor.armature_inductance", Range(value=5e-4, lower=1e-4, upper=2e-3), "assumed", _CLASS)
    for key, said in (("torque_constant", "K_out over gear_reduction"), ("back_emf_constant", "as torque_constant")):
        yield _quantity(f"motor.{key}", m.output_torque_constant, origin, f"{made.relations}; {said}",
                        by=lambda x: x / N)
    w = float(made.sheet.nominal.no_load_speed or 1.0)
    kind, time_60, w_m = made.sheet.motor_type, seconds(w), w * N
    yield _quantity("motor.rotor_inertia", assumed_inertia(kind, time_60, m.output_torque_constant.value,
                                                           m.resistance.value), "assumed",
                    rotor_source(kind, time_60), by=lambda x: x / N**2)
    yield _quantity("motor.motor_viscous_friction", Range(value=0.0, lower=0.0, upper=0.3 * _friction_of(made).value / (
        N * w_m)), "assumed", "the no-load current counts all loss as Coulomb friction; upper end: 30 % of it viscous")


def _gear(made: _Made) -> _Found:
    sheet = made.sheet
    if sheet.gear_reduction is not None:
        yield _quantity("gear.gear_reduction", sheet.gear_reduction, "datasheet", sheet.source_of("gear_reduction"))
    else:
        yield _quantity("gear.gear_reduction", _REDUCTION, "assumed",
                        "no source; outside the motor's own signals only its product with k_a matters")
    if sheet.backlash is not None and made.backlash:
        b = sheet.backlash
        yield _quantity("gear.backlash", Range(value=b, lower=0.5 * b, upper=2.0 * b), "datasheet",
                        f"{sheet.source_of('backlash')}; range assumed, play grows with wear")
        yield _quantity("gear.output_inertia", Range(value=2e-6, lower=5e-7, upper=5e-6), "assumed",
                        "no source: last wheel and horn")


def _friction_of(made: _Made) -> Range:
    """Return the Coulomb torque at the output; all of the no-load torque where no share grows with the load."""
    return made.motor.coulomb_torque if made.load_friction else made.motor.no_load_torque


def _friction(made: _Made) -> _Found:
    N, m = made.reduction, made.motor
    origin = "datasheet" if m.current_from_sheet else "assumed"
    said = "K_out I_0 (1 - mu_m)" if made.load_friction else "K_out I_0"
    for key in ("coulomb_torque_forward", "coulomb_torque_backward"):
        yield _quantity(f"friction.{key}", _friction_of(made), origin, f"{made.relations}; {said} over gear_reduction",
                        by=lambda x: x / N)
    yield _quantity("friction.zero_crossing_slope", Range(value=10.0, lower=0.5, upper=1000.0), "assumed",
                    "no source: slope of the smoothed friction")
    yield _quantity("friction.breakaway_ratio", Range(value=1.0, lower=1.0, upper=2.0), "assumed", _CLASS)
    eta = m.gear_efficiency
    if made.load_friction and eta.value < 1.0:  # of an impossible sheet it may be more
        given = f"{eta.value:.3g} from [sheet]" if m.efficiency_from_sheet else "0.8 assumed (0.7 to 0.9)"
        for key in ("load_friction_motor", "load_friction_external"):
            yield _quantity(f"friction.{key}", eta, "assumed", "(1 - eta_g)/(1 + eta_g), the same share for both "
                            f"sides, gear efficiency {given}", by=lambda x: load_share(min(x, 1.0)))


def _electronics(made: _Made) -> _Found:
    sheet = made.sheet
    bench = "as on the bench of Urrea & Kern 2011, Table II"
    yield _quantity("electronics.bridge_gain", _bridge_gain(made), "assumed",
                    "A k_s = (V_oc - V_ce0) K/(T_f s_r), the mean of the pulses")
    yield _quantity("electronics.comparator_gain", 1.0, "assumed", "only the product A k_s acts")
    yield "electronics.voltage_to_pulse_gain", Quantity(
        value=1.09293e-3, unit="s/V", origin="assumed", source=bench, std=5.37877e-6)
    yield "electronics.command_pulse_offset", Quantity(
        value=-2.15262e-5, unit="s", origin="assumed", source=bench, std=8.25881e-6)
    yield _quantity("electronics.pulse_to_voltage_gain", _S_R, "assumed", "s_r, no source")
    yield _quantity("electronics.command_offset", _S_R, "assumed", "k_p2 t_0, for equal pulse and voltage commands",
                    by=lambda s_r: s_r * -2.15262e-5)
    yield _quantity("electronics.one_shot_slope", _S_R, "assumed", "no source: s_r 0.7 to 1.0 V/ms",
                    by=lambda s_r: 1.0 / s_r)
    yield _quantity("electronics.one_shot_offset", Range(value=0.0, lower=-2e-4, upper=2e-4), "assumed", _CLASS)
    given = sheet.deadband is not None
    w = Range(value=sheet.deadband, lower=sheet.deadband, upper=2.0 * sheet.deadband) if sheet.deadband is not None \
        else Range(value=5e-6, lower=4e-6, upper=1e-5)
    yield _quantity("electronics.voltage_deadband", w, "assumed", "deadband in volts, s_r w, with s_r assumed",
                    by=lambda x: x * _S_R.value)
    yield _quantity("electronics.deadband", w, "datasheet" if given else "assumed",
                    f"{sheet.source_of('deadband')}; taken as the full width, which the sheet does not say" if given
                    else "no source; 4 to 10 us are usual")
    yield _quantity("electronics.frame_period", Range(value=_FRAME, lower=0.003, upper=_FRAME), "assumed",
                    "usual for analog servos; the transmitter's")
    yield _quantity("electronics.stretcher_gain", _K, "assumed", _CLASS)
    yield _quantity("electronics.minimum_drive_time", Range(value=0.0, lower=0.0, upper=5e-4), "assumed", _CLASS)
    yield _quantity("electronics.off_state", "brake", "assumed", "no source")
    low, high = _accepted(sheet)
    yield _quantity("electronics.pulse_width_min", low, "assumed", _CLASS)
    yield _quantity("electronics.pulse_width_max", high, "assumed", _CLASS)


def _bridge_gain(made: _Made) -> Range:
    def gain(drop: float, K: float) -> float:
        return float(averaged_bridge_gain(made.voltage, drop, K, _FRAME, 1.0 / _S_R.value))

    drop = made.motor.drop_voltage
    return Range(value=gain(drop, _K.value), lower=gain(max(drop, 0.4), _K.lower), upper=gain(0.0, _K.upper))


def _accepted(sheet: Sheet) -> tuple[Range, Range]:
    """Return the shortest and the longest pulse that the chip takes; at least what the sheet has."""
    low, high = Range(value=3e-4, lower=2e-4, upper=5e-4), Range(value=2.7e-3, lower=2.5e-3, upper=2.9e-3)
    if sheet.pulse_min is not None and sheet.pulse_min < low.upper:
        a = min(low.value, 0.9 * sheet.pulse_min)
        low = Range(value=a, lower=min(low.lower, a), upper=max(a, min(low.upper, sheet.pulse_min)))
    if sheet.pulse_max is not None and sheet.pulse_max > high.lower:
        b = max(high.value, 1.1 * sheet.pulse_max)
        high = Range(value=b, lower=min(b, max(high.lower, sheet.pulse_max)), upper=max(high.upper, b))
    return low, high


def _rate(sheet: Sheet) -> tuple[Range, str]:
    """Return the angle per pulse width [rad/s], and where it comes from."""
    if sheet.angle_per_pulse is not None:
        rate, off = sheet.angle_per_pulse, 0.05
        said = f"{sheet.source_of('angle_per_pulse')}: {rate / _DEG * 1e-6:.4g} deg/us"
    elif sheet.travel is not None and sheet.pulse_min is not None and sheet.pulse_max is not None:
        rate, off = sheet.travel / (sheet.pulse_max - sheet.pulse_min), 0.05
        said = (f"{sheet.source_of('travel')}: {sheet.travel / _DEG:.4g} deg for {1e6 * sheet.pulse_min:.4g} to "
                f"{1e6 * sheet.pulse_max:.4g} us")
    else:
        rate, off, said = 0.1 * _DEG * 1e6, 0.1, "0.1 deg/us, usual; the sheet gives none"
    return Range(value=rate, lower=rate * (1.0 - off), upper=rate * (1.0 + off)), said


def _potentiometer(made: _Made) -> _Found:
    rate, said = _rate(made.sheet)
    low, high = rate.lower / rate.value, rate.upper / rate.value
    p = Range(value=_S_R.value / rate.value, lower=_S_R.lower * low / rate.value, upper=_S_R.upper * high / rate.value)
    yield _quantity("potentiometer.feedback_gain", p, "assumed", f"{said}; times s_r = 0.85 V/ms, assumed")
    neutral = made.sheet.neutral_pulse or _NEUTRAL
    yield _quantity("potentiometer.feedback_offset", _S_R, "assumed",
                    f"angle 0 at {1e6 * neutral:.4g} us, s_r = 0.85 V/ms, assumed", by=lambda s_r: s_r * neutral)
    if made.sheet.continuous:
        yield _quantity("potentiometer.fixed_angle", 0.0, "assumed",
                        f"turns without end; stands at {1e6 * neutral:.4g} us")


def _firmware(made: _Made) -> _Found:
    rate, said = _rate(made.sheet)
    yield from digital_firmware(made.sheet, rate.value, said)


def _supply(made: _Made) -> _Found:
    drop = made.motor.drop_voltage
    yield _quantity("supply.open_circuit_voltage", made.voltage, "datasheet",
                    made.sheet.source_at(made.sheet.nominal))
    yield _quantity("supply.bridge_drop_voltage", Range(value=drop, lower=0.0, upper=max(drop, 0.4)), "assumed",
                    _CLASS if drop == 0.4 else f"0 to 0.4 V; {drop:g} V is the most that leaves the gear possible"
                    if made.motor.possible else "0 to 0.4 V; the sheet contradicts itself with any")


def _stops(made: _Made) -> _Found:
    sheet = made.sheet
    near, at, far = (x * _DEG for x in _BEYOND)
    rate, neutral = _rate(sheet)[0].value, sheet.neutral_pulse or _NEUTRAL
    if sheet.stop_travel is not None:
        ends, near, at, far = (-0.5 * sheet.stop_travel, 0.5 * sheet.stop_travel), -5.0 * _DEG, 0.0, 5.0 * _DEG
        said, origin = f"{sheet.source_of('stop_travel')}; range assumed", "datasheet"
    elif sheet.pulse_min is not None and sheet.pulse_max is not None:
        ends, origin = ((sheet.pulse_min - neutral) * rate, (sheet.pulse_max - neutral) * rate), "assumed"
        said = "10 to 20 degrees beyond what the pulse range asks for; longer pulses may reach more"
    elif sheet.travel is not None:
        ends, origin = (-0.5 * sheet.travel, 0.5 * sheet.travel), "assumed"
        said = "10 to 20 degrees beyond the travel of the sheet"
    else:
        ends, near, at, far = (-100.0 * _DEG, 100.0 * _DEG), -10.0 * _DEG, 0.0, 10.0 * _DEG
        said, origin = "no source: usual for servos that turn half a circle", "assumed"
    yield _quantity("stops.lower_angle", Range(value=ends[0] - at, lower=ends[0] - far, upper=ends[0] - near), origin,
                    said)
    yield _quantity("stops.upper_angle", Range(value=ends[1] + at, lower=ends[1] + near, upper=ends[1] + far), origin,
                    said)
    yield _quantity("stops.restitution", Range(value=0.0, lower=0.0, upper=0.5), "assumed", "no source")


def _notes(made: _Made, found: tuple[Contradiction, ...]) -> str:
    sheet, m = made.sheet, made.motor
    pulse = f"{1e6 * (sheet.neutral_pulse or _NEUTRAL):.4g} us"
    said = [sheet.note.strip(), f"Turns without end; its shaft stands at {pulse}." if sheet.continuous else
            f"Angle 0 is {'the middle count' if sheet.modulation == 'bus' else f'the middle position, {pulse}'}."]
    if sheet.modulation == "digital":
        said.append("Digital: its firmware is assumed, with wide ranges; so are the electronics of an analog chip, "
                    "with which the models of analog servos compute it.")
    if sheet.modulation == "bus":
        said.append("A bus servo with the registers of the factory.")
    if not m.current_from_sheet:
        said.append("The sheet gives no running current: resistance, torque constant and friction are uncertain.")
    if found:
        said.append("The sheet contradicts itself: " + " ".join(one.text[:1].upper() + one.text[1:] for one in found))
        said.append("This servo was made of it all the same; it cannot have all that the sheet says.")
    if not made.load_friction:
        said.append("Gear losses that grow with the load are left out: it stalls at more than the sheet's torque.")
    return "\n" + "\n".join(textwrap.wrap(" ".join(text for text in said if text), 118)) + "\n"
