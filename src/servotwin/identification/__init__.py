"""What a servo is, from logs of what it did: parameters with intervals."""

from servotwin.identification.advise import Advice, Experiment, advise
from servotwin.identification.bam_convention import BamConvention
from servotwin.identification.bam_logs import read_bam_log, write_bam_log
from servotwin.identification.bam_parameters import read_bam_parameters, write_bam_parameters
from servotwin.identification.csv_logs import read_csv_log, write_log
from servotwin.identification.fit import Fit, Interval, Start, Trace
from servotwin.identification.forecast import Forecast
from servotwin.identification.free import LUMPED, FreeParameter, Space
from servotwin.identification.holdout import ErrorTable, LogError
from servotwin.identification.identify import identify
from servotwin.identification.ladder import RUNGS, Ladder, Rung, friction_ladder
from servotwin.identification.log import Log
from servotwin.identification.miuzei import read_miuzei_logs
from servotwin.identification.point import LogPart, Point
from servotwin.identification.readers import read_logs
from servotwin.identification.sheet import Sheet, SheetPoint
from servotwin.identification.sheet_csv import SheetList, read_sheets
from servotwin.identification.sheet_file import servo_file_text, sheet_of, sheet_table, write_servo_text
from servotwin.identification.sheet_motor import MotorRange, Range, motor_range
from servotwin.identification.sheet_servo import servo_from_sheet
from servotwin.identification.sheet_words import Contradiction, sheet_contradictions, sheet_flags
from servotwin.identification.uncertainty import Uncertainty
from servotwin.identification.validate import Validation, validate
from servotwin.identification.words import Unidentifiable

__all__ = [
    "LUMPED",
    "RUNGS",
    "Advice",
    "BamConvention",
    "Contradiction",
    "ErrorTable",
    "Experiment",
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
    "Rung",
    "Sheet",
    "SheetList",
    "SheetPoint",
    "Space",
    "Start",
    "Trace",
    "Uncertainty",
    "Unidentifiable",
    "Validation",
    "advise",
    "friction_ladder",
    "identify",
    "motor_range",
    "read_bam_log",
    "read_bam_parameters",
    "read_csv_log",
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
