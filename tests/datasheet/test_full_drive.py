"""Speed, current and torque at full drive are those of the paper's formulas, and those that simulations settle at."""

import math
import warnings

import numpy as np
import pytest

import servotwin as st
from servotwin.cli.summary import twin_torque
from servotwin.datasheet import FullDrive
from servotwin.errors import InputError
from servotwin.models import default_model
from servotwin.parameters import printed_points

# Terms of the circuit and of the gear, each alone and all together
TERMS = {
    "plain": {},
    "source": {"supply.internal_resistance": 0.4, "supply.bridge_drop_resistance": 0.2,
               "motor.brush_drop_voltage": 0.3},
    "regulator": {"supply.current_limit": 0.9, "supply.internal_resistance": 0.1},
    "viscous": {"motor.motor_viscous_friction": 2e-7, "friction.coulomb_torque_backward": 2e-3},
    "M3": {"friction.load_friction": 0.12},
    "M4": {"friction.load_friction": 0.1, "friction.load_friction_stribeck": 0.05, "friction.breakaway_ratio": 1.4,
           "friction.stribeck_speed": 40.0},
    "M6": {"friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1,
           "friction.load_friction_motor_stribeck": 0.05, "friction.load_friction_external_quad": 0.1,
           "friction.breakaway_ratio": 1.2, "friction.stribeck_speed": 60.0, "friction.stribeck_exponent": 1.5},
}
TERMS["all"] = {**TERMS["source"], **TERMS["M6"], "supply.current_limit": 1.2, "gear.backlash": 0.02,
                "gear.output_inertia": 1e-3}
ENDLESS = {"stops.lower_angle": None, "stops.upper_angle": None, "motor.rotor_inertia": 1e-8}


def settled(model, torque):
    """Speed and current of a simulation that drives without a pause against a torque."""
    far = {"output_angle": -60.0}  # the one-shot's pulse is at its shortest there, and the error many frames long
    if getattr(model, "frame_period", None) and model.servo.gear.backlash:
        far["motor_angle"] = -60.0 * model.servo.gear.gear_reduction
    result = st.simulate(model, st.signals.constant(2000.0, unit="us"), duration=3.0, initial=far,
                         load=st.loads.Constant(torque), output_times=[3.0 - 1e-9])
    assert result.status.ok
    return result["output_speed"][0], result["armature_current"][0]


@pytest.mark.long(but="M3--0.1")
@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, -0.1])
@pytest.mark.parametrize("terms", TERMS)
def test_simulated_pulses_at_full_drive_settle_at_this_speed_and_current(servo, terms, share):
    model = st.PulseServo(servo.replace({**TERMS[terms], **ENDLESS}))
    drive = FullDrive(model)
    torque = share * drive.stall_torque
    speed, current = settled(model, torque)
    assert drive.speed(torque) == pytest.approx(speed, rel=1e-6)
    assert drive.current(drive.speed(torque)) == pytest.approx(current, rel=1e-6)
    assert drive.torque(drive.speed(torque)) == pytest.approx(max(torque, 0.0), abs=1e-9)


@pytest.mark.parametrize("kind", [st.BoundedServo, st.PulseServoInductive])
def test_the_other_models_with_a_supply_settle_there_too(servo, kind):
    model = kind(servo.replace({**ENDLESS, "motor.armature_inductance": 1e-4}))
    drive = FullDrive(model)
    torque = 0.4 * drive.stall_torque
    speed, current = settled(model, torque)
    assert (drive.speed(torque), drive.current(speed)) == pytest.approx((speed, current), rel=1e-6)


def test_without_load_friction_it_is_the_line_of_the_sheet(servo):
    drive = FullDrive(st.PulseServo(servo))
    R, N = servo.motor.armature_resistance, servo.gear.gear_reduction
    V, K, F = 6.0 - 0.4, N * servo.motor.torque_constant, N * servo.friction.coulomb_torque_forward
    assert drive.stall_current == pytest.approx(V / R, rel=1e-12)
    assert drive.stall_torque == pytest.approx(K * V / R - F, rel=1e-12)
    assert drive.no_load_speed == pytest.approx((V - R * F / K) / K, rel=1e-12)
    assert drive.starting_torque == pytest.approx(drive.stall_torque, rel=1e-12)


