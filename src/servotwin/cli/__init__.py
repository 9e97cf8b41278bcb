"""The command `servotwin`: parse, call, show; no physics.

Nothing but the standard library is loaded before the command line is read.
"""

from servotwin.cli.entry import main

__all__ = ["main"]
