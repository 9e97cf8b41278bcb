"""Models with the registers of Dynamixel's X series, each against the control table of its own e-manual page."""

from __future__ import annotations

from dataclasses import dataclass

from servotwin.parameters.registers.model import RegisterModel

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
