"""Causes of residuals that are not noise: candidates, tried one by one on a few logs, ranked by their gain."""

from servotwin.identification.fitting.diagnosis.trials import diagnose

__all__ = ["diagnose"]
