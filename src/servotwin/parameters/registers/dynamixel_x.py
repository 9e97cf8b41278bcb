"""Registers of Dynamixel's X series (XL330, XL430, XM430 …), by the names of the e-manual with underscores."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from servotwin.errors import ParameterError
from servotwin.parameters.catalog import load_servo
from servotwin.parameters.registers.table import (
    LEROBOT_X_SETS,
    Family,
    Given,
    Raw,
    Register,
    RegisterModel,
    Setting,
    laid,
    model_for,
    on,
    set_registers,
)
from servotwin.parameters.servo import Servo

# --- Models with the registers of Dynamixel's X series, each against the control table of its own e-manual ------------

OF_CURRENT, OF_SLOPE = ("Current_Limit", "Goal_Current", "Present_Current"), ("PWM_Slope",)
_OLD = ("Acceleration_Limit",)  # firmware of today has none
_LATER = (*_OLD, "Startup_Configuration")  # not in the versions of these pages that were read
_VOLTS = {"v5": (31, 70), "v12": (55, 140), "xl": (60, 140), "xc": (60, 160), "x": (95, 160), "24V": (110, 300)}
# lowest and highest of both voltage limits [0.1 V], by what shares them
MANUAL = 128.0
"""Divisor of Position_P_Gain to PWM steps a count, as the e-manual prints it for all models."""
_XL330 = 256.0  # as recordings of an XL330 show: github.com/Rhoban/bam, bam/dynamixel/actuator.py, XL330_KP_DIVISOR


@dataclass(frozen=True, kw_only=True)
class XModel(RegisterModel):
    """A model with the registers of the X series.

    Parameters
    ----------
    current_unit : float, optional
        Of Goal_Current [A]; None: it senses no current.
    current_sense : {"motor", "bus"}
        Where it senses its current.
    slope_unit : float, optional
        Of PWM_Slope [V/s]; None: it has none.
    divisor : float
        Of Position_P_Gain to PWM steps a count; those of the other two gains go with it.
    measured : bool
        Whether it was measured.
    """

    current_unit: float | None = None
    current_sense: str = "motor"
    slope_unit: float | None = None
    divisor: float = MANUAL
    measured: bool = False


def _x(name: str, number: int, volts: tuple[str, int, int], speed: int, velocity: tuple[int, int],
       position: tuple[int, int, int], *, page: str = "", current: tuple[int, float] | None = None, heat: int = 80,
       slope: tuple[int, float] | None = None, speeds: int = 1023, assumed: tuple[str, ...] = _OLD,
       shutdown: int = 52, threshold: int = 10, seen: bool = True, divisor: float = MANUAL,
       measured: bool = False) -> XModel:
    """Return a model.

    Parameters
    ----------
    volts : (str, int, int)
        Range of the voltage limits, and what the highest and the lowest are.
    speed : int
        Velocity_Limit; `speeds` is the most.
    velocity : (int, int)
        Velocity_I_Gain, Velocity_P_Gain.
    position : (int, int, int)
        Position_D_Gain, Position_I_Gain, Position_P_Gain.
    page : str
        Last part of the page's address, `name` unless given.
    current : (int, float), optional
        Current_Limit, and its unit [A].
    slope : (int, float), optional
        PWM_Slope, and its unit [V/s].
    seen : bool
        Whether its page was read.
    """
    values = {"Temperature_Limit": heat, "Max_Voltage_Limit": volts[1], "Min_Voltage_Limit": volts[2],
              "Velocity_Limit": speed, "Velocity_I_Gain": velocity[0], "Velocity_P_Gain": velocity[1],
              "Position_D_Gain": position[0], "Position_I_Gain": position[1], "Position_P_Gain": position[2],
              "Shutdown": shutdown, "Moving_Threshold": threshold, "Model_Number": number}
    limits = _VOLTS[volts[0]]
    ranges = {"Max_Voltage_Limit": limits, "Min_Voltage_Limit": limits, "Velocity_Limit": (0, speeds)}
    if current is not None:
        values |= dict.fromkeys(OF_CURRENT[:2], current[0])
        ranges |= {"Current_Limit": (0, current[0]), "Goal_Current": (1, current[0])}
    if slope is not None:
        values["PWM_Slope"] = slope[0]
    last = page or f"x/{name.lower()}"
    return XModel(
        name=name, number=number, document=f"e-manual of the {name}, control table" if seen else "",
        page=f"https://emanual.robotis.com/docs/en/dxl/{last}/" if seen else "", values=values, ranges=ranges,
        units={} if current is None else dict.fromkeys(OF_CURRENT, f"{1e3 * current[1]:.4g} mA"),
        lacks=frozenset((*(() if current else OF_CURRENT), *(() if slope else OF_SLOPE))),
        assumed=frozenset(assumed), current_unit=None if current is None else current[1],
        current_sense="bus" if slope else "motor", slope_unit=None if slope is None else slope[1], divisor=divisor,
        measured=measured)


_XL330_CURRENT, _XC330_CURRENT, _XC330_T_CURRENT = (1750, 1e-3), (2352, 1e-3), (910, 1e-3)

X_MODELS = (
    _x("XM430-W350", 1020, ("x", 160, 95), 200, (1920, 100), (0, 0, 800), current=(1193, 2.69e-3), assumed=_LATER),
    _x("XM430-W210", 1030, ("x", 160, 95), 330, (1920, 100), (0, 0, 800), current=(1193, 2.69e-3)),
    _x("XL330-M288", 1200, ("v5", 70, 35), 445, (1600, 180), (0, 0, 400), current=_XL330_CURRENT, heat=70, speeds=2047,
       slope=(140, 1.977), shutdown=53, divisor=_XL330, measured=True),
    _x("XL330-M077", 1190, ("v5", 70, 35), 1620, (400, 40), (0, 400, 400), current=_XL330_CURRENT, heat=70,
       speeds=2047, slope=(140, 1.977), shutdown=53, divisor=_XL330, measured=True),
    _x("XC330-M288", 1240, ("v5", 70, 35), 350, (1600, 50), (500, 0, 1100), current=_XC330_CURRENT, heat=70,
       speeds=2047, slope=(140, 1.977), divisor=_XL330),
    _x("XC330-M181", 1230, ("v5", 70, 35), 545, (1400, 100), (500, 0, 1200), current=_XC330_CURRENT, heat=70,
       speeds=2047, slope=(140, 1.977), divisor=_XL330),
    _x("XC330-T288", 1220, ("v12", 140, 55), 320, (1200, 40), (0, 0, 900), current=_XC330_T_CURRENT, heat=70,
       speeds=2047, slope=(255, 3.955), divisor=_XL330),
    _x("XC330-T181", 1210, ("v12", 140, 55), 510, (1200, 40), (0, 0, 900), current=_XC330_T_CURRENT, heat=70,
       speeds=2047, slope=(255, 3.955), divisor=_XL330),
    _x("XL430-W250", 1060, ("xl", 140, 60), 265, (1000, 100), (4000, 0, 640), heat=72),
    _x("2XL430-W250", 1090, ("xl", 140, 60), 250, (1800, 100), (2000, 0, 640), heat=72, assumed=_LATER),
    _x("XC430-W150", 1070, ("xc", 160, 60), 460, (1920, 100), (0, 0, 460), threshold=20),
    _x("XC430-W240", 1080, ("xc", 160, 60), 306, (1920, 100), (0, 0, 700)),
    _x("2XC430-W250", 1160, ("xc", 160, 60), 306, (1920, 100), (0, 0, 700), seen=False),
    _x("XM540-W270", 1120, ("x", 160, 95), 128, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3)),
    _x("XM540-W150", 1130, ("x", 160, 95), 230, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3), assumed=_LATER),
    _x("XH430-W350", 1000, ("x", 160, 95), 130, (1920, 100), (0, 0, 900), current=(648, 2.69e-3)),
    _x("XH430-W210", 1010, ("x", 160, 95), 210, (1920, 100), (0, 0, 900), current=(648, 2.69e-3), assumed=_LATER),
    _x("XH430-V350", 1040, ("24V", 300, 110), 135, (1920, 100), (0, 0, 800), current=(689, 1.34e-3), assumed=_LATER),
    _x("XH430-V210", 1050, ("24V", 300, 110), 380, (1920, 100), (0, 0, 800), current=(689, 1.34e-3),
       assumed=("Startup_Configuration",)),
    _x("XH540-W270", 1100, ("x", 160, 95), 167, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3)),
    _x("XH540-W150", 1110, ("x", 160, 95), 300, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3), assumed=_LATER),
    _x("XH540-V150", 1150, ("24V", 300, 110), 230, (1920, 100), (0, 0, 800), current=(1188, 2.69e-3)),
    _x("XH540-V270", 1140, ("24V", 300, 110), 230, (1920, 100), (0, 0, 800), current=(1188, 2.69e-3), seen=False),
    _x("XW540-T260", 1170, ("x", 160, 95), 167, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3),
       assumed=(*_OLD, "LED")),
    _x("XW540-T140", 1180, ("x", 160, 95), 167, (1920, 100), (0, 0, 800), current=(2047, 2.69e-3), seen=False),
    _x("MX-28(2.0)", 30, ("x", 160, 95), 230, (1920, 100), (0, 0, 850), page="mx/mx-28-2",
       assumed=("Startup_Configuration",)),
    _x("MX-64(2.0)", 311, ("x", 160, 95), 435, (1920, 100), (0, 0, 850), page="mx/mx-64-2", current=(1941, 3.36e-3),
       assumed=("Startup_Configuration",)),
    _x("MX-106(2.0)", 321, ("x", 160, 95), 360, (1920, 100), (0, 0, 850), page="mx/mx-106-2",
       current=(2047, 3.36e-3), assumed=("Startup_Configuration",)),
)
"""The first is what counts for a servo that does not tell its model."""


# --- Registers of Dynamixel's X series (XL330, XL430, XM430 …), by the names of the e-manual with underscores ---------

_COUNT = 2.0 * math.pi / 4096.0  # rad
_MIDDLE = 2048  # counts at angle 0
_TICK = 1e-3  # s
FULL = 885.0  # PWM steps of the whole duty
SPEED = 0.229  # rpm a step
_RPM = math.pi / 30.0
_SPEED, _ACCELERATION = SPEED * _RPM, 214.577 * _RPM / 60.0  # rad/s and rad/s2 a step
_GUESS = "assumed"
_POSITION, _TURNS, _BY_CURRENT = 3, 4, 5
_by_voltage, _by_heat, _by_load = on(0, "Shutdown"), on(2, "Shutdown"), on(5, "Shutdown")
# Divisors of P up to which the range goes, assumed: of a model whose page was read, beyond the 141 of an MX-64(2.0) and
# the 147 of an MX-106(2.0), which were measured; of one that is not given, that of an XL330
_MOST, _MOST_OF_ANY = 150.0, 256.0
_NO_SCALE = "the scale of the feed-forward is not published; set firmware.velocity_feedforward and the like instead"
_FEEDBACK = tuple((name, address) for name, address in (
    ("Model_Information", 2), ("Firmware_Version", 6), ("Hardware_Error_Status", 70), ("Goal_Velocity", 104),
    ("Goal_Position", 116), ("Realtime_Tick", 120), ("Moving", 122), ("Moving_Status", 123), ("Present_PWM", 124),
    ("Present_Current", 126), ("Present_Load", 126), ("Present_Velocity", 128), ("Present_Position", 132),
    ("Velocity_Trajectory", 136), ("Position_Trajectory", 140), ("Present_Input_Voltage", 144),
    ("Present_Temperature", 146), ("Backup_Ready", 147)))
_KNOWN: dict[str, Register] = {
    "Position_P_Gain": Register(84, 1, 16383, 800, why="without P the servo does not control its angle"),
    "Position_I_Gain": Register(82, 0, 16383, 0),
    "Position_D_Gain": Register(80, 0, 16383, 0),
    "Feedforward_2nd_Gain": Register(88, 0, 16383, 0, (0,), _NO_SCALE),
    "Feedforward_1st_Gain": Register(90, 0, 16383, 0, (0,), _NO_SCALE),
    "Operating_Mode": Register(11, 0, 16, _POSITION, (_POSITION, _TURNS, _BY_CURRENT),
                               "only the position modes are computed"),
    "Drive_Mode": Register(10, 0, 13, 0, (0, 1, 8, 9), "profiles by time are not computed"),
    "Profile_Velocity": Register(112, 0, 32767, 0),
    "Profile_Acceleration": Register(108, 0, 32767, 0),
    "PWM_Limit": Register(36, 0, 885, 885),
    "Goal_PWM": Register(100, 0, 885, 885),
    "Current_Limit": Register(38, 0, 2352, 1193),
    "Goal_Current": Register(102, 1, 2352, 1193),
    "Temperature_Limit": Register(31, 0, 100, 80),
    "Min_Voltage_Limit": Register(34, 31, 300, 95),
    "Shutdown": Register(63, 0, 255, 52),
    "Bus_Watchdog": Register(98, 0, 127, 0),
    "PWM_Slope": Register(62, 1, 255, 140),
    "Min_Position_Limit": Register(52, 0, 4095, 0),
    "Max_Position_Limit": Register(48, 0, 4095, 4095),
    "Model_Number": Register(0, 0, 65535, 0),
    # without effect on the control of the angle
    "ID": Register(7, 0, 252, 1),
    "Baud_Rate": Register(8, 0, 7, 1),
    "Return_Delay_Time": Register(9, 0, 254, 250),
    "Secondary_ID": Register(12, 0, 255, 255),
    "Protocol_Type": Register(13, 1, 22, 2),
    "Homing_Offset": Register(20, -1044479, 1044479, 0),
    "Moving_Threshold": Register(24, 0, 1023, 10),
    "Max_Voltage_Limit": Register(32, 31, 300, 160),
    "Acceleration_Limit": Register(40, 0, 32767, 32767),
    "Velocity_Limit": Register(44, 0, 2047, 200),
    "Startup_Configuration": Register(60, 0, 3, 0),
    "Torque_Enable": Register(64, 0, 1, 0),
    "LED": Register(65, 0, 1, 0),
    "Status_Return_Level": Register(68, 0, 2, 2),
    "Registered_Instruction": Register(69, 0, 1, 0),
    "Velocity_I_Gain": Register(76, 0, 16383, 1920),
    "Velocity_P_Gain": Register(78, 0, 16383, 100),
    **{name: Register(address, -2**31, 2**31 - 1, 0, reading=True) for name, address in _FEEDBACK},
}
_WORDS = (
    "Model_Number PWM_Limit Current_Limit Velocity_I_Gain Velocity_P_Gain Position_D_Gain Position_I_Gain "
    "Position_P_Gain Feedforward_2nd_Gain Feedforward_1st_Gain Goal_PWM Goal_Current Realtime_Tick Present_PWM "
    "Present_Current Present_Load Present_Input_Voltage Max_Voltage_Limit Min_Voltage_Limit")
_LONG = (
    "Model_Information Homing_Offset Moving_Threshold Acceleration_Limit Velocity_Limit Max_Position_Limit "
    "Min_Position_Limit Goal_Velocity Profile_Acceleration Profile_Velocity Goal_Position Present_Velocity "
    "Present_Position Velocity_Trajectory Position_Trajectory")
REGISTERS: dict[str, Register] = laid(_KNOWN, sizes={2: _WORDS, 4: _LONG}, signs=dict.fromkeys((
    "Homing_Offset", "Goal_PWM", "Goal_Current", "Goal_Velocity", "Goal_Position", "Present_PWM", "Present_Current",
    "Present_Load", "Present_Velocity", "Present_Position", "Velocity_Trajectory", "Position_Trajectory")),
    stored=(range(64),), units={
    "count": "Homing_Offset Max_Position_Limit Min_Position_Limit Goal_Position Present_Position Position_Trajectory",
    "0.1 V": "Max_Voltage_Limit Min_Voltage_Limit Present_Input_Voltage", "°C": "Temperature_Limit Present_Temperature",
    "1/885": "PWM_Limit Goal_PWM Present_PWM", "20 ms": "Bus_Watchdog", "2 µs": "Return_Delay_Time",
    "0.229 rpm": "Moving_Threshold Velocity_Limit Goal_Velocity Profile_Velocity Present_Velocity Velocity_Trajectory",
    "214.577 rev/min²": "Acceleration_Limit Profile_Acceleration", "ms": "Realtime_Tick", "0.1 %": "Present_Load"})
"""By the e-manual's names with underscores; 0 to 63 outlive power-off."""


