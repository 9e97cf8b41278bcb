"""Logs of measured runs: what one is, and how files of several formats are read and written."""

from servotwin.logs.bam_convention import BamConvention
from servotwin.logs.bam_logs import read_bam_log, write_bam_log
from servotwin.logs.bam_parameters import read_bam_parameters, write_bam_parameters
from servotwin.logs.csv_logs import read_csv_log, write_log
from servotwin.logs.keep import keep_columns
from servotwin.logs.lerobot import read_lerobot_logs
from servotwin.logs.log import Log
from servotwin.logs.miuzei import read_miuzei_logs
from servotwin.logs.readers import read_logs
from servotwin.logs.reading import ReadColumn, Reading

__all__ = [
    "BamConvention",
    "Log",
    "ReadColumn",
    "Reading",
    "keep_columns",
    "read_bam_log",
    "read_bam_parameters",
    "read_csv_log",
    "read_lerobot_logs",
    "read_logs",
    "read_miuzei_logs",
    "write_bam_log",
    "write_bam_parameters",
    "write_log",
]
