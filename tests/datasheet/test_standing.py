"""Holding, the smallest move, and heat: by their formulas where there are some."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet import lift_of, thermal_masses
from servotwin.datasheet.holding import hold, smallest_move
from servotwin.datasheet.warming import masses_by_mass, warmed
from servotwin.models import mid_travel
from servotwin.physics.thermal import Temperatures, thermal_time_constants


def mean_servo(servo):
    """Torque per volt, friction, gain and half the deadband of a bounded servo, at the output."""
    N = servo.gear.gear_reduction
    return (N * servo.motor.torque_constant / servo.motor.armature_resistance,
            N * servo.friction.coulomb_torque_forward, servo.electronics.bridge_gain,
            0.5 * servo.electronics.voltage_deadband)


def test_a_mean_servo_gives_way_until_its_voltage_and_friction_hold(servo):
    per_volt, F, gain, half = mean_servo(servo)
    held = hold(st.BoundedServo(servo), 0.7)
    error = (half + (0.7 - F) / per_volt / gain) / servo.potentiometer.feedback_gain
    assert held.error == pytest.approx(error, rel=5e-3)  # it comes to rest a little beyond
    current = (0.7 - F) / (servo.gear.gear_reduction * servo.motor.torque_constant)
    assert held.current == pytest.approx(current, rel=5e-3)
    assert held.heat == pytest.approx(servo.motor.armature_resistance * current**2, rel=1e-2)


def test_pulses_hold_as_their_long_run_does(servo):
    """Set S of the theory page "pulse" sags by 3.99° and 10.47° in the mean of 0.6 to 1.2 s, and creeps on to
    4.36 and 10.66°."""
    change = {"motor.armature_resistance": 3.1, "motor.torque_constant": 1.03 / 280.0,
              "motor.back_emf_constant": 1.03 / 280.0, "motor.rotor_inertia": 6e-3 / 280.0**2,
              "friction.coulomb_torque_forward": 0.2 / 280.0, "friction.coulomb_torque_backward": 0.2 / 280.0,
              "electronics.stretcher_gain": 60.0, "potentiometer.feedback_gain": 573e-6 / 1.35937e-3,
              "electronics.one_shot_slope": 1.35937e-3}
    model = st.PulseServo(servo.replace(change))
    sag = [math.degrees(hold(model, torque).error) for torque in (0.3, 0.6)]
    assert 3.99 < sag[0] < 4.36
    assert 10.47 < sag[1] < 10.66


def test_a_load_beyond_what_it_holds_makes_it_sink(servo):
    model = st.PulseServo(servo)
    assert hold(model, 0.2).stands  # by friction alone
    assert hold(model, 0.2).current == 0.0
    assert not hold(model, 2.5).stands


@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo])
def test_the_smallest_move_is_followed_to_half_and_lies_beyond_what_does_not_start(servo, kind):
    """Half of a step is left where that is half the deadband: the step is the deadband or more.

    A mean servo starts beyond half the deadband and the voltage of friction, and follows to half by twice that.
    """
    model = kind(servo)
    least, start = smallest_move(model), mid_travel(model)

    def left(step):
        command = st.signals.step(start, start + step, at=0.0, unit="rad")
        return start + step - st.simulate(model, command, duration=1.0).at("output_angle", [1.0])[0]

    assert left(1.01 * least) < 0.5 * 1.01 * least
    assert left(0.97 * least) > 0.5 * 0.97 * least
    if kind is st.PulseServo:
        width = least * servo.electronics.one_shot_slope * servo.potentiometer.feedback_gain
        assert servo.electronics.deadband < width < 2.0 * servo.electronics.deadband
    else:
        per_volt, F, gain, half = mean_servo(servo)
        starts = (half + F / per_volt / gain) / servo.potentiometer.feedback_gain
        assert starts < least < 2.0 * starts * 1.001


def test_the_smallest_move_leaves_noise_out(servo):
    noisy = st.PulseServo(servo.replace({"potentiometer.noise": 5e-3}))
    assert smallest_move(noisy) == smallest_move(st.PulseServo(servo))


@pytest.mark.parametrize("name", st.catalog_names())
def test_assumed_time_constants_are_those_of_servos(name):
    masses = thermal_masses(st.load_servo(name))
    if masses is None:
        assert "mass" not in st.load_servo(name).sheet
        return
    times = thermal_time_constants(
        winding_capacity=masses.winding_capacity, housing_capacity=masses.housing_capacity,
        winding_to_housing=masses.winding_to_housing, housing_to_ambient=masses.housing_to_ambient)
    assert masses.assumed
    assert 9.0 < times.fast < 30.0  # s, and min below: as physics has them, 10 to 30 s and 5 to 15 min
    assert 4.9 * 60.0 < times.slow < 15.1 * 60.0


def test_thermal_numbers_of_the_file_count_before_the_mass(servo):
    given = {"winding_capacity": 2.0, "housing_capacity": 30.0, "winding_to_housing": 10.0, "housing_to_ambient": 16.0}
    masses = thermal_masses(servo.replace({f"thermal.{name}": value for name, value in given.items()}))
    assert {name: getattr(masses, name) for name in given} == given
    assert not masses.assumed
    assert masses.magnet_coefficient == 0.0
    hot = masses.with_winding(373.15)
    assert (hot.housing - 298.15) / (hot.winding - hot.housing) == pytest.approx(1.6, rel=1e-12)


@pytest.mark.long
def test_looks_at_the_pulses_warm_as_a_simulation_does(servo):
    """Small masses, so that four seconds tell; a simulation carries its own temperatures along."""
    given = {"winding_capacity": 0.12, "housing_capacity": 0.6, "winding_to_housing": 6.0, "housing_to_ambient": 8.0,
             "magnet_coefficient": -0.002}
    model = st.PulseServo(servo.replace({f"thermal.{name}": value for name, value in given.items()}))
    found = warmed(model, thermal_masses(model.servo), 0.7, duration=4.0)
    result = st.simulate(model, st.signals.constant(90.0, unit="deg"), duration=4.0, load=st.loads.Constant(0.7),
                         output_times=[4.0])
    rise = result["winding_temperature"][0] - 298.15
    assert found.now.winding - 298.15 == pytest.approx(rise, rel=0.05)
    assert found.warm.error > found.cold.error


def test_the_limit_of_the_wire_is_passed_where_the_temperatures_say(servo):
    masses = masses_by_mass(0.01)  # far too small for this motor
    found = warmed(st.PulseServo(servo), masses, 0.8, duration=120.0)
    heat = found.cold.heat
    start = Temperatures(298.15, 298.15)
    assert 0.0 < found.limit_time < 120.0
    first = masses.after(found.limit_time, heat, start)
    if found.limit_time < 12.0:
        assert first.winding == pytest.approx(403.15, rel=1e-9)


def test_a_lift_knows_where_it_ends():
    model = st.PulseServo(st.load_servo("hitec-hs-311"))
    strong, weak = lift_of(model, 0.1, 0.1), lift_of(model, 0.6, 0.1)
    assert strong.lifts
    assert not weak.lifts
    assert weak.torque * math.cos(weak.blocked) == pytest.approx(weak.most_torque, rel=1e-12)
    assert math.isnan(weak.swing.time)
    assert strong.margin == pytest.approx(6.0 * weak.margin, rel=1e-9)
    assert strong.warming.now.winding >= strong.warming.now.housing >= 298.15


@pytest.mark.long
def test_a_hinge_lifts_as_far_as_the_torque_goes():
    """From hanging at full drive the arm comes to rest where the lift says that it ends."""
    servo = st.load_servo("hitec-hs-311").replace({
        "stops.lower_angle": None, "stops.upper_angle": None, "motor.rotor_inertia": 1e-8})
    model = st.PulseServo(servo)
    lift = lift_of(model, 0.6, 0.1)
    hanging = -40.0 * math.pi
    load = st.loads.Pendulum(mass=0.6, length=0.1, inertia=1e-7, hanging_angle=hanging) + st.loads.Viscous(0.5)
    result = st.simulate(model, st.signals.constant(1500.0, unit="us"), duration=8.0, load=load,
                         initial={"output_angle": hanging}, output_times=np.array([8.0]))
    assert result["output_angle"][0] - hanging == pytest.approx(0.5 * math.pi - lift.blocked, abs=0.02)
