"""Raw logs of BAM (github.com/Rhoban/bam): a servo that swings a pendulum, in and out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.loads import Pendulum
from servotwin.logs.csv_logs import in_file
from servotwin.logs.formats import ReadColumn, Reading
from servotwin.logs.log import Log
from servotwin.logs.sidecar import read_json, write_json
from servotwin.parameters import GROUPS, Quantity, Servo, unit_of
from servotwin.parameters.groups import MOST_WAITING
from servotwin.units import is_finite

# --- BAM's actuators (github.com/Rhoban/bam) --------------------------------------------------------------------------

_TURN = 2.0 * math.pi
_STS = ("feetech-sts3215",)


@dataclass(frozen=True, kw_only=True)
class BamActuator:
    """One actuator by BAM's code.

    Parameters
    ----------
    error_gain : float or None
        Duty per radian and unit of the gain k_P [1/rad]; None if BAM sets a current or a torque, and no duty.
    largest_duty : float
        Most of the supply that the servo gets [1].
    speed : float or None
        At which the goal moves at most, where a file gives no max_velocity [rad/s].
    sets : {"duty", "current", "torque"}
        Quantity that its loop sets.
    servos : tuple of str
        How the ids of the catalog begin of which it is the model.
    source : str
        Where BAM's code says it.
    writes : tuple of str
        Which gains of the firmware its recorder writes into the servo, of P, I and D; 0 into I and D. All else is as
        whoever had the servo before left it.
    """

    error_gain: float | None
    largest_duty: float = 1.0
    speed: float | None = None
    sets: str = "duty"
    servos: tuple[str, ...] = ()
    source: str
    writes: tuple[str, ...] = ("P",)


def _driven(sets: str, source: str) -> BamActuator:
    return BamActuator(error_gain=None, sets=sets, source=source, writes=())


# one line here makes an actuator known
BAM_ACTUATORS = {
    "mx64": BamActuator(error_gain=0.158, largest_duty=0.9625, servos=("dynamixel-mx-64",),
                        source="bam/dynamixel/actuator.py, MXActuator: by oscilloscope"),
    "mx106": BamActuator(error_gain=0.158, largest_duty=0.9625, servos=("dynamixel-mx-106",),
                         source="bam/dynamixel/actuator.py, MXActuator: by oscilloscope"),
    "xl320": BamActuator(error_gain=0.05048199, servos=("dynamixel-xl-320",),
                         source="bam/dynamixel/actuator.py, XL320Actuator: by oscilloscope"),
    "xl330": BamActuator(error_gain=4096.0 / _TURN / (256.0 * 885.0), servos=("dynamixel-xl330",),
                         source="bam/dynamixel/actuator.py, XL330Actuator: counts a radian over 256 and 885 steps"),
    "xc330m288t": BamActuator(error_gain=0.00575504, servos=("dynamixel-xc330-m288",),
                              source="bam/dynamixel/actuator.py, an XC330-M288-T at 5.1 V; the manual's P/128 times "
                                     "0.113 %"),
    "sts3215": BamActuator(error_gain=0.166, largest_duty=0.97, speed=3400.0 * _TURN / 4096.0, servos=_STS,
                           source="bam/feetech/actuator.py, STS3215Actuator: by oscilloscope", writes=("P", "D")),
    "waveshare_st3025": BamActuator(error_gain=0.166,
                                    source="bam/waveshare/actuator.py: the STS3215's gain; the duty was not measured"),
    "xl330i": _driven("current", "bam/dynamixel/actuator.py, XL330CurrentActuator"),
    "erob80_50": _driven("current", "bam/erob/actuator.py, ErobActuator with a damping of 1"),
    "erob80_100": _driven("current", "bam/erob/actuator.py, ErobActuator with a damping of 2"),
    "feetech_hls": _driven("current", "bam/feetech_hls/actuator.py, FeetechHLSActuator"),
    "sts3250": _driven("torque", "an older bam/feetech/actuator.py: stiffness and damping"),
    "unitree_go1": _driven("torque", "bam/unitree/actuator.py, UnitreeGo1Actuator"),
}


def bam_actuator(name: str) -> BamActuator:
    """Return what BAM's code has of an actuator.

    Parameters
    ----------
    name : str
        As BAM's files give it under `actuator`, and its logs under `motor`.

    Raises
    ------
    UnknownNameError
        If BAM has none of that name.

    Examples
    --------
    >>> bam_actuator("sts3215").error_gain, bam_actuator("mx64").largest_duty
    (0.166, 0.9625)
    """
    if name not in BAM_ACTUATORS:
        raise UnknownNameError("actuator of BAM", name, tuple(BAM_ACTUATORS))
    return BAM_ACTUATORS[name]


def writes_gain(motor: object) -> bool:
    """Return whether the gain in a log of BAM is what its recorder wrote into the servo; True of an unknown motor.

    Examples
    --------
    >>> writes_gain("sts3215"), writes_gain("sts3250")
    (True, False)
    """
    return not isinstance(motor, str) or motor not in BAM_ACTUATORS or "P" in BAM_ACTUATORS[motor].writes


def bam_name_of(servo: str) -> str | None:
    """Return what BAM calls a servo of the catalog, None if it has no model of it.

    Examples
    --------
    >>> bam_name_of("feetech-sts3215-7v4"), bam_name_of("hitec-hs-755hb")
    ('sts3215', None)
    """
    return next((name for name, one in BAM_ACTUATORS.items() if servo.startswith(one.servos or ("\0",))), None)

# --- Bam convention ---------------------------------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class BamConvention:
    """Numbers under which a `PulseServo` does what BAM's servo does.

    BAM's servo sets the mean voltage V = V_in clip(k_P g (q* − q), ±1) with firmware gain k_P and error gain g.
    A pulse servo without deadband drives at V_in for K s_µ abs(q* − q) of each frame of T_f, and not beyond its end;
    K = k_P g T_f/s_µ makes the two mean voltages equal. s_µ and the one-shot's offset are free: both are small here, so
    that a decision comes at most 20 µs after its frame starts. One for all: logs and servos have to use the same.

    Parameters
    ----------
    error_gain : float
        g, duty per radian and unit of k_P, in BAM's code and not in its files; the XL330's unless given [1/rad].
    frame_period : float
        T_f, how often the loop looks at the shaft [s].
    pulse_per_angle : float
        s_µ [s/rad].
    centre : float
        Pulse width at angle 0; angles reach from −centre/s_µ to +centre/s_µ, ±10 rad [s].
    largest_duty : float
        Most of the supply that the servo gets, in BAM's code. The firmware has it, the pulse servo not.

    Raises
    ------
    InputError
        If a number is not positive, a pulse is not shorter than its frame, or the duty is more than 1.

    Notes
    -----
    Friction feels pulses and not their mean, and they break it where their mean does not. Beside an integration of
    BAM's law with its published parameters of the XL330, a pendulum lifted at k_P = 100 differs by 44, 11 and 2 mrad
    rms at frames of 5, 1 and 0.2 ms with M6, and by 7, 2 and 0.5 mrad with M1. A shaft without torque coasts in BAM; a
    pulse servo does then what `electronics.silence_state`, or else `electronics.off_state`, says.

    Examples
    --------
    >>> round(BamConvention().stretcher_gain(400), 1), round(BamConvention.of("sts3215").stretcher_gain(32), 6)
    (1151.0, 5312.0)
    """

    error_gain: float = BAM_ACTUATORS["xl330"].error_gain or 0.0
    frame_period: float = 1e-3
    pulse_per_angle: float = 1e-6
    centre: float = 1e-5
    largest_duty: float = 1.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not is_finite(value) or not value > 0.0:
                raise InputError(f"BamConvention({f.name})", got=value, allowed="a positive number")
        if 2.0 * self.centre >= self.frame_period:
            raise InputError("BamConvention(centre)", got=self.centre, allowed="less than half of frame_period")
        if self.largest_duty > 1.0:
            raise InputError("BamConvention(largest_duty)", got=self.largest_duty, allowed="at most 1")

    @classmethod
    def of(cls, actuator: str) -> Self:
        """Return the numbers of one of BAM's actuators, those of `BAM_ACTUATORS`.

        Parameters
        ----------
        actuator : str
            BAM's name of it.

        Raises
        ------
        UnknownNameError
            If BAM has none of that name.
        InputError
            If BAM sets its current or its torque, so that no duty belongs to a gain.
        """
        one = bam_actuator(actuator)
        if one.error_gain is None:
            raise InputError("firmware gain of an actuator of BAM", got=actuator,
                             allowed=f"one whose duty BAM sets; of {actuator} it sets the {one.sets}, and no duty "
                                     "belongs to a gain")
        return cls(error_gain=one.error_gain, largest_duty=one.largest_duty)

    def stretcher_gain(self, gain: float) -> float:
        """Return K for a firmware gain k_P."""
        if not is_finite(gain) or not gain > 0.0:
            raise InputError("firmware gain kp", got=gain, allowed="a positive number")
        return gain * self.error_gain * (self.frame_period / self.pulse_per_angle)

    def parameters(self, gain: float | None = None, voltage: float | None = None,
                   ratio: float = 1.0) -> dict[str, float]:
        """Return the servo parameters by dotted name; those of gain and supply only where they are given.

        Parameters
        ----------
        gain : float, optional
            k_P.
        voltage : float, optional
            V_in [V].
        ratio : float
            BAM's error_gain_ratio, by which a fit corrects g [1].
        """
        made = {
            "electronics.frame_period": self.frame_period,
            "electronics.one_shot_offset": self.centre,
            "electronics.one_shot_slope": self.pulse_per_angle,
            "potentiometer.feedback_gain": 1.0,
            "potentiometer.feedback_offset": 0.0,
        }
        if voltage is not None:
            made["supply.open_circuit_voltage"] = voltage
        if gain is not None:
            made["electronics.stretcher_gain"] = self.stretcher_gain(gain) * ratio
        if gain is not None and voltage is not None:  # the same law with the mean voltage, for the bounded servo
            made["electronics.bridge_gain"] = gain * self.error_gain * ratio * voltage
            made["electronics.comparator_gain"] = 1.0
        return made

    def firmware(self, gain: float | None = None, ratio: float = 1.0, speed: float | None = None,
                 delay: float | None = None) -> dict[str, Any]:
        """Return the same loop as numbers of the firmware, by dotted name; the gain only where it is given.

        Parameters
        ----------
        gain : float, optional
            k_P.
        ratio : float
            BAM's error_gain_ratio, by which a fit corrects g [1].
        speed : float, optional
            BAM's max_velocity, at which the goal moves at most [rad/s].
        delay : float, optional
            BAM's command_delay, from the write of a goal until it counts [s].

        Examples
        --------
        >>> round(BamConvention().firmware(400)["firmware.proportional_gain"], 6)
        1.150951
        """
        made: dict[str, Any] = {"firmware.control_period": self.frame_period, "firmware.duty_limit": self.largest_duty,
                                "firmware.command_kind": "goal"}
        if gain is not None:
            made["firmware.proportional_gain"] = gain * self.error_gain * ratio
        if speed is not None:
            made["firmware.speed_limit"] = speed
        if delay is not None:
            made["firmware.bus_latency"] = delay
        return made


# --- Parameter files of BAM (github.com/Rhoban/bam): friction models M1 to M6 of a servo, in and out ------------------

_MOTOR = {"kt": "motor.torque_constant", "R": "motor.armature_resistance", "armature": "motor.rotor_inertia",
          "friction_viscous": "motor.motor_viscous_friction"}
_SHARES = {  # key in BAM -> friction parameter, the same number in both
    "load_friction_base": "load_friction", "load_friction_stribeck": "load_friction_stribeck",
    **{name: name for name in (
        "load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
        "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad")}}
_STRIBECK = ("friction_stribeck", "dtheta_stribeck", "alpha")
_M5 = ("load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
       "load_friction_external_stribeck")
# model -> keys of its friction, beside friction_base and friction_viscous
MODELS: dict[str, tuple[str, ...]] = {
    "m1": (), "m2": _STRIBECK, "m3": ("load_friction_base",),
    "m4": (*_STRIBECK, "load_friction_base", "load_friction_stribeck"), "m5": (*_STRIBECK, *_M5),
    "m6": (*_STRIBECK, *_M5, "load_friction_motor_quad", "load_friction_external_quad"),
}
_FRICTION = ("friction_base", *_STRIBECK, *_SHARES)
_MAY_BE_NEGATIVE = ("q_offset",)
_LOOP_OF_FILE = {"max_velocity": "firmware.speed_limit", "command_delay": "firmware.bus_latency"}
_OF_LOOP = ("error_gain_ratio", *_LOOP_OF_FILE)
_UNUSED = {  # keys that BAM writes and a servo has no use for: why
    "q_offset": "it turns the rig's gravity: a pendulum hangs at -q_offset",
    "current_limit": "the most current of a loop that sets the current",
    "viscous_damping_with_torque": "damping by a loop that sets the current",
    "ratio": "the gear of a loop that sets the torque", "max_torque": "the limit of a loop that sets the torque",
}


def read_bam_parameters(path: str | Path, *, gain: float | None = None, voltage: float | None = None,
                        convention: BamConvention | None = None) -> Servo:
    """Return the servo that a parameter file of BAM describes.

    All is at the output shaft: the gear reduction is 1, k_a = k_b = k_t. With the friction law of `servotwin.physics`:
    F_c = friction_base, r = 1 + friction_stribeck/friction_base, v_s = dtheta_stribeck, B_m = friction_viscous, and
    the shares K_l … K_eq by their names. The position loop is that of `BamConvention`, as pulses and as firmware, with
    the numbers that BAM's code has for the file's `actuator` (`BAM_ACTUATORS`); it has BAM's error_gain_ratio, and as
    firmware max_velocity and command_delay as `firmware.bus_latency`. An actuator whose current or torque BAM sets has
    no such loop.

    Parameters
    ----------
    path : str or Path
    gain, voltage : float, optional
        Firmware gain k_P and supply [V]; a log of BAM brings its own.
    convention : BamConvention, optional
        Instead of what BAM's code says of the actuator.

    Returns
    -------
    Servo
        Its sheet has a table `bam` with model, actuator and what belongs to the loop or the rig. Its notes say which
        keys of the file are not used, and why.

    Raises
    ------
    InputError
        If it is no such file, lacks a number of its model, or has one that its model does not have; if a gain is given
        and BAM has no such actuator, or sets no duty of it.
    ParameterError
        If a number is not physical.
    """
    content = read_json(path)
    if not is_bam_parameters(content):
        raise InputError(f"{path}", got=type(content).__name__, allowed='an object with "model" and "kt", as of BAM')
    model = content["model"]
    if not isinstance(model, str) or model not in MODELS:
        raise InputError(f"{path}: model", got=model, allowed=", ".join(MODELS))
    actuator = content.get("actuator", "")
    if not isinstance(actuator, str):
        raise InputError(f"{path}: actuator", got=actuator, allowed="a text")
    if "R" not in content:
        raise InputError(f"{path}: R", got="nothing", allowed="the resistance of the motor [ohm]; BAM's files of an "
                         "actuator whose current it sets, as of erob80_100, may have none: add it")
    needed = (*_MOTOR, "friction_base", *MODELS[model])
    numbers = {key: _number(path, content, key) for key in needed}
    for key in _FRICTION:
        if key in content and key not in needed:
            raise InputError(f"{path}: {key}", got=content[key], allowed=f"no such number in model {model}")
    values = _identified(path, numbers)
    for key in (*_OF_LOOP, *_UNUSED):
        if key in content and _number(path, content, key) == 0.0 and key == "error_gain_ratio":
            raise InputError(f"{path}: {key}", got=content[key], allowed="a positive number")
    rig = {key: float(value) if is_finite(value) else value for key, value in content.items()
           if key not in (*needed, "model", "actuator") and (is_finite(value) or isinstance(value, str))}
    loop, unused = _loop(path, content, actuator, rig, (gain, voltage), convention)
    source = f"BAM, friction model {model.upper()}" + (f" of {actuator}" if actuator else "") + f": {Path(path).name}"
    unused |= {key: _UNUSED.get(key, "not known here")
               for key in content if key not in (*needed, *_OF_LOOP, "model", "actuator")}
    notes = f"Not used of the file: {'; '.join(f'{key} ({why})' for key, why in unused.items())}." if unused else ""
    try:
        return _servo(f"{actuator or 'bam'}-{model}", values, loop, (source, _loop_source(actuator, convention)),
                      {"bam": {"model": model, "actuator": actuator, **rig}}, notes)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None


def _loop(path: str | Path, content: Mapping[str, Any], actuator: str, rig: Mapping[str, Any],
          asked: tuple[float | None, float | None],
          convention: BamConvention | None) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the values of the loop by dotted name, and which keys of it are not used, and why."""
    gain, voltage = asked
    known = BAM_ACTUATORS.get(actuator)
    sets = "duty" if known is None or convention is not None else known.sets
    if gain is not None and convention is None:
        _asked_a_gain(path, actuator)
    used = convention or (BamConvention.of(actuator) if known is not None and sets == "duty" else BamConvention())
    delay, most = rig.get("command_delay"), (MOST_WAITING - 1) * used.frame_period
    if delay is not None and delay > most:
        raise InputError(f"{path}: command_delay", got=delay, allowed=f"at most {most:g} s with frames of "
                         f"{used.frame_period:g} s; a convention=BamConvention(frame_period=…) with longer ones")
    if sets != "duty":
        loop: dict[str, Any] = {} if voltage is None else {"supply.open_circuit_voltage": voltage}
        if delay is not None:
            loop["firmware.bus_latency"] = delay
        return loop, {key: f"of {actuator} BAM sets the {sets}, and no duty"
                      for key in ("error_gain_ratio", "max_velocity") if key in content}
    speed = rig.get("max_velocity", None if known is None or convention is not None else known.speed)
    ratio = rig.get("error_gain_ratio", 1.0)
    return {**used.parameters(gain, voltage, ratio), "electronics.deadband": 0.0,
            "electronics.minimum_drive_time": 0.0, "electronics.off_state": "brake",
            **used.firmware(gain, ratio, speed, delay)}, {}


