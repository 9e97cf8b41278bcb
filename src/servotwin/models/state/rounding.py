"""What rounding leaves of a number."""

UNIT = 2e-16  # relative to it
IN_FLOATS = {"UNIT": 1.2e-7}
"""The same where numbers have 32 bits, in C of floats; other modules say so of theirs under this name."""
