"""The runs behind the numbers and pictures of docs/theory/supply_vibration.md."""

import math
from functools import cache

import servotwin as st
from servotwin.bench import Bench, ControlSupply, bench_servo, run_on_one_supply, standing

SOFT = 0.5  # ohm
START, END = 1.5, 4.0  # s: the stretch that is looked at
ROWS = (0.609, 1.002, 1.425, 1.827, 2.246)  # V: the commands of Table II
BEFORE = (1.002, 0.609, 0.609, 0.609, 0.609)  # V: from where each is reached
SEPARATE = ControlSupply(command_share=0.0)
RESISTANCES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
DELAYS = (2e-5, 2e-4, 1e-3, 2e-3, 4e-3, 1e-2)
SHARES = (0.05, 0.1, 0.2, 0.5, 1.0)
COUPLINGS = (0.0, 0.02, 0.1)
LONG = 12.0  # s: some servos wait seconds for the next jump
UNKNOWN = (("as in the servo file", {}), ("stretcher gain 60", {"electronics.stretcher_gain": 60.0}),
           ("stretcher gain 200", {"electronics.stretcher_gain": 200.0}),
           ("least drive time 0.3 ms", {"electronics.minimum_drive_time": 3e-4}),
           ("RC stretcher, 20 ms", {"electronics.stretcher_time_constant": 0.02}),
           ("bridge coasts", {"electronics.off_state": "coast"}),
           ("rotor inertia times 3", {"motor.rotor_inertia": 3.0}),
           ("brushes drop 0.3 V", {"motor.brush_drop_voltage": 0.3}))


@cache
def bench(resistance=SOFT, coupling=0.0):
    """The paper's bench on a supply with this internal resistance [ohm]."""
    servo = bench_servo(st.load_servo("hitec-hs-755hb"))
    return Bench(st.PulseServo(servo.replace({"supply.internal_resistance": resistance,
                                              "electronics.supply_coupling": coupling})))


@cache
def run(control=ControlSupply(), resistance=SOFT, coupling=0.0, row=2):  # noqa: B008 - frozen
    """A step to the command of a row of Table II."""
    command = st.signals.step(BEFORE[row], ROWS[row], at=0.1, unit="V")
    return run_on_one_supply(bench(resistance, coupling), command, END, control)


def target(row=2):
    """Angle without error at a row of Table II [rad]."""
    pulses = st.signals.constant(bench().pulse_width(ROWS[row]), unit="s", frame_period=0.016384)
    return st.Simulator(bench().model).initial(pulses)["output_angle"]


def cells(control=ControlSupply(), resistance=SOFT, coupling=0.0, row=2):  # noqa: B008
    """Where the shaft stands less where it should, how far it swings and how often, as text."""
    still = standing(run(control, resistance, coupling, row).result, START)
    off = f"{math.degrees(still.mean - target(row)):+.1f}°".replace("-", "−")
    return off, f"{math.degrees(still.swing):.2f}°", f"{still.frequency:.1f}", still


def swing(*case):
    """Swing and rate in one cell."""
    _, far, often, still = cells(*case)
    return f"{far}, {often} Hz" if still.frequency > 0.0 else far


def table(header, rows):
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows))


def case_table():
    """What vibrates, and what cures it."""
    cases = (("one soft supply", ControlSupply(), SOFT), ("separate supplies", SEPARATE, SOFT),
             ("one stiff supply, 0.02 Ω", ControlSupply(), 0.02),
             ("one soft supply, read 10 ms after the pulse", ControlSupply(sampling_delay=0.01), SOFT),
             ("separate command, reference on the supply",
              ControlSupply(command_share=0.0, reference_share=1.0), SOFT),
             ("command and reference on the supply", ControlSupply(reference_share=1.0), SOFT))
    rows = []
    for words, control, resistance in cases:
        off, far, often, still = cells(control, resistance)
        rows.append((words, off, far, often, f"{still.current:.2f}", f"{still.lowest_bus:.2f}"))
    return table(("circuit", "stands off by", "swing", "swings (1/s)", "current (A rms)", "lowest supply (V)"), rows)