def _loop_source(actuator: str, convention: BamConvention | None) -> str:
    if convention is not None:
        return "position loop of BAM, by a convention that was given"
    one = BAM_ACTUATORS.get(actuator)
    return "position loop of BAM" + (f", {one.source}" if one else "'s XL330, for want of a known actuator")


def _asked_a_gain(path: str | Path, actuator: str) -> None:
    """Refuse a gain of an actuator of which no duty per gain is known."""
    instead = "convention=BamConvention(error_gain=…) says its duty per radian"
    try:
        known = bam_actuator(actuator)
    except UnknownNameError as error:
        raise InputError(f"{path}: actuator, to which a gain belongs", got=actuator or "nothing",
                         allowed=f"{error.allowed}; of another, {instead}") from None
    if known.error_gain is None:
        raise InputError(f"{path}: gain of {actuator}", got="a gain",
                         allowed=f"none, for BAM sets its {known.sets} and no duty; or {instead}")


def is_bam_parameters(content: object) -> bool:
    """Return whether the content of a JSON file looks like a parameter file of BAM."""
    return isinstance(content, Mapping) and "model" in content and "kt" in content


def write_bam_parameters(servo: Servo, path: str | Path, *, model: str = "auto", actuator: str | None = None,
                         overwrite: bool = False) -> None:
    """Write the motor and the friction of a servo as a parameter file of BAM, at the output shaft.

    Numbers that BAM does not have, such as deadband, bridge and play, are left out; `firmware.bus_latency` is
    its command_delay.

    Parameters
    ----------
    servo : Servo
    path : str or Path
    model : {"auto", "m1", …, "m6"}
        The smallest that holds all friction of the servo unless given.
    actuator : str, optional
        BAM's name of the servo; from `servo.sheet`, by its name in the catalog, or its name unless given.
    overwrite : bool
        Replace a file that is there.

    Raises
    ------
    InputError
        If BAM cannot hold a number: two torque constants, friction that differs by direction, friction beyond `model`.
    ParameterError
        If the servo lacks a number.
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    numbers = _at_output(servo)
    rig = servo.sheet.get("bam", {})
    rig = rig if isinstance(rig, Mapping) else {}
    smallest = _smallest(numbers)
    chosen = smallest if model == "auto" else model
    if chosen not in MODELS:
        raise UnknownNameError("friction model of BAM", str(model), ("auto", *MODELS))
    extra = [key for key in _FRICTION[1:] if numbers.get(key, 0.0) != 0.0 and key not in MODELS[chosen]
             and key not in ("dtheta_stribeck", "alpha")]
    if extra:
        raise InputError(f"servo {servo.name!r} as {chosen} of BAM: {extra[0]}", got=numbers[extra[0]],
                         allowed=f"model {smallest}, which knows it")
    keys = (*_MOTOR, "friction_base", *MODELS[chosen])
    content: dict[str, Any] = {key: numbers.get(key, 0.0) for key in keys}
    content["q_offset"] = 0.0
    content |= {key: value for key, value in rig.items() if key not in content or key == "q_offset"}
    if servo.firmware.bus_latency is not None:
        content["command_delay"] = servo.firmware.bus_latency
    called = actuator or str(rig.get("actuator") or bam_name_of(servo.name) or servo.name)
    content |= {"model": chosen, "actuator": called}
    write_json(path, content, overwrite=overwrite)


def _identified(path: object, numbers: Mapping[str, float]) -> dict[str, float]:
    """Return the values of the servo by dotted name."""
    values = {name: numbers[key] for key, name in _MOTOR.items()}
    values["motor.back_emf_constant"] = numbers["kt"]
    values["gear.gear_reduction"] = 1.0
    base = numbers["friction_base"]
    values["friction.coulomb_torque_forward"] = values["friction.coulomb_torque_backward"] = base
    if "friction_stribeck" in numbers:
        static = numbers["friction_stribeck"]
        if base == 0.0 and static > 0.0:
            raise InputError(f"{path}: friction_base", got=base,
                             allowed="more than 0: static friction is held as a ratio to it")
        values["friction.breakaway_ratio"] = 1.0 + (static / base if static > 0.0 else 0.0)
        values["friction.stribeck_speed"] = numbers["dtheta_stribeck"]
        values["friction.stribeck_exponent"] = numbers["alpha"]
    values |= {f"friction.{name}": numbers[key] for key, name in _SHARES.items() if key in numbers}
    return values


def _servo(name: str, values: Mapping[str, float], loop: Mapping[str, Any], sources: tuple[str, str],
           sheet: Mapping[str, Any], notes: str) -> Servo:
    groups: dict[str, dict[str, Any]] = {}
    for dotted, value in {**values, **loop}.items():
        group, _, key = dotted.partition(".")
        groups.setdefault(group, {})[key] = value
    made: dict[str, Any] = {group: GROUPS[group](**fields) for group, fields in groups.items()}
    own = [dotted for key, dotted in _LOOP_OF_FILE.items() if key in sheet["bam"] and dotted in loop]
    quantities = {dotted: Quantity(value=float(value), unit=unit_of(dotted), origin="identified", source=sources[0])
                  for dotted, value in {**values, **{dotted: loop[dotted] for dotted in own}}.items()}
    quantities |= {dotted: Quantity(value=value, unit=unit_of(dotted), origin="assumed",
                                    source=sources[1] + ("" if dotted.startswith("firmware.") else ", as pulses"))
                   for dotted, value in loop.items() if dotted not in own}
    return Servo(name=name, title=sources[0], kind="bus", quantities=quantities, sheet=sheet, notes=notes, **made)


def _at_output(servo: Servo) -> dict[str, float]:
    """Return BAM's numbers of a servo; shares that it does not give are absent."""
    N = _given(servo, "gear.gear_reduction")
    k_a, k_b = _given(servo, "motor.torque_constant"), _given(servo, "motor.back_emf_constant")
    if abs(k_a - k_b) > 1e-9 * k_a:
        raise InputError(f"servo {servo.name!r} for BAM: motor.back_emf_constant", got=k_b,
                         allowed=f"motor.torque_constant = {k_a!r}, for BAM has one k_t")
    F, F_b = (_given(servo, f"friction.coulomb_torque_{way}") for way in ("forward", "backward"))
    if abs(F - F_b) > 1e-9 * max(F, F_b):
        raise InputError(f"servo {servo.name!r} for BAM: friction.coulomb_torque_backward", got=F_b,
                         allowed=f"friction.coulomb_torque_forward = {F!r}, for BAM has one for both ways")
    J_o = servo.gear.output_inertia or 0.0
    numbers = {"kt": N * k_a, "R": _given(servo, "motor.armature_resistance"),
               "armature": N * N * _given(servo, "motor.rotor_inertia") + J_o,
               "friction_viscous": N * N * _given(servo, "motor.motor_viscous_friction"), "friction_base": N * F}
    friction = servo.friction
    numbers["friction_stribeck"] = N * F * ((friction.breakaway_ratio or 1.0) - 1.0)
    numbers |= {key: getattr(friction, name) for key, name in _SHARES.items() if getattr(friction, name) is not None}
    fades = any(numbers.get(key, 0.0) != 0.0 for key in _FRICTION if "stribeck" in key or "quad" in key)
    if fades and friction.stribeck_speed is None:
        raise ParameterError(f"servo {servo.name!r} for BAM: friction.stribeck_speed", got="nothing",
                             allowed="a speed at which static friction fades")
    # 0.1 rad/s stands where nothing fades and any speed does
    numbers["dtheta_stribeck"] = 0.1 if friction.stribeck_speed is None else friction.stribeck_speed / N
    numbers["alpha"] = friction.stribeck_exponent or 1.0
    return numbers


