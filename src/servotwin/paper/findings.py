"""Where the paper needs a correction and where its own data disagree, each with the number that shows it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin import bench
from servotwin.look import fixed, number, with_error
from servotwin.paper.study import LOAD_INERTIA
from servotwin.physics.friction import creep_speed

if TYPE_CHECKING:
    from servotwin.paper.study import PaperStudy

_MOVED = 1542.0  # µs: the pulse width of the 90° row, one step of the generator longer


class Passage(NamedTuple):
    """A place in the paper, what is done about it (both HTML), and the number that shows why."""

    place: str
    remark: str
    shown_by: str


def corrections(study: PaperStudy) -> tuple[Passage, ...]:
    """Return what the equations need before they can be computed or believed."""
    N = study.value("gear.gear_reduction")
    F = study.value("friction.coulomb_torque_forward")
    damping = (study.value("motor.torque_constant") * study.value("motor.back_emf_constant")
               / study.value("motor.armature_resistance") + study.value("motor.motor_viscous_friction"))
    creep = float(creep_speed(0.5 * N * F, N, F, study.value("friction.coulomb_torque_backward"),
                              study.value("friction.zero_crossing_slope"), damping)) / N
    return (
        Passage("(6)", "Printed as a copy of (5). Read v<sub>b</sub> = k<sub>b</sub> θ̇<sub>m</sub>, as (9) and (24) "
                "use it.", "no number: a misprint"),
        Passage("(4), (5), (10), (41)", "Letters used twice: k is the factor of (5) and the slope of (41); "
                "τ<sub>m</sub> is the torque of the current in (4) and what the bare rotor takes in (10) and (25). "
                "Each has a name of its own here.", "no number: names"),
        *_drive(study),
        Passage("(41): no static friction", "The text announces it, the formula has none and gives no force at rest: a "
                "loaded shaft creeps. In the two other models it sticks.",
                f"with half the friction's torque on the braked, unpowered shaft (41) creeps "
                f"{fixed(60.0 * math.degrees(creep), 1)}° a minute (at the assumed slope k)"),
        Passage("(37), (41): which shaft", "(37) to (40) take f<sub>ec</sub> at the motor's shaft and of the motor's "
                "speed; (41) writes q̇. Taken as (37).",
                f"at the output it is N = {number(N)} times as large: {number(1e3 * F)} mN m become "
                f"{number(N * F)} N m"),
        Passage("(34)", "Gives τ̇<sub>L</sub> from the third derivative of q and cannot be run forward. The same "
                "physics is simulated with the current as a state.", "no number: a change of form"),
        Passage("(40)", "An inverse statement: motion in, torque out. Forward it needs a load, which the paper does "
                "not name.", f"here J<sub>L</sub> = {number(LOAD_INERTIA)} kg m² (assumed)"),
    )


def _drive(study: PaperStudy) -> tuple[Passage, ...]:
    """Return what (38) leaves out between the error and the motor."""
    k_p, p = study.fits["V_o(V_i)"].line.slope, math.degrees(1.0) * study.fits["V_o(q)"].line.slope
    at_zero = float(study.table["V_i_V"][0])
    half_band = 0.5 * study.value("electronics.voltage_deadband") / study.value("potentiometer.feedback_gain")
    return (
        Passage("(38): no offsets", "As printed, zero volts mean zero angle. The bench needs v<sub>a</sub> = A "
                "k<sub>s</sub> [(k<sub>p</sub> v<sub>i</sub> + b<sub>i</sub>) − (p q + b<sub>o</sub>)].",
                f"as printed, {at_zero:.3f} V asks for {fixed(math.degrees(k_p * at_zero / p), 1)}°; the servo stood "
                "at 0°"),
        Passage("(38): no bound", "No bridge gives more than its supply. The averaged servo keeps (38) as printed, the "
                "two others limit it.",
                f"peak |v<sub>a</sub>| {fixed(study.peak_voltage['averaged'], 1)} V on a supply of "
                f"{number(study.supply)} V: {fixed(study.peak_voltage['averaged'] / study.supply, 1)} times"),
        Passage("(38): no deadband", "The chip ignores small errors. The averaged servo has no deadband, the two "
                "others have one.", f"8 µs of full width (sheet) are ± {fixed(math.degrees(half_band), 2)}°"),
        Passage("(38): a mean", "The chip drives in pulses, one a frame, and (38) is their mean. Pulses break a "
                "friction that their mean does not. The pulse servo computes every pulse.",
                "the shaft may stand up to ± " + fixed(math.degrees(study.on_bench["bounded"].widest), 2)
                + "° from its target with the mean, ± " + fixed(math.degrees(study.on_bench["pulse"].widest), 2)
                + "° with pulses"),
    )


def disagreements(study: PaperStudy) -> tuple[Passage, ...]:
    """Return where the paper's data disagree with each other or with other sources."""
    return (*_tables(study), *_converters(study), *_generator(study), *_printed(study))


