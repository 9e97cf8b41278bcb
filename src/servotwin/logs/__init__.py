"""Logs of measured runs: what one is, and how files of several formats are read and written.

A name is loaded when it is first used, so that the help of a command can list the formats.
"""

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from servotwin.logs.bam_logs import BAM_ACTUATORS as BAM_ACTUATORS
    from servotwin.logs.bam_logs import BamActuator as BamActuator
    from servotwin.logs.bam_logs import BamConvention as BamConvention
    from servotwin.logs.bam_logs import read_bam_log as read_bam_log
    from servotwin.logs.bam_logs import read_bam_parameters as read_bam_parameters
    from servotwin.logs.bam_logs import write_bam_log as write_bam_log
    from servotwin.logs.bam_logs import write_bam_parameters as write_bam_parameters
    from servotwin.logs.csv_logs import read_csv_log as read_csv_log
    from servotwin.logs.csv_logs import write_log as write_log
    from servotwin.logs.formats import LOG_FORMATS as LOG_FORMATS
    from servotwin.logs.formats import LogFormat as LogFormat
    from servotwin.logs.formats import ReadColumn as ReadColumn
    from servotwin.logs.formats import Reading as Reading
    from servotwin.logs.lerobot import read_lerobot_logs as read_lerobot_logs
    from servotwin.logs.log import Log as Log
    from servotwin.logs.miuzei import read_miuzei_logs as read_miuzei_logs
    from servotwin.logs.readers import keep_columns as keep_columns
    from servotwin.logs.readers import read_logs as read_logs

# public name -> module that defines it
_LAZY = {
    "BAM_ACTUATORS": "bam_logs", "BamActuator": "bam_logs", "BamConvention": "bam_logs",
    "LOG_FORMATS": "formats", "Log": "log", "LogFormat": "formats", "ReadColumn": "formats", "Reading": "formats",
    "keep_columns": "readers", "read_bam_log": "bam_logs", "read_bam_parameters": "bam_logs",
    "read_csv_log": "csv_logs", "read_lerobot_logs": "lerobot", "read_logs": "readers", "read_miuzei_logs": "miuzei",
    "write_bam_log": "bam_logs", "write_bam_parameters": "bam_logs", "write_log": "csv_logs",
}
__all__ = sorted(_LAZY)


def __getattr__(name: str) -> "Any":
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