_SERVED = frozenset({
    "ID", "Baud_Rate", "Return_Delay_Time", "Status_Return_Level", "Homing_Offset", "Moving_Threshold", "Drive_Mode",
    "Velocity_Limit", "Current_Limit", "Torque_Enable", "Goal_Position", "Feedforward_1st_Gain",
    "Feedforward_2nd_Gain"})


def dynamixel_x(registers: Given, *, servo: str | Path | Servo) -> Servo:
    """Return a servo with registers of Dynamixel's X series set into its firmware.

    Which model it is, and with it the factory's values and the unit of the current, follows from Model_Number or the
    servo's name. Of a name that tells a series alone, such as xl330, what differs within the series is assumed; one
    that tells none counts as an XM430-W350, and all of it is assumed.

    Parameters
    ----------
    registers : mapping of str to int
        Raw values by the e-manual's names with underscores, such as ``{"Position_P_Gain": 400}``; all of a dump may be
        given. Angle 0 is at count 2048.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or a servo. A register that is not given keeps its value, or has the
        factory's.

    Raises
    ------
    UnknownNameError
        If there is no such register: the nearest are suggested.
    ParameterError
        If a value is not whole, out of range or not computed, or the model does not have the register.

    Examples
    --------
    >>> leg = dynamixel_x({"Position_P_Gain": 200}, servo="dynamixel-xl330-m288")
    >>> round(leg.firmware.proportional_gain, 5)
    0.57548
    """
    base = servo if isinstance(servo, Servo) else load_servo(servo)
    number = registers.get("Model_Number", 0) if isinstance(registers, Mapping) else 0
    if "PWM_Slope" in registers and base.supply.open_circuit_voltage is None:
        raise ParameterError(f"register PWM_Slope of Dynamixel X for {base.name!r}, whose supply voltage is not given")
    return set_registers(family_of(base, number), registers, base)