def _tables(study: PaperStudy) -> tuple[Passage, ...]:
    one, fits = study.ranges, study.fits
    rate = float(np.ptp(one["q_deg"]) / np.ptp(one["t_a_us"]))
    gain = float(np.ptp(one["V_o_V"]) / np.radians(np.ptp(one["q_deg"])))
    pulse, pot = fits["q(t_a)"].line, fits["V_o(q)"].line
    p = math.degrees(1.0) * pot.slope
    curve = fits["q(t_a)"]
    return (
        Passage("Table I and Table II: pulse gain", "The pulse gain belongs to one unit. Makers list 0.109 to 0.1125 "
                "°/µs for this type (45° per 400 µs; 202° over 556 to 2410 µs).",
                f"{rate:.4f} °/µs against {with_error(pulse.slope, pulse.slope_error, '°/µs')}: "
                f"{fixed(100.0 * (pulse.slope / rate - 1.0), 1)} %"),
        Passage("Table I and Table II: potentiometer", "The calibration used here is that of Table II.",
                f"{gain:.4f} V/rad against {with_error(p, math.degrees(1.0) * pot.slope_error, 'V/rad')}: "
                f"{fixed(100.0 * (p / gain - 1.0), 1)} %"),
        Passage("“Predominantly linear”", "Angle over pulse width is visibly curved, and the generator's steps do not "
                "explain it. A linear model cannot follow it.",
                "residuals " + ", ".join(fixed(r, 2) for r in curve.line.residuals) + "°; F-test of a parabola: "
                f"F = {fixed(curve.curvature.f_value, 1)}, p = {fixed(curve.curvature.p_value, 3)}"),
    )


def _generator(study: PaperStudy) -> tuple[Passage, ...]:
    generator = study.on_bench["bounded"].bench.generator
    moved = study.table["t_a_us"].copy()
    moved[2] = _MOVED
    straight = bench.fit_line(moved, study.table["V_o_V"])
    step = 1e6 * generator.step * study.fits["q(t_a)"].line.slope
    deadband = study.value("electronics.voltage_deadband") / study.value("potentiometer.feedback_gain")
    return (
        Passage("Pulse widths", "All five are 16 m + 6 µs with m = ⌊(ADC_i − 1)/6⌋ − 1; the frame is 1024 · 16 µs. "
                "Inferred from the numbers, the paper does not say it.",
                f"one step is {fixed(1e6 * generator.step, 0)} µs or {fixed(step, 1)}°, twice the deadband of "
                f"{fixed(math.degrees(deadband), 1)}°; f = {fixed(generator.pulse_rate, 3)} Hz, printed 61"),
        Passage("The 90° row", "Its pulse width and its counts may be of another frame than its voltages. The table is "
                "used as printed.",
                f"with {_MOVED:.0f} µs the largest residual of V_o(t_a) falls from "
                f"{fixed(1e3 * study.fits['V_o(t_a)'].line.max_residual, 1)} to "
                f"{fixed(1e3 * straight.max_residual, 1)} mV"),
    )


