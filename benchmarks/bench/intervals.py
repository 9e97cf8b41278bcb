"""How often 95 % intervals of a fit hold the truth where the logs come from the emulated bench.

Twenty random servos (about an HS-755HB; six parameters each) are recorded by the firmware under simavr: steps, a random
sequence, a ramp, a staircase of 1 us, the tap alone, 1 mV of noise and whole counts. The search begins 10 to 30 % off,
without priors. Intervals without ends (undetermined) are counted apart.
"""

import math
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from bench_fits import FREE, judged

SERVOS = 20


def main(count: int = SERVOS) -> None:
    print(f"intervals of {count} servos on the emulated bench, {len(FREE)} each")
    for rate in ("frame", "fast"):
        start = time.perf_counter()
        found = [judged(seed, rate=rate) for seed in range(count)]
        ends = [(name, held, one.off[name]) for one in found for name, held in one.held.items()
                if math.isfinite(one.off[name])]
        missed = Counter(name.split(".")[-1] for name, held, _ in ends if not held)
        share = 100.0 * np.mean([held for _, held, _ in ends])
        off = np.array([value for *_, value in ends])
        print(f"  rate {rate:5}: {share:5.1f} % of {len(ends)} hold the truth (without ends: "
              f"{count * len(FREE) - len(ends)}); off by {np.sqrt(np.mean(off**2)):.2f} half widths rms, "
              f"{np.abs(off).max():.2f} at most; missed: "
              f"{', '.join(f'{name} {n}' for name, n in missed.most_common()) or 'none'}; "
              f"{(time.perf_counter() - start) / count:.1f} s a servo", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
