"""The emulated bench beside real time: four channels at 1 kHz while the servo goes to and fro.

Seconds of the board per second on the wall, and what a second of the board costs: the program under simavr (processor
time of its process, part of which runs while the servo is computed), the servo on its pins, and the rest: pipes between
the two processes, frames of the wire, and waiting. The bar is 1: it has to keep up with a program that takes it for a
board.
"""

import os
import sys
import time

import servotwin as st
from servotwin.bench.backends import EmulatedBackend
from servotwin.bench.emulator.plant import ServoOnPins
from servotwin.bench.wire import Board, protocol

SECONDS = 10.0
WIDTHS = (1.2e-3, 1.8e-3)
PERIODS = (0.02, 1.0 / 300.0)
HALF = 0.4  # s from one command to the next
DIGITAL = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0}


class Timed:
    """A plant, and how long it has taken [s]."""

    def __init__(self, plant: ServoOnPins) -> None:
        self.plant, self.spent, self.samples = plant, 0.0, 0

    def rise(self, moment: float) -> None:
        start = time.perf_counter()
        self.plant.rise(moment)
        self.spent += time.perf_counter() - start

    def fall(self, moment: float) -> None:
        start = time.perf_counter()
        self.plant.fall(moment)
        self.spent += time.perf_counter() - start

    def voltage(self, channel: str, moment: float) -> float:
        start = time.perf_counter()
        volts = self.plant.voltage(channel, moment)
        self.spent += time.perf_counter() - start
        self.samples += 1
        return volts


def processor_time(pid: int) -> float:
    """Return the time that a process has computed for [s]."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        user, system = file.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def measured(model: st.PulseServo | st.DigitalServo, period: float) -> tuple[float, float, float, float]:
    """Return wall time, simavr's, the servo's and the rest [s] for a second of the board."""
    plant = Timed(ServoOnPins(model))
    wire = EmulatedBackend(plant)
    board, ticks = Board(wire), protocol().ticks
    board.open()
    board.order("stream", mask=15, rate=protocol().words["rate"]["fast"], reference=0)
    board.order("pulse", width=ticks(WIDTHS[0]), period=ticks(period))
    board.wait(0.2)
    computed, plant.spent, plant.samples = processor_time(wire.pid), 0.0, 0
    begun, start, k = wire.time, time.perf_counter(), 0
    while wire.time < begun + SECONDS:
        k += 1
        board.order("pulse", width=ticks(WIDTHS[k % 2]), period=ticks(period))
        while wire.time < begun + k * HALF:
            board.take(0.05)
    wall, passed = time.perf_counter() - start, wire.time - begun
    computed = processor_time(wire.pid) - computed
    board.close()
    if plant.samples < 3.9e3 * passed:
        sys.exit(f"run.py: only {plant.samples} conversions in {passed:.1f} s")
    return wall / passed, computed / passed, plant.spent / passed, (wall - plant.spent) / passed


def main() -> None:
    analog = st.load_servo("hitec-hs-755hb")
    models = {"PulseServo": st.PulseServo(analog), "DigitalServo, 1 ms": st.DigitalServo(analog.replace(DIGITAL))}
    print(f"{'model':20} {'frames':>7} {'x real time':>12} {'simavr':>8} {'servo':>8} {'rest':>8}   (s per second)")
    for name, model in models.items():
        for period in PERIODS:
            wall, simavr, servo, rest = measured(model, period)
            print(f"{name:20} {1.0 / period:4.0f} Hz {1.0 / wall:12.2f} {simavr:8.2f} {servo:8.2f} {rest:8.2f}",
                  flush=True)


if __name__ == "__main__":
    main()
