"""Transfer functions beside simulated sines: the analog servos of the catalog, friction and deadband off.

Gain of the angle command's response, in per cent of that of the transfer function, over frequency in parts of the
bandwidth; and once more with the play of the gear, where a file gives any.
"""

import math

import control
import numpy as np

import servotwin as st

PARTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.7, 1.0, 1.5)  # of the bandwidth
SIZES = (1.0, 5.0)  # deg
HOLDS_TO = 0.4  # of the bandwidth


def bare(servo: st.Servo, *, play: bool) -> st.Servo:
    """The servo without friction and deadband, and without the play of its gear unless that is asked for."""
    ends = ("deadband",) if play else ("deadband", "gear.backlash")
    off = [name for name in servo.names()
           if name.endswith(ends) or name.startswith(("friction.coulomb_torque", "friction.load_friction"))]
    return servo.replace(dict.fromkeys(off, 0.0))


def errors(model: st.PulseServo | st.BoundedServo) -> tuple[float, np.ndarray]:
    """Return the bandwidth [rad/s], and by how many per cent simulated sines differ in gain, shape (sizes, parts)."""
    system = st.linear.transfer_function(model, input="command_angle")
    bandwidth = float(control.bandwidth(system))
    frequencies = bandwidth * np.array(PARTS)
    if isinstance(model, st.PulseServo):
        frequencies = frequencies[frequencies < math.pi / model.frame_period]
    seen = st.linear.frequency_response(model, frequencies, amplitude=np.radians(SIZES))
    found = np.full((len(SIZES), len(PARTS)), np.nan)
    found[:, :len(frequencies)] = 100.0 * (seen.gain / np.abs(system(1j * frequencies)) - 1.0)
    return bandwidth, found


def row(name: str, model: st.PulseServo) -> tuple[float, float]:
    """Print a servo's row; return the worst errors up to 0.4 of the bandwidth, of its pulses, and of its bounded servo.

    The bounded one is taken at all frequencies.
    """
    bandwidth, pulsed = errors(model)
    _, bounded = errors(st.BoundedServo(model.servo))
    shown = " | ".join(" ".join("     -" if math.isnan(x) else f"{x:6.2f}" for x in line) for line in pulsed)
    print(f"{name:24} {bandwidth / (2.0 * math.pi):5.2f} Hz  {shown} | {np.abs(bounded).max():7.4f}", flush=True)
    low = np.array(PARTS) <= HOLDS_TO
    return float(np.nanmax(np.abs(pulsed[0, low]))), float(np.abs(bounded).max())


def main() -> None:
    servos = [servo for servo in map(st.load_servo, st.catalog_names()) if servo.kind == "analog"]
    print(f"{len(servos)} analog servos, friction and deadband off: gain of simulated sines beside that of the "
          "transfer function, error in %\nover frequency in parts of the bandwidth; last column: BoundedServo, worst")
    title = " ".join(f"{part:6g}" for part in PARTS)
    print(f"{'':24} {'':8}  " + " | ".join(f"{f'PulseServo, sines of {size:g} deg':{len(title)}}" for size in SIZES))
    print(f"{'servo':24} {'bandwidth':8} {title} | {title} | bounded")
    worst = [row(servo.name, st.PulseServo(bare(servo, play=False))) for servo in servos]
    pulsed, bounded = (max(column) for column in zip(*worst, strict=True))
    print(f"worst at {SIZES[0]:g} deg up to {HOLDS_TO} of the bandwidth: {pulsed:.2f} %; of the bounded servo: "
          f"{bounded:.4f} %\n\nwith the play of the gear, which no transfer function knows:")
    for servo in servos:
        if servo.get("gear.backlash"):
            row(servo.name, st.PulseServo(bare(servo, play=True)))


if __name__ == "__main__":
    main()