def _smallest(numbers: Mapping[str, float]) -> str:
    """Return the first model that has all friction of these numbers."""
    here = {key for key in _FRICTION if key in numbers} - {"friction_base", "dtheta_stribeck", "alpha"}
    if numbers["friction_stribeck"] == 0.0 and "load_friction_stribeck" not in here and not here & set(_M5):
        here.discard("friction_stribeck")
    return next(name for name, keys in MODELS.items() if here <= set(keys))


def _given(servo: Servo, name: str) -> float:
    value = servo.get(name)
    if not isinstance(value, float):
        raise ParameterError(f"servo {servo.name!r} for BAM: {name}", got="nothing", allowed="a number")
    return value


def _number(path: object, content: Mapping[str, Any], key: str) -> float:
    value = content.get(key)
    if not is_finite(value) or (value < 0.0 and key not in _MAY_BE_NEGATIVE):
        allowed = "a finite number" + ("" if key in _MAY_BE_NEGATIVE else " of at least 0")
        raise InputError(f"{path}: {key}", got="nothing" if value is None else value, allowed=allowed)
    return float(value)


# --- Raw logs of BAM (github.com/Rhoban/bam): a servo that swings a pendulum, in and out ------------------------------

GRAVITY = 9.80665  # m/s², as in BAM's test bench
# key of an entry -> signal; those with True have to be there
_MEASURED = {"position": ("output_angle", True), "speed": ("output_speed", False),
             "input_volts": ("bus_voltage", False)}