def family_of(servo: Servo, number: int = 0) -> Family:
    """Return the registers of a servo of this series, by its model number, else by its name."""
    return x_family(model_for(X_MODELS, servo, number, REGISTERS))


def x_family(model: XModel) -> Family:
    """Return the registers of a model."""
    lacking = {*(() if model.current_unit else OF_CURRENT), *(() if model.slope_unit else OF_SLOPE)}
    settings = tuple(setting for setting in (*_control(model), *_LIMITS, *_TRIPS)
                     if not lacking & set(setting.registers))
    return Family(
        label="Dynamixel X", model=model.name, reference=model.document, count=_COUNT, middle=_MIDDLE,
        current_sense=model.current_sense, registers=model.registers(REGISTERS), sets=LEROBOT_X_SETS,
        assumed=model.unseen(REGISTERS), masks=("Shutdown",), settings=settings,
        other_names={"Secondary_Shadow_ID": "Secondary_ID"},
        copied={"Goal_PWM": "PWM_Limit", **({"Goal_Current": "Current_Limit"} if model.current_unit else {})},
        check=lambda raw: _check(model, raw), served=_SERVED, idle=frozenset({"Bus_Watchdog"}), refuses=True)


def _check(model: XModel, raw: Raw) -> None:
    if raw["Operating_Mode"] == _BY_CURRENT and model.current_unit is None:
        raise ParameterError("register Operating_Mode of Dynamixel X", got=_BY_CURRENT,
                             allowed="3 or 4: this model does not sense its current")
    for goal, limit in (("Goal_PWM", "PWM_Limit"), ("Goal_Current", "Current_Limit")):
        if goal in raw and raw[goal] > raw[limit]:
            raise ParameterError(f"register {goal} of Dynamixel X", got=raw[goal], allowed=f"at most {limit} = "
                                 f"{raw[limit]}")
    low, high = raw["Min_Position_Limit"], raw["Max_Position_Limit"]
    if low >= high:
        raise ParameterError("register Min_Position_Limit of Dynamixel X", got=low,
                             allowed=f"less than Max_Position_Limit = {high}")


