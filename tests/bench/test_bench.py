"""The simulated bench against the paper's Table II."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.bench import Bench, bench_servo, compare, measured_shares, model_shares
from servotwin.errors import CommandError, InputError, MissingParameterError
from servotwin.physics import averaged_bridge_gain


def test_table_two(rows, table):
    for row in compare(rows, table):
        assert abs(row.pulse_width) < 1e-6
        assert abs(math.degrees(row.output_angle)) <= 1.1
        assert abs(row.feedback_voltage) <= 11e-3
        assert abs(row.feedback_count) <= 5
        assert abs(row.command_count) <= 2


def test_pulse_rate(rows):
    assert all(row.reading.pulse_rate == pytest.approx(61.035, abs=1e-3) for row in rows)


def test_standing_band(bench, rows):
    """A free shaft stops where friction and half the deadband hold it, and not beyond."""
    value = bench.model.value
    gain = value("electronics.bridge_gain") * value("electronics.comparator_gain")
    friction = value("friction.coulomb_torque_forward") * value("motor.armature_resistance") / (
        gain * value("motor.torque_constant") * value("potentiometer.feedback_gain"))
    bounded, averaged = isinstance(bench.model, st.BoundedServo), isinstance(bench.model, st.AveragedServo)
    width = value("electronics.deadband") / value("electronics.one_shot_slope")
    deadband = 0.0 if averaged else 0.5 * width / value("potentiometer.feedback_gain")
    for row in rows:
        assert row.standing_band == pytest.approx(row.deadband_band + row.friction_band, rel=1e-12)
        assert row.deadband_band == pytest.approx(deadband, rel=1e-5)
        assert 0.0 < row.standing_band <= (friction + deadband) * (1.0 + 1e-9)
        assert row.at_rest == bounded
        low, high = row.from_below.output_angle, row.from_above.output_angle
        assert low < row.target_angle < high
        assert row.reading.output_angle == pytest.approx(0.5 * (low + high), abs=1e-15)


@pytest.fixture(scope="module")
def pulse_bench(servo):
    return Bench(st.PulseServo(bench_servo(servo)))


def test_pulses_shrink_the_band_of_friction(pulse_bench, servo):
    """The mean of short pulses is too weak for the friction, each pulse is not."""
    by_mean, = Bench(st.BoundedServo(bench_servo(servo))).measure([1.425])
    by_pulses, = pulse_bench.measure([1.425])
    assert by_pulses.deadband_band == pytest.approx(by_mean.deadband_band, rel=1e-5)
    assert math.degrees(by_mean.friction_band) > 1.5
    assert math.degrees(by_pulses.friction_band) < 0.05


@pytest.mark.long
def test_friction_may_bend_the_line_by_the_mean_voltage_only(pulse_bench, servo, table):
    for bench, count, band in ((Bench(st.BoundedServo(bench_servo(servo))), 5, 2.10), (pulse_bench, 0, 0.44)):
        rows = bench.measure(table["V_i_V"])
        assert math.degrees(max(row.standing_band for row in rows)) == pytest.approx(band, abs=0.01)
        inside = [abs(d.output_angle) <= row.standing_band for d, row in zip(compare(rows, table), rows, strict=True)]
        assert sum(inside) == count


def test_a_stand_between_two_pulses_is_no_rest(pulse_bench):
    bands = []
    for dwell in (0.5, 1.0, 2.0, 4.0):
        row, = pulse_bench.measure([1.425], dwell=dwell)
        assert not row.at_rest
        assert row.dwell == dwell
        bands.append(row.friction_band)
    assert bands == sorted(bands, reverse=True)
    assert bands[-1] < 0.3 * bands[0]


def test_within_the_deadband_no_pulse_moves_the_shaft(pulse_bench):
    row, = pulse_bench.measure([1.425], approach=math.radians(0.3))
    assert row.at_rest
    assert row.standing_band == pytest.approx(math.radians(0.3), rel=1e-9)


def test_frames_and_widths_are_the_generators(pulse_bench):
    """Drive starts at the end of the longer of two pulses: the frames of a servo file for 20 ms do not matter."""
    period = pulse_bench.generator.frame_period
    run = pulse_bench.run(st.signals.step(0.609, 1.425, at=2.5 * period, unit="V"), 5.0 * period)
    assert run.result.at("drive", [2.99 * period + 646e-6]).tolist() == [0]
    late = 3.0 * period + pulse_bench.generator.width(582)
    assert run.result.at("drive", [late - 1e-6, late + 1e-6]).tolist() == [0, 1]
    other = Bench(st.PulseServo(pulse_bench.model.servo.replace({"electronics.frame_period": 0.02})))
    assert other.measure([1.0]) == pulse_bench.measure([1.0])


def test_a_servo_without_a_mean_voltage_needs_no_bridge_gain(servo):
    alone = servo.replace({"electronics.bridge_gain": None, "electronics.comparator_gain": None})
    row, = Bench(st.PulseServo(bench_servo(alone))).measure([1.425])
    whole, = Bench(st.PulseServo(bench_servo(servo))).measure([1.425])
    assert row == whole
    with pytest.raises(MissingParameterError):
        bench_servo(alone.replace({"electronics.stretcher_gain": None}))


def test_shares_add_up(rows, fits):
    for quantity in ("output_angle", "feedback_voltage"):
        for share in model_shares(rows, fits, quantity=quantity):
            assert share.total == pytest.approx(
                share.generator + share.curvature + share.standing + share.rest, abs=1e-12)
            assert abs(share.rest) < 0.2 * max(abs(s.total) for s in model_shares(rows, fits, quantity=quantity))
    for measured in measured_shares(fits):
        assert measured.total == pytest.approx(measured.quantum + measured.curvature + measured.rest, abs=1e-12)
    assert max(abs(math.degrees(s.quantum)) for s in measured_shares(fits)) == pytest.approx(0.99, abs=0.01)
    with pytest.raises(InputError):
        model_shares(rows, fits, quantity="pulse_width")
    with pytest.raises(InputError):
        model_shares(rows[:2], fits)


def test_the_frame_rescales_the_loop_gain(servo):
    at_bench = bench_servo(servo)
    value = at_bench.get
    assert value("electronics.frame_period") == pytest.approx(16.384e-3)
    expected = averaged_bridge_gain(
        value("supply.open_circuit_voltage"), value("supply.bridge_drop_voltage"), value("electronics.stretcher_gain"),
        value("electronics.frame_period"), 1.0 / value("electronics.pulse_to_voltage_gain"))
    assert value("electronics.bridge_gain") * value("electronics.comparator_gain") == pytest.approx(expected, rel=1e-4)


def test_run_reads_the_command_once_a_frame(bench):
    period = bench.generator.frame_period
    command = st.signals.step(0.609, 1.425, at=2.5 * period, unit="V")
    run = bench.run(command, 1.0)
    assert run.counts[:4] == (248, 248, 248, 582)
    pulses = 1e6 * run.pulses(np.array([0.0, 2.9, 3.0, 3.1]) * period + 1e-9)
    assert pulses == pytest.approx([646.0, 646.0, 1526.0, 1526.0], abs=1e-6)
    assert run.result["output_angle"][0] == pytest.approx(run.result.at("output_angle", [2.9 * period])[0], abs=1e-9)
    before, after = run.reading(2.9 * period), run.reading(3.0 * period)
    assert (before.command_count, after.command_count) == (248, 582)
    assert math.degrees(run.reading(1.0).output_angle) == pytest.approx(89.0, abs=3.0)
    with pytest.raises(InputError):
        run.reading(1.1)


def test_a_step_at_zero_steps(bench):
    run = bench.run(st.signals.step(0.609, 1.425, unit="V"), 0.8)
    assert math.degrees(run.result["output_angle"][0]) < 3.0
    assert math.degrees(run.result["output_angle"][-1]) > 80.0


def test_measure_and_run_agree(servo):
    bench = Bench(st.BoundedServo(bench_servo(servo)))
    row, = bench.measure([1.425], approach=math.radians(60.0))
    below = bench.pulse_width(1.425)
    command = st.signals.constant(below, unit="s")
    result = st.simulate(bench.model, command, duration=1.0,
                         initial={"output_angle": row.target_angle - math.radians(60.0)})
    assert result["output_angle"][-1] == pytest.approx(row.from_below.output_angle, abs=1e-12)


def test_a_loaded_shaft_sags(servo):
    model = st.BoundedServo(bench_servo(servo))
    free, = Bench(model).measure([1.425])
    loaded, = Bench(model, load=st.loads.Constant(0.3)).measure([1.425])
    assert loaded.reading.output_angle < free.reading.output_angle


def test_bad_input_is_refused(bench, servo):
    with pytest.raises(CommandError):
        bench.run(st.signals.constant(1500.0, unit="us"), 1.0)
    for duration in (0.0, -1.0, math.nan, True):
        with pytest.raises(InputError):
            bench.run(st.signals.constant(1.0, unit="V"), duration)
    with pytest.raises(InputError):
        bench.measure([1.0], dwell=0.0)
    with pytest.raises(InputError):
        bench.measure([math.nan])
    with pytest.raises(InputError):
        Bench(st.GearedMotor(servo))
