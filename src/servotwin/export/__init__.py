"""Servos for programs that have no Python: as C."""

from servotwin.export.c_code import CCode, c

__all__ = ["CCode", "c"]
