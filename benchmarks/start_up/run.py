"""Start-up: importing the package, and `servotwin simulate`, each in a fresh process with warm file caches."""

import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

BIN = Path(sys.executable).parent


def time_of(*command: str) -> float:
    """Return the best time of a fresh process [s]."""
    return best(lambda: subprocess.run(command, check=True, capture_output=True), 7)


def main() -> None:
    empty = time_of(sys.executable, "-c", "pass")
    rows = {"import numpy": time_of(sys.executable, "-c", "import numpy"),
            "import scipy.integrate": time_of(sys.executable, "-c", "import scipy.integrate"),
            "import servotwin": time_of(sys.executable, "-c", "import servotwin")}
    with tempfile.TemporaryDirectory() as folder:
        words = (str(BIN / "servotwin"), "simulate", "hitec-hs-755hb", "--step", "0:180", "--load", "inertia=1e-3",
                 "--model", "averaged", "--force", "--out", f"{folder}/run.csv")
        rows["servotwin simulate --out"] = time_of(*words)
        rows["servotwin simulate --out --plot"] = time_of(*words, "--plot", f"{folder}/run.png")
    peer = rows["import scipy.integrate"]
    print(f"Fresh processes; an empty one takes {1e3 * empty:.0f} ms")
    for name, seconds in rows.items():
        print(f"{name:34} {1e3 * seconds:6.0f} ms   {seconds / peer:4.2f} of import scipy.integrate")


if __name__ == "__main__":
    main()
