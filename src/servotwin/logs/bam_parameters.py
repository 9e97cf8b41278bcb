"""Parameter files of BAM (github.com/Rhoban/bam): friction models M1 to M6 of a servo, in and out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.logs.bam_convention import BAM_ACTUATORS, BamConvention, bam_actuator, bam_name_of
from servotwin.logs.sidecar import read_json, write_json
from servotwin.parameters import GROUPS, Quantity, Servo, unit_of
from servotwin.parameters.groups import MOST_WAITING
from servotwin.units import is_finite

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
        If it is no such file, lacks a number of its model, or has one that its model does not know; if a gain is given
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

    What BAM does not know, such as deadband, bridge and play, is left out; `firmware.bus_latency` is
    its command_delay.

    Parameters
    ----------
    servo : Servo
    path : str or Path
    model : {"auto", "m1", …, "m6"}
        The smallest that holds all friction of the servo unless given.
    actuator : str, optional
        What BAM calls the servo; from `servo.sheet`, by its name in the catalog, or its name unless given.
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
    """Return the first model that knows all friction of these numbers."""
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
