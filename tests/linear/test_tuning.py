"""Gains for a wanted margin or overshoot: simulated again, beside each other, and what there is not."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.linear.gain_search import OuterLoop, stepped

SERVOS = {
    "feetech-sts3215-12v": st.DigitalServo, "dynamixel-xl430-w250": st.DigitalServo, "dsservo-ds3218": st.DigitalServo,
    "hitec-hs-755hb": st.PulseServo}
quiet = pytest.mark.filterwarnings("ignore::UserWarning")  # sheets that contradict themselves


def overshoot(found, load):
    """Overshoot of the tuned servo on its own: by `simulate`, or by a loop around it."""
    start = st.models.mid_travel(found.model) - 0.5 * found.step
    if isinstance(found.model, st.PulseServo):
        angles = stepped(found.model, st.loads.as_load(load), found.settings["outer_gain"], start=start,
                         step=found.step, frames=300)
        return (angles.max() - angles[-1]) / (angles[-1] - angles[0])
    command = st.signals.step(start, start + found.step, unit="rad")
    return st.simulate(found.model, command, duration=2.0, load=load).step_metrics().overshoot


@pytest.mark.long
@quiet
@pytest.mark.parametrize(("name", "inertia", "wanted"), [
    ("dsservo-ds3218", 1e-3, 0.2),
    *(pytest.param(*case, marks=pytest.mark.slow) for case in (
        ("hitec-hs-755hb", 2e-2, 0.2), ("hitec-hs-755hb", 1e-3, 0.1), ("dynamixel-xl430-w250", 1e-3, 0.05),
        ("dynamixel-xl430-w250", 2e-2, 0.2), ("dsservo-ds3218", 2e-2, 0.1), ("feetech-sts3215-12v", 1e-3, 0.08),
        ("feetech-sts3215-12v", 2e-2, 0.08)))])
def test_the_gain_gives_the_overshoot(name, inertia, wanted):
    load = st.loads.Inertia(inertia)
    found = st.linear.tune(SERVOS[name](st.load_servo(name)), load, overshoot=wanted)
    assert overshoot(found, load) == pytest.approx(wanted, abs=0.05)
    assert found.overshoot == pytest.approx(overshoot(found, load), abs=0.01)
    assert found.margins.gain > 1.0


@pytest.mark.long
@quiet
def test_a_phase_margin_is_kept_by_the_largest_gain():
    model, load = st.DigitalServo(st.load_servo("dsservo-ds3218")), st.loads.Inertia(5e-3)
    wanted = math.radians(45.0)
    found = st.linear.tune(model, load, phase_margin=wanted)
    assert found.margins.phase >= wanted
    more = st.DigitalServo(model.servo.replace({
        name: 1.2 * value for name, value in found.settings.items()}))
    assert st.linear.sampled(more, load).margins.phase < wanted
    assert found.stiffness == pytest.approx(float(found.model.loop_stiffness()))


@pytest.mark.long
@quiet
@pytest.mark.parametrize(("name", "wanted"), [
    ("hitec-hs-755hb", 45.0), ("gws-micro-2bbmg", 45.0), ("dfrobot-df05bb", 60.0), ("dsservo-ds3218", 50.0)])
def test_the_phase_margin_is_the_one_that_was_asked_for(name, wanted):
    """Of a grid of gains, 16 % apart, 45 deg became 72.6 of the GWS 2BBMG."""
    kind = SERVOS.get(name, st.PulseServo)
    found = st.linear.tune(kind(st.load_servo(name)), phase_margin=math.radians(wanted))
    assert wanted <= math.degrees(found.margins.phase) < wanted + 0.1


@pytest.mark.long
@quiet
def test_a_register_takes_the_largest_number_that_leaves_the_margin():
    model, wanted = st.DigitalServo(st.load_servo("feetech-sts3215-12v")), math.radians(75.0)
    found = st.linear.tune(model, phase_margin=wanted)
    P = found.settings["P_Coefficient"]
    for value, enough in ((P, True), (P + 1, False)):
        servo = st.feetech_sts({"P_Coefficient": value}, servo="feetech-sts3215-12v")
        assert (st.linear.sampled(st.DigitalServo(servo)).margins.phase >= wanted) == enough


@pytest.mark.slow
@quiet
def test_a_derivative_buys_stiffness():
    model, load = st.DigitalServo(st.load_servo("dsservo-ds3218")), st.loads.Inertia(2e-2)
    without, found = (st.linear.tune(model, load, phase_margin=math.radians(50.0), derivative=lead)
                      for lead in (False, True))
    assert found.stiffness > 3.0 * without.stiffness
    assert set(found.settings) == {"firmware.proportional_gain", "firmware.derivative_gain"}


@pytest.mark.long
def test_registers_are_whole_numbers():
    found = st.linear.tune(st.DigitalServo(st.load_servo("feetech-sts3215-12v")), phase_margin=math.radians(70.0))
    value = found.settings["P_Coefficient"]
    assert value == int(value)
    assert 1 <= value <= 254
    again = st.feetech_sts({"P_Coefficient": value}, servo="feetech-sts3215-12v")
    assert again.firmware.proportional_gain == found.model.servo.firmware.proportional_gain


def test_the_loop_around_a_servo(servo):
    """Its poles: those of the loop of the servo, and 1 − g T of a slow integrator; its steady gain is 1."""
    inner = st.linear.sampled(st.PulseServo(servo)).law
    for gain in (1e-4, 1e-3):
        outer = OuterLoop(inner=inner, gain=gain)
        z = np.linalg.eigvals(outer.monodromy())
        assert z[np.argmax(z.real)] == pytest.approx(1.0 - gain, abs=2.0 * gain**2 / 0.02)
        assert abs(outer.closed_loop(np.array([1e-4]))[0]) == pytest.approx(1.0, abs=1e-2)


@pytest.mark.long(but="wanted0-nothing")
@pytest.mark.parametrize(("wanted", "text"), [
    ({}, "nothing"), ({"overshoot": 0.1, "phase_margin": 1.0}, "both"), ({"overshoot": -0.1}, "overshoot"),
    ({"overshoot": 1.0}, "overshoot"), ({"phase_margin": 4.0}, "phase margin"), ({"phase_margin": math.nan}, "phase"),
    ({"phase_margin": 3.0}, "at most"), ({"overshoot": 0.1, "step": 0.0}, "step")])
def test_bad_input(servo, wanted, text):
    with pytest.raises(InputError, match=text):
        st.linear.tune(st.PulseServo(servo), **wanted)


def test_what_has_no_gain_to_tune(servo):
    with pytest.raises(InputError, match="model to tune"):
        st.linear.tune(st.BoundedServo(servo), overshoot=0.1)


@pytest.mark.long
@quiet
def test_what_no_gain_gives_is_said():
    model = st.DigitalServo(st.load_servo("dsservo-ds3218"))
    with pytest.raises(InputError, match=r"overshoot: got '90 %', allowed: what there is: .* of a step of 10 deg"):
        st.linear.tune(model, st.loads.Viscous(5.0), overshoot=0.9)