_TEXTS = ("motor", "trajectory")


def read_bam_log(path: str | Path, *, convention: BamConvention | None = None) -> Log:
    """Return the log in a raw file of BAM.

    The pendulum's point mass m and its arm m_a have inertia (m + m_a/3) l² and gravity torque (m + m_a/2) g l sin q
    (Duclusaud et al., 2025); an arm that is not recorded weighs nothing. The firmware gain becomes
    `electronics.stretcher_gain` by what BAM's code says of the log's `motor`; a log that names none is read as an
    XL330's, and the gain of a motor whose current or torque BAM sets stays a condition alone. Where torque is off BAM's
    motor is disconnected.

    Parameters
    ----------
    path : str or Path
    convention : BamConvention, optional
        Instead of what BAM's code says of the motor.

    Raises
    ------
    InputError
        If it is no such file, an entry lacks a number, or BAM has no such motor and there is no convention.
    """
    return _log(Path(path), read_json(path), convention)


def recognises(content: object) -> bool:
    """Return whether the content of a JSON file looks like a raw log of BAM."""
    return isinstance(content, Mapping) and "entries" in content


def logs_of(path: Path, content: object) -> list[Log]:
    """Return the log that the content of a file is, alone in a list."""
    return [_log(path, content)]


def _log(path: Path, content: object, convention: BamConvention | None = None) -> Log:
    if not isinstance(content, Mapping) or not isinstance(content.get("entries"), list):
        raise InputError(f"{path}", got=type(content).__name__, allowed='an object with "entries", as BAM records it')
    number = {key: _raw_number(path, content, key) for key in ("mass", "length", "kp", "vin")}
    number["arm_mass"] = _raw_number(path, content, "arm_mass") if "arm_mass" in content else 0.0
    text = {key: content.get(key, "") for key in _TEXTS}
    for key, value in text.items():
        if not isinstance(value, str):
            raise InputError(f"{path}: {key}", got=value, allowed="a text")
    entries = content["entries"]
    first = _entry(path, entries, 0) if entries else {}
    time, command = _column(path, entries, "timestamp"), _column(path, entries, "goal_position", null=True)
    measured = {name: _column(path, entries, key) for key, (name, required) in _MEASURED.items()
                if required or key in first}
    on = _column(path, entries, "torque_enable", default=True) == 1.0
    reading = Reading(file=str(path), remarks=tuple(_left_as_found(text["motor"])), columns=(
        ReadColumn("goal_position", "command_angle", "rad", "BAM's format"),
        *(ReadColumn(key, name, "V" if name == "bus_voltage" else "rad/s" if name == "output_speed" else "rad",
                     "BAM's format") for key, (name, _) in _MEASURED.items() if name in measured)))
    with in_file(path, path.stem):
        mass = number["mass"]
        arm = number["arm_mass"]
        length = number["length"]
        inertia = None if arm == 0.0 else (mass + arm / 3.0) * length**2
        pendulum = Pendulum(mass=mass + arm / 2.0, length=length, inertia=inertia, gravity=GRAVITY)
        return Log(
            name=path.stem, source=str(path), motion=text["trajectory"], time=time, command=command, reading=reading,
            command_kind="angle", measured=measured, torque_on=None if on.all() else on,
            load=pendulum.as_load(),
            parameters=_loop_of_log(path, text["motor"], number["kp"], number["vin"], convention),
            conditions={"gain": number["kp"], "voltage": number["vin"],
                        **({"motor": text["motor"]} if text["motor"] else {})})


