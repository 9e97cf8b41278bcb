"""Faults of a log that show without a fit: one check a file."""
