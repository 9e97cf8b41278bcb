"""Models of Feetech's STS series, each against what was published of its registers."""

from __future__ import annotations

from dataclasses import dataclass

from servotwin.parameters.registers.model import RegisterModel


@dataclass(frozen=True, kw_only=True)
class StsModel(RegisterModel):
    """A model of the STS series.

    Parameters
    ----------
    current_unit : float
        Of Protection_Current and Present_Current [A].
    unit_assumed : bool
        Whether that unit is assumed.
    """

    current_unit: float = 6.5e-3
    unit_assumed: bool = False


_TABLE = "Feetech, memory table of the STS series"
_PAGE = "https://wiki.aifitlab.com/feetech-servo-motor-docs/feetech-sts-servo-memory-table-analysis"
_DUMP = "factory dump of an STS3215, firmware 3.10 (github.com/0o8o0-blip/sts3215-firmware)"
_BAM = "github.com/Rhoban/bam, bam/feetech/actuator.py: 3400 counts/s"
_DUMPED = ("Phase", "Unloading_Condition", "LED_Alarm_Condition", "P_Coefficient", "D_Coefficient",
           "Minimum_Startup_Force", "Protection_Current", "Velocity_closed_loop_P_proportional_coefficient",
           "Velocity_closed_loop_I_integral_coefficient", "Moving_Velocity_Threshold", "DTs", "Minimum_Velocity_Limit",
           "Maximum_Acceleration", "Acceleration_Multiplier")  # the table of the series leaves these open
_ELSEWHERE = {**dict.fromkeys(_DUMPED, _DUMP), "Maximum_Velocity_Limit": _BAM}
_UNITS = frozenset({"Velocity_Unit_factor", "Goal_Time"})  # 82 and 44: sources disagree, or say nothing

STS_MODELS = (
    StsModel(name="STS3215-7V4", number=777, document=_TABLE, page=_PAGE, elsewhere=_ELSEWHERE,
             values={"Max_Voltage_Limit": 80}, assumed=_UNITS | {"Max_Voltage_Limit"}),
    StsModel(name="STS3215-12V", number=777, document=_TABLE, page=_PAGE, assumed=_UNITS,
             elsewhere={**_ELSEWHERE, "Max_Voltage_Limit": _DUMP}),
    StsModel(name="STS3250", number=2825, document=_TABLE, page=_PAGE,
             values={"Maximum_Velocity_Limit": 254}, current_unit=3.8 / 310.0, unit_assumed=True,
             units=dict.fromkeys(("Protection_Current", "Present_Current"), f"{3800.0 / 310.0:.4g} mA, assumed"),
             assumed=_UNITS | {"Maximum_Velocity_Limit", "Max_Voltage_Limit", *_DUMPED}),
)
"""The first is what counts for a servo that does not tell its model."""