def _left_as_found(motor: str) -> list[str]:
    """Return what a log says of registers: which gains its recorder wrote, and that all others are as they were."""
    one = BAM_ACTUATORS.get(motor)
    if one is None or not (one.writes or motor.startswith("sts")):
        return []
    if "P" not in one.writes:
        return [f"BAM's recorder wrote no register of a {motor}: kp is what it was told, not what the servo had; all "
                "registers are as whoever had it before left them"]
    wrote = "P = kp" + (" and D = 0" if "D" in one.writes else "")
    return [f"BAM's recorder wrote {wrote} into this {motor}; the other registers, its profile too, are as whoever had "
            "it before left them"]


def _loop_of_log(path: Path, motor: str, gain: float, voltage: float,
                 convention: BamConvention | None) -> dict[str, float]:
    """Return what stands for the loop, by dotted name."""
    if convention is None and motor:
        if motor not in BAM_ACTUATORS:
            raise InputError(f"{path}: motor, to which the gain kp belongs", got=motor,
                             allowed=f"{', '.join(BAM_ACTUATORS)}; of another, read_bam_log(…, "
                                     "convention=BamConvention(error_gain=…)) says its duty per radian")
        if BAM_ACTUATORS[motor].error_gain is None:
            BamConvention().stretcher_gain(gain)  # a gain it has to be
            return {"supply.open_circuit_voltage": voltage}
        convention = BamConvention.of(motor)
    return (convention or BamConvention()).parameters(gain, voltage)


