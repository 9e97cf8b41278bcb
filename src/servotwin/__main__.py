"""`python -m servotwin` is the command `servotwin`."""

import sys

from servotwin.cli import main

if __name__ == "__main__":
    sys.exit(main())
