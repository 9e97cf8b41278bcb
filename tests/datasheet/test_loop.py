"""The loop of a digital servo at rest: what its program makes of an error, against runs and formulas."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet import FullDrive, Loop
from servotwin.datasheet.holding import hold
from servotwin.errors import InputError

COUNT = 2.0 * math.pi / 4096.0
STS = st.feetech_sts({"P_Coefficient": 16}, servo="feetech-sts3215-12v")
STILL = {"gear.backlash": None, "firmware.derivative_gain": 0.0}  # one stop of a load, whichever way it came
# its bridge resists more at high duty, which the formulas here leave out
XL330 = st.load_servo("dynamixel-xl330-m288").replace({"supply.bridge_drop_resistance": None})
SERVOS = {"feetech": STS, "ax": st.load_servo("dynamixel-ax-12a"), "rc": st.load_servo("towerpro-mg996r"),
          "current": XL330.replace({"firmware.current_limit": 0.2, "firmware.current_sense": "motor"}),
          "bus current": XL330.replace({"firmware.current_limit": 0.2, "firmware.current_sense": "bus"})}


@pytest.mark.parametrize(("P", "zone", "startup", "errors", "duties"), [
    (32, 1, 0, (3, 4, 5, 6, 8, 9), (16, 24, 32, 40, 56, 64)),
    (50, 0, 16, (1, 2, 3), (28, 41, 53)),
    (50, 1, 16, (2, 3, 4), (28, 41, 53)),
    (32, 1, 16, (75, 90, 100), (608, 728, 808)),
])
def test_the_law_at_rest_is_the_published_table_of_the_feetech(P, zone, startup, errors, duties):
    registers = {"P_Coefficient": P, "CW_Dead_Zone": zone, "CCW_Dead_Zone": zone, "Minimum_Startup_Force": startup}
    loop = Loop(st.DigitalServo(st.feetech_sts(registers, servo="feetech-sts3215-12v")))
    for sign in (1.0, -1.0):
        found = [1000.0 * loop.asked(sign * error * COUNT) for error in errors]
        np.testing.assert_allclose(found, sign * np.array(duties), rtol=1e-12)
    assert loop.asked(zone * COUNT) == 0.0


@pytest.mark.parametrize("name", SERVOS)
def test_cap_and_slope_are_the_formulas(name):
    model = st.DigitalServo(SERVOS[name])
    loop, plant = Loop(model), model.pack(st.loads.as_load(None))
    R, K = plant.motor.R, plant.motor.K
    limit = model.servo.get("firmware.current_limit")
    i = (model.most_duty * plant.source.V - model.most_duty * model.value_or("supply.bridge_drop_voltage", 0.0)) / R
    if name == "current":
        i = min(i, limit)
    elif name == "bus current":
        i = min(i, math.sqrt(limit * plant.source.V / R))
    if model.value_or("supply.bridge_drop_voltage", 0.0) == 0.0 or "current" not in name:
        assert loop.cap_torque == pytest.approx(K * i, rel=1e-9)
    assert loop.at(loop.cap_error).motor == pytest.approx(loop.cap_torque, rel=1e-9)
    assert loop.at(loop.cap_error - 2.0 * max(loop.count, 1e-3)).motor < loop.cap_torque
    one, two = 0.4 * loop.cap_error, 0.8 * loop.cap_error
    slope = (loop.at(two).motor - loop.at(one).motor) / (two - one)
    assert slope == pytest.approx(loop.stiffness, rel=0.02)  # of the voltage that the bridge leaves
    torques = loop.over(np.linspace(0.0, 1.1 * loop.cap_error, 60))
    assert (np.diff(torques, axis=1) >= -1e-12).all()
    assert (torques[1] < torques[0]).all()
    assert (torques[2] > torques[0]).all()


@pytest.mark.parametrize("name", ["feetech", "ax", "rc"])
def test_a_load_stands_between_the_two_errors_of_its_droop_and_moves_outside(name):
    free = {"firmware.speed_limit": None, "firmware.acceleration_limit": None}
    model = st.DigitalServo(SERVOS[name].replace(STILL | free))
    loop = Loop(model)
    torque = 0.35 * loop.cap_lifts
    held, lifted = loop.droop(torque)
    goal, margin = st.models.mid_travel(model), 3.0 * loop.count

    def way(error):
        result = st.simulate(model, st.signals.constant(goal, unit="rad"), duration=0.5,
                             load=st.loads.Constant(torque) + st.loads.Inertia(1e-3),
                             initial={"output_angle": goal - error}, output_times=[0.0, 0.5])
        return result["output_angle"][1] - result["output_angle"][0]

    assert lifted > held + 4.0 * margin
    assert abs(way(0.5 * (held + lifted))) < 0.2 * loop.count
    assert way(lifted + margin) > loop.count
    assert way(held - margin) < -loop.count


def test_the_smallest_error_that_moves_is_that_of_a_run():
    model = st.DigitalServo(STS.replace(STILL | {"firmware.speed_limit": None, "firmware.acceleration_limit": None}))
    loop = Loop(model)

    def moves(error):
        result = st.simulate(model, st.signals.constant(error, unit="rad"), duration=0.2,
                             initial={"output_angle": 0.0})
        return bool(np.ptp(result["output_angle"]) > 1e-9)

    counts = round(loop.start_error / COUNT)
    assert moves(counts * COUNT)
    assert not moves((counts - 1) * COUNT)


@pytest.mark.long
def test_the_overload_is_what_a_run_does_when_held_fast():
    free = STS.replace(STILL | {"friction.coulomb_torque_forward": 1e3, "friction.coulomb_torque_backward": 1e3,
                                "firmware.trip_current": None, "firmware.speed_limit": None,
                                "firmware.acceleration_limit": None})
    model = st.DigitalServo(free)
    overload, = (each for each in Loop(model).protections if each.kind == "overload")
    for counts, trips in ((round(overload.error / COUNT), True), (round(overload.error / COUNT) - 1, False)):
        result = st.simulate(model, st.signals.constant(counts * COUNT, unit="rad"), duration=2.5,
                             initial={"output_angle": 0.0})
        assert (result["trip"][-1] == 1.0) == trips
        assert result.remarks[1:] == ((("tripped by overload", pytest.approx(2.0, abs=0.01)), ("stays tripped", 2.5))
                                      if trips else ())
    assert result.remarks[0] == ("cannot hold", 2.5)
    assert overload.left_torque == pytest.approx(Loop(model).motor_torque(0.2), rel=1e-12)
    assert Loop(model).asked(overload.release_error) >= 0.2 > Loop(model).asked(overload.release_error - COUNT)


def test_latches_and_no_protections_are_told():
    latched = st.DigitalServo(STS.replace({"firmware.overload_latches": "yes"}))
    overload = Loop(latched).protections[0]
    assert overload.latches
    assert math.isnan(overload.release_error)
    assert Loop(st.DigitalServo(SERVOS["rc"])).protections == ()
    voltage = Loop(st.DigitalServo(st.load_servo("dynamixel-xl330-m288"))).protections[-1]
    assert (voltage.kind, voltage.threshold) == ("undervoltage", 3.5)


def test_full_drive_is_that_of_the_most_duty():
    # at the most duty of its program a servo is one whose supply is that much smaller
    servo = STS.replace({"supply.bridge_drop_voltage": 0.0, "firmware.duty_limit": 0.5})
    half = FullDrive(st.DigitalServo(servo))
    whole = FullDrive(st.DigitalServo(servo.replace({"firmware.duty_limit": 1.0,
                                                     "supply.open_circuit_voltage": 6.0})))
    assert half.stall_torque == pytest.approx(whole.stall_torque, rel=1e-9)
    assert half.no_load_speed == pytest.approx(whole.no_load_speed, rel=1e-9)
    assert half.stall_current == pytest.approx(0.5 * whole.stall_current, rel=1e-9)
    assert half.bus_voltage(1.0) == pytest.approx(12.0, rel=1e-12)
    run = st.simulate(half.model, st.signals.constant(3.0, unit="rad"), duration=0.9,
                      initial={"output_angle": -2.0}, output_times=[0.8, 0.9])
    assert run["duty"][-1] == 0.5
    assert run["output_speed"][-1] == pytest.approx(half.no_load_speed, rel=1e-6)


@pytest.mark.long
def test_a_load_that_trips_is_not_held():
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    strong = hold(model, 11.5)
    assert (strong.trip, strong.stands) == ("current", False)
    assert hold(model, 1.0).trip == ""


@pytest.mark.parametrize("torque", [-0.1, math.nan, math.inf])
def test_bad_input_is_named(torque):
    with pytest.raises(InputError, match="torque of a droop"):
        Loop(st.DigitalServo(STS)).droop(torque)
    with pytest.raises(InputError, match="model of a loop: got 'PulseServo'"):
        Loop(st.PulseServo(st.load_servo("hitec-hs-755hb")))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["feetech-sts3215-12v", "miuzei-25kg"])
def test_a_sheet_has_the_bandwidth_of_a_program_too(name):
    """It is that of simulated sines; a transfer function it has none."""
    found = st.curves(st.DigitalServo(st.load_servo(name))).voltages[0].bandwidth
    assert any(0.5 < one.frequency < 20.0 for one in found)
