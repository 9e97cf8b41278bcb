"""Numbers of the engine from what is given of a servo: one text, in plain Python, of columns, and compiled."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.loads import as_load
from servotwin.models.columns import LaneServo
from servotwin.models.state.records import numbers_in
from servotwin.models.terms.given import given_of, hung_of
from servotwin.simulation.compile import Recipe, kernels

_TERMS = "servotwin.models.terms."
RECIPE = Recipe("numbers", tuple(f"{_TERMS}packing:{name}" for name in ("pulsed", "digital", "bounded", "averaged")))
PROGRAM, CHIP = Recipe("numbers_of_program", (f"{_TERMS}firmware:pack",)), Recipe("numbers_of_chip",
                                                                                 (f"{_TERMS}frame:pack",))
WORN = {"gear.backlash": 0.01, "gear.output_inertia": 1e-4, "friction.breakaway_ratio": 1.3,
        "friction.stribeck_speed": 2.0, "electronics.off_state": "coast", "supply.internal_resistance": 0.3,
        "supply.current_limit": 1.0, "electronics.pulse_timeout": 0.06, "friction.load_friction": 0.1,
        "thermal.winding_capacity": 3.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 10.0,
        "thermal.housing_to_ambient": 20.0}
ENDLESS = {"stops.lower_angle": None, "stops.upper_angle": None, "stops.restitution": None,
           "potentiometer.fixed_angle": 1.0, "potentiometer.linearity_angle": [0.0, 2.0],
           "potentiometer.linearity_error": [0.0, 0.02], "potentiometer.quantisation": 2e-3}
ELASTIC = {"gear.stiffness": 50.0, "gear.output_inertia": 1e-4, "gear.backlash": 0.02}
SMOOTH = {"friction.zero_crossing_slope": 100.0}
LOAD = as_load(st.loads.Inertia(1e-3) + st.loads.Viscous(1e-4) + st.loads.Pendulum(mass=0.1, length=0.12)
               + st.loads.Spring(0.2, 0.1) + st.loads.Coulomb(0.01))
BEHIND = as_load(st.loads.Flexible(stiffness=2.0, inertia=1e-3))
PROGRAMS = {"firmware.off_state": "diode", "firmware.signal_loss": "failsafe", "firmware.failsafe_angle": 0.1,
            "firmware.integral_limit": 0.0, "firmware.deadband_law": "gate"}
CASES = [(st.PulseServo, "hitec-hs-755hb", changes, load) for changes, load in (
    ({}, LOAD), (WORN, LOAD), (ENDLESS, LOAD), (ELASTIC, LOAD), ({}, BEHIND))]
CASES += [(st.BoundedServo, "hitec-hs-755hb", {}, LOAD), (st.AveragedServo, "hitec-hs-755hb", SMOOTH, LOAD),
          (st.DigitalServo, "feetech-sts3215-12v", PROGRAMS, LOAD)]



def numbers_of(values):
    """Return a flat list of nested tuples."""
    return [x for part in values for x in (numbers_of(part) if isinstance(part, tuple) else (part,))]


def test_what_a_model_does_not_read_is_not_given():
    servo = st.load_servo("hitec-hs-755hb").replace({"motor.armature_inductance": 1e-3})
    for kind, there in ((st.PulseServo, False), (st.PulseServoInductive, True)):
        assert math.isnan(kind(servo).given.motor_armature_inductance) is not there


def test_a_word_stands_as_its_place():
    for word, place in (("brake", 0.0), ("coast", 1.0), (None, math.nan)):
        servo = st.load_servo("hitec-hs-755hb").replace({"electronics.off_state": word})
        np.testing.assert_equal(given_of(servo, ["electronics.off_state"]).electronics_off_state, place)


@pytest.mark.parametrize(("kind", "name", "changes", "load"), CASES)
def test_columns_make_of_each_lane_what_its_numbers_make(kind, name, changes, load):
    servo = st.load_servo(name).replace(changes)
    model, factors = kind(servo), np.array([[0.9], [1.0], [1.2]])
    names = [n for n in ("motor.armature_resistance", "supply.current_limit", "gear.backlash",
                         "firmware.integral_limit", "electronics.pulse_timeout", "potentiometer.fixed_angle")
             if n in (*kind.requires, *kind.optional) and servo.get(n) is not None]
    lanes = model.over(LaneServo(servo, {n: servo.get(n) * factors for n in names}))
    found = [np.broadcast_to(x, (3, 1))[:, 0] for x in numbers_in(lanes.pack(load))]
    for k, factor in enumerate(factors[:, 0]):
        own = kind(servo.replace({n: servo.get(n) * factor for n in names}))
        assert [x[k] for x in found] == list(numbers_in(own.pack(load)))


def test_compiled_it_makes_the_same_numbers_to_the_last_bit():
    compiled = kernels(RECIPE)
    for kind, name, changes, load in CASES:
        model = kind(st.load_servo(name).replace(changes))
        arguments = model.given, hung_of(load)
        if kind is st.BoundedServo:
            found = compiled.bounded(*arguments)
        elif kind is st.AveragedServo:
            found = compiled.averaged(*arguments)
        else:
            make = compiled.digital if kind is st.DigitalServo else compiled.pulsed
            found = make(*arguments, float(model.standing_error))
        assert numbers_of(found) == list(numbers_in(model.pack(load))), (kind, changes)


def test_compiled_chip_and_program_have_the_same_numbers():
    for kind, name, recipe, kept in ((st.PulseServo, "hitec-hs-755hb", CHIP, "chip"),
                                     (st.DigitalServo, "feetech-sts3215-12v", PROGRAM, "firmware")):
        for period in (math.nan, 0.014):
            model = kind(st.load_servo(name))
            command = st.signals.constant(1.5e-3, unit="s", frame_period=None if math.isnan(period) else period)
            assert list(kernels(recipe).pack(model.given, period)) == list(getattr(model, kept)(command))
