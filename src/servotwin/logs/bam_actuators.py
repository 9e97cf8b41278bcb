"""BAM's actuators (github.com/Rhoban/bam): what its code knows of each, and its parameter files do not say."""

from __future__ import annotations

import math
from dataclasses import dataclass

from servotwin.errors import UnknownNameError

_TURN = 2.0 * math.pi
_STS = ("feetech-sts3215",)


@dataclass(frozen=True, kw_only=True)
class BamActuator:
    """What BAM's code says of one actuator.

    Parameters
    ----------
    error_gain : float or None
        Duty per radian and unit of the gain k_P [1/rad]; None if BAM sets a current or a torque, and no duty.
    largest_duty : float
        Most of the supply that the servo gets [1].
    speed : float or None
        At which the goal moves at most, where a file gives no max_velocity [rad/s].
    sets : {"duty", "current", "torque"}
        What its loop sets.
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
    """Return what BAM's code knows of an actuator.

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
