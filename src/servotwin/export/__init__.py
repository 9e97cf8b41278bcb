"""Servos for programs that have no Python: as C."""

from servotwin.export.c_code import c
from servotwin.export.c_writing import CCode
from servotwin.export.fmu import Fmu, fmu

__all__ = ["CCode", "Fmu", "c", "fmu"]
