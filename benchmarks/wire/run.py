"""Our bus beside a bare responder without physics, in turns: six servos at 100 Hz, through Feetech's package and raw.

Ours holds an answer for the time of its bytes, 0.48 ms for six; the bare responder holds nothing.

    python benchmarks/wire/run.py [CYCLES] [TURNS]
"""

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
CASES = {"bare responder": ["bare.py"], "our codec, shafts that stand": ["ours.py", "still"],
         "six STS3215, free shafts": ["ours.py", "free"],
         "six STS3215, SO-101 in MuJoCo": ["ours.py", "arm"]}


def run(script, kind, cycles, ids=6):
    """Return what a server and its client say after so many cycles."""
    server = subprocess.Popen([sys.executable, HERE / script[0], *script[1:]], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, text=True)
    ports = server.stdout.readline().split()
    began = cpu_of(server.pid)
    clients = [subprocess.Popen([sys.executable, HERE / "client.py", kind, port, str(cycles), str(ids)],
                                stdout=subprocess.PIPE, text=True) for port in ports]
    said = [json.loads(client.communicate()[0]) for client in clients]
    took = said[0]["took"]
    cpu = cpu_of(server.pid) - began
    told = json.loads(server.communicate("")[0])
    return {"lost": sum(one["lost"] for one in said), "times": [t for one in said for t in one["times"]],
            "costs": told["costs"], "share": cpu / took, "client": said[0]["cpu"] / took,
            "behind": told.get("lost", 0.0)}


def cpu_of(pid):
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def quantile(values, share):
    values = sorted(values)
    return values[min(int(share * len(values)), len(values) - 1)]


def show(name, runs):
    times, costs = [t for one in runs for t in one["times"]], [c for one in runs for c in one["costs"]]
    print(f"{name:32} {sum(one['lost'] for one in runs):5d} of {len(times):<6d}"
          f"{1e3 * statistics.median(times):9.2f} {1e3 * quantile(times, 0.99):9.2f} {1e3 * max(times):9.1f}"
          f"{1e3 * statistics.median(costs):10.3f} {1e3 * quantile(costs, 0.99):8.3f} {1e3 * max(costs):8.2f}"
          f"{100 * statistics.median(one['share'] for one in runs):8.1f} %"
          f"{100 * statistics.median(one['client'] for one in runs):8.1f} %{sum(one['behind'] for one in runs):7.2f}")


def main():
    cycles, turns = (int(word) for word in (*sys.argv[1:], 500, 3)[:2])
    for kind in ("raw", "sdk"):
        found = {name: [] for name in CASES}
        for _ in range(turns):
            for name, script in CASES.items():
                found[name].append(run(script, kind, cycles))
        print(f"\nclient: {kind}; load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n"
              f"{'':32} {'lost':>15}{'answer ms':>9} {'99 %':>9} {'worst':>9}{'CPU ms':>10} {'99 %':>8} {'worst':>8}"
              f"{'server':>10}{'client':>10}{'behind s':>9}")
        for name, runs in found.items():
            show(name, runs)
    four = run(["ours.py", "four"], "raw", cycles, ids=5)
    print()
    show("20 STS3215 on four buses", [four])


if __name__ == "__main__":
    main()
