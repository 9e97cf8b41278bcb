"""Part 4: the first call after installation, when the kernels are compiled, and later ones, in fresh processes."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
CALL = "import million; million.run(1, {!r})"


def fresh(program: str, cache: str) -> float:
    """Return the time of a new process [s]."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", program], check=True, cwd=HERE, stdout=subprocess.DEVNULL,
                   env={**os.environ, "SERVOTWIN_CACHE_DIR": cache})
    return time.perf_counter() - start


def main() -> None:
    print("Fresh processes that import servotwin and simulate one servo by simulate_many")
    with tempfile.TemporaryDirectory() as cache:
        for dtype in ("float64", "float32"):
            program = CALL.format(dtype)
            first = fresh(program, cache)
            later = min(fresh(program, cache) for _ in range(5))
            print(f"  {dtype}: first call after installation {first:6.2f} s, later start-ups {later:5.2f} s")


if __name__ == "__main__":
    main()
