"""Set S, the invented servo of docs/theory/averaging.md, and the runs behind that page's numbers and pictures."""

import math
from functools import cache

import numpy as np

import servotwin as st

R, K_OUT, DRIVE_VOLTAGE, FRICTION = 3.1, 1.03, 5.6, 0.2  # ohm, N m/A, V, N m
DEADBAND, STRETCHER, PULSE_PER_RADIAN = 8e-6, 60.0, 573e-6  # s, 1, s/rad
PERIODS = (0.02, 0.01, 0.005)  # s
RISE = 0.1  # N m/s: a load that grows slowly


def servo(**electronics):
    """Set S as a servo; its one-shot is 0.6 ms long at 0°."""
    slope = 1e-3  # s/V
    return st.servo_from_values("set-s", {
        "motor": {"armature_resistance": R, "torque_constant": K_OUT, "back_emf_constant": K_OUT,
                  "rotor_inertia": 6e-3, "motor_viscous_friction": 0.0},
        "gear": {"gear_reduction": 1.0},
        "friction": {"coulomb_torque_forward": FRICTION, "coulomb_torque_backward": FRICTION},
        "electronics": {"frame_period": 0.02, "deadband": DEADBAND, "stretcher_gain": STRETCHER, "off_state": "brake",
                        "minimum_drive_time": 0.0, "one_shot_offset": 0.0, "one_shot_slope": slope, **electronics},
        "potentiometer": {"feedback_gain": PULSE_PER_RADIAN / slope, "feedback_offset": 6e-4 / slope},
        "supply": {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 6.0 - DRIVE_VOLTAGE},
    })


def models(period):
    """The pulse servo and the servo with the mean of its pulses."""
    pulsed = st.PulseServo(servo(frame_period=period))
    return pulsed, pulsed.averaged()


def stiffness(period):
    """Torque per angle by the formula [N m/rad]."""
    return st.physics.pulse_stiffness(K_OUT / R, DRIVE_VOLTAGE, STRETCHER, PULSE_PER_RADIAN, period)


def mean_sag(model, torque, start, end):
    """Mean sag [deg] from `start` to `end` [s], the load there from t = 0 on."""
    times = start + (end - start) * (np.arange(2400) + 0.5) / 2400
    result = st.simulate(model, st.signals.constant(0.0, unit="deg"), duration=end, load=st.loads.Constant(torque),
                         output_times=times)
    return -math.degrees(float(result["output_angle"].mean()))


@cache
def settled_sag(period, torque):
    """Mean sag [deg] of the pulses, three seconds after the load came."""
    return mean_sag(models(period)[0], torque, 3.0, 4.0)


def held_in_the_mean(period, torque):
    """Part of the load [N m] that friction holds in the mean, once the pulses have settled."""
    result = st.simulate(models(period)[0], st.signals.constant(0.0, unit="deg"), duration=4.0,
                         load=st.loads.Constant(torque), output_times=3.0 + 1e-5 * (np.arange(100_000) + 0.5))
    return torque - float(result["motor_torque"].mean())


def slow_sag(period, torque):
    """Sag [deg] of the mean voltage under a load that has grown slowly to `torque`."""
    end = torque / RISE
    result = st.simulate(models(period)[1], st.signals.constant(0.0, unit="deg"), duration=end,
                         load=st.loads.Recorded([0.0, end], [0.0, torque]), output_times=[end])
    return -math.degrees(float(result["output_angle"][0]))


def slope(sag, period):
    """Torque per angle between 0.3 N m and 0.6 N m [N m/rad]."""
    return 0.3 / math.radians(sag(period, 0.6) - sag(period, 0.3))


def after_step(model, degrees, duration):
    """Output angle [deg] every millisecond after a step at t = 0."""
    result = st.simulate(model, st.signals.step(0.0, degrees, unit="deg"), duration=duration)
    return result.time, np.degrees(result["output_angle"])


def table(header, rows):
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows))


def sag_table():
    """Sag of the pulses after a second and when it has settled, and of their mean voltage."""
    rows = []
    for period in PERIODS:
        for torque in (0.3, 0.6):
            pulsed, mean = models(period)
            rows.append((f"{1e3 * period:g} ms", f"{torque:g}", f"{mean_sag(pulsed, torque, 0.6, 1.2):.2f}°",
                         f"{settled_sag(period, torque):.2f}°", f"{held_in_the_mean(period, torque):.3f}",
                         f"{mean_sag(mean, torque, 3.0, 4.0):.2f}°"))
    return table(("frame", "load (N m)", "pulses, 0.6 s to 1.2 s", "pulses, settled", "friction holds (N m)",
                  "mean voltage, settled"), rows)


def stiffness_table():
    """Stiffness by the formula, of the mean voltage and of the pulses [N m/rad]."""
    rows = [(f"{1e3 * period:g} ms", f"{stiffness(period):.2f}", f"{slope(slow_sag, period):.2f}",
             f"{slope(settled_sag, period):.2f}") for period in PERIODS]
    return table(("frame", "formula", "mean voltage, load grows slowly", "pulses, settled"), rows)


def step_table():
    """Where steps end."""
    rows = []
    for period in PERIODS:
        pulsed, mean = models(period)
        cells = [f"{1e3 * period:g} ms"]
        for degrees, end in ((2.0, 1.0), (60.0, 1.2)):
            cells += [f"{after_step(model, degrees, end)[1][-1]:.2f}°" for model in (pulsed, mean)]
        rows.append(cells)
    return table(("frame", "2° after 1 s: pulses", "mean voltage", "60° after 1.2 s: pulses", "mean voltage"), rows)


TABLES = {"sag": sag_table, "stiffness": stiffness_table, "step": step_table}

if __name__ == "__main__":
    print("\n\n".join(make() for make in TABLES.values()))
