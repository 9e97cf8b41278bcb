"""What the bench in the browser costs: visitors, scenes, watchers, the page in a browser, and the page as one file.

`run.py` has six parts; `run.py one browser` runs only those named.
"""

import os
import sys

import alone
import browser
import visitors

PARTS = {"one": visitors.one, "eight": visitors.eight, "scenes": visitors.scenes, "watchers": visitors.watchers,
         "browser": browser.main, "alone": alone.main}


def main() -> None:
    for part in sys.argv[1:] or PARTS:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        print(f"{os.cpu_count()} cores, load of the machine {os.getloadavg()[0]:.1f}")
        PARTS[part]()
        print(flush=True)


if __name__ == "__main__":
    main()