def angle_table():
    """One soft supply and separate ones at the five angles of the paper."""
    rows = []
    for row, volts in enumerate(ROWS):
        common, apart = cells(row=row), cells(SEPARATE, row=row)
        rows.append((f"{45 * row}°", f"{volts:.3f}", *common[:3], *apart[:2]))
    return table(("row", "command (V)", "one supply: off by", "swing", "swings (1/s)", "separate: off by", "swing"),
                 rows)


def resistance_table():
    """Swing over the softness of the supply and the instant of the sample."""
    rows = [(f"{resistance:g} Ω", *(swing(ControlSupply(sampling_delay=delay), resistance) for delay in DELAYS))
            for resistance in RESISTANCES]
    return table(("", *(f"{1e3 * delay:g} ms" for delay in DELAYS)), rows)


def share_table():
    """Swing over the share of the sag that reaches the command."""
    rows = []
    for share in SHARES:
        control = ControlSupply(command_share=share)
        rows.append((f"{share:g}", cells(control)[0], swing(control)))
    return table(("share", "stands off by", "swing"), rows)


def coupling_table():
    """The chip's own coupling, with and without the path through the command."""
    rows = [(f"{c:g}", swing(SEPARATE, SOFT, c), swing(ControlSupply(), SOFT, c)) for c in COUPLINGS]
    return table(("$c_s$", "separate supplies", "one soft supply"), rows)


def unknown_table():
    """One soft supply and separate ones, for other values of what is not known of the servo."""
    rows = []
    for words, changes in UNKNOWN:
        servo = bench().model.servo
        inertia = changes.get("motor.rotor_inertia", 1.0) * servo.motor.rotor_inertia
        other = Bench(st.PulseServo(servo.replace({**changes, "motor.rotor_inertia": inertia})))
        command = st.signals.step(BEFORE[2], ROWS[2], at=0.1, unit="V")
        common, apart = (standing(run_on_one_supply(other, command, end, control).result, START)
                         for control, end in ((ControlSupply(), LONG), (SEPARATE, END)))
        rows.append((words, f"{math.degrees(common.swing):.1f}°", f"{common.frequency:.1f}",
                     f"{math.degrees(apart.swing):.1f}°", f"{apart.frequency:.1f}"))
    return table(("servo", "one supply: swing", "swings (1/s)", "separate: swing", "swings (1/s)"), rows)


@cache
def other(model, changes, control):
    """How a servo of another model or on another supply stands at 90°."""
    servo = bench_servo(st.load_servo("hitec-hs-755hb")).replace(dict(changes))
    command = st.signals.step(BEFORE[2], ROWS[2], at=0.1, unit="V")
    return standing(run_on_one_supply(Bench(model(servo)), command, END, control).result, START)


def inductance_table():
    """The servo with and without its armature's inductance, on a resistance and behind a regulator."""
    soft = (("supply.internal_resistance", SOFT),)
    cases = [(f"one soft supply, read after {1e3 * d:g} ms", soft, ControlSupply(sampling_delay=d))
             for d in (2e-5, 1e-4, 2e-4, 1e-3, 1e-2)]
    cases += [("separate supplies", soft, SEPARATE)]
    for limit in (1.0, 1.9):
        cases += [(f"one regulator, {limit:g} A", (("supply.current_limit", limit),), ControlSupply())]
    cases += [("separate, 1 A for the servo", (("supply.current_limit", 1.0),), SEPARATE)]
    rows = []
    for words, changes, control in cases:
        cells = []
        for model in (st.PulseServo, st.PulseServoInductive):
            still = other(model, changes, control)
            cells += [f"{math.degrees(still.swing):.1f}°", f"{still.frequency:.1f}"]
        rows.append((words, *cells))
    return table(("circuit", "without: swing", "swings (1/s)", "with inductance: swing", "swings (1/s)"), rows)


TABLES = {"case": case_table, "angle": angle_table, "resistance": resistance_table, "share": share_table,
          "unknown": unknown_table, "coupling": coupling_table,
          "inductance": inductance_table}

if __name__ == "__main__":
    print("\n\n".join(make() for make in TABLES.values()))
