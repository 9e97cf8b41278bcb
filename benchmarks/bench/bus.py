"""Recording six bus servos at 100 Hz: what share of a core the recorder takes; the servos live in another process.

`python benchmarks/bench/bus.py 10` records ten seconds of each kind. Every servo gets a log of its own, row by row. The
peers answer after the time that their bytes take on a wire of 1 Mbit/s.
"""

import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from servotwin.bench.backends import SerialBackend
from servotwin.bench.bus import Bus, columns_of
from servotwin.bench.recording import Experiment, Hold

PEERS = Path(__file__).resolve().parents[2] / "tests" / "bench" / "bus_peers.py"
CASES = [("feetech", 6, 100.0), ("dynamixel-2", 6, 100.0), ("dynamixel-1", 6, 100.0), ("feetech", 1, 100.0),
         ("feetech", 1, 500.0), ("dynamixel-2", 1, 500.0)]
BAR = 0.5  # of a core, for six at 100 Hz


def recorded(protocol: str, count: int, rate: float, seconds: float, folder: Path) -> dict[str, float]:
    """Return what it took to record some servos."""
    peer = subprocess.Popen([sys.executable, str(PEERS), protocol, str(count)], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True)
    assert peer.stdout is not None
    bus = Bus(SerialBackend(peer.stdout.readline().strip(), 1_000_000), protocol, range(1, count + 1), rate=rate)
    bus.open()
    try:
        bus.approach(dict.fromkeys(bus.ids, 0.0))
        holds = [Hold(0.25, 0.3 * (-1) ** k) for k in range(round(4 * seconds))]
        run = Experiment(name="run", motion="steps", kind="angle", holds=holds)
        rows = 0
        with ExitStack() as stack:
            files = {one: stack.enter_context((folder / f"{protocol}-{one}.csv").open("w", buffering=1))
                     for one in bus.ids}
            for one, file in files.items():
                file.write(",".join(columns_of(bus, one)) + "\n")
            core, wall = time.process_time(), time.perf_counter()
            for tick in bus.run(dict.fromkeys(bus.ids, run)):
                for one, row in tick.items():
                    files[one].write(",".join(map(repr, row)) + "\n")
                rows += 1
            core, wall = time.process_time() - core, time.perf_counter() - wall
        return {"share": core / wall, "rows": rows / wall, "late": bus.late,
                "lost": sum(servo.lost for servo in bus.servos.values())}
    finally:
        bus.close()
        peer.communicate("")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    print(f"{'protocol':12} servos  rate Hz  rows/s  late ticks  lost answers  core")
    with tempfile.TemporaryDirectory() as folder:
        for protocol, count, rate in CASES:
            made = recorded(protocol, count, rate, seconds, Path(folder))
            bar = f"   {made['share'] / BAR:.2f} of the bar" if (count, rate) == (6, 100.0) else ""
            print(f"{protocol:12} {count:6} {rate:8.0f} {made['rows']:7.1f} {made['late']:11.0f} {made['lost']:13.0f}  "
                  f"{made['share']:.3f}{bar}")


if __name__ == "__main__":
    main()
