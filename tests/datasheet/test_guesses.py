"""A figure that rests on a guess carries its range: from one end of the guesses to the other."""

import math

import pytest

import servotwin as st
from servotwin.datasheet.holding import guesses, hold, spans, variants


def ends(servo, name):
    quantity = servo.source(name)
    return quantity.lower, quantity.upper


@pytest.mark.long
def test_the_sag_ranges_from_one_end_of_the_stretcher_s_gain_to_the_other():
    """u = |e| - w/2 has to last K u: the sag beyond the deadband goes as 1/K, and t_min takes some of it away."""
    servo = st.load_servo("hitec-hs-755hb")
    part = st.curves(st.PulseServo(servo), bandwidth=False).voltages[0]
    for held in part.holding:
        if not held.span:
            continue
        for soft, expected in ((True, held.span.upper), (False, held.span.lower)):
            low, high = ends(servo, "electronics.stretcher_gain")
            t_low, t_high = ends(servo, "electronics.minimum_drive_time")
            other = servo.replace({"electronics.stretcher_gain": low if soft else high,
                                   "electronics.minimum_drive_time": t_low if soft else t_high})
            assert hold(st.PulseServo(other), held.torque).error == pytest.approx(expected, rel=1e-9)
        assert held.span.lower < held.error < held.span.upper
    assert part.holding[2].span is not None


@pytest.mark.long
def test_stiffness_and_droop_of_a_digital_servo_range_as_its_gain_does():
    servo = st.load_servo("towerpro-mg996r")
    loop = st.curves(st.DigitalServo(servo), bandwidth=False).voltages[0].loop
    low, high = ends(servo, "firmware.proportional_gain")
    k = servo.firmware.proportional_gain
    assert loop.spans["stiffness"] == pytest.approx((loop.stiffness * low / k, loop.stiffness * high / k))
    span = loop.droop_spans(0.2)["lifted"]
    assert span.lower < loop.droop(0.2)[1] < span.upper


def test_what_was_set_measured_or_read_from_a_register_is_no_guess():
    servo = st.load_servo("hitec-hs-755hb")
    assert guesses(st.PulseServo(servo), rotor=True) == (
        "electronics.stretcher_gain", "electronics.minimum_drive_time", "motor.rotor_inertia")
    known = servo.replace({"electronics.stretcher_gain": 120.0, "electronics.minimum_drive_time": 0.0})
    assert guesses(st.PulseServo(known)) == ()
    assert variants(st.PulseServo(known)) == ()
    part = st.curves(st.PulseServo(known), bandwidth=False).voltages[0]
    assert all(held.span is None for held in part.holding)
    assert part.move_span is None
    assert len(variants(st.PulseServo(servo))) == 2
    assert len(variants(st.PulseServo(servo), rotor=True)) == 4


def test_what_never_happens_at_one_end_has_no_end():
    assert spans({"a": 1.0, "b": math.nan}, [{"a": math.nan, "b": 1.0}]) == {"a": (1.0, math.inf)}


def test_bridge_gain_is_a_guess_at_any_voltage():
    model = st.BoundedServo(st.load_servo("hitec-hs-311"))
    for part in st.curves(model, voltage=[4.8, 6.0], bandwidth=False).voltages:
        assert any(held.span for held in part.holding)
