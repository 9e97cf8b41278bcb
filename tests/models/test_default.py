"""Which model stands for a servo where none is named."""

import math
from dataclasses import replace

import pytest

import servotwin as st
from servotwin.identification.fitting.checks import checked_servo
from servotwin.models import default_class, default_model

SERVO = "hitec-hs-755hb"
CHIP = ("electronics.stretcher_gain", "electronics.one_shot_slope")


@pytest.mark.parametrize(("kind", "lacks", "model", "said"), [
    ("analog", (), st.PulseServo, None),
    ("analog", CHIP, st.BoundedServo, "has no chip"),
    ("analog", CHIP[:1], st.BoundedServo, "stretcher_gain not given"),
    ("digital", (), st.PulseServo, "is a digital servo"),
    ("bus", (), st.PulseServo, "is a bus servo"),
])
def test_it_follows_kind_and_chip_and_says_so(recwarn, kind, lacks, model, said):
    servo = replace(st.load_servo(SERVO), kind=kind).replace(dict.fromkeys(lacks))
    if said is None:
        assert default_class(servo) is model
        assert not recwarn
    else:
        with pytest.warns(UserWarning, match=said):
            assert type(default_model(servo)) is model


def test_without_chip_and_mean_it_is_the_pulse_servo_that_says_what_it_lacks():
    servo = st.servo_from_values("bare", {"motor": {"armature_resistance": 3.0}})
    with pytest.raises(st.errors.MissingParameterError, match="PulseServo needs"):
        default_model(servo)


@pytest.mark.parametrize("name", st.catalog_names())
def test_the_catalog_runs_by_default_and_says_which_servos_are_digital(recwarn, name):
    servo = st.load_servo(name)
    assert default_class(servo) is (st.PulseServo if servo.kind == "analog" else st.DigitalServo)
    assert not recwarn
    for kind in ("digital", "bus"):
        assert (kind in servo.sheet["flags"]) == (servo.kind == kind)


@pytest.mark.long(but="dynamixel-ax-12a")
@pytest.mark.filterwarnings("ignore:.*data sheet contradicts itself")
@pytest.mark.parametrize("name", [name for name in st.catalog_names() if st.load_servo(name).kind != "analog"])
def test_every_digital_and_bus_servo_of_the_catalog_makes_a_small_step(name):
    model = default_model(st.load_servo(name))
    goal = st.models.mid_travel(model) + math.radians(10.0)
    result = st.simulate(model, st.signals.step(goal - math.radians(10.0), goal, at=0.1, unit="rad"), duration=1.5)
    assert result.status.ok
    assert not result.remarks
    loop = st.datasheet.Loop(model)
    droop = loop.start_error + loop.count + model.value_or("gear.backlash", 0.0)
    assert abs(result["output_angle"][-1] - goal) <= droop + 1e-9 < math.radians(4.0)  # which some reach in the end
    assert result["duty"].max() > 0.0
    assert result["trip"].max() == 0.0


def test_a_fit_follows_it_too(recwarn):
    servo = st.load_servo(SERVO).replace(dict.fromkeys(CHIP) | {"electronics.pulse_to_voltage_gain": 735.0})
    with pytest.warns(UserWarning, match="has no chip"):
        advice = checked_servo(servo, None)
    assert isinstance(advice, st.BoundedServo)
