"""Our bus at a pseudo-terminal: `python ours.py still|free|arm|four`; as bare.py, and what it lost."""

import json
import sys
import time

import servotwin as st
from servotwin.wire import Seen
from servotwin.wire.arms import Asked, arm_bus
from servotwin.wire.service import Service

SUPPLY = "12V:0.1ohm"


class Still:
    """In the place of the crew: shafts that stand."""

    def __init__(self, models, *_):
        self._seen = Seen(0.0, 0.0, 0.0, 0.0, 0.0, 12.0, 0.0, 0.0, 0, 298.15)

    def seen(self, servo):
        return self._seen

    def failed(self):
        return None

    def __getattr__(self, name):
        return lambda *_: None


def buses(what):
    if what == "still":
        return [st.wire.Bus({k: "feetech-sts3215-12v" for k in range(1, 7)}, body=Still)]
    if what == "four":
        return [st.wire.Bus({k: "feetech-sts3215-12v" for k in range(1, 6)}, supply=st.Supply.of(SUPPLY))
                for _ in range(4)]
    return [arm_bus(Asked(arm="so101", supply=SUPPLY, body=what == "arm"), registers=lambda servo, words: servo)[0]]


def main():
    services = [Service(bus) for bus in buses(sys.argv[1])]
    for service in services:
        service.start()
    before = time.process_time()
    print(" ".join(service.port for service in services), flush=True)
    sys.stdin.read()
    cpu = time.process_time() - before
    costs = [cost for service in services for cost in service.timing.costs]
    timing = services[0].timing
    print(json.dumps({"costs": costs, "cpu": cpu, "lost": timing.lost, "losses": timing.losses}), flush=True)


if __name__ == "__main__":
    main()