def _converters(study: PaperStudy) -> tuple[Passage, ...]:
    count_in, count_out = study.fits["ADC_i(V_i)"].line, study.fits["ADC_o(V_o)"].line
    generator = study.on_bench["bounded"].bench.generator
    volts, counts = study.table["V_i_V"].tolist(), study.table["ADC_i"].tolist()
    gain = bench.INPUT_CONVERTER.gain
    zero = _count_offsets(volts, counts, gain)
    others = _count_offsets(volts[:2] + volts[3:], counts[:2] + counts[3:], gain)
    span = bench.command_voltage_interval(582, gain=gain)
    read = {offset: bench.Converter(bits=10, reference=2.5, offset=offset).count(volts[2])
            for offset in (0.0, others.middle)}
    low, high = study.offsets
    return (
        Passage("ADC_i and ADC_o", "Two 10-bit converters of one bench have different gains and zeros, so voltmeter "
                "and converter did not see the same voltage. The bench here uses each as fitted.",
                f"{with_error(count_in.slope, count_in.slope_error)} counts/V and {fixed(count_in.intercept, 1)} "
                f"against {with_error(count_out.slope, count_out.slope_error)} counts/V and "
                f"{fixed(count_out.intercept, 1)}"),
        Passage("V_i and ADC_i", f"No zero offset of a converter with {fixed(gain, 1)} counts/V gives all five ADC_i: "
                f"the other four agree on {fixed(others.lower, 2)} to {fixed(others.upper, 2)} counts, the 90° row "
                "does not.",
                f"all five ask for at least {fixed(zero.lower, 2)} and less than {fixed(zero.upper, 2)} counts; "
                f"582 counts are {span.lower:.4f} to {span.upper:.4f} V, printed {volts[2]:.3f} V"),
        Passage("V_i and t_a", "The five pulse widths can be had from the five V_i, but only with a zero offset that "
                f"has no other reason. The bench uses the middle, {fixed(study.offsets.middle, 2)} counts, identified "
                "from Table II.",
                f"offset from {fixed(low, 2)} to below {fixed(high, 2)} counts; " + "; ".join(
                    f"with {fixed(offset, 2)} the 90° row reads {count} counts and gives "
                    f"{1e6 * generator.width(count):.0f} µs" for offset, count in read.items()) + "; printed 1526 µs"),
    )


def _count_offsets(volts: list[float], counts: list[float], gain: float) -> bench.Interval:
    """Return the zero offsets of a converter for which each voltage gives its count."""
    return bench.Interval(max(n - gain * v for n, v in zip(counts, volts, strict=True)),
                          min(n + 1.0 - gain * v for n, v in zip(counts, volts, strict=True)))


def _printed(study: PaperStudy) -> tuple[Passage, ...]:
    per_millivolt = 1e-3 / study.fits["V_o(t_a)"].line.slope
    angle = 1e-3 / study.fits["V_o(q)"].line.slope
    common = study.vibration.circuits["common"].still
    return (
        Passage("Fig. 12: the supply", "The circuit labels the output of an LM2940-CT5 “+6 V”; by its name this is the "
                "5 V version. The voltage at the motor is stated nowhere else.",
                f"{number(study.supply)} V is used (the label)"),
        Passage("Conclusion: vibration", "The servo vibrated until motor and electronics had separate supplies. (38) "
                "has no path from the supply to the motion. The pulse servo has one in its chip, a supply coupling, "
                "for which there is no value; it acts only where the bridge still drives as the chip measures, far "
                "from the target, and does not vibrate. The path through the command does: <a href=\"#vibration\">the "
                "experiment</a>.",
                f"the drive lasts until the next pulse only beyond an error of {fixed(_lasting_error(study), 1)}°; "
                f"scale: 1 mV at the potentiometer is {fixed(per_millivolt, 2)} µs or {fixed(angle, 3)}°; "
                f"command on the same soft supply: {fixed(math.degrees(common.swing), 1)}° at "
                f"{fixed(common.frequency, 0)} Hz"),
        Passage("A word", "ADC_i and ADC_o are called values of a “digital-analog” converter. They are counts of "
                "analog-digital converters.", "no number: a slip"),
        Passage("No parameter values", "The paper publishes no value of k<sub>a</sub>, k<sub>b</sub>, R<sub>a</sub>, "
                "L<sub>a</sub>, J<sub>m</sub>, B<sub>m</sub>, n, A, k<sub>s</sub>, k<sub>p</sub>, p, F<sub>ec</sub> or "
                "k. Its simulated curves cannot be computed from it.", "13 symbols, 0 values"),
    )


def _lasting_error(study: PaperStudy) -> float:
    """Return from which error on the drive of one frame lasts into the next, in the middle of Table II [°]."""
    row = study.on_bench["pulse"].rows[2]
    frame = 1.0 / row.reading.pulse_rate
    error = (0.5 * study.value("electronics.deadband")
             + (frame - row.reading.pulse_width) / study.value("electronics.stretcher_gain"))
    time_per_angle = study.value("electronics.one_shot_slope") * study.value("potentiometer.feedback_gain")
    return math.degrees(error / time_per_angle)
