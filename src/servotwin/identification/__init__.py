"""Identification of servos from logs: parameters with intervals. Every part is loaded when it is first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servotwin.identification.arms.arm_fit import ArmFit
    from servotwin.identification.arms.identify_arm import identify_arm
    from servotwin.identification.fitting.advise import Advice, Experiment, advise
    from servotwin.identification.fitting.checks import findings
    from servotwin.identification.fitting.fit import Fit, Ladder, Rung, Start, Validation
    from servotwin.identification.fitting.identify import identify
    from servotwin.identification.fitting.ladder import (
        RUNGS,
        Structure,
        as_structure,
        compare_structures,
        friction_ladder,
    )
    from servotwin.identification.fitting.search.case import LogPart, Point
    from servotwin.identification.fitting.search.forecast import Forecast
    from servotwin.identification.fitting.search.free import LUMPED, FreeParameter, Space
    from servotwin.identification.fitting.suspicions.look import Finding
    from servotwin.identification.fitting.traces import ErrorTable, Interval, LogError, Trace
    from servotwin.identification.fitting.uncertainty import Uncertainty, Unidentifiable
    from servotwin.identification.fitting.validate import validate
    from servotwin.identification.fitting.verdict import Cause, Verdict
    from servotwin.identification.fitting.yielding import Yielded
    from servotwin.identification.sheets.motor_range import (
        Contradiction,
        MotorRange,
        Range,
        motor_range,
        sheet_contradictions,
        sheet_flags,
    )
    from servotwin.identification.sheets.servo_of_sheet import servo_from_sheet
    from servotwin.identification.sheets.sheet import (
        Sheet,
        SheetList,
        SheetPoint,
        read_sheets,
        servo_file_text,
        sheet_of,
        sheet_table,
        write_servo_text,
    )
    from servotwin.logs import (
        BamConvention,
        Log,
        ReadColumn,
        Reading,
        keep_columns,
        read_bam_log,
        read_bam_parameters,
        read_csv_log,
        read_lerobot_logs,
        read_logs,
        read_miuzei_logs,
        write_bam_log,
        write_bam_parameters,
        write_log,
    )

# where each name is at home
_HOMES = {
    "identification.arms.arm_fit": ("ArmFit",),
    "identification.arms.identify_arm": ("identify_arm",),
    "identification.fitting.advise": ("Advice", "Experiment", "advise"),
    "identification.fitting.search.case": ("LogPart", "Point"),
    "identification.fitting.checks": ("findings",),
    "identification.fitting.fit": ("Fit", "Ladder", "Rung", "Start", "Validation"),
    "identification.fitting.search.forecast": ("Forecast",),
    "identification.fitting.search.free": ("LUMPED", "FreeParameter", "Space"),
    "identification.fitting.identify": ("identify",),
    "identification.fitting.ladder": (
        "RUNGS", "Structure", "as_structure", "compare_structures", "friction_ladder"),
    "identification.fitting.suspicions.look": ("Finding",),
    "identification.fitting.uncertainty": ("Uncertainty", "Unidentifiable"),
    "identification.fitting.traces": ("ErrorTable", "Interval", "LogError", "Trace"),
    "identification.fitting.validate": ("validate",),
    "identification.fitting.verdict": ("Cause", "Verdict"),
    "identification.fitting.yielding": ("Yielded",),
    "identification.sheets.motor_range": (
        "Contradiction", "MotorRange", "Range", "motor_range", "sheet_contradictions", "sheet_flags"),
    "identification.sheets.servo_of_sheet": ("servo_from_sheet",),
    "identification.sheets.sheet": (
        "Sheet", "SheetList", "SheetPoint", "read_sheets", "servo_file_text", "sheet_of", "sheet_table",
        "write_servo_text"),
    "logs": (
        "BamConvention", "Log", "ReadColumn", "Reading", "keep_columns", "read_bam_log", "read_bam_parameters",
        "read_csv_log", "read_lerobot_logs", "read_logs", "read_miuzei_logs", "write_bam_log",
        "write_bam_parameters", "write_log"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "LUMPED",
    "RUNGS",
    "Advice",
    "ArmFit",
    "BamConvention",
    "Cause",
    "Contradiction",
    "ErrorTable",
    "Experiment",
    "Finding",
    "Fit",
    "Forecast",
    "FreeParameter",
    "Interval",
    "Ladder",
    "Log",
    "LogError",
    "LogPart",
    "MotorRange",
    "Point",
    "Range",
    "ReadColumn",
    "Reading",
    "Rung",
    "Sheet",
    "SheetList",
    "SheetPoint",
    "Space",
    "Start",
    "Structure",
    "Trace",
    "Uncertainty",
    "Unidentifiable",
    "Validation",
    "Verdict",
    "Yielded",
    "advise",
    "as_structure",
    "compare_structures",
    "findings",
    "friction_ladder",
    "identify",
    "identify_arm",
    "keep_columns",
    "motor_range",
    "read_bam_log",
    "read_bam_parameters",
    "read_csv_log",
    "read_lerobot_logs",
    "read_logs",
    "read_miuzei_logs",
    "read_sheets",
    "servo_file_text",
    "servo_from_sheet",
    "sheet_contradictions",
    "sheet_flags",
    "sheet_of",
    "sheet_table",
    "validate",
    "write_bam_log",
    "write_bam_parameters",
    "write_log",
    "write_servo_text",
]


def __getattr__(name: str) -> Any:
    if name in _HOME_OF:
        return getattr(import_module(f"servotwin.{_HOME_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
