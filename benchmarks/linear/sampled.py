"""Sampled loops and describing functions beside simulated sines: the analog servos of the catalog.

First with friction, deadband and play off, pulse servos up to the bandwidth of the mean voltage: gain of `sampled`, as
impulses and with bursts that take their time, over that of simulated sines, and the phase between them. Then with
friction and deadband on: `linearise` beside sines of the bounded servo, where nothing sticks, and beside the pulse
servo, whose pulses break a friction that their mean does not. Last poles and margins over the frame rate.
"""

import math
import sys
import warnings

import control
import numpy as np
from run import bare

import servotwin as st

PARTS = (0.1, 0.4, 0.7, 1.0)  # of the bandwidth
SIZES = (0.2, 1.0, 5.0)  # deg
MULTIPLES = (3, 6, 15, 50)  # of half the deadband


def sampled_row(name: str) -> np.ndarray:
    """Print a servo's row; return impulse and burst errors in gain [%] and phase [°], shape (2, 2, sizes)."""
    model = st.PulseServo(bare(st.load_servo(name), play=False))
    bandwidth = float(control.bandwidth(st.linear.transfer_function(model, input="command_angle")))
    omega = bandwidth * np.array(PARTS)
    omega = omega[omega < math.pi / model.frame_period]
    loop = st.linear.sampled(model)
    seen = st.linear.frequency_response(model, omega, amplitude=np.radians(SIZES))
    found = np.zeros((2, 2, len(SIZES)))
    for k, size in enumerate(SIZES):
        for kind, response in enumerate((loop.response(omega), loop.response(omega, amplitude=math.radians(size)))):
            off = response / seen.response[k]
            found[kind, 0, k] = 100.0 * np.abs(np.abs(off) - 1.0).max()
            found[kind, 1, k] = np.degrees(np.abs(np.angle(off))).max()
    shown = " | ".join(" ".join(f"{x:7.2f}" for x in line) for line in (*found[0], *found[1]))
    print(f"{name:24} {bandwidth / (2.0 * math.pi):5.2f} Hz | {shown}", flush=True)
    return found


def described_row(name: str) -> tuple[float, float]:
    """Print a servo's row; return the worst gain error [%] of the bounded servo where nothing sticks, and the pulses'.

    Of the pulse servo, where the describing functions say that nothing sticks.
    """
    pulse = st.PulseServo(st.load_servo(name))
    mean = pulse.averaged()
    half = 0.5 * mean.value("electronics.voltage_deadband") / mean.value("potentiometer.feedback_gain")
    omega = float(control.bandwidth(st.linear.transfer_function(pulse, input="command_angle"))) * np.array(PARTS)
    omega = omega[omega < math.pi / pulse.frame_period]
    worst, apart, cells = 0.0, 0.0, []
    for multiple in MULTIPLES:
        size = multiple * half
        seen = st.linear.linearise(mean, amplitude=size)
        gain, free = np.abs(seen.response(omega)), ~seen.sticks(omega)
        truth = st.linear.frequency_response(mean, omega, amplitude=[size]).gain[0]
        pulses = st.linear.frequency_response(pulse, omega, amplitude=[size]).gain[0]
        off, away = 100.0 * (gain[free] / truth[free] - 1.0), 100.0 * (gain[free] / pulses[free] - 1.0)
        worst, apart = max(worst, np.abs(off).max(initial=0.0)), max(apart, np.abs(away).max(initial=0.0))
        cells.append(f"{math.degrees(size):5.1f}° " + (
            f"sticks ({np.abs(truth).max():.2f}, pulses {np.abs(pulses).max():.2f})" if not free.any() else
            f"{np.abs(off).max():5.1f} % of {free.sum()}/{len(omega)}, pulses {np.abs(away).max():4.0f} %"))
    print(f"{name:24} " + " | ".join(f"{cell:30}" for cell in cells), flush=True)
    return worst, apart


def frames() -> None:
    """Print poles and margins over the frame rate, and of bus servos over P."""
    print("\nHS-755HB over the frame rate, 1e-3 kg m2: mean of the voltage (physics: w_n = sqrt(k/J)), and sampled")
    servo, load = st.load_servo("hitec-hs-755hb"), st.loads.Inertia(1e-3)
    for period in (0.02, 0.016384, 0.01, 0.005, 0.003):
        model = st.PulseServo(servo.replace({"electronics.frame_period": period}))
        omega, zeta, _ = st.linear.transfer_function(model, input="command_angle", load=load).damp()
        N, R = servo.gear.gear_reduction, servo.motor.armature_resistance
        K = N * servo.motor.torque_constant
        J = N**2 * servo.motor.rotor_inertia + load.inertia + (servo.gear.output_inertia or 0.0)
        k = K / R * model.mean_gain() * servo.potentiometer.feedback_gain
        law = math.sqrt(k / J), (K * N * servo.motor.back_emf_constant / R + N**2
                                 * servo.motor.motor_viscous_friction) / (2.0 * math.sqrt(k * J))
        print(f"  {1e3 * period:6.2f} ms: {omega[0]:5.1f} rad/s {zeta[0]:.3f}, by law {law[0]:5.1f} {law[1]:.3f} | "
              f"{margins(st.linear.sampled(model, load))}")
    for P in (16, 32):
        model = st.DigitalServo(st.feetech_sts({"P_Coefficient": P, "D_Coefficient": 32}, servo="feetech-sts3215-12v"))
        print(f"  STS3215 12 V, P {P}, D 32, 5e-3 kg m2: {margins(st.linear.sampled(model, st.loads.Inertia(5e-3)))}")


def margins(loop: st.linear.SampledServo) -> str:
    """Return poles and margins in words."""
    found, pole = loop.margins, loop.poles[0]
    return (f"poles {pole.real:6.1f} ± {abs(pole.imag):5.1f}i, damping {loop.damping:.2f}, gain × {found.gain:5.2f}, "
            f"phase {math.degrees(found.phase):3.0f}°, delay {1e3 * found.delay:5.1f} ms")


def main() -> None:
    warnings.simplefilter("ignore")  # sheets that contradict themselves
    names = [name for name in st.catalog_names() if st.load_servo(name).kind == "analog"]
    names = names[::int(sys.argv[1])] if len(sys.argv) > 1 else names
    print(f"{len(names)} analog servos, friction, deadband and play off, sines of {', '.join(map(str, SIZES))}°:\n"
          "worst error up to the bandwidth, impulses: gain (%) | phase (°) | bursts that take time: gain | phase")
    worst = np.max([sampled_row(name) for name in names], axis=0)
    print(f"worst{'':28} | " + " | ".join(" ".join(f"{x:7.2f}" for x in line) for line in (*worst[0], *worst[1])))
    print("\nfriction and deadband on: linearise beside sines of BoundedServo where nothing sticks, and of PulseServo\n"
          f"amplitudes of {', '.join(map(str, MULTIPLES))} half deadbands")
    rows = np.array([described_row(name) for name in names])
    print(f"worst where nothing sticks: {rows[:, 0].max():.1f} %; beside the pulses {rows[:, 1].max():.0f} %")
    frames()


if __name__ == "__main__":
    main()