def _goal(name: str, register: str) -> Setting:
    return Setting(name, lambda raw, _: None if raw["Operating_Mode"] == _TURNS else (raw[register] - _MIDDLE) * _COUNT,
                   (register, "Operating_Mode"), "angle 0 at count 2048; mode 4 turns without end")


def _sureness(model: XModel) -> tuple[str, tuple[float, float]]:
    """Return how the divisor of P is known, and the ends of the range over the gain that it makes."""
    if model.measured:
        return "as recordings of an XL330 show; the manual says 128", (1.0, 1.0)
    if model.divisor != MANUAL:
        return "as of the XL330; the manual says 128", (1.0, model.divisor / MANUAL)
    most = _MOST if model.document else _MOST_OF_ANY
    return f"as the manual says; {MANUAL:g} to {most:g}", (MANUAL / most, 1.0)


def _control(model: XModel) -> tuple[Setting, ...]:
    unit, slope = model.current_unit or 0.0, model.slope_unit or 0.0
    divisor, scale = model.divisor, model.divisor / MANUAL  # the manual's: 128 of P, 65536 of I, 16 of D
    said, factors = _sureness(model)
    return (
        Setting("control_period", lambda raw, _: _TICK, said="a guess", origin=_GUESS, bounds=(5e-4, 2e-3)),
        Setting("compute_delay", lambda raw, _: 0.0, said="a guess", origin=_GUESS, bounds=(0.0, _TICK)),
        Setting("angle_quantum", lambda raw, _: _COUNT, said="4096 counts a turn"),
        Setting("filter_weight", lambda raw, _: 1.0, said="a guess: no filter", origin=_GUESS, bounds=(0.2, 1.0)),
        Setting("proportional_gain", lambda raw, _: raw["Position_P_Gain"] / (divisor * FULL * _COUNT),
                ("Position_P_Gain",), f"P/{divisor:g} steps of PWM a count, {said}",
                *(() if model.measured else (_GUESS, factors))),
        Setting("integral_gain", lambda raw, _: raw["Position_I_Gain"] / (scale * 65536.0 * FULL * _COUNT * _TICK),
                ("Position_I_Gain",), f"I/{scale * 65536.0:.0f} steps of PWM a count and tick, a guess", _GUESS,
                (0.5, 2.0)),
        Setting("derivative_gain", lambda raw, _: raw["Position_D_Gain"] * _TICK / (scale * 16.0 * FULL * _COUNT),
                ("Position_D_Gain",), f"D/{scale * 16.0:g} steps of PWM a count in a tick, a guess", _GUESS,
                (0.5, 2.0)),
        Setting("duty_quantum", lambda raw, _: 1.0 / FULL, said="PWM in 885 steps"),
        Setting("command_kind", lambda raw, _: "goal", ("Operating_Mode",), "goals on the bus"),
        Setting("current_limit", lambda raw, _: raw["Goal_Current"] * unit
                if raw["Operating_Mode"] == _BY_CURRENT else None,
                ("Goal_Current", "Operating_Mode"), f"{1e3 * unit:.3g} mA, in mode 5"),
        Setting("current_sense",
                lambda raw, _: model.current_sense if raw["Operating_Mode"] == _BY_CURRENT else None,
                ("Operating_Mode", "Goal_Current"), "in mode 5"),
        Setting("duty_slew", lambda raw, servo: raw["PWM_Slope"] * slope / servo.supply.open_circuit_voltage
                if servo.supply.open_circuit_voltage else None,
                ("PWM_Slope",), f"{slope:.4g} V/s over the supply, a guess", _GUESS, (0.5, 2.0)),
    )


