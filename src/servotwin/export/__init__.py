"""Servos for programs that have no Python: as C."""

from servotwin.export.c_code import CCode, c
from servotwin.export.fmu import Fmu, fmu

__all__ = ["CCode", "Fmu", "c", "fmu"]
