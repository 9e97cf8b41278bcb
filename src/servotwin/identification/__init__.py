"""What a servo is, from logs of what it did: parameters with intervals."""

from servotwin.identification.arms import ArmFit, identify_arm
from servotwin.identification.fitting.advise import Advice, Experiment, advise
from servotwin.identification.fitting.choosing import Ladder, Rung
from servotwin.identification.fitting.findings import Finding, findings
from servotwin.identification.fitting.fit import Fit, Interval, Start, Trace
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.free import LUMPED, FreeParameter, Space
from servotwin.identification.fitting.holdout import ErrorTable, LogError
from servotwin.identification.fitting.identify import identify
from servotwin.identification.fitting.ladder import RUNGS, friction_ladder
from servotwin.identification.fitting.point import LogPart, Point
from servotwin.identification.fitting.structures import Structure, as_structure, compare_structures
from servotwin.identification.fitting.uncertainty import Uncertainty
from servotwin.identification.fitting.validate import Validation, validate
from servotwin.identification.fitting.verdict import Cause, Verdict
from servotwin.identification.fitting.words import Unidentifiable
from servotwin.identification.fitting.yielding import Yielded
from servotwin.identification.sheets.contradictions import Contradiction, sheet_contradictions, sheet_flags
from servotwin.identification.sheets.csv_sheets import SheetList, read_sheets
from servotwin.identification.sheets.motor_range import MotorRange, Range, motor_range
from servotwin.identification.sheets.servo_of_sheet import servo_from_sheet
from servotwin.identification.sheets.sheet import Sheet, SheetPoint
from servotwin.identification.sheets.sheet_file import servo_file_text, sheet_of, sheet_table, write_servo_text
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
