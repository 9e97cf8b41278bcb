"""What the bench in the browser costs: visitors, scenes, watchers, and the page in a browser.

`run.py` has five parts; `run.py one browser` runs only those named.
"""

import os
import sys

import browser
import visitors

PARTS = {"one": visitors.one, "eight": visitors.eight, "scenes": visitors.scenes, "watchers": visitors.watchers,
         "browser": browser.main}


def main() -> None:
    for part in sys.argv[1:] or PARTS:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        print(f"{os.cpu_count()} cores, load of the machine {os.getloadavg()[0]:.1f}")
        PARTS[part]()
        print(flush=True)


if __name__ == "__main__":
    main()