_LIMITS = (
    Setting("torque_limit", lambda raw, _: raw["Goal_PWM"] / FULL, ("Goal_PWM",), "1/885, from PWM_Limit at power-up"),
    Setting("duty_limit", lambda raw, _: raw["PWM_Limit"] / FULL, ("PWM_Limit",), "1/885"),
    _goal("lower_goal", "Min_Position_Limit"),
    _goal("upper_goal", "Max_Position_Limit"),
    Setting("speed_limit", lambda raw, _: raw["Profile_Velocity"] * _SPEED or None, ("Profile_Velocity",), "0.229 rpm"),
    Setting("acceleration_limit", lambda raw, _: raw["Profile_Acceleration"] * _ACCELERATION or None,
            ("Profile_Acceleration",), "214.577 rev/min2"),
)
_TRIPS = (
    Setting("overload_output", lambda raw, _: 0.0 if _by_load(raw) else None, ("Shutdown",), "torque off"),
    Setting("overload_latches", lambda raw, _: "yes" if _by_load(raw) else "no", ("Shutdown",), "until a reboot"),
    Setting("trip_temperature", lambda raw, _: raw["Temperature_Limit"] + 273.15 if _by_heat(raw) else None,
            ("Temperature_Limit", "Shutdown"), "deg C"),
    Setting("undervoltage", lambda raw, _: raw["Min_Voltage_Limit"] * 0.1
            if _by_voltage(raw) and raw["Min_Voltage_Limit"] else None, ("Min_Voltage_Limit", "Shutdown"), "0.1 V"),
    Setting("undervoltage_action", lambda raw, _: "stop", ("Shutdown",)),
    Setting("signal_timeout", lambda raw, _: raw["Bus_Watchdog"] * 0.02 or None, ("Bus_Watchdog",), "20 ms"),
    Setting("signal_loss", lambda raw, _: "hold", said="stops where it is"),
)