def write_bam_log(log: Log, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a log as BAM records it; `read_bam_log` reads the same samples back.

    Parameters
    ----------
    log : Log
        Of angle commands held between samples, with `output_angle` at each, a pendulum that hangs at 0 and nothing else
        on the shaft, and the conditions `gain` and `voltage`.
    path : str or Path
    overwrite : bool
        Replace a file that is there.

    Raises
    ------
    InputError
        If BAM's file has no place for something in the log.
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    what = f"log {log.name!r} as a log of BAM"
    if log.command_kind != "angle" or log.command_hold != "previous":
        raise InputError(f"{what}: command", got=f"{log.command_kind}, {log.command_hold}", allowed="angle, previous")
    for name in ("gain", "voltage"):
        if not is_finite(log.conditions.get(name)):
            raise InputError(f"{what}: conditions, {name}", got=log.conditions.get(name, "nothing"), allowed="a number")
    columns = {"timestamp": log.time, "goal_position": log.command}
    for key, (name, required) in _MEASURED.items():
        if name not in log.measured and not required:
            continue
        if name not in log.measured or not np.isfinite(log.measured[name]).all():
            raise InputError(f"{what}: {name}", got="samples without a value", allowed="a value at every sample")
        columns[key] = log.measured[name]
    on = np.ones(log.time.size, dtype=bool) if log.torque_on is None else log.torque_on
    rows = zip(*([None if math.isnan(x) else x for x in values.tolist()] for values in columns.values()), on.tolist(),
               strict=True)
    content = {**_pendulum_words(what, log), "kp": log.conditions["gain"], "vin": log.conditions["voltage"],
               "motor": str(log.conditions.get("motor", "")), "trajectory": log.motion,
               "entries": [dict(zip((*columns, "torque_enable"), row, strict=True)) for row in rows]}
    write_json(path, content, overwrite=overwrite)


def _pendulum_words(what: str, log: Log) -> dict[str, float]:
    """Return mass, arm and length of the pendulum, which has to be all of the load."""
    pendulums = log.load.pendulums
    if len(pendulums) != 1 or log.load != pendulums[0].as_load():
        raise InputError(f"{what}: load", got=log.load, allowed="one pendulum and nothing else")
    pendulum = pendulums[0]
    if pendulum.hanging_angle != 0.0 or pendulum.gravity != GRAVITY or pendulum.length == 0.0:
        raise InputError(f"{what}: pendulum", got=pendulum, allowed=f"hanging at 0, {GRAVITY} m/s2 and a length")
    if pendulum.inertia is None:
        return {"mass": pendulum.mass, "arm_mass": 0.0, "length": pendulum.length}
    arm = 6.0 * (pendulum.mass - pendulum.inertia / pendulum.length**2)
    if arm < -1e-9 * pendulum.mass or arm > 2.0 * pendulum.mass * (1.0 + 1e-9):
        raise InputError(f"{what}: pendulum, inertia", got=pendulum.inertia,
                         allowed="that of a point mass on a rod, between m l²/3 and m l²")
    arm = min(max(arm, 0.0), 2.0 * pendulum.mass)
    return {"mass": pendulum.mass - 0.5 * arm, "arm_mass": arm, "length": pendulum.length}


def _raw_number(path: Path, content: Mapping[str, Any], key: str) -> float:
    value = content.get(key)
    if not is_finite(value) or value < 0.0:
        raise InputError(f"{path}: {key}", got="nothing" if value is None else value, allowed="a number of at least 0")
    return float(value)


def _entry(path: Path, entries: list[Any], k: int) -> Mapping[str, Any]:
    entry = entries[k]
    if not isinstance(entry, Mapping):
        raise InputError(f"{path}: entry {k}", got=entry, allowed="an object")
    return entry


def _column(path: Path, entries: list[Any], key: str, default: object = None, *,
            null: bool = False) -> NDArray[np.float64]:
    """Return the values of all entries; null is nan where it may be."""
    values = []
    for k in range(len(entries)):
        entry = _entry(path, entries, k)
        value = entry.get(key, default)
        if isinstance(value, bool) and key == "torque_enable":
            value = int(value)
        absent = null and value is None and key in entry
        if not absent and not is_finite(value):
            raise InputError(f"{path}: entry {k}, {key}", got="nothing" if value is None else value, allowed="a number")
        values.append(math.nan if absent else float(value))
    return np.array(values, dtype=np.float64)
