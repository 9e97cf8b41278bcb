"""Why a servo buzzes: each number that is said to stop it does, and a little less of the change does not."""

import math

import pytest

import servotwin as st
from servotwin.datasheet import buzz
from servotwin.errors import InputError
from servotwin.models import mid_travel

STEP = st.signals.step(0.0, 20.0, at=0.1, unit="deg")
ANALOG = st.PulseServo(st.load_servo("hitec-hs-755hb").replace(
    {"electronics.stretcher_gain": 1000.0, "electronics.off_state": "coast"}))
LEROBOT = {"D_Coefficient": 32, "Maximum_Acceleration": 254, "Acceleration": 254}


def rest(model, command, load, duration):
    return st.simulate(model, command, load=load, duration=duration).rest


@pytest.mark.long
def test_each_number_that_stops_an_analog_servo_from_hunting():
    """Coasting between pulses and far too stiff it swings; a step of the search back, 9 %, is not enough."""
    found = buzz(ANALOG, command=STEP, duration=2.5)
    assert found.rest == rest(ANALOG, STEP, None, 2.5)
    assert math.degrees(found.rest.swing) > 3.0
    needed = {remedy.name: remedy for remedy in found.remedies}
    assert set(needed) == {"electronics.deadband", "load.coulomb_torque", "electronics.stretcher_gain"}
    for name, remedy in needed.items():
        step = 2.0**0.125 if remedy.needed < remedy.now else 2.0**-0.125
        for value, restless in ((remedy.needed, False), (step * remedy.needed, True)):
            load = st.loads.Coulomb(value) if name.startswith("load") else None
            model = ANALOG if load else st.PulseServo(ANALOG.servo.replace({name: value}))
            assert rest(model, STEP, load, 2.5).restless == restless, (name, value)


@pytest.mark.long
def test_a_bus_servo_whose_output_shaft_has_no_friction():
    """shared/cases/digital-servo-never-rests: any friction ends it, as a dead zone of two counts does, and P 15."""
    servo = st.feetech_sts({"P_Coefficient": 16, **LEROBOT}, servo="feetech-sts3215-7v4")
    model = st.DigitalServo(servo.replace({"friction.bearing_coulomb_torque": 0.0}))
    command = st.signals.step(-3.0, 0.0, at=0.1, unit="deg")
    found = buzz(model, command=command)
    assert math.degrees(found.rest.swing) == pytest.approx(0.66, abs=0.02)
    needed = {remedy.name: remedy.needed for remedy in found.remedies}
    count = 2.0 * math.pi / 4096.0
    assert needed["firmware.deadband_angle"] == pytest.approx(2.0 * count, rel=0.1)
    assert 0.0 < needed["load.coulomb_torque"] < 2e-3
    assert needed["firmware.proportional_gain"] < model.servo.firmware.proportional_gain
    gentler = st.DigitalServo(model.servo.replace(
        {"firmware.proportional_gain": needed["firmware.proportional_gain"]}))
    assert not rest(gentler, command, None, 3.0).restless
    assert not rest(model, command, st.loads.Coulomb(needed["load.coulomb_torque"]), 3.0).restless


@pytest.mark.parametrize("model", [st.DigitalServo(st.load_servo("feetech-sts3215-12v")),
                                   st.BoundedServo(st.load_servo("hitec-hs-755hb"))], ids=repr)
def test_a_quiet_servo_needs_nothing(model):
    found = buzz(model)
    assert found.rest.stands
    assert found.remedies == ()


def test_a_command_that_moves_has_no_rest():
    middle = mid_travel(ANALOG)
    sine = st.signals.sine(mean=middle, amplitude=0.1, frequency=1.0, unit="rad")
    assert buzz(ANALOG, command=sine).rest is None


@pytest.mark.parametrize("model", [st.GearedMotor(st.load_servo("hitec-hs-311")), "hitec-hs-311", None])
def test_what_holds_no_angle_is_refused(model):
    with pytest.raises(InputError, match="model that may buzz"):
        buzz(model)
