"""Four servos on four AA cells: moved together, or only pulsed together, they pull the supply below a reset level."""

import numpy as np

import servotwin as st

# Fresh alkaline AA cells, four in series: 1.485 V with hardly a load, 0.107 V less for 0.5 A more (Energizer, technical
# bulletin "Battery Internal Resistance", version 1.1.0, 2005).
battery = st.Supply(open_circuit_voltage=4 * 1.485, internal_resistance=4 * 0.107 / 0.5)
# Typical level of an ATmega328P's brown-out detector with BODLEVEL = 100, from 4.1 V to 4.5 V (its data sheet, table
# "BODLEVEL Fuse Coding"). Assumed: it sees the battery itself; what a regulator between them drops would come on top.
RESET = 4.3  # V
FRAME, END, STEP = 0.02, 1.6, 2e-4  # s
BEFORE, AFTER = 700.0, 1300.0  # us

model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
cases = {"all at once": (0.0, 0.0), "moves 0.3 s apart": (0.3, 0.0), "and pulses 5 ms apart": (0.3, FRAME / 4)}
time = np.arange(0.0, END, STEP)
lowest, angles = [], []
for style, (name, (between_moves, between_pulses)) in enumerate(cases.items()):
    servos = {}
    for k in range(4):
        edges = between_pulses * k + FRAME * np.arange(round(END / FRAME))
        widths = np.where(edges < 0.1 + between_moves * k, BEFORE, AFTER)
        servos[f"joint {k + 1}"] = (model, st.signals.pulse_train(edges, widths, unit="us"), st.loads.Inertia(1e-3))
    fleet = st.simulate_bus(servos, supply=battery, duration=END, output_times=time).raise_if_failed()
    low = fleet.bus_voltage.reshape(-1, round(FRAME / STEP)).min(axis=1)
    print(f"{name:22} at least {fleet.bus_voltage.min():.2f} V, below {RESET} V in {np.sum(low < RESET):2d} frames of "
          f"{low.size}, at most {fleet.supply_current.max():.1f} A")
    lowest.append(st.plotting.Curve(name, FRAME * (np.arange(low.size) + 0.5), low, style=style))
    angles += [st.plotting.Curve("", time, np.degrees(fleet[joint]["output_angle"]), style=style)
               for joint in ("joint 1", "joint 4")]
figure = st.plotting.curves(
    lowest, x_label="time (s)", y_label="lowest supply in a frame (V)", limits=[st.plotting.Limit("reset", RESET)],
    below=angles, below_label="first and last\njoint (°)", height=4.6)
figure.axes[0].set_ylim(2.8, 7.0)  # room for the legend
st.plotting.save(figure, "brown_out.png", overwrite=True)