@pytest.mark.parametrize("terms", ["plain", "M4", "M6"])
def test_the_stall_torque_is_where_turning_ends(servo, terms):
    model = st.PulseServo(servo.replace({**TERMS[terms], **ENDLESS}))
    drive = FullDrive(model)
    assert drive.speed(1.0001 * drive.stall_torque) == 0.0
    assert settled(model, 0.999 * drive.starting_torque)[0] > 0.0
    below = st.simulate(model, st.signals.constant(2000.0, unit="us"), duration=0.5,
                        initial={"output_angle": -60.0}, load=st.loads.Constant(1.001 * drive.starting_torque))
    assert below["output_angle"].max() == pytest.approx(-60.0, abs=1e-9)


def test_a_swing_of_an_inertia_is_the_first_order_one(servo):
    """J dw/dt = (K²/R)(w_0 − w): the angle is w_0 (t − τ (1 − e^(−t/τ))) with τ = J R/K²."""
    drive = FullDrive(st.PulseServo(servo))
    N, R = servo.gear.gear_reduction, servo.motor.armature_resistance
    K, J = N * servo.motor.torque_constant, N * N * servo.motor.rotor_inertia + 0.01
    tau, w_0 = J * R / K**2, drive.no_load_speed
    turn = drive.swing(st.loads.Inertia(0.01), 0.2, 1.4)
    assert w_0 * (turn.time - tau * (1.0 - math.exp(-turn.time / tau))) == pytest.approx(1.2, rel=1e-9)
    speeds = w_0 * -np.expm1(-np.linspace(0.0, turn.time, 20001) / tau)
    currents = [drive.current(w) for w in speeds.tolist()]
    assert turn.mean_current == pytest.approx(np.trapezoid(currents, dx=1.0 / 20000), rel=1e-7)


def test_a_swing_against_gravity_is_that_of_simulated_pulses(servo):
    free = st.PulseServo(servo.replace(ENDLESS))
    load = st.loads.Pendulum(mass=0.25, length=0.1, hanging_angle=-0.5 * math.pi)  # friction holds it
    start = -math.pi / 6.0 - 20.0 * math.pi  # as many turns lower, so that the error is large all the way
    result = st.simulate(free, st.signals.constant(1500.0, unit="us"), duration=1.2, load=load,
                         initial={"output_angle": start}, output_step=1e-4)
    begun = next(event.time for event in result.events if event.kind == "drive forward")
    passed = np.interp(start + math.pi / 3.0, result["output_angle"], result.time)
    swing = FullDrive(free).swing(load, -math.pi / 6.0, math.pi / 6.0)
    assert swing.time == pytest.approx(passed - begun, rel=1e-5)


def test_what_cannot_lift_does_not_get_there(servo):
    drive = FullDrive(st.PulseServo(servo))
    swing = drive.swing(st.loads.Pendulum(mass=5.0, length=0.1, hanging_angle=-0.5 * math.pi), -0.5, 0.5)
    assert math.isnan(swing.time)


@pytest.mark.parametrize(("kind", "change", "said"), [
    (st.AveragedServo, {}, "a model with a supply"),
    (st.DCMotor, {}, "a model with a supply"),
    (st.PulseServo, {"friction.coulomb_torque_forward": 1.0}, "hitec-hs-755hb does not turn at 6 V"),
])
def test_what_has_no_supply_or_does_not_turn_is_refused(servo, kind, change, said):
    with pytest.raises(InputError, match=said):
        FullDrive(kind(servo.replace(change)))


def test_the_torque_of_lists_is_that_of_full_drive():
    """`servotwin catalog list` has the closed form of the balance that full drive solves."""
    for name in st.catalog_names():
        servo = st.load_servo(name)
        volts = printed_points(servo)[0].supply_voltage
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of digital servos and impossible sheets
            told = {} if volts is None else {"supply.open_circuit_voltage": volts}  # some have no sheet
            drive = FullDrive(default_model(servo.replace(told)))
        assert twin_torque(servo) == pytest.approx(drive.stall_torque, rel=1e-12), name
